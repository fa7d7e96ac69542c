"""The context of the feedforward controller's template: C functions printed from the symbolic kernels, and tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.feedforward import SECANT_FRACTION, SECANT_STEPS, Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.lost_state import FAR
from ctrlgen.controller.motion_feedforward import MotionKernels
from ctrlgen.controller.nearest_displacement import SWEEPS
from ctrlgen.controller.run_time_check import check_run_time
from ctrlgen.core.units import base_unit, show, show_difference
from ctrlgen.devices import Limit
from ctrlgen.firmware.c.c_constants import DERIVED
from ctrlgen.firmware.c.cprint import Kernel, Law, Printer
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import comment
from ctrlgen.firmware.online.start_constants import Tables, given_ranges, start_calls, start_context
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.version import __version__, program

FLOAT_SLACK = 4e-6  # as SLACK of the controller, in float: four roundings of a temperature, 0.4 mK
READY = 0xA500A500  # marks an initialised state: an immediate operand of a Cortex-M, and no repeated byte, as memory set to one value has
UNLIMITED = 1e18  # SI: written for the bound of an actuator state that has none beside one that has; its square is still a float


def online_context(scenario: Scenario, controller: Controller, real: Real, prefix: str) -> dict[str, Any]:
    """The context of online.c.j2 and online.h.j2."""
    kernels = controller.kernels
    check_run_time(kernels)
    model = kernels.nominal
    n = len(model.axes)
    (z_low, z_high), (x_low, x_high), (u_low, u_high) = model.z_bounds, model.x_bounds, model.u_bounds
    s_low, s_high = np.maximum(x_low[: model.n_states], -UNLIMITED), np.minimum(x_high[: model.n_states], UNLIMITED)
    x_range, u_range = (
        (np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0))
        for ends in zip(*((c.nominal.x_bounds, c.nominal.u_bounds) for c in (kernels, *kernels.variants)), strict=True)
    )
    s_range = (
        np.maximum(x_range[0][: model.n_states], -UNLIMITED),
        np.minimum(x_range[1][: model.n_states], UNLIMITED),
    )
    ranges = {  # of the kernels' arguments; a target has none
        "z": model.z_bounds, "wanted": model.z_bounds, "x": x_range, "state": s_range, "drive": u_range,
    }  # fmt: skip
    inverses, given = kernels.named, given_ranges(kernels)
    own = kernels.given  # kernels in terms of the constants of the start, where there are some
    static, moving = (own.static or kernels.static, own.moving) if own else (kernels.static, kernels.moving)
    laws = printed_laws(own.model if own else model, inverses.model)
    printer = Printer(
        real, ranges, {"p": inverses.numbers}, laws, given, {"p": own.numbers} if own else {}, f"{prefix}_derived"
    )
    printed = _Kernels(printer, kernel_comments(kernels))

    modes: list[dict[str, Any]] = []
    for name, inverse, formulas, z in (
        ("settle", static, inverses.static, "out->displacement"),
        ("step", moving, inverses.moving, "state->z"),
    ):
        if inverse is not None:
            named = {
                part: printed.kernel(
                    getattr(inverse, part),
                    (name, part),
                    (f"wanted_{part}", f"{name}_{part}"),
                    named=None if formulas is None else getattr(formulas, part),
                )
                for part in ("displacement", "state", "drive", "advance")
                if getattr(inverse, part).size1_out(0)
            }
            uses_state = any(
                {"x", "z", DERIVED} & set(named[part].arguments) for part in ("state", "drive") if part in named
            )
            modes.append({
                "name": name, "z": z, "uses_state": uses_state,
                "examined_first": kernels.examined_first[name == "step"],
                "drive_can_be_limited": controller.drive_can_be_limited[name == "step"], **named,
            })  # fmt: skip
    motion = {}
    if isinstance(kernels, MotionKernels):
        motion = {
            part: printed.kernel(kernel, ("motion", part), (f"motion_{part}",))
            for part, kernel in kernels.motion.items()
        }
    iterated = ("z", kernels.newton_steps) if kernels.newton_steps > 1 else None
    balance = printed.kernel(
        static.newton, "balance", ("balance_displacement",), steps=iterated,
        named=None if inverses.static is None else inverses.static.newton,
    )  # fmt: skip
    shares = bound = None
    if kernels.guarded_limits:
        shares = printed.kernel(kernels.composite_shares, "shares", ("composite_shares",))
    if kernels.composite_bound:
        bound = printed.kernel(kernels.composite_bound, "bound", ("composite_bound",), returned=True)
    z_slack, s_slack, u_slack = kernels.slacks(controller.slack if real is Real.DOUBLE else FLOAT_SLACK)
    drive, follow = model.signals["drive"], kernels.target
    limited = _limits_in_c(controller, printer, real, u_slack)
    start = start_context(kernels, printer)
    called = printed.calls | ({"square_root"} if shares else set()) | set(start_calls(start))
    return {
        "prefix": prefix, "real": real, "version": __version__, "program": program(), "title": comment(model.device.title),
        "source": comment(model.device.source),
        "device_sha256": scenario.device_sha256, "n": n, "nu": len(drive.channels), "m": len(follow.channels),
        "axes": model.axes, "follow": follow, "drive": drive,
        "drive_unit": drive.units[0], "state": model.signals.get("state"), "n_s": model.n_states,
        "rate": _number(1 / kernels.sample_time) if kernels.sample_time else None,
        "si": _si_text, "limits": [_limit_text(limit) for limit in (*model.limits, *(model.rate_limits if controller.rate else ()))],
        "reserved_for": None if model.probability is None else f"{100 * model.probability:.10g} % along {scenario.name}",
        "composite": ", ".join(limit.label for limit in kernels.guarded_limits) or "none",
        "x_names": [f"{name} [{unit}]" for name, unit in zip(model.x_names, model.x_units, strict=True)],
        "elementary": elementary_text(called, real), "bound": bound, "nearest_slopes": kernels.nearest_slopes, "sweeps": SWEEPS,
        "constants": printer.constants, "laws": printer.laws_text, "kernels": printed.kernels,
        "modes": modes, "motion": motion, "shares": shares,
        "shares_count": kernels.composite_shares.size1_out(0) if shares else 0,
        "balance": balance, "secant_steps": SECANT_STEPS, "secant_fraction": SECANT_FRACTION,
        "composite_rounds": kernels.composite_rounds,
        "shares_use_state": shares is not None and bool({"x", "z"} & set(shares.arguments)),
        "state_limited": controller.state_can_be_limited,
        "relative_slack": FLOAT_SLACK if real is Real.FLOAT else controller.slack,
        "cost": _cost(controller, modes[-1], motion, balance, bound, shares),
        "input_limits": kernels.input_limits,
        "plausible": [([_member(i, model) for i in those], most) for those, most in controller.plausible],
        "rest": model.rest,
        "z_low": z_low, "z_high": z_high, "z_slack": z_slack,
        "s_low": s_low, "s_high": s_high, "s_slack": s_slack,
        "u_low": u_low, "u_high": u_high, "u_slack": u_slack,
        "u_safe": kernels.safe_drive, "ready": READY, "far": FAR, **limited, **start, **rates_in_c(controller),
        "redundancy": kernels.redundancy, "unlimited": UNLIMITED,
    }  # fmt: skip


@dataclass
class _Kernels:
    """The kernels of one file; one that several modes share is printed once."""

    printer: Printer
    comments: Mapping[Any, str]

    def __post_init__(self) -> None:
        self._by_body: dict[str, Kernel] = {}

    def kernel(
        self,
        function: Any,
        what: Any,
        names: tuple[str, ...],
        steps: tuple[str, int] | None = None,
        returned: bool = False,
        named: Any = None,
    ) -> Kernel:
        """`function` as C, named by the first of `names` that no other body has."""
        may_be_result = {"advance": ["x"], "balance": ["z"]}.get(what if what == "balance" else what[-1], [])
        taken = {kernel.name for kernel in self._by_body.values()}
        kernel = self.printer.kernel(function, names[0], self.comments[what], may_be_result, steps, returned, named)
        if kernel.body not in self._by_body and kernel.name in taken:
            kernel = self.printer.kernel(
                function, names[-1], self.comments[what], may_be_result, steps, returned, named
            )
        return self._by_body.setdefault(kernel.body, kernel)

    @property
    def kernels(self) -> list[Kernel]:
        """In the order in which they were printed."""
        return list(self._by_body.values())

    @property
    def calls(self) -> frozenset[str]:
        """The elementary functions that they call."""
        return frozenset().union(*(kernel.calls for kernel in self.kernels))


def printed_laws(model: Model, symbolic: Model) -> list[Law]:
    """The named parts of a model's physics for `Printer`, with the equations and sources of their docstrings; `symbolic` is the same
    model with its numbers as parameters."""
    found = []
    for law, named in zip(model.laws, symbolic.laws, strict=True):
        stated = " ".join(" ".join((function.__doc__ or "").split()) for function in law.documented)
        about = f"{law.label[0].upper()}{law.label[1:]}" + (f": {stated}" if stated else ".")
        functions = [
            ca.Function(
                law.name, [m.x, m.z, m.u, *([m.p] if more else [])], [part.expr], ["x", "z", "drive", *more], ["force"]
            )
            for m, part, more in ((model, law, ("p",) if model.p.numel() else ()), (symbolic, named, ("p",)))
        ]
        found.append(Law(law.name, about, *functions))
    return found


def kernel_comments(kernels: ControllerKernels) -> dict[Any, str]:
    """What each kernel computes, in words, by mode and part or by name."""
    m, follow, drive = (
        kernels.nominal,
        kernels.model.signals[kernels.follow],
        kernels.nominal.signals["drive"],
    )
    state, within = m.signals.get("state"), f"one sample of {kernels.sample_time} s"
    holds = f"the {state.label}s `state`" if state and m.n_states else "the displacement `wanted`"
    states = ", ".join(f"{name} [{unit}]" for name, unit in zip(m.x_names, m.x_units, strict=True))
    steps = "the step" if kernels.newton_steps == 1 else f"{kernels.newton_steps} Newton steps"
    found: dict[Any, str] = {
        "balance": f"Displacement at which the forces balance, g(x, z, drive) = 0: {steps} z - g/(dg/dz) from z.",
        "shares": f"The square of each {', '.join(limit.label for limit in kernels.guarded_limits)} over its limit at displacement "
        "`wanted`.",
        "bound": "A cheap upper bound of the root of the largest of these shares: no more than 1 means that every limit is kept.",
    }
    for mode in ("settle", "step", "motion"):
        after = {"settle": "at rest", "step": within + " later", "motion": "during the motion that `target` says"}[mode]
        found |= {
            (mode, "displacement"): f"Displacement at which the {follow.label} is `target`, {_si_text(follow)}.",
            (mode, "state"): f"States that the displacement needs {after}: {states}.",
            (mode, "drive"): {
                "settle": f"{drive.label.capitalize()} that keeps {holds} at rest.",
                "step": f"{drive.label.capitalize()} that leads from x to {holds} within {within}.",
                "motion": f"{drive.label.capitalize()} of the motion that `target` says.",
            }[mode],
            (mode, "advance"): f"States under `drive`, {after}: {states}.",
        }
    return found


def _cost(
    controller: Controller, mode: dict[str, Any], motion: dict[str, Kernel], balance: Kernel, bound: Kernel | None,
    shares: Kernel | None,
) -> dict[str, int]:  # fmt: skip
    """Operations of the physics: of a "step" that no limit touches, and of the "worst"."""
    kernels = controller.kernels
    n = len(kernels.nominal.axes)
    advance = [] if kernels.nominal.x.numel() == kernels.nominal.n_states else ["advance"]
    step = sum(mode[part].operations for part in ("displacement", "state", "drive", *advance) if part in mode)
    step += bound.operations if bound else 0
    if motion:  # what breaks a limit is answered by settling
        step = sum(kernel.operations for kernel in motion.values())
    again = sum(mode[part].operations for part in ("state", "drive") if part in mode)
    worst = step + (2 if controller.state_can_be_limited else 1) * balance.operations
    worst += again * (SECANT_STEPS + 3 if mode["drive_can_be_limited"] else 1)
    worst += kernels.composite_rounds * (shares.operations + 1) if shares else 0
    worst += mode["advance"].operations if "advance" in mode and not advance else 0
    worst += 2 * n * n * (1 + SWEEPS) if kernels.nearest_slopes is not None else 0
    if kernels.limits_can_be_passed:
        worst += kernels.composite_rounds * (shares.operations + 1) if shares else 0
        worst += bound.operations if bound else 0
    return {"step": step, "worst": worst}


def rates_in_c(controller: Controller) -> dict[str, Any]:
    """What the C needs to keep limits on the rates of drives."""
    if (rate := controller.rate) is None:
        return {"rated": False, "passing": False}
    return {"rated": True, "passing": controller.kernels.limits_can_be_passed, "fall": rate.fall, "rise": rate.rise}


def _member(i: int, model: Model) -> str:
    """Number `i` of x, then z, then the last drive in the C's state."""
    for name, count in (("x", model.x.numel()), ("z", len(model.axes))):
        if i < count:
            return f"state->{name}[{i}]"
        i -= count
    return f"state->u[{i}]"


