"""What speaks against taking a candidate model's causes for what their names say, whatever the model explains.

An amplitude outside of its law's range, a line that the records are too short to tell, an event at the onset of motion: each
is another cause under this law's name. A cause that meets an objection is taken out of its candidate, and the report says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.devices.device_physics import BalancedPhysics, ImposedPhysics
from ctrlgen.diagnosis.selection.way_covered import both_ways, way_covered
from ctrlgen.diagnosis.settings import OBJECTIONS
from ctrlgen.effects import Family, Param
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.free_parameters import SHAPE_AT_BOUND
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics
from ctrlgen.estimation.quiet_stretches import period_of
from ctrlgen.estimation.raw_readings import detect_directly
from ctrlgen.estimation.record_states import place_of_told
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.reporting.numbers import with_unit


def objections(
    recording: Recording, fit: Fit, accepted: Sequence[Hypothesis] = (), exact: bool = False
) -> dict[int, str]:
    """The reason by cause, by its place in the structure, of each that is not yet `accepted` and meets an objection; and of an accepted
    one that has grown so long, while others came and went, that the records do not show that it repeats, or so near to another line of
    its kind that they no longer tell the two apart.

    `exact`: the model leaves noise alone, so that an event, a short line or a pitch of one period is what it looks like.
    """
    causes = fit.structure.causes
    reasons: dict[int, str] = {}
    for k, cause in enumerate(causes):
        if cause in accepted:
            if reason := _no_pitch(recording, fit, k, exact):
                reasons[k] = reason
            continue
        reason = (
            another_law(fit, k)
            or _no_turn(recording, fit, k)
            or _on_the_lattice(recording, fit, k)
            or (_no_pitch(recording, fit, k, exact) if exact else _of_another_kind(recording, fit, k))
        )
        if reason:
            reasons[k] = reason
    for j, k in combinations(range(len(causes)), 2):
        new = j if causes[k] in accepted and causes[j] not in accepted else k
        if new not in reasons and _same_line(recording, fit, j, k):
            reasons[new] = "the records are too short to tell it from another line of its kind"
    return reasons


def _of_another_kind(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why cause k, beside which more than noise is left, only looks like its law; None where nothing says so."""
    tests = (_no_pitch, _no_line, _no_event, _no_drift)
    return next((reason for test in tests if (reason := test(recording, fit, k))), None)


def outside_its_range(fit: Fit, k: int) -> str | None:
    """Why the numbers of cause k are not those of its law; None where they are."""
    structure, cause = fit.structure, fit.structure.causes[k]
    if cause.effect != PARAMETER and (reason := cause.law.contradiction(fit.values(k))):
        return reason
    for u, value in zip(structure.free_parameters, fit.theta, strict=True):
        if u.cause != k or not u.amplitude:
            continue

        def shown(si: float, unit: str = u.unit) -> str:
            return with_unit(float(from_si(si, unit)), unit, 3)

        plausible = structure.plausible_range(u)
        if plausible and not plausible[0] <= value <= plausible[1]:
            return f"{u.name} = {shown(value)} is outside of {shown(plausible[0])} ... {shown(plausible[1])}"
        span = OBJECTIONS.at_bound * (u.high - u.low)
        # a reading that is not late is in time
        if value >= u.high - span or (value <= u.low + span and u.low != u.nominal and not cause.shifts):
            return f"{u.name} is at its bound of {shown(float(value))}"
    return None


def another_law(fit: Fit, k: int) -> str | None:
    """Why cause k, whatever it was when it was accepted, is now another law: its numbers are not those of its own, or tell of no such
    law; None where it is not."""
    return outside_its_range(fit, k) or _at_a_bound(fit, k)


