"""Memory of a displacement: hysteresis, play and creep, three functional forms each, on any sequence of places.

Each operator takes times `t` (n,) [s], evenly spaced, and places `x` (n,), begins at place 0 and returns what it adds to `x`, (n,).
The unit of `x` is free: `scale`, `reach`, radii and gaps are in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import fftconvolve, lfilter

from battery.plant_axis import Array

FAMILY = {
    "bouc_wen_motion": "hysteresis",
    "play_stack": "hysteresis",
    "preisach": "hysteresis",
    "free_play": "backlash",
    "worn_play": "backlash",
    "loose_joints": "backlash",
    "three_relaxations": "creep",
    "power_creep": "creep",
    "sinh_creep": "creep",
}
# Further forms, in a class of their own
FORMS = {
    **dict.fromkeys(("narrow_stack", "wide_stack", "humped_stack", "leaning_stack"), "hysteresis"),
    "play_of_many": "backlash",
    "long_creep": "creep",
}
FAMILIES = FAMILY | FORMS
DECADES = 6  # of `long_creep`


def bouc_wen_motion(t: Array, x: Array, a: float, reach: float, loop: float, power: float) -> Array:
    """-a z, dz = dx (1 - |z/reach|^power (loop sgn(dx z) + 1 - loop)): R. Bouc (1967), Y. K. Wen (1976).

    Midpoint rule over equal parts of a step, each at most a twentieth of `reach`.
    """
    z, last, out = 0.0, 0.0, []

    def slope(z: float, way: float) -> float:
        return 1 - abs(z / reach) ** power * (loop * math.copysign(1, way * z) + 1 - loop)

    for place in x.tolist():
        step = place - last
        last = place
        parts = max(1, math.ceil(abs(step) / (reach / 20)))
        h = step / parts
        for _ in range(parts):
            z += h * slope(z + h / 2 * slope(z, h), h)
        out.append(z)
    return -a * np.array(out)


def _play(x: Array, half: float, w: float) -> Array:
    out = []
    for place in x.tolist():
        w = min(max(w, place - half), place + half)
        out.append(w)
    return np.array(out)


def play_stack(t: Array, x: Array, a: float, radii: list[float], weights: list[float]) -> Array:
    """a sum_j w_j (play of half width r_j - x), Prandtl-Ishlinskii; sum w_j = 1."""
    return a * sum(w * (_play(x, r, 0.0) - x) for r, w in zip(radii, weights, strict=True))


def leaning_stack(
    t: Array, x: Array, a: float, radii: list[float], weights: list[float], scale: float, up: float, down: float
) -> Array:
    """a sum_j w_j (w_j - x), w_j dragged between x - r_j (1 + down f) and x + r_j (1 + up f), f = tanh(|x|/scale): each edge of the
    play leans out in its own way."""
    lean, out = np.tanh(np.abs(x) / scale), np.zeros_like(x)
    for r, weight in zip(radii, weights, strict=True):
        w, path = 0.0, []
        edges = zip(x.tolist(), (x - r * (1 + down * lean)).tolist(), (x + r * (1 + up * lean)).tolist(), strict=True)
        for place, low, high in edges:
            w = max(min(w, high), low)
            path.append(w - place)
        out += weight * np.array(path)
    return a * out


def preisach(t: Array, x: Array, a: float, scale: float, skew: float) -> Array:
    """a scale P(w), w = tanh(x/scale), Preisach's model with the density 1 + skew (alpha + beta)/2 of relays in w.

    On a branch from the turning point b to w the output changes by 2 E(w, b), E the integral of the density over the triangle
    of the relays switched: E = (w - b)^2 (1 + skew (w + b)/2)/2 upwards. A loop that closes leaves no trace.
    """

    def triangle(w: float, b: float) -> float:
        return math.copysign((w - b) ** 2 * (1 + skew * (w + b) / 2), w - b)

    turns: list[tuple[float, float]] = []  # (w, output) of the turning points that are remembered, oldest first
    last, value, way, out = 0.0, 0.0, 0.0, []
    for w in np.tanh(x / scale).tolist():
        if w != last:
            if way and (w - last) * way < 0:
                turns.append((last, value))
            way = w - last
            while len(turns) > 1 and (w - turns[-2][0]) * way >= 0:
                del turns[-2:]
            if len(turns) == 1 and abs(w) >= abs(turns[0][0]):
                turns.clear()
            value = turns[-1][1] + triangle(w, turns[-1][0]) if turns else math.copysign(2 * w * w, w)
            last = w
        out.append(value)
    return a * scale * np.array(out)


def free_play(t: Array, x: Array, a: float, start: float) -> Array:
    """Dragged through a gap a; it begins at `start`, -1 to 1, of half the gap."""
    return _play(x, a / 2, start * a / 2) - x if a else np.zeros_like(x)


def worn_play(t: Array, x: Array, a: float, start: float, scale: float, wear: float) -> Array:
    """As `free_play`, the gap wider on one side of the travel: a (1 + wear tanh(x/scale))."""
    w, out = start * a / 2, []
    for place, half in zip(x.tolist(), (a / 2 * (1 + wear * np.tanh(x / scale))).tolist(), strict=True):
        w = min(max(w, place - half), place + half)
        out.append(w)
    return np.array(out) - x if a else np.zeros_like(x)


def loose_joints(t: Array, x: Array, a: float, start: float, spread: float) -> Array:
    """The mean of three gaps, a (1 - spread), a, a (1 + spread): what hangs on three joints."""
    return sum(free_play(t, x, a * (1 + s), start) for s in (-spread, 0.0, spread)) / 3


def play_of_many(t: Array, x: Array, a: float, start: float, spread: float, joints: int) -> Array:
    """As `loose_joints`, of `joints` gaps evenly within a (1 +- spread): a chain whose links take up their slack one by one."""
    shares = np.linspace(-spread, spread, joints)
    return sum(free_play(t, x, a * (1 + s), start) for s in shares.tolist()) / joints


def three_relaxations(t: Array, x: Array, a: float, tau: float) -> Array:
    """a (0.5 lag(x, tau) + 0.3 lag(x, 4 tau) + 0.2 lag(x, 15 tau))."""
    out = np.zeros_like(x)
    for weight, times in ((0.5, 1.0), (0.3, 4.0), (0.2, 15.0)):
        d = math.exp(-(t[1] - t[0]) / times / tau)
        out += weight * lfilter([1 - d], [1, -d], x)
    return a * out


def long_creep(t: Array, x: Array, a: float, first: float) -> Array:
    """a sum_i lag(x, tau_i)/n, four tau_i a decade over `DECADES` decades from `first` [s]: a logarithm of time that no record ends."""
    out, step = np.zeros_like(x), t[1] - t[0]
    times = first * np.logspace(0, DECADES, 4 * DECADES + 1)
    for tau in times.tolist():
        d = math.exp(-step / tau)
        out += lfilter([1 - d], [1, -d], x)
    return a * out / len(times)


def power_creep(t: Array, x: Array, a: float, tau: float, power: float) -> Array:
    """a sum of the steps of x, each times (its age/tau)^power: W. N. Findley's law."""
    age = (t - t[0]) / tau
    return a * fftconvolve(np.diff(x, prepend=0.0), age**power)[: len(x)]


