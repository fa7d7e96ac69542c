"""Steps 2 and 7: the free parameters of a structure from the records to fit, by Levenberg-Marquardt.

The problem is that of `least_squares`: the parameters of all causes and the device's own uncertain numbers are fitted
jointly, with the initial states of the records.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.estimation.checkpoint import Checkpoint, key_of
from ctrlgen.estimation.error_model import ErrorModel, error_model
from ctrlgen.estimation.initial_memory import at_the_best_quarter, begins_elsewhere, memory_before
from ctrlgen.estimation.leading_part import leading_part
from ctrlgen.estimation.least_squares import LeastSquaresProblem, initial_state_sd, limited, whiten_residual
from ctrlgen.estimation.moved_drive import with_drive_at
from ctrlgen.estimation.noise import Noise
from ctrlgen.estimation.record_states import begun_near
from ctrlgen.estimation.settings import DISCREPANCY, FIT, LEADING_PART, SIMULATION
from ctrlgen.estimation.settled_start import start_of, states_to_begin
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record, Recording


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted structure with k free parameters.

    `theta` (k,) [SI]; `initial_states` [SI] of each record to fit; `chi2` Huber's loss of the whitened readings, over `n`
    independent samples; `penalty` the squares of the prior. `residual` (m,) and its Jacobian `J` (m, k + n_s) by the parameters
    and the initial states [SI] at the optimum: rows of the readings of records of `shapes` (samples, channels), then of the
    prior.
    """

    structure: Structure
    theta: np.ndarray
    initial_states: tuple[np.ndarray, ...]
    chi2: float
    n: float
    residual: np.ndarray
    J: np.ndarray
    penalty: float
    shapes: tuple[tuple[int, int], ...] = ()

    @property
    def objective(self) -> float:
        """What was minimised: chi2 + penalty."""
        return self.chi2 + self.penalty

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance (k, k) [SI^2] of the parameters, the block of (J'J)^-1."""
        scale = np.linalg.norm(self.J, axis=0)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv((self.J / scale).T @ (self.J / scale), rcond=1e-14)
        k = len(self.theta)
        return (inverse / np.outer(scale, scale))[:k, :k]

    @cached_property
    def information_root(self) -> np.ndarray:
        """R (k, k) with |R dp|^2 = dp' C^-1 dp, C the covariance: QR of J after projection out of the initial states."""
        k = len(self.theta)
        if self.J.shape[1] == k:
            return np.linalg.qr(self.J).R
        Q = np.linalg.qr(self.J[:, k:])[0]
        return np.linalg.qr(self.J[:, :k] - Q @ (Q.T @ self.J[:, :k])).R

    @property
    def restarted(self) -> Structure:
        """The fitted structure, with all parameters starting at their fitted values."""
        s = self.structure
        nominal = {p.path: float(v) for p, v in zip(s.free_parameters, self.theta, strict=True) if p.cause is None}
        starts = tuple(self.values(k) for k in range(len(s.causes)))
        return replace(s, starts=starts, nominal_starts=nominal, expansion=s.expanded_at)

    def values(self, cause: int) -> dict[str, float]:
        """The parameters [SI] by name of one cause, by its place in the structure."""
        values = dict(self.structure.starts[cause])
        for p, value in zip(self.structure.free_parameters, self.theta, strict=True):
            if p.cause == cause:
                values[p.name] = float(value)
        return values


@dataclass(frozen=True, eq=False)
class Fitter:
    """Fits structures to one recording under the noise of its channels and the discrepancy `errors` of the models fitted.

    Without `errors` there is noise alone. Optima are kept in the `checkpoint` where there is one. `clock` [s]: by how much the drive of
    the records is taken to be off its time stamps.
    """

    recording: Recording
    noise: Noise
    checkpoint: Checkpoint | None = None
    errors: ErrorModel | None = None
    clock: float = 0.0

    @property
    def error(self) -> ErrorModel:
        """The error model: noise and, where it has been estimated, discrepancy."""
        return self.errors or ErrorModel.of_noise(self.noise)

    def with_noise(self, noise: Noise) -> Fitter:
        """The same under another noise, without discrepancy."""
        return replace(self, noise=noise, errors=None)

    def with_clock(self, clock: float) -> Fitter:
        """The same with the drive of all records at t + `clock` [s]."""
        records = tuple(with_drive_at(r, clock - self.clock) for r in self.recording.records)
        return replace(self, recording=replace(self.recording, records=records), clock=clock)

    def with_errors_of(self, fit: Fit) -> Fitter:
        """The same with the discrepancy that `fit` leaves on the records to fit."""
        residuals = [r.observed - self.predict(fit, r) for r in self.fit_records]
        return replace(self, errors=error_model(self.noise, self.fit_records, [np.nan_to_num(e) for e in residuals]))

    def with_settled_errors(self, structure: Structure) -> Fitter:
        """The same with the discrepancy that a fit of `structure` leaves under it: both are estimated in turn."""
        fitter = self
        for _ in range(DISCREPANCY.updates):
            before, fitter = fitter, fitter.with_errors_of(fitter.fit(structure))
            if np.allclose(fitter.error.weighted.sd, before.error.weighted.sd, rtol=DISCREPANCY.same, atol=0):
                break
        return fitter

    @property
    def fit_records(self) -> list[Record]:
        """The records to fit."""
        return [r for r in self.recording.records if r.role == "fit"]

    @property
    def held_out_records(self) -> list[Record]:
        """The records with the role "hold_out", which no fit reads."""
        return [r for r in self.recording.records if r.role == "hold_out"]

    def simulator(self, structure: Structure, record: Record) -> Simulator:
        """The compiled simulator of a structure for a record's sample time and drive convention."""
        return structure.simulator(self.recording.channels, record.timing)

    def problem(self, structure: Structure) -> LeastSquaresProblem:
        """The least-squares problem of a structure, the initial states of its records expected where they suit its starting values."""
        return self._problem_of(structure, self.recording)

    def _problem_of(self, structure: Structure, recording: Recording) -> LeastSquaresProblem:
        problem = LeastSquaresProblem(structure, recording, self.error)
        problem.expected = states_to_begin(problem, structure.start)
        return problem

    def fit(
        self,
        structure: Structure,
        theta: np.ndarray | None = None,
        steps: int = FIT.max_steps,
        nested: Fit | None = None,
        enough: float = np.inf,
    ) -> Fit:
        """The optimum reached from `theta` (k,) [SI], or from the structure's own starting values, in at most so many steps.

        A fit that ends above the fit `nested` in it started too far away. It is repeated from `nested`'s initial states with
        its new causes almost off, and once more with the device's own numbers as stated, which `nested` may have bent to
        stand in for the new causes. The best of them is returned. A fit ends before where it cannot reach an objective that is `enough`.
        One that ends with a delay as long as the samples that are kept for it is begun again with more of them, from that delay and the
        other numbers as they began, which it may have bent.
        """
        fit = best = self._fit_from(structure.with_room(), theta, steps, nested, enough)
        while steps and (longer := fit.structure.with_room(fit.theta)) is not fit.structure:
            fit = self._fit_from(longer, None, steps, nested, enough)
            best = min(best, fit, key=lambda fit: fit.objective)
        return best

    def _fit_from(
        self, structure: Structure, theta: np.ndarray | None, steps: int, nested: Fit | None, enough: float
    ) -> Fit:
        """The best of the fits that `fit` says, with the samples that are kept of delays."""
        problem = self.problem(structure)
        start = np.concatenate([structure.start if theta is None else theta, problem.expected])
        if nested is not None:
            enough = min(enough, nested.objective)
        first = self._from_turning_points(problem, self._optimum(problem, start, steps, enough), steps, enough)
        if nested is None or first.objective <= nested.objective:
            return first
        near = start.copy()
        for i, p in enumerate(structure.free_parameters):
            if p.amplitude and structure.cause_of(p) not in nested.structure.causes:
                near[i] = p.nominal + FIT.restart_amplitude * (near[i] - p.nominal)
        if len(states := np.concatenate([np.zeros(0), *nested.initial_states])) == problem.n_initial:
            near[problem.k :] = states
        stated = np.concatenate([structure.start, start[problem.k :]])
        for i, p in enumerate(structure.free_parameters):
            if p.cause is None:
                stated[i] = p.nominal
        best = first
        for x in (near, stated):
            best = min(best, self._optimum(problem, x, steps, best.objective), key=lambda fit: fit.objective)
        return best

    def better_of(self, best: Fit, structure: Structure, steps: int) -> Fit:
        """`best`, or the optimum reached in so many steps from other starting values of the same causes where that is better.

        The leading part of the records decides first whether it can be: fitted to that alone, it must leave less of it than `best`
        does, which is fitted to all. What depends on the time at which it acts may not act there, and is fitted to all at once.
        """
        theta, part = None, leading_part(self.recording)
        if part is not None and not any(c.prior.in_time for c in structure.causes):
            rough, same = (self._problem_of(s, part) for s in (structure, best.structure))
            start = rough.to_scaled(np.concatenate([structure.start, rough.expected]))
            x = levenberg_marquardt(rough, start, steps, negligible=LEADING_PART.negligible * len(start))
            r = rough.residual(x)
            own = same.residual(same.to_scaled(np.concatenate([best.theta, *best.initial_states])))
            if r @ r >= own @ own:
                return best
            theta = rough.to_si(x)[: rough.k]
        again = self.fit(structure, theta, steps, enough=best.objective)
        return min(best, again, key=lambda fit: fit.objective)

    def _from_turning_points(self, problem: LeastSquaresProblem, fit: Fit, steps: int, enough: float) -> Fit:
        """The fit, or the better one reached with its plays at the turning points before the records that begin worse than they go on."""
        states, first, along = list(fit.initial_states), 0, 0
        for i, record in enumerate(self.fit_records):
            white = fit.residual[first : first + record.observed.size]
            first += record.observed.size
            simulator = self.simulator(fit.structure, record)
            expected, along = problem.expected[along : along + len(states[i])], along + len(states[i])
            if (simulator.plays or simulator.slews) and begins_elsewhere(simulator, record, white):
                sd = initial_state_sd(simulator)
                begun = states[i] / sd
                turned = memory_before(simulator, fit.theta, record, begun, expected / sd, self._white)
                states[i] = states[i] if turned is begun else sd * turned
        if all(a is b for a, b in zip(states, fit.initial_states, strict=True)):
            return fit
        again = self._optimum(problem, np.concatenate([fit.theta, *states]), steps, min(enough, fit.objective))
        return min(fit, again, key=lambda f: f.objective)

    def described(self, device: Device) -> tuple[Fitter, Fit]:
        """The device as described, without causes, and the fitter with the discrepancy that it leaves.

        Discrepancy and fit are estimated in turn (feasible generalised least squares), first at the stated numbers. Where the
        residual is far above the noise, the fit is repeated with each uncertain number one standard deviation below and above
        its stated value: a device that drifts, or saturates in a loop, has several local optima.
        """
        fitter = self.with_errors_of(self.fit(Structure(device), steps=0)).with_settled_errors(Structure(device))
        fit = fitter.fit(Structure(device))
        if np.all(fitter.error.rms < FIT.poor_start_rms * self.noise.floor):
            return fitter, fit
        for p in fit.structure.free_parameters:
            for start in (p.nominal - p.sd, p.nominal + p.sd) if p.sd else ():
                again = fitter.fit(Structure(device, nominal_starts={p.path: start}), enough=fit.objective)
                fit = min(fit, again, key=lambda fit: fit.objective)
        return fitter.with_errors_of(fit), fit

    def initial_objective(self, structure: Structure) -> float:
        """The objective at the structure's starting values."""
        problem = self.problem(structure)
        residual = problem.residual(problem.to_scaled(np.concatenate([structure.start, problem.expected])))
        return float(residual @ residual)

    def rough_objective(self, structure: Structure) -> float:
        """The objective at the structure's starting values, of the leading part of the records where there is one: a comparison of
        starts of one structure."""
        part = leading_part(self.recording)
        return (self if part is None else replace(self, recording=part)).initial_objective(structure)

    def _optimum(self, problem: LeastSquaresProblem, start: np.ndarray, steps: int, enough: float = np.inf) -> Fit:
        """The optimum from `start` [SI], taken from the checkpoint where it was found before."""
        if self.checkpoint is None:
            return _fit_at(problem, self._descended(problem, problem.to_scaled(start), steps, enough))
        s, noise, corner = problem.structure, self.error.weighted, self.error.corner
        valid = [
            *(r.valid for r in self.recording.records),
            *((r.linear, r.smooth) for r in self.recording.records if r.either),
        ]
        begun = (s.starts, s.expanded_at, sorted(s.nominal_starts.items()), s.free, s.finer, self.clock)
        key = key_of(s.causes, *begun, start, problem.expected, steps, enough, noise.sd, corner, *noise.ar, *valid)
        optimum = self.checkpoint.recall(key)
        if optimum is None:
            optimum = self._descended(problem, problem.to_scaled(start), steps, enough)
            self.checkpoint.keep(key, optimum)
        return _fit_at(problem, optimum)

    def _descended(self, problem: LeastSquaresProblem, x: np.ndarray, steps: int, enough: float) -> np.ndarray:
        """The scaled variables where a descent from x ends. It begins on the leading part of the records, where there is one, as far as
        that tells the way, and goes on from there if that is better on all samples: with half of the steps then."""
        part = leading_part(self.recording) if steps else None
        if part is not None:
            rough = LeastSquaresProblem(problem.structure, part, self.error)
            rough.expected = problem.expected
            near = levenberg_marquardt(rough, x, steps, negligible=LEADING_PART.negligible * len(x))
            if not np.array_equal(near, x):
                here, there = problem.residual(x), problem.evaluate(near)[0]
                if there @ there < here @ here:
                    x, steps = near, (steps + 1) // 2
        return levenberg_marquardt(problem, x, steps, enough)

    def predict(self, fit: Fit, record: Record) -> np.ndarray:
        """Readings (n, n_y) [SI] of a fitted structure on any record, with the initial state that suits this record best."""
        return self.begun(fit, record)[1]

    def begun(self, fit: Fit, record: Record) -> tuple[np.ndarray, np.ndarray]:
        """What is added to the free initial states [SI] so that they suit a record best, and the readings (n, n_y) [SI] from there.

        Found from rest, or from where the device has settled under its first drive. Where the record then begins worse than it goes on and
        a law has plays, once more from the turning point before it, or from a place in its gap.
        """
        simulator, error = self.simulator(fit.structure, record), self.error.weighted
        key = (id(simulator), id(record), fit.theta.tobytes(), error.sd.tobytes(), *(a.tobytes() for a in error.ar))
        if key not in _BEGUN:
            # what has the identities is kept as long
            _BEGUN[key] = (simulator, record, *self._begun(simulator, fit, record))
            if len(_BEGUN) > SIMULATION.kept_predictions:
                del _BEGUN[next(iter(_BEGUN))]
        start, y = _BEGUN[key][2:]
        return start.copy(), y.copy()

    def _begun(self, simulator: Simulator, fit: Fit, record: Record) -> tuple[np.ndarray, np.ndarray]:
        sd = initial_state_sd(simulator)
        if len(sd) == 0:
            return sd, simulator.simulate(record, fit.theta)
        expected = start_of(simulator, self.error, fit.theta, record) / sd
        first = at_the_best_quarter(simulator, fit.theta, record, expected, self._white)
        found = begun_near(simulator, self.error, fit.theta, record, first, expected)
        if begins_elsewhere(simulator, record, self._white(record, found.y)):
            other = memory_before(simulator, fit.theta, record, found.states, expected, self._white)
            if other is not found.states:
                again = begun_near(simulator, self.error, fit.theta, record, other, expected)
                found = min(found, again, key=lambda begun: begun.objective)
        return sd * found.states, found.y

    def _white(self, record: Record, y: np.ndarray) -> np.ndarray:
        """The whitened residual (n n_y,); large values are not limited."""
        return self.error.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid).ravel()

    def whitened_residual(self, fit: Fit, record: Record) -> np.ndarray:
        """Residual (n, n_y) of a fitted structure on any record, whitened by the noise; zero where a sample is not usable."""
        return limited(whiten_residual(self.noise, record, self.predict(fit, record)))

    def held_out_squares(self, fit: Fit) -> float:
        """Sum of the whitened squares of the held-out records, with the parameters of the fit."""
        return sum(float(np.sum(self.whitened_residual(fit, r) ** 2)) for r in self.held_out_records)


# Predictions by what they depend on, the oldest first: a fit is judged by several tests, each of which predicts the same records. Whether
# one was there changes no result.
_BEGUN: dict[tuple[Any, ...], tuple[Simulator, Record, np.ndarray, np.ndarray]] = {}


def forget_predictions() -> None:
    """Those of an earlier diagnosis only take memory."""
    _BEGUN.clear()


def _fit_at(problem: LeastSquaresProblem, x: np.ndarray) -> Fit:
    """The fit with the scaled variables x."""
    residual, J = problem.evaluate(x)
    values, k = problem.to_si(x), problem.k
    n_readings = sum(r.observed.size for r in problem.records)
    readings, prior = residual[:n_readings], residual[n_readings:]
    return Fit(
        structure=problem.structure,
        theta=values[:k],
        initial_states=tuple(np.split(values[k:], np.cumsum([len(s) for s in problem.initial_sd])[:-1])),
        chi2=float(readings @ readings),
        n=float(sum(problem.error.effective(r.valid).sum() for r in problem.records)),
        residual=residual,
        J=J / problem.si_by_scaled(values),
        penalty=float(prior @ prior),
        shapes=tuple(r.observed.shape for r in problem.records),
    )
