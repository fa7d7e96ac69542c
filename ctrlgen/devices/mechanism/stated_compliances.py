"""Elements of a mechanism stated by their compliance, such as one from finite elements."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.mechanism.joining import Joining
from ctrlgen.devices.stated_matrix import matrix_faults, symmetric_note
from ctrlgen.physics.screw import TWIST, Matrix


class Compliance(Joining):
    """A flexure by its compliance about its free end, such as one from finite elements or a notch by its equations."""

    kind: Literal["compliance"]
    """A compliance matrix of one's own; what is left out is zero, and by reciprocity given once."""
    theta_x_per_M_x: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Torsion."""
    theta_y_per_M_y: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Rotation about y."""
    theta_z_per_M_z: Annotated[Quantity, In("rad/(N*m)", positive=True)]
    """Rotation about z."""
    delta_x_per_F_x: Annotated[Quantity, In("m/N", positive=True)]
    """Extension."""
    delta_y_per_F_y: Annotated[Quantity, In("m/N", positive=True)]
    """Deflection along y."""
    delta_z_per_F_z: Annotated[Quantity, In("m/N", positive=True)]
    """Deflection along z."""
    theta_z_per_F_y: Annotated[Quantity, In("rad/N")] | None = None
    """Rotation about z per force along y, which is delta_y per M_z. Left out: none."""
    theta_y_per_F_z: Annotated[Quantity, In("rad/N")] | None = None
    """Rotation about y per force along z, which is delta_z per M_y. Left out: none."""
    theta_x_per_F_z: Annotated[Quantity, In("rad/N")] | None = None
    """Torsion per force along z, which is delta_z per M_x. Left out: none."""

    @model_validator(mode="after")
    def _stores_energy(self) -> Compliance:
        given = ((key, getattr(self, key)) for key in type(self).model_fields)
        p = SimpleNamespace(**{key: value.si if isinstance(value, Quantity) else None for key, value in given})
        # Deflection per load, now symmetric
        C = ca.DM(self.compliance(p, SimpleNamespace())).full()[[3, 4, 5, 0, 1, 2]]
        if np.linalg.eigvalsh(C / np.sqrt(np.outer(np.diag(C), np.diag(C)))).min() <= 0:
            raise ValueError(
                "the compliance is not positive definite: a load would gain energy from it; check the couplings"
            )
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6), twist per wrench."""
        z, y, x = (0.0 if c is None else c for c in (p.theta_z_per_F_y, p.theta_y_per_F_z, p.theta_x_per_F_z))
        turns = (p.theta_x_per_M_x, p.theta_y_per_M_y, p.theta_z_per_M_z)
        return compliance_of_entries(turns, (p.delta_x_per_F_x, p.delta_y_per_F_y, p.delta_z_per_F_z), z, y, x)


class ComplianceMatrix(Joining):
    """A flexure by its whole compliance matrix about its free end, in its own frame."""

    kind: Literal["matrix"]
    """A compliance matrix of one's own, by all its entries."""
    compliance_si: tuple[tuple[float, float, float, float, float, float], ...] = Field(min_length=6, max_length=6)
    """Twist (theta_x, theta_y, theta_z, delta_x, delta_y, delta_z) per wrench (F_x, F_y, F_z, M_x, M_y, M_z), in rad, m, N, N m."""

    @model_validator(mode="after")
    def _stores_energy(self) -> ComplianceMatrix:
        if faults := matrix_faults("compliance_si", self._per_load, TWIST):
            raise ValueError("; ".join(faults))
        return self

    @property
    def _per_load(self) -> np.ndarray:
        """(6, 6) with moments before forces: symmetric by reciprocity."""
        return np.array(self.compliance_si)[:, [3, 4, 5, 0, 1, 2]]

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """That it was made symmetric."""
        return symmetric_note("compliance_si", self._per_load)

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix:
        """[C] about the free end (6, 6): the symmetric part of what the file states."""
        C = self._per_load
        return ca.DM(((C + C.T) / 2)[:, [3, 4, 5, 0, 1, 2]])


def compliance_of_entries(turns: Sequence[Any], shifts: Sequence[Any], z: Any, y: Any, x: Any = 0.0) -> Matrix:
    """[C] (6, 6) of theta per M, delta per F, and theta_z/F_y = delta_y/M_z, theta_y/F_z = delta_z/M_y, theta_x/F_z = delta_z/M_x."""
    rows = [
        [0, 0, x, turns[0], 0, 0],
        [0, 0, y, 0, turns[1], 0],
        [0, z, 0, 0, 0, turns[2]],
        [shifts[0], 0, 0, 0, 0, 0],
        [0, shifts[1], 0, 0, 0, z],
        [0, 0, shifts[2], x, y, 0],
    ]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))
