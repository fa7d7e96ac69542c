"""NIST's meso-scale hexapod: six linear actuators move three planar stages, six struts the platform. Source: S0."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import AfterValidator, Field

from ctrlgen.core.names import ChannelName, distinct
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import BalancedPhysics
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import Signal
from ctrlgen.devices.travel import Travel, ends_of, farthest
from ctrlgen.numerics.constraint_second_order import second_order
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod

Length = Annotated[Quantity, In("mm", positive=True)]
Angle = Annotated[Quantity, In("deg")]
Six = tuple[Angle, Angle, Angle, Angle, Angle, Angle]


class Hexapod(Section):
    """Strut ends and platform, S0 Table 1. The four spacings follow from radii and angles and enter no equation."""

    platform_radius: Length
    """r_a: radius of the circle of strut ends on the platform."""
    base_radius: Length
    """r_b: radius of the circle of strut ends on the stages at home."""
    platform_thickness: Length
    """t: the strut ends stand t/2 below the platform's centre (S0 eq. 1)."""
    height: Length
    """H: the lower strut ends stand H below the platform's centre (S0 eq. 1)."""
    strut_length: Length
    """L as printed; it enters no equation, because the lengths follow from the strut ends at home."""
    base_near: Length
    """c_1: between neighbouring strut ends on the base; enters no equation."""
    base_far: Length
    """c_2: between the other strut ends on the base; enters no equation."""
    platform_near: Length
    """c_3: between neighbouring strut ends on the platform; enters no equation."""
    platform_far: Length
    """c_4: between the other strut ends on the platform; enters no equation."""
    platform_angles: Six
    """phi_1 to phi_6: angles of the platform's strut ends about z, from x."""
    base_angles: Six
    """psi_1 to psi_6: angles of the lower strut ends about z, from x."""


class Directions(Section):
    """Direction of each actuator's motion in the constraint (S0 eq. 4) and in the Jacobian (eq. 9)."""

    constraint: Six
    """As the position constraint has them (S0 eq. 4); the model does not use them."""
    jacobian: Six
    """As the Jacobian has them (S0 eq. 9); the model uses these."""


class Cube(Section):
    """The reflective cube below the platform, at which the instruments measure."""

    depth: Length
    """h: the cube's centre stands h below the platform's (S0 eq. 16)."""


class RatedTravel(Section):
    """Largest rotation and translation about any axis that the paper states; the model's limit is `travel`."""

    rotation: Annotated[Quantity, In("deg", positive=True)]
    """Largest rotation about any axis, either sign."""
    translation: Annotated[Quantity, In("um", positive=True)]
    """Largest translation along any axis, either sign."""


class MesoHexapod(Device):
    """Actuator displacement -> stage -> platform pose: kinematics alone, without force, temperature or time."""

    on_flexures: ClassVar[bool | None] = True

    kind: Literal["meso_hexapod"]
    """The kinematics of NIST's meso-scale hexapod (S0)."""
    axes: Annotated[tuple[ChannelName, ...], Field(min_length=6, max_length=6), AfterValidator(distinct)]
    """Names of the six actuators, in the order of S0 eq. (6): 1x, 2x, 2y, 3x, 3y, 1y."""
    hexapod: Hexapod
    """Strut ends and platform."""
    directions: Directions
    """Direction in which each actuator moves its stage, as an angle from the global x, in the order of `axes`."""
    cube: Cube
    """The reflective cube that is measured."""
    workspace: RatedTravel
    """Range of poses that the paper states."""
    travel: Travel
    """Largest displacement of an actuator, either sign, or its ends, such as ["-0.2 mm", "1 mm"]; the limit of drives and stages."""

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """Commanded actuator travel = stage displacement -> pose by the kinematic Jacobian (6)-(10), as printed."""
        J = meso_hexapod.kinematic_jacobian(p.hexapod, p.directions.jacobian)
        travel, ends = farthest(self.travel), ends_of(self.travel)
        drive = Signal("travel", "actuator travel", self.axes, ("um",) * 6, "u_", ca.SX.sym("u", 6), (travel,) * 6)

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return [
                Limit("drive", drive.label, self.axes, "um", signal.drive, *ends),
                Limit("stroke", "stage displacement", self.axes, "um", signal.displacement, *ends),
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
            second_order_kinematics=lambda d: second_order(
                lambda pose, d: meso_hexapod.loop_closure(pose, d, p.hexapod, p.directions.jacobian), d
            ),
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
