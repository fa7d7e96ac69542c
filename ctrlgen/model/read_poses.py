"""What the sensor laws of a device make of settled poses, y = h(p), and the poses that readings imply, p = h^-1(y).

For laws that read the pose alone: a lean of a mirror, an autocollimator, a scale. What a law adds to settled readings by anything else
(a memory, a temperature) is not the pose's, and is refused. Runs in time have `learning.implied_pose`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Device
from ctrlgen.effects import Place
from ctrlgen.model.effect_terms import EffectTerms
from ctrlgen.numerics.batched_evaluation import evaluate
from ctrlgen.numerics.newton import NoRoot, newton_rows


def sensor_numbers(device: Device) -> frozenset[str]:
    """Paths of all numbers of its sensor laws."""
    laws = ((k, e) for k, e in enumerate(device.effect) if e.place is Place.SENSOR)
    return frozenset(f"effect[{k}].{name}" for k, law in laws for name in law.values)


@dataclass(frozen=True)
class SensorNumber:
    """A number of a sensor law that is not known exactly: its `path`, where it acts in words, and its standard deviation `sd` [SI] with
    the `source` of it."""

    path: str
    name: str
    sd: float
    source: str


class ReadPoses:
    """The sensor laws of a device, as functions of its pose with the points that are read beside it. `acts`: whether there are any;
    `numbers`: those with a stated sd."""

    def __init__(self, device: Device, uncertain: Collection[str] = (), pose_alone: bool = False) -> None:
        """`uncertain`: paths of further numbers of sensor laws that count among `numbers`. `pose_alone`: without the points beside the
        pose. Raises InputError where a sensor law reads something else."""
        laws = [(k, e) for k, e in enumerate(device.effect) if e.place is Place.SENSOR]
        self.acts = bool(laws)
        self.numbers = tuple(
            SensorNumber(
                f"effect[{k}].{name}",
                f"{law.kind.replace('_', ' ')} at {law.at}" + (f" by {law.of}" if law.of else "") + f": {name}",
                number.sd or 0.0,
                number.source or "the device file",
            )
            for k, law in laws
            for name, number in law.values.items()
            if number.sd or f"effect[{k}].{name}" in uncertain
        )
        symbols = {number.path: ca.SX.sym(number.path) for number in self.numbers}
        values = device.values(symbols)
        physics = device.told_physics(values)
        n = len(physics.axes)
        z, still, none = ca.SX.sym("d", n), ca.SX(n, 1), ca.SX(0)
        terms = EffectTerms(device, physics, values, z, still, still, none, None, False)
        if terms.faults:
            raise InputError(device.name, terms.faults)
        pose = ca.SX.sym("pose", len(physics.readings[0]))
        reading = terms.added(Place.SENSOR, pose)
        count = len(physics.components) if pose_alone else pose.numel()
        pose, reading = pose[:count], reading[:count]
        q = ca.vertcat(ca.SX(0, 1), *symbols.values())
        foreign = [
            s
            for s in ca.symvar(reading)
            if not any(ca.is_equal(s, own) for own in (*ca.vertsplit(pose), *symbols.values()))
        ]
        if foreign:
            what = f"a law of the sensor reads {', '.join(s.name() for s in foreign)} beside the pose; settled readings alone do not say it"
            raise InputError(device.name, [Fault("effect", what)])
        at = ca.DM([dict(device.quantities())[number.path].si for number in self.numbers])
        parts = (reading, ca.jacobian(reading, pose), ca.jacobian(reading, q))
        self._at = ca.Function("read", [pose], [ca.densify(ca.substitute(part, q, at)) for part in parts])
        self._size = np.array(physics.readings[2][:count])

    def readings(self, poses: np.ndarray) -> np.ndarray:
        """(n, channels) [SI] what is read of `poses` (n, channels)."""
        return self._parts(poses)[0]

    def poses(self, readings: np.ndarray) -> np.ndarray:
        """(n, channels) [SI] the poses that `readings` (n, channels) imply. Raises InputError where Newton's method finds none, or a
        reading says nothing of the pose."""
        if not (self.acts and len(readings)):
            return readings.copy()
        try:
            return newton_rows(lambda poses: self._parts(poses)[:2], readings, readings, self._size)
        except np.linalg.LinAlgError:
            raise _dead() from None
        except NoRoot:
            what = "no pose has these readings; look at the numbers of the laws"
            raise InputError("sensor laws", [Fault("effect", what)]) from None

    def deviations(self, poses: np.ndarray) -> list[np.ndarray]:
        """For each of `numbers` by how much the implied poses (n, channels) [SI] are off where it is one sd above what is stated."""
        slopes = self.slopes(poses)
        return [slopes[:, :, k] * number.sd for k, number in enumerate(self.numbers)]

    def slopes(self, poses: np.ndarray) -> np.ndarray:
        """(n, channels, numbers) [SI] what the implied poses change by with each of `numbers`, -(dh/dp)^-1 dh/dn."""
        _, slope, by_number = self._parts(poses)
        return -_solved(slope, by_number)

    def _parts(self, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n, width = poses.shape
        seen, slope, by_number = evaluate(self._at.map(n), poses)
        by_pose, by_each = (
            m.reshape(n, columns, width).transpose(0, 2, 1)
            for m, columns in ((slope, width), (by_number, len(self.numbers)))
        )
        return seen, by_pose, by_each


def _solved(slope: np.ndarray, right: np.ndarray) -> np.ndarray:
    """slope^-1 right at each pose. Raises InputError where a reading does not change with the pose."""
    try:
        return np.asarray(np.linalg.solve(slope, right))
    except np.linalg.LinAlgError:
        raise _dead() from None


def _dead() -> InputError:
    what = "a reading says nothing of the pose, as that of a channel that is stuck; leave out its law, or correct it"
    return InputError("sensor laws", [Fault("effect", what)])
