"""A sensor that picks up the drive: where it can, what is read then, and that a diagnosis tells it and no resonance, whichever sample of
the drive the reading has met."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, drives, move, record
from conftest import AXIS_FILE, DEVICE
from effect_cases import PAIR, TESTED, device_of
from recovery import Planted, fitter_of, recover

from ctrlgen import build_model, load_device, simulate
from ctrlgen.core.errors import InputError
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.hypothesis import hypotheses, nominal_physics
from ctrlgen.recordings.recording import Recording

GAIN = 1e-7  # m/V: a five-hundredth of what the stage goes per volt
TABLE = '\n[[effect]]\nkind = "feedthrough"\nat = "axis"\nof = "axis"\ngain = "0.1 um/V"\nbefore = "0.25"\n'
LOOP = (
    '\n[loop]\nmeasures = "{}"\nposition_gain = "60 1/s"\nvelocity_gain = "20 V/(m/s)"\nintegral_gain = "5e4 V/(m*s)"\n'
)


def axis_with(tmp_path, *texts: str):
    (tmp_path / "device.toml").write_text(AXIS_FILE.read_text() + "".join(texts))
    return load_device(tmp_path / "device.toml")


def picked_up(u: np.ndarray, before: float) -> np.ndarray:
    """Of each row `before` is that of the row above it; nothing was driven before the first."""
    return GAIN * np.convolve(u, [1 - before, before])[: len(u)]


def parts(before: float, rng, n: int = 1500) -> list:
    return [
        record(u, move(u) + picked_up(u, before) + NOISE * rng.standard_normal(n), role)
        for u, role in zip(drives(n), ("fit", "hold_out"), strict=True)
    ]


@pytest.mark.parametrize("before", [0.25, 0.8])
def test_it_is_recovered(before, rng):
    planted = Planted("sensor:axis", {"gain": GAIN, "before": before}, "axis", within={"before": 0.05})
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts(before, rng))
    recover(fitter, AXIS, "feedthrough", planted)


@pytest.mark.long
@pytest.mark.parametrize("before", [0.0, 1.0])
def test_it_is_named_and_no_resonance(before, rng):
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts(before, rng)), ())
    found = diagnose_recording(AXIS, recording, jobs=0)
    (only,) = found.findings
    assert found.verdict is Verdict.EXPLAINED and only.effect == "feedthrough"
    for name, true in (("gain", GAIN * 1e6), ("before", before)):
        low, high = only.parameters[name].ci95
        assert low <= true <= high


@pytest.mark.long
def test_a_gain_that_is_wrong_stays_one(rng):
    u = drives(1500)
    rows = [
        record(u, move(1.08 * u) + NOISE * rng.standard_normal(1500), role)
        for u, role in zip(u, ("fit", "hold_out"), strict=True)
    ]
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(rows), ())
    found = diagnose_recording(AXIS, recording, jobs=0)
    assert "feedthrough" not in {f.effect for f in found.findings}


def test_what_the_amplifier_delivers_is_what_is_picked_up(tmp_path, rng):
    """Behind an amplifier that gives 10 % more; the stage moves as without."""
    gain = '\n[[effect]]\nkind = "drive_gain"\nat = "axis"\ngain = "10 %"\n'
    u = rng.uniform(-1, 1, (50, 1))
    seen, bare = (
        simulate(build_model(axis_with(tmp_path, gain, more), sample_time=H), u, H).signals["reading"][:-1, 0]
        for more in (TABLE, "")
    )
    assert seen - bare == pytest.approx(1.1 * picked_up(u[:, 0], 0.25), rel=1e-6, abs=1e-15)


def test_a_controller_that_reads_it_has_no_drive_to_give_it_and_one_that_does_not_read_it_has(tmp_path):
    with pytest.raises(InputError, match="a drive that no feedback of the readings decides on"):
        build_model(axis_with(tmp_path, LOOP.format("reading"), TABLE))
    device = axis_with(tmp_path, LOOP.format("displacement"), TABLE)
    there = simulate(build_model(device, sample_time=H), np.full((4000, 1), 1e-5), H).signals
    held = there["command"][-1, 0]
    assert there["reading"][-1, 0] - there["displacement"][-1, 0] == pytest.approx(GAIN * held, rel=1e-6)


@pytest.mark.parametrize("device", [load_device(DEVICE), device_of(TESTED), device_of(PAIR)], ids=lambda d: d.name)
def test_it_is_not_suspected_in_balance_nor_of_a_motion_that_is_imposed(device):
    """In balance what is picked up is a gain, or a coupling; an imposed motion is no drive."""
    physics = nominal_physics(device)
    channels = tuple(f"reading.{name}" for name in physics.readings[0])
    assert "feedthrough" not in {h.effect for h in hypotheses(device, physics, channels, H, False)}
