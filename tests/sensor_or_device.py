"""Specimens whose sensor is wrong, or a number of the device, by what is usual: settled poses of the battery's hexapod, drawn by a seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from axis_records import record
from conftest import SCENARIOS

from battery.plant_hexapod import COMPONENTS, Faults, Hexapod, changed
from ctrlgen.devices import load_device
from ctrlgen.devices.usual_deviation import ASSUMED_SCALE, usual_deviation
from ctrlgen.estimation.hypothesis import numbers
from ctrlgen.recordings.recording import Recording
from plants.numbers import read

DEVICE = load_device(SCENARIOS / "devices" / "mems_hexapod.toml")
LAWS = ("sensor_gain", "stiffening", "heat_crosstalk")
NUMBERS = (
    "hexapod.platform_radius",
    "hexapod.base_radius",
    "hexapod.height",
    "actuator.beam_length",
    "actuator.beam_width",
    "actuator.young",
    "actuator.expansion",
    "actuator.thermal_resistance",
    "stage.half_stage_stiffness",
)
SD = np.repeat([1e-6, 20e-9], 3)  # rad, m: of a reading
UNITS = np.repeat([1.0, 1e-6], 3)


@dataclass(frozen=True)
class Specimen:
    """What is wrong: `gain` (6,) of the readings or the `shares` by which numbers are off; whether stiffening and heat cross-talk are
    `beside` it; channels that are `read`; whether drives keep to one `plane`, as along a path of two directions."""

    seed: int
    gain: np.ndarray
    shares: dict[str, float]
    beside: bool
    read: tuple[str, ...]
    plane: bool

    @property
    def of_sensor(self) -> bool:
        """Whether the sensor is wrong."""
        return bool(self.gain.any())


def drawn(seed: int) -> Specimen:
    """Sensors and devices by turns; one to two usual deviations."""
    rng = np.random.default_rng([seed, 313])
    size = rng.choice([-1, 1]) * rng.uniform(1, 2)
    which = int(rng.integers(0, 4))
    gain, shares = np.zeros(6), dict[str, float]()
    if seed % 2 == 0:  # a channel of translation, or one reference for all three
        gain[3 + which if which < 3 else slice(3, 6)] = size * ASSUMED_SCALE
    else:
        path = str(rng.choice(NUMBERS))
        number = next(q for p, _, q in numbers(DEVICE) if p == path)
        shares[path] = size * usual_deviation(number) / abs(number.si)
    of_camera = rng.random() < 0.5
    return Specimen(
        seed,
        gain,
        shares,
        bool(rng.random() < 0.3),
        COMPONENTS[3:] if of_camera else COMPONENTS,
        bool(rng.random() < 0.5),
    )


def recorded(s: Specimen, n: int = 40) -> Recording:
    """40 poses to fit and 40 held out."""
    rng = np.random.default_rng([s.seed, 1])
    beside = {"cubic": np.full(6, 4e-6), "crosstalk": 0.01} if s.beside else {}
    plant = Hexapod(changed(read(), s.shares), Faults(gain=s.gain, **beside))
    ways = rng.standard_normal((2, 6))
    ways *= 0.12 / np.abs(ways).max(axis=1, keepdims=True)
    columns, parts = [COMPONENTS.index(c) for c in s.read], []
    for role in ("fit", "hold_out"):
        u = 0.35 + rng.uniform(-1, 1, (n, 2)) @ ways if s.plane else rng.uniform(0.1, 0.6, (n, 6))
        y = plant.settled(u) * UNITS + SD * rng.standard_normal((n, 6))
        parts.append(record(u, y[:, columns], role, h=np.inf))
    units = tuple("mrad" if c.startswith("theta") else "um" for c in s.read)
    names = tuple(f"reading.{c}" for c in s.read)
    return Recording("t", DEVICE.name, "poses", names, units, tuple(SD[columns]), tuple(parts), ())
