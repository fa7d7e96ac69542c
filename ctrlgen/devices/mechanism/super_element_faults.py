"""What makes matrices of a finite-element program impossible for a part that is free, and which usual mistake would mend them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ctrlgen.devices.mechanism.tables import FLAT
from ctrlgen.devices.mechanism.written_matrix import Written
from ctrlgen.devices.stated_matrix import MOST_ASYMMETRY
from ctrlgen.physics.screw import TWIST
from ctrlgen.physics.stated_part import (
    NOISE,
    counted,
    extent,
    freed,
    held_by_nothing,
    rigid_mass,
    unit_eigenvalues,
)

HELD = 1e-3
"""Share of the loads of a row that rigid motions may meet: of a matrix printed to four digits; a mistake makes a tenth or more."""
FREED = 1e-6
"""The same from which on it is told: single precision, or seven printed digits."""
GAINED = 1e-4
"""Negative eigenvalue, diagonal of ones, that four printed digits may make."""
FIRST = ("delta_x", "delta_y", "delta_z", "theta_x", "theta_y", "theta_z")
LENGTHS = ("mm", "m", "um", "cm")
MOST_ORDERS = 4
"""Ports whose orders are all tried: 24 of them."""
Trial = tuple[str, Written]


def stiffness_faults(written: Written) -> list[str]:
    """What keeps K from being symmetric, free and without a gain of energy."""
    K = written.in_si("stiffness")
    if faults := _symmetric("stiffness", K, extent(K, written.places)):
        return faults
    held = held_by_nothing((K + K.T) / 2, written.places)
    if held.max() > HELD:
        named = [name.replace("theta_", "turning about ").replace("delta_", "shifting along ") for name in TWIST]
        met = ", ".join(f"{name} {share:.2g}" for name, share in zip(named, held, strict=True) if share > HELD)
        told = f"{met} (at most {HELD:g}); {_mending(written)}"
        return [f"stiffness: a rigid motion meets a load, as a share of those of its rows: {told}"]
    eigenvalues = unit_eigenvalues(freed((K + K.T) / 2, written.places))
    if eigenvalues[0] < -GAINED * eigenvalues[-1]:
        return [
            f"stiffness: not positive semidefinite (eigenvalue {eigenvalues[0]:.2g}, diagonal of ones): some load would gain "
            "energy from the part; check signs, and that it is the stiffness and not the compliance"
        ]
    return []


def mass_faults(written: Written, M: np.ndarray) -> list[str]:
    """What keeps M from being that of a body where the part moves rigidly."""
    size = extent(written.in_si("stiffness"), written.places)
    if faults := _symmetric("mass", M, size):
        return faults
    M = (M + M.T) / 2
    weighed = rigid_mass(M, written.places, size)
    if not weighed.mass > 0:
        return [f"mass: the part weighs {1e3 * weighed.mass:.3g} g where it moves rigidly; check signs"]
    if weighed.off > HELD:
        return [
            f"mass: moved rigidly it is no body: what shifts, and what turns it, differ by {weighed.off:.2g} of the mass "
            f"(at most {HELD:g}); its rows must stand in the order, the units and the frame of those of the stiffness"
        ]
    principal = np.linalg.eigvalsh(weighed.inertia)
    if principal[0] < -FLAT * principal[2] or principal[2] > (principal[0] + principal[1]) * (1 + FLAT):
        return [
            "mass: about its centre of mass one moment of inertia is above the sum of the others; check units.length and the places"
        ]
    eigenvalues = unit_eigenvalues(M)
    if eigenvalues[0] < -GAINED * eigenvalues[-1]:
        return [f"mass: not positive semidefinite (eigenvalue {eigenvalues[0]:.2g}, diagonal of ones): check signs"]
    return []


def _mending(written: Written) -> str:
    """Which usual mistake, or two of them, would explain a stiffness that is not free."""
    single = list(_trials(written))
    double = (
        (f"{one}, and {other}", second)
        for (one, first) in single
        for other, second in _trials(first)
        if one.split(" = ")[0] != other.split(" = ")[0]
    )
    for told, trial in itertools.chain(single, double):
        if _held(trial).max() <= HELD:
            return f"it would be free with {told}"
    if _held(written)[3:].max() > HELD:
        return (
            "no usual mistake explains it: shifted it resists too, so that it is held somewhere, or a port is left out"
        )
    return "no usual mistake explains it: it may be shifted freely, but not turned; check the places of the ports"


def _held(written: Written) -> np.ndarray:
    K = written.in_si("stiffness")
    return held_by_nothing((K + K.T) / 2, written.places)


def _trials(written: Written) -> Iterator[Trial]:
    """The usual mistakes: each what the table would say, and the matrix read so."""
    turns_first = tuple(TWIST)
    for order in (FIRST, turns_first):
        if tuple(written.order) != order:
            yield f"order = [{', '.join(map(repr, order))}]".replace("'", '"'), replace(written, order=order)
    for length in LENGTHS:
        if length != written.units.length:
            units = written.units.model_copy(update={"length": length})
            yield f'units.length = "{length}"', replace(written, units=units)
    other = "motion" if written.sorted_by == "port" else "port"
    yield f'sorted_by = "{other}"', replace(written, sorted_by=other)
    for along, across in _axes():
        turned = replace(written, along=along, across=across)
        if np.abs(turned.axes - written.axes).max() > FLAT:
            yield f"along = {list(along)} and across = {list(across)}", turned
    if len(written.places) <= MOST_ORDERS:
        for places in itertools.permutations(range(len(written.places))):
            if places != tuple(range(len(written.places))):
                named = ", ".join(str(k + 1) for k in places)
                yield f"ports in the order {named}", replace(written, places=written.places[list(places)])
    signs = np.where(np.array([name.startswith("theta") for name in written.order]), -1.0, 1.0)
    ports = len(written.places)
    all_rows = np.tile(signs, ports) if written.sorted_by == "port" else np.repeat(signs, ports)
    yield "rotations of the other sign", written.of(written.numbers * np.outer(all_rows, all_rows))


def _axes() -> Iterator[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """The 24 ways to lay axes along axes."""
    unit = [tuple(float(s * (i == k)) for i in range(3)) for k in range(3) for s in (1, -1)]
    for along, across in itertools.permutations(unit, 2):
        if np.any(np.cross(along, across)):
            yield along, across  # type: ignore[misc]


def asymmetry(K: np.ndarray, size: float) -> np.ndarray:
    """(6 P, 6 P) |K_ij - K_ji|/sqrt(K_ii K_jj), turns counted as displacements at `size` [m]; a diagonal of rounding counts as `NOISE` of
    the largest, as lumped masses have none of turns."""
    by = counted(size, len(K) // 6)
    diagonal = np.diag(K) * by**2
    least = np.sqrt(np.maximum(diagonal, NOISE * diagonal.max()))
    return np.asarray(np.abs(K - K.T) * np.outer(by, by) / np.outer(least, least))


def _symmetric(key: str, K: np.ndarray, size: float) -> list[str]:
    """That K_ij and K_ji differ by more than `MOST_ASYMMETRY` of sqrt(K_ii K_jj)."""
    diagonal = np.diag(K)
    if not diagonal.max() > 0 or np.any(diagonal < 0):
        return [f"{key}: on its diagonal nothing is above zero, or a number is below it; check signs"]
    share = asymmetry(K, size)
    if share.max() > MOST_ASYMMETRY:
        i, j = np.unravel_index(int(share.argmax()), share.shape)
        first, second = (f"{TWIST[k % 6]} of port {k // 6 + 1}" for k in (int(i), int(j)))
        what = f"{first} and {second} differ across the diagonal by {100 * share.max():.2g} %"
        return [f"{key}: is not symmetric: {what}; by reciprocity they are equal"]
    return []
