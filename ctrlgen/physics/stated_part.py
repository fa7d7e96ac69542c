"""Parts known by their stiffness and mass alone, as a finite-element program condenses them to ports.

A port is a place p at which a body holds the part; its motion is the twist (theta, delta) there, its load (M, F), in the axes of the
global frame, so that K and M (6 P, 6 P) of P ports are symmetric. A rigid motion (theta, delta) at the origin moves a port by
(theta, delta + theta x p), the rows of R (6 P, 6): it stores no energy, K R = 0, and moves the whole mass,

    R' M R = [[J, m S], [-m S, m I]],   S = [r x], r the centre of mass.

Source: superelements and their rigid-body checks, R. R. Craig, A. J. Kurdila, Fundamentals of Structural Dynamics (2006), chapter 17.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NOISE = 1e-9  # of the stiffest row: a row that is softer is held by nothing, and what stands in it is rounding


def skew(r: np.ndarray) -> np.ndarray:
    """[r x] (3, 3)."""
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def rigid_motions(places: np.ndarray) -> np.ndarray:
    """R (6 P, 6) of ports at `places` (P, 3) [m]: their motions per twist at the origin."""
    I, zero = np.eye(3), np.zeros((3, 3))
    return np.vstack([np.block([[I, zero], [-skew(p), I]]) for p in places])


def extent(K: np.ndarray, places: np.ndarray) -> float:
    """The length [m] by which turns of ports count as displacements: half the distance of those farthest apart, or where all
    are in one place that at which turning is as stiff as shifting."""
    apart = float(np.linalg.norm(places[:, None] - places[None], axis=-1).max()) / 2
    if apart > 0:
        return apart
    turns, shifts = (np.diag(K).reshape(-1, 2, 3)[:, half].max() for half in (0, 1))
    return float(np.sqrt(turns / shifts)) if turns > 0 < shifts else 1e-3


def counted(size: float, ports: int) -> np.ndarray:
    """(6 P,) by which motions are multiplied where turns count as displacements at `size` [m]."""
    return np.tile([1 / size] * 3 + [1.0] * 3, ports)


def held_by_nothing(K: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(6,) load that rigid turns about and shifts along x, y, z meet in the worst row, as a share of the largest sum of magnitudes that
    any of the six puts into that row: zero of a part that is free."""
    size = extent(K, places)
    by = counted(size, len(places))
    R = rigid_motions(places - places.mean(axis=0)) / by[:, None] * np.array([1 / size] * 3 + [1.0] * 3)
    scaled = K * np.outer(by, by)
    most = (np.abs(scaled) @ np.abs(R)).max(axis=1)
    return np.asarray((np.abs(scaled @ R) / np.maximum(most, NOISE * most.max())[:, None]).max(axis=0))


def freed(K: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The matrix (6 P, 6 P) nearest to K, turns counted as displacements, that rigid motions meet no load in: P K P, P off them."""
    by = counted(extent(K, places), len(places))
    Q, _ = np.linalg.qr(rigid_motions(places - places.mean(axis=0)) / by[:, None])
    off = np.eye(len(by)) - Q @ Q.T
    free = off @ (K * np.outer(by, by)) @ off
    return np.asarray((free + free.T) / 2 / np.outer(by, by))


def unit_eigenvalues(K: np.ndarray) -> np.ndarray:
    """Eigenvalues, ascending, of K with a diagonal of ones; rows without a diagonal are left out."""
    size = np.sqrt(np.maximum(np.diag(K), 0.0))
    kept = size > 0
    return np.asarray(np.linalg.eigvalsh((K[np.ix_(kept, kept)]) / np.outer(size[kept], size[kept])))


@dataclass(frozen=True, eq=False)
class RigidMass:
    """What a mass matrix weighs where the part moves rigidly: `mass` [kg], `centre` (3,) [m], `inertia` (3, 3) about it [kg m^2], and how
    far R' M R is from that of any body, `off`, as a share of the mass, turns counted as displacements."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    off: float


def rigid_mass(M: np.ndarray, places: np.ndarray, size: float) -> RigidMass:
    """The mass, centre and inertia of M (6 P, 6 P) at `places` (P, 3) [m], `size` [m] of the part."""
    middle = places.mean(axis=0)
    R = rigid_motions(places - middle)
    whole = R.T @ M @ R
    mass = float(np.trace(whole[3:, 3:])) / 3
    coupling = whole[3:, :3]  # -m S
    r = np.array([coupling[1, 2] - coupling[2, 1], coupling[2, 0] - coupling[0, 2], coupling[0, 1] - coupling[1, 0]])
    r = r / (2 * mass) if mass > 0 else np.zeros(3)
    S, J = skew(r), whole[:3, :3]
    ideal = np.block([[J, mass * S], [-mass * S, mass * np.eye(3)]])
    by = counted(size, 1)
    off = float(np.abs((whole - ideal) * np.outer(by, by)).max() / mass) if mass > 0 else np.inf
    return RigidMass(mass, middle + r, J + mass * S @ S, off)
