"""Remarks on sizes of materials and elements that leave the range of their equations."""

from __future__ import annotations

from typing import Any

import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.divided_blades import divided_remarks
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import USUAL, CircularHinge

EARTH, LEAST_GRAVITY, MOST_GRAVITY = 9.81, 1.0, 30.0  # m/s^2: from the moon to Jupiter
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
    remarks += divided_remarks(device) + _unused_expansion(device) + _odd_gravity(device)
    return remarks + [f"{e.name}: {LIGHT}" for e in device.element if _massless(e, dense)]


def _unused_expansion(device: Drawing) -> list[str]:
    """Materials that state an expansion and are not heated: no temperature acts on a mechanism but that of its heaters."""
    heated = {a.on for a in device.actuator if a.kind == "thermal"}
    used = {e.material for e in device.element if e.name in heated}
    return [
        f"{m.name}: expansion has no effect: only a thermal actuator heats, and none heats a bent_beam of {m.name}; what a warmer "
        "frame moves is left out"
        for m in device.material
        if m.expansion is not None and m.name not in used
    ]


def _odd_gravity(device: Drawing) -> list[str]:
    """Gravity that is no planet's, as a wrong unit makes it."""
    if device.gravity is None:
        return []
    falls = float(np.linalg.norm([q.si for q in device.gravity]))
    if falls == 0.0 or LEAST_GRAVITY <= falls <= MOST_GRAVITY:
        return []
    return [f"gravity of {show(falls, 'm/s^2')} is {falls / EARTH:.2g} times that of the earth: check the unit"]


def _massless(e: Any, dense: set[str]) -> bool:
    return isinstance(e, CircularHinge) and e.material in dense
