"""Springs of a mechanism: stiffnesses in chosen directions, and forces that grow with the cube of the displacement."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, Literal

import casadi as ca
from pydantic import model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.mechanism.joining import Joining
from ctrlgen.physics.screw import TWIST, Matrix

Translational = Annotated[Quantity, In("N/um", low=0.0)]
Torsional = Annotated[Quantity, In("N*m/rad", low=0.0)]


class Spring(Joining):
    """A spring between the points of two bodies that meet at `at`, or several springs there: F = k_1 e + k_3 e^3 in each direction
    that is given, e the displacement (turn) of the second body's point against the first one's."""

    kind: Literal["spring"]
    """Stiffnesses by direction, in its own frame; a direction that is left out is free."""
    F_x_per_delta_x: Translational | None = None
    """Along x, which is `along`."""
    F_y_per_delta_y: Translational | None = None
    """Along y."""
    F_z_per_delta_z: Translational | None = None
    """Along z."""
    M_x_per_theta_x: Torsional | None = None
    """About x."""
    M_y_per_theta_y: Torsional | None = None
    """About y."""
    M_z_per_theta_z: Torsional | None = None
    """About z."""
    F_x_per_delta_x3: Annotated[Quantity, In("N/um^3")] | None = None
    """k_3 along x: the force F_x_per_delta_x e + k_3 e^3. Negative where the spring softens."""
    M_x_per_theta_x3: Annotated[Quantity, In("N*m/rad^3")] | None = None
    """k_3 about x."""

    @model_validator(mode="after")
    def _acts(self) -> Spring:
        if not self.directions and not self.cubic:
            raise ValueError('gives no stiffness; add one, such as F_x_per_delta_x = "0.5 N/um"')
        return self

    @property
    def directions(self) -> list[int]:
        """Places in the twist in which it has a linear stiffness above zero."""
        given = {place: getattr(self, _stiffness_name(place)) for place in range(6)}
        return [place for place, k in given.items() if k is not None and k.si > 0]

    @property
    def cubic(self) -> bool:
        """Whether some of its forces grow with the cube."""
        return self.F_x_per_delta_x3 is not None or self.M_x_per_theta_x3 is not None

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> None:
        """None: in some directions it yields without a force."""

    def stiffness(self, C: Matrix | None, p: SimpleNamespace) -> Matrix:
        """[K] about `at` (6, 6): F_i = k_i delta_i, M_i = k_i theta_i."""
        K = ca.SX(6, 6)
        for place in range(6):
            k = getattr(p, _stiffness_name(place))
            if k is not None:
                K[(place + 3) % 6, place] = k
        return K

    def cubic_terms(self, p: SimpleNamespace) -> dict[int, Any]:
        """k_3 of its translation along x and of its turn about x, where they are given."""
        given = {TWIST.index("delta_x"): p.F_x_per_delta_x3, TWIST.index("theta_x"): p.M_x_per_theta_x3}
        return {place: k for place, k in given.items() if k is not None}


def _stiffness_name(place: int) -> str:
    """'M_x_per_theta_x' for the first place in the twist."""
    twist = TWIST[place]
    return f"{'M' if twist.startswith('theta') else 'F'}_{twist[-1]}_per_{twist}"
