"""Whether a second sensor or a turned specimen tells an error of the sensor from one of the device, where no drive does.

The same poses are read once more, (i) by another sensor, which does not have what is suspected of this one, but scales of its own, of each
channel and, of several, of all, known to `SECOND_SCALES`; or (ii) by the same sensor with the specimen turned by a right angle about an
axis, mounted to `MOUNTED` about each axis: what the sensor does stays with its channels, what the device does goes round with it. In
settled poses either reading is zeroed with the drives off; elsewhere, where what the device remembers says where it then stands, each
channel has a zero of its own, anywhere in the range that is read. Either reading is simulated under both models, and

    separation^2 = min over delta, e of |Delta - J delta - E e|^2 + |e/s|^2

over this recording and the new one together, J the sensitivities of the model that is refitted, E those of the new reading's own errors e
of standard deviation s; of the two directions the smaller (`experiment_design`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import pi, radians

import numpy as np
from pydantic import Field

from ctrlgen.core.units import Quantity
from ctrlgen.devices.usual_deviation import ASSUMED_SCALE
from ctrlgen.diagnosis.evidence.experiment_sums import Prediction, Sums
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import EXPERIMENT
from ctrlgen.effects import Param, Place
from ctrlgen.effects.frame_rotation import FrameRotation
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.size_odds import of_sensor
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import channels
from ctrlgen.recordings.recording import Record
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number

SECOND_SCALES = (ASSUMED_SCALE, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 1e-5, 1e-6)
"""Standard deviations of the scale of a second sensor: one as good as any, then calibrated ones, last a laser interferometer in air, whose
refraction is not corrected, or is (N. Bobroff, Meas. Sci. Technol. 4 (1993) 907)."""
MOUNTED = radians(0.5)
"""rad, by which a turned specimen stands otherwise than it did. Judgement: put up by hand against a stop."""
PLANES = 3
"""Axes about which a pose in space can be turned; it has twice as many components."""


class OtherReadingEntry(Keys):
    """Another reading of the same poses, and what it decides."""

    kind: str = Field(description="second sensor, or turned specimen.")
    description: str = Field(description="In words.")
    scale: Number = Field(description="Standard deviation of the second sensor's scale that it takes; null for others.")
    separation: FiniteOrNull = Field(description="Separation of the two by both recordings [standard deviations].")
    settles: bool = Field(description="Whether that decides between them.")


@dataclass(frozen=True)
class OtherReadings:
    """The cause that is the sensor's, the one that is the device's, and what other readings decide between them, the best first; whether
    what is read are settled poses."""

    of_sensor: Hypothesis
    of_device: Hypothesis
    entries: tuple[OtherReadingEntry, ...]
    settled: bool


class _Turned(FrameRotation, listed=False):
    """The specimen stands turned under the sensor, by any angle; after all that moves it."""

    title = "The specimen stands turned"
    order = 1000
    params = (Param("angle", "rad", (-pi, pi), "by which it is turned", off=0.0),)


class _AboutX(_Turned, listed=False):
    axis = 0


class _AboutY(_Turned, listed=False):
    axis = 1


class _AboutZ(_Turned, listed=False):
    axis = 2


class _SkewX(_AboutX, listed=False):
    order = 1001  # of the specimen as it stands then


class _SkewY(_AboutY, listed=False):
    order = 1001


class _SkewZ(_AboutZ, listed=False):
    order = 1001


_ABOUT, _SKEW = (_AboutX, _AboutY, _AboutZ), (_SkewX, _SkewY, _SkewZ)


def other_readings(search: SearchResult, record: Record) -> OtherReadings | None:
    """What other readings of the poses of `record` decide between the chosen model and its first rival that gives to the sensor what it
    gives to the device, or the other way round; None where there is no such rival."""
    found = _pair(search)
    if found is None:
        return None
    chosen, rival, here, there = found
    fitter = search.fitter
    now = (Sums.present(fitter, chosen, rival), Sums.present(fitter, rival, chosen))

    def separation(read: Reading) -> float:
        a, b = (read(fitter, fit, record) for fit in (chosen, rival))
        return min(now[0].plus(fitter, a, b, record).separation, now[1].plus(fitter, b, a, record).separation)

    sensor, device = (here, there) if of_sensor(here) else (there, here)
    entries = [_second(separation, leans(sensor))]
    if len(nominal_physics(chosen.structure.device).components) == PLANES * 2:
        reached, axis = max((separation(partial(read_turned, axis)), axis) for axis in range(PLANES))
        text = f"the specimen turned by 90 deg about {'xyz'[axis]} under the same sensor"
        entries.append(_entry("turned specimen", text, None, reached))
    # what decides; a turned specimen takes no second instrument
    ranked = sorted(entries, key=lambda e: (not e.settles, e.scale is not None))
    return OtherReadings(sensor, device, tuple(ranked), bool(np.isinf(record.sample_time)))


Reading = Callable[[Fitter, Fit, Record], Prediction]


def _entry(kind: str, text: str, scale: float | None, separation: float) -> OtherReadingEntry:
    settles = separation >= EXPERIMENT.settles
    return OtherReadingEntry(kind=kind, description=text, scale=scale, separation=separation, settles=settles)


def _pair(search: SearchResult) -> tuple[Fit, Fit, Hypothesis, Hypothesis] | None:
    """The chosen fit, that of the first rival across sensor and device, and the two causes."""
    for own, rows in zip(search.chosen.causes, search.rivals, strict=True):
        for t in rows:
            if t.cause is not None and of_sensor(t.cause) != of_sensor(own):
                return search.chosen.fit, t.fit, own, t.cause
    return None


def leans(cause: Hypothesis) -> bool:
    """Whether a cause of the sensor is that one of its axes reads a share of another of its kind: then those of a second sensor matter."""
    law = None if cause.effect == PARAMETER else cause.law
    return law is not None and law.pairs and law.channel_unit is not None and law.partner_unit == law.channel_unit


def _second(separation: Callable[[Reading], float], leaning: bool) -> OtherReadingEntry:
    """The coarsest second sensor that decides, else the finest; of one that may be `leaning`, its axes too."""
    for scale in SECOND_SCALES:
        reached = separation(partial(read_by_another, scale, leaning))
        if reached >= EXPERIMENT.settles:
            break
    text = f"a second sensor whose scale is known to {100 * scale:g} %"
    text += f" and whose axes are square to {1000 * scale:g} mrad" if leaning else ""
    return _entry("second sensor", text, scale, reached)


def read_by_another(scale: float, leaning: bool, fitter: Fitter, fit: Fit, record: Record) -> Prediction:
    """What another sensor reads: no cause of the first one acts on it, but a `scale` of each channel and, of several, one of all; where
    its axes may be `leaning`, a share of each channel in each other one of its unit, too."""
    free, theta = fit.structure.free_parameters, fit.theta.copy()
    ours = [i for i, p in enumerate(free) if p.cause is not None and of_sensor(fit.structure.causes[p.cause])]
    for i in ours:
        if free[i].amplitude:
            theta[i] = free[i].nominal
    read = _from_its_zero(fitter, fit.structure, record, theta)
    read.slopes[:, :, ours] = 0.0
    n_y = read.y.shape[1]
    own = read.y[:, :, None] * np.eye(n_y)
    if n_y > 1:
        own = np.concatenate([own, read.y[:, :, None]], axis=2)
    if leaning:
        units = {c.name: c.unit for c in channels(nominal_physics(fit.structure.device), Place.SENSOR)}
        of = [units[c.removeprefix("reading.")] for c in fitter.recording.channels]
        pairs = ((i, j) for i in range(n_y) for j in range(n_y) if i != j and of[i] == of[j])
        own = np.concatenate([own, *(read.y[:, [j], None] * np.eye(n_y)[:, [i]] for i, j in pairs)], axis=2)
    return _beside(read, own, np.full(own.shape[2], scale))


def read_turned(axis: int, fitter: Fitter, fit: Fit, record: Record) -> Prediction:
    """What the same sensor reads of the specimen turned about an axis; how it is mounted then is known to `MOUNTED`."""
    s, k = fit.structure, len(fit.theta)
    turn = _ABOUT[axis]("all", {"angle": Quantity(pi / 2, f"{pi / 2!r} rad")})
    skew = [law("all", {"angle": Quantity(0.0, "0 rad")}) for law in _SKEW]
    device = s.device.model_copy(update={"effect": (*s.device.effect, turn, *skew)})
    turned = replace(s, device=device)
    first = len(s.device.effect) + 1
    angles = tuple(
        FreeParameter(f"effect[{first + i}].angle", "rad", 0.0, -pi, pi, MOUNTED, MOUNTED) for i in range(PLANES)
    )
    turned = replace(turned, free=(*turned.free_parameters, *angles))
    read = _from_its_zero(fitter, turned, record, np.concatenate([fit.theta, np.zeros(PLANES)]))
    own, rest = read.slopes[:, :, k : k + PLANES], np.delete(read.slopes, np.s_[k : k + PLANES], axis=2)
    return _beside(replace(read, slopes=rest), own, np.full(PLANES, MOUNTED))


def _from_its_zero(fitter: Fitter, structure: Structure, record: Record, theta: np.ndarray) -> Prediction:
    """The reading of a record from the place with the drives off, where the poses settle, else with zeros of its own."""
    simulator = fitter.simulator(structure, record)
    y, slopes = simulator.sensitivities(record, theta)
    here = Prediction(y, slopes, initial_state_sd(simulator))
    if np.isinf(record.sample_time):
        y_off, slopes_off = simulator.sensitivities(replace(record, drive=np.zeros_like(record.drive)), theta)
        return replace(here, y=y - y_off, slopes=slopes - slopes_off)
    span = np.ptp(y, axis=0)
    zeros = np.broadcast_to(np.eye(y.shape[1]), (len(y), *2 * y.shape[1:]))
    return replace(here, own=zeros, own_sd=np.where(span > 0, span, 1.0))


def _beside(read: Prediction, own: np.ndarray, sd: np.ndarray) -> Prediction:
    """The reading with errors of its own (n, n_y, m), of deviations (m,), beside those that it has."""
    if read.own is None or read.own_sd is None:
        return replace(read, own=own, own_sd=sd)
    return replace(read, own=np.concatenate([read.own, own], axis=2), own_sd=np.concatenate([read.own_sd, sd]))
