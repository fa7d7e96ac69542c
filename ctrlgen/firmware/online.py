"""The context of the feedforward controller's template: C functions printed from the symbolic kernels, and tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ctrlgen.core.units import base_unit, show
from ctrlgen.firmware.cprint import Kernel, Real, print_function
from ctrlgen.firmware.elementary import elementary_text
from ctrlgen.firmware.templates import comment
from ctrlgen.model.feedforward import SECANT_FRACTION, SECANT_STEPS, Controller
from ctrlgen.model.lost_state import FAR
from ctrlgen.model.motion_feedforward import MotionController
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.version import __version__, program

FLOAT_SLACK = 4e-6  # as SLACK of the controller, in float: four roundings of a temperature, 0.4 mK
READY = 0xA500A500  # marks an initialised state: an immediate operand of a Cortex-M, and no repeated byte, as memory set to one value has
UNLIMITED = 1e18  # SI: written for the bound of an actuator state that has none beside one that has; its square is still a float


def online_context(scenario: Scenario, controller: Controller, real: Real, prefix: str) -> dict[str, Any]:
    """The context of online.c.j2 and online.h.j2."""
    model = controller.nominal
    n = len(model.axes)
    kernels: dict[str, Kernel] = {}  # by body, so that a function shared by settle and step is printed once

    (z_low, z_high), (x_low, x_high), (u_low, u_high) = model.z_bounds, model.x_bounds, model.u_bounds
    s_low, s_high = np.maximum(x_low[: model.n_states], -UNLIMITED), np.minimum(x_high[: model.n_states], UNLIMITED)
    ranges = {  # of the kernels' arguments; a target has none
        "z": model.z_bounds, "wanted": model.z_bounds, "x": model.x_bounds, "state": (s_low, s_high), "drive": model.u_bounds,
    }  # fmt: skip

    def printed(function: Any, *names: str) -> Kernel:
        """`function` as C, named by the first of `names` that no other body has."""
        taken = {kernel.name for kernel in kernels.values()}
        kernel = print_function(function, names[0], real, ranges)
        body = kernel.text.partition("(")[2]
        if body not in kernels and kernel.name in taken:
            kernel = print_function(function, names[-1], real, ranges)
        return kernels.setdefault(body, kernel)

    modes: list[dict[str, Any]] = []
    for name, inverse, z in (
        ("settle", controller.static, "out->displacement"),
        ("step", controller.moving, "state->z"),
    ):
        if inverse is not None:
            named = {
                kernel: printed(getattr(inverse, kernel), f"wanted_{kernel}", f"{name}_{kernel}")
                for kernel in ("displacement", "state", "drive", "advance")
                if getattr(inverse, kernel).size1_out(0)
            }
            uses_state = any(
                {"x", "z"} & set(named[kernel].arguments) for kernel in ("state", "drive") if kernel in named
            )
            modes.append({
                "name": name, "z": z, "uses_state": uses_state,
                "examined_first": controller.examined_first[name == "step"],
                "drive_can_be_limited": controller.drive_can_be_limited[name == "step"], **named,
            })  # fmt: skip
    motion = {}
    if isinstance(controller, MotionController):
        motion = {name: printed(kernel, f"motion_{name}") for name, kernel in controller.motion.items()}
    balance = printed(controller.static.settle, "balance_displacement")
    ratio = printed(controller.composite_ratio, "composite_ratio") if controller.guarded_limits else None
    nearest = printed(controller.nearest, "nearest_displacement")
    bound = printed(controller.composite_bound, "composite_bound") if controller.composite_bound else None
    slack = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    z_slack, s_slack, u_slack = slack.slacks
    drive, follow = model.signals["drive"], controller.target
    last = modes[-1]
    advance = [] if model.x.numel() == model.n_states else ["advance"]
    step_cost = sum(
        last[kernel].operations for kernel in ("displacement", "state", "drive", *advance) if kernel in last
    )
    step_cost += bound.operations if bound else 0
    once_more = sum(last[kernel].operations for kernel in ("state", "drive") if kernel in last)
    worst_cost = (
        step_cost
        + nearest.operations
        + (2 if controller.state_can_be_limited else 1) * balance.operations
        + (controller.composite_rounds * ratio.operations if ratio else 0)
        + (last["advance"].operations if "advance" in last and not advance else 0)
        + once_more * ((SECANT_STEPS + 3) if last["drive_can_be_limited"] else 1)
    )
    if motion:  # what breaks a limit is answered by settling
        step_cost = sum(kernel.operations for kernel in motion.values())
        worst_cost += step_cost
    called = frozenset().union(*(kernel.calls for kernel in kernels.values()))
    (z_centre, z_half), (s_centre, s_half), (u_centre, u_half) = (
        _middles(low, high, real) for low, high in ((z_low, z_high), (s_low, s_high), (u_low, u_high))
    )
    return {
        "prefix": prefix, "real": real, "version": __version__, "program": program(), "title": comment(model.device.title),
        "source": comment(model.device.source),
        "device_sha256": scenario.device_sha256, "n": n, "m": len(follow.channels), "axes": model.axes, "follow": follow, "drive": drive,
        "drive_unit": drive.units[0], "state": model.signals.get("state"), "n_s": model.n_states,
        "rate": _number(1 / controller.sample_time) if controller.sample_time else None,
        "si": _si_text, "limits": [_limit_text(limit) for limit in model.limits],
        "composite": ", ".join(limit.label for limit in controller.guarded_limits) or "none",
        "x_names": [f"{name} [{unit}]" for name, unit in zip(model.x_names, model.x_units, strict=True)],
        "elementary": elementary_text(called, real), "bound": bound, "nearest": nearest,
        "kernels": list(kernels.values()), "modes": modes, "motion": motion, "ratio": ratio,
        "balance": balance, "secant_steps": SECANT_STEPS, "secant_fraction": SECANT_FRACTION,
        "composite_rounds": controller.composite_rounds,
        "ratio_uses_state": ratio is not None and bool({"x", "z"} & set(ratio.arguments)), "state_limited": controller.state_can_be_limited,
        "relative_slack": FLOAT_SLACK if real is Real.FLOAT else controller.slack, "cost": {"step": step_cost, "worst": worst_cost},
        "input_limits": controller.input_limits,
        "plausible": [([_member(i, model.x.numel()) for i in those], most) for those, most in controller.plausible],
        "rest": model.rest,
        "z_low": z_low, "z_high": z_high, "z_slack": z_slack, "z_centre": z_centre, "z_half": z_half,
        "s_low": s_low, "s_high": s_high, "s_slack": s_slack, "s_centre": s_centre, "s_half": s_half,
        "u_low": u_low, "u_high": u_high, "u_slack": u_slack, "u_centre": u_centre, "u_half": u_half,
        "u_safe": controller.safe_drive, "ready": READY, "far": FAR,
    }  # fmt: skip


def _member(i: int, x_count: int) -> str:
    """Number `i` of x and then z in the C's state."""
    return f"state->x[{i}]" if i < x_count else f"state->z[{i - x_count}]"


def _middles(low: np.ndarray, high: np.ndarray, real: Real) -> tuple[np.ndarray, np.ndarray]:
    """Middle and half width of ranges; the width is four roundings smaller, so that the test with it is on the safe side."""
    centre, half = (low + high) / 2, (high - low) / 2
    return centre, np.maximum(half - 4 * real.epsilon * (np.abs(centre) + half), 0.0)


def _number(value: float) -> float | int:
    return round(value) if abs(value - round(value)) < 1e-9 * abs(value) else value


def _si_text(signal: Any) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))


def _limit_text(limit: Any) -> str:
    low = "" if limit.lower is None else f"{show(limit.lower, limit.unit)} <= "
    high = "" if limit.upper is None else f" <= {show(limit.upper, limit.unit)}"
    return f"{low}{limit.label}{high}"
