"""NIST's meso-scale hexapod: six linear actuators move three planar stages, six struts the platform. Source: S0."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Literal

import casadi as ca
import numpy as np

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.base import BalancedPhysics, Device, Limit, Section, Signal
from ctrlgen.physics import meso_hexapod

Length = Annotated[Quantity, In("mm", positive=True)]
Angle = Annotated[Quantity, In("deg")]
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


class RatedTravel(Section):
    """Largest rotation and translation of any axis that the paper states; no limit of the model, `travel` is."""

    rotation: Annotated[Quantity, In("deg", positive=True)]
    translation: Annotated[Quantity, In("um", positive=True)]


class MesoHexapod(Device):
    """Actuator displacement -> stage -> platform pose: kinematics alone, without force, temperature or time."""

    kind: Literal["meso_hexapod"]
    axes: tuple[str, str, str, str, str, str]
    hexapod: Hexapod
    directions: Directions
    cube: Cube
    workspace: RatedTravel
    travel: Length

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """Commanded actuator travel == stage displacement -> pose by the kinematic Jacobian (6)-(10), as printed."""
        J = meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian)
        travel = self.travel.si
        drive = Signal("travel", "actuator travel", self.axes, ("um",) * 6, "u_", ca.SX.sym("u", 6), (travel,) * 6)

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return [
                Limit("drive", drive.label, self.axes, "um", signal.drive, -travel, travel),
                Limit("stroke", "stage displacement", self.axes, "um", signal.displacement, -travel, travel),
            ]

        arm = 1e-6 / self.hexapod.platform_radius.si  # moves the platform's rim by 1 um
        return BalancedPhysics(
            axes=self.axes,
            components=("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"),
            pose_units=("urad",) * 3 + ("um",) * 3,
            pose_scale=(arm,) * 3 + (1e-6,) * 3,
            drive=drive,
            displacement_scale=travel,  # far below it the balance could not be met to its last digit
            force_scale=travel,
            force=lambda u, x, d: u,
            restoring_force=lambda d: d,
            force_unit="um",
            pose=lambda d: ca.mtimes(J, d),
            limits=limits,
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
