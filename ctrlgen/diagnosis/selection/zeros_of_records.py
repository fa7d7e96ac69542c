"""Readings whose zero is another in each record: sensors that are zeroed anew, or that drift between runs.

A zero of its own takes the mean of whatever is missing in a record. It is tried where such means are most of what is left of a reading,
beyond one mean of all records.
"""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Recording


def has_several_runs(recording: Recording) -> bool:
    """Whether readings in time are recorded in two runs or more: the parts of one file have one zero."""
    return recording.kind == "series" and len({_file(r) for r in recording.records if r.role != "rest"}) > 1


def _file(record: Record) -> str:
    return record.file or record.name


def fit_own_zeros(trials: Trials, current: CandidateModel) -> tuple[CandidateModel, ...]:
    """A zero of its own in each record for every reading of which such zeros are most of what is left, and for all of these at once,
    beside `current`, or in the place of a constant that it has there."""
    open_ = [h for h in trials.screen.hypotheses if h.prior.of_each_record and h.beside(current.causes) is not None]
    most = own_zeros(trials.fitter, current.fit) if open_ else {}
    apart = [h for h in open_ if most.get(f"reading.{h.at}", 0.0) >= SEARCH.least_of_zeros]
    sets = [[h] for h in apart] + ([apart] if len(apart) > 1 else [])
    fitted = trials.each(lambda branch, causes: branch.tried(_with(current.fit, causes), causes[-1]), sets)
    return tuple(t for found in fitted for t in found)


def own_zeros(fitter: Fitter, fit: Fit) -> dict[str, float]:
    """By channel the share of the squares that a fit leaves about their mean, of the records to fit and those held out, that a mean of
    each run takes away: sum_r n_r (m_r - m)^2 / sum (e - m)^2 of the residual e. The parts of one file are one run."""
    runs = [r for r in fitter.recording.records if r.role != "rest"]
    left = [r.observed - fitter.predict(fit, r) for r in runs]
    shares = {}
    for i, channel in enumerate(fitter.recording.channels):
        of_run: dict[str, list[np.ndarray]] = {}
        for e, r in zip(left, runs, strict=True):
            of_run.setdefault(_file(r), []).append(e[r.valid[:, i] & np.isfinite(e[:, i]), i])
        parts = [e for e in map(np.concatenate, of_run.values()) if len(e)]
        if len(parts) > 1:
            every = np.concatenate(parts)
            whole = float(np.sum((every - every.mean()) ** 2))
            between = sum(len(e) * float(e.mean() - every.mean()) ** 2 for e in parts)
            shares[channel] = between / whole if whole > 0 else 0.0
    return shares


def zeros_in_records(fitter: Fitter, fit: Fit, cause: Hypothesis) -> dict[str, tuple[float, float]]:
    """The zero of the reading in each record that moves, by the record's name, and how far its 95 % interval reaches to either side [SI]:
    that of a constant under the errors of the fit. Of records with one name also the time at which each begins."""
    i, found = fitter.recording.channels.index(f"reading.{cause.at}"), {}
    own = re.compile(rf"{cause.effect}_\d+_{cause.law.states[0].name}_{re.escape(cause.at)}")
    runs = [r for r in fitter.recording.records if r.role != "rest"]
    often = Counter(r.name for r in runs)
    for record in runs:
        simulator = fitter.simulator(fit.structure, record)
        names = simulator.model.x_names
        (place,) = (
            k for k, x in enumerate(simulator.free_initial_states) if x < len(names) and own.fullmatch(names[x])
        )
        constant = np.zeros(record.observed.shape)
        constant[:, i] = 1.0
        told = float(np.sum(fitter.error.whiten(constant, record.valid) ** 2))
        value = float(fitter.begun(fit, record)[0][place])
        begun = f" from {record.time[0]:g} s" if often[record.name] > 1 else ""
        found[record.name + begun] = value, STATISTICS.z_95 / np.sqrt(told) if told > 0 else np.inf
    return found


def _with(fit: Fit, causes: list[Hypothesis]) -> Structure:
    """The structure with the causes beside the others, without the constants of the same readings."""
    structure = fit.restarted
    for cause in causes:
        for k in reversed(range(len(structure.causes))):
            other = structure.causes[k]
            if other.location == cause.location and other.prior.constant:
                structure = structure.without(k)
        structure = structure.with_cause(cause, {cause.law.amplitude().name: 1.0})
    return structure
