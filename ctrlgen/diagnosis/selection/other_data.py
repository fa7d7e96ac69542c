"""What a model teaches of the records: which readings are spikes, and what the drive did between samples, where nobody states it."""

from __future__ import annotations

from dataclasses import replace

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.isolated_outliers import mark_again
from ctrlgen.estimation.unstated_drive import read_better


def learn_mismatch(trials: Trials, described: CandidateModel) -> None:
    """What the device as described leaves on the held-out records is what causes are measured by."""
    trials.mismatch = described.held_out.plain_mean * trials.fitter.noise.floor**2


def marked_again(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The same model fitted to the readings without the spikes that it uncovers, and with those that it explains."""
    fitter = trials.fitter
    if trials.markings >= SEARCH.most_markings:
        return current
    recording = mark_again(fitter.recording, lambda record: fitter.predict(current.fit, record), fitter.noise)
    if recording is fitter.recording:
        return current
    trials.markings += 1
    return _by(trials, replace(fitter, recording=recording), current)


def read_again(trials: Trials, current: CandidateModel) -> CandidateModel:
    """The same model with a drive of which nobody states what it does between samples read as the model fits best."""
    if not current.causes:
        return current
    try:
        fitter = read_better(trials.fitter, current.fit)
    except FAILURES as error:
        trials.note_failure(current.cause, error)
        return current
    return current if fitter is trials.fitter else _by(trials, fitter, current)


def _by(trials: Trials, fitter: Fitter, current: CandidateModel) -> CandidateModel:
    """The same model fitted by a fitter of other data: what was measured by those of before is forgotten."""
    trials.beaten = {}
    trials.use(fitter)
    learn_mismatch(trials, scored(trials.fitter, trials.fitter.described(current.fit.structure.device)[1]))
    return trials.with_noise_update(trials.with_errors(trials.converged(current)))
