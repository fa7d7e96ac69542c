"""The context of the templates of the feedforward controller: what its C and its header are printed from."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ctrlgen.controller.contraction import FOREVER, KNOWN
from ctrlgen.controller.estimate import EXACT
from ctrlgen.controller.feedforward import SECANT_STEPS, Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.lost_state import FAR
from ctrlgen.controller.nearest_displacement import SWEEPS
from ctrlgen.controller.ringing import STILL, TOLD
from ctrlgen.controller.run_time_check import check_run_time
from ctrlgen.core.units import common_base_unit, show, show_difference
from ctrlgen.devices import Limit
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import ABI, hertz
from ctrlgen.firmware.online.limit_tables import limit_context
from ctrlgen.firmware.online.limiter import bounds_once, limited_modes, limiter_macros, limiter_text
from ctrlgen.firmware.online.printed_kernels import PrintedKernels, kernel_printer, printed_kernels, si_text
from ctrlgen.firmware.online.start_constants import start_calls, start_context
from ctrlgen.firmware.online.stated_pivot import pivot_context
from ctrlgen.model.discretisation import SETTLING_SWEEPS
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.version import __version__, program

WORDS = ("ready",)  # integers of a controller's state, in the order of its structure
CLOCK_WORDS = ("ticking", "tick")  # of one that is told what time it is (step_at.c)
ESTIMATE_WORDS = ("unsure", *CLOCK_WORDS)  # of one whose state can be wrong (estimate.c)

TIME_WORDS = ("stepping",)  # of one whose sample times vary (timed.c)
FILLING = (
    "unused",
)  # behind an odd number of words beside doubles: a structure without padding, whose bytes are all written


def online_context(scenario: Scenario, controller: Controller, real: Real, prefix: str) -> dict[str, Any]:
    """The context of online.c.j2 and online.h.j2."""
    kernels = controller.kernels
    check_run_time(kernels)
    printer = kernel_printer(kernels, real, prefix)
    printed = printed_kernels(controller, printer)
    limits = limit_context(controller, printer)
    start = start_context(kernels, printer)
    pivot = pivot_context(kernels, printer)
    context = (
        header_context(scenario, controller)
        | build_of(scenario, controller, real.value)
        | limits
        | start
        | {
            "prefix": prefix,
            "real": real,
            "cost": _cost(controller, printed),
            "kernels": printed.every,
            "modes": printed.modes,
            "motion": printed.motion,
            "pivot": pivot,
            "balance": printed.balance,
            "reached": printed.reached,
            "own_drives": kernels.own_drives,
            "shares": printed.shares,
            "few": printed.few,
            "bound": printed.bound,
            "target_bound": printed.target_bound,
            # derivatives of a motion's target tell nothing of the displacement: they are examined first
            "direct": kernels.target_directions is not None and not printed.motion,
            "shares_count": kernels.composite_shares.size1_out(0) if printed.shares else 0,
            "few_count": kernels.few_shares.function.size1_in(0) if kernels.few_shares else 0,
            "composite_rounds": kernels.composite_rounds,
            "nearest_slopes": kernels.nearest_slopes,
            "redundancy": kernels.redundancy,
            "state_limited": controller.state_can_be_limited,
            "rest": kernels.nominal.rest,
            "far": FAR,
            "estimated": kernels.contraction,
            "ringing": kernels.ringing,
            # of modes that are led nobody measures the amplitudes
            "observed": kernels.can_be_observed,
            "words": _words(kernels, real),
            "forever": FOREVER,
            "share_known": KNOWN,
            "share_still": STILL,
            "told": TOLD,
            "exact": EXACT,
            "sample_time": kernels.sample_time,
            "times": kernels.times,
        }
    )
    called = printed.calls | ({"square_root"} if printed.shares else set()) | set(start_calls(start))
    others = [
        kernel
        for kernel in (start["derive"], start["changing"] and start["changing"]["kernel"], pivot and pivot["kernel"])
        if kernel
    ]
    texts = [elementary_text(called, real), printer.constants, printer.laws_text]
    texts += [kernel.text for kernel in (*printed.every, *others)]
    context["blocks"] = [text.strip("\n") for text in texts if text]
    context["tables"] = _tables(context)
    context["macros"] = limiter_macros(context)
    context["bits_wanted"] = _bits_wanted(context)
    context["limiter"] = limiter_text(prefix, real, context["macros"])
    return context


def _words(kernels: ControllerKernels, real: Real) -> tuple[str, ...]:
    """The integers of a controller's state."""
    words = WORDS + ESTIMATE_WORDS * (kernels.contraction is not None)
    words += CLOCK_WORDS * (kernels.ringing is not None) + TIME_WORDS * (kernels.times is not None)
    return words + FILLING * (real is Real.DOUBLE and len(words) % 2 == 1)


