"""Readings -> the pose that they imply under the sensor laws of the device, sample by sample.

y = h(p + e; z, x): the reading of a pose that is e off the modelled one, with everything else that a law of the sensor reads (stages,
temperatures) as the model has it. e solves h(p + e) = y by Newton's method. What a law with a memory of its own adds (a filter) is taken
from the model's run; that leaves out the error times its lag over the period, a product of two small numbers. A stated delay is no law of
the model: readings are moved by it in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import Quantity, base_unit, written_unit
from ctrlgen.devices import Signal
from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place, means
from ctrlgen.learning.lifted import Lifted
from ctrlgen.model.assembly import build_model
from ctrlgen.model.effect_terms import LOOKS_BACK
from ctrlgen.numerics.batched_evaluation import evaluate
from ctrlgen.numerics.newton import NoRoot, newton_rows

MOST_ERROR = 1e6
"""Typical sizes; bounds of a number that has none."""


class PoseError(Effect, listed=False):
    """Delta p = e: what the pose is off the modelled one; e is found, never stated."""

    title = "The pose is off"
    place = Place.POSE
    order = 1000  # after every law of the pose
    source = "definition"
    params = (Param("error", "channel", (-MOST_ERROR, MOST_ERROR), "by which it is off", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        """The number itself."""
        return p.error


@dataclass(frozen=True)
class SensorNumber:
    """A number of a law of the sensor in `unit` whose standard deviation `sd` [SI] the device file states; `channels` of the reading it
    acts on."""

    path: str
    unit: str
    sd: float
    channels: tuple[int, ...]
    kind: str


class ImpliedPose:
    """The pose that readings of a device imply. `acts`: whether the device states any law of its sensors; `late` (n_y,) [s]: by how
    much its readings are stated to come after what they show; `numbers`: what of its sensors is stated with a standard deviation."""

    def __init__(self, lifted: Lifted) -> None:
        self.lifted, m = lifted, lifted.model
        device, signal = lifted.solution.scenario.device, lifted.signal
        self.channels = signal.channels
        self.late = _late(device.effect, signal)
        effects = tuple(e for e in device.effect if not (e.place is Place.SENSOR and LOOKS_BACK in e.requires))
        self.numbers = tuple(_numbers(effects, signal))
        of_pose = signal.channels == m.signals["pose"].channels
        self.acts = of_pose and any(e.place is Place.SENSOR for e in effects)
        if not self.acts:
            self.numbers = ()
            return
        remembers = [
            k
            for k, e in enumerate(effects)
            if e.place is Place.SENSOR and any(not (s.clock or s.per_record) for s in e.states)
        ]
        errors = [
            PoseError(c, {"error": Quantity(0.0, f"0 {base_unit(unit)}")})
            for c, unit in zip(signal.channels, signal.units, strict=True)
        ]
        free = [f"effect[{len(effects) + i}].error" for i in range(len(errors))]
        free += [number.path for number in self.numbers]
        seen = device.model_copy(update={"effect": (*effects, *errors)})
        sensed = build_model(seen, free, apart=remembers)
        rows = [sensed.signals["reading"].channels.index(c) for c in signal.channels]
        n_y, h = len(rows), sensed.signals["reading"].expr[rows]
        self.places = [m.x_names.index(name) for name in sensed.x_names]
        self.p_nominal = sensed.p_nominal
        S, e = ca.vertcat(sensed.x, sensed.z), sensed.p[:n_y]
        given = [S, sensed.u, e]
        at = ca.DM(sensed.p_nominal[n_y:])
        value, slope, by_number = (
            ca.densify(ca.substitute(part, sensed.p[n_y:], at))
            for part in (h, ca.jacobian(h, e), ca.jacobian(h, sensed.p[n_y:]))
        )
        self._seen = ca.Function("seen", given, [value, slope], {"cse": True})
        self._by_number = ca.Function("by_number", given, [value, slope, by_number], {"cse": True})
        self._remembered = None
        if remembers:
            whole = m.signals["reading"].expr[[m.signals["reading"].channels.index(c) for c in signal.channels]]
            whole = ca.substitute(whole, m.p, ca.DM(m.p_nominal))
            self._remembered = ca.Function("whole", [ca.vertcat(m.x, m.z), m.u], [ca.densify(whole)])

    def pose(self, y: np.ndarray, drive: np.ndarray) -> np.ndarray:
        """(m, n, n_y) [SI] poses of readings `y` (m, n, n_y) under `drive` (n, n_u); NaN where nothing was read: there the pose is taken to
        be the modelled one by the other channels. Raises InputError where readings say nothing of the pose."""
        if not self.acts:
            return y
        S, v = self._states(drive)
        modelled = self.lifted.run(drive)
        n, n_y = modelled.shape
        known = np.isfinite(y)
        target = np.where(known, y, 0.0)
        if self._remembered is not None:
            (whole,) = evaluate(self._remembered.map(n), self.lifted.states(drive), v)
            target = target - (whole - self._at(self._seen, S, v, np.zeros((n, n_y)))[0])
        found = np.empty(y.shape)
        for j, wanted in enumerate(target):
            found[j] = modelled + self._newton(S, v, wanted, known[j])
        return np.where(known, found, np.nan)

    def deviations(self, drive: np.ndarray) -> list[np.ndarray]:
        """For each of `numbers` by how much the implied pose (n, n_y) [SI] is off where the number is one standard deviation above the
        stated one."""
        if not self.numbers:
            return []
        S, v = self._states(drive)
        n, n_y = self.lifted.n, len(self.channels)
        _, slope, by_number = self._at(self._by_number, S, v, np.zeros((n, n_y)))
        off = -np.linalg.solve(slope, by_number)
        return [off[:, :, k] * number.sd for k, number in enumerate(self.numbers)]

    def _states(self, drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        m, S = self.lifted.model, self.lifted.states(drive)
        x, z = np.split(S, [m.x.numel()], axis=1)
        return np.hstack([x[:, self.places], z]), self.lifted.held(drive)

    def _at(self, function: ca.Function, S: np.ndarray, v: np.ndarray, e: np.ndarray) -> list[np.ndarray]:
        """The reading (n, n_y) and matrices (n, n_y, columns) of it."""
        n = len(S)
        values = evaluate(function.map(n), S, v, e)
        tables = [
            value.reshape(n, function.size2_out(i), function.size1_out(i)).transpose(0, 2, 1)
            for i, value in enumerate(values)
        ]
        return [tables[0][:, :, 0], *tables[1:]]

    def _newton(self, S: np.ndarray, v: np.ndarray, wanted: np.ndarray, known: np.ndarray) -> np.ndarray:
        """(n, n_y) by how much the pose is off. Channels that were not `known` (n, n_y) are not."""
        both, size = known[:, :, None] & known[:, None, :], np.array(self.lifted.signal.scale)

        def seen(e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            value, slope = self._at(self._seen, S, v, e)
            return np.where(known, value, 0.0), np.where(both, slope, np.eye(len(size)))

        try:
            return newton_rows(seen, np.where(known, wanted, 0.0), np.zeros(wanted.shape), size)
        except np.linalg.LinAlgError:
            what = "a reading says nothing of the pose by the sensor laws of the device: leave its column out, or correct them"
        except NoRoot:
            what = "no pose has these readings under the sensor laws of the device: look at the numbers of the laws"
        raise InputError(self.lifted.model.name, [Fault("effect", what)])


def _late(effects: tuple[Effect, ...], signal: Signal) -> np.ndarray:
    """(n_y,) [s] by which stated delays, and means over a window, let readings come late; clocks that run ahead count against it."""
    late = np.zeros(len(signal.channels))
    for e in effects:
        if e.place is Place.SENSOR and e.late_by:
            late[_acted(e, signal)] += e.late_by * e.values[e.amplitude().name].si
    return late


def _acted(e: Effect, signal: Signal) -> list[int]:
    return [i for i, (c, unit) in enumerate(zip(signal.channels, signal.units, strict=True)) if means(e.at, c, unit)]


def _numbers(effects: tuple[Effect, ...], signal: Signal) -> list[SensorNumber]:
    return [
        SensorNumber(f"effect[{k}].{name}", written_unit(number.text), number.sd, tuple(_acted(e, signal)), e.kind)
        for k, e in enumerate(effects)
        if e.place is Place.SENSOR and not any(not (s.clock or s.per_record) for s in e.states)
        for name, number in e.values.items()
        if number.sd
    ]
