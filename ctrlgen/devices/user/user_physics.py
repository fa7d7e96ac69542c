"""The physics of a user's device from the laws that its user wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.units import Quantity, same_dimension, written_unit
from ctrlgen.devices.device_physics import (
    BalancedPhysics,
    DevicePhysics,
    ImposedPhysics,
    InertialPhysics,
    imposed_motion,
)
from ctrlgen.devices.limit import Limit, rate_limit
from ctrlgen.devices.signal import Signal
from ctrlgen.devices.user.ports import Law, Ports, evaluate_law

# Of each law
ARGUMENTS = {
    "force": "uxdvp",
    "restoring_force": "dp",
    "damping_force": "vp",
    "mass": "p",
    "acceleration": "uxdvp",
    "rates": "uxdvp",
    "pose": "dp",
    "needed_force": "dvap",
}


@dataclass(frozen=True)
class UserDescription:
    """What the user gave: components {name: largest size} of each vector, domains and units of the parameters, the laws by
    name, the typical `force` if any, the `ranges` [SI] of components given by a lowest and a highest value, the `limits` on
    expressions, the largest `drive_rates`, the
    `weights` of drives where there are more than axes, the largest `speed` of each axis whose motion is imposed. Faults of the laws
    are collected as they are evaluated."""

    name: str
    axes: dict[str, Quantity]
    drive: dict[str, Quantity]
    reading: dict[str, Quantity]
    state: dict[str, Quantity]
    domains: dict[str, str]
    units: dict[str, str]
    laws: dict[str, Law]
    force: Quantity | None = None
    ranges: dict[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    limits: dict[str, tuple[Law, Quantity]] = field(default_factory=dict)
    drive_rates: dict[str, Quantity] = field(default_factory=dict)
    weights: dict[str, float] = field(default_factory=dict)
    speed: dict[str, Quantity] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list, compare=False)
    identity: str = field(default_factory=lambda: uuid4().hex, compare=False)
    """Of what one call of `user_device` was given, in other processes too: laws such as a `ca.Function` do not equal their copies there."""

    def components(self, law: str) -> tuple[str, ...]:
        """Names of the components of what a law returns."""
        return tuple({"rates": self.state, "pose": self.reading}.get(law, self.axes))

    def evaluate(self, law: str, p: Ports, **vectors: ca.SX) -> ca.SX:
        """The vector that `law` returns; zeros where the law is not given or has faults, which are collected."""
        names = {"u": self.drive, "x": self.state, "d": self.axes, "v": self.axes, "a": self.axes}
        what = {
            "u": "the drive",
            "x": "the state",
            "d": "the displacement",
            "v": "the velocity",
            "a": "the acceleration",
        }
        if law not in self.laws:
            return ca.SX.zeros(len(self.components(law)), 1)
        allowed = [key for key in ARGUMENTS[law] if key == "p" or (key in vectors and vectors[key].numel())]
        offered = {key: p if key == "p" else Ports(what[key], tuple(names[key]), vectors[key]) for key in allowed}
        value, faults = evaluate_law(law, self.laws[law], offered, self.components(law))
        self.faults.extend(fault for fault in faults if fault not in self.faults)
        return value


class PhysicsBuilder:
    """Builds a device's physics from the user's laws with the parameters `p`."""

    def __init__(self, description: UserDescription, p: Ports) -> None:
        self.given, self.p = description, p
        self.inertial = "mass" in description.laws
        self.x = ca.SX.sym("x", len(description.state))
        self.mass = description.evaluate("mass", p)

    def applied_force(self, u: ca.SX, x: ca.SX, d: ca.SX, v: ca.SX) -> ca.SX:
        """Force on the axes apart from restoring and damping force; an acceleration is taken as a force on the mass."""
        if "acceleration" not in self.given.laws:
            return self.given.evaluate("force", self.p, u=u, x=x, d=d, v=v)
        return self.mass * self.given.evaluate("acceleration", self.p, u=u, x=x, d=d, v=v) + self.restoring_force(d)

    def restoring_force(self, d: ca.SX) -> ca.SX:
        """Force that pulls the axes home; of an acceleration its part at standstill without drive."""
        if "acceleration" not in self.given.laws:
            return self.given.evaluate("restoring_force", self.p, d=d)
        n = len(self.given.axes)
        still = {
            "u": ca.SX.zeros(len(self.given.drive), 1),
            "x": ca.SX.zeros(len(self.given.state), 1),
            "v": ca.SX.zeros(n, 1),
        }
        displaced, home = (self.given.evaluate("acceleration", self.p, d=at, **still) for at in (d, ca.SX.zeros(n, 1)))
        return self.mass * (home - displaced)

    def size(self) -> float:
        """Typical force: that of full drive and state at home, or the restoring force of full travel, or 1."""
        n, given = len(self.given.axes), self.given
        u, d, still = ca.SX.sym("u", len(given.drive)), ca.SX.sym("d", n), ca.SX.zeros(n if self.inertial else 0, 1)
        laws = [self.applied_force(u, self.x, d, still), self.restoring_force(d)]
        if given.faults:
            return 1.0
        law = ca.Function("law", [u, self.x, d], laws)
        applied = (law(_sizes(given.drive), _sizes(given.state), 0)[0] - law(0, 0, 0)[0]).full()
        restoring = law(0, 0, _sizes(given.axes))[1].full()
        return float(next((size for f in (applied, restoring) if 0 < (size := np.abs(f).max()) < np.inf), 1.0))

    def imposed_size(self) -> float:
        """Typical force of an imposed motion: that at full travel, speed v and the acceleration v^2/d."""
        travel, speed = np.array(_sizes(self.given.axes)), np.array(_sizes(self.given.speed))
        d, v, a = (ca.SX.sym(name, len(travel)) for name in "dva")
        law = self.given.evaluate("needed_force", self.p, d=d, v=v, a=a)
        if self.given.faults:
            return 1.0
        size = np.abs(ca.Function("law", [d, v, a], [law])(travel, speed, speed**2 / travel).full()).max()
        return float(size) if 0 < size < np.inf else 1.0

    def imposed(self, size: float) -> ImposedPhysics:
        """An imposed motion whose force is read: needed_force(d, v, a), `size` the typical one."""
        given, n, axes = self.given, len(self.given.axes), tuple(self.given.axes)
        travel, speed = _sizes(given.axes), _sizes(given.speed)
        accelerations = tuple(v**2 / d for v, d in zip(speed, travel, strict=True))
        unit = written_unit(next(iter(given.axes.values())).text)
        still = ca.SX.zeros(n, 1)

        def needed(d: ca.SX, v: ca.SX, a: ca.SX) -> ca.SX:
            return given.evaluate("needed_force", self.p, d=d, v=v, a=a)

        def restoring(d: ca.SX) -> ca.SX:
            return needed(d, still, still) - needed(still, still, still)

        force_unit = written_unit(given.force.text) if given.force else "N*m" if same_dimension(unit, "rad") else "N"
        return ImposedPhysics(
            axes=axes,
            components=axes,
            pose_units=(force_unit,) * n,
            pose_scale=(size,) * n,
            drive=imposed_motion(axes, unit, (*travel, *speed, *accelerations)),
            displacement_scale=max(travel),
            travel_unit=unit,
            force_scale=size,
            force_unit=force_unit,
            restoring_force=restoring,
            pose=lambda f: f,
            limits=self.limits,
            force=lambda motion, d: needed(d, motion[n : 2 * n], motion[2 * n :]) - restoring(d),
        )

    def physics(self, size: float) -> DevicePhysics:
        """The laws as a device's physics, `size` the typical force; faults of the laws are collected in the description."""
        given, n, axes = self.given, len(self.given.axes), tuple(self.given.axes)
        u, d, v = ca.SX.sym("u", len(given.drive)), ca.SX.sym("d", n), ca.SX.sym("v", n if self.inertial else 0)
        for law, vectors in {
            "damping_force": {"v": v},
            "rates": {"u": u, "x": self.x, "d": d, "v": v},
            "pose": {"d": d},
        }.items():
            given.evaluate(law, self.p, **vectors)  # collects its faults, so that all are listed together
        self.applied_force(u, self.x, d, v), self.restoring_force(d)
        travel = max(q.si for q in given.axes.values())
        unit = written_unit(next(iter(given.axes.values())).text)
        state = Signal("state", "state", tuple(given.state), _units(given.state), "x_", self.x, _sizes(given.state))
        common: dict[str, Any] = dict(
            axes=axes,
            components=tuple(given.reading),
            pose_units=_units(given.reading),
            pose_scale=_sizes(given.reading),
            drive=Signal("drive", "drive", tuple(given.drive), _units(given.drive), "u_", u, _sizes(given.drive)),
            state=state if given.state else None,
            rest=(0.0,) * len(given.state),
            displacement_scale=travel,
            travel_unit=unit,
            force_scale=size,
            force_unit=written_unit(given.force.text) if given.force else "N*m" if same_dimension(unit, "rad") else "N",
            restoring_force=self.restoring_force,
            limits=self.limits,
            pose=(lambda d: given.evaluate("pose", self.p, d=d)) if "pose" in given.laws else (lambda d: d),
            drive_weights=tuple(given.weights.get(name, 1.0) for name in given.drive),
            bipolar=any(given.ranges.get(("drive", name), (-1.0, 1.0))[0] < 0 for name in given.drive),
        )
        common["rate_limits"] = self.rate_limits(common["drive"])
        self.limits(SimpleNamespace(drive=u, displacement=d, mechanism_displacement=d))  # collects its faults too
        if not self.inertial:
            return BalancedPhysics(
                **common,
                force=lambda u, x, d: self.applied_force(u, x, d, d[:0]),
                rates=lambda x, u: given.evaluate("rates", self.p, u=u, x=x),
            )
        return InertialPhysics(
            **common,
            mass=tuple(ca.vertsplit(self.mass)),
            damping_force=(lambda v: given.evaluate("damping_force", self.p, v=v))
            if "damping_force" in given.laws
            else None,
            dynamics=lambda u, x, d, v: (
                self.applied_force(u, x, d, v),
                given.evaluate("rates", self.p, u=u, x=x, d=d, v=v),
            ),
        )

    def rate_limits(self, drive: Signal) -> tuple[Limit, ...]:
        """The limits on the rates of those drives that have one."""
        limits = []
        for i, name in enumerate(self.given.drive):
            if name in self.given.drive_rates:
                q = self.given.drive_rates[name]
                low, high = self.given.ranges.get(("drive_rate", name), (-q.si, q.si))
                limits.append(rate_limit(drive, i, low, high, written_unit(q.text)))
        return tuple(limits)

    def limits(self, signal: SimpleNamespace) -> list[Limit]:
        """Drives and displacements stay within their ranges or largest sizes, states within ranges, expressions below their limits."""
        given, limits = self.given, []
        for what, label, ports, expr in (
            ("drive", "drive", given.drive, signal.drive),
            ("axes", "travel", given.axes, signal.displacement),
            ("state", "state", given.state, self.x),
        ):
            for i, (name, q) in enumerate(ports.items()):
                if what == "state" and (what, name) not in given.ranges:
                    continue
                low, high = given.ranges.get((what, name), (-q.si, q.si))
                unit = written_unit(q.text)
                limits.append(Limit(f"{label}_{name}", f"{label} of {name}", (name,), unit, expr[i], low, high))
        names = {"x": given.state, "d": given.axes}
        vectors = {"x": self.x, "d": signal.mechanism_displacement}
        for name, (law, q) in given.limits.items():
            offered = {
                key: Ports({"x": "the state", "d": "the displacement"}[key], tuple(names[key]), v)
                for key, v in vectors.items()
                if v.numel()
            }
            value, faults = evaluate_law(f"limits.{name}", law, offered | {"p": self.p}, (name,))
            given.faults.extend(fault for fault in faults if fault not in given.faults)
            limits.append(Limit(name, name, (name,), written_unit(q.text), value, -q.si, q.si))
        return limits


def _units(ports: Mapping[str, Quantity]) -> tuple[str, ...]:
    return tuple(written_unit(q.text) for q in ports.values())


def _sizes(ports: Mapping[str, Quantity]) -> tuple[float, ...]:
    return tuple(q.si for q in ports.values())
