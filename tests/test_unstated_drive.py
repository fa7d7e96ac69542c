"""Whether a drive is held or linear between its samples, where nobody states it: the readings tell, and no law stands in for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, KF, NOISE, H, drive, move, record

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.estimation.unstated_drive import as_described_fits, fits_the_other_way, turned
from ctrlgen.recordings.recording import Recording

N = 1200
LATE = Hypothesis("delay", "sensor:axis", "axis")
STIFFER = 6e12  # N/m^3


def stiffening(now, q, v, memory):
    return -STIFFER * q**3, memory


def held(u, force=None):
    return move(u, force)


def linear(u, force=None):
    """The response to a drive that is linear between samples, by its mean over each tenth of a sample."""

    def more(now, q, v, memory):
        k = int(now / H + 1e-6)
        rises = (u[min(k + 1, len(u) - 1)] - u[k]) * ((now + H / 20) / H - k)
        return KF * rises + (0 if force is None else force(now, q, v, memory)[0]), memory

    return move(u, more)


def recorded(way, force=None, either=True, first=True) -> Recording:
    """A smooth record to fit and one to hold out, that are read as linear `first`."""
    rng, t = np.random.default_rng(2), H * np.arange(N)
    parts = []
    for u, role in (
        (drive(N), "fit"),
        (1.2 * np.sin(2 * np.pi * 3.7 * t) + 0.3 * np.sin(2 * np.pi * 17 * t), "hold_out"),
    ):
        made = record(u, way(u, force) + NOISE * rng.standard_normal(N), role)
        parts.append(replace(made, linear=first, either=either))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


def fitter(recording: Recording) -> Fitter:
    return Fitter(recording, estimate_noise(recording, 0.5))


@pytest.mark.parametrize("way", [held, linear])
def test_the_device_as_described_tells(way):
    read = as_described_fits(AXIS, fitter(recorded(way)))
    assert [r.linear for r in read.recording.records] == [way is linear] * 2
    assert f"{way.__name__} is taken" in read.recording.notes[0]


def test_what_is_stated_stands():
    given = fitter(recorded(held, either=False))
    assert as_described_fits(AXIS, given) is given
    assert not fits_the_other_way(given, given.fit(Structure(AXIS)))


@pytest.mark.parametrize("way", [held, linear])
def test_a_law_by_which_a_reading_is_late_is_weighed_against_it(way):
    """Read as linear a held drive takes a delay; one that is linear does not, and stays."""
    given = fitter(recorded(way))
    late = given.fit(Structure(AXIS).with_cause(LATE, {"delay": 0.4 * H}))
    assert fits_the_other_way(given, late) == (way is held)
    assert not any(r.linear or r.either for r in turned(given.recording, given.recording).records)


def test_a_model_that_leaves_less_the_other_way_is_found_out():
    given = fitter(recorded(linear, first=False))
    assert fits_the_other_way(given, given.fit(Structure(AXIS)))


@pytest.mark.long
@pytest.mark.parametrize("way", [held, linear])
@pytest.mark.parametrize("force, laws", [(None, ()), (stiffening, ("stiffening",))])
def test_a_diagnosis_names_what_acts_and_no_delay(way, force, laws):
    found = diagnose_recording(
        AXIS, recorded(way, force), laws=("delay", "low_pass", "clock_offset", "stiffening", "coulomb")
    )
    assert tuple(f.effect for f in found.findings) == laws
    assert found.verdict == (Verdict.EXPLAINED if laws else Verdict.CONSISTENT)
    assert all(r.linear == (way is linear) for r in found.recording.records)
    assert any(f"{way.__name__} is taken" in note for note in found.notes)
