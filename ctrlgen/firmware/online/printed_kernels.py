"""The kernels of a controller as C functions, by the mode and the part that they compute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.lost_state import UNLIMITED
from ctrlgen.controller.motion_feedforward import MotionKernels
from ctrlgen.controller.quick_state import QuickReach, QuickState
from ctrlgen.core.units import base_unit
from ctrlgen.devices import Signal
from ctrlgen.firmware.c.cprint import Kernel, Law, Printer, Ranges
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.limit_tables import FLOAT_SLACK
from ctrlgen.firmware.online.start_constants import given_ranges
from ctrlgen.model.model import Model

IN_EVERY_SAMPLE = ("displacement", "drive", "few")  # short kernels of every sample
UNROLLED = 8  # rows of a matrix that are written without a loop: 64 products are half a kilobyte


@dataclass(frozen=True)
class PrintedKernels:
    """`modes`: for "settle" and "step" the kernels by part beside "name", "examined_first" and "drive_can_be_limited"; `motion`: those of
    a target with derivatives, by part; `reached` is `balance`, or what stands for it in the range
    of displacements; `shares` and `bound` of composite limits, those of `few` coordinates where they
    need no more, `target_bound` where a target tells it; `every` kernel in the order of the file."""

    modes: list[dict[str, Any]]
    motion: dict[str, Kernel]
    balance: Kernel
    reached: Kernel
    shares: Kernel | None
    few: Kernel | None
    bound: Kernel | None
    target_bound: Kernel | None
    every: list[Kernel]

    @property
    def calls(self) -> frozenset[str]:
        """The elementary functions that they call."""
        return frozenset().union(*(kernel.calls for kernel in self.every))


def kernel_printer(kernels: ControllerKernels, real: Real, prefix: str) -> Printer:
    """What prints the kernels of a controller whose C has names with this `prefix`."""
    given = kernels.given
    laws = printed_laws(given.model if given else kernels.nominal, kernels.named.model)
    numbers, given_numbers = {"p": kernels.named.numbers}, {"p": given.numbers} if given else {}
    ranges = _argument_ranges(kernels)
    return Printer(real, ranges, numbers, laws, given_ranges(kernels), given_numbers, f"{prefix}_derived")


def _argument_ranges(kernels: ControllerKernels) -> Ranges:
    """Low and high of the arguments of kernels; a target has none."""
    model, every = kernels.nominal, (kernels, *kernels.variants)
    x_low, u_low = (
        np.min(lows, axis=0)
        for lows in zip(*((k.nominal.x_bounds[0], k.nominal.u_bounds[0]) for k in every), strict=True)
    )
    x_high, u_high = (
        np.max(highs, axis=0)
        for highs in zip(*((k.nominal.x_bounds[1], k.nominal.u_bounds[1]) for k in every), strict=True)
    )
    n, z = model.n_states, model.z_bounds
    state = np.maximum(x_low[:n], -UNLIMITED), np.minimum(x_high[:n], UNLIMITED)
    times = {} if kernels.times is None else {"h": tuple(np.array([h]) for h in kernels.times)}
    return {"z": z, "wanted": z, "x": (x_low, x_high), "state": state, "drive": (u_low, u_high), **times}


def printed_kernels(controller: Controller, printer: Printer) -> PrintedKernels:
    """The kernels of a `controller`; where constants are given at the start, in terms of these."""
    kernels, inverses, given = controller.kernels, controller.kernels.named, controller.kernels.given
    static, moving = (given.static or kernels.static, given.moving) if given else (kernels.static, kernels.moving)
    moving = kernels.varied or moving
    quick = kernels.quick if printer.real is Real.FLOAT else None  # in double their error would be the largest
    reach = (
        kernels.quick_reach(kernels.slacks(FLOAT_SLACK)[2] / 2)
        if quick and any(controller.drive_can_be_limited)
        else None
    )
    printed = _Kernels(printer, kernel_comments(kernels, quick, reach))
    modes: list[dict[str, Any]] = []
    for name, inverse, formulas in (
        ("settle", static, inverses.static),
        ("step", moving, None if kernels.varied else inverses.moving),
    ):
        if inverse is None:
            continue
        mode: dict[str, Any] = {
            "name": name,
            "examined_first": kernels.examined_first[name == "step"],
            "drive_can_be_limited": controller.drive_can_be_limited[name == "step"],
        }
        for part in ("displacement", "state", "drive", "advance"):
            function, named = getattr(inverse, part), None if formulas is None else getattr(formulas, part)
            if part == "state" and quick is not None:
                function, named = quick.state, None  # the numbers of a polynomial are no formulas of the device's
            if function.size1_out(0):
                mode[part] = printed.kernel(function, (name, part), (f"wanted_{part}", f"{name}_{part}"), named=named)
        modes.append(mode)
    motion = {}
    if isinstance(kernels, MotionKernels):
        motion = {part: printed.kernel(k, ("motion", part), (f"motion_{part}",)) for part, k in kernels.motion.items()}
        if kernels.ringing is not None:
            motion["joins"] = printed.kernel(kernels.joins, ("motion", "joins"), ("motion_joins",))
    steps = ("z", kernels.newton_steps) if kernels.newton_steps > 1 else None
    named = None if inverses.static is None else inverses.static.newton
    balance = printed.kernel(static.newton, "balance", ("balance_displacement",), steps=steps, named=named)
    reached = balance
    if reach is not None:
        reached = printed.kernel(reach.displacement, "reached", ("reached_displacement",))
    shares = few = bound = target_bound = None
    if kernels.guarded_limits:
        fewer = kernels.few_shares
        if fewer is not None:
            few = printed.kernel(fewer.coordinates, ("shares", "few"), ("few_coordinates",))
        function, name = (kernels.varied_shares, "composite") if fewer is None else (fewer.function, "few")
        shares = printed.kernel(function, "shares", (f"{name}_shares",))
    # A state that is limited moves the displacement, and so do targets with derivatives.
    of_target = kernels.target_bound and not controller.state_can_be_limited and not motion
    if kernels.composite_bound and (not of_target or kernels.limits_can_be_passed):
        bound = printed.kernel(kernels.composite_bound, "bound", ("composite_bound",), returned=True)
    if of_target:
        target_bound = printed.kernel(kernels.target_bound, "target_bound", ("target_bound",), returned=True)
    return PrintedKernels(modes, motion, balance, reached, shares, few, bound, target_bound, printed.kernels)


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
        # In every sample: a loop costs a small core twice as much, and most of a matrix of directions is zeros, ones and equal numbers.
        one_by_one = what[-1] in IN_EVERY_SAMPLE and function.size1_out(0) <= UNROLLED
        may_be_result = {"advance": ["x"], "balance": ["z"]}.get(what if what == "balance" else what[-1], [])
        taken = {kernel.name for kernel in self._by_body.values()}
        kernel = self.printer.kernel(
            function, names[0], self.comments[what], may_be_result, steps, returned, named, one_by_one
        )
        if kernel.body not in self._by_body and kernel.name in taken:
            kernel = self.printer.kernel(
                function, names[-1], self.comments[what], may_be_result, steps, returned, named, one_by_one
            )
        return self._by_body.setdefault(kernel.body, kernel)

    @property
    def kernels(self) -> list[Kernel]:
        """The different kernels, in the order in which they were printed."""
        return list(self._by_body.values())


def printed_laws(model: Model, symbolic: Model) -> list[Law]:
    """The named parts of a model's physics for `Printer`, with the equations and sources of their docstrings; `symbolic` is the same
    model with its numbers as parameters."""
    laws = []
    for law, named in zip(model.laws, symbolic.laws, strict=True):
        stated = " ".join(" ".join((function.__doc__ or "").split()) for function in law.documented)
        about = f"{law.label[0].upper()}{law.label[1:]}" + (f": {stated}" if stated else ".")
        functions = [
            ca.Function(
                law.name, [m.x, m.z, m.u, *([m.p] if more else [])], [part.expr], ["x", "z", "drive", *more], ["force"]
            )
            for m, part, more in ((model, law, ("p",) if model.p.numel() else ()), (symbolic, named, ("p",)))
        ]
        laws.append(Law(law.name, about, *functions))
    return laws


def kernel_comments(
    kernels: ControllerKernels, quick_state: QuickState | None = None, reach: QuickReach | None = None
) -> dict[Any, str]:
    """What each kernel computes, in words, by mode and part or by name; the state by `quick_state` and what it leads to by `reach` where
    there are any."""
    m, follow, drive = (
        kernels.nominal,
        kernels.model.signals[kernels.follow],
        kernels.nominal.signals["drive"],
    )
    state, within = m.signals.get("state"), f"one sample of {'h' if kernels.times else kernels.sample_time} s"
    holds = f"the {state.label}s `state`" if state and m.n_states else "the displacement `wanted`"
    states = ", ".join(f"{name} [{unit}]" for name, unit in zip(m.x_names, m.x_units, strict=True))
    steps = "the step" if kernels.newton_steps == 1 else f"{kernels.newton_steps} Newton steps"
    comments: dict[Any, str] = {
        "balance": f"Displacement at which the forces balance, g(x, z, drive) = 0: {steps} z - g/(dg/dz) from z.",
        "shares": f"The square of each {', '.join(limit.label for limit in kernels.guarded_limits)} over its limit at displacement "
        + ("`wanted`." if kernels.few_shares is None else "with these coordinates `few`."),
        ("shares", "few"): "As many coordinates of the displacement as these limits depend on.",
        "bound": "A cheap upper bound of the root of the largest of these shares: no more than 1 means that every limit is kept.",
        "target_bound": "A cheap upper bound of the root of the largest of these shares at the displacement of a `target` that leads into "
        "the range: no more than 1 means that every limit is kept.",
    }
    if reach is not None:
        comments["reached"] = (
            f"Displacement at which the forces balance the states x, in its range. By polynomials of degree {reach.degree}, proved to be "
            f"off by less than {1.05 * reach.off:.2g} m."
        )
    quick = ""
    if quick_state is not None:
        quick = (
            f" By polynomials of degree {quick_state.degree}, proved over the displacement's range to be off by less than a change of "
            f"the displacement by {quick_state.off:.1g} m."
        )
    for mode in ("settle", "step", "motion"):
        after = {"settle": "at rest", "step": within + " later", "motion": "during the motion that `target` says"}[mode]
        comments |= {
            (mode, "displacement"): f"Displacement at which the {follow.label} is `target`, {si_text(follow)}.",
            (mode, "state"): f"States that the displacement needs {after}: {states}.{quick}",
            (mode, "drive"): {
                "settle": f"{drive.label.capitalize()} that keeps {holds} at rest.",
                "step": f"{drive.label.capitalize()} that leads from x to {holds} within {within}.",
                "motion": f"{drive.label.capitalize()} of the motion that `target` says.",
            }[mode],
            (
                mode,
                "joins",
            ): "Where the motion that `target` says comes from, half a sample before, then where it leads, half a sample after: "
            "states and displacements, weighted by what is told of a ringing.",
            (mode, "advance"): f"States under `drive`, {after}: {states}.",
        }
    return comments


def si_text(signal: Signal) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))
