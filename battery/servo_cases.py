"""Draws a piezo axis without dynamics, commanded in volts or in displacement: its drives, noise and records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from battery.axis_cases import Array, Bench, Rng, Take, draw_noise, filtered_noise
from battery.plant_axis import Axis, Scene

SAMPLE_TIME = 0.01  # s
GAIN_SD = 0.05


def levels(rng: Rng, n: int) -> Array:
    """Random levels within +-1, ramps of 0.3 to 1 s, dwells of 0.3 to 3 s."""
    u, k, at = np.zeros(n), 20, 0.0
    while k < n:
        to = float(rng.uniform(-1, 1))
        ramp, dwell = int(rng.uniform(0.3, 1) / SAMPLE_TIME), int(rng.uniform(0.3, 3) / SAMPLE_TIME)
        part = np.concatenate([np.linspace(at, to, ramp), np.full(dwell, to)])
        u[k : k + len(part)] = part[: max(0, n - k)]
        k, at = k + len(part), to
    return u


def swells(rng: Rng, n: int) -> Array:
    """Triangles of 0.3 to 1 Hz whose height swells and falls within +-1."""
    t = np.arange(n) * SAMPLE_TIME
    phase = rng.uniform(0.3, 1.0) * t % 1
    triangle = 4 * np.abs((phase + 0.75) % 1 - 0.5) - 1
    return triangle * (0.15 + 0.85 * np.sin(np.pi * t / t[-1] * rng.uniform(0.8, 1.0)) ** 2)


def draw_bench(rng: Rng, seconds: float = 30.0) -> Bench:
    """A bench with records of levels and swells to fit, a random wander with a dwell held out, and perhaps one at rest."""
    volts = bool(rng.uniform() < 0.5)
    reach = float(rng.uniform(2e-5, 5e-5))  # m
    limit = 100.0 if volts else 6e-5
    gain = reach / 90.0 if volts else 1.0  # m/V
    true = Axis(0.0, 0.0, 1.0, gain, 6e-5, limit)
    error = GAIN_SD * float(np.clip(rng.standard_normal(), -1.8, 1.8)) if volts else 0.0
    stated = replace(true, force_constant=float(f"{gain * (1 + error):.4g}"))
    n = int(seconds / SAMPLE_TIME)
    half = n // 2
    fit = np.concatenate([levels(rng, half), swells(rng, n - half)])
    fit[half:] += (fit[half - 1] - fit[half]) * np.exp(-np.arange(n - half) * SAMPLE_TIME / 0.3)
    m = int(0.8 * n)
    held = filtered_noise(rng, m, SAMPLE_TIME, 1.0)
    held[int(0.8 * m) :] = held[int(0.8 * m)]
    sd = float(10 ** rng.uniform(-8.6, -7.9))
    phi = float(rng.choice([0.0, rng.uniform(0.3, 0.85)]))
    takes, clock = [], 0.0
    rest = [("rest", np.zeros(300))] if rng.uniform() < 0.6 else []
    scale = reach / gain * 0.9
    for role, drive in [*rest, ("fit", fit * scale), ("hold_out", held * scale)]:
        takes.append(Take(role, drive, draw_noise(rng, sd, phi, len(drive)), None, clock))
        clock += len(drive) * SAMPLE_TIME + 5
    q = fit * 0.9 * reach
    scene = Scene(
        true,
        float(q.std()),
        float(np.gradient(q, SAMPLE_TIME).std()),
        float(np.abs(q).max()),
        float(scale),
        clock,
        sd,
        SAMPLE_TIME,
    )
    return Bench(true, stated, scene, tuple(takes), True, bool(rng.uniform() < 0.5), {"sd": sd, "phi": phi})


def device_text(stated: Axis) -> str:
    """device.toml as a maker would write it."""
    lines = [
        'kind = "servo"',
        'name = "stage"',
        'title = "A piezo stage on one axis"',
        'source = "data sheet"',
        f'travel = "{stated.stroke * 1e6:g} um"',
    ]
    if not commanded(stated):
        gain = stated.force_constant / stated.stiffness * 1e6
        lines += [
            "",
            "[transducer]",
            f'gain = {{ value = "{gain:.6g} um/V", sd = "{GAIN_SD * gain:.3g} um/V", source = "data sheet" }}',
            f'drive_limit = "{stated.drive_limit:g} V"',
        ]
    return "\n".join(lines) + "\n"


def commanded(stated: Axis) -> bool:
    """Whether the command is the position itself."""
    return stated.mass == 0 and stated.force_constant == stated.stiffness
