"""Mutations of the shipped inputs that know their structure: what stands in a table is left out, doubled, exchanged, made absurd.

A mutation is a function of its seed alone, so that one that was found can be made again.
"""

from __future__ import annotations

import datetime
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import tomlkit
from hostile_texts import FOREIGN, SHOWN, UNSEEN, replaced

NUMBERS = (
    "0",
    "-1",
    "1e300",
    "-1e300",
    "1e-300",
    "1e30",
    "1e9",
    "1e-9",
    "nan",
    "inf",
    "9" * 400,
    "1e",
    "0x10",
    "",
    "½",
)
UNITS = (
    "um", "m", "km", "ly", "s", "Hz", "V", "N/um", "degC", "delta_degC", "rad", "%", "1", "", "um^9^9^9", "um^-3", "(((um)))", "um*", "*um",
    "u" * 100_000, "um/um", "1/0", "0*um", "dB", "count", "um */", "µm", "inf", "nan", "um+um", "um um", "bit", "kelvin", "Δ_degC",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**63 - 1, 10**300, 0.0, -0.0, 1e-300, 1e308, float("nan"), float("inf"), "", " ", [], [[]],
    [None], {}, {"kind": "x"}, datetime.date(2026, 1, 1), datetime.time(1), "1", "1 um", "all", "0 1", FOREIGN, "x" * 300,
    [1] * 1000, ["1 um"] * 1000, {str(k): k for k in range(300)},
)  # fmt: skip


@dataclass(frozen=True)
class Mutated:
    """A mutated table and what was done to it."""

    table: dict[str, Any]
    how: tuple[str, ...]


def mutated(table: dict[str, Any], seed: int) -> Mutated:
    """One to three changes of a table, by `seed`."""
    draw, how = random.Random(seed), list[str]()
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        places = list(_places(table))
        if not places:
            break
        change = draw.choice(CHANGES)
        place = draw.choice(places)
        try:
            table = change(table, place, draw)
        except (TypeError, ValueError, LookupError, AttributeError):  # a change that does not fit the place
            continue
        how.append(f"{change.__name__} at {'.'.join(map(str, place))}")
    return Mutated(table, tuple(how))


def _places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    for key, member in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        yield (*path, key)
        yield from _places(member, (*path, key))


def _at(node: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        node = node[key]
    return node


Change = Callable[[dict[str, Any], tuple[Any, ...], random.Random], dict[str, Any]]


def text(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    return replaced(table, place, draw.choice((*SHOWN, *UNSEEN)))


def number(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    words = str(_at(table, place)).split(" ", 1)
    return replaced(table, place, " ".join([draw.choice(NUMBERS), *words[1:]]))


def scaled(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    """A number with its unit, or a plain one, times a power of ten that may still be meant."""
    value, factor = _at(table, place), draw.choice((-1, 0, 2, 10, 1e3, 1e6, 0.5, 0.1, 1e-3, 1e-6, 1e12, 1e-12))
    if isinstance(value, str):
        first, *rest = value.split(" ", 1)
        return replaced(table, place, " ".join([repr(float(first) * factor), *rest]))
    if isinstance(value, bool):
        raise TypeError
    return replaced(table, place, type(value)(value * factor))


def unit(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    words = str(_at(table, place)).split(" ", 1)
    return replaced(table, place, f"{words[0]} {draw.choice(UNITS)}" if len(words) > 1 else draw.choice(UNITS))


def other_type(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    return replaced(table, place, draw.choice(VALUES))


def left_out(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    outer = _at(table, place[:-1])
    rest = {k: v for k, v in outer.items() if k != place[-1]} if isinstance(outer, dict) else outer[: place[-1]]
    return replaced(table, place[:-1], rest)


def doubled(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    outer = _at(table, place[:-1])
    if isinstance(outer, list):
        return replaced(table, place[:-1], [*outer, *[outer[place[-1]]] * draw.choice((1, 2, 300))])
    return replaced(table, place[:-1], {**outer, f"{place[-1]}{draw.choice(('_2', ' ', 'x', '-1'))}": outer[place[-1]]})


def exchanged(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    """A value from elsewhere in the file."""
    return replaced(table, place, _at(table, draw.choice(list(_places(table)))))


def renamed(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    outer = _at(table, place[:-1])
    name = draw.choice((*SHOWN, *UNSEEN, "", "x", str(place[-1])[:-1]))
    return replaced(table, place[:-1], {name if k == place[-1] else k: v for k, v in outer.items()})


def nested(table: dict[str, Any], place: tuple[Any, ...], draw: random.Random) -> dict[str, Any]:
    value = _at(table, place)
    for _ in range(draw.choice((1, 2, 60))):
        value = [value] if draw.random() < 0.5 else {"value": value}
    return replaced(table, place, value)


CHANGES: tuple[Change, ...] = (
    text, number, number, scaled, scaled, scaled, scaled, unit, unit, other_type, other_type, left_out, doubled, exchanged,
    exchanged, renamed, nested,
)  # fmt: skip


def written(table: dict[str, Any]) -> str:
    """The table as TOML; None, which that does not have, is left out."""
    return tomlkit.dumps(_without_none(table))


def _without_none(node: Any) -> Any:
    if isinstance(node, dict):
        return {str(k): _without_none(v) for k, v in node.items() if v is not None}
    return [_without_none(v) for v in node if v is not None] if isinstance(node, list) else node


def garbled(content: bytes, seed: int) -> bytes:
    """One to three changes of a text file: bytes, cells, lines."""
    draw = random.Random(seed)
    for _ in range(draw.choice((1, 1, 2, 3))):
        lines = content.split(b"\n")
        k, place = draw.randrange(len(lines)), draw.randrange(len(content) + 1)
        cells = lines[k].split(b",")
        cell = draw.randrange(len(cells))
        odd = draw.choice((*SHOWN, *UNSEEN, *NUMBERS, ",", ";", '"', "1,5", "\t", "-", "#", "''")).encode(
            "utf-8", "replace"
        )
        match draw.randrange(9):
            case 0:
                content = content[:place]
            case 1:
                content = content[:place] + odd + content[place:]
            case 2:
                content = content[:place] + bytes([draw.randrange(256)]) + content[place + 1 :]
            case 3:
                content = b"\n".join([*lines[:k], *lines[k + 1 :]])
            case 4:
                content = b"\n".join([*lines[:k], lines[k], *lines[k:]])
            case 5 | 6:
                content = b"\n".join([*lines[:k], b",".join([*cells[:cell], odd, *cells[cell + 1 :]]), *lines[k + 1 :]])
            case 7:
                content = content.replace(b",", draw.choice((b";", b"\t", b" ", b",,")))
            case _:
                content = content.decode("utf-8", "replace").encode(
                    draw.choice(("utf-16", "latin-1", "utf-8-sig")), "replace"
                )
        content = content or b"\n"
    return content
