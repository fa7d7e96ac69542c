"""Physics that no library has: the right answer to these is "unexplained"."""

from __future__ import annotations

import math

import numpy as np

from battery.plant_axis import Array, Hooks, Scene


def make_unseen_clock(scene: Scene, a: float, period: float, duty: float) -> Hooks:
    """The spring is stiffer by the share a whenever a clock that nobody recorded is on, edges of 20 ms."""

    def force(t: float, q: float, v: float) -> float:
        x = (t % period) / period - duty
        return -a * scene.axis.stiffness * q * 0.5 * (1 - math.tanh(x * period / 0.02))

    return Hooks(force=force)


def make_hidden_chaos(scene: Scene, a: float, rate: float, seed: int) -> Hooks:
    """A force a x(t)/8 [N] from a Lorenz system (10, 28, 8/3) running `rate` times a second: E. N. Lorenz, J. Atmos. Sci. 20 (1963)."""
    state = list(np.random.default_rng(seed).uniform(1, 9, 3))
    h = scene.step * rate

    def force(t: float, q: float, v: float) -> float:
        x, y, z = state
        dx, dy, dz = 10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z
        X, Y, Z = x + h / 2 * dx, y + h / 2 * dy, z + h / 2 * dz
        state[:] = [x + h * 10 * (Y - X), y + h * (X * (28 - Z) - Y), z + h * (X * Y - 8 / 3 * Z)]
        return a * x / 8

    return Hooks(force=force)


def make_parametric(scene: Scene, a: float, frequency: float, phase: float) -> Hooks:
    """F = -a k sin(2 pi f t + phase) q: a spring that breathes."""
    w, k = 2 * math.pi * frequency, scene.axis.stiffness
    return Hooks(force=lambda t, q, v: -a * k * math.sin(w * t + phase) * q)


def make_telegraph(scene: Scene, a: float, dwell: float, seed: int) -> Hooks:
    """The reading jumps between +-a/2 at random moments, `dwell` [s] apart on average."""
    rng = np.random.default_rng(seed)
    edges = np.cumsum(rng.exponential(dwell, int(6 * scene.span / dwell) + 10))

    def sensed(t: Array, y: Array, T: Array) -> Array:
        return y + a * ((np.searchsorted(edges, t) % 2) - 0.5)

    return Hooks(sensed=sensed)


def make_fading_duhem(scene: Scene, a: float, width: float, fade: float) -> Hooks:
    """dz = (1 - z^3 sign(dq)) (1 + z^2) dq/width - z |z| dt/fade, F = -a z [N]: a Duhem law that forgets."""
    z = [0.0]
    last = [0.0]
    h = scene.step

    def force(t: float, q: float, v: float) -> float:
        dq = q - last[0]
        last[0] = q
        x = z[0]
        x += (1 - x**3 * math.copysign(1, dq)) * (1 + x * x) * dq / width - x * abs(x) * h / fade
        z[0] = min(max(x, -1.0), 1.0)
        return -a * z[0]

    return Hooks(force=force)


def make_clock_jitter(scene: Scene, a: float, seed: int) -> Hooks:
    """The sample is taken a n_k [s] late or early, n_k slow random numbers: an error that grows with speed."""

    def sensed(t: Array, y: Array, T: Array) -> Array:
        apart = 25 * scene.substeps
        n = np.random.default_rng([seed, round(t[0] * 1e3)]).standard_normal(len(t) // apart + 3)
        late = np.interp(t - t[0], np.arange(len(n)) * apart * scene.step, n)
        return np.interp(t - a * late, t, y)

    return Hooks(sensed=sensed)


def make_turning_points(scene: Scene, a: float, seed: int) -> Hooks:
    """The reading remembers the last turning point and how long ago it was: y + a sin(3 x_turn/travel) exp(-age/0.2 s)."""

    def sensed(t: Array, y: Array, T: Array) -> Array:
        turns = np.flatnonzero(np.diff(np.sign(np.diff(y)))) + 1
        if len(turns) == 0:
            return y
        which = np.searchsorted(turns, np.arange(len(y)), side="right") - 1
        at = turns[np.maximum(which, 0)]
        memory = np.sin(3 * y[at] / scene.travel) * np.exp(-(t - t[at]) / 0.2)
        return y + a * np.where(which >= 0, memory, 0.0)

    return Hooks(sensed=sensed)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _own(s: Scene) -> float:
    return math.sqrt(s.axis.stiffness / s.axis.mass) / 2 / math.pi


DRAW = {
    "unseen_clock": lambda rng, s: {"period": float(rng.uniform(0.4, 1.1)), "duty": float(rng.uniform(0.3, 0.6))},
    "hidden_chaos": lambda rng, s: {"rate": float(rng.uniform(8, 25)), "seed": _seed(rng)},
    "parametric": lambda rng, s: {
        "frequency": float(rng.uniform(0.6, 1.9) * _own(s)),
        "phase": float(rng.uniform(0, 6.28)),
    },
    "telegraph": lambda rng, s: {"dwell": float(rng.uniform(0.02, 0.1)), "seed": _seed(rng)},
    "fading_duhem": lambda rng, s: {"width": 0.5 * s.travel, "fade": float(rng.uniform(0.02, 0.1))},
    "clock_jitter": lambda rng, s: {"seed": _seed(rng)},
    "turning_points": lambda rng, s: {"seed": _seed(rng)},
}
GUESS = {
    "unseen_clock": lambda s: 0.005,
    "hidden_chaos": lambda s: 0.003 * s.axis.force_constant * s.drive_peak,
    "parametric": lambda s: 0.005,
    "telegraph": lambda s: 10 * s.noise,
    "fading_duhem": lambda s: 0.003 * s.axis.force_constant * s.drive_peak,
    "clock_jitter": lambda s: 1e-6,
    "turning_points": lambda s: 10 * s.noise,
}
