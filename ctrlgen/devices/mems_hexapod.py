"""NIST's MEMS hexapod: six thermal actuators, three X-Y stages, six struts. Source: S1."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.base import AxisSignal, BalancedPhysics, Device, Limit, Section, Signal
from ctrlgen.physics import hexapod, thermal_actuator, xy_stage

Length = Annotated[Quantity, In("um", positive=True)]
Angle = Annotated[Quantity, In("deg")]
Count = Annotated[Quantity, In("1", positive=True, whole=True)]
Axis = Annotated[str, Field(pattern=r"^[A-Za-z0-9_]+$")]


class Actuator(Section):
    """Bent-beam thermal actuator, S1 Table 1, with its heater."""

    domain: ClassVar[str] = "actuator"

    beams: Annotated[Quantity, In("1", low=1, whole=True)]
    beam_length: Length
    beam_width: Length
    beam_gap: Length
    bar_width: Length
    bar_half_height: Length
    beam_angle: Annotated[Quantity, In("rad", positive=True, high=0.5)]
    thickness: Length
    young: Annotated[Quantity, In("GPa", positive=True)]
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    expansion: Annotated[Quantity, In("1/K", positive=True)]
    expansion_slope: Annotated[Quantity, In("1/K^2", low=0.0)]
    ambient: Annotated[Quantity, In("degC", low=200.0, high=400.0)]
    temperature_limit: Annotated[Quantity, In("degC", positive=True)]
    thermal_resistance: Annotated[Quantity, In("K/W", positive=True)]
    time_constant: Annotated[Quantity, In("ms", positive=True)]
    power_limit: Annotated[Quantity, In("W", positive=True)]
    heater_resistance: Annotated[Quantity, In("ohm", positive=True)]
    drive: Literal["power", "voltage"]


class Notch(Section):
    """Compliance of one circular notch about its free end, S1 eq. (7)."""

    domain: ClassVar[str] = "stage"

    theta_x_per_M_x: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    theta_y_per_F_z: Annotated[Quantity, In("rad/N")]
    theta_y_per_M_y: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    theta_z_per_F_y: Annotated[Quantity, In("rad/N")]
    theta_z_per_M_z: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    delta_x_per_F_x: Annotated[Quantity, In("um/N", positive=True)]
    delta_y_per_F_y: Annotated[Quantity, In("um/N", positive=True)]
    delta_y_per_M_z: Annotated[Quantity, In("um/(N*um)")]
    delta_z_per_F_z: Annotated[Quantity, In("um/N", positive=True)]
    delta_z_per_M_y: Annotated[Quantity, In("um/(N*um)")]


class Stage(Section):
    """One axis of an X-Y stage, S1 Table 1 and sections 3.3-4.2."""

    domain: ClassVar[str] = "stage"

    lever_short: Length
    lever_long: Length
    lever_width: Length
    notch_radius: Length
    notches: Count
    notch: Notch
    half_stage_stiffness: Annotated[Quantity, In("N/um", positive=True)]
    plate_half_length: Length
    plate_half_width: Length
    centre_offset: Length
    stroke: Length
    notch_rotation_limit: Annotated[Quantity, In("deg", positive=True)]


class Hexapod(Section):
    """Struts and platform, S1 Table 2."""

    platform_radius: Length
    base_radius: Length
    height: Length
    platform_thickness: Length
    platform_angles: tuple[Angle, Angle, Angle, Angle, Angle, Angle]
    base_angles: tuple[Angle, Angle, Angle, Angle, Angle, Angle]
    stage_angles: tuple[Angle, Angle, Angle]
    wire_length: Length
    wire_diameter: Length
    rod_diameter: Length
    young: Annotated[Quantity, In("GPa", positive=True)]
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    stress_limit: Annotated[Quantity, In("MPa", positive=True)]


class MemsHexapod(Device):
    """Heater power -> temperature -> bar force == stage force of the displacement -> pose.

    `push` is the table of signs of S1 eq. (19): the direction along the paper's stage axis in
    which each actuator pushes. Inside, displacement and force count positive along the push.
    """

    kind: Literal["mems_hexapod"]
    axes: tuple[Axis, Axis, Axis, Axis, Axis, Axis]
    push: tuple[Literal[-1, 1], ...] = Field(min_length=6, max_length=6)
    actuator: Actuator
    stage: Stage
    hexapod: Hexapod

    @model_validator(mode="after")
    def _lengths_fit(self) -> MemsHexapod:
        h, s, a = self.hexapod, self.stage, self.actuator
        if len(set(self.axes)) != 6:
            raise ValueError("axes: two actuators have the same name; name each once")
        if s.lever_short.si >= s.lever_long.si:
            raise ValueError("stage.lever_short must be below stage.lever_long: the lever multiplies travel")
        if s.stroke.si >= s.lever_long.si:
            raise ValueError("stage.stroke must be below stage.lever_long: phi = asin(stroke/lever_long)")
        if 2 * s.notch_radius.si >= s.lever_long.si:
            raise ValueError("stage.notch_radius is too large: two notches must fit on lever_long")
        if 2 * h.wire_length.si >= h.height.si:
            raise ValueError("hexapod.wire_length is too large: two wires must fit in the strut")
        if a.temperature_limit.si <= a.ambient.si:
            raise ValueError("actuator.temperature_limit must be above actuator.ambient: a heater can only heat")
        return self

    def in_paper_axes(self, values: np.ndarray) -> np.ndarray:
        """Displacements or forces (..., 6), positive along the push, with the signs of S1 eq. (19)."""
        return np.asarray(values) * np.array(self.push)

    def remarks(self) -> list[str]:
        """Where the paper counts the other way."""
        turned = [axis for axis, sign in zip(self.axes, self.push, strict=True) if sign < 0]
        return (
            [f"S1 eq. (19) counts {', '.join(turned)} against the push; here all count positive along it"]
            if turned
            else []
        )

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """Equations of `ctrlgen.physics` with this device's numbers."""
        a, s, h = p.actuator, p.stage, p.hexapod
        C_XY = xy_stage.stage_compliance(s, a)
        J = hexapod.jacobian(h, C_XY)
        loads = hexapod.wire_loads(h, C_XY, J)
        voltage = self.actuator.drive == "voltage"
        power_limit, resistance = self.actuator.power_limit.si, self.actuator.heater_resistance.si
        drive_limit = (power_limit * resistance) ** 0.5 if voltage else power_limit
        drive = Signal(
            "voltage" if voltage else "power",
            "heater voltage" if voltage else "heater power",
            self.axes,
            ("V" if voltage else "W",) * 6,
            "V_" if voltage else "P_",
            ca.SX.sym("u", 6),
            (drive_limit,) * 6,
        )
        state = Signal(
            "temperature", "actuator temperature", self.axes, ("degC",) * 6, "T_", ca.SX.sym("T", 6), (100.0,) * 6
        )
        rotation_scale = 1e-6 / self.hexapod.platform_radius.si  # moves the platform's rim by 1 um

        def heating_power(u: ca.SX) -> ca.SX:
            return u**2 / a.heater_resistance if voltage else u

        def limits(signal: SimpleNamespace) -> list[Limit]:
            d = signal.displacement
            # The moment is linear along a strut, so its magnitude is convex: largest at one of the strut's own ends.
            wires = tuple(f"strut{i + 1}_{end}" for i in range(6) for end in ("base_bottom", "platform_top"))
            wire_stress = hexapod.wire_stress(signal.mechanism_displacement, loads, h)
            outermost = [4 * i + end for i in range(6) for end in (0, 3)]
            return [
                Limit("drive", f"commanded {drive.label}", self.axes, drive.units[0], signal.drive, 0.0, drive_limit),
                Limit(
                    "temperature", state.label, self.axes, "degC", signal.state,
                    self.actuator.ambient.si, self.actuator.temperature_limit.si,
                ),
                Limit("force", "actuator force", self.axes, "N", signal.force, 0.0, None),
                Limit("stroke", "stage displacement", self.axes, "um", d, 0.0, self.stage.stroke.si),
                Limit(
                    "notch_rotation", "notch rotation", self.axes, "deg", xy_stage.rotation(d, s),
                    None, self.stage.notch_rotation_limit.si,
                ),
                Limit(
                    "wire_stress", "wire flexure stress", wires, "MPa", wire_stress[outermost],
                    None, self.hexapod.stress_limit.si,
                ),
            ]  # fmt: skip

        return BalancedPhysics(
            axes=self.axes,
            components=("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"),
            pose_units=("rad",) * 3 + ("um",) * 3,
            pose_scale=(rotation_scale,) * 3 + (1e-6,) * 3,
            drive=drive,
            state=state,
            rest=(a.ambient,) * 6,
            displacement_scale=1e-5,
            force_scale=0.05,
            heating_power=heating_power,
            power=AxisSignal("heater power", "W", "P_", power_limit),
            rates=lambda T, P: thermal_actuator.temperature_rate(T, P, a),
            force=lambda u, T, d: thermal_actuator.force(T, a),
            restoring_force=lambda d: xy_stage.force(d, s, a),
            restoring_force_parts=lambda d: {
                "linear": xy_stage.linear_force(d, s, a),
                "nonlinear": xy_stage.nonlinear_force(d, s),
            },
            pose=lambda d: ca.mtimes(J, d),
            limits=limits,
            bipolar=False,
            tangent_compliance=lambda d: xy_stage.stiffened(d, s, a) * ca.mtimes(hexapod.stage_loads(h, C_XY, J), d),
            second_order_kinematics=lambda d: hexapod.second_order(d, h),
        )


def matrices(device: MemsHexapod) -> dict[str, Any]:
    """The matrices the paper prints or defines, as (6, 6) arrays in SI, by their symbol."""
    p = device.values()
    C_XY = xy_stage.stage_compliance(p.stage, p.actuator)
    named = {
        "K_tb": thermal_actuator.beam_stiffness(p.actuator),
        "K_t": thermal_actuator.stiffness(p.actuator),
        "C_c": xy_stage.notch_compliance(p.stage),
        "K_X": xy_stage.axis_stiffness(p.stage, p.actuator),
        "C_XY": C_XY,
        "J": hexapod.jacobian(p.hexapod, C_XY),
        "J_kinematic": hexapod.kinematic_jacobian(p.hexapod),
    }
    return {name: ca.DM(matrix).full() for name, matrix in named.items()}
