"""Readings whose zero or drift is another in each record, or that jump in one of them, as of a sensor that is zeroed before every run."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, move, record

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.report.answer import answer
from ctrlgen.diagnosis.report.explain import explain
from ctrlgen.diagnosis.report.luck_sentences import luck_text
from ctrlgen.diagnosis.selection.of_each_record import Left, may_differ, of_one_step, told_in_records
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

UM = 1e-6
LAWS = ("zero_per_record", "home_offset", "drift", "coulomb", "drive_offset", "stiffening", "hysteresis")
ROLES = ("fit", "hold_out", "hold_out")


def runs(zeros, roles=ROLES, law=None, n=1000, change=lambda y, t: y, noise=NOISE):
    """Runs of the axis under different drives, which read so far off [m]; `change` (position, time on the common clock)."""
    rng, parts = np.random.default_rng(1), []
    for k, (zero, role) in enumerate(zip(zeros, roles, strict=True)):
        t = np.arange(n) * H
        u = 1.2 * np.sin(2 * np.pi * (1.7 + 0.6 * k) * t) + 0.4 * np.sin(2 * np.pi * (11 + 3 * k) * t + k)
        y = change(move(u, law), t + 3.0 * k) + zero + NOISE * rng.standard_normal(n)
        parts.append(replace(record(u, y, role, first=3.0 * k), name=f"run_{k}.csv"))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (noise,), tuple(parts), ())


def diagnosed(recording, device=AXIS):
    return diagnose_recording(device, recording, jobs=0, laws=LAWS)


def effects(found):
    return [f.effect for f in found.findings]


@pytest.mark.parametrize(
    "zeros, roles",
    [
        ((0, 0.5), ROLES[:2]),
        ((0.2, -0.3, 0.4), ROLES),
        ((0.2, -0.3, 0.4, -0.1), ("fit", "fit", "hold_out", "hold_out")),
    ],
)
def test_a_zero_that_is_another_in_each_record_is_found_with_its_values(zeros, roles):
    found = diagnosed(runs(UM * np.array(zeros), roles))
    (finding,) = found.findings
    assert finding.effect == "zero_per_record" and found.verdict == "explained"
    assert finding.share.value == pytest.approx(1.0, abs=0.01)
    assert len(finding.in_each_record) == len(zeros)
    for estimate, zero in zip(finding.in_each_record.values(), zeros, strict=True):
        low, high = estimate.ci95
        assert estimate.unit == "um" and low < zero < high and high - low < 0.01
    assert found.held_out["reading.axis"].rms_after == pytest.approx(NOISE / UM, rel=0.1)
    told = re.findall(r"(\S+) um \([^)]*\) in ", answer(found)[0])
    assert [float(x) for x in told] == pytest.approx([min(zeros), max(zeros)], abs=0.001)
    assert "no other one can confirm it" in luck_text(finding)


def test_friction_beside_such_zeros_is_found_with_its_force():
    found = diagnosed(
        runs(UM * np.array([0.2, -0.3, 0.4]), law=lambda t, q, v, memory: (-0.05 * np.tanh(v / 1e-5), memory))
    )
    assert set(effects(found)) == {"coulomb", "zero_per_record"}
    (friction,) = [f for f in found.findings if f.effect == "coulomb"]
    assert friction.parameters["force"].value == pytest.approx(0.05, rel=0.05)


def test_what_is_the_same_in_all_records_or_goes_on_in_time_is_no_zero_of_each():
    (constant,) = effects(diagnosed(runs([0.3 * UM] * 3)))
    assert constant in ("home_offset", "drive_offset")
    drifting = diagnosed(runs([0.0] * 3, change=lambda y, t: y + 0.1 * UM * t))
    assert effects(drifting) == ["drift"]


def test_nothing_is_found_where_nothing_differs():
    found = diagnosed(runs([0.0] * 3))
    assert found.verdict == "consistent" and not found.findings


def test_a_zero_that_the_file_leaves_free_is_not_found_again():
    loose = validate(
        type(AXIS),
        AXIS.model_dump(mode="json") | {"effect": [{"kind": "zero_per_record", "at": "axis", "share": 1}]},
        "d",
    )
    found = diagnosed(runs(UM * np.array([0.2, -0.3, 0.4])), loose)
    assert found.verdict == "consistent" and not found.findings
    assert explain(found, "zero_per_record")[0].endswith("the device file has it wherever it was recorded.")


def test_it_is_told_why_such_zeros_were_not_tried():
    (said,) = explain(diagnosed(runs([0.2 * UM] * 2, ROLES[:2])), "zero_per_record")
    assert said.endswith("never could it take away 50 % of what was left of its reading.")


def test_readings_of_which_one_ends_in_the_name_of_the_other_keep_their_zeros_apart():
    """Two tested axes, whose forces are read with another zero in each run: 5 and -3 N, 1 and 2 N."""
    numbers = {
        "mass": "1 kg",
        "damping": "0 N*s/m",
        "stiffness": "0 N/m",
        "stroke": "1 m",
        "speed": "9 m/s",
        "force": "99 N",
    }
    axes = [{"name": name, **numbers} for name in ("x", "a_x")]
    table = {"kind": "tested_axes", "name": "bench", "title": "a bench", "source": "round numbers", "axis": axes}
    device, rng, parts = validate(Device.library["tested_axes"], table, "device"), np.random.default_rng(3), []
    for zeros, role in (((5.0, 1.0), "fit"), ((-3.0, 2.0), "hold_out")):
        motion = 0.1 * rng.standard_normal((200, 6))
        accelerations = motion[:, 4:]
        parts.append(record(motion, accelerations + zeros + 0.01 * rng.standard_normal((200, 2)), role))
    names = ("reading.x", "reading.a_x")
    recording = Recording("t", "bench", "series", names, ("N", "N"), (0.01, 0.01), tuple(parts), ())
    fitter, structure = Fitter(recording, estimate_noise(recording, 0.0)), Structure(device)
    causes = [Hypothesis("zero_per_record", f"sensor:{at}", at) for at in ("x", "a_x")]
    for cause in causes:
        structure = structure.with_cause(cause, {"share": 1.0})
    fit = fitter.fit(structure)
    told = [told_in_records(fitter, fit, cause) for cause in causes]
    assert [value for zeros in told for value, _ in zeros.values()] == pytest.approx([5.0, -3.0, 1.0, 2.0], abs=0.01)


def test_the_parts_of_one_file_have_one_zero():
    """Two halves of a run that differ by half a micrometre hold a jump, and no sensor that was zeroed in between."""
    whole = runs(UM * np.array([0.0, 0.5]), ROLES[:2])
    one, two = (
        replace(whole, records=tuple(replace(r, file=file) for r, file in zip(whole.records, files, strict=True)))
        for files in (("day_1.csv", "day_1.csv"), ("day_1.csv", "day_2.csv"))
    )
    zero, jump = (Hypothesis(f"{law}_per_record", "sensor:axis", "axis") for law in ("zero", "sensor_step"))
    assert not may_differ(zero, one) and may_differ(zero, two)
    assert may_differ(jump, one)
    of_one = diagnosed(one)
    assert "zero_per_record" not in effects(of_one) and effects(diagnosed(two)) == ["zero_per_record"]
    assert explain(of_one, "zero_per_record")[0].endswith("another one in each run, and one run alone was recorded.")


RATES = (0.3, -0.5, 0.2, 0.7)  # um/s
FOUR = ("fit", "fit", "hold_out", "hold_out")
OWN = (
    "drift_per_record",
    "zero_per_record",
    "sensor_step_per_record",
    "sensor_step",
    "drift",
    "warm_up",
    "home_offset",
)
OWN_AND_OTHERS = (*OWN, "cyclic", "creep", "coulomb", "stiffening", "thermal_lag")


def in_run(k, change, else_=lambda y, s: y):
    """A change of run k alone (all: None), by the position and the time since it began."""
    return lambda y, t: (change if k is None or round(t[0] / 3.0) == k else else_)(y, t - t[0])


def drifting(y, t):
    k = round(t[0] / 3.0)
    return y + UM * RATES[k] * (t - t[0])


def on_their_own_clocks(recording):
    """Files that begin at zero each, as most loggers write them."""
    return replace(recording, records=tuple(replace(r, time=r.time - r.time[0]) for r in recording.records))


def jump(at, size=0.4):
    return lambda y, s: y + size * UM * (s > at)


@pytest.mark.parametrize("clocks", [lambda r: r, on_their_own_clocks])
def test_a_drift_that_is_another_in_each_record_is_found_with_its_rates(clocks):
    found = diagnose_recording(
        AXIS, clocks(runs([0.0, 0.1 * UM, -0.2 * UM, 0.0], FOUR, change=drifting)), jobs=0, laws=OWN
    )
    (finding,) = found.findings
    assert finding.effect == "drift_per_record" and found.verdict == "explained"
    for estimate, rate in zip(finding.in_each_record.values(), RATES, strict=True):
        low, high = estimate.ci95
        assert estimate.unit == "um/s" and low < rate < high and high - low < 0.01
    assert found.held_out["reading.axis"].rms_after == pytest.approx(NOISE / UM, rel=0.1)
    assert "drift in run_1.csv" in [name for name, _ in finding.numbers]


@pytest.mark.parametrize("clocks", [lambda r: r, on_their_own_clocks])
def test_a_jump_in_one_record_to_fit_is_found_with_its_moment_and_size(clocks):
    recording = clocks(runs([0.0] * 4, FOUR, change=in_run(1, jump(0.4127))))
    found = diagnose_recording(AXIS, recording, jobs=0, laws=OWN)
    (finding,) = found.findings
    assert finding.effect == "sensor_step_per_record" and found.verdict == "explained"
    sizes = {name: e.value for name, e in finding.in_each_record.items()}
    assert sizes.pop("run_1.csv") == pytest.approx(0.4, abs=0.002)
    assert np.max(np.abs(list(sizes.values()))) < 0.002
    moment = finding.parameters["moment"]
    begin = recording.records[1].time[0]
    assert moment.value == pytest.approx(begin + 0.4127, abs=H)
    assert "in run_1.csv, at " in answer(found)[0]


def test_a_jump_in_a_held_out_record_is_found_with_its_size():
    recording = on_their_own_clocks(runs([0.0] * 4, FOUR, change=in_run(2, jump(0.4127, -0.3))))
    found = diagnose_recording(AXIS, recording, jobs=0, laws=OWN)
    (finding,) = found.findings
    assert finding.effect == "sensor_step_per_record"
    assert finding.in_each_record["run_2.csv"].value == pytest.approx(-0.3, abs=0.002)
    assert finding.parameters["moment"].value == pytest.approx(0.4127, abs=H)
    assert found.held_out["reading.axis"].rms_after == pytest.approx(NOISE / UM, rel=0.1)


@pytest.mark.parametrize("where", ["fit", "hold_out", "both"])
def test_jumps_in_parts_of_one_file_are_found_wherever_they_are(where):
    """0.4 um in the part to fit go on in the other one, which tells them too; what jumps in the last part alone is fitted there."""
    n, rng = 2000, np.random.default_rng(2)
    t = np.arange(2 * n) * H
    u = 1.2 * np.sin(2 * np.pi * 1.7 * t) + 0.4 * np.sin(2 * np.pi * 11 * t)
    early, late = 0.4 * UM * (t > 0.9), -0.25 * UM * (t > 3.1)
    y = move(u) + (where != "hold_out") * early + (where != "fit") * late + NOISE * rng.standard_normal(2 * n)
    parts = [
        replace(record(u[a:b], y[a:b], role, first=t[a]), file="log.csv", name=f"rows {a} to {b}", resumed=a > 0)
        for a, b, role in ((0, n, "fit"), (n, 2 * n, "hold_out"))
    ]
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())
    found = diagnose_recording(AXIS, recording, jobs=0, laws=OWN)
    told = {f.effect: f for f in found.findings}
    laws = {
        "fit": {"sensor_step"},
        "hold_out": {"sensor_step_per_record"},
        "both": {"sensor_step", "sensor_step_per_record"},
    }
    assert set(told) == laws[where] and found.verdict == "explained"
    if where != "fit":
        ((record_name, size),) = told["sensor_step_per_record"].in_each_record.items()
        assert record_name == "rows 2000 to 4000" and size.value == pytest.approx(-0.25, abs=0.002)
    if where != "hold_out":
        assert told["sensor_step"].parameters["offset"].value == pytest.approx(0.4, abs=0.002)
    assert found.held_out["reading.axis"].rms_after == pytest.approx(NOISE / UM, rel=0.1)


@pytest.mark.long
@pytest.mark.parametrize("seen", [drifting, in_run(0, jump(0.31))])
def test_a_pitch_beside_what_is_another_in_each_record_is_found(seen):
    def change(y, t):
        moved = seen(y, t)
        return moved + 0.05 * UM * np.sin(2 * np.pi * (moved if seen is drifting else y) / (2.5 * UM))

    found = diagnose_recording(
        AXIS, on_their_own_clocks(runs([0.0] * 4, FOUR, change=change)), jobs=0, laws=OWN_AND_OTHERS
    )
    assert set(effects(found)) == {"cyclic", "drift_per_record" if seen is drifting else "sensor_step_per_record"}
    (pitch,) = [f for f in found.findings if f.effect == "cyclic"]
    assert pitch.parameters["period"].value == pytest.approx(2.5, rel=1e-3)


def test_a_drift_or_a_jump_of_all_records_is_none_of_each():
    steady = runs([0.0] * 4, FOUR, change=in_run(None, lambda y, s: y + 0.3 * UM * s))
    assert effects(diagnose_recording(AXIS, on_their_own_clocks(steady), jobs=0, laws=OWN)) == ["drift"]
    alike = runs([0.0] * 4, FOUR, change=in_run(None, jump(0.4127)))
    assert effects(diagnose_recording(AXIS, on_their_own_clocks(alike), jobs=0, laws=OWN)) == ["sensor_step"]


@pytest.mark.long
def test_a_stage_that_creeps_is_no_drift_of_each_record():
    """What creeps goes on in each record, at another rate in each."""

    def change(y, t):
        crept = np.zeros_like(y)
        for k in range(1, len(y)):
            crept[k] = crept[k - 1] + (y[k] - crept[k - 1]) * H / 0.8
        return y + 0.1 * crept

    found = diagnose_recording(AXIS, runs([0.0] * 4, FOUR, change=change), jobs=0, laws=OWN_AND_OTHERS)
    assert not {"drift_per_record", "sensor_step_per_record", "zero_per_record"} & set(effects(found))


def test_what_comes_slowly_is_no_jump():
    """A sine of one period in a run is taken away by a step to four fifths, and shows a sixth of it at once."""
    t = np.arange(1000) * H
    for slow, jumps in ((np.sin(2 * np.pi * t), False), (np.sign(t - 0.4127), True), (np.tanh((t - 0.4) / 0.1), False)):
        part = of_one_step([Left(t, 0 * t, 0.0), Left(t, slow, 0.0)])
        assert (part.share > 0) is jumps
    assert part.numbers == {}
