"""A rotary axis told its angle: what errs once a turn, gains along the chain that do the same, and steps that look like noise."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import SETTLING, record
from recovery import Planted, fitter_of, recover
from scipy.signal import lfilter

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.report.half_a_sample import half_a_sample
from ctrlgen.diagnosis.selection.findings import Estimate
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.rivals import rivals
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.way_covered import where_it_turns
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.noise_update import update_guessed_noise
from ctrlgen.estimation.residual_noise import louder_than_readings
from ctrlgen.estimation.settings import FIT
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

H, NOISE = 0.02, 1e-5  # s, rad
TABLE = {"kind": "servo", "name": "wrist", "title": "a wrist", "source": "round numbers", "travel": "400 deg"}
WRIST = validate(Device.library["servo"], TABLE, "device")
ECCENTRIC, GAIN, SCALE = (
    Hypothesis(law, at, "axis")
    for law, at in (
        ("eccentricity", "sensor:axis"),
        ("drive_gain", "actuator:axis"),
        ("sensor_gain", "sensor:axis"),
    )
)
WEIGHT = Hypothesis("payload", "mechanism:axis", "axis")


def swings(largest: float, n: int = 700) -> list[np.ndarray]:
    """A motion to fit and one to hold out [rad]."""
    t = H * np.arange(n)
    return [largest * (0.7 * np.sin(1.1 * t) + 0.3 * np.sin(2.9 * t + p) - 0.3 * np.sin(p)) for p in (1.0, 2.0)]


def fitter_on(change, largest: float, sd: float | None = NOISE) -> Fitter:
    rng, parts = np.random.default_rng(7), []
    for told, role in zip(swings(largest), ("fit", "hold_out"), strict=True):
        parts.append(record(told, change(told) + NOISE * rng.standard_normal(len(told)), role, h=H))
    return fitter_of(WRIST, ("reading.axis",), ("deg",), (sd,), "series", parts)


def disc(q: np.ndarray) -> np.ndarray:
    """The angle that a head reads on a disc whose centre is a thousandth of its radius beside the axis."""
    head = np.exp(1j * q) - 1e-3 * np.exp(-0.8j)
    return np.unwrap(np.angle(head)) - np.angle(head[0])


def test_a_disc_beside_its_axis_is_recovered_from_the_angle_that_a_head_reads():
    fitter = fitter_on(disc, 5.0)
    first = swings(5.0)[0]
    assert np.ptp(first) > 2 * np.pi / 4
    recover(
        fitter, WRIST, "eccentricity", Planted("sensor:axis", {"amplitude": 1e-3, "phase": 0.8}, within={"phase": 0.02})
    )


@pytest.mark.parametrize(("largest", "there"), [(0.5, False), (1.5, True)])
def test_what_errs_once_a_turn_is_suspected_where_a_quarter_of_one_is_read(largest, there):
    fitter = fitter_on(lambda q: q, largest)
    offered = where_it_turns([ECCENTRIC, GAIN], fitter.recording, WRIST)
    assert (ECCENTRIC in offered) == there and GAIN in offered
    # an indexing table is calibrated pose by pose
    poses = replace(fitter.recording, kind="poses")
    assert where_it_turns([ECCENTRIC, GAIN], poses, WRIST) == offered


def chosen(change, largest: float, suspected: list[Hypothesis], *causes: tuple[Hypothesis, dict[str, float]]):
    """Trials of what is suspected, and the model with the causes begun at these numbers."""
    fitter = fitter_on(change, largest)
    structure = Structure(WRIST)
    for cause, start in causes:
        structure = structure.with_cause(cause, start)
    trials = Trials(fitter, Screen(fitter, suspected), lambda _: None, jobs=0)
    return trials, scored(fitter, fitter.fit(structure, steps=FIT.max_steps))


def test_a_gain_beside_a_weight_is_not_told_from_that_at_the_other_end():
    """Without the gain the moment of the weight bends to do its part, and no screen suspects another gain."""

    def told(q):
        return 0.976 * q + 0.01 * (np.sin(0.976 * q - 0.4) + np.sin(0.4))

    began = (SCALE, {"gain": -0.024}), (WEIGHT, {"share": 0.01, "lean": -0.4})
    trials, current = chosen(told, 0.9, [SCALE, GAIN, WEIGHT], *began)
    assert current.errors.is_noise
    alike, _ = rivals(trials, current, 0)
    assert [t.cause for t in alike] == [GAIN]
    gain = alike[0].fit.values(next(k for k, c in enumerate(alike[0].causes) if c == GAIN))["gain"]
    assert gain == pytest.approx(-0.024, abs=2e-4)


@pytest.mark.parametrize(
    ("named", "other"), [((WEIGHT, "share", "lean"), ECCENTRIC), ((ECCENTRIC, "amplitude", "phase"), WEIGHT)]
)
def test_a_weight_is_not_told_from_a_disc_beside_its_axis(named, other):
    """Both err once a turn, wherever the weight hangs."""
    cause, size, angle = named
    trials, current = chosen(disc, 5.0, [ECCENTRIC, WEIGHT, SCALE], (cause, {size: 1e-3, angle: 0.8}))
    alike, _ = rivals(trials, current, 0)
    assert [t.cause for t in alike] == [other]


def reads(noise: np.ndarray) -> Recording:
    """A recording of a slow motion with this noise, and nothing that tells it."""
    slow = 0.3 * np.sin(0.7 * H * np.arange(len(noise)))
    parts = tuple(record(slow, slow + noise, role, h=H) for role in ("fit", "hold_out"))
    return Recording("t", WRIST.name, "series", ("reading.axis",), ("deg",), (None,), parts, ())


def test_noise_of_any_colour_is_no_louder_than_the_readings_that_hold_it():
    """Coloured, coarsely read, heavy in its tails, and such as is louder where the device moves; not what is five times as loud."""
    white = np.random.default_rng(4).standard_normal(3000)
    tailed = np.random.default_rng(5).standard_t(3, 3000) / np.sqrt(3)
    for a in (-0.8, 0.0, 0.6, 0.99):
        coloured = reads(NOISE * lfilter([1.0], [1.0, -a], white))
        assert not louder_than_readings(coloured, 0, NOISE, np.array([a]))
        assert louder_than_readings(coloured, 0, 5 * NOISE, np.array([a]))
    assert not louder_than_readings(reads(NOISE * tailed), 0, NOISE, np.zeros(0))
    on_the_move = np.where(np.arange(3000) % 100 < 60, 0.5, 1.5)
    assert not louder_than_readings(reads(NOISE * white * on_the_move), 0, NOISE, np.zeros(0))
    coarse, step = reads(NOISE * white), 0.1  # which most samples do not leave
    rounded = replace(
        coarse, records=tuple(replace(r, observed=step * np.round(r.observed / step)) for r in coarse.records)
    )
    assert not louder_than_readings(rounded, 0, step / np.sqrt(12.0), np.zeros(0))


def test_a_lag_after_steps_is_not_taken_for_noise():
    """It acts at all frequencies, as noise does; most readings show that they are not so loud."""
    rng, parts = np.random.default_rng(3), []
    for role in ("fit", "hold_out"):
        steps = np.repeat(rng.uniform(0, 1, 30), 40)
        y, late = np.zeros(1200), 0.0
        for k, told in enumerate(steps):
            y[k], late = late, told + (late - told) * np.exp(-1 / 3)
        parts.append(record(steps, y + 1e-4 * rng.standard_normal(1200), role, h=H))
    recording = Recording("t", WRIST.name, "series", ("reading.axis",), ("deg",), (None,), tuple(parts), ())
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    assert fitter.noise.guessed.all()
    noise = update_guessed_noise(*fitter.described(WRIST))
    assert 1e-4 < noise.floor[0] < 2e-4  # 0.04 rad where the residual is taken


@pytest.mark.parametrize(
    ("linear", "late", "sd", "told"),
    [
        (True, 10.0, 0.01, True),
        (True, 9.7, 0.01, True),
        (True, 12.0, 0.01, False),
        (False, 10.0, 0.01, False),
        (True, 9.0, 3.0, True),
        (True, 9.0, 10.0, False),  # it may be none at all
        (True, 14.0, 6.0, False),  # or a whole sample
    ],
)
def test_a_delay_of_half_a_sample_may_be_a_held_drive_that_was_read_as_linear(linear, late, sd, told):
    recording = fitter_on(lambda q: q, 0.5).recording
    recording = replace(recording, records=tuple(replace(r, linear=linear) for r in recording.records))
    numbers = {"delay": Estimate(late, (late - sd, late + sd), "ms")}
    found = SimpleNamespace(effect="delay", cause=Hypothesis("delay", "sensor:axis", "axis"), parameters=numbers)
    notes = half_a_sample(recording, [found, SimpleNamespace(effect="parameter")])
    assert len(notes) == told and all("half a sample" in note and "held" in note for note in notes)
