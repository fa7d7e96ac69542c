"""Whether the records can tell two lines of one kind apart: fringes of two periods, vibrations of two frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.hypotheses.direct_detection import detect_directly
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis
from ctrlgen.diagnosis.settings import LINE_RESOLVABILITY
from ctrlgen.effects import Param
from ctrlgen.numerics.quantisation_step import quantisation_step
from ctrlgen.recordings.recording import Recording


def lines_resolved(recording: Recording, fit: Fit, accepted: Sequence[Hypothesis] = ()) -> bool:
    """Whether every two causes of one kind at one place part, and none repeats with the rounding of its reading; those
    `accepted` are not compared with one another."""
    causes = fit.structure.causes
    if any(_on_the_lattice(recording, fit, k) for k, c in enumerate(causes) if c not in accepted):
        return False
    for j, k in combinations(range(len(causes)), 2):
        a, b = causes[j], causes[k]
        if a.effect == PARAMETER or not a.prior.repeatable or (a.effect, a.location) != (b.effect, b.location):
            continue
        if a in accepted and b in accepted:
            continue
        lines = [_line(fit, i) for i in (j, k)]
        if abs(lines[0] - lines[1]) * _covered(recording, a) < LINE_RESOLVABILITY.apart:
            return False
    return True


def _on_the_lattice(recording: Recording, fit: Fit, k: int) -> bool:
    """Whether cause k is or repeats with the steps in which its channel is read: what the readings show by themselves."""
    cause = fit.structure.causes[k]
    channel = f"reading.{cause.at}"
    if cause.effect == PARAMETER or channel not in recording.channels:
        return False
    i = recording.channels.index(channel)
    values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
    read, *_ = detect_directly(cause.law, values) or ({},)
    steps = (p.name for p in cause.law.params if p.off is None and (_is_spatial_period(cause, p) or p.name in read))
    return any(fit.values(k)[name] < LINE_RESOLVABILITY.shortest_period * quantisation_step(values) for name in steps)


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


def _covered(recording: Recording, cause: Hypothesis) -> float:
    """The longest of the records to fit [s], or how far its reading goes in them [SI]; no end where neither is meant."""
    records = [r for r in recording.records if r.role == "fit"]
    params = cause.law.params
    if any(p.unit == "Hz" for p in params):
        return max(float(r.time[-1] - r.time[0]) for r in records)
    channel = f"reading.{cause.at}"
    if not any(_is_spatial_period(cause, p) for p in params) or channel not in recording.channels:
        return np.inf
    i = recording.channels.index(channel)
    read = np.concatenate([r.observed[r.valid[:, i], i] for r in records])
    return float(np.ptp(read)) if len(read) else np.inf
