"""Copies of the parts of a mechanism: where a pattern puts them, and between which bodies they act."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ctrlgen.physics.screw import Matrix


@dataclass(frozen=True, eq=False)  # a matrix has no truth value that a comparison could use
class Copied:
    """One copy of a body, element or actuator: which table of the file it is, its name, its number in the pattern (0: it has none)
    and the rotation (3, 3) by which it is turned."""

    section: Any
    index: int
    name: str
    copy: int
    turn: Matrix


@dataclass(frozen=True, eq=False)
class Placed(Copied):
    """A copy of an element or actuator and the numbers of the bodies between which it acts, `GROUND` for none."""

    first: int
    second: int
