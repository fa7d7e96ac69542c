"""The memories of `battery.memory` as laws of an axis: between the stage and the sensor's target."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from battery.memory import OPERATORS, added, draw_shape
from battery.plant_axis import Hooks, Scene


def _maker(name: str) -> Callable[..., Hooks]:
    def make(scene: Scene, a: float, **shape: Any) -> Hooks:
        return Hooks(carried=lambda t, q, u: q + added(name, a, shape, t, q))

    return make


MAKE = {name: _maker(name) for name in OPERATORS}
DRAW = {name: (lambda rng, s, name=name: draw_shape(name, rng, s.travel, 1000 * s.sample_time)) for name in OPERATORS}
GUESS = {name: (lambda s: 0.01) for name in OPERATORS} | {
    name: (lambda s: 0.005 * s.travel) for name in ("free_play", "worn_play", "loose_joints", "play_of_many")
}
