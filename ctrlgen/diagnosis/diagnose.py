"""Recordings -> what was left out: the steps, in order. Each is a module of its own.

gate (in `ctrlgen.recordings.validation`), `noise`, nominal refit (`fit`), is there a mismatch (`screen`, `adequacy`), `hypotheses`,
`screen`, `search` (fit, choose, swap), `adequacy`, verdict (`diagnosis`), `where`, `writeback`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Device
from ctrlgen.diagnosis.estimation.checkpoint import Checkpoint
from ctrlgen.diagnosis.estimation.fit import Fitter
from ctrlgen.diagnosis.estimation.isolated_outliers import mark_outliers
from ctrlgen.diagnosis.estimation.noise import estimate_noise
from ctrlgen.diagnosis.estimation.noise_update import update_guessed_noise
from ctrlgen.diagnosis.estimation.profile_likelihood import profiles
from ctrlgen.diagnosis.estimation.residual_tests import run_residual_tests
from ctrlgen.diagnosis.estimation.structure import Structure
from ctrlgen.diagnosis.evidence.supporting_analyses import evidence
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, hypotheses, nominal_physics
from ctrlgen.diagnosis.selection.dead_channels import without_dead_channels
from ctrlgen.diagnosis.selection.direct_detection import directly_detected_findings
from ctrlgen.diagnosis.selection.result import Diagnosis, findings, held_out_errors
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.verdict import verdict
from ctrlgen.diagnosis.settings import NOISE_UPDATE, SIMULATION
from ctrlgen.model.assembly import build_model, movable
from ctrlgen.model.discretisation import settling_time
from ctrlgen.recordings.recording import Recording

Progress = Callable[[str], None]
RESTLESS = "{}: what is left at rest is no noise, it jumps or remembers; something acts there that is not described"


def diagnose_recording(
    device: Device,
    recording: Recording,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
) -> Diagnosis:
    """What `device` leaves out that `recording` shows.

    Deterministic for a given `seed`. `progress` is called with a sentence before each step; what was fitted before stands
    in the `journal`. Raises InputError where the recording holds nothing to fit or to hold out.
    """
    # one thread: the matrices are small; no warnings: a trial may leave the numbers, and is then rejected
    with threadpool_limits(1), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _diagnose(device, recording, seed, progress or (lambda _: None), checkpoint)


def _diagnose(
    device: Device, recording: Recording, seed: int, step: Progress, checkpoint: Checkpoint | None = None
) -> Diagnosis:
    recording = _relative_ambient(recording)
    missing = [role for role in ("fit", "hold_out") if not any(r.role == role for r in recording.records)]
    if missing:
        raise InputError(recording.title, [Fault("record", f"no record has role {role!r}") for role in missing])
    step("noise")
    live = without_dead_channels(device, recording)
    recording = live.recording
    noise = estimate_noise(recording, settling_time(build_model(device, sample_time=SIMULATION.settling_sample_time)))
    fitter = Fitter(recording, noise, checkpoint)
    for _ in range(NOISE_UPDATE.guessed_refits if noise.guessed.any() else 0):
        fitter.noise = update_guessed_noise(fitter, fitter.fit(Structure(device)))
    noise = fitter.noise
    described = fitter.fit_described(device)
    fitter.recording, spikes = mark_outliers(recording, lambda record: fitter.predict(described, record))
    acting = set(movable(device))
    sample_times = {r.sample_time for r in recording.records}
    physics = nominal_physics(device)
    look_back = min(sample_times) if np.isfinite(min(sample_times)) else None
    ambient = any(r.ambient is not None for r in recording.records)
    open_ = [
        h for h in hypotheses(device, physics, recording.channels, look_back, ambient)
        if h.effect != PARAMETER or h.path in acting
    ]  # fmt: skip
    step(f"refit of the device as described, {len(open_)} hypotheses")
    found = Searcher(fitter, Screen(fitter, open_, seed), step).run(Structure(device))
    step("judging")
    after = run_residual_tests(fitter, found.chosen.fit)
    seen = (*live.findings, *directly_detected_findings(fitter, found))
    said = verdict(fitter, found, after, bool(seen))
    step("evidence")
    sure = profiles(fitter, found.chosen.fit)
    beside = evidence(fitter, found, after.passed, seed)
    return Diagnosis(
        verdict=said,
        findings=(*findings(found, sure), *seen),
        held_out=held_out_errors(fitter, found, noise.known),
        residual_tests=after,
        residual_location=beside.residual_location,
        detectability=beside.detectability,
        next_experiment=beside.next_experiment,
        search_history=beside.search_history,
        notes=(
            *recording.notes,
            *live.said,
            *fitter.noise.notes,
            *([spikes] if spikes else []),
            *map(RESTLESS.format, after.restless),
        ),
        device=device,
        recording=fitter.recording,
        search=found,
        fitter=fitter,
        profiles=sure,
        extra=beside.extra,
    )


def _relative_ambient(recording: Recording) -> Recording:
    """The surroundings as a rise over their mean in the records to fit."""
    given = [r.ambient for r in recording.records if r.ambient is not None and r.role == "fit"]
    if not given:
        return replace(recording, records=tuple(replace(r, ambient=None) for r in recording.records))
    mean = float(np.mean(np.concatenate(given)))
    records = tuple(replace(r, ambient=None if r.ambient is None else r.ambient - mean) for r in recording.records)
    return replace(recording, records=records)
