"""A device with other numbers."""

from __future__ import annotations

from typing import Any

from ctrlgen.core.units import Quantity, from_si, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.section import Section
from ctrlgen.effects import Effect


def written(si: float, unit: str, source: str | None = None) -> Quantity:
    """A number in SI as a device file would write it in `unit`."""
    shown = f"{from_si(si, unit):.9g} {'' if unit == '1' else unit}".strip()
    return Quantity(si, shown, source)


def changed(device: Device, values: dict[str, float]) -> Device:
    """The device with some of its numbers at other values [SI]."""

    def walk(node: Any, prefix: str) -> Any:
        if isinstance(node, Quantity):
            return written(values[prefix], written_unit(node.text), node.source) if prefix in values else node
        if isinstance(node, Section):
            fields = {
                key: walk(getattr(node, key), f"{prefix}.{key}" if prefix else key) for key in type(node).model_fields
            }
            return node.model_copy(update=fields)
        if isinstance(node, Effect):
            own = {key: walk(value, f"{prefix}.{key}") for key, value in node.values.items()}
            return node if own == node.values else type(node)(node.at, own, node.of)
        if isinstance(node, tuple):
            return tuple(walk(member, f"{prefix}[{i}]") for i, member in enumerate(node))
        return node

    return walk(device, "") if values else device
