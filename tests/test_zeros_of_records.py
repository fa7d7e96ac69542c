"""A reading whose zero is another in each record, as of a sensor that is zeroed anew before every run."""

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
from ctrlgen.diagnosis.selection.zeros_of_records import has_several_runs, zeros_in_records
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


def test_it_is_told_why_such_zeros_were_not_tried():
    (said,) = explain(diagnosed(runs([0.2 * UM] * 2, ROLES[:2])), "zero_per_record")
    assert said.endswith("never were such constants 50 % of what was left of its reading.")


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
    told = [zeros_in_records(fitter, fit, cause) for cause in causes]
    assert [value for zeros in told for value, _ in zeros.values()] == pytest.approx([5.0, -3.0, 1.0, 2.0], abs=0.01)


def test_the_parts_of_one_file_have_one_zero():
    """Two halves of a run that differ by half a micrometre hold a jump, and no sensor that was zeroed in between."""
    whole = runs(UM * np.array([0.0, 0.5]), ROLES[:2])
    one, two = (
        replace(whole, records=tuple(replace(r, file=file) for r, file in zip(whole.records, files, strict=True)))
        for files in (("day_1.csv", "day_1.csv"), ("day_1.csv", "day_2.csv"))
    )
    assert not has_several_runs(one) and has_several_runs(two)
    assert "zero_per_record" not in effects(diagnosed(one)) and effects(diagnosed(two)) == ["zero_per_record"]
