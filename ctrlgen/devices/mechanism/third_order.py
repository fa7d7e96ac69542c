"""The part of a mechanism's energy of fourth order that its expansion to second order leaves out."""

from __future__ import annotations

from typing import Any

import numpy as np

from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import numbers
from ctrlgen.physics.third_order_flexure import third_order_motion, third_order_work


def left_out_energy(s: SecondOrder, d: np.ndarray) -> float:
    """V [N m] of fourth order of the displacements `d` (n,): the loads of first order on deformations of third order, less the work of
    the actuators' forces on what rotations to third order add to their travels. A flexure that yields at a point does so in axes halfway
    between those of its bodies, of which the second order already counts a part, theta x (theta x delta)/8."""
    c = s.c
    twists = [numbers(T) @ d for T in s.first_order]

    def moved(point: Any, first: int, second: int) -> tuple[np.ndarray, np.ndarray]:
        ends = (np.zeros(6) if b == GROUND else twists[b] for b in (first, second))
        return third_order_motion(numbers(point).ravel(), *ends)

    energy = 0.0
    for k, placed in enumerate(c.device.placed_elements):
        e, (place, segments, _) = s.motions(k), s.parts[k]
        R, load, own = numbers(e.R), numbers(e.load) @ d, numbers(e.relative) @ d
        turn, shift = (R.T @ v for v in moved(place, placed.first, placed.second))
        energy += float(load[:3] @ shift + load[3:] @ turn)
        if segments:
            energy += third_order_work(segments, load)
        else:
            energy -= float(load[:3] @ np.cross(own[:3], np.cross(own[:3], own[3:]))) / 8
    if c.pushes:
        forces = numbers(c.stiffness) @ d
        for force, placed, direction in zip(forces, c.device.placed_actuators, c.directions, strict=True):
            shift = moved(c.point(placed), placed.first, placed.second)[1]
            energy -= float(force * (numbers(direction).ravel() @ shift))
    return energy
