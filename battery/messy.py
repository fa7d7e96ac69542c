"""Axes on which every law is a little wrong: dominant causes over a background, numbers off by more than stated, uneven noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from battery import axis_cases, laws, memory, servo_cases, truth
from battery.axis_cases import Array, Bench, Rng
from battery.laws import simulate
from battery.plant_axis import Axis, Planted
from battery.size import Gauge, Ruler, refitted

Draw = Callable[[str], Any]
DOMINANT = (30.0, 1000.0)  # rms over the noise's that refitting the stated numbers cannot take away
SMALL = (0.005, 0.05)  # rms of a law of the background over that of the largest dominant cause
LARGEST_TRAVEL = 0.15  # rms of a dominant cause over that of the motion
LARGEST_SHARE = 0.4  # of a memory's amplitude: more is another device
SPIKES, SPIKE_SIZE = 1e-3, (4.0, 6.0)  # share of the samples, size over the noise
OFF = (1.2, 2.5)  # stated numbers, in stated standard deviations
# Groups of dominant causes; two come from different groups
CAUSES = (
    ("stiffening", "softening", "bow"),
    ("hysteresis", "coulomb", "stribeck", "backlash"),
    ("quadratic_damping", "viscous"),
    ("creep", "log_creep", "thermal_lag"),
    ("dead_zone",),  # an end of the drive shows only where a record reaches it
    ("resonance",),
)
KNOWN = (
    "stiffening",
    "hysteresis",
    "log_creep",
    "creep",
    "backlash",
    "coulomb",
    "viscous",
    "quadratic_damping",
    "bow",
    "cyclic",
    "drift",
    "thermal_lag",
    "delay",
    "low_pass",
    "vibration",
    "degradation",
    "resonance",
    "dead_zone",
)
FOREIGN = (*laws.STRANGE, "bouc_wen_motion", "preisach", "worn_play", "power_creep", "sinh_creep")
# Laws that need no inertia
ON_SERVO = (
    ("bow", "cyclic", "drift", "thermal_lag", "degradation", "dead_zone", "creep", "backlash"),
    (
        "telegraph",
        "clock_jitter",
        "turning_points",
        "bouc_wen_motion",
        "preisach",
        "worn_play",
        "power_creep",
        "sinh_creep",
    ),
)


def mixture(rng: Rng, count: int) -> tuple[str, ...]:
    """`count` dominant causes of different groups."""
    groups = rng.choice(len(CAUSES), count, replace=False)
    return tuple(str(rng.choice(CAUSES[g])) for g in groups)


def unsettled(rng: Rng, bench: Bench) -> Bench:
    """The same bench with stated numbers farther off than stated, and coloured noise with rare spikes."""
    off = {
        name: float(f"{getattr(bench.axis, name) * (1 + rng.choice([-1, 1]) * rng.uniform(*OFF) * sd):.4g}")
        for name, sd in _stated_sd(bench.stated).items()
    }
    phi = float(rng.uniform(0.5, 0.9))
    sd = bench.scene.noise
    takes = tuple(
        replace(t, noise=spiky(rng, axis_cases.draw_noise(rng, sd, phi, len(t.drive)), sd)) for t in bench.takes
    )
    kind = {"sd": sd, "phi": phi}
    return replace(bench, stated=replace(bench.stated, **off), takes=takes, noise_kind=kind)


def _stated_sd(stated: Axis) -> dict[str, float]:
    if stated.mass:
        return axis_cases.STATED_SD
    return {} if servo_cases.commanded(stated) else {"force_constant": servo_cases.GAIN_SD}


def spiky(rng: Rng, noise: Array, sd: float) -> Array:
    """The noise (n,) with 0.1 % of its samples, one at least, farther off by 4 to 6 standard deviations."""
    count = max(1, round(SPIKES * len(noise)))
    at = rng.choice(len(noise), count, replace=False)
    out = noise.copy()
    out[at] += rng.choice([-1, 1], count) * rng.uniform(*SPIKE_SIZE, count) * sd
    return out


def shifted(rng: Rng, bench: Bench, size: float) -> Bench:
    """The same bench, the zero point of each record off by up to `size` [m]."""
    return replace(bench, takes=tuple(replace(t, noise=t.noise + rng.uniform(-size, size)) for t in bench.takes))


def dominant(
    rng: Rng, draw: Draw, gauge: Gauge, names: Sequence[str], low: float, high: float
) -> list[tuple[Any, float]]:
    """Laws and their sizes: the first within (low, high), the others at 0.5 to 1 of it. Raises ValueError: draw again."""
    if high < 1.5 * low:
        raise ValueError("too much noise for a dominant cause")
    target = float(np.exp(rng.uniform(np.log(1.2 * low), np.log(high / 1.2))))
    found = []
    for k, name in enumerate(names):
        wanted = target if k == 0 else max(1.2 * low, target * float(rng.uniform(0.5, 1.0)))
        law, size = gauge.scaled(draw(name), wanted, low, high)
        if memory.FAMILIES.get(name, "backlash") != "backlash" and law.amplitude > LARGEST_SHARE:
            raise ValueError(f"{name}: a share of {law.amplitude:.2g}")
        found.append((law, size))
    return found


def background(
    rng: Rng, draw: Draw, gauge: Gauge, largest: float, pools: tuple[Sequence[str], Sequence[str]], taken: Sequence[str]
) -> list[tuple[Any, float]]:
    """Five to ten small laws and their sizes; `pools`: kinds that libraries have, and others, half of each.

    `largest`: the size of the dominant cause; no law is of the kind or family of those `taken`.
    """
    count = int(rng.integers(5, 11))
    families = {memory.FAMILIES.get(name, name) for name in taken}
    names: list[str] = []
    for pool, n in zip(pools, (count // 2, count - count // 2), strict=True):
        free = [p for p in pool if memory.FAMILIES.get(p, p) not in families]
        names += rng.permutation(free)[:n].tolist()
    found = []
    for name in names:
        low, high = SMALL[0] * largest, SMALL[1] * largest
        target = float(np.exp(rng.uniform(np.log(1.2 * low), np.log(high / 1.2))))
        try:
            found.append(gauge.scaled(draw(name), target, low, high))
        except ValueError:  # a law that cannot have this size here is left out
            continue
    if len(found) < 4:
        raise ValueError("too few laws of the background")
    return found


def shares(bench: Bench, dominant: Sequence[Planted], small: Sequence[Planted], ruler: Ruler) -> dict[str, Any]:
    """What the answer says of shares: with constants counted, without them, and the least error [noise]."""
    numbers, takes = refitted(bench.axis), [bench.fit, bench.takes[-1]]
    # a stage without springs has no stiffness
    kept = [
        k for k, name in enumerate(numbers) if getattr(bench.axis, name) and not servo_cases.commanded(bench.stated)
    ]
    names = [numbers[k] for k in kept]
    noise = bench.scene.noise

    def reading(planted: Sequence[Planted], x: Array, record: int) -> Array:
        t = takes[record]
        moved = {name: getattr(bench.axis, name) * (1 + share) for name, share in zip(names, x, strict=True)}
        axis = replace(bench.axis, **moved)
        return (
            simulate(axis, t.drive, planted, bench.scene.rough, t.start, t.ambient, 0.0, bench.linear)[:, None] / noise
        )

    zero = np.zeros(len(names))
    observed = tuple(reading([*dominant, *small], zero, record) for record in (0, 1))
    observed = tuple(y + t.noise.mean() / noise for y, t in zip(observed, takes, strict=True))  # with its zero point
    columns, sd = ruler.columns[:, kept] / noise, _stated_sd(bench.stated)
    off = [getattr(bench.stated, name) / getattr(bench.axis, name) - 1 for name in names]
    stated = truth.Stated(np.array(off), np.array([sd[name] for name in names]))

    def model(present: frozenset[int], x: Array, record: int) -> Array:
        return reading([dominant[k] for k in sorted(present)], x, record)

    counted, free = (truth.attribute(observed, model, columns, stated, len(dominant), zeros) for zeros in (False, True))
    return {
        "shares": counted.shares,
        "shares_varying": free.shares,
        "parts": counted.parts,
        "parts_varying": free.parts,
        "before_parts": counted.before_parts,
        "before_parts_varying": free.before_parts,
        "least_error": counted.error,
        "mismatch": counted.before,
    }


def write(folder: Path, bench: Bench, planted: Sequence[Planted]) -> None:
    """The folder that a diagnosis reads."""
    servo = not bench.axis.mass
    device = servo_cases.device_text(bench.stated) if servo else None
    axis_cases.write_bench(folder, bench, list(planted), device, servo_cases.commanded(bench.stated))
