"""The run-time constants of one specimen from a recording: the numbers of [run_time] alone are fitted, everything else is held.

    min over p of rho(W (y - y(p, s))) + sum (s_j/sd_j)^2,   low <= p <= high

as `ctrlgen.estimation.least_squares` states it, under the noise and the discrepancy of the recording. A constant that the
recording does not tell better than `TOLD` times what its bounds tell keeps its default; the intervals of the others then include what
it may be within its bounds (uniform, GUM 4.3.7), with which they are correlated (GUM 5.2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.calibration.sensor_share import by_held, sensor_covariance
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference, from_si, show_difference
from ctrlgen.devices import Device, load_device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.devices.usual_deviation import ASSUMED_SCALE
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.late_readings import settling_time_of
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.noise_update import update_guessed_noise
from ctrlgen.estimation.robust_covariance import widening
from ctrlgen.estimation.settings import DISCREPANCY, NOISE_UPDATE, STATISTICS
from ctrlgen.estimation.simulator import compiled_simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.estimation.unstated_drive import as_described_fits, told_of_reading
from ctrlgen.model.assembly import build_model, movable, symbolic_model
from ctrlgen.recordings.plausibility import suspected, with_plausibility
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.numbers import with_interval
from ctrlgen.trajectory.scenario import Input, device_inputs

TOLD = 0.5
"""Share of the standard deviation that its bounds alone give a constant: above, the recording does not determine it."""
FAR_READING = 3.0
"""Times the model's motion (rms) by which readings may be off it: more is another unit or origin."""
AT_BOUND = 1e-4
"""Share of the range: a value so near its end was held there."""


class Determination(Enum):
    """What a recording says of a constant, in the words of the report."""

    DETERMINED = ""
    AT_BOUND = (
        "at its bound: the specimen lies beyond it, or the device file leaves something out; run ctrlgen diagnose"
    )
    BOUNDS_ALONE = "not determined by this recording beyond its bounds"
    IDLE = "acts on nothing that moves or is read"


