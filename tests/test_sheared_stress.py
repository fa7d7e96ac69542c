"""The stress inside of short flexures, where transverse shear is largest, beside statics and a parabola of shear."""

from __future__ import annotations

import re

import casadi as ca
import numpy as np
import pytest
from mechanism_files import HEAD, hinged, loaded, place

from ctrlgen.devices.mechanism.reach import reach_lines, reach_remarks
from ctrlgen.physics import flexure

E, T, TRAVEL = 100e9, 0.2e-3, 2e-6
INSIDE = re.compile(r"up to ([\d.]+) MPa of [\d.]+ MPa.*, inside of flexures ([\d.]+) MPa by transverse shear")
METAL = f'[[material]]\nname = "metal"\nyoung = "{E / 1e9} GPa"\npoisson = "0.3"\nstress_limit = "%s MPa"\n[[body]]\nname = "stage"\n'


def carried(length: float, section: str, force: float, limit: float) -> str:
    """A stage between two flexures along y, that a load in the middle of their length presses along z; its drive moves it along x."""
    text = HEAD + METAL % limit
    for k, x in enumerate((-20e-3, 20e-3)):
        text += (
            f'[[element]]\nname = "e{k}"\nslender = true\nfrom = "ground"\nto = "stage"\nat = {place((x, 0, 0))}\nalong = [0, 1, 0]\n'
            f'across = [1, 0, 0]\nlength = "{length!r} m"\nmaterial = "metal"\n{section}\n'
        )
    at = place((0, -length / 2, 0))
    text += f'[[load]]\nname = "weight"\non = "stage"\nat = {at}\nforce = ["0 N", "0 N", "{-force!r} N"]\n'
    return text + (
        f'[[actuator]]\nname = "coil"\nkind = "force"\non = "stage"\nat = {at}\nalong = [1, 0, 0]\ngain = "100 kN/V"\n'
        'low = "-1 V"\nhigh = "1 V"\n'
        f'travel = "{TRAVEL!r} m"\n[output]\nbody = "stage"\nat = {place((0, 0, 0))}\nchannels = ["delta_x"]\n'
    )


@pytest.mark.parametrize("seed", range(8))
def test_wide_short_blades_and_thick_wires_are_sheared_inside(tmp_path, seed):
    """V of each is half of the load, its bending V l/2 at the ends, that of the drive 3 E t d/l^2: the larger of corner and middle."""
    rng = np.random.default_rng(seed)
    length, force = float(rng.uniform(3e-3, 8e-3)), float(rng.uniform(50, 500))
    round_, wide = seed % 2, float(length * rng.uniform(0.2, 4))
    V, bends = force / 2, 3 * E * TRAVEL / length**2
    if round_:
        d = float(length * rng.uniform(0.2, 0.45))
        section, area = f'kind = "wire"\ndiameter = "{d!r} m"', np.pi * d**2 / 4
        outside = np.hypot(bends * d, V * length / 2 / (np.pi * d**3 / 32))
        inside = np.sqrt(3) * 4 / 3 * np.hypot(V, 12 * E * np.pi * d**4 / 64 / length**3 * TRAVEL) / area
    else:
        section, area = f'kind = "blade"\nthickness = "{T} m"\nwidth = "{wide!r} m"', T * wide
        outside = bends * T + V * length / 2 / (T * wide**2 / 6)
        inside = np.hypot(bends * T, np.sqrt(3) * 1.5 * V / area)
    (line,) = reach_lines(loaded(tmp_path, carried(length, section, force, 1e5)))
    told = INSIDE.search(line)
    if inside > 1.06 * outside:
        assert float(told[1]) * 1e6 == pytest.approx(outside, rel=0.01)
        assert float(told[2]) * 1e6 == pytest.approx(inside, rel=0.01)
        between = (inside + outside) / 2e6
        assert any(
            "inside of a short flexure" in x
            for x in reach_remarks(loaded(tmp_path, carried(length, section, force, between)))
        )
    elif inside < 1.04 * outside:
        assert told is None
    above = 1.1 * max(inside, outside) / 1e6
    assert not any(
        "inside of a short flexure" in x
        for x in reach_remarks(loaded(tmp_path, carried(length, section, force, above)))
    )


@pytest.mark.parametrize(
    ("section", "half_width"),
    [
        (flexure.sheared_circle, lambda z: np.sqrt(0.25 - z**2)),
        (flexure.sheared_rectangle, lambda z: np.full_like(z, 0.5)),
    ],
)
def test_the_shear_in_the_middle_of_a_section_is_that_of_the_force_above_it(section, half_width):
    """tau = V Q/(I b), Q the first moment of the area above the middle, I and b its second moment and width; sections one high, V = 1."""
    z = np.linspace(-0.5, 0.5, 20001)
    b, up = 2 * half_width(z), z >= 0
    area, second = np.trapezoid(b, z), np.trapezoid(b * z**2, z)
    tau = np.trapezoid((b * z)[up], z[up]) / (second * b[10000])
    none, mean = ca.DM(0.0), ca.DM(1 / area)
    for along in ((mean, none), (none, mean)):
        assert float(section((none, none, none), none, along)) == pytest.approx(np.sqrt(3) * tau, rel=1e-3)
    pulled = float(section((none, none, ca.DM(2.0)), ca.DM(0.5), (mean, none)))
    assert pulled == pytest.approx(np.hypot(2.0, np.sqrt(3) * (tau + 0.5)), rel=1e-3)


def test_a_force_through_a_neck_shears_it_where_it_does_not_bend_it(tmp_path):
    """3/2 V/(b t) and no moment there; before the drive moves it the model has no stress at all."""
    force = 200.0
    load = f'[[load]]\nname = "side"\non = "plate"\nat = {place((0, 0, 0))}\nforce = ["0 N", "{force} N", "0 N"]\n'
    text = hinged(5.0).replace("[[actuator]]", f"{load}[[actuator]]", 1).replace('high = "1 V"', 'high = "1e-6 V"')
    (line,) = reach_lines(loaded(tmp_path, text))
    assert float(INSIDE.search(line)[2]) * 1e6 == pytest.approx(np.sqrt(3) * 1.5 * force / (8e-3 * 0.3e-3), rel=0.01)
