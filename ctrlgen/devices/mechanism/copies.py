"""Copies of the parts of a mechanism: where a pattern puts them, between which bodies they act, and their numbers.

The copies of a table share its numbers. Each may deviate from them: copy k of a number x is x + e_k, e_k zero as described. The path of
e_2 of 'element[0].length' is 'element[0].length@2' (`quantities.deviation_path`); it is a symbol where a model has it free, and a
number in a device that is `deviating`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Self

import casadi as ca
from pydantic import PrivateAttr

from ctrlgen.devices.base import Device
from ctrlgen.devices.changed_numbers import with_numbers
from ctrlgen.devices.quantities import deviation_path, member_at, shared_path, si_namespace
from ctrlgen.physics.screw import Matrix

COPIED = re.compile(r"(\w+)\[(\d+)\]\.?(.*)")  # table, its place, the number's path in it


@dataclass(frozen=True, eq=False)  # a matrix has no truth value that a comparison could use
class Copied:
    """One copy of a body, element or actuator: which table of the file it is, its name, its number in the pattern (0: it has none)
    and the rotation (3, 3) by which it is turned."""

    section: Any
    table: str
    index: int
    name: str
    copy: int
    turn: Matrix

    def numbers(self, p: SimpleNamespace) -> SimpleNamespace:
        """Its numbers among the values `p` of the description."""
        found: SimpleNamespace = p.copies.get((self.table, self.index, self.copy)) or getattr(p, self.table)[self.index]
        return found


@dataclass(frozen=True, eq=False)
class Placed(Copied):
    """A copy of an element or actuator and the numbers of the bodies between which it acts, `GROUND` for none; `run`: of a piece of a
    divided blade all pieces."""

    first: int
    second: int
    run: tuple[Placed, ...] = ()

    def numbers(self, p: SimpleNamespace) -> SimpleNamespace:
        """Its numbers among the values `p` of the description; of a piece with the length of the whole blade as `held_length` [m]."""
        found = super().numbers(p)
        if not self.run:
            return found
        return SimpleNamespace(**vars(found), held_length=sum(piece.numbers(p).length for piece in self.run))


class CopiedParts(Device):
    """A device whose tables may name a `[[pattern]]`, by which they are copied."""

    _deviations: tuple[tuple[str, float], ...] = PrivateAttr(())  # by the path of each [SI]

    def copies(self, path: str) -> tuple[str, ...]:
        """The paths of the deviations of each copy of the number at `path`; none where its table has no pattern."""
        table = member_at(self, path.partition(".")[0])
        pattern = next((q for q in getattr(self, "pattern", ()) if q.name == getattr(table, "pattern", "")), None)
        return () if pattern is None else tuple(deviation_path(path, k) for k, _ in enumerate(pattern.turns, start=1))

    def deviating(self, deviations: Mapping[str, float]) -> Self:
        """The device whose copies are off by more [SI], by the paths of `copies`."""
        device, before = self.model_copy(), dict(self._deviations)
        more = {path: before.get(path, 0.0) + value for path, value in deviations.items()}
        device._deviations = tuple((before | more).items())
        return device

    def values(self, free: dict[str, ca.SX] | None = None) -> SimpleNamespace:
        """SI numbers as nested namespaces, and in `copies` those of copies that deviate: (table, place, copy) -> namespace."""
        symbols = {path: s for path, s in (free or {}).items() if path == shared_path(path)}
        off = {**dict(self._deviations)}
        for path, s in (free or {}).items():
            if path not in symbols:
                off[path] = s + off.get(path, 0.0)
        of_copy: dict[tuple[str, int, int], dict[str, Any]] = {}
        for path, deviation in off.items():
            table, index, _ = _parts(path)
            shared = shared_path(path)
            value = symbols.get(shared, member_at(self, shared).si) + deviation
            of_copy.setdefault((table, index, _copy(path)), {})[shared] = value
        p = super().values(symbols)
        p.copies = {
            key: si_namespace(getattr(self, key[0])[key[1]], f"{key[0]}[{key[1]}]", symbols | numbers)
            for key, numbers in of_copy.items()
        }
        return p

    def _copies(self, table: str) -> Iterator[Copied]:
        """Every copy of every table of a kind, such as 'element', with its own numbers."""
        for index, section in enumerate(getattr(self, table)):
            pattern = next((q for q in getattr(self, "pattern", ()) if q.name == section.pattern), None)
            if pattern is None:
                yield Copied(section, table, index, section.name, 0, ca.DM.eye(3))
                continue
            for k, turn in enumerate(pattern.turns, start=1):
                own = self._deviating_section(table, index, k, section)
                yield Copied(own, table, index, f"{section.name}_{k}", k, turn)

    def _deviating_section(self, table: str, index: int, copy: int, section: Any) -> Any:
        """The table as one copy has it."""
        off = {
            _parts(path)[2]: value
            for path, value in self._deviations
            if (table, index, copy) == (*_parts(path)[:2], _copy(path))
        }
        return with_numbers(section, {path: member_at(section, path).si + value for path, value in off.items()})


def _parts(path: str) -> tuple[str, int, str]:
    """The kind of table, its place and the path in it of the number that deviates."""
    match = COPIED.fullmatch(shared_path(path))
    assert match is not None, path
    return match[1], int(match[2]), match[3]


def _copy(path: str) -> int:
    return int(path.partition("@")[2])
