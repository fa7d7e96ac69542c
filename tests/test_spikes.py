"""Spikes are told with their rate and size, and the verdict is what it would be without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, drive, move, record

import ctrlgen
from ctrlgen.diagnosis.prepared_recording import noise_before_fits
from ctrlgen.diagnosis.selection.dead_channels import without_dead_channels
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.isolated_outliers import mark_outliers
from ctrlgen.estimation.spikes import Spikes, find_spikes
from ctrlgen.recordings.recording import Recording
from ctrlgen.recordings.validation import ChannelNames, mark, rows_between

N = 6000
AT = {"fit": [700, 2100, 2900, 5003], "hold_out": [401, 1777, 4000, 5900]}


def spiked(size: float, seed: int = 5) -> Recording:
    """An axis as described with spikes of `size` standard deviations of the noise [m], of either sign."""
    rng, parts = np.random.default_rng(seed), []
    for role, u in (("fit", drive(N)), ("hold_out", 1.2 * np.sin(2 * np.pi * 1.7 * np.arange(N) * H))):
        y = move(u, fine=1) + NOISE * rng.standard_normal(N)
        y[AT[role]] += NOISE * size * np.array([1, -1, 1, -1])
        parts.append(record(u, y, role, first=0.0 if role == "fit" else N * H))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), tuple(parts), ())


def described(recording: Recording):
    fitter, fit = Fitter(recording, noise_before_fits(AXIS, recording)).described(AXIS)
    return fitter, fit


@pytest.mark.long
@pytest.mark.parametrize("size", [6.5, 40.0])
def test_spikes_have_their_rate_and_size_however_large_and_the_verdict_stays(size):
    found = ctrlgen.diagnose(AXIS, spiked(size), laws=["stiffening", "creep"])
    assert found.verdict == Verdict.CONSISTENT and found.findings == ()
    (spikes,) = found.spikes
    assert (spikes.channel, spikes.unit, spikes.samples) == ("reading.axis", "nm", 2 * N)
    assert spikes.count == pytest.approx(8, abs=1)  # normal noise takes one below four deviations, or adds one
    assert spikes.per_thousand == pytest.approx(8 / 12, rel=0.15)
    assert spikes.size == pytest.approx(5 * size, abs=5)  # a standard deviation of the noise
    assert spikes.in_noise == pytest.approx(size, abs=1)
    assert sum(spikes.sentence == note for note in found.notes) == 1


@pytest.mark.long
@pytest.mark.parametrize("seed", range(5))
def test_normal_noise_has_no_spikes(seed):
    fitter, fit = described(spiked(0.0, seed))
    assert find_spikes(fitter, fit, np.array([True])) == ()


def test_a_channel_whose_noise_is_not_known_has_spikes_without_a_size_in_noise():
    recording = spiked(40.0)
    fitter, fit = described(recording)
    marked = mark_outliers(recording, lambda r: fitter.predict(fit, r))
    assert [row for row, *_ in marked.records[0].spikes] == AT["fit"]
    (spikes,) = find_spikes(replace(fitter, recording=marked), fit, np.array([False]))
    assert spikes.count == 8 and spikes.in_noise is None and "standard deviations" not in spikes.sentence


def test_settled_poses_that_a_model_explains_have_no_spikes():
    recording = replace(spiked(40.0), kind="poses")
    marked = mark_outliers(recording, lambda r: r.observed)
    assert all(a is b for a, b in zip(marked.records, recording.records, strict=True))


def test_validation_keeps_the_deviation_of_an_outlier_from_its_neighbours():
    at = AT["fit"]
    u = 0.01 * np.sin(2 * np.pi * 0.2 * np.arange(N) * H)  # so slow that it lies on the chords of its noise
    y = move(u, fine=1) + NOISE * np.random.default_rng(1).standard_normal(N)
    y[at] += 40 * NOISE * np.array([1, -1, 1, -1])
    given = record(u, y, "fit")
    names = ChannelNames(("drive.axis",), ("V",), ("reading.axis",), ("nm",))
    marked, notes = mark(given, "series", names, np.array([True]))
    assert [(row, channel) for row, channel, _ in marked.spikes] == [(row, 0) for row in at] and len(notes) == 1
    sizes = np.array([size for *_, size in marked.spikes])
    assert sizes / NOISE == pytest.approx([40, -40, 40, -40], abs=4)  # two standard deviations and what the axis moves
    assert [row for row, *_ in rows_between(marked, 2000, 3000).spikes] == [100, 900]


def test_a_dead_channel_takes_neither_tolerance_nor_spikes_of_another():
    recording = spiked(0.0)
    records = tuple(
        replace(
            r,
            observed=np.column_stack([np.zeros(N), r.observed]),
            valid=np.ones((N, 2), bool),
            spikes=((1, 0, 1.0), (2, 1, 3.0)),
        )
        for r in recording.records
    )
    both = replace(
        recording,
        channels=("drive.axis", "reading.axis"),
        units=("V", "nm"),
        noise=(None, NOISE),
        records=records,
        tolerance=(1.0, 2e-9),
    )
    live = without_dead_channels(AXIS, both).recording
    assert live.channels == ("reading.axis",) and live.tolerance == (2e-9,)
    assert all(r.spikes == ((2, 0, 3.0),) for r in live.records)


def test_the_sentence_says_rate_size_and_noise():
    spikes = Spikes("reading.axis", 12, 10_000, 24.13, "nm", 4.83)
    assert spikes.sentence.startswith(
        "reading.axis: 1.2 of 1000 samples are spikes of typically 24.1 nm (4.8 standard deviations of the noise); "
    )
