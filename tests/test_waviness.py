"""A wavy guide: one reading repeats along the way of another axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import record
from xy_stage import xy_stage

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.recordings.recording import Recording

UM, H, N = 1e-6, 1e-3, 3000
NOISE = 5e-9
STAGE = xy_stage("0.5", "200 V")
NAMES = ("reading.delta_x", "reading.delta_y")


def recorded(across, n=N, seed=3):
    """A record to fit and one held out of other moves; `across` (x, y) [m] -> what x and y read too much [m]."""
    rng, parts, t = np.random.default_rng(seed), [], H * np.arange(n)
    for role, (f, g) in (("fit", (0.41, 0.73)), ("hold_out", (0.57, 0.31))):
        u = 100 + 80 * np.column_stack([np.sin(2 * np.pi * f * t), np.sin(2 * np.pi * g * t + 1)])
        x, y = 0.5 * UM * u.T
        read = np.column_stack([x, y]) + np.column_stack(across(x, y)) + NOISE * rng.standard_normal((n, 2))
        parts.append(replace(record(u, read, role), name=role))
    return Recording("t", STAGE.name, "series", NAMES, ("um", "um"), (NOISE, NOISE), tuple(parts), ())


def wave(way, size, period, phase=0.7):
    return size * UM * np.sin(2 * np.pi * way / (period * UM) + phase)


@pytest.mark.parametrize("period, size", [(40.0, 0.35), (7.3, 0.05)])
@pytest.mark.parametrize("bent", [0, 1])
def test_a_wave_along_the_other_axis_is_found_with_its_period(period, size, bent):
    of_y = recorded(lambda x, y: (0 * x, wave(x, size, period)))
    of_x = recorded(lambda x, y: (wave(y, size, period), 0 * y))
    found = diagnose_recording(STAGE, of_y if bent else of_x, jobs=0)
    (finding,) = found.findings
    assert (finding.effect, finding.location, finding.cause.of) == (
        "waviness",
        f"sensor:delta_{'xy'[bent]}",
        f"delta_{'yx'[bent]}",
    )
    assert finding.parameters["period"].value == pytest.approx(period, rel=2e-3)
    assert abs(finding.parameters["amplitude"].value) == pytest.approx(size, rel=0.02)
    assert found.verdict == "explained"
    assert all(e.rms_after == pytest.approx(NOISE / UM, rel=0.1) for e in found.held_out.values())


def test_readings_in_units_of_their_own_show_the_wave_too():
    along = recorded(lambda x, y: (0 * x, wave(x, 0.35, 40.0)))
    (finding,) = diagnose_recording(STAGE, replace(along, units=("um", "nm")), jobs=0).findings
    assert finding.effect == "waviness"
    assert {name: e.unit for name, e in finding.parameters.items()} == {
        "amplitude": "nm",
        "period": "um",
        "phase": "deg",
    }


@pytest.mark.long
def test_two_waves_of_a_guide_are_one_finding_of_two_terms():
    found = diagnose_recording(
        STAGE, recorded(lambda x, y: (0 * x, wave(x, 0.3, 40.0) + wave(x, 0.1, 13.0, 0.2))), jobs=0
    )
    (finding,) = found.findings
    periods = sorted(p["period"].value for p in (finding.parameters, *finding.terms))
    assert finding.effect == "waviness" and periods == pytest.approx([13.0, 40.0], rel=5e-3)


def test_what_repeats_along_its_own_way_or_bends_once_is_none():
    fringes = diagnose_recording(STAGE, recorded(lambda x, y: (wave(x, 0.1, 9.0), 0 * y)), jobs=0)
    assert {f.effect for f in fringes.findings} <= {"cyclic", "cyclic_from_home"} and fringes.findings
    bend = diagnose_recording(STAGE, recorded(lambda x, y: (0 * x, -2e-4 / UM * (x - 50 * UM) ** 2)), jobs=0)
    assert "waviness" not in {f.effect for f in bend.findings}
