"""Empirical terms: smoothers of what no law reaches, confirmed by held-out records, in a device file that predicts with them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from axis_records import record

import ctrlgen
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.writeback import next_text
from ctrlgen.diagnosis.shares.empirical_terms import ridge_regression, taken_away
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Recording

SERVO = 'kind = "servo"\nname = "servo"\ntitle = "an axis"\nsource = "round numbers"\ntravel = "100 um"\n'
TESTED = """kind = "tested_axis"
name = "tested"
title = "an axis in a test machine"
source = "round numbers"
[mechanics]
mass = "2 kg"
damping = "30 N*s/m"
stiffness = "5 N/mm"
stroke = "10 mm"
speed = "100 mm/s"
force = "60 N"
"""
PAIR = (
    'kind = "tested_axes"\nname = "pair"\ntitle = "two axes in a test machine"\nsource = "round numbers"\n'
    + "".join(f'[[axis]]\nname = "{name}"\n' + TESTED.partition("[mechanics]\n")[2] for name in "ab")
)
H, N, NOISE = 1e-2, 1500, 5e-9
T = H * np.arange(N)
FIT = 8e-5 * np.sin(2 * np.pi * 0.3 * T) * np.cos(2 * np.pi * 0.043 * T) + 1e-5 * np.sin(2 * np.pi * 1.3 * T)
HELD = 7e-5 * np.sin(2 * np.pi * 0.21 * T + 1) + 1.5e-5 * np.cos(2 * np.pi * 0.9 * T)


def device_of(folder, text: str) -> Device:
    (folder / "device.toml").write_text(text)
    return ctrlgen.load_device(folder / "device.toml")


def recording(device: Device, channel: str, unit: str, noise: float, drives, readings) -> Recording:
    rng = np.random.default_rng(0)
    parts = [
        record(u, y + noise * rng.standard_normal(N), role, h=H)
        for role, u, y in zip(("fit", "hold_out"), drives, readings, strict=True)
    ]
    return Recording("t", device.name, "series", (channel,), (unit,), (noise,), tuple(parts), ())


def loops(d: np.ndarray) -> np.ndarray:
    """Plays that lead and lag, as no joint does: 0.2, -0.1 and 0.03 of what is left of 3, 10 and 30 um."""
    radii, play, out = np.array([3e-6, 1e-5, 3e-5]), np.zeros(3), []
    for value in d:
        play = np.clip(play, value - radii, value + radii)
        out.append(value + np.array([0.2, -0.1, 0.03]) @ (value - play))
    return np.array(out)


def bumps(d: np.ndarray) -> np.ndarray:
    """Three bumps of a scale, of 12, 9 and 10 um."""
    e = [
        a * np.exp(-(((d - x) / w) ** 2))
        for a, x, w in ((-6, -40, 12), (3, -5, 9), (4, 30, 10))
        for x, w in [(x * 1e-6, w * 1e-6)]
    ]
    return d + 1e-7 * np.sum(e, axis=0)


def servo() -> Device:
    return validate(
        Device.library["servo"],
        {"kind": "servo", "name": "servo", "title": "t", "source": "s", "travel": "100 um"},
        "d",
    )


@cache
def diagnosed(law, also_held_out: bool = True, laws: tuple[str, ...] = ("sensor_gain",)):
    device = servo()
    readings = law(FIT), law(HELD) if also_held_out else HELD
    return ctrlgen.diagnose(
        device, recording(device, "reading.axis", "um", NOISE, (FIT, HELD), readings), laws=laws, jobs=0
    )


def rms_of(device: Device, channel: str, given: Recording) -> float:
    held = given.records[1]
    read = Simulator(device, (), (channel,), H).simulate(held, np.zeros(0))
    return float(np.sqrt(np.mean((held.observed - read) ** 2)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "effect", "least"), [(loops, "empirical_history", 0.7), (bumps, "empirical_position", 0.8)]
)
def test_a_function_that_no_law_reaches_is_written_into_the_device_file_and_predicts(tmp_path, law, effect, least):
    found = diagnosed(law)
    assert found.verdict in ("unexplained", "partly")
    (term,) = found.empirical_terms
    assert (term.effect.kind, term.effect.at, term.effect.of, term.channel) == (effect, "axis", "axis", "reading.axis")
    assert term.share > least
    written = next_text(found, SERVO)
    assert f'kind  = "{effect}"' in written and "It names no cause" in " ".join(written.split()).replace("# ", "")
    device = device_of(tmp_path, written)
    rms = rms_of(device, "reading.axis", found.recording)
    assert rms == pytest.approx(term.rms_after * 1e-6, rel=1e-3)  # told in um; initial states are free there
    assert rms < np.sqrt(1.05 * (1 - term.share)) * rms_of(device_of(tmp_path, SERVO), "reading.axis", found.recording)
    (entry,) = diagnosis_record(found, Provenance({}, 0)).empirical_terms
    assert entry.effect == effect and entry.share == term.share


def test_a_function_that_the_held_out_record_does_not_show_is_not_written():
    assert diagnosed(bumps, also_held_out=False).empirical_terms == ()


@pytest.mark.long
def test_where_what_is_left_is_within_the_tolerance_nothing_is_written():
    device = servo()
    given = replace(
        recording(device, "reading.axis", "um", NOISE, (FIT, HELD), (bumps(FIT), bumps(HELD))), tolerance=(1e-6,)
    )
    found = ctrlgen.diagnose(device, given, laws=("sensor_gain",), jobs=0)
    assert found.verdict in ("consistent", "explained") and found.empirical_terms == ()


def test_a_wrong_unit_is_not_corrected_by_a_smoother():
    device = servo()
    given = recording(device, "reading.axis", "um", NOISE, (FIT, HELD), (1000 * FIT, 1000 * HELD))
    found = ctrlgen.diagnose(device, given, laws=("coupling",), jobs=0)
    assert found.verdict == "unexplained" and found.empirical_terms == ()


@pytest.mark.long
def test_a_channel_that_a_term_does_not_move_has_no_say_in_it_and_a_second_diagnosis_adds_nothing(tmp_path):
    """Bumps of a scale on the first of two axes, of which the second is exact; then the device that the first answer wrote."""
    device = device_of(tmp_path, PAIR)
    rng, parts = np.random.default_rng(0), []
    for both, role in (((FIT, HELD), "fit"), ((HELD, FIT), "hold_out")):
        z = 100 * np.column_stack(both)
        v = np.gradient(z, H, axis=0)
        a = np.gradient(v, H, axis=0)
        y = 2 * a + 30 * v + 5e3 * z + 0.02 * rng.standard_normal(z.shape)
        y[:, 0] += 1e6 * (bumps(both[0]) - both[0])
        parts.append(record(np.hstack([z, v, a]), y, role, h=H))
    channels = ("reading.a", "reading.b")
    given = Recording("t", device.name, "series", channels, ("N", "N"), (0.02, 0.02), tuple(parts), ())
    first = ctrlgen.diagnose(device, given, laws=("sensor_gain",), jobs=0)
    (term,) = first.empirical_terms
    assert (term.effect.at, term.effect.of) == ("a", "a") and term.share > 0.97
    again = ctrlgen.diagnose(device_of(tmp_path, next_text(first, PAIR)), given, laws=("sensor_gain",), jobs=0)
    assert again.empirical_terms == ()


def test_where_the_laws_leave_noise_nothing_is_written():
    assert diagnosed(lambda d: 1.02 * d).empirical_terms == ()


@pytest.mark.long
def test_a_named_cause_keeps_its_numbers_and_its_findings():
    """Bumps beside 2 % of gain: the gain is found, and what the term takes is not taken from it."""
    found = diagnosed(lambda d: bumps(d) + 0.02 * d)
    fit = found.search.chosen.fit
    gain = next(f for f in found.findings if f.effect == "sensor_gain").parameters["gain"]
    first, term = found.corrected.effect
    assert first.kind == "sensor_gain" and first.values["gain"].si == pytest.approx(gain.value, rel=1e-9)
    assert term.kind == "empirical_position" and len(fit.structure.causes) == 1


@pytest.mark.long
def test_a_force_that_falls_with_speed_in_its_own_way_is_a_function_of_speed(tmp_path):
    """A torque of 3 N that changes its sign and sags in the middle of the speeds; the law of the library for it is not tried."""
    device = device_of(tmp_path, TESTED)

    def motion(f, g, a):
        z = 4e-3 * np.sin(2 * np.pi * f * T) + 1e-3 * np.sin(2 * np.pi * g * T + a)
        v = np.gradient(z, H)
        return np.column_stack([z, v, np.gradient(v, H)])

    drives = motion(0.5, 1.7, 0.3), motion(0.37, 2.1, 1.0)
    readings = [
        2 * u[:, 2]
        + 30 * u[:, 1]
        + 5e3 * u[:, 0]
        + 3 * np.sign(u[:, 1]) * (1 - 0.8 * np.exp(-(((np.abs(u[:, 1]) - 0.01) / 0.004) ** 2)))
        for u in drives
    ]
    found = ctrlgen.diagnose(
        device, recording(device, "reading.force", "N", 0.05, drives, readings), laws=("sensor_gain",), jobs=0
    )
    (term,) = found.empirical_terms
    assert term.effect.kind == "empirical_speed" and term.share > 0.6


def test_the_ridge_is_that_of_cross_validation(rng):
    """Ten columns of which two act: of white noise alone the largest ridge, beside a strong signal a small one."""
    X = rng.standard_normal((400, 10)) / 3
    y = rng.standard_normal(400)
    alone, _ = ridge_regression(X, y)
    heavy = np.linalg.solve(X.T @ X + np.eye(10), X.T @ y)
    assert alone == pytest.approx(heavy, rel=1e-9)
    loud = X[:, :2] @ [30.0, -20.0] + 0.1 * y
    c, left = ridge_regression(X, loud)
    assert c[:2] == pytest.approx([30, -20], abs=0.2) and np.abs(c[2:]).max() < 0.1
    H_trace = np.trace(X @ np.linalg.solve(X.T @ X + 1e-4 * np.eye(10), X.T))
    assert left <= np.sum((loud - X @ c) ** 2) / (1 - H_trace / float(loud @ loud)) ** 2 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("noise", "after", "share"), [(20.0, 40.0, 0.75), (0.0, 40.0, 0.6), (20.0, 10.0, 1.0), (100.0, 40.0, 0.0)]
)
def test_a_term_takes_away_no_more_than_is_left_beyond_a_noise_that_is_known(noise, after, share):
    """Of 100; a noise that is guessed from what is left may be larger than what a term then leaves."""
    assert taken_away(100.0, after, noise) == pytest.approx(share)
