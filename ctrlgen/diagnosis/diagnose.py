"""The steps of a diagnosis in their order, from a validated recording to the answer.

1. Channels that read one constant value are taken out (`selection.dead_channels`).
2. The noise of every channel is estimated (`estimation.noise`), and isolated outliers are marked (`isolated_outliers`); the search
   marks them again against each model that it accepts.
3. The device as described is refitted within its stated uncertainty (`estimation.fit`).
4. Hypotheses are listed: every effect at every location, every parameter of the device (`estimation.hypothesis`).
5. The search screens them, fits candidate models and selects among them on held-out data (`selection.screen`, `search`).
6. Every accepted cause gets its share of the mismatch (`selection.attribution`), and beside it stands of what the residual is a
   function before and after, whatever the law (`shares`), which may speak against it (`selection.standing`); and the chance that luck
   found it, by an exact test on the held-out records (`evidence.chance_by_luck`).
7. Residual tests and the held-out data give the verdict (`estimation.residual_tests`, `selection.verdict`).
8. Supporting analyses: where the residual is, what was detectable, what to record next (`evidence`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import CtrlgenError, Fault, InputError, SolverError
from ctrlgen.core.forks import usable_cores
from ctrlgen.devices import Device
from ctrlgen.diagnosis.evidence.chance_by_luck import doubted, with_chances
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.evidence.supporting_analyses import run_supporting_analyses
from ctrlgen.diagnosis.needed_memory import refuse_what_memory_cannot_hold
from ctrlgen.diagnosis.report.half_a_sample import half_a_sample
from ctrlgen.diagnosis.report.nearly_as_large import nearly_as_large
from ctrlgen.diagnosis.report.on_the_clock import a_pose_a_second
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.diagnosis.selection.dead_channels import without_dead_channels
from ctrlgen.diagnosis.selection.direct_detection import directly_detected_findings
from ctrlgen.diagnosis.selection.failures import FAILURES, reason_of
from ctrlgen.diagnosis.selection.findings import findings, held_out_errors
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.speeds import counted_in_speeds
from ctrlgen.diagnosis.selection.standing import answer_of, borne_out_instead, evidence_of, in_standing
from ctrlgen.diagnosis.selection.untried import refuse_without_trials, untried
from ctrlgen.diagnosis.selection.verdict import Verdict, in_another_unit, verdict, within_tolerance
from ctrlgen.diagnosis.selection.way_covered import where_it_turns, with_longest_periods
from ctrlgen.diagnosis.shares.empirical_terms import EmpiricalTerm, empirical_terms
from ctrlgen.diagnosis.shares.gather import ResidualShares, residual_shares
from ctrlgen.effects import Effect
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.estimation.described_device import described, forget_described
from ctrlgen.estimation.drive_clock import STAMPS, TOLD, stamp_deviation
from ctrlgen.estimation.fit import Fit, Fitter, forget_predictions
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics, selected_laws
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.late_readings import settling_time_of
from ctrlgen.estimation.law_needs import not_offered, offered_as_faults, refusals, usual, with_odds
from ctrlgen.estimation.noise import Noise, estimate_noise
from ctrlgen.estimation.noise_update import correct_stated_noise, update_guessed_noise
from ctrlgen.estimation.profile_likelihood import profiles
from ctrlgen.estimation.residual_tests import run_residual_tests
from ctrlgen.estimation.settings import NOISE_UPDATE
from ctrlgen.estimation.simulator import compiled_simulator
from ctrlgen.estimation.spikes import find_spikes, marking_notes
from ctrlgen.model.assembly import movable
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.numbers import number

Progress = Callable[[str], None]
RESTLESS = "{}: at rest the residual jumps or has memory, so it is not noise; something acts there that the device file does not describe"
NOT_OFFERED = "not offered: {}"
OFFERED_AS_FAULTS = "offered as a fault, as rare as one in a hundred: {}"
WITHDRAWN = "{} is not confirmed: with it the held-out records are predicted worse than by the device as described"
OFF_ITS_STAMPS = (
    "the drive is taken to come {} s {} its time stamps, {} of a sample: with that the held-out records are predicted better; it is a "
    "number of the recording and not written to the device"
)
OF_OTHER_RECORDINGS = "left out, as other recordings had it alone: {}"
RESTRICTED = "only these effects were considered, beside the device's own parameters: {}"


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
) -> Diagnosis:
    effects = selected_laws(laws)
    device, recording = _in_this_recording(device, recording)
    refuse_what_memory_cannot_hold(recording)
    device = _in_units_of_the_reader(device, recording)
    recording = _relative_ambient(_with_both_roles(recording))
    step("noise")
    live = without_dead_channels(device, recording, effects)
    fitter = _without_outliers(device, Fitter(live.recording, noise_before_fits(device, live.recording), checkpoint))
    fitter = _with_noise(device, fitter)
    known = fitter.noise.known
    suspected = _hypotheses(device, live.recording, effects)
    parts = device.parts(nominal_physics(device))
    refused = not_offered(list(dict.fromkeys(h.effect for h in suspected)), parts) if laws is None else {}
    suspected = [with_odds(h, parts) for h in suspected if h.effect not in refused]
    suspected = counted_in_speeds(suspected, fitter, device)
    step(f"refit of the device as described, {number_of(len(suspected), 'hypothesis', 'hypotheses')}")
    searcher = Searcher(fitter, Screen(fitter, suspected, seed), step, jobs)
    search = searcher.run(device)
    step("shares of the residual")
    shares = residual_shares(search.fitter, search.nominal.fit, search.chosen.fit, seed)
    evidence = None if shares is None else evidence_of(search, shares.before, suspected, laws is None)
    rival = None if evidence is None else borne_out_instead(search, evidence)
    if rival is not None and (instead := searcher.with_rival(search, rival)) is not search:
        search = instead
        shares = residual_shares(search.fitter, search.nominal.fit, search.chosen.fit, seed)
    step("residual tests")
    tests = run_residual_tests(search.fitter, search.chosen.fit)
    attribution = search.account
    detected = (*live.findings, *directly_detected_findings(search, effects))
    unit_is_wrong = in_another_unit(search)
    answer = verdict(search, tests, attribution, bool(detected), unit_is_wrong)
    missing = untried(search)
    named = detected or search.chosen.causes or search.withdrawn
    if not (named or unit_is_wrong or within_tolerance(search) or (tests.passed and search.fitter.noise.known.all())):
        refuse_without_trials(search, missing)
    step("supporting analyses")
    likelihoods = profiles(search.fitter, search.chosen.fit)
    analyses = run_supporting_analyses(search, tests.passed, seed)
    found = (*findings(search, attribution, likelihoods), *detected)
    if evidence is not None:
        found = in_standing(found, evidence, detected)
        answer = answer_of(answer, found, search.chosen.errors.is_noise)
    found = with_chances(found, search)
    answer = doubted(answer, found)
    explained = answer == Verdict.EXPLAINED and (tests.passed or within_tolerance(search))
    enough = unit_is_wrong or explained or answer == Verdict.CONSISTENT
    left, failed = ((), ()) if enough else _empirical_terms(search, shares)
    spikes = find_spikes(search.fitter, search.chosen.fit, known)
    told = (*marking_notes(live.recording, search.fitter.recording), *(s.sentence for s in spikes))
    told = (*told, *half_a_sample(search.fitter.recording, found), *nearly_as_large(found))
    told = (*told, *a_pose_a_second(search.fitter.recording, found))
    told_of_machine = [NOT_OFFERED.format("; ".join(refusals(refused)))] if refused else []
    if rare := offered_as_faults(list(dict.fromkeys(h.effect for h in suspected)), parts):
        told_of_machine.append(OFFERED_AS_FAULTS.format("; ".join(refusals(rare))))
    if brought := [f"{law.kind} ({law.package})" for law in effects if law.package]:
        told_of_machine.append(f"laws of other packages were considered too: {', '.join(brought)}")
    told_of_machine += [f"usual: {row.text}" for row in usual(parts)]
    notes = (
        *_notes(search, live.notes, told, tests.restless, laws, effects, told_of_machine),
        *analyses.failed,
        *failed,
    )
    return Diagnosis(
        verdict=answer,
        findings=found,
        attribution=attribution,
        shares=shares,
        empirical_terms=left,
        held_out=held_out_errors(search, known, tests),
        residual_tests=tests,
        spikes=spikes,
        notes=notes,
        device=device,
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


def _empirical_terms(
    search: SearchResult, shares: ResidualShares | None
) -> tuple[tuple[EmpiricalTerm, ...], tuple[str, ...]]:
    """Smoothers of what is left, and a note where they cannot be had: no finding depends on them."""
    try:
        return empirical_terms(search.fitter, search.chosen.fit, shares), ()
    except FAILURES as error:
        return (), (f"empirical terms are left out: {reason_of(error)}",)


def _in_this_recording(device: Device, recording: Recording) -> tuple[Device, Recording]:
    """The device with the effects that this recording had alone, and the recording with a note of those that others had."""
    others = [each.text for each in device.recording_effect if each.recording != recording.title]
    notes = [OF_OTHER_RECORDINGS.format("; ".join(others))] if others else []
    return device.in_recording(recording.title), replace(recording, notes=(*recording.notes, *notes))


def _in_units_of_the_reader(device: Device, recording: Recording) -> Device:
    """The device, whose numbers are told in the units of the recording's columns."""
    drives = [f"drive.{c}" for c in nominal_physics(device).drive.channels]
    units = {
        **dict(zip(recording.channels, recording.units, strict=True)),
        **(dict(zip(drives, recording.drive_units, strict=True)) if recording.drive_units else {}),
    }
    return device.told_in(units)


