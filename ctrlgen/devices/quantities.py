"""The numbers of a description by their dotted paths, such as 'actuator[0].gain': one walk for all that read or change them.

A description is a tree of tables (`Section`), effects, lists (tuples) and quantities.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import casadi as ca

from ctrlgen.core.units import Quantity
from ctrlgen.devices.section import Section
from ctrlgen.effects import Effect


def deviation_path(path: str, copy: int) -> str:
    """The path of how far the number at `path` is off in one copy of its table: 'element[0].length@2'."""
    return f"{path}@{copy}"


def shared_path(path: str) -> str:
    """The path of the number that a deviation is one of: 'element[0].length'; of any other path itself."""
    return path.partition("@")[0]


def members(node: Any) -> dict[str, Any]:
    """The members of a table, an effect or a list, by what each adds to a path: '.key' or '[0]'; none of anything else."""
    if isinstance(node, Section):
        return {f".{key}": getattr(node, key) for key in type(node).model_fields}
    if isinstance(node, Effect):
        return {f".{key}": number for key, number in node.values.items()}
    return {f"[{i}]": member for i, member in enumerate(node)} if isinstance(node, tuple) else {}


def member_at(node: Any, path: str) -> Any:
    """The table, list or number of `node` at a path; None where there is none."""
    for key, index in re.findall(r"(\w+)|(\[\d+\])", path):
        node = members(node).get(index or f".{key}")
    return node


def walk(node: Any, prefix: str = "", owner: Any = None) -> Iterator[tuple[str, Any, Quantity]]:
    """Every number of `node` with its path and the table or effect that holds it."""
    if isinstance(node, Quantity):
        yield prefix, owner, node
    for suffix, member in members(node).items():
        yield from walk(member, f"{prefix}{suffix}".removeprefix("."), owner if isinstance(node, tuple) else node)


def map_quantities(
    node: Any, change: Callable[[str, Quantity], Any], build: Callable[[Any, dict[str, Any]], Any], prefix: str = ""
) -> Any:
    """`node` with `change(path, number)` in place of each number; `build(node, members)` makes a table, an effect or a list anew."""
    if isinstance(node, Quantity):
        return change(prefix, node)
    if not isinstance(node, Section | Effect | tuple):
        return node
    changed = {
        suffix: map_quantities(member, change, build, f"{prefix}{suffix}".removeprefix("."))
        for suffix, member in members(node).items()
    }
    return build(node, changed)


def si_namespace(node: Any, prefix: str, free: dict[str, ca.SX]) -> Any:
    """SI numbers of a table as nested namespaces; `free` (path, which begins with `prefix` -> symbol) replaces some of them."""

    def build(table: Any, changed: dict[str, Any]) -> Any:
        if isinstance(table, tuple):
            return tuple(changed.values())
        return SimpleNamespace(**{suffix.removeprefix("."): member for suffix, member in changed.items()})

    return map_quantities(node, lambda path, number: free.get(path, number.si), build, prefix)
