"""Readings of the load in a flexure or spring, such as of a load cell in a strut for integral force feedback.

The load on the free end, in the element's own frame, is that of the axes at d and, of a mechanism with inertia, of what the bodies
put on it as they are accelerated: with the axes held the forces -M_i T_i d'' of the bodies, which move by T_i d, move them by T_h d'', so

    W = W_1 d + W_a d'',  W_1 = K (T_1 - m),  W_a = K T_h:

a strut between a stack and a stage of mass m on springs k carries k x + m x''. Modes with the axes held are at rest in it, which is right
well below them. What damping adds is left out, and what a constant load makes of
the load of a flexure as that bends.

Source: mode acceleration, R. R. Craig, A. J. Kurdila, Fundamentals of Structural Dynamics (2006), 11.4.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.modes import guyan_modes
from ctrlgen.devices.travel import farthest
from ctrlgen.physics import rigid_bodies
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import Matrix, numbers

FAINT = 1e-9  # of the largest travel: a stretch of an element that is rounding

SWAP = [3, 4, 5, 0, 1, 2]  # (moment; force) <-> (force; moment)


def inertial(c: Condensed) -> Matrix:
    """W_a (readings, n) per acceleration of the axes; zero of readings of a motion."""
    n, readings = len(c.directions), c.device.placed_readings
    if not any(r.section.of for r in readings):
        return ca.DM(len(readings), n)
    held, rows = _held(c), []
    for r in readings:
        if r.section.of is None:
            rows.append(ca.SX(1, n))
            continue
        k, row = c.load_row(r)
        e = c.elements[k]
        ends = [ca.SX(6, n) if b == GROUND else held[b] for b in (e.second, e.first)]
        rows.append(ca.mtimes([row, e.stiffness, ends[0] - ends[1]]))
    return ca.vertcat(*rows)


def reach(device: Drawing) -> np.ndarray:
    """(readings,) typical loads [N, N m]: at the largest travels at rest, and with inertia as the fastest mode takes them there; zero of
    readings of a motion."""
    c, travel = nominal(device), max(farthest(a.section.travel) for a in device.placed_actuators)
    n, fastest = len(c.directions), guyan_modes(device).frequencies[-1:] if device.dynamics is not None else np.zeros(0)
    found = numbers(c.reading_motion)[:, :n]
    size = np.abs(found).sum(axis=1)
    if len(fastest):
        size += np.abs(numbers(inertial(c))).sum(axis=1) * (2 * np.pi * fastest[0]) ** 2
    return np.asarray(size * travel * [r.section.of is not None for r in device.placed_readings])


def unloaded(device: Drawing) -> list[str]:
    """The readings of loads that no actuator makes."""
    c, loads, faint = nominal(device), reach(device), []
    least = FAINT * max(farthest(a.section.travel) for a in device.placed_actuators)
    for r, load in zip(device.placed_readings, loads, strict=True):
        if r.section.of is not None:
            # counted as the force that would stretch the element as far as a share of the largest travel
            K = np.abs(numbers(c.elements[c.load_row(r)[0]].stiffness)[:3, 3:]).max()
            faint += [r.name] * bool(load <= least * K * (device.size if r.section.unit == "N*m" else 1.0))
    return faint


def _held(c: Condensed) -> list[Matrix]:
    """T_h (6, n) of every body."""
    n, loads = len(c.directions), dict[int, Matrix]()
    first = [T[:, :n] for T in c.twists]

    def push(body: int, momentum: Matrix) -> None:
        if body != GROUND:
            loads[body] = loads.get(body, ca.SX(6, n)) - momentum[SWAP, :]

    for number, T in enumerate(first):
        if (mass := c.body_mass(number)) is not None:
            push(number, ca.mtimes(mass, T))
    both = ca.DM.eye(12)
    for k, e in enumerate(c.elements):
        if (mass := c.flexure_mass(k, both[:6, :], both[6:, :])) is not None:
            ends = [ca.SX(6, n) if b == GROUND else first[b] for b in (e.first, e.second)]
            momentum = ca.mtimes(mass, ca.vertcat(*ends))
            push(e.first, momentum[:6, :])
            push(e.second, momentum[6:, :])
    for part in c.ported:
        if part.mass is not None:
            momentum = ca.mtimes(part.mass, ca.vertcat(*(first[b] for b in part.bodies)))
            for body, rows in zip(part.bodies, ca.vertsplit(momentum, 6), strict=True):
                push(body, rows)
    free = rigid_bodies.twists(len(c.device.bodies), c.joints, loads, c.device.size)
    travel = ca.vertcat(*(c.travel(i, free) for i in range(n)))
    return [T - ca.mtimes(T_1, travel) for T, T_1 in zip(free, first, strict=True)]
