"""A flexure hinge: a section that any device file may use, such as

hinge = { kind = "circular", R = "1.1 mm", t = "0.84 mm", equation = "auto" }
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, Literal, get_args

from pydantic import model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.section import Section
from ctrlgen.physics import circular_hinge_table as table
from ctrlgen.physics.screw import Matrix, Scalar

Length = Annotated[Quantity, In("mm", positive=True)]
Group = Literal[
    "auto",
    "paros_weisbord",
    "paros_weisbord_simplified",
    "smith",
    "zhang_fasse",
    "wu_zhou",
    "tseytlin",
    "lobontiu",
    "schotborgh",
    "composed",
]


class HingeEquations(Section):
    """The authors whose equation gives each compliance, named as in S3 Table 2; one name instead of the table means all three."""

    alpha_z_per_M_z: Group = "auto"
    """Rotation per moment: authors of the equation."""
    delta_y_per_F_y: Group = "auto"
    """Deflection across the hinge per force: authors of the equation."""
    delta_x_per_F_x: Group = "auto"
    """Extension along the hinge per force: authors of the equation."""

    @model_validator(mode="before")
    @classmethod
    def _one_for_all(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        known = get_args(Group)
        if given not in known:
            raise ValueError(f"{given!r} must be one of {', '.join(known)}, or a table with one of them per compliance")
        return dict.fromkeys(table.PLANAR, given)


class Hinge(Section):
    """A right circular hinge. Width and material may be its own or come from the device."""

    kind: Literal["circular"]
    """A hinge with two circular cut-outs."""
    R: Length
    """Radius of the cut-outs."""
    t: Length
    """Least thickness, at the neck; t/R decides which equations hold."""
    equation: HingeEquations = HingeEquations()
    """Authors of the equations: one name for all three compliances, a table with one each, or `auto`, the one that S3
    Table 3 recommends at this t/R.
    """
    outside: table.Outside = "refuse"
    """What happens where t/R is outside an equation's range: an error, a warning, or nothing (`ctrlgen check` still
    says so).
    """
    shear_factor: Annotated[Quantity, In("1", low=0.0, high=2.0)] | None = None
    """Factor of the shear term of delta_y/F_y, 3/2 for a rectangular section; 0 leaves shear out. Left out: each
    author's own.
    """
    b: Length | None = None
    """Width, normal to the plane of motion. Left out: the device's."""
    young: Annotated[Quantity, In("GPa", positive=True)] | None = None
    """Young's modulus. Left out: the device's."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)] | None = None
    """Poisson's ratio. Left out: the device's."""

    @model_validator(mode="after")
    def _equations_hold(self) -> Hinge:
        faults = []
        for compliance, group in self.equations.items():
            try:
                table.choose(compliance, self.ratio, group, self.outside)
            except ValueError as fault:
                faults.append(str(fault))
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def ratio(self) -> float:
        """t/R, which selects the equations."""
        return self.t.si / self.R.si

    @property
    def equations(self) -> dict[str, str]:
        """The chosen group of authors for each compliance."""
        return {key: getattr(self.equation, key) for key in table.PLANAR}

    def notes(self) -> list[str]:
        """One sentence on each compliance whose equation S3 Table 3 does not recommend at this t/R."""
        chosen = self.equations.items()
        return [note for key, group in chosen if (note := table.pedigree(key, self.ratio, group, self.outside)[1])]

    def geometry(
        self, p: SimpleNamespace, b: Scalar | None = None, E: Scalar | None = None, nu: Scalar | None = None
    ) -> table.Geometry:
        """The hinge with the numbers or symbols `p`, completed by the device's width `b` and material `E`, `nu`; SI. Raises
        ValueError where one is missing."""
        stated = {"b": p.b, "young": p.young, "poisson": p.poisson}
        given = {"b": b, "young": E, "poisson": nu}
        complete = {key: given[key] if value is None else value for key, value in stated.items()}
        missing = [key for key, value in complete.items() if value is None]
        if missing:
            raise ValueError(f"hinge: {missing[0]} is missing; give it in the hinge or in the device")
        return table.Geometry(
            p.R, p.t, complete["b"], complete["young"], complete["poisson"], p.shear_factor, at=self.ratio
        )

    def planar(
        self, p: SimpleNamespace, b: Scalar | None = None, E: Scalar | None = None, nu: Scalar | None = None
    ) -> Matrix:
        """Compliance (delta_x, delta_y, alpha_z) per (F_x, F_y, M_z) at the hinge's end, shape (3, 3), SI."""
        return table.planar(self.geometry(p, b, E, nu), self.equations, self.outside)
