"""Signed counts that were written without their sign, and readings that lie further off than any device moves: told."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats.wrapped_counters import wrapped
from ctrlgen.recordings.implausible_note import Implausible
from ctrlgen.recordings.plausibility import suspected, with_plausibility
from ctrlgen.recordings.reader import load_recordings


def motion(rng, size: float, n: int = 400) -> np.ndarray:
    """Counts of a motion about zero with rests, of which noise of a few counts is left."""
    k = np.arange(n)
    moving = (k > 100) & (k < 300)
    return np.round(moving * size * np.sin(0.05 * k) + rng.normal(0, 2, n))


@pytest.mark.parametrize(("bits", "size"), [(12, 300.0), (16, 14000.0), (16, 90.0), (24, 2e6), (32, 7e4), (32, 5e8)])
def test_signed_counts_without_their_sign_are_told(rng, bits, size):
    signed = motion(rng, size)
    signed[[5, 50]] = np.nan
    again = wrapped(np.where(signed < 0, signed + 2.0**bits, signed))
    assert again is not None and (again.signed, again.size) == (True, 2.0**bits)
    assert f"write {2**bits} less for those from {2 ** (bits - 1)} on" in again.told
    assert wrapped(signed) is None


def test_full_steps_saturations_and_constants_are_no_signed_counts(rng):
    top = 65535.0
    ends = np.tile(np.r_[np.zeros(9), np.full(9, top)], 20)
    k = np.arange(400)
    for values in (
        ends,
        np.clip(ends + np.round(rng.normal(0, 2, len(ends))), 0, top),  # two ends of a converter, with noise
        np.clip(np.round(32768 + 50000 * np.sin(0.05 * k)), 0, top),  # saturates at both ends
        np.clip(np.round(30000 * np.sin(0.05 * k)), 0, None),
        np.full(400, top),
        np.where(k == 40, top, 0.0),
        rng.integers(0, 65536, 400).astype(float),
        np.where(k == 40, 65000.0, np.round(100 + 30 * np.sin(0.1 * k))),  # one wrong byte
        np.where(k > 200, top, 0.0),
    ):
        again = wrapped(values)
        assert again is None or not again.signed, values[:20]


def notes_of(folder, reading: np.ndarray) -> list[str]:
    axis = build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))
    u = np.sin(0.05 * np.arange(len(reading)))
    rows = "".join(f"{k},{a:.5f},{x:.0f}\n" for k, (a, x) in enumerate(zip(u, reading, strict=True)))
    (folder / "log.csv").write_text("t (ms),u (V),x (nm)\n" + rows)
    (folder / "recording.toml").write_text(
        'title = "a"\ndevice = "my_stage"\nkind = "series"\n[[record]]\nfile = "log.csv"\nrole = "fit"\n'
        'time = { column = "t (ms)", unit = "ms" }\n[columns]\n'
        '"drive.axis" = { column = "u (V)", unit = "V" }\n"reading.axis" = { column = "x (nm)", unit = "nm" }\n'
    )
    recording = load_recordings([folder], axis, hold_out=False)
    noted = with_plausibility(recording, axis)
    assert len(suspected(noted.notes)) == sum(isinstance(note, Implausible) for note in noted.notes)
    return list(noted.notes)


def test_a_reading_beyond_a_thousand_strokes_is_told_by_itself(tmp_path, rng):
    x = np.round(4e4 * np.sin(0.05 * np.arange(400)) + rng.normal(0, 20, 400))
    assert not any("its other samples" in note for note in notes_of(tmp_path, x))
    said = notes_of(tmp_path, np.where(x < 0, x + 2.0**32, x))
    assert sum("as signed counts do" in note for note in said) == 1
    far = [note for note in said if note.startswith("reading.axis lies 4.29e+09 nm from its other samples")]
    assert len(far) == 1 and "was a sign lost" in far[0]
    spiked = x.copy()
    spiked[[40, 90]] += 5e9
    far = [note for note in notes_of(tmp_path, spiked) if "its other samples" in note]
    assert len(far) == 1 and "in 2 samples of log.csv, first at 0.04 s" in far[0]  # though they are marked
