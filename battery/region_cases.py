"""The class `regional`: one law that acts in a region only; the answer holds the region and where the samples are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from itertools import cycle, islice
from typing import Any

import numpy as np

from battery import axis_cases, laws, laws_region, messy, rough_cases
from battery.axis_cases import Array, Bench, Rng, Take
from battery.plant_axis import Planted, move
from battery.region import Region

SECONDS = 3.0  # of the record to fit
SIZE = (15.0, 600.0)  # rms over the noise's that refitting the stated numbers cannot take away
INSIDE = (0.1, 0.8)  # share of the samples that are in a region, so that an overlap says something
TOUCHED = (0.004, 0.5)  # of a stop
SOFTEST = 0.3  # stiffness of a stop over the stage's


def plan(rng: Rng, count: int) -> list[tuple[str, ...]]:
    """The law of each of `count` cases: all in turn."""
    return [(name,) for name in islice(cycle(rng.permutation(laws_region.NAMES).tolist()), count)]


def make(wanted: tuple[str, ...], rng: Rng) -> rough_cases.Made:
    """One case; draws until the law has its size and its region is neither empty nor all."""
    (name,) = wanted

    def once() -> rough_cases.Made:
        bench, planted, answer = once_drawn(name, rng, SECONDS)
        return (lambda d: messy.write(d, bench, planted)), answer

    return rough_cases.until(once, wanted)


def once_drawn(name: str, rng: Rng, seconds: float) -> tuple[Bench, list[Planted], dict[str, Any]]:
    """A bench with a record to fit of `seconds`, what is planted, the law `name` first, and the answer. Raises ValueError where the law has
    not its size, or its region is empty or all."""
    bench = axis_cases.draw_bench(rng, seconds, ambient=True if name == "warm_reading" else None)
    bench, planted, answer = rough_cases.on_axis(bench, "axis", (name,), rng, SIZE, draw=lambda n: drawn(n, rng, bench))
    if name == "stop_there" and planted[0].amplitude < SOFTEST * bench.axis.stiffness:
        raise ValueError("a stop softer than the stage's own springs")
    region = laws_region.region_of(planted[0])
    samples = {role: samples_of(bench, take, planted) for role, take in zip(ROLES, _takes(bench), strict=True)}
    _check(name, region, samples)
    answer |= {"region": asdict(region), "samples": {role: _rounded(s) for role, s in samples.items()}}
    return bench, planted, answer


ROLES = ("fit", "hold_out")


def drawn(name: str, rng: Rng, bench: Bench) -> Planted:
    """The law `name`; a moment lies in the record to fit, a threshold of temperature within the room's."""
    law = laws_region.signed(rng, laws.draw(name, rng, bench.scene))
    take = bench.fit
    if "moment" in law.shape:
        span = len(take.drive) * bench.scene.sample_time
        law = replace(law, shape=law.shape | {"moment": take.start + float(rng.uniform(0.3, 0.7)) * span})
    if name == "warm_reading":
        law = replace(law, shape={"above": float(np.quantile(take.ambient, rng.uniform(0.35, 0.65)))})
    return law


def _takes(bench: Bench) -> tuple[Take, Take]:
    return bench.fit, bench.takes[-1]


def samples_of(bench: Bench, take: Take, planted: list[Planted]) -> dict[str, Array]:
    """Where the plant is at each sample, (n,) SI."""
    hooks = laws.build(planted, bench.scene)
    m = move(bench.axis, take.drive, hooks, take.start, bench.scene, bench.linear)
    out = {"position": m.position[:: m.substeps], "velocity": m.speed[:: m.substeps], "drive": take.drive}
    out["time"] = take.start + bench.scene.sample_time * np.arange(len(take.drive))
    return out if take.ambient is None else out | {"temperature": take.ambient}


def _check(name: str, region: Region, samples: Mapping[str, Mapping[str, Array]]) -> None:
    low, high = TOUCHED if name == "stop_there" else INSIDE
    roles = ("fit",) if region.of == "time" else ROLES
    for role in roles:
        inside = float(region.mask(samples[role]).mean())
        if not low <= inside <= high:
            raise ValueError(f"{name}: {inside:.2f} of the samples are in its region")


def _rounded(samples: Mapping[str, Array]) -> dict[str, list[float]]:
    return {of: [float(f"{v:.6g}") for v in x.tolist()] for of, x in samples.items()}
