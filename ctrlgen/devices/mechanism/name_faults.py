"""Names in the tables of a mechanism that are given twice, or that nothing has."""

from __future__ import annotations

from typing import Any

from ctrlgen.core.errors import Fault
from ctrlgen.devices.load import GROUND_NAME
from ctrlgen.devices.mechanism.bent_beams import BentBeam
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import Flexible


def name_faults(device: Drawing) -> list[Fault]:
    """Names given twice, patterns, bodies, elements and materials that there are not."""
    faults: list[Fault] = []
    for what, names in {
        "material": [m.name for m in device.material],
        "pattern": [q.name for q in device.pattern],
        "body": list(device.bodies),
        "element": [e.name for e in (*device.element, *device.super_element)],
        "actuator": [a.name for a in device.actuator],
        "load": [x.name for x in device.load],
        "reading": [*device.output.channels, *(r.name for r in device.placed_readings)],
    }.items():
        faults += [Fault(what, f"{name!r} is named twice") for name in dict.fromkeys(names) if names.count(name) > 1]
    if GROUND_NAME in device.bodies:
        faults.append(Fault("body", '"ground" is the name of what does not move; choose another one'))
    known = {q.name for q in device.pattern} | {""}
    for where, sections in (
        ("body", device.body),
        ("element", device.element),
        ("super_element", device.super_element),
        ("actuator", device.actuator),
        ("reading", device.reading),
        ("load", device.load),
    ):
        for k, section in enumerate(sections):
            if section.pattern not in known:
                faults.append(Fault(f"{where}[{k}].pattern", f"{section.pattern!r} is no pattern"))
    if not faults:
        faults += _unknown(device)
    return faults


def _unknown(device: Drawing) -> list[Fault]:
    faults = []
    materials = {m.name for m in device.material}
    for k, e in enumerate(device.element):
        faults += _no_body(device, f"element[{k}]", e, "from", "to")
        if isinstance(e, Flexible) and e.material not in materials:
            faults.append(Fault(f"element[{k}].material", f"{e.material!r} is no material"))
    for k, s in enumerate(device.super_element):
        for i, port in enumerate(s.port):
            if device.body_number(port.body, s.pattern, 1) is None:
                where = f"super_element[{k}].port[{i}].body"
                faults.append(Fault(where, f"{port.body!r} is no body" + _of_pattern(s)))
    elements = {e.name: e for e in device.element}
    for k, a in enumerate(device.actuator):
        if a.kind != "force":
            moved = elements.get(a.on)
            if moved is None or moved.pattern != a.pattern:
                faults.append(
                    Fault(
                        f"actuator[{k}].on",
                        f"{a.on!r} is no element{_of_pattern(a)}",
                    )
                )
            elif a.kind == "thermal" and not isinstance(moved, BentBeam):
                faults.append(Fault(f"actuator[{k}].on", f"{a.on!r} is no bent_beam, which a heater needs"))
            elif (
                isinstance(moved, BentBeam)
                and a.kind == "thermal"
                and not any(m.name == moved.material and m.expansion for m in device.material)
            ):
                faults.append(
                    Fault(f"actuator[{k}].on", f"give the material of {a.on!r} its expansion and expansion_slope")
                )
            continue
        faults += _no_body(device, f"actuator[{k}]", a, "on", "against")
    for k, x in enumerate(device.load):
        faults += _no_body(device, f"load[{k}]", x, "on", "against")
    for k, r in enumerate(device.reading):
        faults += _no_body(device, f"reading[{k}]", r, "body", "against")
        if r.of is not None and (r.of not in elements or elements[r.of].pattern != r.pattern):
            faults.append(
                Fault(
                    f"reading[{k}].of",
                    f"{r.of!r} is no element{_of_pattern(r)}",
                )
            )
    if device.output.body not in device.bodies:
        faults.append(Fault("output.body", f"{device.output.body!r} is no body; there are {', '.join(device.bodies)}"))
    return faults


def _no_body(device: Drawing, where: str, table: Any, *keys: str) -> list[Fault]:
    """The names of bodies in a table, under `keys`, that are none."""
    names = {key: getattr(table, "from_" if key == "from" else key) for key in keys}
    return [
        Fault(f"{where}.{key}", f"{name!r} is no body{_of_pattern(table)}")
        for key, name in names.items()
        if name is not None and device.body_number(name, table.pattern, 1) is None
    ]


def _of_pattern(table: Any) -> str:
    return f" with the pattern {table.pattern!r}" if table.pattern else ""
