"""The steps of a diagnosis in their order, from a validated recording to the answer.

1. Channels that read one constant value are taken out (`selection.dead_channels`).
2. The noise of every channel is estimated (`estimation.noise`), and isolated outliers are marked (`isolated_outliers`); the search
   marks them again against each model that it accepts. Both are done in `prepared_recording`.
3. The device as described is refitted within its stated uncertainty (`estimation.fit`).
4. Hypotheses are listed: every effect at every location, every parameter of the device (`estimation.hypothesis`), of which the
   machine's parts refuse some (`selection.offered_laws`).
5. The search screens them, fits candidate models and selects among them on held-out data (`selection.screen`, `search`).
6. Every accepted cause gets its share of the mismatch (`selection.attribution`), and beside it stands of what the residual is a
   function before and after, whatever the law (`shares`), which may speak against it (`selection.standing`); and the chance that luck
   found it, by an exact test on the held-out records (`evidence.chance_by_luck`).
7. Residual tests and the held-out data give the verdict (`estimation.residual_tests`, `selection.verdict`).
8. Supporting analyses: where the residual is, what was detectable, what to record next (`evidence`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.core.counts import number_of
from ctrlgen.core.forks import usable_cores
from ctrlgen.devices import Device
from ctrlgen.diagnosis.evidence.chance_by_luck import doubted, with_chances
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.evidence.supporting_analyses import run_supporting_analyses
from ctrlgen.diagnosis.prepared_recording import prepared
from ctrlgen.diagnosis.report.told_beside import told_beside
from ctrlgen.diagnosis.selection.direct_detection import directly_detected_findings
from ctrlgen.diagnosis.selection.failures import FAILURES, UNSOLVED, reason_of
from ctrlgen.diagnosis.selection.findings import findings, held_out_errors
from ctrlgen.diagnosis.selection.offered_laws import offered_laws
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.standing import answer_of, borne_out_instead, evidence_of, in_standing
from ctrlgen.diagnosis.selection.untried import refuse_without_trials, untried
from ctrlgen.diagnosis.selection.verdict import Verdict, in_another_unit, verdict, within_tolerance
from ctrlgen.diagnosis.shares.empirical_terms import EmpiricalTerm, empirical_terms
from ctrlgen.diagnosis.shares.gather import ResidualShares, residual_shares
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.estimation.described_device import forget_described
from ctrlgen.estimation.fit import Fitter, forget_predictions
from ctrlgen.estimation.hypothesis import selected_laws
from ctrlgen.estimation.profile_likelihood import profiles
from ctrlgen.estimation.residual_tests import run_residual_tests
from ctrlgen.estimation.simulator import compiled_simulator
from ctrlgen.estimation.spikes import find_spikes
from ctrlgen.estimation.unstated_drive import read_with_less, way_of
from ctrlgen.recordings.recording import Recording

Progress = Callable[[str], None]


def diagnose_recording(
    device: Device,
    recording: Recording,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    laws: Sequence[str] | None = None,
    jobs: int | None = None,
) -> Diagnosis:
    """The physics that `recording` shows and `device` leaves out.

    Deterministic for a given `seed`, whatever the number of processes, `jobs`: one per core unless given, 0 for this one alone.
    `progress` is called with a sentence before each step. Fits that the `checkpoint` holds are not repeated. `laws` restricts the
    hypotheses to the effects of these names and the device's own parameters.
    Raises InputError where no record has the role fit or hold_out, where no channel varies, for an unknown effect, or where memory
    does not hold the recording; SolverError where the device as described cannot be simulated, or with no cause that might be its
    own.
    """
    # Those of an earlier diagnosis only take memory
    compiled_simulator.cache_clear()
    forget_predictions()
    forget_described()
    # One thread: the matrices are small. No warnings: a candidate model may diverge, and is then rejected.
    with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        processes = usable_cores() if jobs is None else max(jobs, 1)
        return _diagnose(device, recording, seed, progress or (lambda _: None), checkpoint, laws, processes)


def _diagnose(
    device: Device,
    recording: Recording,
    seed: int,
    step: Progress,
    checkpoint: Checkpoint | None,
    laws: Sequence[str] | None,
    jobs: int,
    way: str | None = None,
) -> Diagnosis:
    """`way`: in which drives of which nobody states it are read between samples first; as the device as described fits where None."""
    effects = selected_laws(laws)
    step("noise")
    ready = prepared(device, recording, effects, checkpoint, way)
    known = ready.fitter.noise.known
    offered = offered_laws(ready.device, ready.fitter, effects, chosen=laws is not None)
    step(f"refit of the device as described, {number_of(len(offered.hypotheses), 'hypothesis', 'hypotheses')}")
    searcher = Searcher(ready.fitter, Screen(ready.fitter, offered.hypotheses, seed), step, jobs)
    search = searcher.run(ready.device)
    other = search.fitter if way else _read_with_less(search)
    if other is not search.fitter:
        step(f"the same with the drive read as {way_of(other.recording)} between its samples")
        return _diagnose(device, recording, seed, step, checkpoint, laws, jobs, way_of(other.recording))
    step("shares of the residual")
    shares = residual_shares(search.fitter, search.nominal.fit, search.chosen.fit, seed)
    evidence = None if shares is None else evidence_of(search, shares.before, offered.hypotheses, laws is None)
    rival = None if evidence is None else borne_out_instead(search, evidence)
    if rival is not None and (instead := searcher.with_rival(search, rival)) is not search:
        search = instead
        shares = residual_shares(search.fitter, search.nominal.fit, search.chosen.fit, seed)
    step("residual tests")
    tests = run_residual_tests(search.fitter, search.chosen.fit)
    detected = (*ready.live.findings, *directly_detected_findings(search, effects))
    unit_is_wrong = in_another_unit(search)
    answer = verdict(search, tests, search.account, bool(detected), unit_is_wrong)
    missing = untried(search)
    named = detected or search.chosen.causes or search.withdrawn
    if not (named or unit_is_wrong or within_tolerance(search) or (tests.passed and search.fitter.noise.known.all())):
        refuse_without_trials(search, missing)
    step("supporting analyses")
    likelihoods = profiles(search.fitter, search.chosen.fit)
    analyses = run_supporting_analyses(search, tests.passed, seed)
    found = (*findings(search, search.account, likelihoods), *detected)
    if evidence is not None:
        found = in_standing(found, evidence, detected)
    answer = answer_of(answer, found, search.chosen.errors.is_noise)
    found = with_chances(found, search)
    answer = doubted(answer, found)
    explained = answer == Verdict.EXPLAINED and (tests.passed or within_tolerance(search))
    enough = unit_is_wrong or explained or answer == Verdict.CONSISTENT
    left, failed = ((), ()) if enough else _empirical_terms(search, shares)
    spikes = find_spikes(search.fitter, search.chosen.fit, known)
    notes = told_beside(search, ready.live, found, spikes, tests.restless, offered.notes)
    return Diagnosis(
        verdict=answer,
        findings=found,
        attribution=search.account,
        shares=shares,
        empirical_terms=left,
        held_out=held_out_errors(search, known, tests),
        residual_tests=tests,
        spikes=spikes,
        notes=(*notes, *analyses.failed, *failed),
        device=ready.device,
        recording=search.fitter.recording,
        search=search,
        fitter=search.fitter,
        profiles=likelihoods,
        residual_location=analyses.residual_location,
        unmodelled_force=analyses.unmodelled_force,
        detectability=analyses.detectability,
        next_experiment=analyses.next_experiment,
        untried=missing,
    )


def _read_with_less(search: SearchResult) -> Fitter:
    """The search's fitter with drives that may be anything between samples read so that the answer leaves less or needs a law less; as it
    is where none is, or where a fit fails."""
    try:
        return read_with_less(search.fitter, search.chosen.fit)
    except UNSOLVED:
        return search.fitter


def _empirical_terms(
    search: SearchResult, shares: ResidualShares | None
) -> tuple[tuple[EmpiricalTerm, ...], tuple[str, ...]]:
    """Smoothers of what is left, and a note where they cannot be had: no finding depends on them."""
    try:
        return empirical_terms(search.fitter, search.chosen.fit, shares), ()
    except FAILURES as error:
        return (), (f"empirical terms are left out: {reason_of(error)}",)
