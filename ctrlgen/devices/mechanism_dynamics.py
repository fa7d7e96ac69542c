"""What follows from a mechanism's equations at home: degrees of freedom, natural frequencies, and the lines that describe it."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.linalg import eigh

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism_model import Condensed, Drawing
from ctrlgen.physics.mechanism import GROUND
from ctrlgen.physics.screw import inverse_adjoint

INDEPENDENT = 1e-3  # singular value of unit rows below which a constraint adds nothing: no drawing is more exact
STILL = 1e-9  # m/m or rad/m: of the motion per actuator, below which it is rounding


def freedoms(device: Drawing) -> tuple[int, int]:
    """(degrees of freedom, times over-constrained) of the mechanism without its actuators.

    Each flexure holds its stiff directions ideally, a blade three and a wire one: c rows A of relative twists of all bodies,
    6 n - rank(A) and c - rank(A). Source: J. B. Hopkins, M. L. Culpepper, Precis. Eng. 34 (2010) 259 (ideal constraints).
    """
    c = Condensed(device, device.values())
    count, rows = len(device.bodies), []
    turn = np.array([device.size] * 3 + [1.0] * 3)  # twists (theta; delta) as displacements, wrenches (M; F) as forces
    swap = [3, 4, 5, 0, 1, 2]
    yields = {
        k: turn[:, None] * ca.DM(ca.evalf(ca.SX(C))).full()[:, swap] * turn
        for k, C in enumerate(c.compliances) if C is not None
    }  # fmt: skip
    largest = max((float(np.linalg.eigvalsh((C + C.T) / 2).max()) for C in yields.values()), default=0.0)
    for k, e in enumerate(device.placed_elements):
        if k not in yields:
            continue  # a spring holds nothing
        pivot = c.ends[k] - e.section.pivot(c.p.element[e.index]) * c.frames[k][:, 0]
        local = inverse_adjoint(c.frames[k], pivot)  # twist in the element's frame
        own = e.section.constrained(yields[k], largest) * turn
        A = np.zeros((len(own), 6 * count))
        held = own @ ca.DM(ca.evalf(ca.SX(local))).full()
        for body, sign in ((e.second, 1), (e.first, -1)):
            if body != GROUND:
                A[:, 6 * body : 6 * body + 6] = sign * held
        rows.append(A)
    A = np.vstack([np.zeros((0, 6 * count)), *rows]) * np.tile([1 / device.size] * 3 + [1.0] * 3, count)
    A /= np.linalg.norm(A, axis=1, keepdims=True)
    rank = int(np.linalg.matrix_rank(A, tol=INDEPENDENT))
    return 6 * count - rank, len(A) - rank


def natural_frequencies(device: Drawing) -> np.ndarray:
    """The natural frequencies [Hz] with the drives held, ascending; empty where no body has a mass.

    K v = w^2 M v of all bodies, those without mass condensed first (which is exact): a stack counts with its stiffness, a force
    without one leaves its axis free, a prescribed displacement holds it.
    """
    c, p = Condensed(device, device.values()), device.values()
    count = len(device.bodies)
    K, M = np.zeros((6 * count, 6 * count)), np.zeros((6 * count, 6 * count))
    swap = np.r_[3:6, 0:3]  # a wrench as (moment; force) beside a twist: the stiffness is then symmetric
    for e in c.held_elements():
        k = ca.DM(ca.evalf(ca.SX(e.stiffness))).full()[swap]
        for i, j, sign in (
            (e.first, e.first, 1),
            (e.second, e.second, 1),
            (e.first, e.second, -1),
            (e.second, e.first, -1),
        ):
            if GROUND not in (i, j):
                K[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] += sign * k
    heavy: list[int] = []
    for number, placed in enumerate(device.placed_bodies):
        own = p.body[placed.index]
        if own.mass is None:
            continue
        R = np.array(placed.turn)
        r = R @ np.array((0.0, 0.0, 0.0) if own.centre is None else own.centre)
        S = np.array(ca.DM(ca.skew(ca.DM(r))))
        about = R @ np.diag(own.inertia) @ R.T - own.mass * S @ S
        at = slice(6 * number, 6 * number + 6)
        M[at, at] = np.block([[about, own.mass * S], [-own.mass * S, own.mass * np.eye(3)]])
        heavy += range(at.start, at.stop)
    if not heavy:
        return np.zeros(0)
    scale = np.tile([1 / device.size] * 3 + [1.0] * 3, count)  # turns in displacements at the mechanism's size
    K, M = K * np.outer(scale, scale), M * np.outer(scale, scale)
    light = [i for i in range(6 * count) if i not in heavy]
    K_h = K[np.ix_(heavy, heavy)] - K[np.ix_(heavy, light)] @ np.linalg.solve(
        K[np.ix_(light, light)], K[np.ix_(light, heavy)]
    )
    squares = eigh((K_h + K_h.T) / 2, M[np.ix_(heavy, heavy)], eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi)


def summary(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of a mechanism: its parts, and how stiff it is at the output point."""
    c = Condensed(device, device.values())
    C = ca.DM(ca.evalf(ca.SX(c.output_compliance))).full()
    springs = sum(C is None for C in c.compliances)
    lines = [
        f"{len(device.bodies)} bodies, {len(c.elements) - springs} flexures, "
        + (f"{springs} springs, " if springs else "")
        + f"{len(device.placed_actuators)} actuators"
    ]
    free, over = freedoms(device)
    lines.append(f"degrees of freedom without actuators: {free}; redundant constraints: {over}")
    forces = ", ".join(f"{name} {show(1 / C[3 + i, i], 'N/um')}" for i, name in enumerate("xyz"))
    moments = ", ".join(f"{name} {show(1 / C[i, 3 + i], 'N*m/rad')}" for i, name in enumerate("xyz"))
    lines.append(f"stiffness at the output point: {forces}; about {moments}")
    if len(modes := natural_frequencies(device)):
        lines.append(f"natural frequencies with the drives held: {', '.join(show(f, 'Hz') for f in modes[:6])}")
    J = ca.DM(ca.evalf(ca.SX(c.jacobian))).full()[:, : len(device.placed_actuators)]
    for channel, row in zip(device.output.channels, J, strict=True):
        unit = "urad/um" if channel.startswith("theta") else "um/um"
        parts = ", ".join(
            f"{show(v, unit)} per {a.name}" for a, v in zip(device.placed_actuators, row, strict=True) if abs(v) > STILL
        )
        lines.append(f"{channel}: {parts or 'not moved'}")
    return lines
