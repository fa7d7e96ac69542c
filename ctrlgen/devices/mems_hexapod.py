"""NIST's MEMS hexapod: six thermal actuators, three X-Y stages, six struts. Source: S1."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal

import casadi as ca
import numpy as np
import scipy
from pydantic import AfterValidator, Field, model_validator

from ctrlgen.core.names import ChannelName, distinct
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics, InertialPhysics
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.loaded_platform import LoadedPlatform
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import AxisSignal, Signal
from ctrlgen.numerics.constraint_second_order import second_order
from ctrlgen.physics import hexapod, thermal_actuator, xy_stage
from ctrlgen.physics.damping import modal_damping
from ctrlgen.physics.screw import Matrix

BEYOND = 1.01  # of how far a load pushes a cold stage back: at the bound itself the force is zero but for rounding
Length = Annotated[Quantity, In("um", positive=True)]
Angle = Annotated[Quantity, In("deg")]
Count = Annotated[Quantity, In("1", positive=True, whole=True)]
Inertia = Annotated[Quantity, In("mg*mm^2", positive=True)]


class Actuator(Section):
    """Bent-beam thermal actuator, S1 Table 1, with its heater."""

    domain: ClassVar[str] = "actuator"

    beams: Annotated[Quantity, In("1", low=1, whole=True)]
    """n: beams on each side of the bar."""
    beam_length: Length
    """l^bt: length of one beam."""
    beam_width: Length
    """w_1: width of one beam, in the plane of motion."""
    beam_gap: Length
    """w_2: distance between two beams."""
    bar_width: Length
    """w_3: width of a beam as measured along the bar; beams stand w_2 + w_3/2 apart."""
    bar_half_height: Length
    """Distance from the bar's middle line to the roots of its beams, 50 um in d_1^i of S1 section 3.1."""
    beam_angle: Annotated[Quantity, In("rad", positive=True, high=0.5)]
    """theta^t: angle of the beams to the normal of the bar; the force grows with its sine."""
    thickness: Length
    """h: thickness of the device layer, of beams, levers and notches alike."""
    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus E of the device layer."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio v of the device layer."""
    expansion: Annotated[Quantity, In("1/K", positive=True)]
    """Coefficient of thermal expansion alpha at 0 degC."""
    expansion_slope: Annotated[Quantity, In("1/K^2", low=0.0)]
    """Increase of alpha per kelvin."""
    ambient: Annotated[Quantity, In("degC", low=200.0, high=400.0)]
    """Temperature T_amb at which the actuators are without force and to which they cool."""
    temperature_limit: Annotated[Quantity, In("degC", positive=True, high=3700.0)]  # tungsten melts
    """Largest average temperature of an actuator; a limit of trajectories and of the generated controller."""
    thermal_resistance: Annotated[Quantity, In("K/W", positive=True)]
    """R_th: temperature rise per heater power in the steady state."""
    time_constant: Annotated[Quantity, In("ms", positive=True)]
    """tau: time constant of heating and of cooling, first order."""
    power_limit: Annotated[Quantity, In("W", positive=True)]
    """Largest heater power; the smallest is 0, because cooling is passive."""
    heater_resistance: Annotated[Quantity, In("ohm", positive=True)]
    """R: turns a drive in volts into power, P = V^2/R; not used where the drive is a power."""
    drive: Literal["power", "voltage"]
    """Whether the six drives are heater powers [W] or heater voltages [V]."""


class Notch(Section):
    """Compliance of one circular notch about its free end, S1 eq. (7)."""

    domain: ClassVar[str] = "stage"

    theta_x_per_M_x: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    """Torsion per moment about x, the axis along the flexure."""
    theta_y_per_F_z: Annotated[Quantity, In("rad/N")]
    """Rotation about y per force along z; averaged with `delta_z_per_M_y`, which is the same by reciprocity."""
    theta_y_per_M_y: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    """Rotation about y per moment about y, out of the plane."""
    theta_z_per_F_y: Annotated[Quantity, In("rad/N")]
    """Rotation about z per force along y; averaged with `delta_y_per_M_z`."""
    theta_z_per_M_z: Annotated[Quantity, In("rad/(N*um)", positive=True)]
    """Rotation about z per moment about z: the hinge's own motion, in S1 eq. (9)."""
    delta_x_per_F_x: Annotated[Quantity, In("um/N", positive=True)]
    """Extension along the flexure per force."""
    delta_y_per_F_y: Annotated[Quantity, In("um/N", positive=True)]
    """Deflection along y, in the plane, per force."""
    delta_y_per_M_z: Annotated[Quantity, In("um/(N*um)")]
    """Deflection along y per moment about z."""
    delta_z_per_F_z: Annotated[Quantity, In("um/N", positive=True)]
    """Deflection along z, out of the plane, per force."""
    delta_z_per_M_y: Annotated[Quantity, In("um/(N*um)")]
    """Deflection along z per moment about y."""


