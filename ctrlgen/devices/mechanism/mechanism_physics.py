"""The equations of a mechanism as a device's physics: in balance, or with the inertia of its bodies."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca

from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics, InertialPhysics, SensedPoints
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.copies import Placed
from ctrlgen.devices.mechanism.drives import transduction
from ctrlgen.devices.mechanism.force_readings import inertial
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.mechanism.stretching import Stretching
from ctrlgen.devices.travel import ends_of, farthest
from ctrlgen.physics.damping import modal_damping
from ctrlgen.physics.screw import WRENCH, told_in


def mechanism_physics(c: Condensed) -> DevicePhysics:
    """The condensed mechanism as physics: with the table `dynamics` that of bodies with inertia, else in balance."""
    device, p, acting = c.device, c.p, transduction(c)
    axes, sections = acting.drive.channels, [a.section for a in device.placed_actuators]

    def restoring_force_parts(d: ca.SX) -> dict[str, ca.SX]:
        linear, springs = ca.mtimes(c.held_stiffness, d), c.restoring_force(d)
        loaded = {"loads": loads.restoring_force(d)} if loads.there else {}
        if bent and c.pushes:
            return {"linear": linear, "geometric": restoring_force(d) - springs - sum(loaded.values()), **loaded}
        cubic = {"cubic": springs - linear} if c.cubics else {}
        return {"linear": linear, **cubic, **loaded} if cubic or loaded else {}

    def limits(signal: SimpleNamespace) -> list[Limit]:
        limited = acting.limits(signal)
        for i, (axis, s) in enumerate(zip(axes, sections, strict=True)):
            d, ends = signal.displacement[i], ends_of(s.travel)
            limited.append(Limit(f"travel_{axis}", f"travel of {axis}", (axis,), "um", d, *ends))
        return limited + _flexure_limits(c, signal.mechanism_displacement, stretching, loads)

    J, channels, second = c.jacobian, device.output.channels, SecondOrder(c)
    loads = Loads(c, second)
    bent, stretching = device.second_order, Stretching(second) if device.geometric_stiffening else None

    def restoring_force(d: ca.SX) -> ca.SX:
        force, more = c.restoring_force(d), None if stretching is None else stretching.energy
        force += loads.restoring_force(d) if loads.there else 0
        return force + second.restoring_force(d, more) if bent and c.pushes else force

    def pose(d: ca.SX) -> ca.SX:
        linear = ca.mtimes(J, c.loads(d)) + (loads.pose if loads.there else 0)
        return linear + second.pose(d) if bent else linear

    common: dict[str, Any] = dict(
        axes=axes,
        components=channels,
        pose_units=tuple(map(told_in, channels)),
        pose_scale=device.channel_scale,
        drive=acting.drive,
        state=acting.state,
        rest=acting.rest,
        displacement_scale=max(farthest(s.travel) for s in sections),
        bipolar=any(low < 0 for low, _ in acting.drive_range),
        force_scale=acting.force_scale,
        force_unit="N" if c.pushes else "um",
        restoring_force=restoring_force,
        restoring_force_parts=restoring_force_parts,
        pose=pose,
        limits=limits,
        sensed=_sensed(c, second if bent else None, loads, stretching),
        second_order_kinematics=None if bent or c.cubics or c.ported else second.pose,
        rate_limits=acting.rate_limits(sections),
    )
    if p.dynamics is None:
        return BalancedPhysics(
            **common,
            force=lambda u, x, d: acting.force(u, x),
            rates=acting.rates,
            heating_power=acting.heat,
            power=acting.power,
        )
    D = modal_damping(c.mass, c.held_stiffness + loads.stiffness, p.dynamics.damping_ratio)
    return InertialPhysics(
        **common,
        mass=c.mass,
        dynamics=lambda u, x, d, v: (acting.force(u, x), acting.rates(x, u)),
        damping_force=lambda v: ca.mtimes(D, v),
    )


def _sensed(
    c: Condensed, second: SecondOrder | None, loads: Loads, stretching: Stretching | None
) -> SensedPoints | None:
    """The readings beside those of the output, to first order or to second; of loads to second where flexures stretch."""
    readings, rows = c.device.placed_readings, c.reading_motion
    if not readings:
        return None
    units = tuple(r.section.unit for r in readings)
    inertia = inertial(c) if c.device.dynamics is not None else None
    names = tuple(r.name for r in readings)

    def at(d: ca.SX) -> ca.SX:
        linear = ca.mtimes(rows, c.loads(d)) + (loads.sensed if loads.there else 0)
        seen = linear if second is None else linear + second.sensed(d)
        if stretching is None:
            return seen
        return seen + ca.vertcat(*(_stretched(c, r, stretching, d) for r in readings))

    return SensedPoints(names, units, c.device.reading_scale, at, inertia)


def _stretched(c: Condensed, r: Placed, stretching: Stretching, d: ca.SX) -> ca.SX:
    """What a reading of a load sees of second order and more."""
    if r.section.of is None:
        return ca.SX(1, 1)
    k = c.element_named(r.section.of, r.copy)
    return stretching.extra_load(k, 0.0, d)[WRENCH.index(r.section.load or "F_x")]


def _flexure_limits(c: Condensed, d: ca.SX, stretching: Stretching | None, loads: Loads) -> list[Limit]:
    """Rotations and stresses of the flexures with the axes displaced by `d` (n,), as they are at rest there."""
    extra_load = None if stretching is None else stretching.extra_load
    limits = []
    for k, e in enumerate(c.device.placed_elements):
        most = getattr(e.section, "rotation_limit", None)
        if most is not None:
            turned = ca.mtimes(c.frames[k][:, 2].T, loads.relative(k)[:3, :]) if loads.there else 0
            angle = ca.fabs(ca.mtimes(c.rotation(k), c.loads(d)) + turned)
            limits.append(Limit(f"rotation_{e.name}", f"rotation of {e.name}", (e.name,), "deg", angle, None, most.si))
    for m in c.device.material:
        if m.stress_limit is not None:
            names, stress = c.stress(
                m.name, d, 1e-9 * m.stress_limit.si, extra_load, loads.wrench if loads.there else None
            )
            if names:
                label = f"stress of {m.name}"
                limits.append(Limit(f"stress_{m.name}", label, names, "MPa", stress, None, m.stress_limit.si))
    return limits
