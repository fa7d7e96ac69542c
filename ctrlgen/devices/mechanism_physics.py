"""The equations of a mechanism as a device's physics: in balance, or with the inertia of its bodies."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca

from ctrlgen.core.units import written_unit
from ctrlgen.devices.base import BalancedPhysics, DevicePhysics, InertialPhysics, Limit, SensedPoints, Signal
from ctrlgen.devices.mechanism_model import Condensed
from ctrlgen.physics.damping import modal_damping


def mechanism_physics(c: Condensed) -> DevicePhysics:
    """The condensed mechanism as physics: with the table `dynamics` that of bodies with inertia, else in balance."""
    device, actuators, p = c.device, c.device.placed_actuators, c.p
    n, axes = len(actuators), tuple(a.name for a in actuators)
    own = [p.actuator[a.index] for a in actuators]
    sections = [a.section for a in actuators]
    gain = ca.vertcat(*(q.gain for q in own))
    units = tuple(written_unit(s.low.text) for s in sections)
    sizes = tuple(max(abs(s.low.si), abs(s.high.si)) for s in sections)
    drive = Signal("drive", "drive", axes, units, "u_", ca.SX.sym("u", n), sizes)
    lags = [q.time_constant for q in own]
    lagging = all(tau is not None for tau in lags)  # all of them, or none
    state = Signal("state", "amplifier output", axes, units, "x_", ca.SX.sym("x", n), sizes) if lagging else None

    def force(u: ca.SX, x: ca.SX) -> ca.SX:
        return gain * (x if lagging else u)

    def rates(x: ca.SX, u: ca.SX) -> ca.SX:
        return (u - x) / ca.vertcat(*lags) if lagging else ca.SX(0, 1)

    def restoring_force_parts(d: ca.SX) -> dict[str, ca.SX]:
        linear = ca.mtimes(c.held_stiffness, d)
        return {"linear": linear, "cubic": c.restoring_force(d) - linear} if c.cubics else {}

    def limits(signal: SimpleNamespace) -> list[Limit]:
        found = []
        for i, (axis, s) in enumerate(zip(axes, sections, strict=True)):
            reach = s.travel.si
            rows = [("drive", "drive", units[i], signal.drive[i], s.low.si, s.high.si)]
            if state is not None:
                rows.append(("output", "amplifier output", units[i], signal.state[i], s.low.si, s.high.si))
            rows.append(("travel", "travel", "um", signal.displacement[i], -reach, reach))
            found += [Limit(f"{name}_{axis}", f"{label} of {axis}", (axis,), *rest) for name, label, *rest in rows]
        return found + _flexure_limits(c, signal.mechanism_displacement)

    J, channels = c.jacobian, device.output.channels
    common: dict[str, Any] = dict(
        axes=axes, components=channels, pose_units=tuple("urad" if name.startswith("theta") else "um" for name in channels),
        pose_scale=device.channel_scale, drive=drive, state=state, rest=(0.0,) * (n if lagging else 0),
        displacement_scale=max(s.travel.si for s in sections), bipolar=any(s.low.si < 0 for s in sections),
        force_scale=float(max(abs(s.gain.si) * size for s, size in zip(sections, sizes, strict=True))),
        force_unit="N" if c.pushes else "um", restoring_force=c.restoring_force, restoring_force_parts=restoring_force_parts,
        pose=lambda d: ca.mtimes(J, c.loads(d)), limits=limits, sensed=_sensed(c),
    )  # fmt: skip
    if p.dynamics is None:
        return BalancedPhysics(**common, force=lambda u, x, d: force(u, x), rates=rates)
    D = modal_damping(c.mass, c.held_stiffness, p.dynamics.damping_ratio)
    return InertialPhysics(
        **common, mass=c.mass, dynamics=lambda u, x, d, v: (force(u, x), rates(x, u)), damping_force=lambda v: ca.mtimes(D, v)
    )  # fmt: skip


def _sensed(c: Condensed) -> SensedPoints | None:
    """The readings beside those of the output."""
    readings, rows = c.device.placed_readings, c.reading_motion
    if not readings:
        return None
    units = tuple("um" if r.section.about is None else "urad" for r in readings)
    names = tuple(r.name for r in readings)
    return SensedPoints(names, units, c.device.reading_scale, lambda d: ca.mtimes(rows, c.loads(d)))


def _flexure_limits(c: Condensed, d: ca.SX) -> list[Limit]:
    """Rotations and stresses of the flexures with the axes displaced by `d` (n,), as they are at rest there."""
    found = []
    for k, e in enumerate(c.device.placed_elements):
        most = getattr(e.section, "rotation_limit", None)
        if most is not None:
            angle = ca.fabs(ca.mtimes(c.rotation(k), c.loads(d)))
            found.append(Limit(f"rotation_{e.name}", f"rotation of {e.name}", (e.name,), "deg", angle, None, most.si))
    for m in c.device.material:
        if m.stress_limit is not None:
            names, stress = c.stress(m.name, d, 1e-9 * m.stress_limit.si)
            if names:
                label = f"stress of {m.name}"
                found.append(Limit(f"stress_{m.name}", label, names, "MPa", stress, None, m.stress_limit.si))
    return found
