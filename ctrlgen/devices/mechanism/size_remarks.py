"""Remarks on sizes of materials and elements that leave the range of their equations."""

from __future__ import annotations

from typing import Any

from ctrlgen.devices.mechanism.divided_blades import divided_remarks
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import USUAL, CircularHinge

LIGHT = "a hinge has no mass of its own; count it to the bodies that it joins"


def size_remarks(device: Drawing) -> list[str]:
    """Those of materials, elements and super-elements; hinges of a material with a density have no mass of their own."""
    dense = {m.name for m in device.material if m.density is not None}
    poisson = {m.name: m.poisson.si for m in device.material}
    lengths = {e.index: sum(piece.section.length.si for piece in e.run) for e in device.placed_elements if e.run}
    remarks = [f"{m.name}: {note}" for m in device.material for note in m.notes()]
    for k, e in enumerate(device.element):
        notes = e.notes(lengths.get(k), poisson.get(getattr(e, "material", ""), USUAL))
        remarks += [f"{e.name}: {note}" for note in notes]
    remarks += [f"{s.name}: {note}" for s in device.super_element for note in s.notes()]
    remarks += divided_remarks(device)
    return remarks + [f"{e.name}: {LIGHT}" for e in device.element if _massless(e, dense)]


def _massless(e: Any, dense: set[str]) -> bool:
    return isinstance(e, CircularHinge) and e.material in dense
