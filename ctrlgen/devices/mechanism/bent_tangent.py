"""How stiff a mechanism is at the output point where its axes are displaced: bent flexures yield along themselves, bodies have turned,
and what the drives put into the flexures makes them softer or stiffer across.

With the axes at d the tangent stiffness of all bodies is that of every element where it then is, a flexure as the curved one that it
is (`physics.bent_flexure`), any other in the axes halfway between those of its bodies, and beside it what the loads of d, those of the
drives among them, add (`loaded_tangent`). It is complete to first order in d. The output point moves with the axes held.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.loaded_tangent import LoadedTangent, loaded_tangent
from ctrlgen.devices.mechanism.loads import DrivenLoads
from ctrlgen.devices.mechanism.modes import as_displacements
from ctrlgen.devices.mechanism.reach import reaches
from ctrlgen.physics.bent_flexure import bent_compliance
from ctrlgen.physics.rigid_bodies import GROUND, Element, point_motion
from ctrlgen.physics.screw import inverse, inverse_adjoint, move, numbers

NOTICED = 0.05  # of a stiffness: less is what thicknesses are known to
ALONG = 10.0  # times as stiff with the axes held as with their drives: a direction in which they move it
SHIFTS, TURNS = [(3 + i, i) for i in range(3)], [(i, 3 + i) for i in range(3)]  # of a compliance (6, 6)


def displaced_compliance(c: Condensed, d: np.ndarray) -> np.ndarray:
    """(6, 6) twist per wrench at the output point with the axes moved by `d` (n,) [m] and held there, of a mechanism of numbers. The
    tension of flexures that stretch (`stretching`) is not in it."""
    loads = DrivenLoads(loaded_tangent(c).loads, d)
    tangent = LoadedTangent(c, loads)
    twists = [numbers(T).ravel() for T in loads.held]
    elements = [_displaced(loads, k, twists) for k in range(len(c.elements))]
    K, scale = tangent.assembled(elements) + tangent.of_loads(), as_displacements(c.device)
    output = c.device.bodies.index(c.device.output.body)
    seen = np.zeros((6, len(scale)))
    here = slice(6 * output, 6 * output + 6)
    seen[:, here] = numbers(inverse_adjoint(None, _moved(numbers(c.output_point).ravel(), twists[output])))
    seen *= scale
    held = _travels(c, twists) * scale
    yields = np.linalg.solve(K, np.vstack([seen, held]).T)
    C, by_push, travels = seen @ yields[:, :6], seen @ yields[:, 6:], held @ yields[:, 6:]
    if len(held):
        C = C - by_push @ np.linalg.solve(travels, by_push.T)
    return np.asarray(C[:, [3, 4, 5, 0, 1, 2]])


def _displaced(loads: DrivenLoads, k: int, twists: list[np.ndarray]) -> Element:
    """Element k where it is, in the global frame."""
    c, second = loads.c, loads.s
    e, (place, segments, _), frame = c.elements[k], second.parts[k], numbers(c.frames[k])
    base, end = (np.zeros(6) if b == GROUND else twists[b] for b in (e.first, e.second))
    if segments:
        load = numbers(second.local(k, loads.wrench(k) - ca.mtimes(e.stiffness, loads.prescribed(k)))).ravel()
        K, turn, at = inverse(ca.DM(bent_compliance(segments, load))), base, _moved(numbers(c.ends[k]).ravel(), end)
    else:
        K, turn, home = second.local_stiffness(k), (base + end) / 2, numbers(place).ravel()
        at = (_moved(home, base) + _moved(home, end)) / 2
    R = Rotation.from_rotvec(turn[:3]).as_matrix() @ frame
    return Element(e.first, e.second, move(K, ca.DM(R), ca.DM(at)))


def _travels(c: Condensed, twists: list[np.ndarray]) -> np.ndarray:
    """(axes, 6 bodies) per twist the travels of the actuators that push, at the points where they then are."""
    rows = np.zeros((len(c.directions) if c.pushes else 0, 6 * len(twists)))
    for row, a, direction in zip(rows, c.device.placed_actuators, c.directions, strict=False):
        for body, sign in ((a.first, -1), (a.second, 1)):
            if body != GROUND:
                at = _moved(numbers(c.point(a)).ravel(), twists[body])
                row[6 * body : 6 * body + 6] += sign * numbers(point_motion(ca.DM(at), direction)).ravel()
    return rows


def _moved(point: np.ndarray, twist: np.ndarray) -> np.ndarray:
    return np.asarray(point + twist[3:] + np.cross(twist[:3], point))


def displaced_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of it: of each axis alone, at the ends of its reach where that is more, the changes of the output point's
    stiffness above `NOTICED`; of one end where the other is alike. Nothing of heaters: how hot beams press one another is not known."""
    c = nominal(device)
    if c.cubics or c.ported or any(a.kind == "thermal" for a in device.actuator):
        return []
    home, free, lines = displaced_compliance(c, np.zeros(len(c.directions))), np.abs(numbers(c.output_compliance)), []
    for r in reaches(c):
        said: list[np.ndarray] = []
        for end in sorted(r.ends, key=abs, reverse=True):
            if end == r.home[r.own]:
                continue
            there = displaced_compliance(c, r.at(end))
            changes = np.array([_changed(home[at], there[at], free[at]) for at in (*SHIFTS, *TURNS)])
            if any(np.abs(changes - other).max() <= NOTICED for other in said):
                continue
            parts, turned = _changes(changes[:3]), _changes(changes[3:])
            parts += [f"about {', '.join(turned)}"] if turned else []
            if parts:
                said.append(changes)
                lines.append(
                    f"stiffness at the output point with {r.name} held at {show(end, 'um')}, over that held at home: {', '.join(parts)}"
                )
    return lines


def _changed(home: float, there: float, free: float) -> float:
    """Of a stiffness; nothing of one that is that of a held axis, -1 of one that is lost."""
    if home < free / ALONG:
        return 0.0
    return -1.0 if there <= 0 else home / there - 1


def _changes(shares: np.ndarray) -> list[str]:
    return [f"{name} {percent(float(x), sign=True)}" for name, x in zip("xyz", shares, strict=True) if abs(x) > NOTICED]
