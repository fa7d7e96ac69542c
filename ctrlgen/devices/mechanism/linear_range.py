"""How far the force of a mechanism is linear: flexures that are held stretch as they bend, and turn with the bodies that they join.

What a travel takes beside K d is told by the energy to fourth order and beyond (`second_order`, `stretching`), and by what that leaves
out of the fourth (`third_order`): (36/35) (y/l)^2 of a guided blade, (2/3) (d/r)^2 of an arm r on a pivot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import Beam
from ctrlgen.devices.mechanism.reach import reaches
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.mechanism.springs import Spring
from ctrlgen.devices.mechanism.stretching import Stretching
from ctrlgen.devices.mechanism.third_order import left_out_energy
from ctrlgen.devices.travel import farthest

LEVELS = (0.01, 0.05, 0.2)  # of the linear force
FARTHEST = 10.0  # times the largest travel: beyond it nothing is said
SMALL = 1e-6  # of a level: what is zero by symmetry has no logarithm
STEPS = 200  # between a thousandth of the travel and the farthest: the deviation may have a turning point


def stiffened(elements: Sequence[Any]) -> tuple[Any, ...] | None:
    """The elements, all beams with `geometric_stiffening`; None where no beam is among them, one has it, or a spring is cubic."""
    beams = [e for e in elements if isinstance(e, Beam)]
    if not beams or any(e.geometric_stiffening for e in beams) or any(getattr(e, "cubic", False) for e in elements):
        return None
    return tuple(e.model_copy(update={"geometric_stiffening": True}) if isinstance(e, Beam) else e for e in elements)


def second_order_faults(device: Drawing) -> list[Fault]:
    """What the expansion of the equilibrium does not hold."""
    stiffens = [e.name for e in device.element if getattr(e, "geometric_stiffening", False)]
    faults, asked = [], "geometric_stiffening" if stiffens else "kinematics" if device.second_order else ""
    if asked and device.super_element:
        faults.append(
            Fault(asked, "the matrices of a super-element say nothing of the second order; leave out one of them")
        )
    if asked and any(isinstance(e, Spring) and e.cubic for e in device.element):
        faults.append(Fault(asked, "the second order is that of linear flexures; leave it out, or the springs' k_3"))
    if stiffens and device.kinematics == "first_order" and "kinematics" in device.model_fields_set:
        faults.append(
            Fault(
                "kinematics",
                f'geometric_stiffening of {", ".join(stiffens)} is of second order, not of "first_order"; leave out one of them',
            )
        )
    if stiffens and device.actuator and device.actuator[0].kind == "displacement":
        faults.append(
            Fault(
                "geometric_stiffening",
                f"of {', '.join(stiffens)} has no effect where actuators prescribe displacements; leave it out, "
                'and write kinematics = "second_order"',
            )
        )
    return faults


def left_out_shares(c: Condensed) -> list[float]:
    """Of each axis moved alone, what deformations of third order take of its linear force, per square of its displacement [1/m^2]."""
    second, K = SecondOrder(c), ca.DM(ca.evalf(ca.SX(c.held_stiffness))).full()
    return [4 * left_out_energy(second, unit) / K[i, i] for i, unit in enumerate(np.eye(second.n))]


def linear_ranges(c: Condensed) -> list[tuple[float | None, ...]]:
    """Of each axis moved alone, to the side where that is sooner, the travel [m] from which on the linear force is off by each of
    `LEVELS`; None where that is not within `FARTHEST` of the largest travel."""
    left_out = left_out_shares(c)
    second, ranges = SecondOrder(c), []
    d = ca.SX.sym("d", second.n)
    extra = ca.Function("extra", [d], [second.restoring_force(d, Stretching(second).energy)])
    K = ca.DM(ca.evalf(ca.SX(c.held_stiffness))).full()
    for i, a in enumerate(c.device.placed_actuators):
        travel = farthest(a.section.travel)
        grid = travel * np.geomspace(1e-3, FARTHEST, STEPS)

        def off(x: float, i: int = i) -> float:
            sides = [sign * extra(sign * x * np.eye(second.n)[i]).full()[i, 0] / (K[i, i] * x) for sign in (1, -1)]
            return max(abs(side + left_out[i] * x**2) for side in sides)

        shares = np.array([off(x) for x in grid])
        found: list[float | None] = []
        for level in LEVELS:
            k = int(np.argmax(shares > level))
            if shares[k] <= level:
                found.append(None)
            elif k == 0:
                found.append(float(grid[0]))
            else:  # between two points a power of the travel
                known, ways = (np.log(x[k - 1 : k + 1]) for x in (np.maximum(shares, level * SMALL), grid))
                found.append(float(np.exp(np.interp(np.log(level), known, ways))))
        ranges.append(tuple(found))
    return ranges


def range_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of it: of each actuator that does not stay linear to 1 % within its travel ten times over."""
    c = nominal(device)
    if not _told(c):
        return []
    levels, lines = ", ".join(f"{100 * level:g}" for level in LEVELS), []
    for a, found, share in zip(device.placed_actuators, linear_ranges(c), left_out_shares(c), strict=True):
        if found[0] is None:
            continue
        places = (
            f"over {show(FARTHEST * farthest(a.section.travel), 'um')}" if x is None else show(x, "um") for x in found
        )
        held = "; geometric_stiffening = true holds that"
        if abs(share) * found[0] ** 2 > LEVELS[0] / 2:
            held = "; most of that is of third order, which the model does not have"
        elif device.geometric_stiffening or not any(isinstance(e, Beam) for e in device.element):
            held = ""
        lines.append(f"linear force of {a.name} off by {levels} % from a travel of {', '.join(places)}{held}")
    return lines


def third_order_remarks(device: Drawing) -> list[str]:
    """Axes whose force within their reach is off by more than the first level because deformations of third order are left out."""
    c = nominal(device)
    if not _told(c):
        return []
    remarks = []
    for r, share in zip(reaches(c), left_out_shares(c), strict=True):
        most = max(map(abs, r.ends))
        if (off := share * most**2) and abs(off) > LEVELS[0]:
            where = show(float(np.sqrt(LEVELS[0] / abs(share))), "um")
            remarks.append(
                f"the force of {r.name} is off by {percent(-off / (1 + off), sign=True)} at {show(most, 'um')} of it alone, because "
                f"deformations and rotations of third order are left out; it is right to {percent(LEVELS[0])} up to {where}"
            )
    return remarks


def _told(c: Condensed) -> bool:
    return c.pushes and not c.cubics and not c.ported
