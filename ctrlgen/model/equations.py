"""The equations of each kind of device with its effects, joined place by place.

u --(drive terms)--> drive --rates--> x --force(terms)--> balance with the stage --> z
  --(displacement terms)--> pose(terms) --> reading(terms)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from ctrlgen.devices import BalancedPhysics, DevicePhysics, ImposedPhysics, InertialPhysics, Signal
from ctrlgen.effects import Place
from ctrlgen.model.effect_terms import EffectTerms

NONE = ca.SX(0, 1)  # a vector without components
NO_MASS = ca.SX(0, 0)


@dataclass(frozen=True)
class Equations:
    """The equations of a device with its effects.

    `rates` of the device's own states and `balance`, zero or mass times acceleration, in terms of the symbol `heat`,
    whose value is `heat_of_drive`, and of `held`, the output of a feedback loop, whose value is `held_value`.
    `own_force` is the device's force on the axes, damping included, without its effects. With inertia `mass` (n_axes, n_axes)
    times the `acceleration` is the balance.
    """

    signals: dict[str, Signal]
    rates: ca.SX
    balance: ca.SX
    heat: ca.SX
    heat_of_drive: ca.SX
    held: ca.SX = NONE
    held_value: ca.SX = NONE
    own_force: ca.SX = NONE
    mass: ca.SX = NO_MASS
    acceleration: ca.SX = NONE


def equations_of(physics: DevicePhysics, terms: EffectTerms, z: ca.SX, v: ca.SX) -> Equations:
    """The equations at the displacement `z` and, with inertia, the velocity `v`."""
    if isinstance(physics, BalancedPhysics):
        return _balanced(physics, terms, z)
    if isinstance(physics, InertialPhysics):
        return _inertial(physics, terms, z, v)
    assert isinstance(physics, ImposedPhysics)  # there is no other kind
    return _imposed(physics, terms, z)


def _balanced(physics: BalancedPhysics, terms: EffectTerms, z: ca.SX) -> Equations:
    """Forces in balance: 0 = force - restoring force."""
    u, x = physics.drive.expr, NONE if physics.state is None else physics.state.expr
    drive = terms.added(Place.DRIVE, u)
    displacement, pose, reading = _carried(physics, terms, z)
    produced = physics.heating_power(drive)
    heat = ca.SX.sym("heat", produced.numel())  # an unknown of its own, so that the inverse need not solve for squares
    arriving = terms.added(Place.HEAT, heat)
    force = physics.force(drive, x, z)
    balance = terms.added(Place.FORCE, force) - physics.restoring_force(z)
    signals = {"drive": physics.drive}
    if physics.power is not None:
        signals["power"] = physics.power.signal("power", physics.axes, ca.substitute(arriving, heat, produced))
    if physics.state is not None:
        signals["state"] = physics.state
    signals |= _mechanical(physics, force, displacement, pose, reading)
    return Equations(signals, physics.rates(x, arriving), balance, heat, produced)


def _inertial(physics: InertialPhysics, terms: EffectTerms, z: ca.SX, v: ca.SX) -> Equations:
    """Newton's second law, with the feedback loop if there is one: mass a = force - restoring force - damping force."""
    u, x, n = physics.drive.expr, NONE if physics.state is None else physics.state.expr, len(physics.axes)
    loop, signals, command = physics.feedback, {"drive": physics.drive}, NONE
    held = NONE if loop is None else ca.SX.sym("held", n)
    drive = produced = terms.added(Place.DRIVE, u if loop is None else held)
    displacement, pose, reading = _carried(physics, terms, z)
    if loop is not None:
        measured = reading if loop.measures == "reading" else z
        command, produced = loop.control_law(u, measured, v, x), u - measured
        signals["command"] = loop.command.signal("command", physics.axes, command)
    heat = ca.SX.sym("heat", produced.numel())
    arriving = terms.added(Place.HEAT, heat)
    force, rates = physics.dynamics(drive, x, z, v)
    damping = physics.damping_force(v) if physics.damping_force else ca.SX(n, 1)
    balance = terms.added(Place.FORCE, force) - physics.restoring_force(z) - damping
    if physics.state is not None:
        signals["state"] = physics.state
    signals |= _mechanical(physics, force, displacement, pose, reading)
    rates = rates if loop is None else loop.rates(x, arriving)
    mass, acceleration = _mass(physics.mass), _acceleration(physics.mass, balance)
    return Equations(signals, rates, balance, heat, produced, held, command, force - damping, mass, acceleration)


