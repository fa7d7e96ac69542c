"""Laws of the sensor: what is read for a given place of the target. Amplitude 0 is exactly the plain sensor."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import bilinear, lfilter

from battery.plant_axis import Array, Hooks, Scene


def make_sensor_gain(scene: Scene, a: float) -> Hooks:
    """y -> (1 + a) y."""
    return Hooks(sensed=lambda t, y, T: y + a * y)


def make_home_offset(scene: Scene, a: float) -> Hooks:
    """y -> y + a [m]."""
    return Hooks(sensed=lambda t, y, T: y + a)


def make_bow(scene: Scene, a: float, span: float, cubic: float) -> Hooks:
    """y -> y + a (x^2 + cubic x^3), x = y/span; a [m] at x = 1."""
    return Hooks(sensed=lambda t, y, T: y + a * ((y / span) ** 2 + cubic * (y / span) ** 3))


def make_cyclic(scene: Scene, a: float, period: float, phase: float, second: float) -> Hooks:
    """y -> y + a (sin(p) + second sin(2 p)), p = 2 pi y/period + phase."""

    def sensed(t: Array, y: Array, T: Array) -> Array:
        p = 2 * math.pi * y / period + phase
        return y + a * (np.sin(p) + second * np.sin(2 * p))

    return Hooks(sensed=sensed)


def make_drift(scene: Scene, a: float, seed: int, wander: float) -> Hooks:
    """y -> y + a t/span + a random walk whose sd at the end of the clock is `wander` |a|; on one clock for all records."""
    n = 2000
    walk = np.cumsum(np.random.default_rng(seed).standard_normal(n)) / math.sqrt(n)

    def sensed(t: Array, y: Array, T: Array) -> Array:
        x = t / scene.span
        return y + a * x + abs(a) * wander * np.interp(x, np.linspace(0, 1.05, n), walk)

    return Hooks(sensed=sensed)


def make_temperature(scene: Scene, a: float, reference: float) -> Hooks:
    """y -> y + a (T - reference), a [m/K]."""
    return Hooks(sensed=lambda t, y, T: y + a * (T - reference))


def make_low_pass(scene: Scene, a: float, ratio: float) -> Hooks:
    """Second order: y'' a^2 + 2 ratio a y' + y = input, a = 1/w [s]; bilinear on the fine grid."""
    if a == 0:
        return Hooks(sensed=lambda t, y, T: y)
    b, d = bilinear([1.0], [a * a, 2 * ratio * a, 1.0], 1 / scene.step)

    def sensed(t: Array, y: Array, T: Array) -> Array:
        return y[0] + lfilter(b, d, y - y[0])

    return Hooks(sensed=sensed)


def make_delay(scene: Scene, a: float) -> Hooks:
    """y(t) -> y(t - a), any fraction of a sample: cubic interpolation on the fine grid."""

    def sensed(t: Array, y: Array, T: Array) -> Array:
        from scipy.interpolate import CubicSpline

        return CubicSpline(t, y)(np.maximum(t - a, t[0])) if a else y

    return Hooks(sensed=sensed)


def make_quantisation(scene: Scene, a: float, shift: float) -> Hooks:
    """The converter's steps of a [m], mid-tread at `shift` of a step; after the noise."""
    return Hooks(digital=lambda t, y: a * (np.round(y / a + shift) - shift) if a else y)


def make_stuck(scene: Scene, a: float, begin: float) -> Hooks:
    """The reading repeats itself for a [s] from `begin` [s] of the clock on."""

    def digital(t: Array, y: Array) -> Array:
        held = (t >= begin) & (t < begin + a)
        if not held.any():
            return y
        y = y.copy()
        y[held] = y[np.argmax(held)]
        return y

    return Hooks(digital=digital)


DRAW = {
    "sensor_gain": lambda rng, s: {},
    "home_offset": lambda rng, s: {},
    "bow": lambda rng, s: {"span": s.peak, "cubic": float(rng.uniform(-0.1, 0.1))},
    "cyclic": lambda rng, s: {
        "period": float(rng.choice([158e-9, 316.4e-9, 2e-6, 20e-6])) if s.peak < 1e-3 else s.peak / 20,
        "phase": float(rng.uniform(0, 2 * np.pi)),
        "second": float(rng.uniform(0, 0.2)),
    },
    "drift": lambda rng, s: {"seed": int(rng.integers(2**31)), "wander": 0.1},
    "temperature_sensitivity": lambda rng, s: {"reference": 295.15},
    "low_pass": lambda rng, s: {"ratio": float(rng.uniform(0.6, 0.9))},
    "delay": lambda rng, s: {},
    "quantisation": lambda rng, s: {"shift": float(rng.uniform(0, 1))},
    "stuck": lambda rng, s: {"begin": float(rng.uniform(0.2, 0.4) * s.span)},
}
GUESS = {
    "sensor_gain": lambda s: 0.2,
    "home_offset": lambda s: 20 * s.noise,
    "bow": lambda s: 0.01 * s.peak,
    "cyclic": lambda s: 3 * s.noise,
    "drift": lambda s: 10 * s.noise,
    "temperature_sensitivity": lambda s: 10 * s.noise,
    "low_pass": lambda s: 1 / (2 * math.pi * 250),
    "delay": lambda s: 0.6 * s.sample_time,
    "quantisation": lambda s: 6 * s.noise,
    "stuck": lambda s: 0.08 * s.span,
}
MAKE = {
    "temperature_sensitivity": make_temperature,
}
