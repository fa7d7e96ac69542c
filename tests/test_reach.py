"""Where drives take their axes: sizes and units that cannot be meant, stress on the way, and what buckles before."""

from __future__ import annotations

import re

import numpy as np
import pytest
from mechanism_files import HEAD, PARALLELOGRAM, SILICON, blade, dm, loaded

from ctrlgen import InputError, build_model, load_scenario, solve
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.reach import buckling_remarks, reach_lines, reach_remarks, reaches
from ctrlgen.physics.beam_column import Column, Piece

E = 130e9
ACTUATOR = (
    '[[actuator]]\nname = "{name}"\nkind = "force"\non = "{on}"\nat = [{at}]\nalong = [{along}]\ngain = "1 N/V"\nlow = "{low} V"\n'
    'high = "{high} V"\ntravel = "{travel}"\n'
)
COMPLIANCE = (
    '[[element]]\nkind = "compliance"\nname = "{}"\nfrom = "ground"\nto = "{}"\nat = ["0 mm", "0 mm", "{} mm"]\nalong = [0, 0, 1]\n'
    "across = [0, 1, 0]\n"
)


@pytest.mark.parametrize(
    "old, new",
    [
        ('length = "20 mm"', 'length = "20 m"'),
        ('thickness = "0.2 mm"', 'thickness = "0.2 um"'),
        ('young = "130 GPa"', 'young = "130000 GPa"'),
        ('young = "130 GPa"', 'young = "130 kPa"'),
        ("across = [-1, 0, 0]", "across = [0, 0, 1]"),
        ('gain = "2 N/A"', 'gain = "2 mN/A"'),
        ('gain = "2 N/A"', 'gain = "2 MN/A"'),
        ('travel = "300 um"', 'travel = "300 mm"'),
    ],
)
def test_a_unit_that_is_a_thousand_off_and_a_blade_about_its_stiff_axis_are_told(tmp_path, old, new):
    assert not reach_remarks(loaded(tmp_path, PARALLELOGRAM))
    device = loaded(tmp_path, PARALLELOGRAM.replace(old, new))
    assert reach_remarks(device) and set(reach_remarks(device)) <= set(device.remarks())


def test_the_way_of_a_guided_stage_is_that_of_its_drive_and_its_stress(tmp_path):
    """2 N on 24 EI/l^3, and 3 E t y/l^2 at its ends."""
    text = PARALLELOGRAM.replace('gain = "2 N/A"', 'gain = "0.5 N/A"')
    device = loaded(tmp_path, text.replace('stress_limit = "300 MPa"', 'stress_limit = "30 MPa"'))
    stiffness = 24 * E * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3
    (r,), (line,) = reaches(nominal(device)), reach_lines(device)
    assert r.drive == pytest.approx((-0.5 / stiffness, 0.5 / stiffness), rel=1e-6) and r.ends == r.drive
    said = re.search(r"stress of silicon on it up to ([\d.]+) MPa of 30 MPa, its limit from -?([\d.]+) um on", line)
    per_travel = 3 * E * 0.2e-3 / 20e-3**2
    assert float(said[1]) * 1e6 == pytest.approx(per_travel * 0.5 / stiffness, rel=1e-3)
    assert float(said[2]) * 1e-6 == pytest.approx(30e6 / per_travel, rel=1e-3)


def pushed_by_a_rod(seed: int) -> tuple[str, float]:
    """A stage on two blades that a carriage on two others pushes by a wire; the wire's EI/l^2."""
    rng = np.random.default_rng(seed)
    length, thick = rng.uniform(25, 40), rng.uniform(0.1, 0.18)
    text = (
        HEAD
        + SILICON
        + '[[body]]\nname = "stage"\n[[body]]\nname = "carriage"\n'
        + blade("left", 0)
        + blade("right", 20)
    )
    for name, x in (("c_left", -60), ("c_right", -75)):
        text += blade(name, x).replace('to = "stage"', 'to = "carriage"').replace('"0.2 mm"', '"0.05 mm"')
    text += (
        f'[[element]]\nkind = "wire"\nslender = true\nname = "rod"\nfrom = "carriage"\nto = "stage"\nat = ["0 mm", "-10 mm", "0 mm"]\n'
        f'along = [1, 0, 0]\nlength = "{length} mm"\ndiameter = "{thick} mm"\nmaterial = "silicon"\n'
    )
    text += ACTUATOR.format(
        name="coil", on="carriage", at='"-60 mm", "-10 mm", "0 mm"', along="1, 0, 0", low=-50, high=50, travel="400 um"
    )
    text += '[output]\nbody = "stage"\nat = ["0 mm", "-10 mm", "0 mm"]\nchannels = ["delta_x"]\n'
    return text, E * np.pi * (thick * 1e-3) ** 4 / 64 / (length * 1e-3) ** 2