def _at_a_bound(fit: Fit, k: int) -> str | None:
    """Why cause k is another law: a shape that is at its bound, or of which the records say nothing; None where it is not."""
    structure, cause = fit.structure, fit.structure.causes[k]
    if cause.effect == PARAMETER:
        return None
    for i, (u, value) in enumerate(zip(structure.free_parameters, fit.theta, strict=True)):
        stated = cause.law.at_bounds.get(u.name)
        if u.cause != k or stated is None:
            continue
        ways, (at_low, at_high) = u.low > 0, u.shape_ends(float(value))
        if other := (stated.low if at_low else "") or (stated.high if at_high else ""):
            return f"its {u.name} is at a bound of {with_unit(float(from_si(value, u.unit)), u.unit, 3)}, where it is {other}"
        told, beside = (value * size for size in _told(fit, k, i))
        if stated.untold and ways and told < OBJECTIONS.told_shape:
            return f"the records say nothing of its {u.name}; without one it is {stated.untold}"
        if stated.as_size and ways and beside < OBJECTIONS.told_shape <= told:
            return f"the records do not tell its {u.name} from its size; where they do not it is {stated.as_size}"
    return "no loop is seen; without one it is a gain" if _has_no_loop(fit, k) else None


def _told(fit: Fit, k: int, i: int) -> tuple[float, float]:
    """How much all readings depend on number i, per its unit in standard deviations, and how much beside what the size of its cause k
    does."""
    slope, free = fit.J[:, i], fit.structure.free_parameters
    rest = slope
    for size in (fit.J[:, j] for j, u in enumerate(free) if u.cause == k and u.amplitude):
        rest = rest - size * (size @ rest) / max(float(size @ size), 1e-300)
    return float(np.linalg.norm(slope)), float(np.linalg.norm(rest))


def _has_no_loop(fit: Fit, k: int) -> bool:
    """Whether what cause k adds is in proportion to its signal, but for less than the noise: its amplitude's slope is that of the shape
    that adds such a part."""
    numbers = {u.name: i for i, u in enumerate(fit.structure.free_parameters) if u.cause == k}
    priors = fit.structure.causes[k].prior
    amplitude = fit.structure.causes[k].law.amplitude()
    along = [
        i
        for p in fit.structure.causes[k].law.params
        if (i := numbers.get(p.name)) is not None and priors.of(p).proportional
    ]
    if not along or amplitude.name not in numbers:
        return False
    added = fit.J[:, numbers[amplitude.name]] * fit.theta[numbers[amplitude.name]]
    proportional = fit.J[:, along[0]]
    rest = added - proportional * (proportional @ added) / max(float(proportional @ proportional), 1e-300)
    return float(np.linalg.norm(rest)) < OBJECTIONS.told_loop


def _same_line(recording: Recording, fit: Fit, j: int, k: int) -> bool:
    """Whether two causes are lines of one kind at one place that do not part within the records to fit."""
    a, b = fit.structure.causes[j], fit.structure.causes[k]
    if a.effect == PARAMETER or not a.prior.repeatable or (a.effect, a.location) != (b.effect, b.location):
        return False
    return abs(_line(fit, j) - _line(fit, k)) * _covered(recording, a, fit) < OBJECTIONS.apart