def _mass(mass: tuple[float | ca.SX, ...] | ca.SX | ca.DM) -> ca.SX:
    """(n_axes, n_axes) from one number an axis or a matrix."""
    return ca.diag(ca.SX(ca.vertcat(*mass))) if isinstance(mass, tuple) else ca.SX(mass)


def _acceleration(mass: tuple[float | ca.SX, ...] | ca.SX | ca.DM, force: ca.SX) -> ca.SX:
    """(n_axes,) what a `force` (n_axes,) gives masses, or a matrix of them that axes share."""
    return force / ca.vertcat(*mass) if isinstance(mass, tuple) else ca.mtimes(ca.inv(mass), force)


def _imposed(physics: ImposedPhysics, terms: EffectTerms, z: ca.SX) -> Equations:
    """Motion imposed, force read: the displacements are the first components of the drive.

    What stands behind the displacement effects moves by d(z, m), m their memories, with d' = J v + (dd/dm) m', J = dd/dz; by virtual
    work its force F takes J' F of the machine: none while a play is crossed.
    """
    n = len(physics.axes)
    drive = terms.added(Place.DRIVE, physics.drive.expr)
    v, a = drive[n : 2 * n], drive[2 * n :]
    displacement = terms.added(Place.DISPLACEMENT, z)
    carried = [m for m in terms.members if m.effect.place is Place.DISPLACEMENT]
    memories = [(m.states[s.name], m.rates[s.name]) for m in carried for s in m.kept if not s.stepped]
    memory, rate = (ca.vertcat(NONE, *part) for part in (zip(*memories, strict=True) if memories else ((), ())))
    velocity = ca.jtimes(displacement, z, v) + ca.jtimes(displacement, memory, rate)
    acceleration = ca.jtimes(displacement, z, a) + ca.jtimes(velocity, z, v) + ca.jtimes(velocity, memory, rate)
    motion = ca.vertcat(displacement, velocity, acceleration)
    behind = physics.force(motion, displacement) + physics.restoring_force(displacement)
    needed = ca.jtimes(displacement, z, behind, True)
    applied = needed - terms.added(Place.FORCE, ca.SX(n, 1))  # forces of effects act on the axis beside the machine
    force = terms.added(Place.POSE, applied)
    reading = terms.added(Place.SENSOR, force)
    signals = {"drive": physics.drive, **_mechanical(physics, applied, displacement, force, reading)}
    return Equations(signals, NONE, drive[:n] - z, ca.SX.sym("heat", n), drive[:n])


def _carried(physics: DevicePhysics, terms: EffectTerms, z: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """What follows the stages' displacement: that of the mechanism, the platform's pose and the readings, with effects."""
    displacement = terms.added(Place.DISPLACEMENT, z)
    pose = terms.added(Place.POSE, physics.pose(displacement))
    if physics.sensed is None:
        return displacement, pose, terms.added(Place.SENSOR, pose)
    sensed = physics.sensed.at(displacement)
    if physics.sensed.per_acceleration is not None:
        sensed += ca.mtimes(physics.sensed.per_acceleration, terms.acceleration)
    seen = ca.vertcat(pose, sensed)
    return displacement, pose, terms.added(Place.SENSOR, seen)


def _mechanical(
    physics: DevicePhysics, force: ca.SX, displacement: ca.SX, pose: ca.SX, reading: ca.SX
) -> dict[str, Signal]:
    axes, n = physics.axes, len(physics.axes)
    (channels, reading_units, reading_scale), travel = physics.readings, (physics.displacement_scale,) * n
    units, sizes, lengths = (physics.force_unit,) * n, (physics.force_scale,) * n, (physics.travel_unit,) * n
    return {
        "force": Signal("force", "actuator force", axes, units, "F_", force, sizes),
        "displacement": Signal("displacement", "stage displacement", axes, lengths, "d_", displacement, travel),
        "pose": Signal("pose", "platform pose", physics.components, physics.pose_units, "", pose, physics.pose_scale),
        "reading": Signal("reading", "sensor reading", channels, reading_units, "reading_", reading, reading_scale),
    }


def named_forces(physics: DevicePhysics, z: ca.SX, v: ca.SX) -> Iterator[tuple[str, str, str, ca.SX]]:
    """C name, label, map and value of the device's own forces."""
    yield "restoring_force", "restoring force", "restoring_force", physics.restoring_force(z)
    if isinstance(physics, BalancedPhysics):
        x = NONE if physics.state is None else physics.state.expr
        yield "actuator_force", "actuator force", "force", physics.force(physics.drive.expr, x, z)
    if isinstance(physics, InertialPhysics) and physics.damping_force is not None:
        yield "damping_force", "damping force", "damping_force", physics.damping_force(v)
