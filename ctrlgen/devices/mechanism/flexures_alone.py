"""How the flexures of a mechanism ring by themselves, between ends that do not move, and what its frequencies do not show of that."""

from __future__ import annotations

from types import SimpleNamespace

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import Beam, Flexible, Strut
from ctrlgen.devices.mechanism.internal_modes import highest_told
from ctrlgen.physics.flexure_modes import lowest_bending, lowest_twist

NAMED = 4  # flexures in a line
ALIKE = 1e-6  # of a frequency


def lowest_alone(c: Condensed) -> dict[str, float]:
    """The lowest frequency [Hz] of every beam whose material states a density, by its name."""
    found = {}
    for e in c.device.placed_elements:
        material = c.materials.get(getattr(e.section, "material", ""))
        if not isinstance(e.section, Beam) or material is None or material.density is None:
            continue
        numbers, density = e.numbers(c.p), float(material.density)
        rings = [lowest_bending(e.section.segments(numbers, material), density)]
        if not isinstance(e.section, Strut):  # one of round pieces bends long before it twists
            half = SimpleNamespace(**vars(numbers) | {"length": numbers.length / 2})
            rings.append(lowest_twist(e.section.segments(half, material), density))
        found[e.name] = min(rings)
    return found


def alone_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of it beside the natural frequencies."""
    lines = []
    if found := lowest_alone(nominal(device)):
        first = min(found.values())
        named = [name for name, f in found.items() if f <= first * (1 + ALIKE)]
        names = ", ".join(named[:NAMED]) + (f" and {len(named) - NAMED} more" if len(named) > NAMED else "")
        lines.append(
            f"flexures ring by themselves, their ends held, from {show(first, 'Hz')} on ({names}): such modes are left out above, and "
            "where they begin only the motion of the bodies is told"
        )
    light = [m.name for m in device.material if m.density is None]
    if used := [x for x in light if any(isinstance(e, Flexible) and e.material == x for e in device.element)]:
        lines.append(f"flexures of {', '.join(used)} count without mass: no density is stated")
    return lines


def alone_remarks(device: Drawing) -> list[str]:
    """Where the response is told up to frequencies at which flexures ring by themselves."""
    found, highest = lowest_alone(nominal(device)), highest_told(device)
    if not found or highest is None or min(found.values()) >= highest:
        return []
    name, shown = min(found, key=lambda x: found[x]), show(min(found.values()), "Hz")
    return [
        f"{name} rings by itself, its ends held, at {shown}, below the {show(highest, 'Hz')} up to which the response is told: from there "
        "on it lacks modes; divide the flexure by bodies without mass, or state a lower modes_below"
    ]
