"""A sensor that gives a reading in one row of several: its noise is that of its readings, not of what moves between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, drive, move, record

from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.noise import NoiseSource, estimate_noise
from ctrlgen.estimation.noise_update import longest_stretch, update_guessed_noise, usual_spacing
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

N, NOISE = 6000, 2e-8


def fitter_of_readings_in(every: int, missing: float = 0.0, colour: float = 0.0) -> Fitter:
    """Of the axis, read in one row of `every`, of which a share is `missing`; noise of this `colour` from row to row."""
    rng, records = np.random.default_rng(5), []
    for k, role in enumerate(("fit", "hold_out")):
        u = np.roll(drive(N), 700 * k)
        e = np.zeros(N)
        for j, w in enumerate(rng.standard_normal(N)):
            e[j] = colour * e[j - 1] + np.sqrt(1 - colour**2) * w
        there = (np.arange(N) % every == 3 % every) & (rng.random(N) >= missing)
        y = np.where(there, move(u) + NOISE * e, np.nan)
        records.append(replace(record(u, y, role), valid=there[:, None]))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), tuple(records), ())
    return Fitter(recording, estimate_noise(recording, 0.5))


@pytest.mark.parametrize("every", [1, 2, 3, 5, 8, 16])
@pytest.mark.parametrize("missing", [0.0, 0.05])
def test_the_residual_tells_the_noise_of_readings_in_some_rows(every, missing):
    """375 readings or more tell a deviation to 4 %; 15 % is four times that."""
    given = fitter_of_readings_in(every, missing)
    assert given.noise.sources == (NoiseSource.FASTEST_PART,)
    if every >= 5:
        assert given.noise.floor[0] > 20 * NOISE  # the motion between them
    for _ in range(2):
        fit = given.fit(Structure(AXIS))
        given = given.with_noise(update_guessed_noise(given.with_errors_of(fit), fit))
    assert given.noise.floor[0] == pytest.approx(NOISE, rel=0.15)
    assert every == 1 or len(given.noise.ar[0]) == 0


def test_coloured_noise_keeps_its_size_and_tells_no_colour_between_the_rows():
    given = fitter_of_readings_in(4, colour=0.9)
    for _ in range(2):
        fit = given.fit(Structure(AXIS))
        given = given.with_noise(update_guessed_noise(given.with_errors_of(fit), fit))
    assert given.noise.floor[0] == pytest.approx(NOISE, rel=0.2) and len(given.noise.ar[0]) == 0


def test_the_usual_spacing_is_that_of_most_readings():
    good = np.zeros(100, bool)
    assert usual_spacing(good) == usual_spacing(np.arange(100) == 4) == 1
    good[2:98:8] = True
    assert usual_spacing(good) == 8 and longest_stretch(good, 8) == (2, 91)
    good[34] = False
    assert usual_spacing(good) == 8 and longest_stretch(good, 8)[0] == 2
    good[26:60] = False  # more than three of them
    assert longest_stretch(good, 8)[0] == 66
    assert usual_spacing(np.ones(9, bool)) == 1
