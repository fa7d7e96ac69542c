"""Calls that lead the limiter into each of its branches: what the test that runs on the target is made of beside the command.

Candidates are drawn around every limit; one is kept where the controller in Python, whose kernels are watched, decides something that
none kept before did. A decision is an answer of a kernel against its limits: inside, within the slack, beyond, on which side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.controller.feedforward import Controller, ControllerStep
from ctrlgen.model.inverse import Inverse

AROUND = 8  # displacements drawn anywhere in the range, and on its corners
MOVED = 0.05  # of its range, by which a displacement goes beyond
GROWING = (1, 4, 16, 64, 256)  # of its usual size, a highest derivative
HALVINGS = 45  # that find where a drive is at its rate
STEADY = 16  # roundings of a target that must not change the status: what a processor's own roundings may amount to


@dataclass(frozen=True, eq=False)
class Call:
    """One call: from a device at rest where `fresh`, else from where the last call led; `settle` or step to `target`."""

    target: np.ndarray
    settle: bool
    fresh: bool


def limiter_calls(controller: Controller, epsilon: float, count: int) -> list[Call]:
    """At most `count` calls that take the decisions that can be taken; none whose status a rounding of `epsilon` could change."""
    watched, seen = _watched(controller)
    known: set[tuple] = set()
    kept: list[Call] = []
    started: dict[Call, tuple[ControllerStep, set[tuple]]] = {}  # many cases begin with the same call
    for case in _cases(controller):
        decisions: set[tuple] = set()
        states = [watched.rest()]
        statuses = []
        for call in case:
            if call not in started:
                seen.clear()
                step = watched.step(states[-1], call.target, settle=call.settle)
                taken = {(call.settle, *decision) for decision in [*seen, ("status", int(step.status))]}
                if call.fresh:
                    started[call] = step, taken
            else:
                step, taken = started[call]
            decisions |= taken
            states.append(step.state)
            statuses.append(step.status)
        if decisions <= known or len(kept) + len(case) > count:
            continue
        if all(
            controller.step(state, call.target * (1 + off), settle=call.settle).status == status
            for state, call, status in zip(states, case, statuses, strict=False)
            for off in (-STEADY * epsilon, STEADY * epsilon)
        ):
            known |= decisions
            kept += case
    return kept


def _cases(controller: Controller) -> Iterator[Sequence[Call]]:
    """Single calls from rest, and pairs: settle somewhere, then step or settle elsewhere."""
    m, rng = controller.nominal, np.random.default_rng(1)
    n, (low, high) = len(m.axes), m.z_bounds
    signal = ca.Function("followed", [m.x, m.z, m.u], [m.signals[controller.follow].expr])
    scale = np.array(controller.target.scale)

    def target(z: np.ndarray, moving: float = 0.0) -> np.ndarray:
        at = signal(m.rest, z, np.zeros(m.u.numel())).full().ravel()
        return np.concatenate([at, moving * rng.normal(size=len(scale))[len(at) :] * scale[len(at) :]])

    middle, slack = (low + high) / 2, controller.slacks[0]
    inside = [np.zeros(n), middle, *(low + (high - low) * rng.uniform(0.05, 0.95, (AROUND, n)))]
    corners = [np.where(rng.random(n) < 0.5, low, high) for _ in range(AROUND)]
    beyond = []
    for i in range(n):
        for bound, outward in ((low[i], -1), (high[i], 1)):
            for by in (slack[i] / 2, MOVED * (high[i] - low[i])):
                z = middle.copy()
                z[i] = bound + outward * by
                beyond.append(z)
    anywhere = [*inside, *corners, *beyond]
    still = controller.sample_time is None
    starts = [Call(target(z), True, True) for z in inside]
    for k, z in enumerate(anywhere):
        yield (Call(target(z), True, True),)
        if not still:
            yield (Call(target(z), False, True),)
            start = starts[k % len(starts)]
            yield start, Call(target(z), False, False)
            yield start, Call(0.5 * (start.target + target(z)), False, False)
            if controller.nominal.inertial:
                yield start, Call(target(z, 1.0), False, False)
    if controller.nominal.inertial and not still:
        for driving in _driven(controller, target(middle)):
            yield starts[0], Call(driving, False, False)
    for z in anywhere[:AROUND] if controller.rate else ():
        for settle in (True, False):
            yield (Call(_at_its_rate(controller, target(z), settle), settle, True),)
    absurd = np.full(len(scale), 1e9)
    yield (Call(absurd, True, True),)
    if not still:
        yield (Call(absurd, False, True),)


def _driven(controller: Controller, target: np.ndarray) -> Iterator[np.ndarray]:
    """`target` with ever larger highest derivatives of one axis: only the drive limits them."""
    scale = np.array(controller.target.scale)
    for i in range(len(scale) - len(controller.nominal.axes), len(scale)):
        for size in GROWING:
            for way in (1, -1):
                yield target + way * size * scale[i] * np.eye(len(scale))[i]


def _at_its_rate(controller: Controller, target: np.ndarray, settle: bool) -> np.ndarray:
    """The share of a `target` at which, from rest, a drive changes faster than it may by half of its slack; all of it where none does."""
    rate, free = (
        controller.rate,
        type(controller)(controller.model, controller.follow, controller.sample_time, controller.slack),
    )
    assert rate is not None
    free.__dict__.update(
        {name: value for name, value in controller.__dict__.items() if name != "plausible"} | {"rate": None}
    )
    rest = controller.rest()
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        change = free.step(rest[:2], middle * target, settle=settle).drive - rest[2]
        beyond = np.any(np.maximum(change - rate.rise, rate.fall - change) > rate.slack / 2)
        low, high = (low, middle) if beyond else (middle, high)
    return high * target


class _Watch:
    """A kernel that tells its answers to `note`."""

    def __init__(self, kernel: ca.Function, note: Callable[[np.ndarray], None]) -> None:
        self._kernel, self._note = kernel, note

    def __call__(self, *arguments: object) -> ca.DM:
        answer = self._kernel(*arguments)
        self._note(answer.full().ravel())
        return answer


def _watched(controller: Controller) -> tuple[Controller, list[tuple]]:
    """A twin of `controller`, and the list of the decisions that its kernels' answers ask for."""
    m, n = controller.nominal, controller.nominal.n_states
    seen: list[tuple] = []
    # worked out from the kernels themselves, before they are watched
    _ = (
        controller.examined_first, controller.drive_can_be_limited, controller.state_can_be_limited, controller.slacks,
        controller.plausible, controller.composite_bound,
    )  # fmt: skip
    x_low, x_high = (bound[:n] for bound in m.x_bounds)
    limits = {
        name: (*bound, slack)
        for name, bound, slack in zip(
            ("displacement", "state", "drive"),
            (m.z_bounds, (x_low, x_high), m.u_bounds),
            controller.slacks,
            strict=True,
        )
    }

    def against(name: str) -> Callable[[np.ndarray], None]:
        low, high, slack = limits[name]

        def note(value: np.ndarray) -> None:
            asked = sum(decision[0] == f"{name} asked" for decision in seen)
            seen.append((f"{name} asked", asked))
            side = np.where(value < low, -1, np.where(value > high, 1, 0))
            far = (value < low - slack) | (value > high + slack)
            seen.append((name, asked, bool(far.any()), bool(side.any())))
            seen.extend((name, "side", int(s), bool(f)) for s, f in zip(side, far, strict=True))
            if asked == 0 and side.any():
                seen.append((name, "first", int(np.flatnonzero(side)[0])))

        return note

    def ratio(value: np.ndarray) -> None:
        seen.append(("ratio", bool(value[0] > 1), bool(value[0] > 1 + controller.slack)))

    twin = type(controller)(controller.model, controller.follow, controller.sample_time, controller.slack)
    twin.__dict__.update(controller.__dict__)
    for mode in ("static", "moving"):
        k = getattr(controller, mode)
        if k is not None:
            kernels = {f.name: getattr(k, f.name) for f in fields(Inverse)}
            twin.__dict__[mode] = Inverse(**kernels | {name: _Watch(kernels[name], against(name)) for name in limits})
    twin.__dict__["composite_ratio"] = _Watch(controller.composite_ratio, ratio)
    if controller.composite_bound is not None:
        twin.__dict__["composite_bound"] = _Watch(
            controller.composite_bound, lambda value: seen.append(("bound", bool(value[0] <= 1)))
        )
    if (rate := controller.rate) is not None:

        def toward(last: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, float, bool, bool]:
            answer = rate.toward(last, wanted)
            seen.append(("rate", *answer[2:]))
            return answer

        twin.__dict__["rate"] = SimpleNamespace(fall=rate.fall, rise=rate.rise, toward=toward)
    return twin, seen
