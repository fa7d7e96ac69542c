"""The run-time constants of one specimen from a recording: the numbers of [run_time] alone are fitted, everything else is held.

    min over p of rho(W (y - y(p, s))) + sum (s_j/sd_j)^2,   low <= p <= high

as `ctrlgen.estimation.least_squares` states it, under the noise and the discrepancy of the recording. A constant that the
recording does not tell better than `TOLD` times what its bounds tell keeps its default; the intervals of the others then include what
it may be within its bounds (uniform, GUM 4.3.7), with which they are correlated (GUM 5.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text
from ctrlgen.devices import Device, files_of, load_device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.noise_update import update_guessed_noise
from ctrlgen.estimation.robust_covariance import widening
from ctrlgen.estimation.settings import DISCREPANCY, NOISE_UPDATE, SIMULATION, STATISTICS
from ctrlgen.estimation.structure import FreeParameter, Structure
from ctrlgen.model.assembly import build_model, movable, symbolic_model
from ctrlgen.model.discretisation import settling_time
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.trajectory.scenario import Input

TOLD = (
    0.5  # of the standard deviation that its bounds alone give a constant: above, the recording does not determine it
)
BEYOND = "at its bound: the specimen lies beyond it, or the device file leaves something out; run ctrlgen diagnose"
FAR_READING = 3.0  # times the model's motion (rms), by which readings may be off it: more is another unit or origin
AT_BOUND = 1e-4  # of the range: a value so near its end was held there


@dataclass(frozen=True)
class CalibratedConstant:
    """One constant, SI: its `value`, standard deviation `sd`, 95 % interval; `remark`: what its reader should know of it."""

    constant: RunTimeConstant
    value: float
    sd: float
    determined: bool
    remark: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval within the bounds."""
        c, reach = self.constant, STATISTICS.z_95 * self.sd
        if not self.determined:
            return c.low, c.high
        return max(self.value - reach, c.low), min(self.value + reach, c.high)


@dataclass(frozen=True)
class ReadingError:
    """Root mean square [SI] of the error of one observed channel on held-out records, before and after, with the channel's noise;
    `unit` of the reader."""

    channel: str
    unit: str
    before: float
    after: float
    noise: float


@dataclass(frozen=True)
class Calibration:
    """The constants of a specimen of `device`, described by `inputs`, from `recording`. `covariance` (k, k) [SI] of the constants in
    their order; that of one which is not determined is what its bounds say."""

    device: Device
    inputs: dict[str, Input]
    recording: Recording
    constants: tuple[CalibratedConstant, ...]
    covariance: np.ndarray
    errors: tuple[ReadingError, ...]
    notes: tuple[str, ...]

    @property
    def calibrated(self) -> Device:
        """The device with these constants as its numbers."""
        return changed(self.device, {c.constant.path: c.value for c in self.constants if c.determined})


class _Specimen(Structure):
    """A device of which chosen run-time constants are free, and no other number. `held`: those with what their bounds say of them."""

    chosen: tuple[RunTimeConstant, ...]
    held: tuple[RunTimeConstant, ...]

    @classmethod
    def of(cls, device: Device, chosen: Sequence[RunTimeConstant], held: Sequence[RunTimeConstant] = ()) -> _Specimen:
        """With these constants free."""
        found = cls(device)
        object.__setattr__(found, "chosen", tuple(chosen))
        object.__setattr__(found, "held", tuple(held))
        return found

    @cached_property
    def free_parameters(self) -> tuple[FreeParameter, ...]:
        """The chosen constants within their bounds, then those held."""
        return tuple(
            FreeParameter(c.path, c.unit, c.default, c.low, c.high, c.high - c.low, sd)
            for constants, given in ((self.chosen, False), (self.held, True))
            for c in constants
            for sd in (sd_of_bounds(c) if given else None,)
        )


def sd_of_bounds(c: RunTimeConstant) -> float:
    """Standard deviation [SI] of a number of which the bounds alone are known: uniform between them, GUM 4.3.7."""
    return (c.high - c.low) / np.sqrt(12)


