"""A super-element of a mechanism: a part by its stiffness and mass from a finite-element program, condensed to ports.

In the file of the program each port has six motions, in an order and in units that the table states. The part is linear: it stores
u' K u/2. What it would do beyond, such as come nearer as it bends, is not in K.

Source: superelements, R. R. Craig, A. J. Kurdila, Fundamentals of Structural Dynamics (2006), chapter 17.
"""

from __future__ import annotations

import reprlib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema, model_validator

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.matrix_file import StatedMatrix, read_matrix, square_fault
from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity, parse
from ctrlgen.devices.mechanism.super_element_faults import FREED, asymmetry, mass_faults, stiffness_faults
from ctrlgen.devices.mechanism.written_matrix import Written
from ctrlgen.devices.place import Direction
from ctrlgen.devices.section import Section
from ctrlgen.physics.screw import TwistComponent
from ctrlgen.physics.stated_part import RigidMass, extent, freed, held_by_nothing, rigid_mass

MOST_PORTS = 32
"""Of a super-element: 192 rows. With more a part is better condensed again."""
MATRICES = ("stiffness", "mass")


def _coordinate(text: object) -> float:
    """Metres; no quantity, as K belongs to these places and to no others."""
    return parse(text, "mm")


def _matrix(given: Any) -> StatedMatrix:
    if isinstance(given, StatedMatrix):
        return given
    if isinstance(given, str):
        raise ValueError(f"names the file {reprlib.repr(given)}, which is read beside a device file alone")
    try:
        numbers = np.array(given, float)
    except (TypeError, ValueError):
        raise ValueError("is no matrix; write a list of rows of numbers, or the name of a file") from None
    if (fault := square_fault(numbers, 6 * MOST_PORTS)) is not None:
        raise ValueError(fault)
    return StatedMatrix.of("", numbers)


Coordinate = Annotated[
    float,
    BeforeValidator(_coordinate),
    WithJsonSchema({"type": ["string", "number"], "title": "quantity", "x-unit": "mm"}),
]
Matrix = Annotated[
    StatedMatrix,
    BeforeValidator(_matrix),
    PlainSerializer(lambda m: m.file or m.numbers.tolist()),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string", "pattern": r"\.(npy|csv|txt|mtx)$"},
                {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
            ]
        }
    ),
]


class Port(Section):
    """`[[super_element.port]]`: where a body holds the part."""

    body: str
    """The body, or "ground"."""
    at: tuple[Coordinate, Coordinate, Coordinate]
    """Whose motion the matrices have, in the global frame; it moves with the body."""


class MatrixUnits(Section):
    """Units of the numbers in the matrices: stiffness in force/length, force and force*length, mass in mass, mass*length and
    mass*length^2."""

    length: Literal["m", "cm", "mm", "um"]
    """Of displacements and lever arms."""
    force: Literal["N", "kN", "mN", "uN"]
    """Of forces."""
    mass: Literal["kg", "g", "t"] | None = None
    """Of masses: with mm, N and s that is t, a tonne."""


