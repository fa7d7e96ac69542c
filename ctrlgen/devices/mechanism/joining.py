"""What all elements of a mechanism have: the bodies that they join, and where; how far they hold them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.place import Direction, Place
from ctrlgen.devices.section import Section
from ctrlgen.physics import rigid_bodies as mechanism
from ctrlgen.physics.flexure import Segment
from ctrlgen.physics.screw import TWIST, Matrix, inverse

Length = Annotated[Quantity, In("mm", positive=True)]
STIFF = 0.01  # of the largest compliance of a mechanism's flexures, below which a direction counts as held


class Joining(Section):
    """What all elements have: whom they join, and where."""

    ideal: ClassVar[tuple[str, ...] | None] = None  # what the ideal flexure holds, where there is one

    name: Name
    """In messages and reports."""
    from_: str = Field(alias="from")
    """The body at its fixed end, or "ground"."""
    to: str
    """The body at its free end."""
    at: Place
    """Its free end in the global frame."""
    along: Direction = (1.0, 0.0, 0.0)
    """Direction from its fixed to its free end, its x axis; of any length."""
    across: Direction | None = None
    """A direction that fixes its y axis, along which a blade is thin; not parallel to `along`. Left out: y, or z where `along` is y."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _has_a_frame(self) -> Joining:
        if self.from_ == self.to:
            raise ValueError(f"from and to are both {self.to!r}; an element joins two bodies, or one and the ground")
        if not (np.isfinite(self.along).all() and np.any(self.along)):
            raise ValueError(f"along: {list(self.along)} is no direction; give one, such as [0, 1, 0]")
        if np.linalg.norm(np.cross(self.along, self.thin)) < 1e-6 * np.linalg.norm(self.along) * np.linalg.norm(
            self.thin
        ):
            raise ValueError("across: is parallel to along, or one of them is zero; give two directions")
        return self

    def compliance(self, p: SimpleNamespace, m: SimpleNamespace) -> Matrix | None:
        """[C] about its free end (6, 6), twist per wrench, with its numbers `p` and its material's `m`; None where it has none."""
        raise NotImplementedError

    def stiffness(self, C: Matrix | None, p: SimpleNamespace) -> Matrix:
        """[K] about its free end (6, 6), wrench per twist, from its compliance `C`."""
        return inverse(C)

    def cubic_terms(self, p: SimpleNamespace) -> dict[int, Any]:
        """Its forces that grow with the cube: place in the twist -> k_3 of the wrench k_3 e^3 [N/m^3, N m/rad^3]."""
        return {}

    def reach(self, p: SimpleNamespace) -> Any:
        """Distance between its ends [m]; None where it says none."""
        return None

    def segments(self, p: SimpleNamespace, m: SimpleNamespace) -> tuple[Segment, ...]:
        """The uniform pieces that it consists of, from its fixed end; none where it yields at one point, its pivot."""
        return ()

    def notes(self, held_length: float | None, poisson: float) -> list[str]:
        """Where its sizes leave the range of its equations; `held_length` [m] is that of the blade of which it is a piece, `poisson`
        that of its material."""
        return []

    def pivot(self, p: SimpleNamespace) -> Any:
        """Distance from its free end, toward the fixed one, of the point at which it holds its ideal directions [m]."""
        return 0.0

    @property
    def thin(self) -> Direction:
        """The thin direction: `across`, or without it the axis z or y that is not along the element."""
        if self.across is not None:
            return self.across
        return (0.0, 0.0, 1.0) if abs(self.along[1]) > 0.9 * np.linalg.norm(self.along) else (0.0, 1.0, 0.0)

    @property
    def frame(self) -> Matrix:
        """R (3, 3) from its own frame to the global one."""
        return mechanism.frame(ca.DM(self.along), ca.DM(self.thin))

    def constrained(self, C: np.ndarray, largest: float) -> np.ndarray:
        """(m, 6): the directions of relative twist at its free end, in its frame, that count as held: those of the ideal flexure, or
        those in which its compliance C (6, 6), turns counted as displacements, is below a share `STIFF` of the `largest` one in the
        mechanism."""
        if self.ideal is not None:
            return np.eye(6)[[TWIST.index(name) for name in self.ideal]]
        values, directions = np.linalg.eigh((C + C.T) / 2)
        return directions[:, values < STIFF * largest].T
