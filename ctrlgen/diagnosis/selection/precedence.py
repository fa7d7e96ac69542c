"""Which of two causes that explain nearly the same comes first: laws that act with the motion before those that happen in time.

A drift, an event or a line holds in the record in which it was seen and at its speed; what follows the motion holds at any. At one
speed v a pitch and a line of the frequency v/pitch are one signal: the pitch comes first, the line stands beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.confusable import explains_alike
from ctrlgen.diagnosis.selection.failures import FAILURES
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import CONFUSABLE, PRECEDENCE, REGIONS, SEARCH
from ctrlgen.diagnosis.shares.families import family_of
from ctrlgen.effects import Family, Place
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis
from ctrlgen.estimation.size_odds import prior_odds
from ctrlgen.recordings.recording import Recording


def acting_first(
    trials: Trials, current: CandidateModel, best: CandidateModel, candidates: Sequence[CandidateModel]
) -> CandidateModel:
    """The best candidate; where what it adds to `current` is a function of time alone, rather one that acts with the motion and
    explains alike or, where more than noise is left, nearly as much."""
    if not _of_time(best, current):
        return best
    added = [k for k, c in enumerate(best.causes) if c not in current.causes]
    pitches = [t for k in added if best.causes[k].prior.of_time for t in counterparts(trials, best, k)]
    compare = trials.selection
    acting = [t for t in (*candidates, *pitches) if not _of_time(t, current) and compare.improves_enough(current, t)]
    first = compare.ranked(acting)[: SEARCH.converged_candidates]
    ends = trials.each(lambda branch, t: branch.converged(t), first)
    for t in compare.ranked([t for t in ends if not trials.objections(t, current.causes)]):
        nearly = not best.errors.is_noise and _share_of(current, best, t) >= PRECEDENCE.nearly_as_much
        if explains_alike(compare, t, best) or nearly:
            return t
    return best


def everywhere_first(
    trials: Trials,
    current: CandidateModel,
    best: CandidateModel,
    candidates: Sequence[CandidateModel],
    screened: Screened,
) -> CandidateModel:
    """The best candidate; where it acts in a region that no test showed, rather the best law everywhere, unless that leaves several times
    as much, by the geometric mean of both kinds of records: an edge more follows the error of any law's form."""
    shown = {s.hypothesis for s in screened.suspects}
    if not any(c.prior.in_a_region and c not in shown for c in best.causes if c not in current.causes):
        return best
    compare = trials.selection
    others = [t for t in candidates if not any(c.prior.in_a_region and c not in shown for c in t.causes)]
    first = compare.ranked([t for t in others if compare.improves_enough(current, t)])[: SEARCH.converged_candidates]
    ends = trials.each(lambda branch, t: branch.converged(t), first)
    for t in compare.ranked([t for t in ends if not trials.objections(t, current.causes)]):
        pairs = ((best.fitted, t.fitted), (best.held_out, t.held_out))
        ratios = [a.plain.sum() / max(b.plain.sum(), 1e-300) for a, b in pairs]
        if np.sqrt(np.prod(ratios)) > REGIONS.share:
            return t
    return best


def one_loop_first(
    trials: Trials, current: CandidateModel, best: CandidateModel, candidates: Sequence[CandidateModel]
) -> CandidateModel:
    """The best candidate; where it adds a further loop to a hysteresis at its place, rather the finer form of that one, if it takes away
    nearly as much: a play is one width of a hysteresis."""
    for added in (c for c in best.causes if c not in current.causes and _is_loop(c)):
        there = [c for c in current.causes if c.at == added.at and _is_loop(c)]
        forms = {finer for c in there for finer in c.finer}
        finer = [t for t in candidates if t.cause in forms and len(t.causes) == len(current.causes)]
        for t in trials.selection.ranked([t for t in finer if trials.selection.improves_enough(current, t)]):
            if _share_of(current, best, t) >= PRECEDENCE.nearly_as_much:
                return t
    return best


def _is_loop(cause: Hypothesis) -> bool:
    return family_of(cause.effect) is Family.HYSTERESIS


def _of_time(candidate: CandidateModel, current: CandidateModel) -> bool:
    """Whether one of the causes that a candidate adds is a function of time alone."""
    return any(c.prior.of_time for c in candidate.causes if c not in current.causes)


def _share_of(current: CandidateModel, best: CandidateModel, other: CandidateModel) -> float:
    """What another candidate takes away of the squares, over what the best one does, on the records to fit or on the held-out
    records, whichever is less."""
    pairs = (
        (current.fitted, best.fitted, other.fitted),
        (current.held_out, best.held_out, other.held_out),
    )
    taken = [
        (a.plain.sum() - c.plain.sum()) / most if (most := a.plain.sum() - b.plain.sum()) > 0 else 0.0
        for a, b, c in pairs
    ]
    return float(min(taken))


