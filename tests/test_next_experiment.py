"""The next experiment can be done: no drive of it leaves the range, the rate or the band that was recorded, or stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, H, axis_fitter, record
from conftest import MESO_FILE, SCENARIOS

from ctrlgen import build_model, load_device
from ctrlgen.diagnosis.evidence.drive_envelope import DriveEnvelope, free_drives, occupied_band
from ctrlgen.diagnosis.evidence.excitation_signals import admissible, pose_sets, time_series
from ctrlgen.diagnosis.evidence.experiment_design import Experiment, separate
from ctrlgen.diagnosis.evidence.other_readings import OtherReadingEntry, OtherReadings
from ctrlgen.diagnosis.report.experiment_sentences import experiment_sentence
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure

SERVO = load_device(SCENARIOS / "slit_axis" / "device.toml")
STACK = load_device(SCENARIOS / "piezo_stack" / "device.toml")
RACK = load_device(SCENARIOS / "rack_pinion" / "device.toml")
ROUNDING = 1 + 1e-6
FORMS = ("sines", "steps", "one way", "offset", "staircase", "chirp")


def recorded(form: str, rng: np.random.Generator, n: int, h: float) -> np.ndarray:
    """A drive within -1 ... 1 as somebody might have recorded it."""
    t, T = h * np.arange(n), n * h
    match form:
        case "sines":
            return sum(np.sin(2 * np.pi * (f / T * t + rng.random())) for f in rng.uniform(0.7, n / 12, 3)) / 3
        case "steps":
            return np.repeat(rng.uniform(-1, 1, 9), n // 9 + 1)[:n]
        case "one way":
            return np.sort(rng.uniform(-1, 1, 2)) @ np.array([1 - t / T, t / T])
        case "offset":
            return 0.7 + 0.2 * np.sin(2 * np.pi * rng.uniform(2, 9) * t / T)
        case "staircase":
            return np.round(8 * np.sin(2 * np.pi * rng.uniform(1, 4) * t / T)) / 8
        case _:
            return np.sin(2 * np.pi * rng.uniform(2, n / 30) * t**2 / T**2)


def beyond(drive: np.ndarray, seen: list[np.ndarray], h: float) -> list[str]:
    """In what a proposed `drive` leaves what was `seen`, column by column, by definitions of its own."""
    faults = []
    for i in range(drive.shape[1]):
        past = [u[:, i] for u in seen]
        low, high = min(u.min() for u in past), max(u.max() for u in past)
        slack = 1e-9 * max(abs(low), abs(high))
        if drive[:, i].min() < low - slack or drive[:, i].max() > high + slack:
            faults.append(f"range of {i}")
        if np.abs(np.diff(drive[:, i])).max() > ROUNDING * max(np.abs(np.diff(u)).max() for u in past) + slack:
            faults.append(f"rate of {i}")
        edges = []
        for u in past:
            power = np.abs(np.fft.rfft(np.diff(u))) ** 2
            edges.append((np.searchsorted(power.cumsum(), 0.99 * power.sum() * (1 - 1e-12)) + 1) / (len(u) - 1) / h)
        power = np.abs(np.fft.rfft(np.diff(drive[:, i]))) ** 2
        frequency = np.arange(len(power)) / (len(drive) - 1) / h
        if power[frequency > ROUNDING * max(edges)].sum() > 0.01 * ROUNDING * power.sum():
            faults.append(f"band of {i}")
    return faults


@pytest.mark.long
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("device", [AXIS, SERVO, STACK], ids=lambda d: d.name)
def test_no_drive_leaves_what_was_recorded(device, form):
    """Devices of each kind of dynamics, sizes, rates and lengths drawn at random."""
    model, offered = build_model(device), 0
    for seed in range(2):
        rng = np.random.default_rng(seed)
        n, h = int(rng.integers(120, 700)), float(10 ** rng.uniform(-4, -1))
        size = rng.uniform(0.05, 0.9) * model.u_bounds[1]
        seen = [size * recorded(form, rng, n, h)[:, None] for _ in range(2)]
        records = [record(u, np.zeros(n), role, h=h) for u, role in zip(seen, ("fit", "hold_out"), strict=True)]
        envelope, channels = DriveEnvelope.recorded(records, model), ("reading.axis",)
        structure = Structure(device)
        simulator = structure.simulator(channels, records[0].timing)
        for shape in time_series(n, envelope, h, seed, free_drives(model)):
            found = admissible(shape, simulator, structure.start, records[0], 0.0, envelope)
            if found is not None:
                offered += 1
                assert not beyond(found[0].drive, seen, h), (shape.kind, seed)
    assert offered >= 4  # two a recording at the least


@pytest.mark.parametrize("one_way", [False, True])
def test_an_imposed_motion_is_one_motion_within_what_was_recorded(one_way):
    """Speed and acceleration are derivatives of the position, and each within its own range."""
    model, h, n = build_model(RACK), 1e-3, 600
    t = h * np.arange(n)
    place = (
        0.1 * (t / t[-1] - np.sin(2 * np.pi * t / t[-1]) / 2 / np.pi) if one_way else 0.05 * np.sin(2 * np.pi * 4 * t)
    )
    speed = np.gradient(place, h)
    seen = np.column_stack([place, speed, np.gradient(speed, h)])
    template = record(seen, np.zeros(n), "fit", h=h)
    envelope = DriveEnvelope.recorded([template], model)
    structure = Structure(RACK)
    simulator = structure.simulator(("reading.force",), template.timing)
    found = [
        given[0].drive
        for shape in time_series(n, envelope, h, 0, free_drives(model))
        if (given := admissible(shape, simulator, structure.start, template, 0.0, envelope)) is not None
    ]
    assert found
    for drive in found:
        assert not beyond(drive, [seen], h)
        np.testing.assert_allclose(drive[:, 1], np.gradient(drive[:, 0], h), atol=1e-9)
        assert not one_way or drive[:, 1].min() >= 0
    if one_way:  # and where that does not decide, back as well, as fast as forward and as far
        wider = envelope.widened(model)
        assert (wider.low[0], wider.high[0]) == (envelope.low[0], envelope.high[0])
        assert wider.low[1] == -wider.high[1] == -speed.max()


def test_poses_stay_within_the_recorded_ones():
    device = load_device(MESO_FILE)
    model = build_model(device)
    channels = tuple(f"reading.{c}" for c in model.signals["reading"].channels)
    simulator = Simulator(device, (), channels, np.inf, False)
    u = np.random.default_rng(0).uniform([-2e-5] * 6, [1e-5, 3e-5, 0, 1e-5, 1e-5, 1e-5], (40, 6))
    template = record(u, np.zeros((40, 6)), "fit", h=np.inf)
    envelope = DriveEnvelope.recorded([template], model)
    for shape in pose_sets(30, 6, 1):
        given = admissible(shape, simulator, np.zeros(0), template, 0.0, envelope)
        assert given is not None
        assert (given[0].drive >= u.min(axis=0)).all() and (given[0].drive <= u.max(axis=0)).all()


def test_a_stated_rate_takes_the_place_of_the_recorded_one():
    model = build_model(AXIS)
    slow = record(np.sin(np.linspace(0, 6, 500)), np.zeros(500), "fit")
    assert DriveEnvelope.recorded([slow], model).rate == pytest.approx(6 / 499 / H, rel=1e-3)

    class Stated:
        """A model whose drive may go at 50 V/s forward and 40 V/s back."""

        u_bounds, rate_bounds = model.u_bounds, (np.array([-40.0]), np.array([50.0]))

    assert DriveEnvelope.recorded([slow], Stated()).rate == pytest.approx(40.0)


def test_the_band_of_a_sine_is_its_frequency_and_a_ramp_has_none():
    t = H * np.arange(2000)
    assert occupied_band(np.sin(2 * np.pi * 20 * t)[:, None], H) == pytest.approx(20, abs=1)
    assert occupied_band(t[:, None], H) == 0


def doubtful(gain: float, size: float, n: int = 600) -> tuple:
    """A short slow record of the axis, small beside its limit, fitted with creep and with drift."""
    t = np.arange(n) * H
    fitter = axis_fitter(u=size * np.minimum(t / 0.05, 1.0))
    bare = Structure(AXIS)
    creep = fitter.fit(
        bare.with_cause(Hypothesis("creep", "stage:axis", "axis"), {"gain": gain, "tau": 1.0, "slow": 0.0})
    )
    drift = fitter.fit(bare.with_cause(Hypothesis("drift", "sensor:axis", "axis"), {"rate": 1e-8}))
    return fitter, creep, drift


def test_what_does_not_decide_within_the_recording_has_an_alternative():
    """A creep that a recorded drive shows too little: several times the same drive, or a larger one that the device file allows."""
    fitter, creep, drift = doubtful(1e-4, 0.05)
    found = separate(fitter, creep, drift, "alike")
    assert found.settles or found.alternative is not None
    limit = build_model(AXIS).u_bounds[1][0]
    asked = found.drives[0]
    assert asked.range[1] <= 0.05 * ROUNDING and asked.recorded_range[1] == pytest.approx(0.05)
    if found.alternative is not None and found.alternative.beyond is not None:
        assert 0.05 < found.alternative.drives[0].range[1] <= limit
        assert found.alternative.separation_after > 3
    assert isinstance(found, Experiment) and experiment_sentence(found) != experiment_sentence(None)


def test_what_is_read_otherwise_is_told_where_it_decides_and_where_nothing_does():
    """It comes first where no drive is worth recording, and after the drive where one is."""
    fitter, creep, drift = doubtful(1e-4, 0.05)
    found = separate(fitter, creep, drift, "alike")
    gain = Hypothesis("sensor_gain", "sensor:axis", "axis")
    height = Hypothesis(PARAMETER, "mechanism:height", path="hexapod.height")

    def said(after: float, *rows: tuple[str, float]) -> str:
        entries = (
            OtherReadingEntry(kind=text, description=text, scale=None, separation=s, settles=s > 3) for text, s in rows
        )
        design = replace(
            found, after=after, alternative=None, readings=OtherReadings(gain, height, tuple(entries), True)
        )
        return experiment_sentence(design)

    both = "sensor_gain at sensor:axis from a wrong mechanism:height"
    first = (
        f"To tell {both}, read the same poses, zeroed with the drives off, with a turned specimen: "
        "they are 12 standard deviations apart then, "
        "and a second sensor does not (1.4)."
    )
    rows = ("a turned specimen", 12.0), ("a second sensor", 1.4)
    assert said(0.1, *rows) == first
    by_drive = said(99.0, *rows)
    assert by_drive.startswith("Run the next experiment") and by_drive.endswith(first)
    assert said(0.1, rows[0], ("a second sensor", 4.0)).endswith("apart then, and a second sensor does too (4).")
    assert f"Neither a nor b tells {both}: measure" in said(0.1, ("a", 1.0), ("b", 1.0))
    assert f"Not even b tells {both}: measure" in said(0.1, ("b", 1.0))
