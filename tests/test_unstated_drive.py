"""What a drive does between its samples, where nobody states it: the readings tell, and no law stands in for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, KF, NOISE, H, M, drive, move, record
from conftest import DEVICES
from scipy.interpolate import CubicSpline

from ctrlgen import build_model, load_device, simulate
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.estimation.unstated_drive import (
    WAYS,
    as_described_fits,
    read_as,
    read_better,
    read_with_less,
    told_of_reading,
    way_of,
)
from ctrlgen.recordings.recording import Recording
from ctrlgen.recordings.smooth_drive import with_lines_as_strong

N = 1200
LATE = Hypothesis("delay", "sensor:axis", "axis")
PICKED_UP = Hypothesis("feedthrough", "sensor:axis", "axis", "axis")
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


def smooth(u, force=None):
    """The response to a drive that is a curve through its samples, by its mean over each tenth of a sample."""
    until = CubicSpline(np.arange(len(u)), u).antiderivative()

    def more(now, q, v, memory):
        a = now / H
        mean = 10 * float(until(a + 0.1) - until(a))
        return KF * (mean - u[int(a + 1e-6)]) + (0 if force is None else force(now, q, v, memory)[0]), memory

    return move(u, more)


TRUE = {"held": held, "linear": linear, "smooth": smooth}


def recorded(way, force=None, either=True, first="linear") -> Recording:
    """A smooth record to fit and one to hold out, that are read in the way `first`."""
    rng, t = np.random.default_rng(2), H * np.arange(N)
    parts = []
    for u, role in (
        (drive(N), "fit"),
        (1.2 * np.sin(2 * np.pi * 3.7 * t) + 0.3 * np.sin(2 * np.pi * 17 * t), "hold_out"),
    ):
        made = record(u, TRUE[way](u, force) + NOISE * rng.standard_normal(N), role)
        parts.append(replace(made, linear=first != "held", smooth=first == "smooth", either=either))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


def fitter(recording: Recording) -> Fitter:
    return Fitter(recording, estimate_noise(recording, 0.5))


@pytest.mark.parametrize("rows", range(1, 8))
def test_lines_through_a_straight_drive_stay(rows):
    u = np.column_stack([3.0 + 2.0 * np.arange(rows), np.ones(rows)])
    assert np.allclose(with_lines_as_strong(u), u, rtol=1e-14)


@pytest.mark.parametrize(
    "samples, missed, lines", [(5, 6e-3, 0.13), (10, 1.2e-4, 0.033), (20, 2e-6, 8.3e-3), (50, 1e-8, 1.4e-3)]
)
def test_lines_as_strong_undo_by_what_lines_weaken_a_sine(samples, missed, lines):
    """Of so many samples a period: the mean over a period of straight lines times the sine itself, to the sixth power of its frequency."""
    u = np.exp(2j * np.pi * np.arange(12 * samples) / samples)
    weaker = np.sinc(1 / samples) ** 2
    gain = with_lines_as_strong(u[:, None])[3 * samples, 0] / u[3 * samples] * weaker
    assert abs(gain - 1) < missed and abs(weaker - 1) == pytest.approx(lines, rel=0.1)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("first", WAYS)
def test_the_device_as_described_tells(way, first):
    read = as_described_fits(AXIS, fitter(recorded(way, first=first)))
    assert way_of(read.recording) == way
    (told,) = told_of_reading(read, read.fit(Structure(AXIS)))
    assert f"{way} is taken" in told and all(other in told for other in WAYS)


def test_a_stage_in_balance_follows_its_drive_at_once_and_none_between_samples():
    """A curve, which would bend what is read at the samples, is not taken."""
    stage = load_device(DEVICES / "parallelogram.toml")
    u = np.sin(2 * np.pi * 30 * H * np.arange(300))
    read = simulate(build_model(stage), u[:, None], H).signals["reading"][1:, :1]
    y = read[:, 0] + NOISE * np.random.default_rng(1).standard_normal(len(read))
    name = f"reading.{build_model(stage).signals['reading'].channels[0]}"
    parts = tuple(replace(record(u[: len(y)], y, role), either=True) for role in ("fit", "hold_out"))
    given = fitter(Recording("t", stage.name, "series", (name,), ("um",), (NOISE,), parts, ()))
    assert way_of(as_described_fits(stage, given).recording) == "linear"


def test_what_is_stated_stands():
    given = fitter(recorded("held", either=False))
    plain = given.fit(Structure(AXIS))
    assert as_described_fits(AXIS, given) is given
    assert read_better(given, plain) is given and read_with_less(given, plain) is given
    assert told_of_reading(given, plain) == []


@pytest.mark.parametrize("linear", [True, False])
def test_a_held_out_drive_that_is_not_stated_goes_as_those_to_fit(linear):
    fit, held_out = recorded("held").records
    given = fitter(replace(recorded("held"), records=(replace(fit, linear=linear, either=False), held_out)))
    read = as_described_fits(AXIS, given)
    assert [r.linear for r in read.recording.records] == [linear, linear]
    plain = read.fit(Structure(AXIS))
    assert (
        read_better(read, plain) is read and read_with_less(read, plain) is read and told_of_reading(read, plain) == []
    )


@pytest.mark.parametrize("way", WAYS)
def test_a_law_by_which_a_reading_is_late_is_weighed_against_it(way):
    """Read as linear a held drive takes a delay; one that is linear does not, and stays."""
    given = fitter(recorded(way))
    late = given.fit(Structure(AXIS).with_cause(LATE, {"delay": 0.4 * H}))
    assert way_of(read_with_less(given, late).recording) == way


@pytest.mark.parametrize("way", WAYS)
def test_a_law_that_is_needed_in_one_way_alone_is_weighed_against_it(way):
    """Lines for a curve leave a force F of an axis h^2 F / 12 m too weak, which is a pick-up of its drive."""
    given = fitter(recorded(way))
    picked = given.fit(Structure(AXIS).with_cause(PICKED_UP, {"gain": -(H**2) * KF / (12 * M), "before": 0.05}))
    if way == "smooth":
        assert picked.values(0)["gain"] == pytest.approx(-(H**2) * KF / (12 * M), rel=0.1)
    assert way_of(read_with_less(given, picked).recording) == way


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("first", WAYS)
def test_a_model_that_leaves_less_another_way_is_found_out(way, first):
    given = fitter(recorded(way, first=first))
    plain = given.fit(Structure(AXIS))
    assert way_of(read_better(given, plain).recording) == way_of(read_with_less(given, plain).recording) == way


def test_a_slow_drive_tells_nothing_and_is_left():
    t = H * np.arange(N)
    u = np.sin(2 * np.pi * 0.4 * t)
    slow = [
        replace(
            record(u, linear(u) + 1e-7 * np.random.default_rng(k).standard_normal(N), role), linear=True, either=True
        )
        for k, role in enumerate(("fit", "hold_out"))
    ]
    given = fitter(Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (1e-7,), tuple(slow), ()))
    assert way_of(as_described_fits(AXIS, given).recording) == "linear"
    assert read_better(given, given.fit(Structure(AXIS))) is given


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("force, laws", [(None, ()), (stiffening, ("stiffening",))])
def test_a_diagnosis_names_what_acts_and_no_stand_in(way, force, laws):
    offered = (
        "delay",
        "low_pass",
        "clock_offset",
        "feedthrough",
        "amplifier_lag",
        "stiffening",
        "coulomb",
        "force_factor",
    )
    found = diagnose_recording(AXIS, recorded(way, force), laws=offered)
    assert tuple(f.effect for f in found.findings) == laws
    assert found.verdict == (Verdict.EXPLAINED if laws else Verdict.CONSISTENT)
    assert way_of(found.recording) == way
    assert any(f"{way} is taken" in note for note in found.notes)


def rough(smooth: bool) -> Fitter:
    """Of a drive that is another value in each row, as a curve through these or in the lines that stand for it."""
    u, records = np.random.default_rng(4).standard_normal(600), []
    for role in ("fit", "hold_out"):
        y = linear(u) + 3e-7 * u
        made = replace(record(u, y, role), linear=True, smooth=True, either=True)
        records.append(made if smooth else replace(made, drive=made.applied, smooth=False))
    return fitter(Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(records), ()))


def test_a_curve_is_simulated_and_screened_as_the_lines_that_stand_for_it():
    laws = [PICKED_UP, Hypothesis("cubic_drive", "actuator:axis", "axis")]
    seen = [Screen(f, laws).run(f.fit(Structure(AXIS))) for f in (rough(True), rough(False))]
    curve, lines = ({s.hypothesis.effect: s.z for s in screened.suspects} for screened in seen)
    assert curve.keys() == lines.keys() and len(curve) == 2
    assert [curve[name] for name in lines] == pytest.approx(list(lines.values()), rel=1e-9)


def test_a_checkpoint_tells_fits_of_a_curve_from_those_of_lines(tmp_path):
    plain = fitter(recorded("smooth"))
    kept = replace(plain, checkpoint=Checkpoint(tmp_path / "fits", {}))
    for way in WAYS:
        alone, again = (replace(f, recording=read_as(f.recording, way)).fit(Structure(AXIS)) for f in (plain, kept))
        assert np.array_equal(alone.theta, again.theta)
