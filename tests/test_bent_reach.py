"""How far a drive takes its axis where flexures stretch, beside corotational beams and the theory of beam-columns."""

from __future__ import annotations

import re

import numpy as np
import pytest
from held_blades import EI, STIFFENS, L, T, W, frame_of, held, stretched
from mechanism_files import PARALLELOGRAM, loaded, pushed

from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.reach import reach_lines, reach_remarks, reaches

K = 2 * 12 * EI / L**3  # of the stage between both blades


def driven(*, force: float, travel: float, stiffens: bool, limit: float = 1e4) -> str:
    text = held() if stiffens else held().replace(STIFFENS, "")
    text = text.replace('gain = "2 N/A"', f'gain = "{force!r} N/A"').replace(
        'travel = "300 um"', f'travel = "{travel * 1e6!r} um"'
    )
    return text.replace('stress_limit = "300 MPa"', f'stress_limit = "{limit} MPa"')


@pytest.mark.parametrize("thicknesses", [0.3, 1.0, 2.0, 4.0])
def test_a_drive_takes_a_stage_between_held_blades_as_far_as_beam_columns_let_it(tmp_path, thicknesses):
    """Where the file states the stretching, and beside the linear reach where it does not; the stress there too."""
    y = thicknesses * T
    force = 2 * stretched(y)
    straight = force / K
    stated = loaded(tmp_path, driven(force=force, travel=1.2 * straight, stiffens=True))
    (r,) = reaches(nominal(stated))
    assert r.drive == pytest.approx((-y, y), rel=0.005)
    frame, (push, *_) = frame_of(nominal(stated), (0.0, 0.0))
    _, _, loads = frame.moved(push, y)
    of_blades = [load for load, beam in zip(loads, frame.beams, strict=True) if beam[3] == EI]
    worst = max(abs(N) / (T * W) + max(abs(a), abs(b)) / (W * T**2 / 6) for N, a, b in of_blades)
    silent = loaded(tmp_path, driven(force=force, travel=1.2 * straight, stiffens=False))
    ((line,), (drive,)) = reach_lines(silent), reaches(nominal(silent))
    assert drive.drive == pytest.approx((-straight, straight), rel=1e-6)
    if straight < 1.05 * y:
        assert "stretch" not in line and not reach_remarks(silent)
        return
    tail = line.partition("with flexures that stretch")[2]
    told = float(re.search(r"to ([\d.]+) um", tail)[1]) * 1e-6
    assert told == pytest.approx(y, rel=0.005)
    if stress := re.search(r"up to ([\d.]+) MPa", tail):
        assert float(stress[1]) * 1e6 == pytest.approx(worst, rel=0.02)
    assert stress or thicknesses == 0.3
    assert any("goes less far" in remark for remark in reach_remarks(silent))


def test_a_stress_limit_that_stretching_passes_is_told(tmp_path):
    """At twice the thickness bending alone is half of the stress; a longer travel is not asked for."""
    y = 2 * T
    linear = 3 * 130e9 * T * y / L**2 / 1e6
    text = driven(force=20 * K * y, travel=y, stiffens=False, limit=1.1 * linear)
    assert any("goes less far" in remark for remark in reach_remarks(loaded(tmp_path, text)))
    text = driven(force=20 * K * y, travel=y, stiffens=False, limit=3 * linear)
    assert not any("goes less far" in remark for remark in reach_remarks(loaded(tmp_path, text)))


def two_drives(places, forces, travel: float) -> str:
    """The stage between held blades, pushed at two places along y by drives of their own."""
    text, (before, after) = held(), PARALLELOGRAM.split("[[actuator]]")
    text = text.split("[[actuator]]")[0]
    for k, (y, force) in enumerate(zip(places, forces, strict=True)):
        drive = pushed(
            "stage",
            f"coil{k}",
            f"{y * 1e3!r} mm",
            gain=f"{force!r} N/A",
            ends=("-1 A", "1 A"),
            travel=f"{travel * 1e6!r} um",
        )
        text += drive.partition("[output]")[0]
    output = "[output]" + after.partition("[output]")[2]
    assert before
    return text + re.sub(r"channels = .*", 'channels = ["delta_x", "theta_z"]', output)


@pytest.mark.parametrize("seed", range(4))
def test_the_way_of_one_of_two_drives_is_that_of_corotational_beams(tmp_path, seed):
    """The other axis is free: the stage turns as well, and the blades stretch as they can."""
    rng = np.random.default_rng(seed)
    places, aim = (float(rng.uniform(1e-3, 9e-3)), -float(rng.uniform(1e-3, 9e-3))), T * float(rng.uniform(0.5, 2))
    forces = [0.0, 0.0]
    c = nominal(loaded(tmp_path, two_drives(places, (1.0, 1.0), 1e-3)))
    frame, (one, other, *_) = frame_of(c, *[(0.0, y) for y in places], parts=12)
    for k, node in enumerate((one, other)):
        forces[k] = float(abs(frame.moved(node, aim)[0]))
    found = reaches(nominal(loaded(tmp_path, two_drives(places, forces, 5 * aim))))
    for r in found:
        assert r.drive == pytest.approx((-aim, aim), rel=0.02)
