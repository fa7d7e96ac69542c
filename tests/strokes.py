"""Records of a servo axis that is believed to go where it is told: strokes of one speed or two, with an error of the reading."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from recording_folders import SERVO

from ctrlgen import Device, load_device
from ctrlgen.recordings.recording import Record, Recording

STEP = 0.01  # s
MM = 1e-3


def servo(folder: Path, travel: str = "25 mm") -> Device:
    """The axis of a stepper."""
    (folder / "servo.toml").write_text(SERVO.replace("90 deg", travel))
    return load_device(folder / "servo.toml")


def strokes(
    error: Callable[[np.ndarray, np.ndarray], np.ndarray], speeds: tuple[float, ...], noise: float, seconds=20.0, seed=0
) -> Recording:
    """A stroke [m] a speed [m/s], the last one held out, after one another; read with `error` (place [m], time [s]) and noise [m]."""
    rng, parts, place, begin = np.random.default_rng(seed), [], 0.0, 0.0
    for k, speed in enumerate(speeds):
        time = begin + STEP * np.arange(int(seconds / STEP))
        path = place + speed * (time - begin)
        read = path + error(path, time) + noise * rng.standard_normal(len(time))
        role = "hold_out" if k == len(speeds) - 1 else "fit"
        valid = np.ones((len(time), 1), bool)
        parts.append(Record(f"{role}{k}", role, time, STEP, path[:, None], read[:, None], True, None, valid))
        place, begin = path[-1] + speed * STEP, time[-1] + STEP
    return Recording("strokes", "table", "series", ("reading.axis",), ("mm",), (noise,), tuple(parts), ())
