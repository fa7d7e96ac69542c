"""A device with other numbers."""

from __future__ import annotations

from typing import Any, TypeVar

from ctrlgen.core.units import Quantity, from_si, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.quantities import map_quantities, shared_path
from ctrlgen.effects import Effect

Node = TypeVar("Node")


def written(si: float, unit: str, source: str | None = None) -> Quantity:
    """A number in SI as a device file would write it in `unit`."""
    shown = f"{from_si(si, unit):.9g} {'' if unit == '1' else unit}".strip()
    return Quantity(si, shown, source)


def changed(device: Device, values: dict[str, float]) -> Device:
    """The device with some of its numbers at other values [SI]; of a path of `Device.copies` the deviation of that copy."""
    shared = {path: value for path, value in values.items() if path == shared_path(path)}
    copies = {path: value for path, value in values.items() if path not in shared}
    numbered = with_numbers(device, shared)
    return numbered.deviating(copies) if copies else numbered


def with_numbers(table: Node, values: dict[str, float]) -> Node:
    """A device, or one of its tables, with some of its numbers at other values [SI], by their paths in it."""

    def change(path: str, number: Quantity) -> Quantity:
        return written(values[path], written_unit(number.text), number.source) if path in values else number

    def build(node: Any, members: dict[str, Any]) -> Any:
        if isinstance(node, tuple):
            return tuple(members.values())
        named = {suffix.removeprefix("."): member for suffix, member in members.items()}
        if isinstance(node, Effect):
            return node if named == node.values else type(node)(node.at, named, node.of)
        return node.model_copy(update=named)

    changed_table: Node = map_quantities(table, change, build) if values else table
    return changed_table
