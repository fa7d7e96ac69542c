"""Solve, generate, compare for devices and scenarios that the repository does not ship: nothing is tuned to the circle."""

from __future__ import annotations

import pytest
from conftest import DEVICE

from ctrlgen import run

EFFECTS = """
[[effect]]
kind = "creep"
at = "all"
gain = "0.03"
tau = "0.1 s"
slow = "0.2"

[[effect]]
kind = "heat_crosstalk"
at = "all"
share = "0.02"

[[effect]]
kind = "stiffening"
at = "2X"
k3 = "5e-8 N/um^3"

[[effect]]
kind = "frame_rotation_z"
at = "delta_y"
angle = "3 mrad"

"""
VOLTS = ('drive = "power"', 'drive = "voltage"')
WITH_EFFECTS = ("[hexapod]", EFFECTS + "[hexapod]")
CIRCLE = '[path]\nkind = "circle"\ndiameter = "{} um"\ncentre = {{ delta_z = "22 um" }}\n'

CASES = {
    "effects, closed path": (WITH_EFFECTS, 'sample_rate = "1 kHz"\nduration = "0.5 s"\n' + CIRCLE.format(12)),
    "effects, open path": (
        WITH_EFFECTS,
        'sample_rate = "500 Hz"\nduration = "1 s"\n'
        '[path]\nkind = "spiral"\nturns = 3\ndiameter = "12 um"\ncentre = { delta_z = "22 um" }\n',
    ),
    "effects, equilibria": (
        WITH_EFFECTS,
        '[path]\nkind = "poses"\npoints = [{ delta_z = "22 um" }, { delta_z = "28 um" }]\n',
    ),
    "driven in volts, heaters warming each other": (
        ('drive = "power"', 'drive = "voltage"\n\n[[effect]]\nkind = "heat_crosstalk"\nat = "1X"\nshare = "0.02"\n'),
        'sample_rate = "1 kHz"\nduration = "0.3 s"\n' + CIRCLE.format(10),
    ),
    "driven in volts": (VOLTS, 'sample_rate = "1 kHz"\nduration = "0.5 s"\n' + CIRCLE.format(18)),
    "samples longer than the time constant": (("", ""), 'sample_rate = "20 Hz"\nduration = "5 s"\n' + CIRCLE.format(8)),
    "samples much shorter than the time constant": (
        ("", ""),
        'sample_rate = "20 kHz"\nduration = "0.05 s"\n' + CIRCLE.format(1),
    ),
    "from home": (
        ("", ""),
        'sample_rate = "1 kHz"\nduration = "0.3 s"\n[path]\nkind = "line"\nend = { delta_z = "25 um" }\n',
    ),
    "stages to the end of their stroke": (
        ("", ""),
        'sample_rate = "1 kHz"\nduration = "0.3 s"\nfollow = "displacement"\n'
        '[path]\nkind = "line"\nend = { 1X = "55 um", 2Y = "40 um" }\n',
    ),
    "a coarser device": (
        ('"0.051577 N/um"', '"0.02 N/um"'),
        'sample_rate = "1 kHz"\nduration = "0.3 s"\n' + CIRCLE.format(6),
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_the_whole_chain_holds(name, tmp_path, compiler):
    edit, text = CASES[name]
    device = DEVICE.read_text()
    assert edit[0] in device
    (tmp_path / "device.toml").write_text(device.replace(*edit, 1) if edit[0] else device)
    folder = tmp_path / f"Case: {name[:30]}"  # not a C identifier, on purpose
    folder.mkdir()
    (folder / "scenario.toml").write_text(f'title = "{name}"\ndevice = "../device.toml"\n{text}')
    outcome = run(folder, tmp_path / "out")
    assert outcome.passed, [row for row in outcome.comparison.rows if not row.passed]
    assert all(
        margin.distance >= -1e-7 * max(abs(margin.bound), abs(margin.value)) for margin in outcome.solution.margins
    )