def _no_turn(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why a loop, or a number that changes by the clock, is none: in no record to fit does a drive turn back, and up to the first turn
    either is a curve of the position; None where it may be one. What has inertia turns back by itself."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER:
        return None
    loop = cause.law.family is Family.HYSTERESIS
    if not loop and (cause.prior.of_time or not any(s.clock for s in cause.law.states)):
        return None
    physics = nominal_physics(fit.structure.device)
    by_itself = recording.kind == "series" and not isinstance(physics, BalancedPhysics | ImposedPhysics)
    if by_itself or both_ways([r.drive for r in recording.records if r.role == "fit"]):
        return None
    what = "a loop" if loop else "what changes with time"
    return f"no drive turns back in the records to fit; before a turn {what} cannot be told from a curve"


def _no_pitch(recording: Recording, fit: Fit, k: int, exact: bool = False) -> str | None:
    """Why an error that repeats along a reading does not: the reading goes no farther than about its period; None where it may. A part
    of a period is a curve too where the model is `exact`."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER or not any(_is_spatial_period(cause, p) for p in cause.law.params):
        return None
    periods = _line(fit, k) * _covered(recording, cause, fit)
    fewest = 1.0 if exact else OBJECTIONS.fewest_pitches
    if periods > fewest * (1 + SHAPE_AT_BOUND):  # at its bound it would go on growing
        return None
    return f"the reading covers {periods:.1f} periods of it, and {fewest:g} are needed to see it repeat"


def _no_line(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why a disturbance of one frequency is none: the records are too short to tell one, or the drive itself repeats with its
    harmonic; None where it may be one."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER or cause.prior.domain != "disturbance" or recording.kind != "series":
        return None
    if not any(p.unit == "Hz" for p in cause.law.params):
        return None
    line, covered = _line(fit, k), _covered(recording, cause, fit)
    if line * covered < OBJECTIONS.fewest_periods:
        fewest = f"{OBJECTIONS.fewest_periods:.0f} are needed to tell a line"
        return f"the records hold {line * covered:.1f} periods of it, and {fewest}"
    near = max(OBJECTIONS.harmonic / covered, _line_interval(fit, k))
    orders = [_harmonic(record, line, near) for record in recording.records if record.role in ("fit", "hold_out")]
    # a line that drives of other periods meet too is none of theirs: where they do not meet it, held-out errors speak against it
    if not orders or 0 in orders:
        return None
    return f"it is harmonic {orders[0]} of the drive's period, as everything is that the drive causes"


def _harmonic(record: Record, line: float, near: float) -> int:
    """The harmonic of a record's drive that a line [Hz] is, within `near` [Hz]; 0 where it is none or the drive does not repeat."""
    period = period_of(record) or _nearly_period(record)
    order = round(line * period) if period else 0
    return order if period and order and abs(line - order / period) < near else 0


def _line_interval(fit: Fit, k: int) -> float:
    """Half the 95 % interval [Hz] of the frequency of cause k."""
    free = fit.structure.free_parameters
    places = (i for i, p in enumerate(free) if p.cause == k and p.unit == "Hz")
    i = next(places, None)
    return 0.0 if i is None else STATISTICS.z_95 * float(np.sqrt(max(fit.covariance[i, i], 0.0)))


def _nearly_period(record: Record) -> float | None:
    """Period [s] after which a drive that was measured repeats but for its noise: the first high peak of its autocorrelation."""
    n = len(record.drive)
    for drive in (record.drive - np.mean(record.drive, axis=0)).T:
        power = np.abs(np.fft.rfft(drive, 2 * n)) ** 2
        r = np.fft.irfft(power)[: n // 2] / (n - np.arange(n // 2))
        fallen = np.flatnonzero(r < 0)
        if not len(fallen):
            continue
        lag = int(fallen[0]) + int(np.argmax(r[fallen[0] :]))
        if r[lag] > OBJECTIONS.repeats * r[0]:
            return lag * record.sample_time
    return None


def _no_event(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why an event is none of its own: it is slow, as physics that was left out is, or begins where the drive begins or ceases
    to move; None where it may be one."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER or recording.kind != "series":
        return None
    moments = cause.prior.moments
    values = fit.values(k)
    for record in (r for r in recording.records if r.role == "fit" and moments):
        near = OBJECTIONS.onset_samples * record.sample_time
        sharp = max(OBJECTIONS.sharp * float(record.time[-1] - record.time[0]), near)
        if values.get("rise", 0.0) > sharp:
            return f"its rise of {values['rise']:.3g} s is slow beside the record; an event is sharp"
        if any(abs(values[name] - t) <= near for name in moments for t in _onsets(record)):
            return "it happens where the motion begins or ends, as friction, slack and delays do"
    return None


def _no_drift(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why a drift is none: it would be a large part of the motion; None where it may be one."""
    cause = fit.structure.causes[k]
    channel = f"reading.{cause.at}"
    if cause.effect == PARAMETER or recording.kind != "series" or channel not in recording.channels:
        return None
    if cause.prior.form_of != "drift":
        return None
    i = recording.channels.index(channel)
    records = [r for r in recording.records if r.role == "fit"]
    read = np.concatenate([r.observed[r.valid[:, i], i] for r in records])
    time = max((float(r.time[-1] - r.time[0]) for r in records), default=0.0)
    numbers = fit.values(k)
    if cause.prior.of_each_record:
        most = max((abs(rate) for rate in _own_rates(recording, fit, cause)), default=0.0) * time
    elif "tau" in numbers:
        most = numbers["size"] * -np.expm1(-time / numbers["tau"])
    else:
        most = numbers["rate"] * time
    share = abs(most) / max(float(np.ptp(read)) if len(read) else 0.0, 1e-300)
    if share <= OBJECTIONS.largest_drift:
        return None
    return f"it would drift by {100 * share:.0f} % of the motion within a record"


def _own_rates(recording: Recording, fit: Fit, cause: Hypothesis) -> Iterator[float]:
    """The rate [SI] at which a reading drifts in each record to fit, of a drift of each."""
    for record, states in zip((r for r in recording.records if r.role == "fit"), fit.initial_states, strict=True):
        yield float(states[place_of_told(fit.structure.simulator(recording.channels, record.timing), cause)])


def _onsets(record: Record) -> np.ndarray:
    """Times [s] at which a drive that stood still begins to move, or one that moved stands still."""
    span = np.ptp(record.drive, axis=0)
    moving = np.any(np.abs(np.diff(record.drive, axis=0)) > OBJECTIONS.standing * span, axis=1)
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    long = int(OBJECTIONS.rest_samples)

    def after_rest_or_before(a: int) -> bool:
        rest = moving[max(a + 1 - long, 0) : a + 1] if moving[a + 1] else moving[a + 1 : a + 1 + long]
        return not rest.any()

    return np.array([record.time[a + 1] for a in edges.tolist() if after_rest_or_before(a)])


def _on_the_lattice(recording: Recording, fit: Fit, k: int) -> str | None:
    """Why cause k is the rounding of its channel, which the readings show by themselves; None where it is not."""
    cause = fit.structure.causes[k]
    channel = f"reading.{cause.at}"
    if cause.effect == PARAMETER or channel not in recording.channels:
        return None
    i = recording.channels.index(channel)
    values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
    read, *_ = detect_directly(cause.law, values) or ({},)
    steps = (p.name for p in cause.law.params if p.off is None and (_is_spatial_period(cause, p) or p.name in read))
    shortest = OBJECTIONS.shortest_period * quantisation_step(values)
    return "it repeats with the steps of the reading" if any(fit.values(k)[name] < shortest for name in steps) else None


def _is_spatial_period(cause: Hypothesis, p: Param) -> bool:
    return cause.prior.of(p).start_from_data == "spatial_periods"


def _line(fit: Fit, k: int) -> float:
    """Periods a second, or a unit of the path, of cause k; zero for one that has none."""
    values = fit.values(k)
    cause = fit.structure.causes[k]
    for p in cause.law.params:
        if p.unit == "Hz":
            return values[p.name]
        if _is_spatial_period(cause, p):
            return 1 / values[p.name]
    return 0.0


def _covered(recording: Recording, cause: Hypothesis, fit: Fit) -> float:
    """The longest of the records to fit [s], or how far its reading, or its axis, goes in them [SI]; no end where neither is
    meant."""
    if any(p.unit == "Hz" for p in cause.law.params):
        return max(float(r.time[-1] - r.time[0]) for r in recording.records if r.role == "fit")
    return way_covered(recording, cause, fit.structure.device) if cause.prior.is_pitch else np.inf
