"""What the template of the online controller needs: kernels printed from the controller's symbolic functions, and tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ctrlgen._version import __version__
from ctrlgen.controller import BISECTIONS, SLACK, Controller
from ctrlgen.firmware.cprint import Kernel, Real, print_function
from ctrlgen.firmware.templates import comment
from ctrlgen.scenario import Scenario
from ctrlgen.units import base_unit, show

FLOAT_SLACK = 4e-6  # as SLACK of the controller, for float: 0.4 mK, which four roundings of a temperature amount to


def online_context(scenario: Scenario, controller: Controller, real: Real, prefix: str) -> dict[str, Any]:
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
        "prefix": prefix, "real": real, "version": __version__, "title": comment(model.device.title),
        "source": comment(model.device.source),
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


def _number(value: float) -> float | int:
    return round(value) if abs(value - round(value)) < 1e-9 * abs(value) else value


def _si_text(signal: Any) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))


def _limit_text(limit: Any) -> str:
    low = "" if limit.lower is None else f"{show(limit.lower, limit.unit)} <= "
    high = "" if limit.upper is None else f" <= {show(limit.upper, limit.unit)}"
    return f"{low}{limit.label}{high}"
