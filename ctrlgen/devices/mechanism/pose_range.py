"""How far the pose of a mechanism is linear: what finite rotations and bent flexures add to it where a file leaves out the second order."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.reach import reaches
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.screw import numbers, told_in

LEVEL = 0.01  # of the motion of a channel


def pose_remarks(device: Drawing) -> list[str]:
    """The channels whose motion within the reach of all axes is off by more than `LEVEL` of it, at most, whatever the signs."""
    c = nominal(device)
    stated = any(effect.kind == "finite_rotation" for effect in device.effect)
    if device.second_order or stated or c.cubics or c.ported:
        return []
    ways = reaches(c)
    ends = np.array([max(map(abs, r.ends)) for r in ways])
    if not ends.any():
        return []
    linear = np.abs(numbers(c.jacobian)[:, : len(ends)]) @ ends
    second = SecondOrder(c)
    off = np.abs(numbers(second.output)) @ np.abs(numbers(second.products(ca.DM(ends)))).ravel()
    remarks = []
    for channel, moved, more in zip(device.output.channels, linear, off, strict=True):
        if more > LEVEL * moved:
            unit = told_in(channel)
            of = " and ".join(f"{show(x, 'um')} of {r.name}" for r, x in zip(ways, ends, strict=True))
            remarks.append(
                f"{channel} is off by up to {show(more, unit)} of {show(moved, unit)} ({percent(more / moved)}) at {of}, because the "
                f'pose is of first order; kinematics = "second_order" has it. It is right to {percent(LEVEL)} up to '
                f"{percent(LEVEL * moved / more)} of that way"
            )
    return remarks