def build_of(scenario: Scenario, controller: Controller, arithmetic: str) -> dict[str, Any]:
    """What tells this controller from others of the same name: the word "ready", by which it marks its states, and "build", which with the
    rate is part of a symbol: of device, followed signal, rate, limits and `arithmetic`."""
    kernels = controller.kernels
    rate = hertz(1 / kernels.sample_time) if kernels.sample_time else "0"
    about = (
        ABI,
        scenario.device_sha256,
        *scenario.device.load_texts,
        kernels.follow,
        kernels.target.channels,  # with derivatives, and more of them where modes are led
        rate,
        [limit.text for limit in kernels.nominal.limits],
        arithmetic,
        *(() if kernels.times is None else kernels.times),
    )
    ready = int(hashlib.sha256(repr(about).encode()).hexdigest()[:8], 16)
    if len(set(ready.to_bytes(4, "big"))) == 1:  # as memory set to one value is
        ready ^= 1
    return {"ready": ready, "build": f"{re.sub(r'[^0-9]', '_', rate)}hz_{ready:08x}"}


def _bits_wanted(context: Mapping[str, Any]) -> set[str]:
    """The functions by which the C asks for the bits of numbers: those that it calls."""
    tests = [test for name in ("z", "s", "u") for test in context[f"{name}_tests"]]
    tests += [macro.body for macro in context["macros"].values()]
    return {"bits_of", "is_nan"} | ({"ordered"} if "ordered(" in " ".join(tests) else set())


def header_context(scenario: Scenario, controller: Controller) -> dict[str, Any]:
    """What the header of a controller says of the device and of its limits."""
    kernels, model = controller.kernels, controller.kernels.nominal
    drive, follow = model.signals["drive"], kernels.target
    limits = (*model.limits, *(model.rate_limits if controller.rate else ()))
    reserved = None if model.probability is None else f"{100 * model.probability:.10g} % along {scenario.name}"
    return {
        "version": __version__,
        "program": program(),
        "title": model.device.title,
        "source": model.device.source,
        "loads": model.device.load_texts,
        "device_sha256": scenario.device_sha256,
        "specimen_macro": f"{model.device.name.upper()}_CONSTANTS_DEVICE_HASH",
        "n": len(model.axes),
        "nu": len(drive.channels),
        "m": len(follow.channels),
        "positions": len(model.signals[kernels.follow].channels),  # of a motion's target the rest are derivatives
        "n_s": model.n_states,
        "axes": model.axes,
        "follow": follow,
        "drive": drive,
        "drive_unit": common_base_unit(drive.units),
        "state": model.signals.get("state"),
        "rate": _number(1 / kernels.sample_time) if kernels.sample_time else None,
        "si": si_text,
        "limits": [_limit_text(limit) for limit in limits],
        "reserved_for": reserved,
        "composite": ", ".join(limit.label for limit in kernels.guarded_limits) or "none",
        "x_names": [f"{name} [{unit}]" for name, unit in zip(model.x_names, model.x_units, strict=True)],
    }


