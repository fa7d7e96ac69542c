"""All laws by name: how to draw their shapes, how large to begin, how to build them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from battery import laws_drive, laws_memory, laws_region, laws_sensor, laws_stage, laws_strange
from battery.plant_axis import Axis, Hooks, Planted, Scene, digitise, move, read

MODULES = (laws_drive, laws_stage, laws_sensor, laws_strange, laws_memory, laws_region)
DRAW = {name: draw for module in MODULES for name, draw in module.DRAW.items()}
GUESS = {name: guess for module in MODULES for name, guess in module.GUESS.items()}
STRANGE = tuple(laws_strange.DRAW)
MAKE = {name: getattr(module, f"make_{name}", None) for module in MODULES for name in module.DRAW}
MAKE |= {"temperature_sensitivity": laws_sensor.make_temperature, "softening": laws_stage.make_stiffening}
MAKE |= laws_memory.MAKE
# Where a law acts, if not at the stage
PLACE = {
    **dict.fromkeys(
        ("drive_gain", "saturation", "dead_zone", "lost_beams", "degradation", "thermal_lag", "gain_beyond"), "actuator"
    ),
    **dict.fromkeys(("vibration", "step"), "disturbance"),
    **dict.fromkeys(
        (
            "cyclic",
            "bow",
            "drift",
            "temperature_sensitivity",
            "low_pass",
            "delay",
            "quantisation",
            "stuck",
            "sensor_gain",
            "home_offset",
            "scratch",
            "warm_reading",
        ),
        "sensor",
    ),
}


def build(planted: Sequence[Planted], scene: Scene) -> list[Hooks]:
    """Fresh hooks, with empty memories."""
    return [MAKE[p.name](scene, p.amplitude, **p.shape) for p in planted]


def draw(name: str, rng: np.random.Generator, scene: Scene) -> Planted:
    """The law `name` with drawn shape values and a first guess of its amplitude."""
    return Planted(name, float(GUESS[name](scene)), DRAW[name](rng, scene))


def simulate(
    axis: Axis,
    drive: Any,
    planted: Sequence[Planted] = (),
    scene: Scene | None = None,
    start: float = 0.0,
    ambient: Any = None,
    noise: Any = 0.0,
    linear: bool = False,
) -> np.ndarray:
    """The reading (n,) [m] under `drive` (n,), begun at rest at `start` [s] of the clock, `noise` (n,) [m] added before the converter."""
    scene = scene or Scene(axis)
    hooks = build(planted, scene)
    motion = move(axis, drive, hooks, start, scene, linear)
    clean = read(motion, hooks, ambient)
    time = start + scene.sample_time * np.arange(len(clean))
    return digitise(time, clean + noise, hooks)