def _middles(low: np.ndarray, high: np.ndarray, real: Real) -> tuple[np.ndarray, np.ndarray]:
    """Middle and squared half width of ranges; the width is four roundings smaller, so that the test with it is on the safe side."""
    centre, half = (low + high) / 2, (high - low) / 2
    return centre, np.maximum(half - 4 * real.epsilon * (np.abs(centre) + half), 0.0) ** 2


def _middle_formulas(low: ca.SX, high: ca.SX, real: Real) -> tuple[ca.SX, ca.SX]:
    """The same of formulas."""
    centre, half = (low + high) / 2, (high - low) / 2
    return centre, ca.fmax(half - 4 * real.epsilon * (ca.fabs(centre) + half), 0.0) ** 2


def _u_bounds(m: Model) -> tuple[ca.SX, ca.SX]:
    return m.bounds_formula(m.u)


def _s_bounds(m: Model) -> tuple[ca.SX, ca.SX]:
    """Of the actuators' states, where they have limits."""
    low, high = m.bounds_formula(m.x[: m.n_states])
    return ca.fmax(low, -UNLIMITED), ca.fmin(high, UNLIMITED)


def _limits_in_c(controller: Controller, printer: Printer, real: Real, u_slack: np.ndarray) -> dict[str, Any]:
    """Middles and squared half widths as C, by "z_middle", ..., and where each table of limits is found, by its name in "arrays"."""
    model, tables, limited = (
        controller.kernels.nominal,
        Tables(controller.kernels, printer),
        any(controller.drive_can_be_limited),
    )
    (u_low, u_high), n_s = model.u_bounds, model.n_states
    s_low, s_high = np.maximum(model.x_bounds[0][:n_s], -UNLIMITED), np.minimum(model.x_bounds[1][:n_s], UNLIMITED)
    arrays = {
        "U_LOW": tables.array("U_LOW", lambda m: _u_bounds(m)[0], u_low),
        "U_HIGH": tables.array("U_HIGH", lambda m: _u_bounds(m)[1], u_high),
        "U_LEAST": "U_LEAST", "U_MOST": "U_MOST",
    }  # fmt: skip
    if limited:
        arrays |= {
            "U_LEAST": tables.array("U_LEAST", lambda m: _u_bounds(m)[0] - ca.DM(u_slack), u_low - u_slack),
            "U_MOST": tables.array("U_MOST", lambda m: _u_bounds(m)[1] + ca.DM(u_slack), u_high + u_slack),
        }
    middles = {
        "z_middle": [[real.literal(v) if v else "" for v in row] for row in _middles(*model.z_bounds, real)],
        "u_middle": _middle_texts(tables, _u_bounds, u_low, u_high, real), "s_middle": [],
    }  # fmt: skip
    if controller.state_can_be_limited:
        arrays |= {
            "S_LOW": tables.array("S_LOW", lambda m: _s_bounds(m)[0], s_low),
            "S_HIGH": tables.array("S_HIGH", lambda m: _s_bounds(m)[1], s_high),
        }
        middles["s_middle"] = _middle_texts(tables, _s_bounds, s_low, s_high, real)
    rest = tables.each("X_REST", lambda m: m.rest_formula, model.rest)
    return {"arrays": arrays, "rest_given": rest, **middles}


def _middle_texts(
    tables: Tables, bounds: Callable[[Model], tuple[ca.SX, ca.SX]], low: np.ndarray, high: np.ndarray, real: Real
) -> list[list[str]]:
    centre, square = _middles(low, high, real)
    return [
        tables.texts(lambda m: _middle_formulas(*bounds(m), real)[0], centre),
        tables.texts(lambda m: _middle_formulas(*bounds(m), real)[1], square),
    ]


def _number(value: float) -> float | int:
    return round(value) if abs(value - round(value)) < 1e-9 * abs(value) else value


def _si_text(signal: Any) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))


def _limit_text(limit: Limit) -> str:
    sides = [(bound, by) for bound, by in zip((limit.lower, limit.upper), limit.reserve, strict=True) if by]
    reserved = [
        f"{show(limit.described(bound), limit.unit)} less {show_difference(by, limit.unit)}"
        for bound, by in sides
        if bound is not None
    ]
    return limit.text + (f" ({'; '.join(reserved)} reserved)" if reserved else "")