class Stage(Section):
    """One axis of an X-Y stage, S1 Table 1 and sections 3.3-4.2."""

    domain: ClassVar[str] = "stage"

    lever_short: Length
    """e_3: from the lever's root to the notch that drives it."""
    lever_long: Length
    """e_4: length of levers and guides between their notches; e_4/e_3 multiplies the bar's travel."""
    lever_width: Length
    """w_5: width of levers and guides, in the plane."""
    notch_radius: Length
    """r: radius of the circular notches."""
    notches: Count
    """Notches that turn when the stage moves, each by d/e_4 (S1 eq. 9)."""
    notch: Notch
    """Compliance of one notch."""
    half_stage_stiffness: Annotated[Quantity, In("N/um", positive=True)]
    """k_a: axial stiffness of one half stage, which makes the nonlinear force of S1 eq. (11)."""
    plate_half_length: Length
    """From the plate's centre to its arms, along the motion."""
    plate_half_width: Length
    """e_6: from the plate's centre to its arms, across the motion."""
    centre_offset: Length
    """e_8: from the centre of the X stage to that of the Y stage, along y."""
    stroke: Length
    """Largest displacement; the smallest is 0. A limit of trajectories and of the generated controller."""
    notch_rotation_limit: Annotated[Quantity, In("deg", positive=True)]
    """Largest rotation phi = asin(d/e_4) of a notch; a limit."""


class Hexapod(Section):
    """Struts and platform, S1 Table 2."""

    platform_radius: Length
    """r_a: radius of the circle of strut ends on the platform."""
    base_radius: Length
    """r_b: radius of the circle of strut ends on the stages at home."""
    height: Length
    """H: height of a strut, from its lower to its upper end."""
    platform_thickness: Length
    """t: the upper strut ends stand t below the origin, the centre of the platform's top face."""
    platform_angles: tuple[Angle, Angle, Angle, Angle, Angle, Angle]
    """alpha_1 to alpha_6: angles of the platform's strut ends about z, from x."""
    base_angles: tuple[Angle, Angle, Angle, Angle, Angle, Angle]
    """beta_1 to beta_6: angles of the lower strut ends about z, from x."""
    stage_angles: tuple[Angle, Angle, Angle]
    """Angle by which each of the three stages is turned about z."""
    wire_length: Length
    """l: length of the wire flexure at each end of a strut."""
    wire_diameter: Length
    """d: diameter of the wire flexures."""
    rod_diameter: Length
    """D: diameter of the rod between them."""
    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus of wires and rods."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio of wires and rods."""
    stress_limit: Annotated[Quantity, In("MPa", positive=True)]
    """Largest stress at the ends of the wires; a limit."""


class HexapodDynamics(Section):
    """`[dynamics]`: the model has the inertia of stages, struts and platform, which move as they do at rest. Left out: it is in balance at
    every moment."""

    stage_mass: Annotated[Quantity, In("mg", positive=True)]
    """What moves with a stage along one axis: its plate, and of levers and guides, which turn about an end, a third."""
    platform_mass: Annotated[Quantity, In("mg", positive=True)]
    """Mass of the platform, its centre half the `platform_thickness` below the origin."""
    platform_inertia: tuple[Inertia, Inertia, Inertia]
    """Its moments of inertia about axes along x, y and z through its centre of mass."""
    strut_mass: Annotated[Quantity, In("mg", low=0.0)]
    """Mass of one strut, a slender rod."""
    damping_ratio: Annotated[Quantity, In("1", low=0.0, high=1.0)]
    """Damping ratio of every mode at home."""


