"""A reading is late by one number: no second delay stands beside it, the file's own is what may be off, and it holds over its range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, fine, record
from conftest import AXIS_FILE
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from ctrlgen import load_device, user_device
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.report.explain import explain
from ctrlgen.diagnosis.report.writeback import next_text
from ctrlgen.diagnosis.selection import candidates
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Effect
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import (
    PARAMETER,
    Hypothesis,
    hypotheses,
    nominal_physics,
    selected_laws,
    why_not_offered,
)
from ctrlgen.estimation.late_readings import effects_apart
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

STEP = 2e-8
LATE = Hypothesis("delay", "sensor:axis", "axis", highest=CANDIDATE_TERMS.highest_frequency / H, longest=0.5)


def axis_with(*effects: Effect) -> Device:
    return AXIS.model_copy(update={"effect": effects})


def law(kind: str, **numbers: str) -> Effect:
    """A law of the axis, its numbers as the file has them."""
    units = {"ms": 1e-3, "nm": 1e-9, "1": 1.0}
    values = {
        name: Quantity(float(text.split()[0]) * units[text.split()[1]], text.removesuffix(" 1"))
        for name, text in numbers.items()
    }
    return Effect.library[kind]("axis", values)


def recorded(tau: float, step: float = 0.0, gain: float = 1.0, n: int = 1500) -> Fitter:
    """The axis from rest, read late by tau [s], rounded to a step [m], under noise that counts the rounding."""
    rng, t, parts = np.random.default_rng(3), H * np.arange(n), []
    for first, role in ((1.3, "fit"), (1.7, "hold_out")):
        u = 0.5 * np.sin(2 * np.pi * first * t + 1) + 0.2 * np.sin(2 * np.pi * 2.9 * t)
        u *= np.clip((t - 0.05) / 0.3, 0.0, 1.0)
        y = fine(u)
        seen = CubicSpline(H * np.arange(len(y)) / 10, y)(np.maximum(t - tau, 0.0))
        seen = gain * seen + NOISE * rng.standard_normal(n)
        parts.append(record(u, step * np.floor(seen / step + 0.5) if step else seen, role))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())
    sd = np.array([np.hypot(NOISE, step / np.sqrt(12))])
    return Fitter(recording, Noise(sd, (np.zeros(0),), (NoiseSource.STATED,), ("",), np.array([np.inf])))


def offered(device: Device, sample_time: float | None = H) -> list[Hypothesis]:
    return hypotheses(device, nominal_physics(device), ("reading.axis",), sample_time, False)


def test_a_delay_of_all_readings_and_one_of_one_of_them_are_no_two_causes():
    every, other = replace(LATE, location="sensor:all", at="all"), replace(LATE, location="sensor:b", at="b")
    assert every.beside([LATE]) is None and LATE.beside([every]) is None
    assert other.beside([LATE]) is other and LATE.beside([Hypothesis("low_pass", "sensor:all", "all")]) is LATE
    early = Hypothesis("clock_offset", "recording:all", "all")
    assert early.beside([LATE]) is early
    # one gain of all, and one that differs beside it, are two
    gains = Hypothesis("sensor_gain", "sensor:all", "all"), Hypothesis("sensor_gain", "sensor:axis", "axis")
    assert gains[1].beside(gains[:1]) is gains[1]


@pytest.mark.parametrize("at", ["axis", "all"])
def test_beside_a_delay_of_the_file_none_is_offered_but_its_number(at):
    late = Effect.library["delay"](at, {"delay": Quantity(5e-3, "5 ms")})
    device = axis_with(late)
    shifts = [h for h in offered(device) if h.shifts]
    assert {h.effect for h in offered(AXIS) if h.shifts} == {"delay", "clock_offset"}
    assert [(h.effect, h.location) for h in shifts] == [
        ("clock_offset", "recording:all"),
        (PARAMETER, f"sensor:{at}.delay"),
    ]
    given = device, nominal_physics(device), ("reading.axis",)
    assert "its number is what may be off" in why_not_offered(Effect.library["delay"], *given, H, False)
    assert not [h for h in offered(device, None) if h.shifts]  # settled poses have no clock
    assert why_not_offered(Effect.library["delay"], AXIS, nominal_physics(AXIS), ("reading.axis",), H, False) == ""


@pytest.mark.parametrize(("stated", "true"), [(5.0, 24.3), (30.0, 6.5), (4.0, 4.2), (6.0, 0.0)])
def test_a_delay_of_the_file_that_is_off_is_found_however_far(stated, true):
    """Longer, shorter, by a fifth of a sample, and there at all."""
    device = axis_with(law("delay", delay=f"{stated} ms"))
    fitter, described = recorded(true * 1e-3).described(device)
    trials = Trials(fitter, Screen(fitter, offered(device)), lambda _: None)
    tried = candidates.fit_other_clocks(trials, scored(fitter, described), ())
    found = min(tried, key=lambda t: t.fitted.excess)
    (cause,) = found.causes
    assert (cause.effect, cause.path) == (PARAMETER, "effect[0].delay")
    end = trials.converged(found).fit
    assert end.values(0)["value"] == pytest.approx(true * 1e-3, abs=2e-4)
    corrected = end.restarted.device_with_causes
    assert [e.values["delay"].si for e in corrected.effect] == [end.values(0)["value"]]
    assert end.chi2 < 1.15 * end.n and not trials.objections(found)


def two_readings(late: tuple[float, float], n: int = 1200) -> tuple[Device, Fitter]:
    """Two lags of one drive, each read late by a number of its own [s], and what is read of them."""
    lags = {"first": 0.05, "second": 0.12}
    device = user_device(
        "two_lags",
        parameters={"gain": "1 mm/V"},
        drive={"pump": "1 V"},
        axes={name: "1 mm" for name in lags},
        state={f"x{name}": "1 mm" for name in lags},
        rates=lambda u, x, p: [
            (p.gain * u.pump - value) / tau for value, tau in zip((x.xfirst, x.xsecond), lags.values(), strict=True)
        ],
        force=lambda x: [x.xfirst, x.xsecond],
        restoring_force=lambda d: d.vector,
    )
    rng, t, parts = np.random.default_rng(5), H * np.arange(n), []
    for first, role in ((1.3, "fit"), (1.7, "hold_out")):
        u = np.clip((t - 0.05) / 0.3, 0, 1) * (0.5 * np.sin(2 * np.pi * first * t + 1) + 0.2 * np.sin(18 * t))
        columns = []
        for tau, lateness in zip(lags.values(), late, strict=True):
            x = 1e-3 * lfilter([1 - np.exp(-H / tau)], [1, -np.exp(-H / tau)], np.append(0.0, u[:-1]))
            columns.append(CubicSpline(t, x)(np.maximum(t - lateness, 0.0)))
        y = np.column_stack(columns) + 1e-6 * rng.standard_normal((n, 2))
        parts.append(record(u, y, role))
    channels = tuple(f"reading.{name}" for name in lags)
    recording = Recording("t", device.name, "series", channels, ("um",) * 2, (1e-6,) * 2, tuple(parts), ())
    none = (np.zeros(0),) * 2
    noise = Noise(np.full(2, 1e-6), none, (NoiseSource.STATED,) * 2, ("",) * 2, np.full(2, np.inf))
    return device, Fitter(recording, noise)


def test_readings_that_are_late_by_different_times_are_two_delays_and_not_one_of_all():
    """What bars a second delay bars none that takes the place of the first."""
    device, plain = two_readings((0.005, 0.013))
    fitter, described = plain.described(device)
    suspected = [
        h
        for h in hypotheses(device, nominal_physics(device), fitter.recording.channels, H, False)
        if h.effect == "delay"
    ]
    every = next(h for h in suspected if h.at == "all")
    trials = Trials(fitter, Screen(fitter, suspected), lambda _: None)
    common = trials.fit(described.restarted.with_cause(every, {"delay": 0.008}), every, steps=40)
    assert not candidates.fit_other_clocks(trials, common, ())
    (own,) = candidates.fit_own_shifts(trials, common)
    ages = {c.at: own.fit.values(k)["delay"] for k, c in enumerate(own.causes)}
    assert ages == pytest.approx({"first": 0.005, "second": 0.013}, abs=1e-4)
    ends = [plain.fit(t.fit.restarted) for t in (own, common)]
    assert ends[0].chi2 < 1.15 * ends[0].n < 0.1 * ends[1].chi2


@pytest.mark.long
def test_a_diagnosis_tells_that_the_delay_of_the_file_is_off(tmp_path):
    file = tmp_path / "late.toml"
    file.write_text(AXIS_FILE.read_text() + '\n[[effect]]\nkind = "delay"\nat = "axis"\ndelay = "5 ms"\n')
    device = load_device(file)
    found = diagnose_recording(device, recorded(0.012).recording, jobs=0)
    (finding,) = found.findings
    assert (finding.effect, finding.location) == (PARAMETER, "sensor:axis.delay")
    low, high = finding.parameters["delay"].ci95
    assert low <= 12.0 <= high and high - low < 0.5  # ms
    assert "sensor:axis.delay" in sentence(found) and "12" in sentence(found)
    assert "its number is what may be off" in " ".join(explain(found, "delay"))
    file.write_text(next_text(found, file.read_text()))
    (late,) = load_device(file).effect
    assert late.kind == "delay" and low <= 1e3 * late.values["delay"].si <= high


@pytest.mark.parametrize("samples", [30.0, 45.3])
def test_a_delay_in_front_of_another_law_is_found_beyond_the_samples_that_were_kept_for_it(samples):
    """Eight samples are kept of one that begins at two."""
    dead = law("stuck", share="0 1", level="0 nm")
    begun = Structure(axis_with(dead)).with_cause(LATE, {"delay": 2 * H})
    assert effects_apart(begun.expanded_device, nominal_physics(AXIS)) == ()
    assert begun.free_parameters[-1].high == pytest.approx(8 * H)
    fit = recorded(samples * H).fit(begun)
    assert fit.values(0)["delay"] == pytest.approx(samples * H, abs=0.1 * H) and fit.chi2 < 1.15 * fit.n
    # a start beyond what was kept is not bent
    assert begun.restarted(0, {"delay": 20 * H}).with_room().start[-1] == 20 * H


def test_a_delay_that_a_loop_reads_ends_at_its_bound_and_no_earlier():
    begun = Structure(AXIS).with_cause(replace(LATE, longest=8 * H), {"delay": H})
    assert begun.with_room() is begun and begun.free_parameters[-1].high == 8 * H


@pytest.mark.parametrize("kind", ["delay", "sensor_gain"])
def test_what_stands_before_rounding_is_found(kind):
    """Rounded readings have no slope: a fit takes rounding as noise."""
    fitter = recorded(0.03 if kind == "delay" else 0.0, STEP, 1.0 if kind == "delay" else 1.05)
    device = axis_with(law("quantisation", share="1 1", quantum="20 nm"))
    cause = LATE if kind == "delay" else Hypothesis("sensor_gain", "sensor:axis", "axis")
    begun = Structure(device).with_cause(cause, {"delay": 2 * H} if kind == "delay" else {"gain": 0.0})
    fit = fitter.fit(begun)
    name, true, within = ("delay", 0.03, 1e-4) if kind == "delay" else ("gain", 0.05, 0.02)
    near = abs(fit.values(0)[name] - true) < max(within, 3 * np.sqrt(fit.covariance[-1, -1]))
    assert near and np.abs(fit.J[:, -1]).max() > 0 and fit.chi2 < 1.15 * fit.n


def test_rounding_that_the_file_has_is_not_suspected_again():
    rounded = axis_with(law("quantisation", share="1 1", quantum="20 nm"))
    assert "quantisation" in {h.effect for h in offered(AXIS)}
    assert "quantisation" not in {h.effect for h in offered(rounded)}
    late = law("delay", delay="5 ms")
    physics = nominal_physics(AXIS)
    digits = law("quantisation", share="1 1", quantum="20 nm")
    assert effects_apart(axis_with(late, digits), physics) == (0, 1)
    # rounding that is itself fitted stays, and so does what is in front of it
    assert effects_apart(axis_with(late, digits), physics, ("effect[1].share",)) == ()
    assert effects_apart(axis_with(late, digits), physics, (), False) == (1,)
    assert {law.kind for law in selected_laws() if law.in_steps} == {"quantisation"}
