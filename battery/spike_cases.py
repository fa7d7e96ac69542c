"""The class `spikes`: a missing law whose error hides wild readings that are smaller than it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from battery import axis_cases, messy, pose_cases, rough_cases
from battery.axis_cases import Array, Rng

SECONDS = 3.0
SIZE = (30.0, 120.0)  # rms of the law over the noise's: above, what the form of the law leaves counts more than spikes
SERIES = ("coulomb", "stribeck", "stiffening", "quadratic_damping", "hysteresis", "backlash", "viscous", "log_creep")
POSES = ("drive_gain", "bow", "coupling")
SHARE = {"axis": 0.01, "mems": 0.02, "meso": 0.02}  # of the readings
SMALLEST, LARGEST = 8.0, 0.7  # of a spike: over the noise, and over the rms of the law
APART = 5  # samples from one to the next


def plan(rng: Rng, count: int) -> list[tuple[str, ...]]:
    """Device and law: two of three cases are series."""
    series, poses = (rng.permutation(names).tolist() for names in (SERIES, POSES))
    return [
        (("mems", "meso")[k // 3 % 2], poses[k // 3 % len(poses)])
        if k % 3 == 2
        else ("axis", series[(k - k // 3) % len(series)])
        for k in range(count)
    ]


def make(wanted: tuple[str, ...], rng: Rng) -> rough_cases.Made:
    """One case."""
    device, law = wanted

    def series() -> rough_cases.Made:
        bench = axis_cases.draw_bench(rng, SECONDS)
        bench, planted, answer = rough_cases.on_axis(bench, device, (law,), rng, SIZE)
        sd, size, takes, count = bench.scene.noise, answer["planted"][0]["size"], [], 0
        for take in bench.takes:
            wild = 0 if take.role == "rest" else spikes(rng, len(take.noise), SHARE[device], size) * sd
            count += int(np.count_nonzero(wild))
            takes.append(replace(take, noise=take.noise + wild))
        bench = replace(bench, takes=tuple(takes))
        return (lambda d: messy.write(d, bench, planted)), answer | {"hidden_spikes": count}

    def poses() -> rough_cases.Made:
        bench = pose_cases.draw_bench(rng, device, False)
        bench, acts, dwell, answer = rough_cases.on_poses(bench, device, (law,), rng, SIZE)
        sd, size, noise, count = np.repeat(bench.poses.sd, 3), answer["planted"][0]["size"], {}, 0
        for role, e in bench.poses.noise.items():
            wild = spikes(rng, e.size, SHARE[device], size).reshape(e.shape)
            count += int(np.count_nonzero(wild))
            noise[role] = e + wild * sd
        wilder = replace(bench, poses=replace(bench.poses, noise=noise))
        return (lambda d: pose_cases.write(d, wilder, acts, dwell)), answer | {"hidden_spikes": count}

    return rough_cases.until(series if device == "axis" else poses, wanted)


def spikes(rng: Rng, n: int, share: float, size: float) -> Array:
    """(n,) zero, but for a `share` of samples, apart from each other; in standard deviations of the noise, for a law of `size`."""
    out = np.zeros(n)
    slots = rng.choice(np.arange(1, n // APART), max(1, round(share * n)), replace=False)
    at = slots * APART
    out[at] = rng.choice([-1, 1], len(at)) * rng.uniform(SMALLEST, max(LARGEST * size, 1.5 * SMALLEST), len(at))
    return out
