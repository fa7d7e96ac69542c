"""The stiffness of a mechanism whose flexures are bent, across its axes, against corotational beams; and what is told of it."""

from __future__ import annotations

import numpy as np
import pytest
from corotational_frame import Frame, line
from held_blades import EA, EI, L, T
from mechanism_files import PARALLELOGRAM, blade, dm, loaded

from ctrlgen.devices.mechanism.bent_tangent import displaced_compliance, displaced_lines
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.physics.bent_flexure import bent_compliance
from ctrlgen.physics.held_flexure import held_blade
from ctrlgen.physics.rigid_bodies import GROUND

PARTS, RIGID = 12, (1e4 * EA, 1e6 * EI)


def serial() -> str:
    """The stage on two blades on a body between, that is on two others beside them: nothing holds the body but the loads."""
    text = PARALLELOGRAM.replace("[[body]]", '[[body]]\nname = "between"\n[[body]]', 1)
    for name, x in (("left", -10), ("right", 10)):
        outer = blade(f"outer_{name}", 2 * x).replace('to = "stage"', 'to = "between"')
        outer = outer.replace("[0, 1, 0]", "[0, -1, 0]").replace('"0 mm", "0 mm"]', '"-20 mm", "0 mm"]')
        text = text.replace(blade(name, x), blade(name, x).replace('from = "ground"', 'from = "between"') + outer)
    return text


def leaning(first: float, second: float) -> str:
    text = PARALLELOGRAM.replace("[0, 1, 0]", f"[{first}, 1, 0]", 1)
    return text.replace("[0, 1, 0]", f"[{second}, 1, 0]", 1)


def along_the_blades(c, x: float) -> float:
    """Compliance [m/N] at the output point along y of the same in a plane, with the point that is pushed held at x [m]."""
    places = [dm(c.output_point).ravel()[:2], dm(c.point(c.device.placed_actuators[0])).ravel()[:2]]
    stage = c.device.bodies.index("stage")
    nodes = [places[0] + [0.0, 1e-4 * (k + 1)] if k != stage else places[0] for k in range(len(c.device.bodies))]
    nodes.append(places[1])
    beams, fixed = [(stage, len(nodes) - 1, *RIGID)], []
    for e, end, frame in zip(c.elements, c.ends, c.frames, strict=True):
        tip, axis, start = dm(end).ravel()[:2], dm(frame)[:2, 0], len(nodes)
        nodes += line(tip - L * axis, tip, PARTS)
        beams += [(start + j, start + j + 1, EA, EI) for j in range(PARTS)]
        for body, node in ((e.first, start), (e.second, start + PARTS)):
            if body == GROUND:
                fixed += [3 * node + k for k in range(3)]
            else:
                beams.append((body, node, *RIGID))
    frame = Frame(nodes, beams, fixed)
    driven = 3 * len(c.device.bodies)
    rest = np.setdiff1d(frame.free, [driven])
    for step in (0.5, 0.3, 0.2, 0.1):  # of a thickness: Newton's method leaves a stiff frame now and then
        force, q, _ = frame.moved(driven, x, steps=max(1, round(abs(x) / (step * T))))
        if np.abs(frame.forces(q)[0][rest]).max() <= 1e-6 * abs(force):
            break
    K = frame.forces(q)[1]
    return float(np.linalg.inv(K[np.ix_(rest, rest)])[(at := int(np.flatnonzero(rest == 3 * stage + 1)[0])), at])


@pytest.mark.parametrize("share", [1.0, 3.0])
@pytest.mark.parametrize("text", [PARALLELOGRAM, serial(), leaning(0.15, -0.1), leaning(-0.2, 0.2), leaning(0.3, 0.3)])
def test_a_bent_mechanism_yields_along_its_blades_as_corotational_beams_do(tmp_path, text, share):
    """At one and three thicknesses: 12/700 (y/t)^2 of a guided pair, and far more where a body between is free to give way."""
    c = nominal(loaded(tmp_path, text))
    home, bent = (displaced_compliance(c, np.array([x]))[4, 1] for x in (0.0, share * T))
    rigid = along_the_blades(c, 0.0) / home
    assert rigid == pytest.approx(1.0, rel=0.05)  # the links of the frame yield a little
    assert bent / home == pytest.approx(along_the_blades(c, share * T) / home / rigid, rel=0.03)


def test_what_a_displaced_stage_loses_is_told(tmp_path):
    far = PARALLELOGRAM.replace('travel = "300 um"', 'travel = "1 mm"').replace('gain = "2 N/A"', 'gain = "9 N/A"')
    (said,) = displaced_lines(loaded(tmp_path, far))
    assert "coil held at" in said and "1000 um" in said and "y -30 %" in said  # 1/(1 + 12/700 * 5^2)
    assert not displaced_lines(loaded(tmp_path, PARALLELOGRAM.replace('travel = "300 um"', 'travel = "30 um"')))


@pytest.mark.parametrize("width", [2e-3, 10e-3, 40e-3])
def test_a_guided_blade_between_held_ends_yields_along_itself_as_its_stiffness_says(width):
    """y^2/(700 E I) l with the bending stiffness that it has where it is guided."""
    l, t, E, y = 25e-3, 0.3e-3, 2e11, 1e-3
    s = held_blade(l, t, width, E, 0.3)
    bends = np.array([[l**3 / 3 / s.EI_z + l * s.shear_y, l**2 / 2 / s.EI_z], [l**2 / 2 / s.EI_z, l / s.EI_z]])
    force, moment = np.linalg.solve(bends, [y, 0.0])
    C = bent_compliance((s,), np.array([0, force, 0, 0, 0, moment]))[np.ix_([3, 4, 2], [0, 1, 5])]
    guided = 1 / (1 / s.EI_z + 12 * s.shear_y / l**2)
    assert 1 / np.linalg.inv(C)[0, 0] == pytest.approx(l / s.EA + y**2 * l / (700 * guided), rel=0.01)