def _with_both_roles(recording: Recording) -> Recording:
    """The recording. Raises InputError where no record is to fit, or none is held out."""
    missing = [role for role in ("fit", "hold_out") if not any(r.role == role for r in recording.records)]
    if missing:
        raise InputError(recording.title, [Fault("record", f"no record has role {role!r}") for role in missing])
    return recording


def noise_before_fits(device: Device, recording: Recording) -> Noise:
    """The noise of every channel, before any fit."""
    return estimate_noise(recording, settling_time_of(device))


def _with_noise(device: Device, fitter: Fitter) -> Fitter:
    """The fitter with noise that was guessed, or stated wrongly, taken from the residual of the device as described."""
    for _ in range(NOISE_UPDATE.guessed_refits if fitter.noise.guessed.any() else 0):
        fitter, fit = described(fitter, device)
        fitter = fitter.with_noise(update_guessed_noise(fitter, fit))
    if fitter.noise.stated.any():
        weighed, fit = described(fitter, device)
        fitter = fitter.with_noise(correct_stated_noise(weighed, fit))
    return fitter


def _without_outliers(device: Device, fitter: Fitter) -> Fitter:
    """The fitter without samples that lie off the prediction of the device as described alone."""
    weighed, fit = _as_described(fitter, device)
    return replace(fitter, recording=mark_outliers(fitter.recording, lambda record: weighed.predict(fit, record)))


