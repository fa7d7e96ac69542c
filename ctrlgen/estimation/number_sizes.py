"""Typical sizes of the numbers of a device: a number's own, and of one that is zero what the rest of the file makes of it.

Of a zero the typical size is `SHARE` of the largest number of the same dimension. Where there is none it is the product of powers of
the typical force F, displacement D, drive U and time T = sqrt(m D/F) of the device that has its dimension, such as F T/D for a damping
(E. Buckingham, Phys. Rev. 4 (1914) 345). So a machine of another size has zeros of another size; an angle and a ratio have none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.core.units import exponents, same_dimension, written_unit
from ctrlgen.devices import Device, DevicePhysics, InertialPhysics
from ctrlgen.estimation.hypothesis import DEVICES_KEPT, nominal_physics, numbers

SHARE = 0.02
"""Of the largest number of its dimension: a millimetre in a drawing of 50 mm. Judgement."""
OTHER = 1e-3
"""[SI] of an angle or a ratio, and of a zero that nothing in the file is like. Judgement."""


@lru_cache(maxsize=DEVICES_KEPT)
def sizes_of_numbers(device: Device) -> dict[str, float]:
    """Typical size [SI], above zero, of every number outside the effects, by its path."""
    found = [(path, number.si, written_unit(number.text)) for path, _, number in numbers(device)]
    sizes = {path: abs(si) for path, si, _ in found}
    for path, si, unit in found:
        if not si:
            alike = [abs(other) for _, other, its in found if same_dimension(unit, its)]
            powers = exponents(unit) or {}
            sizes[path] = (SHARE * max(alike) or _typical(powers, device)) if set(powers) - {"rad"} else OTHER
    return sizes


def _typical(wanted: dict[str, int], device: Device) -> float:
    """The product [SI] of powers of the device's typical sizes that has the dimension `wanted`; `OTHER` where none has."""
    typical = list(_typical_sizes(nominal_physics(device)))
    base = sorted({name for powers in (wanted, *(p for p, _ in typical)) for name in powers} - {"rad"})
    columns = np.array([[powers.get(name, 0) for powers, _ in typical] for name in base], float)
    aim = np.array([wanted.get(name, 0) for name in base], float)
    powers = np.linalg.lstsq(columns, aim, rcond=None)[0]
    if not np.allclose(columns @ powers, aim, atol=1e-9):
        return OTHER
    return float(np.prod([size**power for (_, size), power in zip(typical, powers, strict=True)]))


def _typical_sizes(physics: DevicePhysics) -> Iterator[tuple[dict[str, int], float]]:
    """(powers of SI units, size) of F, D, U and, of a stage with inertia, T."""
    known = (
        (physics.force_unit, physics.force_scale),
        (physics.travel_unit, physics.displacement_scale),
        (physics.drive.units[0], physics.drive.scale[0]),
    )
    yield from ((powers, size) for unit, size in known if (powers := exponents(unit)) is not None)
    if isinstance(physics, InertialPhysics):
        masses = ca.vertcat(*physics.mass) if isinstance(physics.mass, tuple) else physics.mass
        heaviest = float(ca.mmax(ca.evalf(ca.SX(masses))))
        yield {"s": 1}, math.sqrt(heaviest * physics.displacement_scale / physics.force_scale)
