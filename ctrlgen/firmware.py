"""Model and solution -> a folder of C99: the only writer of C.

`online` controllers (any reachable target -> drives) and `player`s (the solved trajectory as a table), each in
double and in float, with a CMake file and a test of reference vectors. Same input, same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from ctrlgen._version import __version__
from ctrlgen.controller import BISECTIONS, SLACK, Controller, Status
from ctrlgen.cprint import Kernel, Real, print_function
from ctrlgen.files import write_text
from ctrlgen.model import Model
from ctrlgen.scenario import Scenario
from ctrlgen.solution import Solution
from ctrlgen.units import base_unit, show

FLOAT_SLACK = 4e-6  # as SLACK of the controller, for float: 0.4 mK, which four roundings of a temperature amount to
VECTORS = 48  # reference vectors along the command; 16 more lie beyond the limits


def codegen_folder() -> Path:
    """Templates and harness: `codegen/` of the repository, or its copy in an installed package."""
    beside = Path(__file__).resolve().parent.parent / "codegen"
    return beside if beside.is_dir() else Path(__file__).resolve().parent / "_codegen"


@dataclass(frozen=True)
class CFolder:
    """What was generated: `path`, and the names of the pieces in each arithmetic."""

    path: Path
    online: dict[Real, str]
    player: dict[Real, str]
    test: dict[Real, str]
    operations: int
    worst_operations: int


def generate(scenario: Scenario, model: Model, out: Path, solution: Solution | None = None) -> CFolder:
    """Writes the C of `scenario` to `out`; with a `solution` also its player. Raises CtrlgenError."""
    controller = Controller(model, scenario.file.follow, scenario.sample_time)
    online = {real: f"{scenario.name}_online_{real.suffix}" for real in Real}
    player = (
        {real: f"{scenario.name}_player_{real.suffix}" for real in Real} if solution and scenario.sample_time else {}
    )
    cost = (0, 0)
    for real in Real:
        context = _online_context(scenario, controller, real, online[real])
        cost = (context["cost"]["step"], context["cost"]["worst"])
        _render("online.h", context, out / f"{online[real]}.h")
        _render("online.c", context, out / f"{online[real]}.c")
        command = scenario.command(model) if solution is None else solution.command
        _render(
            "test.c",
            context | {"online": online[real]} | _vectors(controller, command, real),
            out / f"test_{scenario.name}_{real.suffix}.c",
        )
        if solution and player:
            _render("player.h", context | _player_context(solution, player[real]), out / f"{player[real]}.h")
            _render("player.c", context | _player_context(solution, player[real]), out / f"{player[real]}.c")
    sources = " ".join(
        f"{scenario.name}_{piece}_${{real}}.c" for piece in ("online", "player") if piece == "online" or player
    )
    _render("CMakeLists.txt", {"name": scenario.name, "sources": sources}, out / "CMakeLists.txt")
    return CFolder(out, online, player, {real: f"test_{scenario.name}_{real.suffix}" for real in Real}, *cost)


def write_harness(folder: CFolder, scenario: Scenario, model: Model, real: Real, path: Path) -> None:
    """The program that `ctrlgen.comparison` builds around one pair of controllers."""
    context = {
        "real": real,
        "online": folder.online[real],
        "player": folder.player.get(real),
        "n": len(model.axes),
        "nx": model.x.numel(),
        "n_s": model.n_states,
        "m": len(model.signals[scenario.file.follow].channels),
        "rate": scenario.sample_time is not None,
    }
    _render("harness.c", context, path)


def _render(template: str, context: dict[str, Any], path: Path) -> None:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(codegen_folder() / "templates"),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    write_text(path, environment.get_template(f"{template}.j2").render(context))


def _online_context(scenario: Scenario, controller: Controller, real: Real, prefix: str) -> dict[str, Any]:
    """Everything the templates of one online controller need."""
    model = controller.nominal
    n = len(model.axes)
    kernels: dict[str, Kernel] = {}  # by body: what settling and stepping share is printed once

    def printed(function: Any, *names: str) -> Kernel:
        """Under the first of `names` that no other body has."""
        taken = {kernel.name for kernel in kernels.values()}
        kernel = print_function(function, names[0], real)
        body = kernel.text.partition("(")[2]
        if body not in kernels and kernel.name in taken:
            kernel = print_function(function, names[-1], real)
        return kernels.setdefault(body, kernel)

    modes = []
    for name, inverse, z in (
        ("settle", controller.static, "out->displacement"),
        ("step", controller.moving, "state->z"),
    ):
        if inverse is not None:
            parts = {
                part: printed(getattr(inverse, part), f"wanted_{part}", f"{name}_{part}")
                for part in ("displacement", "state", "drive", "advance")
                if getattr(inverse, part).size1_out(0)
            }
            uses_state = any({"x", "z"} & set(parts[part].arguments) for part in ("state", "drive") if part in parts)
            modes.append({"name": name, "z": z, "uses_state": uses_state, **parts})
    balance = printed(controller.static.settle, "balance_displacement")
    ratio = None
    if controller.guarded_limits:
        ratio = printed(controller.composite_ratio, "composite_ratio")
    (z_low, z_high), (x_low, x_high), (u_low, u_high) = model.z_bounds, model.x_bounds, model.u_bounds
    slack = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    z_slack, s_slack, u_slack = slack.slacks
    drive, follow = model.signals["drive"], model.signals[scenario.file.follow]
    last = modes[-1]
    step_cost = sum(last[part].operations for part in ("displacement", "state", "drive", "advance") if part in last)
    once_more = sum(last[part].operations for part in ("state", "drive") if part in last)
    worst_cost = (
        step_cost
        + 2 * balance.operations
        + (controller.shrinks * ratio.operations if ratio else 0)
        + once_more * (BISECTIONS + 2)
    )
    return {
        "prefix": prefix, "real": real, "version": __version__, "title": _comment(model.device.title),
        "source": _comment(model.device.source),
        "digest": scenario.digest, "n": n, "m": len(follow.channels), "axes": model.axes, "follow": follow, "drive": drive,
        "drive_unit": drive.units[0], "state": model.signals.get("state"), "n_s": model.n_states,
        "rate": _number(1 / controller.sample_time) if controller.sample_time else None,
        "si": _si_text, "limits": [_limit_text(limit) for limit in model.limits],
        "composite": ", ".join(limit.label for limit in controller.guarded_limits) or "none",
        
        "x_names": [f"{name} [{unit}]" for name, unit in zip(model.x_names, model.x_units, strict=True)],
        
        "kernels": list(kernels.values()), "modes": modes, "ratio": ratio,
        "balance": balance, "bisections": BISECTIONS, "shrinks": controller.shrinks,
        "ratio_uses_state": bool(ratio) and bool({"x", "z"} & set(ratio.arguments)), "safe": controller.safe_displacement if ratio else 0.0,
        "relative_slack": FLOAT_SLACK if real is Real.FLOAT else SLACK, "cost": {"step": step_cost, "worst": worst_cost},
        "input_limits": controller.input_limits, "rest": model.rest,
        "z_low": z_low, "z_high": z_high, "z_slack": z_slack, 
        "s_low": x_low[: model.n_states], "s_high": x_high[: model.n_states], "s_slack": s_slack,
        "u_low": u_low, "u_high": u_high, "u_slack": u_slack,
        "u_safe": controller.safe_drive,
    }  # fmt: skip


def _player_context(solution: Solution, prefix: str) -> dict[str, Any]:
    return {
        "prefix": prefix,
        "title": _comment(solution.scenario.file.title),
        "samples": len(solution.drive),
        "closed": solution.scenario.closed,
        "table": solution.drive,
        "rate": 1 / (solution.scenario.sample_time or 1.0),
    }


def _vectors(controller: Controller, command: np.ndarray, real: Real) -> dict[str, Any]:
    """Targets and the drives and status the reference answers, and what rounding may change.

    The tolerance is the change of drive that four roundings of what it follows from cause.
    """
    controller = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    rng = np.random.default_rng(0)
    scale = np.array(controller.model.signals[controller.follow].scale)
    beyond = rng.normal(size=(16, command.shape[1])) * 40 * scale
    targets = [*command[:VECTORS], *beyond, np.full(command.shape[1], 1e9)]
    vectors, tolerance, state = [], 0.0, controller.rest()
    rounding = 4 * (np.finfo(np.float32).eps if real is Real.FLOAT else np.finfo(np.float64).eps)
    for k, target in enumerate(targets):
        target = np.array(target, dtype=np.float32).astype(float) if real is Real.FLOAT else target
        settle = k == 0 or k >= len(targets) - len(beyond) - 1 or controller.moving is None
        before, step = state, controller.step(state, target, settle=settle)
        state = step.state
        exact = (
            not step.status & Status.DRIVE
        )  # a bisection may turn the other way in float: only its status is compared
        vectors.append(
            {"target": target, "drive": step.drive, "status": int(step.status), "settle": settle, "exact": exact}
        )
        if exact and not step.status & Status.INPUT:
            kernel = (controller.static if settle or controller.moving is None else controller.moving).drive
            reached = (step.displacement, step.actuator_state)
            off = kernel(*before, *(value * (1 + rounding) for value in reached)) - kernel(*before, *reached)
            tolerance = max(tolerance, float(np.max(np.abs(off.full()))))
    tolerance = max(tolerance, 1e-12 * float(np.max(controller.nominal.u_scale)))
    return {"vectors": vectors, "tolerance": tolerance}


def _comment(text: str) -> str:
    """`text` as it may stand inside a C comment, on one line."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")


def _number(value: float) -> float | int:
    return round(value) if abs(value - round(value)) < 1e-9 * abs(value) else value


def _si_text(signal: Any) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))


def _limit_text(limit: Any) -> str:
    low = "" if limit.lower is None else f"{show(limit.lower, limit.unit)} <= "
    high = "" if limit.upper is None else f" <= {show(limit.upper, limit.unit)}"
    return f"{low}{limit.label}{high}"
