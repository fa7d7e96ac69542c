"""Excitation signals for any device, from which the next experiment is chosen.

Signals lie within -1 ... 1; `admissible` scales them as far as the limits of the device allow, and brings them within what its
drives were seen to do (`drive_envelope.py`). Of an imposed motion the signals are its positions, and the rest of the drive follows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.diagnosis.evidence.drive_envelope import DriveEnvelope
from ctrlgen.diagnosis.evidence.ltv_linearisation import simulate_motion
from ctrlgen.diagnosis.settings import EXCITATION
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class ExcitationSignal:
    """A drive of order one, (n, k) for k free drives, and its description."""

    kind: str
    description: str
    values: np.ndarray


def time_series(
    n: int, envelope: DriveEnvelope, sample_time: float, seed: int, free: int
) -> Iterator[ExcitationSignal]:
    """Signals of `n` samples for the first `free` drives, whose lines and speeds lie in their envelope; `seed` draws the phases."""
    s = np.arange(n) / n
    yield from _multisines(n, envelope, sample_time, seed, free)
    triangle = 1 - 2 * np.abs(2 * ((2 * s + 0.25) % 1) - 1)
    yield ExcitationSignal("slow triangle", "two slow triangles without pauses", _together(triangle, free))
    yield from _strokes(n, envelope, sample_time, free)
    levels = np.array(EXCITATION.levels)[
        np.minimum((s * len(EXCITATION.levels)).astype(int), len(EXCITATION.levels) - 1)
    ]
    rest = n / len(EXCITATION.levels) * sample_time
    yield ExcitationSignal("steps and rests", f"steps with rests of {rest:.3g} s", _together(levels, free))
    once = np.where((s >= 0.1) & (s < 0.5), 1.0, 0.0)
    yield ExcitationSignal("on and off", "off, on for 40 % of the time, off for the rest", _together(once, free))
    square = np.where((8 * s) % 2 < 1, 1.0, -1.0)
    yield ExcitationSignal("on/off cycles", "four cycles between the limits", _together(square, free))
    if free > 1:
        turns = np.minimum((s * free).astype(int), free - 1)
        turn = (s * free) % 1
        wave = np.where(turn < 0.25, 0.0, np.where(turn < 0.6, 1.0, -1.0))
        yield ExcitationSignal(
            "one axis at a time", "each actuator stepped and returned alone", wave[:, None] * np.eye(free)[turns]
        )


def _multisines(
    n: int, envelope: DriveEnvelope, sample_time: float, seed: int, free: int
) -> Iterator[ExcitationSignal]:
    """Odd lines of random phase in the band of each drive. Above the frequency at which a sine of full range is as fast as the drive
    ever was, they fall with frequency: with equal lines the fast ones would take all of the rate and leave none of the range."""
    rng, s = np.random.default_rng(seed), np.arange(n) / n
    seen: set[tuple[int, ...]] = set()
    for kind, highest in (("slow multisine", 40), ("fast multisine", n // 10)):
        values, tops = np.zeros((n, free)), []
        for drive in range(free):
            top = max(int(min(highest, envelope.band[drive] * n * sample_time)), 1)
            lines = np.unique((np.geomspace(1, top, EXCITATION.lines).astype(int) - 1) // 2 * 2 + 1)
            corner = envelope.rate[drive] / (np.pi * envelope.span[drive]) if envelope.span[drive] > 0 else np.inf
            sizes = 1 / np.maximum(lines / (n * sample_time) / corner, 1.0)
            waves = sizes * np.cos(2 * np.pi * (np.multiply.outer(s, lines) + rng.random(len(lines))))
            values[:, drive] = waves.sum(axis=1) / np.abs(waves.sum(axis=1)).max()
            step = np.abs(np.diff(values[:, drive])).max() * envelope.span[drive] / 2
            values[:, drive] *= min(1.0, envelope.rate[drive] * sample_time / step) if step > 0 else 1.0
            tops.append(int(lines.max()))
        if tuple(tops) in seen:
            continue
        seen.add(tuple(tops))
        text = f"{kind}, odd lines up to {max(tops) / (n * sample_time):.3g} Hz"
        yield ExcitationSignal(kind, text if max(tops) > 1 else f"one period of {n * sample_time:.3g} s", values)


def _strokes(n: int, envelope: DriveEnvelope, sample_time: float, free: int) -> Iterator[ExcitationSignal]:
    """Strokes whose speed falls smoothly to a tenth and rises again: what repeats along the way is so told from what repeats in time,
    also on a machine that was seen to move one way only, and at one speed."""
    span = np.where(envelope.span > 0, envelope.span, np.inf)[:free]
    slowest, step = EXCITATION.slowest, float(np.min(envelope.rate[:free] * sample_time / span, initial=np.inf))
    for kind, ways, text in (
        ("strokes", (1.0, -1.0), "a stroke forward and one back, each"),
        ("stroke forward", (1.0,), "a stroke forward"),
        ("stroke backward", (-1.0,), "a stroke backward"),
    ):
        part = np.arange(n) * len(ways) / n
        speed = (1 + slowest) / 2 + (1 - slowest) / 2 * np.cos(2 * np.pi * part)
        way = np.cumsum(speed * np.array(ways)[part.astype(int)])
        way -= way.min()
        # the whole range in the given time, or as far as the fastest speed leads
        fastest = min(step, 1 / way.max())
        values = 2 * way * fastest - 1 if ways[0] > 0 else 1 - 2 * (way.max() - way) * fastest
        told = f"{text} with a speed that falls to {100 * slowest:.0f} % and rises again"
        yield ExcitationSignal(kind, told, _together(values, free))


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
    shape: ExcitationSignal,
    simulator: Simulator,
    p: np.ndarray,
    template: Record,
    first: float,
    envelope: DriveEnvelope,
) -> tuple[Record, float] | None:
    """`shape` as a record that begins at `first` [s], with the largest strength (share of the drive's range) at which it is within the
    `envelope` and the predicted motion keeps every limit of the device, and that strength; None where there is none.

    `template` gives the sample time and how drives run between samples. The strength is found by bisection, as if a stronger
    drive were never nearer to a limit.
    """
    k = shape.values.shape[1]
    low, high = envelope.low[:k], envelope.high[:k]
    imposed = k < len(envelope.low)
    h = template.sample_time if np.isfinite(template.sample_time) else 1.0

    def drives(values: np.ndarray) -> np.ndarray:
        """The drives of an imposed motion: its positions, and their first and second derivatives."""
        return np.hstack([values, speed := np.gradient(values, h, axis=0), np.gradient(speed, h, axis=0)])

    both, best = _both_ways(low, high), None
    first_left, last_left = 0, len(EXCITATION.strengths) - 1
    while first_left <= last_left:
        middle = (first_left + last_left + 1) // 2
        half = EXCITATION.strengths[middle] * np.where(both, np.minimum(high, -low), (high - low) / 2)
        # from the end that is nearer to zero, where a heater is cold and a stack without voltage
        centre = np.where(both, 0.0, np.where(np.abs(low) <= np.abs(high), low + half, high - half))
        wanted = centre + half * shape.values
        drive = envelope.shaped(wanted, h, drives, odd=True) if imposed else envelope.shaped(wanted, h)
        record = None if drive is None else _blank(shape, first, template, drive)
        if record is not None and _kept(simulator, p, record):
            best, first_left = (record, EXCITATION.strengths[middle]), middle + 1
        else:
            last_left = middle - 1
    return best


def _both_ways(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which drives went to both sides of zero, and hardly farther to one."""
    sides = np.minimum(-low, high), np.maximum(-low, high)
    return sides[0] >= EXCITATION.both_ways * np.maximum(sides[1], 1e-300)


def _blank(shape: ExcitationSignal, first: float, template: Record, drive: np.ndarray) -> Record:
    """A record of `drive` without readings, like the `template`."""
    n, h = len(drive), template.sample_time if np.isfinite(template.sample_time) else 1.0
    return Record(
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
