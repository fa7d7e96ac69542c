"""Laws that act in a region only: of position, speed, direction, drive, temperature or time. Amplitude 0 is exactly the plain plant.

An edge is a straight ramp over a short way, or none where the law grows from zero at it. Each law states its region, SI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from battery import laws_stage
from battery.laws_drive import ARRIVING
from battery.laws_stage import lugre
from battery.plant_axis import Array, Hooks, Planted, Scene
from battery.region import Region

Rng = np.random.Generator
RAMP = 0.02  # of the rms travel, over which a law in a part of the travel sets in
REST = 1e-3  # of the level of friction one way that is left the other way: bristles need some
PRESLIDING = 0.003  # of the rms travel


def _beyond(scene: Scene, at: float, side: float) -> Callable[[float], float]:
    """0 before the place `at` on its `side`, 1 beyond, straight between."""
    width = RAMP * scene.travel

    def share(q: float) -> float:
        return min(max(side * (q - at) / width + 0.5, 0.0), 1.0)

    return share


def _gated(force: Callable[..., float], share: Callable[[float, float], float]) -> Hooks:
    """`force`(t, q, v), whose memory goes on everywhere, times `share`(t, q)."""
    return Hooks(force=lambda t, q, v: share(t, q) * force(t, q, v))


def make_friction_there(scene: Scene, a: float, at: float, side: float) -> Hooks:
    """Bristles of level a [N] beyond the place `at`."""
    if not a:
        return Hooks()
    on = _beyond(scene, at, side)
    return _gated(lugre(scene, lambda v: a, a / PRESLIDING / scene.travel), lambda t, q: on(q))


def _between(scene: Scene, at: float, half: float) -> Callable[[float], float]:
    """1 within `half` of the place `at`, straight down to 0 outside over the way of an edge."""
    width = RAMP * scene.travel

    def share(q: float) -> float:
        return min(max((half - abs(q - at)) / width + 0.5, 0.0), 1.0)

    return share


def make_friction_between(scene: Scene, a: float, at: float, half: float) -> Hooks:
    """Bristles of level a [N] within `half` of the place `at`: a tight spot."""
    if not a:
        return Hooks()
    on = _between(scene, at, half)
    return _gated(lugre(scene, lambda v: a, a / PRESLIDING / scene.travel), lambda t, q: on(q))


def make_damping_between(scene: Scene, a: float, at: float, half: float) -> Hooks:
    """F = -a v within `half` of the place `at`, `a` [N s/m]."""
    on = _between(scene, at, half)
    return Hooks(force=lambda t, q, v: -a * v * on(q))


def make_friction_from(scene: Scene, a: float, moment: float) -> Hooks:
    """Bristles of level a [N] from `moment` [s] on."""
    if not a:
        return Hooks()
    force = lugre(scene, lambda v: a, a / PRESLIDING / scene.travel)
    return _gated(force, lambda t, q: min(max((t - moment) / ARRIVING, 0.0), 1.0))


def make_stick_from(scene: Scene, a: float, moment: float, ratio: float, speed: float) -> Hooks:
    """As `friction_from`, stronger by `ratio` below about `speed`."""
    if not a:
        return Hooks()
    force = lugre(scene, lambda v: a * (1 + (ratio - 1) * math.exp(-((v / speed) ** 2))), a / PRESLIDING / scene.travel)
    return _gated(force, lambda t, q: min(max((t - moment) / ARRIVING, 0.0), 1.0))


def make_friction_one_way(scene: Scene, a: float, way: float) -> Hooks:
    """Bristles of level a [N] on the `way` +1 or -1, next to none on the other."""
    if not a:
        return Hooks()
    return Hooks(force=lugre(scene, lambda v: a if v * way > 0 else REST * a, a / PRESLIDING / scene.travel))


def make_damping_there(scene: Scene, a: float, at: float, side: float) -> Hooks:
    """F = -a v beyond the place `at`, `a` [N s/m]."""
    on = _beyond(scene, at, side)
    return Hooks(force=lambda t, q, v: -a * v * on(q))


def make_damping_fast(scene: Scene, a: float, above: float, bend: float) -> Hooks:
    """F = -a x (1 + bend x/above) against the motion, x = |v| - above where positive, `a` [N s/m]."""

    def force(t: float, q: float, v: float) -> float:
        x = abs(v) - above
        return -math.copysign(a * x * (1 + bend * x / above), v) if x > 0 else 0.0

    return Hooks(force=force)


def make_knee(scene: Scene, a: float, at: float, side: float, bend: float) -> Hooks:
    """A spring a [N/m] that acts beyond the place `at` only: F = -a x (1 + bend x/peak)."""

    def force(t: float, q: float, v: float) -> float:
        x = side * (q - at)
        return -side * a * x * (1 + bend * x / scene.peak) if x > 0 else 0.0

    return Hooks(force=force)


def make_stop_there(scene: Scene, a: float, at: float, side: float) -> Hooks:
    """A rubber stop at the place `at`: F = -a x sqrt(x/(0.1 peak)) beyond it, Hertz's contact, `a` [N/m]."""

    def force(t: float, q: float, v: float) -> float:
        x = side * (q - at)
        return -side * a * x * math.sqrt(x / (0.1 * scene.peak)) if x > 0 else 0.0

    return Hooks(force=force)


def make_scratch(scene: Scene, a: float, at: float, half: float) -> Hooks:
    """y -> y + a (1 - x^2) for |x| < 1, x = (y - at)/half: a bruise of the scale."""
    return Hooks(sensed=lambda t, y, T: y + a * np.maximum(1 - ((y - at) / half) ** 2, 0.0))


