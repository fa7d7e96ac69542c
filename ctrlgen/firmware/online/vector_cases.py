"""Calls that lead the limiter into each of its branches: what the test that runs on the target is made of beside the command.

Candidates are drawn around every limit; one is kept where the controller in Python, which is observed, decides something that
none kept before did. A decision is an answer of a kernel against its limits: inside, within the slack, beyond, on which side.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.controller_step import ControllerStep
from ctrlgen.controller.feedforward import Controller

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
    known: set[tuple[Any, ...]] = set()
    kept: list[Call] = []
    started: dict[Call, tuple[ControllerStep, set[tuple[Any, ...]]]] = {}  # many cases begin with the same call
    for case in _cases(controller):
        decisions: set[tuple[Any, ...]] = set()
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
            controller.step(state, call.target * (1 + side * STEADY * epsilon * off), settle=call.settle).status
            == status
            for state, call, status in zip(states, case, statuses, strict=False)
            for off in (np.ones(len(call.target)), *np.eye(len(call.target)))  # where numbers cancel, roundings do not
            for side in (-1, 1)
        ):
            known |= decisions
            kept += case
    return kept


def _cases(controller: Controller) -> Iterator[Sequence[Call]]:
    """Single calls from rest, and pairs: settle somewhere, then step or settle elsewhere."""
    m, rng = controller.kernels.nominal, np.random.default_rng(1)
    n, (low, high) = len(m.axes), m.z_bounds
    signal = ca.Function("followed", [m.x, m.z, m.u], [m.signals[controller.kernels.follow].expr])
    scale = np.array(controller.kernels.target.scale)

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
    still = controller.kernels.sample_time is None
    starts = [Call(target(z), True, True) for z in inside]
    for k, z in enumerate(anywhere):
        yield (Call(target(z), True, True),)
        if not still:
            yield (Call(target(z), False, True),)
            start = starts[k % len(starts)]
            yield start, Call(target(z), False, False)
            yield start, Call(0.5 * (start.target + target(z)), False, False)
            if controller.kernels.nominal.inertial:
                yield start, Call(target(z, 1.0), False, False)
    if controller.kernels.nominal.inertial and not still:
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
    scale = np.array(controller.kernels.target.scale)
    for i in range(len(scale) - len(controller.kernels.nominal.axes), len(scale)):
        for size in GROWING:
            for way in (1, -1):
                yield target + way * size * scale[i] * np.eye(len(scale))[i]


def _at_its_rate(controller: Controller, target: np.ndarray, settle: bool) -> np.ndarray:
    """The share of a `target` at which, from rest, a drive changes faster than it may by half of its slack; all of it where none does."""
    rate, free = controller.rate, replace(controller, keeps_rates=False)
    assert rate is not None
    rest = controller.rest()
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        change = free.step(rest[:2], middle * target, settle=settle).drive - rest[2]
        beyond = np.any(np.maximum(change - rate.rise, rate.fall - change) > rate.slack / 2)
        low, high = (low, middle) if beyond else (middle, high)
    return high * target


def _watched(controller: Controller) -> tuple[Controller, list[tuple[Any, ...]]]:
    """The `controller` with an observer, and the list of the decisions that the answers of its kernels ask for."""
    m, n = controller.kernels.nominal, controller.kernels.nominal.n_states
    x_low, x_high = (bound[:n] for bound in m.x_bounds)
    ranges = m.z_bounds, (x_low, x_high), m.u_bounds
    limits = dict(zip(("displacement", "state", "drive"), zip(ranges, controller.slacks, strict=True), strict=True))
    seen: list[tuple[Any, ...]] = []

    def note(what: str, answer: np.ndarray) -> None:
        if what in limits:
            (low, high), slack = limits[what]
            asked = sum(decision[0] == f"{what} asked" for decision in seen)
            seen.append((f"{what} asked", asked))
            side = np.where(answer < low, -1, np.where(answer > high, 1, 0))
            far = (answer < low - slack) | (answer > high + slack)
            seen.append((what, asked, bool(far.any()), bool(side.any())))
            seen.extend((what, "side", int(s), bool(f)) for s, f in zip(side, far, strict=True))
            if asked == 0 and side.any():
                seen.append((what, "first", int(np.flatnonzero(side)[0])))
        elif what == "composite_ratio":
            seen.append((what, bool(answer[0] > 1), bool(answer[0] > 1 + controller.slack)))
        elif what == "composite_bound":
            seen.append((what, bool(answer[0] <= 1)))
        else:
            seen.append((what, *answer.tolist()))

    return replace(controller, observe=note), seen
