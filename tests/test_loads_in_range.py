"""How far constant loads may go: the stiffness that they leave against beam-columns and corotational beams, what is told of it, and
blades that buckle."""

from __future__ import annotations

import re

import numpy as np
import pytest
from held_blades import EI, L, frame_of, guided
from mechanism_files import PARALLELOGRAM, blade, dm, loaded

from ctrlgen import InputError, build_model, load_scenario, solve
from ctrlgen.core.percent import percent
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.load_effects import load_lines
from ctrlgen.devices.mechanism.loaded_tangent import loaded_tangent
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.physics.beam_column import Column, Piece

HALF = L / np.sqrt(8)  # of the height and width of a crossed pivot
UPRIGHT, LEANING = "[0, 1, 0]", "[{}, 1, 0]"
PUSHED = 'at = ["0 mm", "-10 mm"'


def crossed(p: float, at: float = -1e3 * HALF) -> str:
    """A stage on two blades that cross in their middles at a right angle, pushed at an arm and loaded there so that both have p."""
    text = PARALLELOGRAM.replace(PUSHED, 'at = ["0 mm", "15 mm"').replace('["delta_x"]', '["theta_z"]')
    for name, x, side in (("left", -10, -1), ("right", 10, 1)):
        there = blade(name, 1e3 * side * HALF).replace(UPRIGHT, LEANING.format(side)).replace("[-1, 0, 0]", "[0, 0, 1]")
        text = text.replace(blade(name, x), there.replace("[0, 0, 1]", f"[-1, {side}, 0]"))
    return text + pressed(np.sqrt(2) * p * EI / L**2, at)


def pressed(force: float, at: float = 0.0) -> str:
    return f'[[load]]\nname = "on_it"\non = "stage"\nat = ["0 mm", "{at} mm", "0 mm"]\nforce = ["0 N", "{force} N", "0 N"]\n'


def exact(c: Condensed, push: float, at: float, force: float) -> float:
    """Stiffness of the axis [N/m] of the same stage of corotational beams, pushed and loaded on its middle at these heights [m]."""
    frame, (driven, on) = frame_of(c, np.array([0.0, push]), (0.0, at))
    q = np.zeros(3 * len(frame.X))
    q[on + 1] = force
    return frame.stiffness(driven, q)


@pytest.mark.parametrize("p", [-30.0, -9.0, -1.0, -0.04, 0.04, 3.0, 60.0])
def test_a_column_in_pieces_is_one_and_is_the_beam_column(p):
    whole, parts = Column((Piece(1.0, 1.0),)), Column((Piece(0.2, 1.0), Piece(0.5, 1.0), Piece(0.3, 1.0)))
    assert whole.stiffness(p)[0, 0] == pytest.approx(guided(p), rel=1e-9)
    for a, b in ((whole.stiffness(p), parts.stiffness(p)), (whole.rest(p), parts.rest(p))):
        assert np.allclose(a, b, rtol=1e-9, atol=1e-9)
    bends = np.array([0.5, 1.0])  # evenly, with ends that turn by a radian
    assert whole.rest(0.3) @ bends @ bends == pytest.approx(-(0.3**2) / 720, rel=0.02)
    assert whole.rest(0.3)[0, 0] == pytest.approx(-(0.3**2) / 700, rel=0.02)


def test_a_column_buckles_between_ends_that_do_not_turn():
    """At 4 pi^2 EI/l^2; where a rod in its middle does not bend by what both wires do, far before each of them alone."""
    for pieces in ((Piece(1.0, 2.0),), (Piece(0.3, 2.0), Piece(0.7, 2.0))):
        assert Column(pieces).buckling_load == pytest.approx(8 * np.pi**2, rel=1e-9)
    stiff = Column((Piece(0.1, 1.0), Piece(0.8, 1e4), Piece(0.1, 1.0)))
    fine = Column((*(Piece(0.05, 1.0),) * 2, *(Piece(0.1, 1e4),) * 8, *(Piece(0.05, 1.0),) * 2))
    assert stiff.buckling_load == pytest.approx(fine.buckling_load, rel=1e-6) and stiff.buckling_load < 400 * np.pi**2