class MemsHexapod(LoadedPlatform):
    """Heater power -> temperature -> bar force = restoring force of the stage at its displacement -> pose; with `[dynamics]` the
    difference of the forces accelerates the masses.

    Displacements and forces count positive in the direction in which the actuators push.
    """

    works_by: ClassVar[str | None] = "thermal"
    on_flexures: ClassVar[bool | None] = True

    kind: Literal["mems_hexapod"]
    """NIST's MEMS hexapod with thermal actuators (S1)."""
    axes: Annotated[tuple[ChannelName, ...], Field(min_length=6, max_length=6), AfterValidator(distinct)]
    """Names of the six actuators, in the order 1X, 1Y, 2X, 2Y, 3X, 3Y of S1 eq. (19)."""
    push: tuple[Literal[-1, 1], ...] = Field(min_length=6, max_length=6)
    """Signs of S1 eq. (19): along which direction of the paper's axis each actuator pushes. Displacements and forces
    count positive along the push.
    """
    actuator: Actuator
    """The thermal actuators, all six alike."""
    stage: Stage
    """One axis of an X-Y stage, all six alike."""
    hexapod: Hexapod
    """Struts and platform."""
    dynamics: HexapodDynamics | None = None
    """`[dynamics]`: where inertia counts."""

    @model_validator(mode="after")
    def _lengths_fit(self) -> MemsHexapod:
        h, s, a = self.hexapod, self.stage, self.actuator
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
        """Names the axes that the paper counts in the opposite direction."""
        opposite = [axis for axis, sign in zip(self.axes, self.push, strict=True) if sign < 0]
        return (
            [f"S1 eq. (19) counts {', '.join(opposite)} against the push; here all count positive along it"]
            if opposite
            else []
        )

    def _resistance(self, actuator: Any) -> Any:
        """The heaters' resistance where the drive is a voltage; None where it is the power."""
        return actuator.heater_resistance if self.actuator.drive == "voltage" else None

    def _drive(self) -> Signal:
        """The heaters' drive, power or voltage."""
        name, unit, column = ("voltage", "V", "V_") if self.actuator.drive == "voltage" else ("power", "W", "P_")
        actuator = self.values().actuator
        _, largest = thermal_actuator.drive_range(actuator.power_limit, self._resistance(actuator))
        return Signal(name, f"heater {name}", self.axes, (unit,) * 6, column, ca.SX.sym("u", 6), (largest,) * 6)

    def _limits(
        self, p: SimpleNamespace, loads: Matrix, drive: Signal, state: Signal, signal: SimpleNamespace
    ) -> list[Limit]:
        """The limits on what `signal` holds; `loads` are those of the wires per displacement."""
        a, axes, d = p.actuator, self.axes, signal.displacement
        least, most = thermal_actuator.drive_range(a.power_limit, self._resistance(a))
        turn, turn_limit = xy_stage.rotation(d, p.stage), self.stage.notch_rotation_limit.si
        # The moment is linear along a strut, so its magnitude is convex: largest at one of the strut's own ends.
        wires = tuple(f"strut{i + 1}_{end}" for i in range(6) for end in ("base_bottom", "platform_top"))
        outermost = [4 * i + end for i in range(6) for end in (0, 3)]
        moved = self._with_loads(signal.mechanism_displacement)
        stress = hexapod.wire_stress(moved, loads, p.hexapod)[outermost]
        return [
            Limit("drive", f"commanded {drive.label}", axes, drive.units[0], signal.drive, least, most),
            Limit("temperature", state.label, axes, "degC", signal.state, a.ambient, a.temperature_limit),
            Limit("force", "actuator force", axes, "N", signal.force, 0.0, None),
            Limit("stroke", "stage displacement", axes, "um", d, pushed_back(self), self.stage.stroke.si),
            Limit("notch_rotation", "notch rotation", axes, "deg", turn, None, turn_limit),
            Limit("wire_stress", "wire flexure stress", wires, "MPa", stress, None, self.hexapod.stress_limit.si),
        ]

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """Equations of `ctrlgen.physics` with this device's numbers."""
        a, s, h = p.actuator, p.stage, p.hexapod
        C_XY = xy_stage.stage_compliance(s, a)
        J = hexapod.jacobian(h, C_XY)
        drive, motion, pulled = self._drive(), J, ca.DM.zeros(6)
        if self.load:
            W = self.wrench(p)
            motion = ca.horzcat(J, ca.mtimes(hexapod.platform_compliance(h, C_XY), W))
            pulled = ca.mtimes(J.T, ca.vertcat(W[3:], W[:3]))
        loads = hexapod.wire_loads(h, C_XY, motion)
        T = ca.SX.sym("T", 6)
        state = Signal("temperature", "actuator temperature", self.axes, ("degC",) * 6, "T_", T, (100.0,) * 6)
        rotation_scale = 1e-6 / self.hexapod.platform_radius.si  # moves the platform's rim by 1 um

        common: dict[str, Any] = dict(
            axes=self.axes,
            components=("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"),
            pose_units=("rad",) * 3 + ("um",) * 3,
            pose_scale=(rotation_scale,) * 3 + (1e-6,) * 3,
            drive=drive,
            state=state,
            rest=(a.ambient,) * 6,
            displacement_scale=1e-5,
            force_scale=0.05,
            restoring_force=lambda d: xy_stage.force(d, s, a) - pulled,
            restoring_force_parts=lambda d: {
                "linear": xy_stage.linear_force(d, s, a),
                "nonlinear": xy_stage.nonlinear_force(d, s),
                **({"load": -pulled} if self.load else {}),
            },
            pose=lambda d: ca.mtimes(motion, self._with_loads(d)),
            second_order_kinematics=lambda d: second_order(lambda pose, d: hexapod.loop_closure(pose, d, h), d),
            limits=partial(self._limits, p, loads, drive, state),
            bipolar=False,
            documented={
                "force": (thermal_actuator.force, thermal_actuator.expansion),
                "restoring_force": (xy_stage.force, xy_stage.linear_force, xy_stage.nonlinear_force),
            },
        )
        if p.dynamics is None:
            return BalancedPhysics(
                **common,
                heating_power=lambda u: thermal_actuator.heating_power(u, self._resistance(a)),
                power=AxisSignal("heater power", "W", "P_", self.actuator.power_limit.si),
                rates=lambda T, P: thermal_actuator.temperature_rate(T, P, a),
                force=lambda u, T, d: thermal_actuator.force(T, a),
                tangent_compliance=lambda d: (
                    xy_stage.stiffened(d, s, a) * ca.mtimes(hexapod.stage_loads(h, C_XY, motion), self._with_loads(d))
                ),
            )
        M, D = self._inertia()
        return InertialPhysics(
            **common,
            mass=M,
            dynamics=lambda u, T, d, v: (
                thermal_actuator.force(T, a),
                thermal_actuator.temperature_rate(T, thermal_actuator.heating_power(u, self._resistance(a)), a),
            ),
            damping_force=lambda v: p.dynamics.damping_ratio * ca.mtimes(D, v),
        )

    def _with_loads(self, d: ca.SX) -> ca.SX:
        """The displacements (6,), and behind them one for the loads where there are some."""
        return ca.vertcat(d, 1) if self.load else d

    def _inertia(self) -> tuple[ca.DM, ca.DM]:
        """(6, 6) mass and damping, that by the damping ratio, of the stated numbers: their formulas would be a thousand times those of the
        statics."""
        p = self.values()
        assert p.dynamics is not None
        J = hexapod.jacobian(p.hexapod, xy_stage.stage_compliance(p.stage, p.actuator))
        M = hexapod.mass(p.hexapod, p.dynamics, J)
        D = modal_damping(M, home_stiffness(lambda d: xy_stage.force(d, p.stage, p.actuator)), 1.0)
        return ca.DM(ca.evalf(ca.SX(M))), ca.DM(ca.evalf(ca.SX(D)))