class SuperElement(Section):
    """`[[super_element]]`: a part of the mechanism by its stiffness and mass matrices from a finite-element program."""

    name: Name
    """In messages and reports."""
    source: str = Field(min_length=1)
    """Where the matrices come from: program, version, mesh, what was condensed."""
    port: tuple[Port, ...] = Field(min_length=2, max_length=MOST_PORTS)
    """Its ports, in the order in which the matrices have them."""
    units: MatrixUnits
    """Units of the matrices, such as { length = "mm", force = "N", mass = "t" }."""
    order: tuple[TwistComponent, TwistComponent, TwistComponent, TwistComponent, TwistComponent, TwistComponent]
    """The six motions of a port in the order of the rows, such as the displacements first."""
    sorted_by: Literal["port", "motion"] = "port"
    """Whether the six rows of a port stand together, or those of a motion at all ports."""
    stiffness: Matrix
    """K, by rows, or a file beside the device file: .npy, .csv or .mtx (Matrix Market)."""
    mass: Matrix | None = None
    """M, likewise. Left out: it has none."""
    along: Direction = (1.0, 0.0, 0.0)
    """The x axis of the program, in the global frame; of any length."""
    across: Direction = (0.0, 1.0, 0.0)
    """A direction that fixes its y axis; not parallel to `along`."""
    stiffness_factor: Annotated[Quantity, In("1", positive=True)] | None = None
    """By which K is multiplied, such as { value = "1", sd = "3 %" } of an uncertain Young's modulus. Left out: 1."""
    mass_factor: Annotated[Quantity, In("1", positive=True)] | None = None
    """By which M is multiplied. Left out: 1."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _is_a_part(self) -> SuperElement:
        faults = []
        if len(set(self.order)) < len(self.order):
            faults.append("order: names a motion twice; give each of the six once")
        if np.linalg.norm(np.cross(self.along, self.across)) <= 1e-6 * np.linalg.norm(self.along) * np.linalg.norm(
            self.across
        ):
            faults.append("across: is parallel to along, or one of them is zero; give two directions")
        for key in MATRICES:
            stated = getattr(self, key)
            if stated is not None and stated.rows != 6 * len(self.port):
                faults.append(
                    f"{key}: has {stated.rows} rows; six at each of {len(self.port)} ports are {6 * len(self.port)}"
                )
        if len({p.body for p in self.port}) == 1:
            faults.append(
                f"port: all stand on {self.port[0].body}, which moves them as one; the part then does nothing"
            )
        if (self.mass is None) != (self.units.mass is None):
            faults.append("mass and units.mass belong together; give both or none")
        if self.mass is None and self.mass_factor is not None:
            faults.append("mass_factor: belongs to mass")
        faults = faults or stiffness_faults(self.written)
        if not faults and (M := self.as_written[1]) is not None:
            faults = mass_faults(self.written, M)
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @cached_property
    def written(self) -> Written:
        """The stiffness as the file has it, and how it is to be read."""
        places = np.array([p.at for p in self.port])
        return Written(self.stiffness.numbers, places, self.order, self.sorted_by, self.units, self.along, self.across)

    @cached_property
    def as_written(self) -> tuple[np.ndarray, np.ndarray | None]:
        """K and M (6 P, 6 P) in SI and in the global frame, twists (theta; delta) of the ports -> (M; F), as they are stated."""
        written = self.written
        M = None if self.mass is None else written.of(self.mass.numbers).in_si("mass")
        return written.in_si("stiffness"), M

    @cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray | None]:
        """The same, symmetric, and K the nearest one in which rigid motions meet no load."""
        K, M = self.as_written
        return freed((K + K.T) / 2, self.written.places), None if M is None else (M + M.T) / 2

    @property
    def weighed(self) -> RigidMass | None:
        """Mass, centre and inertia where it moves rigidly, without `mass_factor`; None where it has none."""
        K, M = self.matrices
        places = self.written.places
        return None if M is None else rigid_mass(M, places, extent(K, places))

    def notes(self) -> list[str]:
        """What was taken out of the matrices, and that K says nothing of what is not linear."""
        K, M = self.as_written
        notes, size = [], extent(K, self.written.places)
        for key, stated in zip(MATRICES, (K, M), strict=True):
            if stated is not None and (most := asymmetry(stated, size).max()) > FREED:
                notes.append(f"{key} is not symmetric by {100 * most:.2g} %: the mean of both halves is taken")
        held = held_by_nothing((K + K.T) / 2, self.written.places).max()
        taken = f": the nearest K without that is taken (told from {FREED:g} on)"
        notes += [f"stiffness: rigid motions meet {held:.1g} of the loads of its rows{taken}"] if held > FREED else []
        return [*notes, "it is linear: how far that holds is not in its matrices"]


def with_matrices(table: dict[str, Any], path: Path) -> dict[str, Any]:
    """The tables of a mechanism's file at `path`, with the matrices of the files that its super-elements name. Raises InputError."""
    parts = table.get("super_element")
    if not isinstance(parts, list):
        return table
    read, faults = list[Any](), list[Fault]()
    for k, part in enumerate(parts):
        part = dict(part) if isinstance(part, dict) else part
        for key in MATRICES if isinstance(part, dict) else ():
            if isinstance(part.get(key), str):
                try:
                    part[key] = read_matrix(path.parent / part[key], part[key], 6 * MOST_PORTS)
                except InputError as error:
                    faults += [Fault(f"super_element[{k}].{key}", f"{part[key]}: {f.what}") for f in error.faults]
        read.append(part)
    if faults:
        raise InputError(path, faults)
    return {**table, "super_element": read}


def matrix_files(table: dict[str, Any], path: Path) -> tuple[Path, ...]:
    """The files that the super-elements of a device file at `path` name."""
    parts = table.get("super_element")
    parts = parts if isinstance(parts, list) else []
    names = [part.get(key) for part in parts if isinstance(part, dict) for key in MATRICES]
    return tuple(dict.fromkeys(path.parent / name for name in names if isinstance(name, str)))
