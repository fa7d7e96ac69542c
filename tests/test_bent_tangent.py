"""The stiffness of a mechanism whose flexures are bent, across its axes, against corotational beams; and what is told of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from corotational_frame import Frame, line
from held_blades import EA, EI, L, T
from mechanism_files import HEAD, PARALLELOGRAM, SILICON, blade, dm, loaded, pushed

from ctrlgen.devices.mechanism import bent_tangent
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


def toggle(joint: str, weight: float) -> str:
    """A stage between two arms that lean against it, like half of a bridge amplifier: the coil pushes the slider, the stage rises. A
    `weight` presses the arms."""
    text = HEAD + SILICON + "".join(f'[[body]]\nname = "{b}"\n' for b in ("first", "stage", "second", "slider"))
    chain = ("ground", "first", "stage", "second", "slider")
    for k, (x, y) in enumerate(((-16, 0), (-4, 1.2), (6, 1.2), (18, 0))):
        text += f'[[element]]\nname = "joint_{k}"\nfrom = "{chain[k]}"\nto = "{chain[k + 1]}"\nmaterial = "silicon"\n{joint}'
        text += f'at = ["{x} mm", "{y} mm", "0 mm"]\nalong = [1, 0, 0]\n'
    text += "".join(blade(f"guide_{x}", x).replace('"stage"', '"slider"') for x in (22, 26))
    text += f'[[load]]\nname = "weight"\non = "stage"\nat = ["0 mm", "2 mm", "0 mm"]\nforce = ["0 N", "{-weight} N", "0 N"]\n'
    push = pushed("slider", "coil", "0 mm", gain="5 N/A", ends=("-1 A", "1 A"), travel="50 um")
    push = push.replace(
        '[output]\nbody = "slider"\nat = ["0 mm", "0 mm"', '[output]\nbody = "stage"\nat = ["0 mm", "2 mm"'
    )
    return text + push.replace("delta_x", "delta_y")


BLADES = 'kind = "blade"\nslender = true\nlength = "2 mm"\nthickness = "0.2 mm"\nwidth = "8 mm"\n'
NOTCHES = 'kind = "hinge"\nhinge = { kind = "circular", R = "1 mm", t = "0.2 mm", b = "8 mm", outside = "accept" }\n'


def corotational_toggle(c, x: float, weight: float) -> np.ndarray:
    """(2, 2) [m/N] at the output point in the plane, by corotational beams; a notch is a short one in its middle that yields alike."""
    out, slider = np.array([0.0, 2e-3]), np.array([0.0, 0.0])
    nodes, beams, fixed, bodies = [out, slider], [], [], {"stage": 0, "slider": 1}
    for k, e in enumerate(c.device.placed_elements):
        tip, axis, C = dm(c.ends[k]).ravel()[:2], dm(c.frames[k])[:2, 0], dm(c.compliances[k])
        length, parts = (L, PARTS) if e.name.startswith("guide") else (2e-3, PARTS)
        start, stiffness = tip - length * axis, (EA, EI)
        if e.section.kind == "hinge":
            start, tip, parts = tip - 1.2e-3 * axis, tip - 0.8e-3 * axis, 1
            stiffness = (0.4e-3 / C[3, 0], 0.4e-3 / C[2, 5])
        first = len(nodes)
        nodes += line(start, tip, parts)
        beams += [(first + j, first + j + 1, *stiffness) for j in range(parts)]
        for name, node in ((e.section.from_, first), (e.section.to, first + parts)):
            if name == "ground":
                fixed += [3 * node + i for i in range(3)]
            elif name in bodies:
                beams.append((bodies[name], node, *RIGID))
            else:
                bodies[name] = node
    frame, load = Frame(nodes, beams, fixed), np.zeros(3 * len(nodes))
    load[1] = -weight
    _, q, _ = frame.moved(3, x, load, steps=4)
    rest = np.setdiff1d(frame.free, [3])
    at = [int(np.flatnonzero(rest == i)[0]) for i in (0, 1)]
    return np.linalg.inv(frame.forces(q)[1][np.ix_(rest, rest)])[np.ix_(at, at)]


@pytest.mark.parametrize("joint", [BLADES, NOTCHES])
@pytest.mark.parametrize("weight", [0.0, 3.0])
def test_a_toggle_turns_and_what_its_drive_presses_counts(tmp_path, joint, weight):
    """Of both directions in the plane, the change of the stiffness: bodies turn, the drive loads the arms; joints that bend, and that
    yield at a point."""
    c = nominal(loaded(tmp_path, toggle(joint, weight)))
    changes = []
    for x in (-20e-6, 20e-6):
        ours, exact = (
            [f(at) for at in (0.0, x)]
            for f in (
                lambda at: displaced_compliance(c, np.array([at]))[np.ix_([3, 4], [0, 1])],
                lambda at: corotational_toggle(c, at, weight),
            )
        )
        changes.append([np.diag(home) / np.diag(there) - 1 for home, there in (ours, exact)])
    ours, exact = np.swapaxes(np.array(changes), 0, 1)
    assert np.abs(exact).max() > 0.1
    assert ours == pytest.approx(exact, abs=0.015)


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


def test_both_ends_are_told_where_they_differ_and_one_where_they_are_alike(tmp_path):
    """Arms of 0.12 rad that a stack pushes to 0.097 and 0.14; a straight blade is as soft to both sides."""
    stack = toggle(BLADES, 0.0).replace('travel = "50 um"', 'travel = "20 um"\nstiffness = "1 N/um"')
    both = displaced_lines(loaded(tmp_path, stack.replace('gain = "5 N/A"', 'gain = "50 N/A"')))
    assert ["at 20 um" in line for line in both] == [False, True]
    assert "x +15 %" in both[0] and "x -12 %" in both[1]
    far = PARALLELOGRAM.replace('travel = "300 um"', 'travel = "1 mm"').replace('gain = "2 N/A"', 'gain = "9 N/A"')
    assert len(displaced_lines(loaded(tmp_path, far))) == 1


@pytest.mark.parametrize("ends", [(-500e-6, 400e-6), (-400e-6, 500e-6)])
def test_an_end_that_is_not_told_silences_no_other(monkeypatch, ends):
    """4 % softer at one end, which is too little to tell, and 8 % at the other, within 5 % of the first."""
    soft = {-1: 1.04, 0: 1.0, 1: 1.08}

    def compliance(c, held):
        return np.ones((6, 6)) / soft[int(np.sign(held[0]))]

    drawing = SimpleNamespace(cubics=(), ported=False, directions=[0], output_compliance=np.ones((6, 6)))
    reach = SimpleNamespace(name="a", own=0, home=np.zeros(1), ends=ends, at=lambda end: np.array([end]))
    monkeypatch.setattr(bent_tangent, "nominal", lambda device: drawing)
    monkeypatch.setattr(bent_tangent, "numbers", lambda matrix: matrix)
    monkeypatch.setattr(bent_tangent, "reaches", lambda c: [reach])
    monkeypatch.setattr(bent_tangent, "displaced_compliance", compliance)
    (told,) = displaced_lines(SimpleNamespace(actuator=[SimpleNamespace(kind="force")]))
    assert f"held at {max(ends) * 1e6:g} um" in told and "+8 %" in told