def home_stiffness(force: Callable[[ca.SX], ca.SX]) -> ca.SX:
    """(6, 6) [N/m] slope of a `force` (6,) of the displacements (6,) at home."""
    d = ca.SX.sym("d", 6)
    return ca.substitute(ca.jacobian(force(d), d), d, ca.SX.zeros(6))


def pushed_back(device: MemsHexapod) -> float:
    """The lowest displacement of a stage at rest [m], zero or below: how far the loads push the cold stages back, K^-1 J'W with their
    stiffness at home, beyond which they only get stiffer."""
    if not device.load:
        return 0.0
    p = device.values()
    W = device.wrench(p)
    J = hexapod.jacobian(p.hexapod, xy_stage.stage_compliance(p.stage, p.actuator))
    K = home_stiffness(lambda d: xy_stage.force(d, p.stage, p.actuator))
    return min(BEYOND * float(ca.mmin(ca.evalf(ca.solve(K, ca.mtimes(J.T, ca.vertcat(W[3:], W[:3])))))), 0.0)


def natural_frequencies(device: MemsHexapod) -> np.ndarray:
    """(6,) [Hz] with the drives held, at home, ascending; none of a device without the table `dynamics`."""
    p = device.values()
    if p.dynamics is None:
        return np.zeros(0)
    J = hexapod.jacobian(p.hexapod, xy_stage.stage_compliance(p.stage, p.actuator))
    K = home_stiffness(lambda d: xy_stage.force(d, p.stage, p.actuator))
    M, K = (ca.DM(ca.evalf(ca.SX(matrix))).full() for matrix in (hexapod.mass(p.hexapod, p.dynamics, J), K))
    return np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)) / (2 * np.pi)


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
