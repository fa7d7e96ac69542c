"""How stiff a mechanism is at the output point where its axes are displaced: bent flexures yield along themselves."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.reach import reaches
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics import rigid_bodies
from ctrlgen.physics.bent_flexure import bent_compliance
from ctrlgen.physics.rigid_bodies import GROUND, Element
from ctrlgen.physics.screw import adjoint, inverse, inverse_adjoint, move, numbers

NOTICED = 0.05  # of a stiffness: less is what thicknesses are known to
ALONG = 10.0  # times as stiff with the axes held as with their drives: a direction in which they move it
HELD = 1e7  # times the stiffness of an axis, with which it is held
SHIFTS, TURNS = [(3 + i, i) for i in range(3)], [(i, 3 + i) for i in range(3)]  # of a compliance (6, 6)


def displaced_compliance(c: Condensed, d: np.ndarray) -> np.ndarray:
    """(6, 6) twist per wrench at the output point with the axes moved by `d` (n,) and held there, of a mechanism of numbers. What
    the load in a flexure does to its stiffness across (`stretching`, `loaded_tangent`) is not in it."""
    second, device = SecondOrder(c), c.device
    twists = [
        np.zeros(6) if b == GROUND else numbers(second.first_order[b]) @ d for b in (*range(len(device.bodies)), GROUND)
    ]
    elements = []
    for k, e in enumerate(c.elements):
        segments = second.parts[k][1]
        if not segments:
            elements.append(e)
            continue
        motions, base, end = second.motions(k), twists[e.first], numbers(c.ends[k]).ravel()
        C = bent_compliance(segments, numbers(motions.load)[:, : len(d)] @ d)
        R = Rotation.from_rotvec(base[:3]).as_matrix() @ numbers(c.frames[k])
        there = end + twists[e.second][3:] + np.cross(twists[e.second][:3], end)
        elements.append(Element(e.first, e.second, move(inverse(ca.DM(C)), ca.DM(R), ca.DM(there))))
    for i, (a, n) in enumerate(zip(device.placed_actuators if c.pushes else (), c.directions, strict=False)):
        held = HELD * numbers(c.held_stiffness)[i, i]
        point = numbers(c.point(a)).ravel()
        push = [rigid_bodies.point_force(ca.DM(point), n), rigid_bodies.point_motion(ca.DM(point), n)]
        elements.append(Element(a.first, a.second, held * ca.mtimes(*push)))
    output = device.bodies.index(device.output.body)
    at = numbers(c.output_point).ravel()
    at = ca.DM(at + twists[output][3:] + np.cross(twists[output][:3], at))
    T = rigid_bodies.twists(len(device.bodies), elements, {output: adjoint(None, at)}, device.size)
    return numbers(ca.mtimes(inverse_adjoint(None, at), T[output]))


def displaced_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of it: of each axis alone, at the end of its reach where that is more, the changes of the output point's
    stiffness above `NOTICED`."""
    c = nominal(device)
    if c.cubics or c.ported:
        return []
    home, free, lines = displaced_compliance(c, np.zeros(len(c.directions))), np.abs(numbers(c.output_compliance)), []
    for r in reaches(c):
        end = max(r.ends, key=abs)
        bent = displaced_compliance(c, r.at(end))
        parts, turned = (
            _changes([_changed(home[at], bent[at], free[at]) for at in places]) for places in (SHIFTS, TURNS)
        )
        parts += [f"about {', '.join(turned)}"] if turned else []
        if parts:
            lines.append(
                f"stiffness at the output point with {r.name} held at {show(end, 'um')}, over that held at home: {', '.join(parts)}"
            )
    return lines


def _changed(home: float, bent: float, free: float) -> float:
    """Of a stiffness; nothing of one that is that of a held axis."""
    return 0.0 if home < free / ALONG else home / bent - 1


def _changes(shares: list[float]) -> list[str]:
    return [f"{name} {percent(x, sign=True)}" for name, x in zip("xyz", shares, strict=True) if abs(x) > NOTICED]
