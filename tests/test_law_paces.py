"""How fast a machine is changes no finding: what is slow in it is told a hundred times as fast or as slow.

The readings of a linear stage are the same numbers where its mass goes with the square of the time and its damping with the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, C, H, M, drive, move, record
from planted_axis import amplifier_lag

from ctrlgen.core.units import to_si
from ctrlgen.devices.changed_numbers import with_numbers
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, hypotheses, nominal_physics
from ctrlgen.recordings.recording import Recording

PACES = (1e-3, 1e-2, 1e2, 1e3)
# Powers of time in the units that laws count in
POWER = {"s": 1, "Hz": -1, "1/s": -1, "channel/s": -1, "travel/s": -1, "ms": 1}
POWER |= {"channel*s/travel": 1, "channel*s^2/travel^2": 2, "channel*s^2/travel": 2, "channel*s/travel^2": 1}
# As late as a camera or a bus, whatever the machine; moments count on the clock
ABSOLUTE = {"delay", "offset", "moment"}


def suspected(pace: float) -> dict[tuple[str, str], Hypothesis]:
    """The hypotheses about the axis that is `pace` times as slow, by law and place."""
    found = hypotheses(AXIS, nominal_physics(AXIS), ("reading.axis",), pace * H, True)
    return {(h.effect, h.location): replace(h, time=0.02 * pace) for h in found if h.effect != PARAMETER}


def hints(pace: float) -> DataHints:
    return DataHints(
        {"channel": 1.0, "travel": 1e-4, "travel/s": 5e-3 / pace, "channel/s": 50 / pace, "s": 0.5 * pace},
        duration=6.0 * pace,
    )


@pytest.mark.parametrize("pace", PACES)
def test_every_law_is_sought_in_the_pace_of_its_records(pace):
    compared = 0
    usual, there = suspected(1.0), suspected(pace)
    assert usual.keys() == there.keys()
    for key, h in usual.items():
        if h.effect in ("vibration", "vibration_per_record"):  # mains and rotating machines keep their frequencies
            continue
        other = there[key]
        channel, moved = h.channel_on(AXIS), other.channel_on(AXIS)
        shapes, again = h.shapes(channel, hints(1.0)), other.shapes(moved, hints(pace))
        assert len(shapes) == len(again), key
        for p in h.law.params:
            if p.unit in POWER and p.name in ABSOLUTE:
                continue
            factor = pace ** POWER.get(p.unit, 0)
            timed = set("s") & set(p.unit.replace("travel", "").replace("channel", "").replace("deg", ""))
            assert not timed or p.unit in POWER, (h.effect, p)
            wanted = np.multiply(h.bounds(p, channel), factor)
            assert other.bounds(p, moved) == pytest.approx(wanted, rel=1e-9), (key, p)
            for one, two in zip(shapes, again, strict=True):
                if p.name in one:
                    assert two[p.name] == pytest.approx(one[p.name] * factor, rel=1e-9), (key, p)
            compared += p.unit in POWER
    assert compared > 20


def ringing(now, q, v, memory):
    """A payload of 50 g that rings at 160 Hz, in steps of a twentieth of a sample."""
    x, w = memory if isinstance(memory, tuple) else (0.0, 0.0)
    omega, step = 2 * np.pi * 160, H / 20
    k, c = 0.05 * omega**2, 2 * 0.03 * 0.05 * omega
    pushed = k * (x - q) + c * (w - v)
    w = w - step * pushed / 0.05
    return pushed, (x + step * w, w)


def creeping(y: np.ndarray, u: np.ndarray) -> np.ndarray:
    """A reading that goes on by 3 % within 300 samples."""
    late, out = 0.0, []
    for value in y:
        out.append(value + 0.03 * late)
        late += (value - late) / 300
    return np.array(out)


def test_a_sample_a_millisecond_is_the_usual_pace_and_so_are_half_and_twice_of_it():
    for times in (0.5, 1.0, 2.0):
        late = suspected(times)["low_pass", "sensor:axis"]
        tau = next(p for p in late.law.params if p.name == "tau")
        assert late.pace == 1.0 and late.bounds(tau, late.channel_on(AXIS)) == tau.bounds


@pytest.mark.parametrize("sample_time, longest", [(1e-5, 0.05), (1e-3, 0.05), (1.0, 50.0)])
def test_clocks_may_disagree_by_a_twentieth_of_a_second_and_slow_ones_by_fifty_samples(sample_time, longest):
    clock = suspected(sample_time / H)["clock_offset", "recording:all"]
    assert clock.bounds(clock.law.amplitude(), clock.channel_on(AXIS)) == pytest.approx((0.0, longest))


@pytest.mark.parametrize("duration, slowest", [(0.025, 50.0), (0.09, 16.7), (10.0, 10.0)])
def test_what_takes_longer_than_the_records_for_a_period_is_no_vibration(duration, slowest):
    hum = suspected(1.0)["vibration", "disturbance:axis"]
    starts = hum.shapes(hum.channel_on(AXIS), replace(hints(1.0), duration=duration))
    assert min(start["frequency"] for start in starts) == slowest


CAUSES = {
    "low_pass": (lambda u: amplifier_lag(u, None), {"low_pass", "amplifier_lag"}),
    "resonance": (lambda u: move(u, ringing, fine=20), {"resonance"}),
    "creep": (lambda u: creeping(move(u), u), {"creep", "log_creep"}),
    "drift": (move, {"drift"}),
}


def machine(cause: str, pace: float):
    """The axis and its recording, `pace` times as slow."""
    device = with_numbers(AXIS, {"mechanics.mass": M * pace**2, "mechanics.damping": C * pace})
    n, rng, parts = 2500, np.random.default_rng(5), []
    held = 1.2 * np.sin(2 * np.pi * 1.7 * np.arange(n) * H)
    for role, u in (("fit", drive(n)), ("hold_out", held)):
        u = u + sum(0.2 * np.sin(2 * np.pi * f * np.arange(n) * H) for f in (97, 151, 173))
        since = len(parts) * n + np.arange(n)
        y = CAUSES[cause][0](u) + NOISE * rng.standard_normal(n) + (2e-10 * since if cause == "drift" else 0.0)
        parts.append(record(u, y, role, first=len(parts) * n * H * pace, h=H * pace))
    return device, Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


@pytest.mark.long
@pytest.mark.parametrize(
    "cause", [pytest.param("low_pass", marks=pytest.mark.exhaustive), "resonance", "creep", "drift"]
)
def test_a_finding_is_the_same_a_hundred_times_as_fast_and_as_slow(cause):
    """Its numbers go with the pace, to a tenth of their intervals."""
    told = {}
    for pace in (1e-2, 1.0, 1e2):
        device, recording = machine(cause, pace)
        found = diagnose_recording(device, recording, jobs=0)
        first = found.findings[0]
        assert found.verdict is not Verdict.UNEXPLAINED and first.effect in CAUSES[cause][1], (pace, first.effect)
        told[pace] = first
    for pace, first in told.items():
        assert first.parameters.keys() == told[1.0].parameters.keys()
        for name, number in first.parameters.items():
            law = Effect.library[first.effect]
            power = POWER.get(next(p.unit for p in law.params if p.name == name), 0)
            si, usual = (to_si(x.value, x.unit) for x in (number, told[1.0].parameters[name]))
            low, high = (to_si(x, told[1.0].parameters[name].unit) for x in told[1.0].parameters[name].ci95)
            assert abs(si / pace**power - usual) <= 0.1 * (high - low) + 1e-3 * abs(usual), (pace, name)
