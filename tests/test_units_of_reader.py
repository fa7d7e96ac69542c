"""What was recorded in millimetres is told in millimetres, in every sentence, table and file of a diagnosis."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from axis_records import AXIS, axis_fitter
from conftest import SCENARIOS

from ctrlgen import build_model, diagnose, load_device
from ctrlgen.core.units import to_si
from ctrlgen.devices.reported_units import derived_unit, in_units_of
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.narrative import interval
from ctrlgen.diagnosis.report.writeback import next_text
from ctrlgen.diagnosis.selection.findings import Estimate
from ctrlgen.reporting.numbers import sized, with_unit
from ctrlgen.reporting.result_file import json_text


def test_a_size_is_told_in_the_unit_in_which_it_is_read_best():
    """Times by their size, quotients without a power of ten; readings and what is plain as they are."""
    assert interval(Estimate(6085.0, (6050.0, 6119.0), "ms")) == "6.085 s (6.05 ... 6.119 s)"
    assert interval(Estimate(0.0123, (0.0121, 0.0125), "s")) == "12.3 ms (12.1 ... 12.5 ms)"
    assert interval(Estimate(3.63e-10, (3.4e-10, 3.8e-10), "N/um^3")) == "363 pN/um^3 (340 ... 380 pN/um^3)"
    assert interval(Estimate(0.2857, (0.2852, 0.2863), "1")) == "28.57 % (28.52 ... 28.63 %)"
    assert interval(Estimate(0.2857, (0.2852, 0.2863), "1"), "exponent") == "0.2857 (0.2852 ... 0.2863)"
    assert (with_unit(999.6, "ms", 3), with_unit(999.4, "ms", 3)) == ("1 s", "999 ms")  # not 1000 ms
    assert with_unit(-1.26e-7, "(N*m)/urad", 3) == "-126 (nN*m)/urad" and with_unit(2.5e9, "N/m") == "2.5 GN/m"
    assert with_unit(0.0, "ms") == "0 ms" and with_unit(-3e-7, "s") == "-0.3 us" and with_unit(0.5, "1") == "0.5"
    for unit in ("mm", "um", "deg", "V", "N", "1/K^2", "rad/s", "min"):
        assert sized(unit, 2.5e-7) == (unit, 1.0)
    for unit, size in (("ms", 6085.0), ("s", 2e-5), ("N/um^3", 3e-10), ("V/(m/s)", 4e7), ("(N*m)/rad", 3e-5)):
        best, factor = sized(unit, size)
        assert to_si(factor * size, best) == pytest.approx(to_si(size, unit), rel=1e-12)


def told(units: str, drives: str):
    """The diagnosis of an axis with a cubic spring, whose columns are in these units."""
    fitter = axis_fitter(lambda t, q, v, memory: (-2e10 * q**3, memory), n=1200)
    recording = replace(fitter.recording, units=(units,), drive_units=(drives,))
    return diagnose(AXIS, recording, laws=["stiffening", "backlash"], jobs=0)


@pytest.fixture(scope="module")
def both():
    return told("um", "V"), told("mm", "mV")


@pytest.mark.long
def test_only_the_units_differ(both):
    """Every number is the same in SI: no threshold, start or bound of the search is in the reader's units."""
    fine, coarse = both
    assert fine.verdict == coarse.verdict and len(fine.findings) == len(coarse.findings) == 1
    for name, value in fine.findings[0].parameters.items():
        other = coarse.findings[0].parameters[name]
        assert (value.unit, other.unit) == ("N/um^3", "N/mm^3")
        assert to_si(other.value, other.unit) == pytest.approx(to_si(value.value, value.unit), rel=1e-6)
    for channel, error in fine.held_out.items():
        assert coarse.held_out[channel].rms_after == pytest.approx(1e-3 * error.rms_after, rel=1e-6)


@pytest.mark.long
def test_nothing_is_told_in_a_unit_that_no_column_has(both):
    found, origin = both[1], Provenance({}, 0)
    report = page(found, origin)  # with its figures, whose texts stand in the SVG
    for text in (json_text(diagnosis_record(found, origin)), sentence(found), report):
        assert not re.search(r"(?<!N/)\b(um|µm)\b", text)  # the stiffness of the device file is in N/um
    assert " mm" in sentence(found) and "axis [mm]<" in report


@pytest.mark.long
def test_the_corrected_device_can_be_read_and_is_the_same(both, tmp_path):
    original = (SCENARIOS / "devices" / "flexure_axis.toml").read_text()
    k3 = []
    for found in both:
        (tmp_path / "next.toml").write_text(next_text(found, original))
        (effect,) = load_device(tmp_path / "next.toml").effect
        k3.append(effect.values["k3"])
    assert "mm^3" in k3[1].text and "um^3" in k3[0].text
    assert k3[1].si == pytest.approx(k3[0].si, rel=1e-6)


def test_a_signal_without_a_column_is_told_like_those_with_one():
    """A test machine's motion in inches and inches a second, its force in kip."""
    device = load_device(SCENARIOS / "friction_damper" / "device.toml")
    physics = device.physics(device.values())
    told = in_units_of(physics, {"drive.velocity": "in/s", "reading.force": "kip"})
    assert (told.travel_unit, told.force_unit, told.pose_units) == ("in", "kip", ("kip",))
    assert told.drive.units == ("in", "in/s", physics.drive.units[2])
    assert in_units_of(physics, {"reading.force": "V"}).pose_units == physics.pose_units  # of another dimension


def test_the_unit_of_a_derivative():
    assert (derived_unit("mm", 1), derived_unit("mm/s", -1), derived_unit("mm", 2)) == ("mm/s", "mm", "mm/s^2")


def test_a_device_told_otherwise_is_the_same_device():
    told = AXIS.told_in({"reading.axis": "mm"})
    assert build_model(told).signals["reading"].units == ("mm",)
    assert build_model(AXIS).signals["reading"].units == ("um",)
    assert told.model_copy(update={"effect": ()}).told_physics(told.values()).pose_units == ("mm",)
