"""Linear time-varying (LTV) model of a fitted structure along the motion of one record.

    D+ = F_S D + F_f f,   y = H_S D + H_f f

f are small disturbances at one place, in its unit; D is the change of the state that they cause, y that of the readings.
The residual of a record can so be expressed as readings or as an equivalent disturbance of the axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.units import written_unit
from ctrlgen.devices import BalancedPhysics, DevicePhysics
from ctrlgen.diagnosis.settings import LTV_MODEL
from ctrlgen.effects import Place
from ctrlgen.estimation.disturbance_inputs import with_disturbance_inputs
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import nominal_physics
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.simulator import Simulator, compiled_simulator
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class LtvModel:
    """The LTV model of one fit along one record, in SI units.

    place, axes, units: where the disturbance enters, its channels and their units.
    residual: observed - predicted (n, n_y), zero where not valid. white: the whitened residual, zero where not `usable`.
    displacement, velocity: of the axes (n, n_axes).
    F_S, F_f, H_S, H_f: matrices of the LTV model (n, ., .), with one column of f per axis.
    start_sd: standard deviation of the initial state (n_s,). state_scale: typical size of the state (n_s,).
    ages: by how many whole samples each reading is late beyond what H_S and H_f say.
    """

    record: Record
    place: Place
    axes: tuple[str, ...]
    units: tuple[str, ...]
    travel_unit: str
    residual: np.ndarray
    white: np.ndarray
    usable: np.ndarray
    displacement: np.ndarray
    velocity: np.ndarray
    F_S: np.ndarray
    F_f: np.ndarray
    H_S: np.ndarray
    H_f: np.ndarray
    start_sd: np.ndarray
    state_scale: np.ndarray
    ages: tuple[int, ...]

    @property
    def poses(self) -> bool:
        """Whether the samples are poses."""
        return self.record.poses

    @property
    def advanced(self) -> tuple[np.ndarray, np.ndarray]:
        """The residual (n, n_y) with readings that are late taken back to when they were caused, and whether they are valid; zero
        where the record ends before they come."""
        residual, valid = np.zeros_like(self.residual), np.zeros_like(self.record.valid)
        for i, age in enumerate(self.ages):
            residual[: len(residual) - age, i] = self.residual[age:, i]
            valid[: len(valid) - age, i] = self.record.valid[age:, i]
        return residual, valid

    def readings(self, f: np.ndarray, axis: np.ndarray) -> np.ndarray:
        """Change of the readings (n, n_y, m), before they are late, by disturbances f (n, m), of which column j acts on axis
        `axis`[j], SI."""
        following = f if self.poses else np.vstack([f[1:], f[-1:]])
        into = self.F_f[:, :, axis] * ((f + following) / 2)[:, None, :]
        direct = self.H_f[:, :, axis] * f[:, None, :]
        states = np.empty_like(into)
        D = np.zeros(into.shape[1:])
        for k in range(len(f)):
            states[k] = D
            D = self.F_S[k] @ D + into[k]
        return self.H_S @ states + direct

    def steady(self) -> np.ndarray:
        """Static gain (n_y, n_axes) from disturbances to readings at the middle sample of the record, SI."""
        k = len(self.F_S) // 2
        held = np.linalg.lstsq(np.eye(self.F_S.shape[1]) - self.F_S[k], self.F_f[k], rcond=1e-10)[0]
        return self.H_S[k] @ held + self.H_f[k]

    def direction(self) -> np.ndarray:
        """Sign of the velocity of each axis (n, n_axes), 0 at standstill."""
        fastest = np.abs(self.velocity).max(axis=0)
        return np.where(np.abs(self.velocity) > LTV_MODEL.standing * fastest, np.sign(self.velocity), 0.0)


def unknown_input_place(physics: DevicePhysics) -> Place:
    """Place of the unknown input: a force for devices with inertia or with measured force, else a displacement."""
    return Place.DISPLACEMENT if isinstance(physics, BalancedPhysics) else Place.FORCE


def linearise_along(fitter: Fitter, fit: Fit, record: Record) -> LtvModel:
    """The LTV model of `fit` along `record`. Raises ArithmeticError where the motion that it foretells leaves what is finite."""
    physics = nominal_physics(fit.structure.device)
    place = unknown_input_place(physics)
    simulator, p, chosen = _probed(fitter, fit, record, place)
    start = _start(fitter, fit, record)
    before, after, y = simulate_motion(simulator, record, p, start)
    if start is None:
        y = fitter.predict(fit, record)
    F_S, F_f, H_S, H_f = _linearised(simulator, record, p, chosen, before)
    if not all(np.isfinite(part).all() for part in (F_S, F_f, H_S, H_f)):
        raise ArithmeticError("the motion that the model foretells is not finite")
    at = after if record.poses else before
    m = simulator.model
    z = at[:, simulator.n_x :]
    noise = fitter.noise
    residual = np.where(record.valid, record.observed - y, 0.0)
    probes = m.device.effect[len(fit.structure.device_with_causes.effect) :]
    placed = [probe for probe in probes if probe.place is place]
    sd = np.zeros(simulator.n_s)
    sd[list(simulator.free_initial_states)] = initial_state_sd(simulator)
    return LtvModel(
        record=record,
        place=place,
        axes=tuple(probe.at for probe in placed),
        units=tuple(written_unit(probe.values["delta"].text) for probe in placed),
        travel_unit=physics.travel_unit,
        residual=residual,
        white=noise.whiten(residual, record.valid),
        usable=noise.usable(record.valid),
        displacement=z,
        velocity=_velocity(simulator, record, at, z),
        F_S=F_S,
        F_f=F_f,
        H_S=H_S,
        H_f=H_f,
        start_sd=sd,
        state_scale=np.concatenate([m.x_scale, m.z_scale]),
        ages=_ages(simulator, record, p),
    )


def _probed(fitter: Fitter, fit: Fit, record: Record, place: Place) -> tuple[Simulator, np.ndarray, list[int]]:
    """A simulator with disturbance inputs, its parameters, and the positions of the inputs at `place` among them."""
    known = [unknown.path for unknown in fit.structure.free_parameters]
    device, probes = with_disturbance_inputs(fit.structure.expanded_device, nominal_physics(fit.structure.device))
    paths = [path for (where, _), path in probes.items() if where is place]
    simulator = compiled_simulator(
        device, (*known, *paths), fitter.recording.channels, record.timing, fit.structure.finer
    )
    p = np.concatenate([fit.theta, np.zeros(len(paths))])
    return simulator, p, list(range(len(known), len(p)))


def _start(fitter: Fitter, fit: Fit, record: Record) -> np.ndarray | None:
    """The fitted initial state of a record to fit; None for others, which are linearised along the motion from rest."""
    places = [k for k, r in enumerate(fitter.fit_records) if r is record]
    return fit.initial_states[places[0]] if places and fit.initial_states else None


def simulate_motion(
    r: Simulator, record: Record, p: np.ndarray, start: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State before and after each sample (n, n_s), and the readings (n, n_y)."""
    after, y = r.simulate_states(record, p, start)
    record = r.aligned(record, p)
    return np.vstack([r.starting_state(record, p, start), after[:-1]]), after, y


def _linearised(
    r: Simulator, record: Record, p: np.ndarray, chosen: list[int], before: np.ndarray
) -> tuple[np.ndarray, ...]:
    """F_S, F_f, H_S, H_f along the motion."""
    linear, inputs = r.linearise(p, chosen), (before, *r.inputs(r.aligned(record, p)))
    parts = [
        linear.evaluate_along(*(x[a : a + LTV_MODEL.block] for x in inputs))
        for a in range(0, len(before), LTV_MODEL.block)
    ]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def _ages(simulator: Simulator, record: Record, p: np.ndarray) -> tuple[int, ...]:
    ages = [0.0] * len(simulator.channels)
    for late in simulator.late:
        ages[late.row] += late.age(p) / record.sample_time
    return tuple(min(round(age), len(record.time)) for age in ages)


def _velocity(r: Simulator, record: Record, at: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Velocity of the axes (n, n_axes) [SI]; for poses the step from the previous pose."""
    n_v = r.model.v.numel()
    if n_v:
        return at[:, r.n_x - n_v : r.n_x]
    if record.poses:
        return np.vstack([z[:1], np.diff(z, axis=0)])
    return np.gradient(z, record.sample_time, axis=0) if len(z) > 1 else np.zeros_like(z)
