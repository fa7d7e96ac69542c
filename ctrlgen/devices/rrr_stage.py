"""A planar 3-RRR compliant stage on three piezo stacks. Source: S3."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import AfterValidator, Field, model_validator

from ctrlgen.core.names import ChannelName, distinct
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.device_physics import BalancedPhysics
from ctrlgen.devices.hinge import Hinge
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.loaded_platform import LoadedPlatform
from ctrlgen.devices.section import Section
from ctrlgen.devices.signal import Signal
from ctrlgen.physics import piezo_stack
from ctrlgen.physics import rrr_kinetostatics as rrr_stage
from ctrlgen.physics.rrr_kinetostatics import Kinetostatics
from ctrlgen.physics.screw import Matrix

Length = Annotated[Quantity, In("mm", positive=True)]


class Lengths(Section):
    """Link lengths of S3 Fig. 6(b)."""

    l1: Length
    """From Point 1, the end of hinge 1, to Point o', where the link meets the platform, along x of Link 1 (S3 eq.
    B.17).
    """
    l2: Length
    """Length of the rigid link between hinges 2 and 3 (S3 Table 1)."""
    l3: Annotated[Quantity, In("mm", low=0.0)]
    """From the end of hinge 3 to Point o' (S3 Table 1)."""
    l4: Length
    """From Point 1 to Point o', along y of Link 1 (S3 eq. B.17)."""
    l5: Annotated[Quantity, In("mm", low=0.0)]
    """Arm of the input force about Point 1 (S3 below eq. B.8)."""
    l6: Annotated[Quantity, In("mm", low=0.0)]
    """From Point o' to the platform's centre, Point o (S3 eq. B.58)."""


class Material(Section):
    """Material and width of the sheet the stage is cut from."""

    young: Annotated[Quantity, In("GPa", positive=True)]
    """Young's modulus E."""
    poisson: Annotated[Quantity, In("1", low=0.0, high=0.5)]
    """Poisson's ratio v."""
    width: Length
    """Thickness of the sheet, which is the width b of every hinge."""


class Piezo(Section):
    """The stack behind each input and its amplifier."""

    stroke: Annotated[Quantity, In("um", positive=True)]
    """Free travel s at the largest voltage."""
    blocking_force: Annotated[Quantity, In("N", positive=True)]
    """Force F_b at the largest voltage and no travel; the stack's stiffness is F_b/s."""
    voltage_limit: Annotated[Quantity, In("V", positive=True)]
    """Largest voltage V_max; voltages run from 0 to it."""
    time_constant: Annotated[Quantity, In("ms", positive=True)]
    """Time constant with which the stack's voltage follows the amplifier's input."""


class RrrStage(LoadedPlatform):
    """Stack voltage -> force on the input = restoring force of the input -> output displacement."""

    works_by: ClassVar[str | None] = "piezo"
    planar: ClassVar[bool] = True
    on_flexures: ClassVar[bool | None] = True

    kind: Literal["rrr_stage"]
    """A planar stage of three links with three circular hinges each (S3)."""
    axes: Annotated[tuple[ChannelName, ...], Field(min_length=3, max_length=3), AfterValidator(distinct)]
    """Names of the three inputs, in the order of Links 1 to 3."""
    frame_angle: Annotated[Quantity, In("deg")]
    """Angle by which the output frame is turned from the frame of Link 1."""
    inputs: Literal["whole", "printed"] = "whole"
    """Input compliance of the whole linear model, or as S3 eq. (B.83) prints it, without the part that the inputs give
    with the platform held.
    """
    lengths: Lengths
    """Lengths of the links."""
    material: Material
    """Material and thickness of the sheet."""
    hinge1: Hinge
    """Hinge 1 of every link, at the base."""
    hinge2: Hinge
    """Hinge 2 of every link, in the middle."""
    hinge3: Hinge
    """Hinge 3 of every link, at the platform."""
    piezo: Piezo
    """The stacks, all three alike."""

    @model_validator(mode="after")
    def _hinges_store_energy(self) -> RrrStage:
        faults = []
        for name in self.hinges:
            try:
                hinge_compliance(self, name, self.values())
            except ValueError as fault:
                faults.append(f"{name}: {fault}")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    @property
    def hinges(self) -> dict[str, Hinge]:
        """The hinges of one arm by their name, from the base to the platform."""
        return {"hinge1": self.hinge1, "hinge2": self.hinge2, "hinge3": self.hinge3}

    def remarks(self) -> list[str]:
        """Remarks on hinge equations used outside their t/R range."""
        return [f"{name}: {note}" for name, hinge in self.hinges.items() for note in hinge.notes()]

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """Equations of `ctrlgen.physics` with this device's numbers.

        The stiffness of the stack counts as the stage's, so that its force depends on the voltage alone:
        F_b V/V_max = (C_in^-1 + k_p) d. The voltage limit keeps it below F_b. The stacks are taken to be preloaded; it is
        not checked that none pulls on its input. A load W = (F_x, F_y, M_z) on the platform, at Point o in the output frame, moves the
        inputs by C_in,Fo W and the output by C_o,Fo W where nothing pushes (S3 eq. (1)): with the inputs at d the force is
        C_in^-1 (d - C_in,Fo W) and the output J d + (C_o,Fo - J C_in,Fo) W.
        """
        k = stage(self, p)
        K_in, J = input_stiffness(self, k), (k.complete_J if self.inputs == "whole" else k.J)
        limit, stroke = self.piezo.voltage_limit.si, self.piezo.stroke.si
        # The lowest displacement under any voltages: an input moves back a little when the others push.
        lowest = float(np.minimum(input_per_voltage(self), 0).sum(axis=1).min()) * limit + min(pushed_back(self), 0.0)
        own = stage(self)
        reach = np.abs(ca.DM(own.complete_J if self.inputs == "whole" else own.J).full()).sum(axis=1) * stroke
        W = self.wrench(p)[[0, 1, 5]] if self.load else ca.DM.zeros(3)
        given = ca.mtimes(k.C_inFo, W)  # displacement of the inputs by the load, no voltages and no stacks
        carried = {"load": -ca.mtimes(K_in, given)} if self.load else {}
        drive = Signal("voltage", "amplifier input", self.axes, ("V",) * 3, "u_", ca.SX.sym("u", 3), (limit,) * 3)
        state = Signal("stack_voltage", "stack voltage", self.axes, ("V",) * 3, "V_", ca.SX.sym("V", 3), (limit,) * 3)

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return [
                Limit("drive", drive.label, self.axes, "V", signal.drive, 0.0, limit),
                Limit("stack_voltage", state.label, self.axes, "V", signal.state, 0.0, limit),
                Limit("force", "blocked force", self.axes, "N", signal.force, 0.0, None),
                Limit("stroke", "input displacement", self.axes, "um", signal.displacement, lowest, stroke),
            ]

        return BalancedPhysics(
            axes=self.axes,
            components=("delta_x", "delta_y", "theta_z"),
            pose_units=("um", "um", "urad"),
            pose_scale=tuple(map(float, reach)),  # what all inputs at their stroke make of it
            drive=drive,
            state=state,
            rest=(0.0,) * 3,
            displacement_scale=stroke,
            force_scale=self.piezo.blocking_force.si,
            rates=lambda V, u: piezo_stack.voltage_rate(V, u, p.piezo),
            force=lambda u, V, d: piezo_stack.blocked_force(V, p.piezo),
            restoring_force=lambda d: ca.mtimes(K_in, d - given) + piezo_stack.stiffness(p.piezo) * d,
            documented={"force": (piezo_stack.blocked_force,)},
            restoring_force_parts=lambda d: {
                "hinges": ca.mtimes(K_in, d),
                "stacks": piezo_stack.stiffness(p.piezo) * d,
                **carried,
            },
            pose=lambda d: ca.mtimes(J, d - given) + ca.mtimes(k.C_oFo, W),
            limits=limits,
            bipolar=False,
        )


