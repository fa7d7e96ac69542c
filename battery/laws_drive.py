"""Laws of the actuator and of what pushes from outside. Amplitude 0 is exactly the plain plant.

Each `make_*(scene, amplitude, **shape)` returns Hooks; each `draw_*(rng, scene)` the shape values.
"""

from __future__ import annotations

import math

import numpy as np

from battery.plant_axis import Hooks, Scene

BREAKING, ARRIVING = 3e-3, 2e-3  # s, how long an event takes from its begin on


def make_drive_gain(scene: Scene, a: float) -> Hooks:
    """u -> (1 + a) u."""
    return Hooks(drive=lambda t, u: u + a * u)


def make_saturation(scene: Scene, a: float, peak: float) -> Hooks:
    """The amplifier ends softly at (1 - a) `peak` [V]: the last 1 % bends over by tanh."""
    if a == 0:
        return Hooks(drive=lambda t, u: u)
    level = (1 - a) * peak
    knee, rest = 0.99 * level, 0.01 * level

    def drive(t: float, u: float) -> float:
        size = abs(u)
        return u if size <= knee else math.copysign(knee + rest * math.tanh((size - knee) / rest), u)

    return Hooks(drive=drive)


def make_dead_zone(scene: Scene, a: float) -> Hooks:
    """u - a tanh(u/a): nothing below about a [V], all but a above; the printed dead zone has corners."""
    return Hooks(drive=(lambda t, u: u - a * math.tanh(u / a)) if a else lambda t, u: u)


def make_lost_beams(scene: Scene, a: float, moment: float) -> Hooks:
    """k_f falls by the share a within 3 ms from `moment` [s] on."""

    def drive(t: float, u: float) -> float:
        return u * (1 - a * min(max((t - moment) / BREAKING, 0.0), 1.0))

    return Hooks(drive=drive)


def make_degradation(scene: Scene, a: float, tau: float) -> Hooks:
    """k_f falls by a (1 - exp(-t/tau))/(1 - exp(-span/tau)): a at the end of the clock, a little faster at first."""
    scale = a / (1 - math.exp(-scene.span / tau))
    return Hooks(drive=lambda t, u: u * (1 - scale * (1 - math.exp(-t / tau))))


def make_thermal_lag(scene: Scene, a: float, tau: float) -> Hooks:
    """The share a of the force arrives through a ladder of three equal R-C nodes whose longest time is `tau` [s].

    dT_1 = (u - 2 T_1 + T_2)/s, dT_2 = (T_1 - 2 T_2 + T_3)/s, dT_3 = (T_2 - T_3)/s; the slowest rate is 0.19806/s.
    """
    s = 0.19806226 * tau
    h = scene.step
    A = np.array([[-2.0, 1, 0], [1, -2, 1], [0, 1, -1]]) / s
    w, V = np.linalg.eigh(A)
    decay = np.exp(w * h).tolist()
    weight = (V[0] * V[2] / s / -w).tolist()  # of each mode in T_3 per steady u
    z = [0.0, 0.0, 0.0]

    def drive(t: float, u: float) -> float:
        out = 0.0
        for i in range(3):
            out += z[i]
            z[i] += (weight[i] * u - z[i]) * (1 - decay[i])
        return u + a * (out - u)

    return Hooks(drive=drive, direct=1 - a)


def make_vibration(scene: Scene, a: float, frequency: float, phase: float) -> Hooks:
    """A force a sin(2 pi f t + phase) [N]."""
    w = 2 * math.pi * frequency
    return Hooks(force=lambda t, q, v: a * math.sin(w * t + phase))


def make_step(scene: Scene, a: float, moment: float) -> Hooks:
    """A force a [N] that is there from `moment` [s] on, arriving within 2 ms."""
    return Hooks(force=lambda t, q, v: a * min(max((t - moment) / ARRIVING, 0.0), 1.0))


def _moment(rng: np.random.Generator, scene: Scene) -> dict[str, float]:
    return {"moment": float(rng.uniform(0.25, 0.5) * scene.span)}


def _frequency(scene: Scene) -> float:
    a = scene.axis
    return math.sqrt(max(a.stiffness / a.mass, (2 * math.pi * 15) ** 2)) / 2 / math.pi


def draw_vibration(rng: np.random.Generator, scene: Scene) -> dict[str, float]:
    """A line away from the resonance and from the multisine's own lines."""
    factor = float(rng.choice([rng.uniform(0.25, 0.8), rng.uniform(1.25, 1.8)]))
    return {"frequency": factor * _frequency(scene), "phase": float(rng.uniform(0, 2 * np.pi))}


DRAW = {
    "drive_gain": lambda rng, s: {},
    "saturation": lambda rng, s: {"peak": s.drive_peak},
    "dead_zone": lambda rng, s: {},
    "lost_beams": _moment,
    "degradation": lambda rng, s: {"tau": float(s.span * rng.uniform(0.7, 3))},
    "thermal_lag": lambda rng, s: {"tau": float(10 ** rng.uniform(-1.5, 0.0))},
    "vibration": draw_vibration,
    "step": _moment,
}
GUESS = {
    "drive_gain": lambda s: 0.2,
    "saturation": lambda s: 0.1,
    "dead_zone": lambda s: 0.01 * s.drive_peak,
    "lost_beams": lambda s: 1 / 15,
    "degradation": lambda s: 0.02,
    "thermal_lag": lambda s: 0.02,
    "vibration": lambda s: s.axis.force_constant * s.drive_peak * 0.002,
    "step": lambda s: s.axis.force_constant * s.drive_peak * 0.002,
}
