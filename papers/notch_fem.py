"""A circular notch in space by finite elements: triquadratic hexahedra, both ends held as rigid plates, as S1 section 3.2.

The reference for S1 eq. (7); it imports nothing of ctrlgen. Needs scikit-fem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu
from skfem.helpers import ddot, sym_grad, trace


@dataclass(frozen=True)
class SolidNotch:
    """Radius, neck and depth [m], Young's modulus [Pa], Poisson's ratio."""

    R: float
    t: float
    b: float
    E: float
    nu: float


@dataclass(frozen=True)
class SolidGrid:
    """Elements along the notch, across its height and through its depth; smaller towards the neck.

    Twenty by four by four change no compliance by more than 0.5 %."""

    along: int = 14
    across: int = 4
    deep: int = 3


def compliance(notch: SolidNotch, grid: SolidGrid | None = None) -> np.ndarray:
    """[C] of twist (theta, delta) per wrench (F, M) about the right end's centre, x along the notch, (6, 6), SI.

    The left end is fixed, the right end moves as a rigid plate.
    """
    basis = skfem.Basis(_mesh(notch, grid or SolidGrid()), skfem.ElementVector(skfem.ElementHex2()), intorder=4)
    x, y, z = basis.doflocs
    component = _components(basis)
    held, moved = (np.isclose(x, at, rtol=0, atol=1e-9) for at in (-1.0, 1.0))
    free, face = np.flatnonzero(~(held | moved)), np.flatnonzero(moved)
    still = np.zeros(face.size)
    turns = ((still, -z[face], y[face]), (z[face], still, still), (-y[face], still, still))
    columns = [np.choose(component[face], turn) for turn in turns]
    columns += [(component[face] == k).astype(float) for k in range(3)]
    n = free.size
    T = csc_matrix(
        (
            np.concatenate([np.ones(n), *columns]),
            (
                np.concatenate([free, np.tile(face, 6)]),
                np.concatenate([np.arange(n), n + np.repeat(np.arange(6), face.size)]),
            ),
        ),
        shape=(basis.N, n + 6),
    )
    K = _elasticity(notch.nu).assemble(basis)
    load = np.vstack([np.zeros((n, 6)), np.eye(6)])
    by_generalised = splu((T.T @ K @ T).tocsc(), permc_spec="COLAMD").solve(load)[n:]  # twist per (M, F), E = R = 1
    size = np.repeat([1.0, notch.R], 3)
    C = by_generalised * np.outer(size, size) / (notch.E * notch.R**3)
    return C[:, [3, 4, 5, 0, 1, 2]]


def _mesh(notch: SolidNotch, grid: SolidGrid) -> skfem.MeshHex2:
    """In units of R: columns of elements between the two arcs, equal layers through the depth."""
    near = np.sqrt(notch.t / notch.R)  # bending is concentrated within sqrt(t R) of the neck
    angles = near * np.sinh(np.linspace(-1, 1, grid.along + 1) * np.arcsinh(np.pi / 2 / near))
    across = np.linspace(-1, 1, grid.across + 1)
    deep = np.linspace(-0.5, 0.5, grid.deep + 1) * notch.b / notch.R
    flat = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(angles, across, deep))
    angle, height, z = flat.doflocs
    half_height = notch.t / notch.R / 2 + 1 - np.cos(angle)
    return skfem.MeshHex2(np.array([np.sin(angle), height * half_height, z]), flat.t)


def _elasticity(nu: float) -> skfem.BilinearForm:
    first, second = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    @skfem.BilinearForm
    def energy(u, v, _):
        e, f = sym_grad(u), sym_grad(v)
        return first * trace(e) * trace(f) + 2 * second * ddot(e, f)

    return energy


def _components(basis: skfem.Basis) -> np.ndarray:
    component = np.zeros(basis.N, int)
    for k in range(3):
        component[basis.get_dofs(elements=True).all(f"u^{k + 1}")] = k
    return component