def hinge_compliance(device: RrrStage, name: str, p: SimpleNamespace) -> Matrix:
    """[C] of one hinge by the equations that `device` names and the values `p`, (3, 3). Width and material are the sheet's.

    Raises ValueError where it is not positive definite: a load would gain energy from it.
    """
    m = p.material
    return device.hinges[name].planar(getattr(p, name), m.width, m.young, m.poisson)


def stage(device: RrrStage, p: SimpleNamespace | None = None) -> Kinetostatics:
    """The matrices of S3 appendix B with the values `p`, by default the device's own."""
    p = device.values() if p is None else p
    g = SimpleNamespace(**vars(p.lengths), R1=p.hinge1.R, R2=p.hinge2.R, R3=p.hinge3.R, frame_angle=p.frame_angle)
    return rrr_stage.kinetostatics([hinge_compliance(device, name, p) for name in device.hinges], g)


def input_stiffness(device: RrrStage, k: Kinetostatics) -> Matrix:
    """Input force per input displacement (3, 3) [N/m], by what the device's `inputs` says."""
    return k.input_stiffness if device.inputs == "whole" else ca.inv(k.C_inFin)


def input_per_voltage(device: RrrStage, p: SimpleNamespace | None = None) -> np.ndarray:
    """Input displacement per stack voltage at rest, (3, 3) [m/V]: (C_in^-1 + k_p)^-1 F_b/V_max."""
    p = device.values() if p is None else p
    K = input_stiffness(device, stage(device, p)) + piezo_stack.stiffness(p.piezo) * ca.DM.eye(3)
    return ca.DM(ca.inv(K) * piezo_stack.blocked_force(1.0, p.piezo)).full()


def pushed_back(device: RrrStage) -> float:
    """The lowest displacement of an input under the loads, no voltage on the stacks [m]: (C_in^-1 + k_p)^-1 C_in^-1 C_in,Fo W."""
    if not device.load:
        return 0.0
    p = device.values()
    k = stage(device, p)
    K_in = input_stiffness(device, k)
    force = ca.mtimes([K_in, k.C_inFo, device.wrench(p)[[0, 1, 5]]])
    return float(ca.mmin(ca.evalf(ca.solve(K_in + piezo_stack.stiffness(p.piezo) * ca.DM.eye(3), force))))


def matrices(device: RrrStage) -> dict[str, np.ndarray]:
    """The matrices the paper prints, as (3, 3) arrays in SI, by their symbol, and those of the whole model."""
    k = stage(device)
    named = {
        "C_oFo": k.C_oFo,
        "C_oFin": k.C_oFin,
        "C_inFo": k.C_inFo,
        "C_inFin": k.C_inFin,
        "J": k.J,
        "C_in": k.input_compliance,
        "K_in": k.input_stiffness,
        "J_complete": k.complete_J,
    }
    return {name: ca.DM(matrix).full() for name, matrix in named.items()}
