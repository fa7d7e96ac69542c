"""What a search starts from: the recording as it is used, its noise, and the device as described, fitted to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.core.errors import CtrlgenError, Fault, InputError, SolverError
from ctrlgen.devices import Device
from ctrlgen.diagnosis.needed_memory import refuse_what_memory_cannot_hold
from ctrlgen.diagnosis.selection.dead_channels import LiveChannels, without_dead_channels
from ctrlgen.diagnosis.selection.failures import FAILURES, UNSOLVED, reason_of
from ctrlgen.effects import Effect
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.estimation.described_device import described
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import nominal_physics
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.late_readings import settling_time_of
from ctrlgen.estimation.noise import Noise, estimate_noise
from ctrlgen.estimation.noise_update import correct_stated_noise, update_guessed_noise
from ctrlgen.estimation.settings import NOISE_UPDATE
from ctrlgen.estimation.unstated_drive import as_described_fits, read_as
from ctrlgen.recordings.recording import Recording

OF_OTHER_RECORDINGS = "left out, as other recordings had it alone: {}"


@dataclass(frozen=True)
class Prepared:
    """The device as it is in this recording, the channels that are alive, and the fitter of what they read."""

    device: Device
    """With the effects that this recording had alone; its numbers are told in the units of the recording's columns."""
    live: LiveChannels
    """The recording without channels that read one constant value, and what is found of these."""
    fitter: Fitter
    """Of the live recording, isolated outliers marked, with the noise that the device as described leaves."""


def prepared(
    device: Device,
    recording: Recording,
    effects: Sequence[type[Effect]],
    checkpoint: Checkpoint | None,
    way: str | None = None,
) -> Prepared:
    """Device, recording and noise as a search takes them. `way`: in which drives of which nobody states it are read between samples (one of
    `WAYS`); as the device as described fits the readings where None.

    Raises InputError where no record is to fit or none is held out, where no channel varies, or where memory does not hold the
    recording; SolverError where the device as described cannot be simulated along it.
    """
    device, recording = _in_this_recording(device, recording)
    refuse_what_memory_cannot_hold(recording)
    device = _in_units_of_the_reader(device, recording)
    recording = _relative_ambient(_with_both_roles(recording))
    live = without_dead_channels(device, recording, effects)
    fitter = Fitter(live.recording, noise_before_fits(device, live.recording), checkpoint)
    read = (
        _with_drive_read(device, fitter) if way is None else replace(fitter, recording=read_as(fitter.recording, way))
    )
    fitter = _without_outliers(device, read)
    return Prepared(device, live, _with_noise(device, fitter))


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


def _relative_ambient(recording: Recording) -> Recording:
    """The ambient temperature [K] relative to its mean over the records to fit; without one there, it is left out."""
    given = [r.ambient for r in recording.records if r.ambient is not None and r.role == "fit"]
    if not given:
        return replace(recording, records=tuple(replace(r, ambient=None) for r in recording.records))
    mean = float(np.mean(np.concatenate(given)))
    records = tuple(replace(r, ambient=None if r.ambient is None else r.ambient - mean) for r in recording.records)
    return replace(recording, records=records)


def noise_before_fits(device: Device, recording: Recording) -> Noise:
    """The noise of every channel, before any fit."""
    return estimate_noise(recording, settling_time_of(device))


def _with_drive_read(device: Device, fitter: Fitter) -> Fitter:
    """The fitter with drives that may be anything between samples as the readings have it; as they are where they cannot tell."""
    try:
        return as_described_fits(device, fitter)
    except UNSOLVED:
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


def _with_noise(device: Device, fitter: Fitter) -> Fitter:
    """The fitter with noise that was guessed, or stated wrongly, taken from the residual of the device as described."""
    for _ in range(NOISE_UPDATE.guessed_refits if fitter.noise.guessed.any() else 0):
        fitter, fit = described(fitter, device)
        fitter = fitter.with_noise(update_guessed_noise(fitter, fit))
    if fitter.noise.stated.any():
        weighed, fit = described(fitter, device)
        fitter = fitter.with_noise(correct_stated_noise(weighed, fit))
    return fitter