def calibrate(
    device: Path | str,
    recordings: Path | str | Sequence[Path | str],
    progress: Callable[[str], None] = lambda _: None,
) -> Calibration:
    """The run-time constants of the specimen that `recordings` were made on, `device` being the file that describes it.

    Raises InputError for a device without run-time constants, or of which none acts on what was recorded.
    """
    described = load_device(device)
    if not described.given_at_start:
        what = 'is missing: it names what differs between specimens; write [run_time] and under it constants = ["actuator.ambient"]'
        raise InputError(device, [Fault("run_time", what)])
    progress("reading")
    paths = [recordings] if isinstance(recordings, (str, Path)) else list(recordings)
    recording = load_recordings(paths, build_model(described))
    inputs = {
        name: Input(path, read_text(path))
        for name, path in zip(("device", "device_code"), files_of(Path(device)), strict=False)
    }
    # A trial value may lead nowhere, and is then rejected.
    with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _Search(described, recording, progress).run(inputs)


class _Search:
    """The fits of one calibration."""

    def __init__(self, device: Device, recording: Recording, progress: Callable[[str], None]) -> None:
        self.device, self.progress = device, progress
        ambient = [r for r in recording.records if r.ambient is not None]
        self.notes = list(recording.notes)
        if ambient:
            self.notes.append(
                "the recorded ambient temperature is not used: a constant of [run_time] holds for the whole recording"
            )
        progress("noise")
        settling = settling_time(build_model(device, sample_time=SIMULATION.settling_sample_time))
        recording = replace(
            recording, records=tuple(self._settled(replace(r, ambient=None), settling) for r in recording.records)
        )
        self.fitter = Fitter(recording, estimate_noise(recording, settling))

    def _settled(self, record: Record, settling: float) -> Record:
        """A record whose rows count from when its start is forgotten, where the state of rest depends on a constant: a simulation
        begins at the rest of the file."""
        free = [c.path for c in self.device.given_at_start]
        rests = symbolic_model(self.device, free).rest_formula
        if not ca.symvar(rests) or not np.isfinite(record.sample_time):
            return record
        rows = int(np.ceil(settling / record.sample_time))
        if rows >= len(record.time):
            what = f"lasts no longer than {settling:.3g} s, in which its start is forgotten; record longer"
            raise InputError(record.name, [Fault("record", what)])
        self.notes.append(
            f"{record.name}: the first {settling:.3g} s are not used, because the state of rest depends on a constant"
        )
        valid = record.valid.copy()
        valid[:rows] = False
        return replace(record, valid=valid)

    def run(self, inputs: dict[str, Input]) -> Calibration:
        """Fits what the recording determines."""
        constants = self.device.given_at_start
        acting = set(movable(self.device))
        why = {c.path: "acts on nothing that moves or is read" for c in constants if c.path not in acting}
        chosen = [c for c in constants if c.path in acting]
        self._weigh(chosen)
        while chosen:
            self.progress(f"fit of {', '.join(c.path for c in chosen)}")
            fit = self._fit(chosen)
            told = np.array([sd / sd_of_bounds(c) for c, sd in zip(chosen, self._sds(fit), strict=True)])
            if np.all(told <= TOLD):
                break
            worst = chosen.pop(int(np.argmax(np.where(np.isfinite(told), told, np.inf))))
            why[worst.path] = "not determined by this recording beyond its bounds"
        if not chosen:
            faults = [Fault(f"run_time.constants {path}", reason) for path, reason in why.items()]
            what = "determines none of the constants: record a motion that depends on them"
            raise InputError(self.fitter.recording.title, [Fault("recording", what), *faults])
        return self._result(inputs, fit, chosen, why)

    def _weigh(self, chosen: Sequence[RunTimeConstant]) -> None:
        """Marks outliers, and estimates guessed noise and the discrepancy in turn with the fit."""
        structure = _Specimen.of(self.device, chosen)
        fit = self._fit(chosen)
        before = self.fitter.with_errors_of(fit)
        self.fitter = replace(
            before, recording=mark_outliers(before.recording, lambda record: before.predict(fit, record)), errors=None
        )
        for _ in range(NOISE_UPDATE.guessed_refits if self.fitter.noise.guessed.any() else 0):
            fit = self.fitter.fit(structure)
            self.fitter = self.fitter.with_noise(update_guessed_noise(self.fitter.with_errors_of(fit), fit))
        for _ in range(DISCREPANCY.updates):
            self.fitter = self.fitter.with_errors_of(self.fitter.fit(structure))

    def _fit(self, chosen: Sequence[RunTimeConstant]) -> Fit:
        """The optimum with these constants free, in simulators of their own."""
        self.fitter = replace(self.fitter, cache={})
        return self.fitter.fit(_Specimen.of(self.device, chosen))

    def _sds(self, fit: Fit) -> np.ndarray:
        return np.sqrt(np.maximum(np.diag(_covariance(fit)), 0.0))

    def _result(
        self, inputs: dict[str, Input], fit: Fit, chosen: Sequence[RunTimeConstant], why: dict[str, str]
    ) -> Calibration:
        constants = self.device.given_at_start
        held = [c for c in constants if c not in chosen and "acts on nothing" not in why[c.path]]
        every = replace(self.fitter, cache={})
        values = np.concatenate([fit.theta, [c.default for c in held]])
        joint = every.fit(_Specimen.of(self.device, chosen, held), values, steps=0)
        order = [constants.index(c) for c in (*chosen, *held)]
        covariance = np.diag([sd_of_bounds(c) ** 2 for c in constants])
        covariance[np.ix_(order, order)] = with_held(
            _covariance(fit), joint.covariance, np.array([sd_of_bounds(c) for c in held])
        )
        rows = []
        for k, c in enumerate(constants):
            determined = c in chosen
            value = float(fit.theta[chosen.index(c)]) if determined else c.default
            remark = why.get(c.path, "")
            if determined and min(value - c.low, c.high - value) < AT_BOUND * (c.high - c.low):
                remark = BEYOND
            rows.append(CalibratedConstant(c, value, float(np.sqrt(covariance[k, k])), determined, remark))
        start = replace(self.fitter, cache={}).fit(_Specimen.of(self.device, chosen), steps=0)
        errors = self._errors(start, fit)
        self._check_readings(fit, errors)
        more = [e.channel for e in errors if e.after > DISCREPANCY.ratio * 2 * e.noise]
        if more:
            what = "is read with more than its noise in error, whatever the constants: run ctrlgen diagnose for what is left out"
            self.notes.append(f"{', '.join(more)} {what}")
        return Calibration(
            self.device, inputs, self.fitter.recording, tuple(rows), covariance, errors,
            tuple(dict.fromkeys((*self.notes, *(note for note in self.fitter.noise.notes if "as stated" not in note)))),
        )  # fmt: skip

    def _check_readings(self, fit: Fit, errors: Sequence[ReadingError]) -> None:
        """Refuses readings that are farther off than the stage moves. Raises InputError."""
        moved = np.concatenate([self.fitter.predict(fit, record) for record in self.fitter.held_out_records])
        size = np.sqrt(np.mean(moved**2, axis=0))
        faults = [
            Fault(e.channel, f"is {e.after / s:.2g} times the motion of the model away from it; check its column, unit, sign and origin")
            for e, s in zip(errors, size, strict=True) if e.after > FAR_READING * s > 0
        ]  # fmt: skip
        if faults:
            raise InputError(self.fitter.recording.title, faults)

    def _errors(self, before: Fit, after: Fit) -> tuple[ReadingError, ...]:
        """Of held-out records, channel by channel."""
        recording, rows = self.fitter.recording, []
        records = self.fitter.held_out_records
        squares = [
            [np.where(r.valid, r.observed - self.fitter.predict(fit, r), np.nan) ** 2 for r in records]
            for fit in (before, after)
        ]
        for i, (channel, unit) in enumerate(zip(recording.channels, recording.units, strict=True)):
            start, end = (float(np.sqrt(np.nanmean(np.concatenate([s[:, i] for s in by])))) for by in squares)
            rows.append(ReadingError(channel, unit, start, end, float(self.fitter.noise.floor[i])))
        return tuple(rows)


def with_held(fitted: np.ndarray, joint: np.ndarray, sds: np.ndarray) -> np.ndarray:
    """(k, k) covariance of the deviations of fitted constants c and held ones h, in this order: c - c_true = e + G (h - h_true).

    e, with the covariance `fitted`, is the deviation with h known; G = dc/dh follows from the covariance `joint` (k, k) of a fit of both,
    C_ch C_hh^-1, whatever is stated of h there. `sds` (n_h,) of h - h_true are those of the bounds, for h stays where it is.
    """
    n, S = len(fitted), np.diag(sds**2)
    if not len(sds):
        return fitted
    G = np.linalg.solve(joint[n:, n:], joint[n:, :n]).T
    return np.block([[fitted + G @ S @ G.T, G @ S], [S @ G.T, S]])


def _covariance(fit: Fit) -> np.ndarray:
    """(k, k) [SI] with the sandwich's standard deviations where they are clearly larger."""
    wider = widening(fit)
    return fit.covariance * np.outer(wider, wider)