def counterparts(trials: Trials, model: CandidateModel, k: int) -> list[CandidateModel]:
    """The model with the line in place of the pitch that cause k is, or the pitch in place of the line, where the motion has one
    speed: both begun where they are one signal."""
    cause = model.causes[k]
    if cause.effect == PARAMETER or cause.law.place is not Place.SENSOR or not (is_line(cause) or cause.prior.is_pitch):
        return []
    speed = even_speed(trials.fitter.recording, cause.at)
    if speed is None:
        return []
    others = model.fit.restarted.without(k)
    offered = (h.beside(others.causes) for h in trials.screen.hypotheses if h.effect != PARAMETER and h.at == cause.at)
    fits = []
    for h in offered:
        twin = h is not None and h.law.place is Place.SENSOR and (h.prior.is_pitch if is_line(cause) else is_line(h))
        if h is None or not twin:
            continue
        try:
            begun = [others.with_cause(h, start) for start in _starts(model, k, h, speed)]
            start = min(begun, key=trials.fitter.rough_objective)
        except FAILURES as error:
            trials.note_failure(h, error)
            continue
        fits += [trials.converged(t) for t in trials.tried(start, h)]
    return fits


def _starts(model: CandidateModel, k: int, twin: Hypothesis, speed: float) -> list[dict[str, float]]:
    """Where the twin of the pitch or line k begins: its amplitude, its way or frequency at `speed`, several phases."""
    values, here = model.fit.values(k), model.causes[k]
    channel = twin.channel_on(model.fit.structure.device)
    repeats = speed / values[_period_name(here)]
    size = values[here.law.amplitude().name]
    ways = {_period_name(twin): repeats, twin.law.amplitude().name: size}
    # the phases
    begun = {tuple({**shape, **ways}.items()) for shape in twin.shapes(channel, DataHints())}
    back = {twin.law.amplitude().name: -size}
    return [dict(shape) | sign for shape in sorted(begun) for sign in ({}, back)]


def _period_name(cause: Hypothesis) -> str:
    """The name of the way of a pitch, or of the frequency of a line."""
    return next(
        p.name for p in cause.law.params if p.unit == "Hz" or cause.prior.of(p).start_from_data == "spatial_periods"
    )


def is_line(cause: Hypothesis) -> bool:
    """Whether a cause is a disturbance of one frequency in time."""
    return cause.effect != PARAMETER and cause.prior.of_time and any(p.unit == "Hz" for p in cause.law.params)


def even_speed(recording: Recording, channel: str) -> float | None:
    """The speed [SI] at which a reading goes along in the longest record to fit, where it moves at one speed; else None."""
    name = f"reading.{channel}"
    if recording.kind != "series" or name not in recording.channels:
        return None
    i = recording.channels.index(name)
    record = max((r for r in recording.records if r.role == "fit"), key=lambda r: r.valid[:, i].sum())
    y, t = record.observed[record.valid[:, i], i], record.time[record.valid[:, i]]
    parts = min(PRECEDENCE.speed_parts, len(y) // 2)
    if parts < 1:
        return None
    ends = np.linspace(0, len(y) - 1, parts + 1).astype(int)
    speeds = np.abs(np.diff(y[ends]) / np.diff(t[ends]))
    moving = speeds[speeds > PRECEDENCE.moving * speeds.max()]
    if not len(moving):
        return None
    low, middle, high = np.quantile(moving, [0.2, 0.5, 0.8])
    return float(middle) if high - low <= PRECEDENCE.even_speed * middle else None


def explains_alike_but_for_odds(compare: ModelSelection, rival: CandidateModel, model: CandidateModel) -> bool:
    """Whether a rival explains as well as a model does, its odds beforehand left aside."""
    odds = 2 * (prior_odds(model.fit) - prior_odds(rival.fit))
    return compare.advantage(model, rival) - odds < CONFUSABLE.criterion


def why_alike(cause: Hypothesis, rival: Hypothesis) -> str:
    """Why two causes explain one recording alike, and what would tell them apart."""
    if is_line(cause) != is_line(rival) and (cause.prior.is_pitch or rival.prior.is_pitch):
        return (
            "at one speed a pitch and a line in time are one signal; a line would hold at this speed alone, "
            "and a record at another speed tells them apart"
        )
    if cause.prior.of_time != rival.prior.of_time:
        return "a function of time alone; a record of another course of the motion tells them apart"
    if cause.form_of is not None and (cause.form_of, cause.location) == (rival.form_of, rival.location):
        return f"another form of {cause.form_of}"
    return "their effects on these readings are alike"