@pytest.mark.parametrize("p", [-1.2, -5.0, -20.0, 3.0])
def test_the_tangent_of_a_loaded_pivot_is_that_of_corotational_beams(tmp_path, p):
    device = loaded(tmp_path, crossed(p))
    c = nominal(device)
    tangent, force = loaded_tangent(c), np.sqrt(2) * p * EI / L**2
    wanted = exact(c, 15e-3, -HALF, force)
    assert [e.p for e in tangent.flexures] == pytest.approx([p, p], rel=1e-3)
    assert tangent.stiffness()[0, 0] == pytest.approx(wanted, rel=5e-3)
    told, first = tangent.off()[0], dm(c.held_stiffness)[0, 0] + dm(tangent.loads.stiffness)[0, 0]
    assert told == pytest.approx(first / wanted - 1, abs=0.006 + 0.01 * told)
    notes = device.range_remarks()
    assert bool(notes) == (abs(told) > 0.01) and all(note in device.remarks() for note in notes)
    for note in notes:
        assert re.search(rf"(left|right) is (pressed|pulled) by .*, p = N l\^2/EI = {p:g}: ", note)
        assert percent(told, sign=True) in note
        share = float(re.search(r"to 1 % up to ([\d.]+) % of", note)[1]) / 100
        assert abs(tangent.off(share)[0]) == pytest.approx(0.01, rel=0.05)


def test_the_tangent_under_small_loads_is_that_of_first_order(tmp_path):
    """Also of a body between two pairs of blades, which the held axis leaves free, and of leaning blades that turn under their load."""
    leaning = PARALLELOGRAM.replace(UPRIGHT, "[0.2, 1, 0]", 1) + pressed(-3.0, 4.0)
    for text in (crossed(-5.0), leaning, serial(-3.0)):
        c = nominal(loaded(tmp_path, text))
        tangent = loaded_tangent(c)
        at_rest, first = dm(c.held_stiffness), dm(tangent.loads.stiffness)
        assert np.allclose(tangent.stiffness(0.0), at_rest, rtol=1e-9)
        slope = (tangent.stiffness(1e-4) - at_rest) / 1e-4
        assert np.allclose(slope, first, rtol=1e-2, atol=1e-3 * at_rest.max())


def serial(force: float) -> str:
    """The stage on two blades on a body between, that is on two others on the ground beside them."""
    text = PARALLELOGRAM.replace("[[body]]", '[[body]]\nname = "between"\n[[body]]', 1)
    for name, x in (("left", -10), ("right", 10)):
        inner = blade(name, x).replace('from = "ground"', 'from = "between"')
        outer = blade(f"outer_{name}", 2 * x).replace('to = "stage"', 'to = "between"')
        text = text.replace(
            blade(name, x), inner + outer.replace(UPRIGHT, "[0, -1, 0]").replace('"0 mm", "0 mm"]', '"-20 mm", "0 mm"]')
        )
    return text + pressed(force)


def test_a_body_between_that_buckles_is_refused_and_before_that_told(tmp_path):
    """The inner blades are pressed and the outer ones pulled, as both stand: what the axis yields to is in the tangent alone."""
    tangent = loaded_tangent(nominal(loaded(tmp_path, serial(-8.0))))
    assert {np.sign(e.tension) for e in tangent.flexures} == {-1.0, 1.0}
    assert abs(tangent.off()[0]) > 0.01 and loaded(tmp_path, serial(-8.0)).range_remarks()
    assert not loaded(tmp_path, serial(-0.5)).range_remarks()


@pytest.mark.parametrize(
    ("p", "fault"), [(-35.0, "the loads buckle the mechanism"), (-45.0, "even between ends that do not turn")]
)
def test_a_pivot_whose_blades_buckle_is_refused(tmp_path, p, fault):
    """To first order it only becomes stiffer."""
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, crossed(p))
    assert fault in str(caught.value)
    for by, most in re.findall(r"is pressed by ([\d.]+) N and buckles at ([\d.]+) N", str(caught.value)):
        assert [float(by), float(most)] == pytest.approx([-p * EI / L**2, 4 * np.pi**2 * EI / L**2], rel=2e-3)


def test_large_percentages_are_read_at_a_glance(tmp_path):
    assert percent(1.6, sign=True) == "+160 %" and percent(12.345) == "1200 %" and percent(-0.0123) == "-1.2 %"
    assert percent(0.105) == "10 %" and percent(9.996, 3) == "1000 %" and percent(0.0) == "0 %"
    device = loaded(tmp_path, crossed(-20.0))
    (line,) = (line for line in load_lines(device) if "change its stiffness" in line)
    assert re.search(r"by \+3\d0 %$", line) and not any("e+" in each for each in summary(device))


def test_a_solution_tells_that_the_stiffness_under_its_loads_is_off(tmp_path):
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\npoints = 3\n[path]\n'
        'kind = "line"\nstart = { theta_z = "0 rad" }\nend = { theta_z = "100 urad" }\n'
    )
    for p, told in ((-20.0, True), (-1.2, False)):
        device = loaded(tmp_path, crossed(p))
        left_out = solve(load_scenario(tmp_path), build_model(device)).left_out
        assert any("under the constant loads" in sentence for sentence in left_out) == told