@dataclass(frozen=True)
class CalibratedConstant:
    """One constant, SI: its `value`, its standard deviation `sd`, and what the recording says of it."""

    constant: RunTimeConstant
    value: float
    sd: float
    determination: Determination

    @property
    def determined(self) -> bool:
        """Whether the recording tells the value; else it is the default."""
        return self.determination in (Determination.DETERMINED, Determination.AT_BOUND)

    @property
    def remark(self) -> str:
        """What the reader should know of it."""
        return self.determination.value

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval within the bounds."""
        c, reach = self.constant, STATISTICS.z_95 * self.sd
        if not self.determined:
            return c.low, c.high
        return max(self.value - reach, c.low), min(self.value + reach, c.high)

    @property
    def texts(self) -> tuple[str, str, str]:
        """The value and the ends of its interval in the unit of the device file, to the digits that are known."""
        c = self.constant
        if not self.determined:
            return c.shown(self.value), c.shown(c.low), c.shown(c.high)
        value, low, high = (float(from_si(v, c.unit)) for v in (self.value, *self.interval))
        first, *ends = (f"{text} {c.unit}".removesuffix(" 1") for text in with_interval(value, (low, high)))
        return first, ends[0], ends[1]


@dataclass(frozen=True)
class ReadingError:
    """Root mean square [SI] of the error of one observed channel on held-out records, before and after, with the channel's noise;
    `unit` of the reader."""

    channel: str
    unit: str
    before: float
    after: float
    noise: float


@dataclass(frozen=True, repr=False)
class Calibration(Tabular, Reported):
    """The constants of a specimen of `device`, described by `inputs`, from `recording`. `covariance` (k, k) [SI] of the constants in
    their order; that of one which is not determined is what its bounds say. `of_sensor` (k, k) [SI]: what a wrong scale of the sensor makes
    of them, which is not in `covariance`: no recording with this sensor tells it."""

    device: Device
    inputs: dict[str, Input]
    recording: Recording
    constants: tuple[CalibratedConstant, ...]
    covariance: np.ndarray
    errors: tuple[ReadingError, ...]
    notes: tuple[str, ...]
    of_sensor: np.ndarray | None = None

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "device": self.device.name,
            "recording": self.recording.title,
            "constants": f"{sum(c.determined for c in self.constants)} of {len(self.constants)} determined",
        }

    def columns(self) -> tuple[Column, ...]:
        """A row a constant: its value and standard deviation in the `unit` of the row, and what the recording says of it."""
        every = self.constants
        return (
            Column("constant", "", [c.constant.path for c in every]),
            Column("value", "", [from_si(c.value, c.constant.unit) for c in every]),
            Column("sd", "", [difference(c.sd, c.constant.unit) for c in every]),
            Column("unit", "", [c.constant.unit for c in every]),
            Column("remark", "", [c.remark for c in every]),
        )

    @property
    def calibrated(self) -> Device:
        """The device with these constants as its numbers."""
        return changed(self.device, {c.constant.path: c.value for c in self.constants if c.determined})


def specimen(device: Device, chosen: Sequence[RunTimeConstant], held: Sequence[RunTimeConstant] = ()) -> Structure:
    """The device with the `chosen` constants free within their bounds, then those `held` by what their bounds say of them."""
    free = [FreeParameter(c.path, c.unit, c.default, c.low, c.high, c.high - c.low) for c in (*chosen, *held)]
    known = [replace(p, sd=sd_of_bounds(c)) for p, c in zip(free[len(chosen) :], held, strict=True)]
    return Structure(device, free=(*free[: len(chosen)], *known))


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
    # Those of an earlier calibration only take memory
    compiled_simulator.cache_clear()
    described = load_device(device)
    if not described.given_at_start:
        what = 'is missing: it names what differs between specimens; write [run_time] and under it constants = ["actuator.ambient"]'
        raise InputError(device, [Fault("run_time", what)])
    progress("reading")
    model = build_model(described)
    recording = with_plausibility(load_recordings(recordings, model), model)
    inputs = device_inputs(Path(device))
    # A trial value may lead nowhere, and is then rejected.
    with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _calibration(described, recording, inputs, progress)


def _calibration(
    device: Device, recording: Recording, inputs: dict[str, Input], progress: Callable[[str], None]
) -> Calibration:
    """The constants that the recording determines, and the errors that are left with them."""
    constants, acting = device.given_at_start, set(movable(device))
    chosen = [c for c in constants if c.path in acting]
    progress("noise")
    settling = settling_time_of(device)
    usable, notes = _usable(device, recording, settling)
    fitter = as_described_fits(device, Fitter(usable, estimate_noise(usable, settling)))
    fitter = _weighed(fitter, specimen(device, chosen))
    fit, told = _told(fitter, device, chosen, progress)
    covariance = _covariance_within_bounds(fitter, device, fit, told, [c for c in chosen if c not in told])
    order, of_sensor = [constants.index(c) for c in told], np.zeros(covariance.shape)
    of_sensor[np.ix_(order, order)] = sensor_covariance(fitter, fit)
    rows = []
    for k, c in enumerate(constants):
        value = float(fit.theta[told.index(c)]) if c in told else c.default
        state = Determination.BOUNDS_ALONE if c in chosen else Determination.IDLE
        if c in told:
            held = min(value - c.low, c.high - value) < AT_BOUND * (c.high - c.low)
            state = Determination.AT_BOUND if held else Determination.DETERMINED
        rows.append(CalibratedConstant(c, value, float(np.sqrt(covariance[k, k])), state))
    errors = _errors(fitter, fitter.fit(specimen(device, told), steps=0), fit)
    _check_readings(fitter, fit, errors)
    more = [e.channel for e in errors if e.after > DISCREPANCY.ratio * 2 * e.noise]
    if more:
        what = "differs from the model by more than its noise whatever the constants are: run ctrlgen diagnose to find what the model lacks"
        notes.append(f"{', '.join(more)} {what}")
    noise = fitter.noise
    notes += [note for note, source in zip(noise.notes, noise.sources, strict=True) if not source.stated]
    notes += told_of_reading(fitter, fit)
    notes += _sensor_notes(rows, of_sensor)
    unique = tuple(dict.fromkeys(notes))
    return Calibration(device, inputs, fitter.recording, tuple(rows), covariance, errors, unique, of_sensor)


def _sensor_notes(rows: Sequence[CalibratedConstant], of_sensor: np.ndarray) -> list[str]:
    """The budget of the sensor: which constants its scale may be off by more than the recording leaves of them."""
    off = [
        f"{row.constant.path} by {show_difference(sd, row.constant.unit, 3)}"
        for row, sd in zip(rows, np.sqrt(np.diag(of_sensor)), strict=True)
        if row.determined and sd > row.sd
    ]
    if not off:
        return []
    scales = f"scales that are off by their standard deviation (where the device file states none, {100 * ASSUMED_SCALE:g} %)"
    what = f"{scales} move {', '.join(off)}"
    return [
        f"budget of the sensor: {what}, more than the intervals show; no recording with this sensor tells it, a second sensor does, or the "
        "specimen turned by 90 degrees under it"
    ]


def _usable(device: Device, recording: Recording, settling: float) -> tuple[Recording, list[str]]:
    """The recording as far as the constants are to explain it, and what its reader should know of that.

    The ambient is a constant. Where the state of rest depends on a constant, rows count from when a record's start is forgotten,
    `settling` [s] after it: a simulation begins at the rest of the file. Raises InputError for a record that is no longer.
    """
    notes = list(recording.notes)
    if any(r.ambient is not None for r in recording.records):
        notes.append(
            "the recorded ambient temperature is not used: a constant of [run_time] holds for the whole recording"
        )
    records = [replace(r, ambient=None) for r in recording.records]
    rests = symbolic_model(device, [c.path for c in device.given_at_start]).rest_formula
    for k, record in enumerate(records):
        if not ca.symvar(rests) or not np.isfinite(record.sample_time):
            continue
        rows = int(np.ceil(settling / record.sample_time))
        if rows >= len(record.time):
            what = f"lasts no longer than {to_digits(settling, 3)} s, in which its start is forgotten; record longer"
            raise InputError(record.name, [Fault("record", what)])
        notes.append(
            f"{record.name}: the first {to_digits(settling, 3)} s are not used, because the state of rest depends on a constant"
        )
        valid = record.valid.copy()
        valid[:rows] = False
        records[k] = replace(record, valid=valid)
    return replace(recording, records=tuple(records)), notes


def _weighed(fitter: Fitter, structure: Structure) -> Fitter:
    """The fitter without outliers, with guessed noise and the discrepancy estimated in turn with the fit."""
    fit = fitter.fit(structure)
    before = fitter.with_errors_of(fit)
    good = mark_outliers(before.recording, lambda record: before.predict(fit, record))
    fitter = replace(fitter, recording=good)
    for _ in range(NOISE_UPDATE.guessed_refits if fitter.noise.guessed.any() else 0):
        fit = fitter.fit(structure)
        fitter = fitter.with_noise(update_guessed_noise(fitter.with_errors_of(fit), fit))
    return fitter.with_settled_errors(structure)


def _told(
    fitter: Fitter, device: Device, chosen: Sequence[RunTimeConstant], progress: Callable[[str], None]
) -> tuple[Fit, list[RunTimeConstant]]:
    """The fit of those constants that the recording tells better than their bounds, left out one at a time, and these.

    Raises InputError where it tells none.
    """
    told = list(chosen)
    while told:
        progress(f"fit of {', '.join(c.path for c in told)}")
        fit = fitter.fit(specimen(device, told))
        sds = np.sqrt(np.maximum(np.diag(_covariance(fit)), 0.0))
        shares = np.array([sd / sd_of_bounds(c) for c, sd in zip(told, sds, strict=True)])
        if np.all(shares <= TOLD):
            return fit, told
        del told[int(np.argmax(np.where(np.isfinite(shares), shares, np.inf)))]
    why = {c.path: Determination.BOUNDS_ALONE if c in chosen else Determination.IDLE for c in device.given_at_start}
    faults = [Fault(f"run_time.constants {path}", reason.value) for path, reason in why.items()]
    what = "determines none of the constants: record a motion that depends on them"
    raise InputError(fitter.recording.title, [Fault("recording", what), *faults, *suspected(fitter.recording.notes)])


def _covariance_within_bounds(
    fitter: Fitter, device: Device, fit: Fit, told: Sequence[RunTimeConstant], held: Sequence[RunTimeConstant]
) -> np.ndarray:
    """(k, k) [SI] of all constants in their order: those `told` as fitted beside those `held`, the others as their bounds say."""
    constants, sds = device.given_at_start, np.array([sd_of_bounds(c) for c in held])
    values = np.concatenate([fit.theta, [c.default for c in held]])
    joint = fitter.fit(specimen(device, told, held), values, steps=0)
    order = [constants.index(c) for c in (*told, *held)]
    covariance = np.diag([sd_of_bounds(c) ** 2 for c in constants])
    covariance[np.ix_(order, order)] = with_held(_covariance(fit), joint.covariance, sds)
    return covariance


def _check_readings(fitter: Fitter, fit: Fit, errors: Sequence[ReadingError]) -> None:
    """Refuses readings that are farther off than the stage moves. Raises InputError."""
    moved = np.concatenate([fitter.predict(fit, record) for record in fitter.held_out_records])
    size = np.sqrt(np.mean(moved**2, axis=0))
    off = [(e, e.after / s) for e, s in zip(errors, size, strict=True) if e.after > FAR_READING * s > 0]
    what = "times as far from the model as the model moves; check its column, unit, sign and origin"
    if faults := [Fault(e.channel, f"is {to_digits(ratio, 2)} {what}") for e, ratio in off]:
        raise InputError(fitter.recording.title, [*faults, *suspected(fitter.recording.notes)])


def _errors(fitter: Fitter, before: Fit, after: Fit) -> tuple[ReadingError, ...]:
    """The errors on held-out records, channel by channel."""
    recording, records, rows = fitter.recording, fitter.held_out_records, []
    squares = [
        [np.where(r.valid, r.observed - fitter.predict(fit, r), np.nan) ** 2 for r in records]
        for fit in (before, after)
    ]
    for i, (channel, unit) in enumerate(zip(recording.channels, recording.units, strict=True)):
        start, end = (float(np.sqrt(np.nanmean(np.concatenate([s[:, i] for s in by])))) for by in squares)
        rows.append(ReadingError(channel, unit, start, end, float(fitter.noise.floor[i])))
    return tuple(rows)


def with_held(fitted: np.ndarray, joint: np.ndarray, sds: np.ndarray) -> np.ndarray:
    """(k, k) covariance of the deviations of fitted constants c and held ones h, in this order: c - c_true = e + G (h - h_true).

    e, with the covariance `fitted`, is the deviation with h known; G = dc/dh follows from the covariance `joint` (k, k) of a fit of both
    (`by_held`). `sds` (n_h,) of h - h_true are those of the bounds, for h stays where it is.
    """
    n, S = len(fitted), np.diag(sds**2)
    if not len(sds):
        return fitted
    G = by_held(joint, n)
    return np.block([[fitted + G @ S @ G.T, G @ S], [S @ G.T, S]])


def _covariance(fit: Fit) -> np.ndarray:
    """(k, k) [SI] with the sandwich's standard deviations where they are clearly larger."""
    wider = widening(fit)
    return fit.covariance * np.outer(wider, wider)
