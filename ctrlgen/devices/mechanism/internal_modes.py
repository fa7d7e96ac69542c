"""Modes of a mechanism's bodies while its axes are held, beside the motions at rest to which its model is condensed."""

from __future__ import annotations

import casadi as ca
import numpy as np
import scipy.linalg

from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.force_readings import inertial
from ctrlgen.devices.mechanism.modes import as_displacements, body_matrices, guyan_modes
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import inverse_adjoint, numbers

REACH = 5.0  # times the fastest condensed mode: how far up the response is told where a file states no `modes_below`
MOVES = 1e-9  # of the softest mode with mass: below it a motion of bodies has no mass


def highest_told(device: Drawing) -> float | None:
    """The frequency [Hz] up to which the response is told; None without a table [dynamics]."""
    condensed = guyan_modes(device)
    if device.dynamics is None or not len(condensed.frequencies):
        return None
    stated = device.dynamics.modes_below
    return REACH * float(condensed.frequencies[-1]) if stated is None else float(stated.si)


def structural_model(device: Drawing) -> StructuralModel | None:
    """The mechanism with its inertia and the fewest modes of its bodies that tell its response up to `modes_below`, at home; None
    without a table [dynamics]."""
    if (highest := highest_told(device)) is None:
        return None
    c, n = nominal(device), len(device.placed_actuators)
    K, M, _ = body_matrices(c)
    size = as_displacements(device)
    at_rest = np.vstack([numbers(T[:, :n]) for T in c.twists]) / size[:, None]
    bodies = [np.eye(6 * len(device.bodies))[6 * i : 6 * i + 6] * size for i in range(len(device.bodies))]
    travel = np.vstack([numbers(c.travel(i, [ca.DM(b) for b in bodies])) for i in range(n)])
    free = scipy.linalg.null_space(travel)  # the axes held
    slow, shapes = scipy.linalg.eigh(free.T @ M @ free, free.T @ K @ free)  # 1/w^2: bodies without a mass have none
    shapes, slow = (x[..., ::-1] for x in (shapes, slow))  # the slowest first
    moving = slow > MOVES * slow.max(initial=0.0)
    shapes = free @ shapes[:, moving] / np.sqrt(slow[moving])
    seen = numbers(inverse_adjoint(None, c.output_point)) @ bodies[device.bodies.index(device.output.body)]
    ratio = device.dynamics.damping_ratio.si

    rows, per_acceleration, kept = _readings(c, bodies), numbers(inertial(c)), slow[moving]

    def with_modes(count: int) -> StructuralModel:
        basis = np.hstack([at_rest, shapes[:, :count]])
        mass, stiffness = (basis.T @ X @ basis for X in (M, K))
        output = seen[c.channel_rows] @ basis
        readings = rows @ basis
        # of the modes that are kept what they do at rest is theirs
        more = per_acceleration + readings[:, n:] @ (kept[:count, None] * mass[n:, :n])
        more = np.vstack([np.zeros((len(output), n)), more])
        read = np.vstack([output, readings])
        return StructuralModel((mass + mass.T) / 2, (stiffness + stiffness.T) / 2, output, n, ratio, read, more)

    few, most = 0, shapes.shape[1]
    whole = with_modes(most)
    while few < most:  # the more of them, the nearer
        middle = (few + most) // 2
        few, most = (few, middle) if with_modes(middle).is_near(whole, highest) else (middle + 1, most)
    return with_modes(most)


def _readings(c: Condensed, bodies: list[np.ndarray]) -> np.ndarray:
    """(readings, 6 bodies) what is read beside the output of the twists of all bodies, turns counted as displacements."""
    rows = np.zeros((len(c.device.placed_readings), bodies[0].shape[1]))
    for i, (r, row) in enumerate(zip(c.device.placed_readings, c.reading_rows, strict=True)):
        first, second, seen = r.first, r.second, numbers(row)
        if r.section.of is not None:
            k, of_wrench = c.load_row(r)
            first, second = c.elements[k].first, c.elements[k].second
            seen = numbers(ca.mtimes(of_wrench, c.elements[k].stiffness))
        for body, sign in ((second, 1), (first, -1)):
            if body != GROUND:
                rows[i] += sign * (seen @ bodies[body]).ravel()
    return rows