def _as_described(fitter: Fitter, device: Device) -> tuple[Fitter, Fit]:
    """The device as described, fitted to the recording. Raises SolverError where it cannot be simulated."""
    cause: Exception | None = None
    try:
        weighed, fit = described(fitter, device)
        if any(np.isfinite(weighed.predict(fit, r)).any() for r in fitter.fit_records):
            return weighed, fit
        why = "no reading that it predicts is finite"
    except CtrlgenError:
        raise
    except FAILURES as error:
        why, cause = reason_of(error), error
    raise SolverError(
        f"{fitter.recording.title}: no answer, because {device.title} cannot be simulated along it as described: {why}. Check that the "
        "recorded drives lie in the range of the device and are in their units, and that the device moves with `ctrlgen simulate`"
    ) from cause


def _notes(
    search: SearchResult,
    live: Sequence[str],
    marks: Sequence[str],
    restless: Sequence[str],
    laws: Sequence[str] | None,
    effects: Sequence[type[Effect]],
    told_of_machine: Sequence[str],
) -> tuple[str, ...]:
    """What was done to the recording, what is known of its noise, and what could not be tried."""
    failed = dict.fromkeys(text for round_ in search.rounds for text in round_.failed)
    return (
        *search.fitter.recording.notes,
        *live,
        *search.fitter.noise.notes,
        *marks,
        *map(RESTLESS.format, restless),
        *clock_note(search.fitter),
        *told_of_machine,
        *([] if laws is None else [RESTRICTED.format(", ".join(law.kind for law in effects) or "none")]),
        *(WITHDRAWN.format(cause_name(c)) for c in search.withdrawn),
        *(f"could not be tried: {text}" for text in failed),
    )


def clock_note(fitter: Fitter) -> list[str]:
    """By how much the drive is off its time stamps, where that is more than stamps usually are."""
    stamps = stamp_deviation(fitter.recording)
    if abs(fitter.clock) <= TOLD * stamps:
        return []
    side = "before" if fitter.clock > 0 else "behind"
    return [OFF_ITS_STAMPS.format(number(abs(fitter.clock), 2), side, number(STAMPS * abs(fitter.clock) / stamps, 2))]


def _hypotheses(device: Device, recording: Recording, effects: Sequence[type[Effect]]) -> list[Hypothesis]:
    """Hypotheses that the recording can test; of the device's parameters, those that change its readings."""
    acting = set(movable(device))
    shortest = min(r.sample_time for r in recording.records)
    sample_time = shortest if np.isfinite(shortest) else None
    ambient = any(r.ambient is not None for r in recording.records)
    offered = hypotheses(device, nominal_physics(device), recording.channels, sample_time, ambient, effects)
    offered = [h for h in offered if h.effect != PARAMETER or h.path in acting]
    return with_longest_periods(where_it_turns(offered, recording, device), recording, device)


def _relative_ambient(recording: Recording) -> Recording:
    """The ambient temperature [K] relative to its mean over the records to fit; without one there, it is left out."""
    given = [r.ambient for r in recording.records if r.ambient is not None and r.role == "fit"]
    if not given:
        return replace(recording, records=tuple(replace(r, ambient=None) for r in recording.records))
    mean = float(np.mean(np.concatenate(given)))
    records = tuple(replace(r, ambient=None if r.ambient is None else r.ambient - mean) for r in recording.records)
    return replace(recording, records=records)
