"""The lines that `ctrlgen check` prints of a mechanism."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.bent_tangent import displaced_lines
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.constraints import freedoms, redundant_constraints
from ctrlgen.devices.mechanism.divided_blades import divided_lines
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures_alone import alone_lines
from ctrlgen.devices.mechanism.linear_range import range_lines
from ctrlgen.devices.mechanism.load_effects import load_lines
from ctrlgen.devices.mechanism.modes import condensed_modes, free_modes, guyan_modes
from ctrlgen.devices.mechanism.point_compliance import point_compliance
from ctrlgen.devices.mechanism.ported_parts import part_line
from ctrlgen.devices.mechanism.reach import reach_lines
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.travel import farthest
from ctrlgen.physics.screw import told_in

NAMED = 8  # elements in a line
STILL = 1e-9  # m/m or rad/m: of the motion per actuator, below which it is rounding


def summary(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of a mechanism: its parts, and how stiff it is at the output point."""
    c = nominal(device)
    C = ca.DM(ca.evalf(ca.SX(c.output_compliance))).full()
    springs, ported = sum(C is None for C in c.compliances), len(c.ported)
    lines = [
        f"{number_of(len(device.bodies), 'body', 'bodies')}, {number_of(len(c.elements) - springs, 'flexure')}, "
        + (f"{number_of(springs, 'spring')}, " if springs else "")
        + (f"{number_of(ported, 'super-element')}, " if ported else "")
        + number_of(len(device.placed_actuators), "actuator")
    ]
    lines += [part_line(s) for s in device.super_element] + divided_lines(device)
    free, over = freedoms(device)
    lines.append(f"degrees of freedom without actuators: {free}; redundant constraints: {over}")
    if over:
        named = [f"{name} {', '.join(held)}" for name, held in redundant_constraints(device).items()]
        more = f"; and of {len(named) - NAMED} more" if len(named) > NAMED else ""
        lines.append(f"{over} among these are redundant: {'; '.join(named[:NAMED])}{more}")
    forces = ", ".join(f"{name} {show(1 / C[3 + i, i], 'N/um')}" for i, name in enumerate("xyz"))
    moments = ", ".join(f"{name} {show(1 / C[i, 3 + i], 'N*m/rad')}" for i, name in enumerate("xyz"))
    lines.append(f"stiffness at the output point: {forces}; about {moments}")
    centre = point_compliance(device).centre_of_compliance
    lines.append(f"centre of compliance: ({', '.join(show(x, 'mm') for x in centre)})")
    if len((whole := free_modes(device)).frequencies):
        shown = ", ".join(show(f, "Hz") for f in whole.frequencies[:6])
        lines.append(f"natural frequencies with the drives held: {shown}")
        lines += alone_lines(device)
    condensed, left_out = condensed_modes(device, whole)
    if condensed:
        used = "solved with it" if device.dynamics is not None else "a table [dynamics] solves with it"
        more = "" if left_out is None else f"; first mode left out: {show(left_out, 'Hz')}"
        lines.append(f"inertia condensed to the actuators (Guyan; {used}): {', '.join(map(str, condensed))}{more}")
        if device.load or device.gravity:
            loaded = ", ".join(show(float(f), "Hz") for f in guyan_modes(device, under_loads=True).frequencies)
            lines.append(f"the same under the constant loads: {loaded}")
    seen = ca.vertcat(c.jacobian, c.reading_motion)[:, : len(device.placed_actuators)]
    units = [told_in(name) for name in device.output.channels] + [r.section.unit for r in device.placed_readings]
    names = [*device.output.channels, *(r.name for r in device.placed_readings)]
    for channel, told, row in zip(names, units, ca.DM(ca.evalf(ca.SX(seen))).full(), strict=True):
        unit = f"{told}/um"
        parts = ", ".join(
            f"{show(v, unit)} per {a.name}" for a, v in zip(device.placed_actuators, row, strict=True) if abs(v) > STILL
        )
        lines.append(f"{channel}: {parts or 'not moved to first order'}")
    return (
        lines
        + (_second_order_lines(c) if device.second_order else [])
        + load_lines(device)
        + reach_lines(device)
        + displaced_lines(device)
        + range_lines(device)
    )


def _second_order_lines(c: Condensed) -> list[str]:
    """What the second order adds to the channels that are followed, at the largest travels, whatever their signs."""
    second = SecondOrder(c)
    output = np.abs(ca.DM(ca.evalf(ca.SX(second.output))).full())
    travel = np.array([farthest(a.section.travel) for a in c.device.placed_actuators])
    reach = np.abs(ca.DM(second.products(ca.DM(travel))).full()).ravel()
    units = {r.name: r.section.unit for r in c.device.placed_readings}
    names = (*c.device.output.channels, *units)
    shown = (
        f"{name} {show(value, units.get(name, told_in(name)))}"
        for name, value in zip(names, (*(output @ reach), *second.sensed_reach()), strict=True)
    )
    return [f"second order at the largest travels, at most: {', '.join(shown)}"]
