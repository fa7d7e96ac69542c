"""A circular flexure hinge by finite elements: plane stress, biquadratic isoparametric quadrilaterals.

The reference for the hinge equations; it imports nothing of ctrlgen. Needs scikit-fem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import skfem
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from skfem.helpers import ddot, sym_grad, trace


class Reading(Enum):
    """How the relative motion of the hinge's ends, x = -R and x = +R, is read.

    The choice alone changes delta_x/F_x: SECTION exceeds CENTRE by 6 % at t/R = 0.05 and by 32 % at 0.8, BLOCKS by more.
    """

    CENTRE = "centre-line points of the end sections, mean rotation of the sections, elastic blocks beyond"
    SECTION = "mean motion of the end sections, elastic blocks beyond"
    RIGID = "end sections held plane, no blocks"
    BLOCKS = "outer faces of the blocks, held plane and carried back to the sections as if the blocks were rigid"


@dataclass(frozen=True)
class Notch:
    """The solid in units of R: `ratio` = t/R, Poisson's ratio, `block` length of link at each end over R.

    The blocks are as high as the hinge's ends, t + 2 R. Longer ones change the CENTRE reading by less than 0.4 %.
    """

    ratio: float
    nu: float
    block: float = 2.0


@dataclass(frozen=True)
class Grid:
    """Elements along the notch, across its height, and along each block. The sizes shrink towards the neck."""

    along: int = 56
    across: int = 12
    block: int = 14

    def finer(self, factor: int = 2) -> Grid:
        """`factor` times the elements in each direction."""
        return Grid(factor * self.along, factor * self.across, factor * self.block)


def compliance(notch: Notch, reading: Reading = Reading.CENTRE, grid: Grid | None = None) -> np.ndarray:
    """(delta_x, delta_y, alpha_z) of the right end per (F_x, F_y, M_z) acting there, shape (3, 3), for E = b = R = 1.

    Referred to the point (R, 0); the left end is fixed. For other E, b, R: delta_x/F_x and delta_y/F_y scale with 1/(E b),
    delta_y/M_z with 1/(E b R), alpha_z/M_z with 1/(E b R^2).
    """
    notch = replace(notch, block=0.0) if reading is Reading.RIGID else notch
    basis = skfem.Basis(mesh(notch, grid or Grid()), skfem.ElementVector(skfem.ElementQuad2()), intorder=6)
    x, y = basis.doflocs
    sideways = _components(basis)
    end = x.max()
    held, moved = np.isclose(x, -end, rtol=0, atol=1e-9), np.isclose(x, end, rtol=0, atol=1e-9)
    free = np.flatnonzero(~(held | moved))
    # The right face follows the rigid motion of (1, 0): u = dx - y alpha, v = dy + (x - 1) alpha.
    face = np.flatnonzero(moved)
    rigid = np.zeros((3, face.size))
    rigid[0], rigid[1] = ~sideways[face], sideways[face]
    rigid[2] = np.where(sideways[face], x[face] - 1, -y[face])
    n = free.size
    rows = np.concatenate([free, np.tile(face, 3)])
    columns = np.concatenate([np.arange(n), n + np.repeat(np.arange(3), face.size)])
    T = csc_matrix((np.concatenate([np.ones(n), rigid.ravel()]), (rows, columns)), shape=(basis.N, n + 3))
    K = _stiffness(notch.nu).assemble(basis)
    load = np.vstack([np.zeros((n, 3)), np.eye(3)])
    motion = splu((T.T @ K @ T).tocsc()).solve(load)
    if reading in (Reading.RIGID, Reading.BLOCKS):
        return motion[n:]
    u = T @ motion
    left, right = (_section(basis, sideways, u, side, reading) for side in (-1.0, 1.0))
    relative = right - left
    relative[1] -= 2 * left[2]  # the left section's rotation moves (1, 0) too
    return relative


def mesh(notch: Notch, grid: Grid) -> skfem.MeshQuad2:
    """Columns of elements between the two arcs, then the blocks; both end sections are mesh lines."""
    near = np.sqrt(notch.ratio)  # bending is concentrated within sqrt(t R) of the neck
    angles = near * np.sinh(np.linspace(-1, 1, grid.along + 1) * np.arcsinh(np.pi / 2 / near))
    columns = list(angles)
    if notch.block:
        beyond = list(np.pi / 2 + np.linspace(0, 1, grid.block + 1)[1:])
        columns = [-a for a in reversed(beyond)] + columns + beyond
    flat = skfem.MeshQuad2.from_mesh(skfem.MeshQuad.init_tensor(np.array(columns), np.linspace(-1, 1, grid.across + 1)))
    along, across = flat.doflocs
    angle = np.clip(along, -np.pi / 2, np.pi / 2)
    out = along - angle
    x = np.sin(angle) + np.sign(out) * notch.block * np.abs(out) ** 1.5
    half_height = notch.ratio / 2 + 1 - np.cos(angle)
    return skfem.MeshQuad2(np.array([x, across * half_height]), flat.t)


def change_on_refinement(notch: Notch, reading: Reading = Reading.CENTRE, grid: Grid | None = None) -> float:
    """Largest relative change of the four compliances when the elements are halved in each direction."""
    coarse = compliance(notch, reading, grid)
    fine = compliance(notch, reading, (grid or Grid()).finer())
    at = ([0, 1, 1, 2], [0, 1, 2, 2])
    return float(np.abs(coarse[at] / fine[at] - 1).max())


def sweep(ratios: Sequence[float], nu: float, reading: Reading = Reading.CENTRE) -> np.ndarray:
    """`compliance` for each t/R, shape (n, 3, 3)."""
    return np.array([compliance(Notch(ratio, nu), reading) for ratio in ratios])


def _stiffness(nu: float) -> skfem.BilinearForm:
    @skfem.BilinearForm
    def plane_stress(u, v, _):
        e, f = sym_grad(u), sym_grad(v)
        return (nu * trace(e) * trace(f) + (1 - nu) * ddot(e, f)) / (1 - nu**2)

    return plane_stress


def _components(basis: skfem.Basis) -> np.ndarray:
    """(N,) True for the degrees of freedom that are y components."""
    y = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        y[dofs[1::2]] = True
    return y


def _section(basis: skfem.Basis, sideways: np.ndarray, u: np.ndarray, side: float, reading: Reading) -> np.ndarray:
    """Displacement and rotation of the section x = `side` for each load, shape (3, loads)."""
    x, y = basis.doflocs
    on = np.isclose(x, side, rtol=0, atol=1e-9)
    xs, ys = (np.flatnonzero(on & part) for part in (~sideways, sideways))
    xs, ys = xs[np.argsort(y[xs])], ys[np.argsort(y[ys])]
    h = y[xs]
    weight = np.ones(h.size)  # Simpson's rule, exact on the quadratic elements
    weight[1:-1:2], weight[2:-1:2] = 4, 2
    weight *= (h[2] - h[0]) / 6
    rotation = -(weight * h) @ u[xs] / ((weight * h) @ h)
    if reading is Reading.CENTRE:
        middle = h.size // 2
        return np.array([u[xs[middle]], u[ys[middle]], rotation])
    return np.array([weight @ u[xs], weight @ u[ys], rotation * weight.sum()]) / weight.sum()
