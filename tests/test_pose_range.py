"""What the second order of the pose is beside its first is told where a file leaves it out; beside corotational beams."""

from __future__ import annotations

import re

import numpy as np
import pytest
from corotational_frame import Frame, line
from mechanism_files import HEAD, loaded, place

E, LENGTH, THICK, WIDTH = 70e9, 5e-3, 0.3e-3, 8e-3
EA, EI = E * THICK * WIDTH, E * WIDTH * THICK**3 / 12
PARTS = 8
TOLD = re.compile(r"(\w+) is off by up to ([\d.]+) um of ([\d.]+) um")


def lever(push, out, channel: str, travel: float, more: str = "") -> str:
    """A rigid arm on one blade from the ground to the origin, pushed along y at `push` (x, y), followed at `out`."""
    return (
        f'{HEAD}{more}[[material]]\nname = "metal"\nyoung = "{E / 1e9} GPa"\npoisson = "0.3"\n[[body]]\nname = "arm"\n'
        f'[[element]]\nkind = "blade"\nslender = true\nname = "pivot"\nfrom = "ground"\nto = "arm"\nat = {place((0, 0, 0))}\n'
        'along = [1, 0, 0]\nacross = [0, 1, 0]\nlength = "5 mm"\nthickness = "0.3 mm"\nwidth = "8 mm"\nmaterial = "metal"\n'
        f'[[actuator]]\nname = "piezo"\nkind = "force"\non = "arm"\nat = {place((*push, 0))}\nalong = [0, 1, 0]\n'
        f'gain = "1 kN/V"\nlow = "-1 V"\nhigh = "1 V"\ntravel = "{travel!r} m"\n'
        f'[output]\nbody = "arm"\nat = {place((*out, 0))}\nchannels = ["{channel}"]\n'
    )


def bent(push, out, travel: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (2,) of the output point where the push has moved its point by the travel up, and down."""
    nodes = line(np.array([-LENGTH, 0.0]), np.zeros(2), PARTS)
    beams = [(k, k + 1, EA, EI) for k in range(PARTS)]
    at = [len(nodes), len(nodes) + 1]
    rigid = [(PARTS, k, 1e4 * EA, 1e6 * EI) for k in at]
    frame = Frame([*nodes, np.array(push), np.array(out)], beams + rigid, [0, 1, 2])
    found = []
    for by in (travel, -travel):
        _, q, _ = frame.moved(3 * at[0] + 1, by)
        found.append(q[3 * at[1] : 3 * at[1] + 2])
    return found[0], found[1]


@pytest.mark.parametrize("seed", range(10))
def test_what_a_lever_leaves_out_of_its_pose_is_told_with_its_size(tmp_path, seed):
    rng = np.random.default_rng(seed)
    push = (float(rng.uniform(4e-3, 12e-3)), float(rng.uniform(-3e-3, 3e-3)))
    out = (float(rng.uniform(20e-3, 50e-3)), float(rng.uniform(5e-3, 40e-3) * rng.choice([-1, 1])))
    travel = push[0] * rng.uniform(0.02, 0.06)
    up, down = bent(push, out, travel)
    axis = int(rng.integers(2))
    linear, second = abs(up - down)[axis] / 2, abs(up + down)[axis] / 2
    told = [
        TOLD.match(x) for x in loaded(tmp_path, lever(push, out, f"delta_{'xy'[axis]}", float(travel))).range_remarks()
    ]
    told = [x for x in told if x]
    if second > 0.011 * linear:
        assert float(told[0][2]) * 1e-6 == pytest.approx(second, rel=0.03)
        assert float(told[0][3]) * 1e-6 == pytest.approx(linear, rel=0.03)
    elif second < 0.009 * linear:
        assert not told


@pytest.mark.parametrize(("share", "tells"), [(0.008, False), (0.012, True)])
def test_a_hundredth_of_the_motion_is_told_and_less_is_not(tmp_path, share, tells):
    push, out, travel = (6e-3, 0.0), (20e-3, 30e-3), 0.4e-3
    up, down = bent(push, out, travel)
    travel *= share * abs(up - down)[1] / abs(up + down)[1]  # the second order goes as the square
    remarks = loaded(tmp_path, lever(push, out, "delta_y", float(travel))).range_remarks()
    assert any(TOLD.match(x) for x in remarks) is tells


def test_nothing_is_told_where_the_file_has_the_second_order(tmp_path):
    push, out = (6e-3, 0.0), (20e-3, 30e-3)
    effect = '\n[[effect]]\nkind = "finite_rotation"\nat = "delta_y"\nshare = "1"\n'
    text = lever(push, out, "delta_y", 0.4e-3)
    told = {
        "first": loaded(tmp_path, text).range_remarks(),
        "second": loaded(
            tmp_path, lever(push, out, "delta_y", 0.4e-3, 'kinematics = "second_order"\n')
        ).range_remarks(),
        "effect": loaded(tmp_path, text + effect).range_remarks(),
        "shorter": loaded(tmp_path, lever(push, out, "delta_y", 0.04e-3)).range_remarks(),
    }
    assert {what: any(TOLD.match(x) for x in remarks) for what, remarks in told.items()} == {
        "first": True,
        "second": False,
        "effect": False,
        "shorter": False,
    }