def make_gain_beyond(scene: Scene, a: float, above: float) -> Hooks:
    """The drive beyond `above` [V] counts 1 + a."""
    return Hooks(drive=lambda t, u: u + math.copysign(a * max(abs(u) - above, 0.0), u))


def make_play_there(scene: Scene, a: float, at: float, side: float) -> Hooks:
    """The target is dragged through a gap a [m] beyond the place `at`, and tight before it: a worn stretch of a screw."""
    width = 10 * RAMP * scene.travel

    def carried(t: Array, q: Array, u: Array) -> Array:
        halves = a / 2 * np.clip(side * (q - at) / width, 0.0, 1.0)
        x, out = 0.0, []
        for place, half in zip(q.tolist(), halves.tolist(), strict=True):
            x = min(max(x, place - half), place + half)
            out.append(x)
        return np.array(out)

    return Hooks(carried=carried)


def make_warm_reading(scene: Scene, a: float, above: float) -> Hooks:
    """y -> y + a (T - above) where it is warmer, a [m/K]."""
    return Hooks(sensed=lambda t, y, T: y + a * np.maximum(T - above, 0.0))


def _place(rng: Rng, s: Scene) -> dict[str, float]:
    return {"at": float(rng.uniform(-0.7, 0.7) * s.travel), "side": float(rng.choice([-1, 1]))}


def _far(rng: Rng, s: Scene) -> dict[str, float]:
    """Away from home: a spring that acts on the far side of home, and one that is missing on the near side, are one."""
    return _side(rng, float(rng.uniform(0.2, 0.8) * s.travel))


def _side(rng: Rng, at: float) -> dict[str, float]:
    side = float(rng.choice([-1, 1]))
    return {"at": side * at, "side": side}


def _moment(rng: Rng, s: Scene) -> dict[str, float]:
    return {"moment": float(rng.uniform(0.25, 0.5) * s.span)}


def _stretch(rng: Rng, s: Scene) -> dict[str, float]:
    return {"at": float(rng.uniform(-0.6, 0.6) * s.travel), "half": float(rng.uniform(0.2, 0.4) * s.travel)}


DRAW: dict[str, Callable[[Rng, Scene], dict[str, Any]]] = {
    "friction_there": _place,
    "friction_between": _stretch,
    "friction_from": _moment,
    "stick_from": lambda rng, s: (
        _moment(rng, s) | {"ratio": float(rng.uniform(1.5, 2.2)), "speed": float(rng.uniform(0.1, 0.3) * s.speed)}
    ),
    "friction_one_way": lambda rng, s: {"way": float(rng.choice([-1, 1]))},
    "damping_there": _place,
    "damping_between": _stretch,
    "damping_fast": lambda rng, s: {
        "above": float(rng.uniform(0.6, 1.3) * s.speed),
        "bend": float(rng.uniform(0, 0.1)),
    },
    "knee": lambda rng, s: _far(rng, s) | {"bend": float(rng.uniform(0, 0.2))},
    "stop_there": lambda rng, s: _side(rng, float(rng.uniform(0.6, 0.85) * s.peak)),
    "scratch": lambda rng, s: {
        "at": float(rng.uniform(-1, 1) * s.travel),
        "half": float(rng.uniform(0.2, 0.5) * s.travel),
    },
    "gain_beyond": lambda rng, s: {"above": float(rng.uniform(0.2, 0.45) * s.drive_peak)},
    "play_there": _place,
    "warm_reading": lambda rng, s: {"above": 295.0},
}
GUESS: dict[str, Callable[[Scene], float]] = {
    **dict.fromkeys(
        ("friction_there", "friction_between", "friction_from", "friction_one_way"), laws_stage.GUESS["coulomb"]
    ),
    "stick_from": laws_stage.GUESS["stribeck"],
    **dict.fromkeys(("damping_there", "damping_between", "damping_fast"), laws_stage.GUESS["viscous"]),
    "knee": lambda s: 0.05 * max(s.axis.stiffness, 1e3),
    "stop_there": lambda s: max(s.axis.stiffness, 1e3),
    "scratch": lambda s: 30 * s.noise,
    "gain_beyond": lambda s: 0.05,
    "play_there": lambda s: 0.005 * s.travel,
    "warm_reading": lambda s: 100 * s.noise,
}
EITHER_SIGN = ("scratch", "gain_beyond", "warm_reading")
NAMES = tuple(DRAW)


def signed(rng: Rng, planted: Planted) -> Planted:
    """The law with either sign of its amplitude, where both are physics."""
    return (
        replace(planted, amplitude=planted.amplitude * float(rng.choice([-1, 1])))
        if (planted.name in EITHER_SIGN)
        else planted
    )


def region_of(planted: Planted) -> Region:
    """Where the law acts."""
    s = planted.shape
    if "side" in s:
        return Region("position", s["at"], np.inf) if s["side"] > 0 else Region("position", -np.inf, s["at"])
    if "half" in s:
        return Region("position", s["at"] - s["half"], s["at"] + s["half"])
    if "moment" in s:
        return Region("time", s["moment"], np.inf)
    if "way" in s:
        return Region("velocity", 0.0, np.inf) if s["way"] > 0 else Region("velocity", -np.inf, 0.0)
    of = {"damping_fast": "speed", "gain_beyond": "drive size", "warm_reading": "temperature"}[planted.name]
    return Region(of, s["above"], np.inf)