def sinh_creep(t: Array, x: Array, a: float, tau: float, scale: float) -> Array:
    """a z, dz/dt = scale/tau sinh((x - z)/scale), H. Eyring's flow: exact for x held over a step."""
    decay = math.exp(-(t[1] - t[0]) / tau)
    z, out = 0.0, []
    for place in x.tolist():
        z = place - 2 * scale * math.atanh(math.tanh((place - z) / 2 / scale) * decay)
        out.append(z)
    return a * np.array(out)


# As `play_stack`, radii in even ratios, with most of the weight on the narrowest, on the widest, or in two humps
WEIGHTED = ("narrow_stack", "wide_stack", "humped_stack")
OPERATORS: dict[str, Callable[..., Array]] = {
    f.__name__: f
    for f in (
        bouc_wen_motion,
        play_stack,
        leaning_stack,
        preisach,
        free_play,
        worn_play,
        loose_joints,
        play_of_many,
        three_relaxations,
        long_creep,
        power_creep,
        sinh_creep,
    )
} | dict.fromkeys(WEIGHTED, play_stack)


def added(name: str, amplitude: float, shape: dict[str, Any], t: Array, x: Array) -> Array:
    """What the law `name` adds to the places `x` (n,) at `t` (n,) [s]."""
    return OPERATORS[name](t, x, amplitude, **shape)


def draw_shape(name: str, rng: np.random.Generator, travel: float, clock: float) -> dict[str, Any]:
    """Shape values for a motion of rms `travel` that is watched for some multiples of `clock` [s]."""

    def between(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    if name == "bouc_wen_motion":
        return {"reach": travel * between(0.3, 1.0), "loop": between(0.6, 0.9), "power": between(1.0, 2.0)}
    if name == "play_stack":
        n = int(rng.integers(9, 13))
        weights = np.exp(-between(0.0, 2.0) * np.linspace(0, 1, n)) * rng.uniform(0.7, 1.3, n)
        radii = travel * np.linspace(0.04, between(0.6, 1.2), n) ** between(0.9, 1.3)
        return {"radii": radii.tolist(), "weights": (weights / weights.sum()).tolist()}
    if name in WEIGHTED:
        radii = travel * np.geomspace(0.01, between(0.5, 1.5), int(rng.integers(10, 14)))
        weights = rng.exponential(1.0, len(radii)) * radii ** -between(0.1, 0.5)
        if name == "wide_stack":
            weights = weights[::-1]
        if name == "humped_stack":
            at, places = np.linspace(0, 1, len(radii)), (between(0.0, 0.3), between(0.7, 1.0))
            weights = sum(between(0.5, 1.0) * np.exp(-(((at - c) / 0.12) ** 2)) for c in places)
        return {"radii": radii.tolist(), "weights": (weights / weights.sum()).tolist()}
    if name == "leaning_stack":
        radii, weights = travel * rng.uniform(0.1, 0.7, 3), rng.uniform(0.5, 1.5, 3)
        leans = rng.permutation([between(0.6, 1.6), between(-0.3, 0.3)]).tolist()
        shape = {"radii": radii.tolist(), "weights": (weights / weights.sum()).tolist()}
        return shape | {"scale": travel * between(0.8, 2.0), "up": leans[0], "down": leans[1]}
    if name == "preisach":
        return {"scale": travel * between(1.5, 3.0), "skew": between(-0.4, 0.4)}
    start = {"start": between(-1, 1)}
    if name == "long_creep":
        return {"first": clock * 10 ** between(-3.5, -2.5)}
    if name in {"three_relaxations", "power_creep", "sinh_creep"}:
        start = {"tau": clock * between(0.2, 1.0)}
    more = {
        "worn_play": {"scale": travel, "wear": between(0.1, 0.3)},
        "loose_joints": {"spread": between(0.05, 0.2)},
        "play_of_many": {"spread": between(0.2, 0.5), "joints": int(rng.integers(5, 9))},
        "power_creep": {"power": between(0.15, 0.4)},
        "sinh_creep": {"scale": travel * between(0.7, 1.5)},
    }
    return start | more.get(name, {})
