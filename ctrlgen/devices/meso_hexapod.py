"""NIST's meso-scale hexapod: six linear actuators move three planar stages, six struts the platform. Source: S0."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Literal

import casadi as ca
import numpy as np

from ctrlgen.devices.base import Device, Links, Section
from ctrlgen.errors import Fault, InputError
from ctrlgen.physics import meso_hexapod
from ctrlgen.units import quantity

Length = quantity("mm", positive=True)
Angle = quantity("deg")
Six = tuple[Angle, Angle, Angle, Angle, Angle, Angle]


class Hexapod(Section):
    """Strut ends and platform, S0 Table 1. The four spacings follow from radii and angles; none enters an equation."""

    platform_radius: Length
    base_radius: Length
    platform_thickness: Length
    height: Length
    strut_length: Length
    base_near: Length
    base_far: Length
    platform_near: Length
    platform_far: Length
    platform_angles: Six
    base_angles: Six


class Directions(Section):
    """The direction of each actuator's motion, as the constraint (S0 eq. 4) and as the Jacobian (eq. 9) has it."""

    constraint: Six
    jacobian: Six


class Cube(Section):
    """The reflective cube below the platform, which the instruments look at."""

    depth: Length


class Workspace(Section):
    """Largest rotation and translation of any axis."""

    rotation: quantity("deg", positive=True)
    translation: quantity("um", positive=True)


class MesoHexapod(Device):
    """Actuator displacement -> stage -> platform pose: kinematics alone, without force, temperature or time."""

    kind: Literal["meso_hexapod"]
    axes: tuple[str, str, str, str, str, str]
    hexapod: Hexapod
    directions: Directions
    cube: Cube
    workspace: Workspace

    def links(self, p: SimpleNamespace) -> Links:
        """Refused: a chain of `Links` runs over a heated actuator's force, which this device does not have."""
        raise InputError(
            self.name,
            [Fault("kind", "is kinematics alone; use its Jacobian or pose_from_actuators, a model needs an actuator")],
        )


def matrices(device: MesoHexapod) -> dict[str, np.ndarray]:
    """The matrices of S0 with the device's numbers, as (6, 6) arrays in SI, by their symbol."""
    p = device.values()
    named = {
        "J_l": meso_hexapod.jacobian_left(p.hexapod),
        "J_r": meso_hexapod.jacobian_right(p.hexapod, p.directions.jacobian),
        "J_k": meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian),
        "Ad": meso_hexapod.cube_to_platform(p.cube.depth),
    }
    return {name: ca.DM(matrix).full() for name, matrix in named.items()}