def _tables(context: Mapping[str, Any]) -> list[tuple[str, np.ndarray, str]]:
    """Name, numbers and unit of the tables that several functions of the limiter read."""
    arrays, unit = context["arrays"], context["drive_unit"]
    limited = bool(limited_modes(context)) and not context["own_drives"]
    candidates = [
        ("U_LOW", context["u_low"], unit, not bounds_once(context) and arrays["U_LOW"] == "U_LOW"),
        ("U_HIGH", context["u_high"], unit, not bounds_once(context) and arrays["U_HIGH"] == "U_HIGH"),
        ("U_SLACK", context["u_slack"], unit, not bounds_once(context)),
        (
            "U_LEAST",
            context["u_low"] - context["u_slack"],
            f"admissible, {unit}",
            limited and arrays["U_LEAST"] == "U_LEAST",
        ),
        (
            "U_MOST",
            context["u_high"] + context["u_slack"],
            f"admissible, {unit}",
            limited and arrays["U_MOST"] == "U_MOST",
        ),
        ("U_SAFE", context["u_safe"], unit, True),
        ("FALL", context.get("fall"), f"{unit} a sample", context["rated"] and context["redundancy"] is not None),
        ("RISE", context.get("rise"), f"{unit} a sample", context["rated"] and context["redundancy"] is not None),
        ("X_REST", context["rest"], ", ".join(context["x_names"]), context["n_s"] > 0),
    ]
    return [(name, values, about) for name, values, about, several in candidates if several]


def _cost(controller: Controller, printed: PrintedKernels) -> dict[str, int]:
    """Operations of the physics: of a "step" that no limit touches, of the "worst", and of what is made up for where calls came "late" or
    a state was "measured" or forgotten, at most."""
    mode, bound, balance = printed.modes[-1], printed.bound, printed.balance
    shares = sum(kernel.operations for kernel in (printed.shares, printed.few) if kernel)
    kernels = controller.kernels
    n = len(kernels.nominal.axes)
    advance = [] if kernels.nominal.x.numel() == kernels.nominal.n_states else ["advance"]
    step = sum(mode[part].operations for part in ("displacement", "state", "drive", *advance) if part in mode)
    first = printed.target_bound or bound
    step += first.operations if first else 0
    # a motion that breaks a limit is answered by settling
    if printed.motion:
        step = sum(kernel.operations for kernel in printed.motion.values())
    again = sum(mode[part].operations for part in ("state", "drive") if part in mode)
    worst = step + (2 if controller.state_can_be_limited else 1) * balance.operations
    worst += again * ((2 if kernels.own_drives else SECANT_STEPS + 3) if mode["drive_can_be_limited"] else 1)
    if mode["drive_can_be_limited"] and kernels.own_drives:
        worst += printed.reached.operations + (mode["advance"].operations if "advance" in mode else 0)
    worst += kernels.composite_rounds * (shares + 1) if shares else 0
    worst += mode["advance"].operations if "advance" in mode and not advance else 0
    worst += 2 * n * n * (1 + SWEEPS) if kernels.nearest_slopes is not None else 0
    if kernels.limits_can_be_passed:
        worst += kernels.composite_rounds * (shares + 1) if shares else 0
        worst += bound.operations if bound else 0
    measured = late = 0
    if kernels.contraction or kernels.ringing:
        measured = SETTLING_SWEEPS * balance.operations
        late = measured
        late += SETTLING_SWEEPS * sum(m["advance"].operations for m in printed.modes[:1] if "advance" in m)
    if kernels.contraction:
        remembering = "z" in mode["advance"].arguments
        late += EXACT * (mode["advance"].operations + (balance.operations if remembering else 0))
    return {"step": step, "worst": worst, "late": late, "measured": measured}


def _number(value: float) -> float | int:
    return round(value) if abs(value - round(value)) < 1e-9 * abs(value) else value


def _limit_text(limit: Limit) -> str:
    sides = [(bound, by) for bound, by in zip((limit.lower, limit.upper), limit.reserve, strict=True) if by]
    reserved = [
        f"{show(limit.described(bound), limit.unit)} less {show_difference(by, limit.unit)}"
        for bound, by in sides
        if bound is not None
    ]
    return limit.text + (f" ({'; '.join(reserved)} reserved)" if reserved else "")
