"""What the flexures of a mechanism hold ideally: degrees of freedom, redundant constraints, bodies that nothing holds."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import KEPT, Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.joining import STIFF
from ctrlgen.devices.mechanism.ported_parts import on_bodies, stored_motions
from ctrlgen.devices.mechanism.springs import Spring
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import inverse_adjoint

SHORT_CHAIN = 10  # bodies: of a chain of n the weakest independent constraint has a singular value of 1.5/n^2
INDEPENDENT = 1e-3  # singular value of unit rows below which a constraint adds nothing: no drawing is more exact
FREE = 1e-6  # of the largest singular value, below which springs hold nothing: symmetry leaves rounding, 1e-9


def freedoms(device: Drawing) -> tuple[int, int]:
    """(degrees of freedom, times over-constrained) of the mechanism without its actuators.

    Each flexure holds its stiff directions ideally, a blade three and a wire one: c rows A of relative twists of all bodies,
    6 n - rank(A) and c - rank(A). Source: J. B. Hopkins, M. L. Culpepper, Precis. Eng. 34 (2010) 259 (ideal constraints).
    """
    stressed = _in_balance(nominal(device))
    rank = len(stressed) - stressed.shape[1]
    return 6 * len(device.bodies) - rank, len(stressed) - rank


def redundant_constraints(device: Drawing) -> dict[str, list[str]]:
    """Of each element the directions that could be left out without another freedom: those that take part in a set of forces in balance
    without a load. Those with a direction of their own, as of a stated compliance, are counted: "constraint 1"."""
    _, names = constraints(nominal(device))
    stressed = _in_balance(nominal(device))
    found: dict[str, list[str]] = {}
    for (element, direction), row in zip(names, stressed, strict=True):
        if np.linalg.norm(row) > INDEPENDENT:
            found.setdefault(element, []).append(direction)
    return found


@lru_cache(maxsize=KEPT)
def _in_balance(c: Condensed) -> np.ndarray:
    """(c, redundant) the sets of forces on the constraints that are in balance without a load, of unit size."""
    A, _ = constraints(c)
    if not len(A):
        return np.zeros((0, 0))
    U, values, _ = np.linalg.svd(A)
    least = INDEPENDENT * min(1.0, (SHORT_CHAIN / len(c.device.bodies)) ** 2)
    return np.asarray(U[:, int((values > least).sum()) :])


@lru_cache(maxsize=KEPT)
def constraints(c: Condensed) -> tuple[np.ndarray, list[tuple[str, str]]]:
    """(c, 6 bodies) unit rows of what the flexures hold of the twists of all bodies, turns counted as displacements, and (element,
    direction) of each."""
    names: list[tuple[str, str]] = []
    device = c.device
    count, rows = len(device.bodies), []
    turn = np.array([device.size] * 3 + [1.0] * 3)  # twists (theta; delta) as displacements, wrenches (M; F) as forces
    swap = [3, 4, 5, 0, 1, 2]
    yields = {
        k: turn[:, None] * ca.DM(ca.evalf(ca.SX(C))).full()[:, swap] * turn
        for k, C in enumerate(c.compliances)
        if C is not None
    }
    stored = [stored_motions(s, device.size) for s in device.placed_super_elements]
    largest = max((float(np.linalg.eigvalsh((C + C.T) / 2).max()) for C in yields.values()), default=0.0)
    largest = max([largest, *(float(1 / values.min()) for values, _ in stored)])
    for k, e in enumerate(device.placed_elements):
        if k not in yields:
            continue  # a spring holds nothing
        pivot = c.ends[k] - e.section.pivot(e.numbers(c.p)) * c.frames[k][:, 0]
        local = inverse_adjoint(c.frames[k], pivot)  # twist in the element's frame
        directions = e.section.constrained(yields[k], largest) * turn
        A = np.zeros((len(directions), 6 * count))
        held = directions @ ca.DM(ca.evalf(ca.SX(local))).full()
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                A[:, 6 * body : 6 * body + 6] = sign * held
        rows.append(A)
        held_by = e.section.ideal or [f"constraint {i + 1}" for i in range(len(A))]
        names += [(e.name, direction) for direction in held_by]
    for s, (values, motions) in zip(device.placed_super_elements, stored, strict=True):
        stiff = motions[1 / values < STIFF * largest]
        rows.append(on_bodies(s, stiff, count))
        names += [(s.name, f"constraint {i + 1}") for i in range(len(stiff))]
    A = np.vstack([np.zeros((0, 6 * count)), *rows]) * np.tile([1 / device.size] * 3 + [1.0] * 3, count)
    return A / np.linalg.norm(A, axis=1, keepdims=True), names


def free_between_springs(device: Drawing) -> list[str]:
    """Bodies that can move without a force, because what joins them are springs, or super-elements with joints inside."""
    if not device.super_element and not any(isinstance(e.section, Spring) for e in device.placed_elements):
        return []
    count, c = len(device.bodies), nominal(device)
    size = np.array([1 / device.size] * 3 + [1.0] * 3)  # turns as displacements
    rows = []
    for e, R, end in zip(device.placed_elements, c.frames, c.ends, strict=True):
        held = e.section.directions if isinstance(e.section, Spring) else range(6)
        local = ca.DM(inverse_adjoint(R, end)).full()[list(held)] * size / size[list(held), None]
        row = np.zeros((len(local), 6 * count))
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                row[:, 6 * body : 6 * body + 6] = sign * local
        rows.append(row)
    stored = (on_bodies(s, stored_motions(s, device.size)[1], count) for s in device.placed_super_elements)
    rows += [row * np.tile(size, count) for row in stored]
    _, values, motions = np.linalg.svd(np.vstack([*rows, np.zeros((6 * count, 6 * count))]))
    free = motions[values < FREE * values.max()]
    return [name for i, name in enumerate(device.bodies) if np.abs(free[:, 6 * i : 6 * i + 6]).max(initial=0) > FREE]
