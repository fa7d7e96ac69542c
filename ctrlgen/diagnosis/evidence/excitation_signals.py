"""Excitation signals for any device, from which the next experiment is chosen.

Signals lie within -1 ... 1; `admissible` scales them as far as the limits of the device allow.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.diagnosis.evidence.ltv_linearisation import simulate_motion
from ctrlgen.diagnosis.settings import EXCITATION
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class ExcitationSignal:
    """A drive of order one, (n, n_u), and its description."""

    kind: str
    description: str
    values: np.ndarray


def time_series(n: int, n_u: int, rate: float, seed: int) -> Iterator[ExcitationSignal]:
    """Signals of `n` samples for `n_u` actuators at `rate` samples a second; `seed` draws the phases."""
    rng, s = np.random.default_rng(seed), np.arange(n) / n
    for kind, highest in (("slow multisine", 40), ("fast multisine", n // 10)):
        harmonics = np.unique(np.geomspace(1, max(highest, 2), EXCITATION.lines).astype(int) // 2 * 2 + 1)
        waves = np.cos(2 * np.pi * (np.multiply.outer(s, harmonics)[:, None] + rng.random((n_u, len(harmonics)))))
        values = waves.sum(axis=2)
        top = harmonics.max() * rate / n
        yield ExcitationSignal(kind, f"{kind}, odd lines up to {top:.3g} Hz", values / np.abs(values).max())
    triangle = 1 - 2 * np.abs(2 * ((2 * s + 0.25) % 1) - 1)
    yield ExcitationSignal("slow triangle", "two slow triangles without pauses", _together(triangle, n_u))
    levels = np.array(EXCITATION.levels)[
        np.minimum((s * len(EXCITATION.levels)).astype(int), len(EXCITATION.levels) - 1)
    ]
    yield ExcitationSignal(
        "steps and rests", f"steps with rests of {n / len(EXCITATION.levels) / rate:.3g} s", _together(levels, n_u)
    )
    once = np.where((s >= 0.1) & (s < 0.5), 1.0, 0.0)
    yield ExcitationSignal("on and off", "off, on for 40 % of the time, off for the rest", _together(once, n_u))
    square = np.where((8 * s) % 2 < 1, 1.0, -1.0)
    yield ExcitationSignal("on/off cycles", "four cycles between the limits", _together(square, n_u))
    if n_u > 1:
        turns = np.minimum((s * n_u).astype(int), n_u - 1)
        turn = (s * n_u) % 1
        wave = np.where(turn < 0.25, 0.0, np.where(turn < 0.6, 1.0, -1.0))
        yield ExcitationSignal(
            "one axis at a time", "each actuator stepped and returned alone", wave[:, None] * np.eye(n_u)[turns]
        )


def pose_sets(n: int, n_u: int, seed: int) -> Iterator[ExcitationSignal]:
    """Sets of `n` settled poses for `n_u` actuators."""
    rng = np.random.default_rng(seed)
    turns, steps = np.arange(n) % n_u, np.arange(n) // n_u
    level = np.linspace(-1, 1, max(steps.max() + 1, 2))[steps]
    yield ExcitationSignal(
        "one axis at a time", "each actuator alone over its range", level[:, None] * np.eye(n_u)[turns]
    )
    yield ExcitationSignal(
        "all together", "all actuators by the same share of their range", _together(np.linspace(-1, 1, n), n_u)
    )
    yield ExcitationSignal("corners", "every actuator at one of its ends", rng.choice([-1.0, 1.0], (n, n_u)))
    yield ExcitationSignal("anywhere", "poses spread evenly over the range", rng.uniform(-1, 1, (n, n_u)))


def _together(values: np.ndarray, n_u: int) -> np.ndarray:
    return np.repeat(values[:, None], n_u, axis=1)


def admissible(
    shape: ExcitationSignal, simulator: Simulator, p: np.ndarray, template: Record, first: float
) -> tuple[Record, float] | None:
    """`shape` as a record that begins at `first` [s], with the largest strength (share of the drive's range) at which the
    predicted motion keeps every limit of the device, and that strength; None where the smallest strength breaks a limit.

    `template` gives the sample time, how drives run between samples and, where the device states none, the drive's range.
    The strength is found by bisection, as if a stronger drive were never nearer to a limit.
    """
    low, high = simulator.model.u_bounds
    low = np.where(np.isfinite(low), low, template.drive.min(axis=0))
    high = np.where(np.isfinite(high), high, template.drive.max(axis=0))
    n = len(shape.values)
    h = template.sample_time if np.isfinite(template.sample_time) else 1.0
    one_sided, best = low >= 0, None
    first_left, last_left = 0, len(EXCITATION.strengths) - 1
    while first_left <= last_left:
        middle = (first_left + last_left + 1) // 2
        half = EXCITATION.strengths[middle] * np.where(one_sided, (high - low) / 2, np.minimum(high, -low))
        centre = np.where(one_sided, low + half, 0.0)
        drive = np.clip(centre + half * shape.values, low, high)
        record = Record(
            f"next: {shape.kind}",
            "fit",
            first + np.arange(n) * h,
            template.sample_time,
            drive,
            np.zeros((n, template.observed.shape[1])),
            template.linear,
            None,
            np.ones((n, template.observed.shape[1]), bool),
            poses=template.poses,
        )
        if _kept(simulator, p, record):
            best, first_left = (record, EXCITATION.strengths[middle]), middle + 1
        else:
            last_left = middle - 1
    return best


def _kept(simulator: Simulator, p: np.ndarray, record: Record) -> bool:
    """Whether the motion that the simulator predicts with parameters `p` keeps every limit."""
    m = simulator.model
    after = simulate_motion(simulator, record, p, None)[1]
    if not np.all(np.isfinite(after)):
        return False
    given = [ca.vertcat(m.x, m.z), m.u, m.p, simulator.ambient]
    expr = ca.vertcat(*(ca.substitute(limit.expr, m.heat, m.heat_of_drive) for limit in m.limits))
    n = len(after)
    f = ca.Function("limits", given, [expr]).map(n)
    values = f(after.T, record.drive.T, np.tile(p[:, None], (1, n)), np.zeros((1, n))).full().T
    first = 0
    for limit in m.limits:
        reached = values[:, first : first + limit.expr.numel()]
        first += limit.expr.numel()
        (low, high), size = limit.bounds, max(abs(limit.lower or 0.0), abs(limit.upper or 0.0))
        if reached.min() < low - EXCITATION.limit_slack * size or reached.max() > high + EXCITATION.limit_slack * size:
            return False
    return True