@pytest.mark.parametrize("seed", range(6))
def test_a_push_rod_that_buckles_is_told_with_its_load_and_where(tmp_path, seed):
    """At 4 pi^2 EI/l^2 between a stage and a carriage that hardly turn; a pull never."""
    text, unit = pushed_by_a_rod(seed)
    device = loaded(tmp_path, text)
    (said,) = buckling_remarks(device)
    where, name, press = re.search(r"from ([\d.]+) um on, .*: (\w+) is then pressed by ([\d.]+) N", said).groups()
    assert name == "rod" and float(press) == pytest.approx(4 * np.pi**2 * unit, rel=0.02)
    c = nominal(device)
    assert (
        dm(c.stiffness)[0, 0] * float(where) * 1e-6 >= float(press) * 0.98
    )  # what the carriage's blades take beside it
    W = dm(c.wrench(4))[:3, 0]
    assert np.linalg.norm(W) * float(where) * 1e-6 == pytest.approx(float(press), rel=1e-3)
    assert said in device.remarks() and said in device.range_remarks()
    pulled = loaded(tmp_path, text.replace('high = "50 V"', 'high = "0 V"'))
    assert not buckling_remarks(pulled)


def test_struts_whose_bases_are_moved_press_as_they_are_moved(tmp_path):
    """A wire that a stroke pushes up against a spring that does not turn: k x of both in series, and 4 pi^2 EI/l^2."""
    stiff = "".join(f'delta_{x}_per_F_{x} = "1e-4 um/N"\ntheta_{x}_per_M_{x} = "1e-4 rad/(N*m)"\n' for x in "xyz")
    text = HEAD + SILICON + '[[body]]\nname = "base"\n[[body]]\nname = "top"\n'
    text += COMPLIANCE.format("piezo", "base", 0) + stiff
    text += '[[element]]\nkind = "wire"\nslender = true\nname = "strut"\nfrom = "base"\nto = "top"\n'
    text += 'at = ["0 mm", "0 mm", "30 mm"]\nalong = [0, 0, 1]\nlength = "30 mm"\ndiameter = "0.2 mm"\nmaterial = "silicon"\n'
    soft = 'delta_x_per_F_x = "10 um/N"\n' + "".join(f'delta_{x}_per_F_{x} = "1e-3 um/N"\n' for x in "yz")
    soft += "".join(f'theta_{x}_per_M_{x} = "1e-3 rad/(N*m)"\n' for x in "xyz")
    text += COMPLIANCE.format("spring", "top", 30) + soft
    text += (
        '[[actuator]]\nname = "z"\nkind = "displacement"\non = "piezo"\nalong = [0, 0, 1]\ngain = "1 um/V"\nlow = "0 V"\nhigh = "40 V"\n'
        'travel = "40 um"\n[output]\nbody = "top"\nat = ["0 mm", "0 mm", "30 mm"]\nchannels = ["delta_z"]\n'
    )
    EI, EA = E * np.pi * 0.2e-3**4 / 64, E * np.pi * 0.2e-3**2 / 4
    series = 1 / (10e-6 + 30e-3 / EA + 1e-10)
    (said,) = buckling_remarks(loaded(tmp_path, text))
    where, press = (float(x) for x in re.search(r"from ([\d.]+) um on, .* pressed by ([\d.]+) N", said).groups())
    assert press == pytest.approx(series * where * 1e-6, rel=2e-3)
    assert press == pytest.approx(4 * np.pi**2 * EI / 30e-3**2, rel=0.01)
    assert press == pytest.approx(Column((Piece(30e-3, EI),)).buckling_load, rel=0.01)


def test_a_solution_tells_of_it(tmp_path):
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\npoints = 3\n[path]\nkind = "line"\nstart = { delta_x = "0 um" }\n'
        'end = { delta_x = "5 um" }\n'
    )
    device = loaded(tmp_path, pushed_by_a_rod(1)[0])
    left_out = solve(load_scenario(tmp_path), build_model(device)).left_out
    assert any("alone buckles the mechanism from" in sentence for sentence in left_out)


@pytest.mark.parametrize("direction", ["[1e200, 0, 0]", "[1e-200, 0, 0]", "[true, 0, 0]"])
@pytest.mark.parametrize("written", ["along = [0, 1, 0]", "along = [1, 0, 0]"])
def test_a_direction_whose_numbers_are_none_is_refused_where_it_stands(tmp_path, written, direction):
    """Of a blade and of an actuator; the squares of such numbers are infinite, or zero."""
    with pytest.raises(InputError, match=r"along"):
        loaded(tmp_path, PARALLELOGRAM.replace(written, f"along = {direction}"))
