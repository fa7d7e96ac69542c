"""Suspects of a device that is far off: the scores are of a linear model, about a motion that is not the one recorded.

A machine that moves five times as far as its records say has another brake than the slope at that speed tells, and what clips its drive
scores more. One simulation of a cause costs little beside a fit, and tells what a fit of it may reach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.estimation.hypothesis import PARAMETER


def nearer_when_simulated(
    trials: Trials, current: CandidateModel, screened: Screened, chosen: Sequence[Suspect]
) -> list[Suspect]:
    """Of the suspects that score, but less than those `chosen`, the few that come nearest to the records when they are simulated, at
    the best of several amplitudes; none where what is left is small beside the motion."""
    others = [s for s in screened.suspects if s.z and s not in chosen and not s.hypothesis.prior.in_a_region]
    if trials.fitter.recording.kind == "poses" or not others or not is_far_off(trials, current):
        return []
    most = screened.suspects[0].z ** 2
    others = [s for s in others if s.z**2 >= SEARCH.smallest_score * most]

    def simulated(branch: Trials, s: Suspect) -> tuple[float, Suspect]:
        def reached(start: dict[str, float]) -> float:
            try:
                return branch.fitter.rough_objective(current.fit.restarted.with_cause(s.hypothesis, start))
            except FAILURES:
                return np.inf

        if s.hypothesis.effect == PARAMETER:
            return reached(s.start), s
        return _at_best_size(s, reached)

    found = trials.each(simulated, others)
    nearest = sorted((f for f in found if np.isfinite(f[0])), key=lambda f: f[0])
    return [s for _, s in nearest[: SEARCH.far_off_fits]]


def _at_best_size(s: Suspect, reached: Callable[[dict[str, float]], float]) -> tuple[float, Suspect]:
    """The objective `reached`, and the suspect with the amplitude at which it is: that of the linear model, larger or smaller as long
    as that comes nearer. A brake that slows a machine n times is promised n^2 times too small from the speed that it has without."""
    size = s.hypothesis.law.amplitude().name
    best, start = reached(s.start), s.start
    for factor in (SEARCH.far_off_factor, 1 / SEARCH.far_off_factor):
        for _ in range(SEARCH.far_off_steps):
            farther = start | {size: factor * start[size]}
            if not (objective := reached(farther)) < best:
                break
            best, start = objective, farther
    return best, replace(s, start=start)


def is_far_off(trials: Trials, current: CandidateModel) -> bool:
    """Whether what a model leaves of the records to fit is not small beside how far any of their readings move."""
    fitter, left = trials.fitter, 0.0
    for i in range(len(fitter.recording.channels)):
        pairs = [
            (r.observed[r.valid[:, i], i], fitter.predict(current.fit, r)[r.valid[:, i], i]) for r in fitter.fit_records
        ]
        read, foretold = (np.concatenate(each) for each in zip(*pairs, strict=True))
        if len(read) and np.std(read) > 0:
            left = max(left, float(np.sqrt(np.nanmean((read - foretold) ** 2)) / np.std(read)))
    return left > SEARCH.far_off
