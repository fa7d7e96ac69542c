"""A mechanism of rigid bodies and flexures, from a file: bodies, what joins them, what moves them, what is followed.

Actuators either push (a force between two bodies, or on one) or prescribe the motion of one element, as a stage's stroke does.
Motions are small: stiffness, Jacobian and loads are those of the mechanism as drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import casadi as ca
import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, TableFaults
from ctrlgen.core.mode_lines import ModeShape
from ctrlgen.core.units import Quantity
from ctrlgen.devices.device_physics import DevicePhysics
from ctrlgen.devices.load import GROUND_NAME, Gravity, Load, joined
from ctrlgen.devices.mechanism.bent_beams import BentBeam, ThermalActuator
from ctrlgen.devices.mechanism.condensed import MOST_STEPS, SPARE_STEPS, Condensed, nominal
from ctrlgen.devices.mechanism.constraints import free_between_springs
from ctrlgen.devices.mechanism.copies import Copied, CopiedParts, Placed
from ctrlgen.devices.mechanism.divided_blades import blade_runs, with_runs
from ctrlgen.devices.mechanism.flexures import Blade, CircularHinge, Strut, Wire
from ctrlgen.devices.mechanism.flexures_alone import alone_remarks
from ctrlgen.devices.mechanism.force_readings import reach as load_reach
from ctrlgen.devices.mechanism.force_readings import unloaded
from ctrlgen.devices.mechanism.internal_modes import structural_model
from ctrlgen.devices.mechanism.linear_range import second_order_faults, stiffened, third_order_remarks
from ctrlgen.devices.mechanism.load_effects import load_faults, load_remarks
from ctrlgen.devices.mechanism.mechanism_physics import mechanism_physics
from ctrlgen.devices.mechanism.mode_shapes import mode_shapes
from ctrlgen.devices.mechanism.modes import guyan_modes, inertia_faults, inertia_remarks
from ctrlgen.devices.mechanism.name_faults import name_faults
from ctrlgen.devices.mechanism.overlaps import flexures_in_one_place, overlap_remarks
from ctrlgen.devices.mechanism.ported_parts import Ported
from ctrlgen.devices.mechanism.pose_range import pose_remarks
from ctrlgen.devices.mechanism.reach import buckling_remarks, reach_remarks
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.devices.mechanism.size_remarks import size_remarks
from ctrlgen.devices.mechanism.springs import Spring
from ctrlgen.devices.mechanism.stated_compliances import Compliance, ComplianceMatrix
from ctrlgen.devices.mechanism.super_element import MATRICES, SuperElement, matrix_files, with_matrices
from ctrlgen.devices.mechanism.tables import (
    Actuator,
    Body,
    Dynamics,
    Material,
    Output,
    Pattern,
    Reading,
)
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.devices.travel import farthest
from ctrlgen.physics import rigid_bodies as mechanism
from ctrlgen.physics.rigid_bodies import GROUND, Element
from ctrlgen.physics.screw import TWIST

AnyElement = Annotated[
    Blade | Wire | Strut | CircularHinge | Compliance | ComplianceMatrix | Spring | BentBeam,
    Field(discriminator="kind"),
]
AnyActuator = Annotated[Actuator | ThermalActuator, Field(discriminator="kind")]
ASSUMED_DAMPING = Quantity(0.01, "1 %")  # of a stage on flexures in air, where a file states none
MOVED = 1e-6  # of the largest motion, below which a channel is not moved on purpose: symmetry leaves rounding, 1e-9

T = TypeVar("T")


def _as_described(method: Callable[[Mechanism], T]) -> cached_property[T]:
    """A cached property that copies with other numbers take from the device that the file describes."""

    @wraps(method)
    def described(device: Mechanism) -> T:
        return method(device) if device._described is None else getattr(device._described, method.__name__)

    return cached_property(described)


class Mechanism(CopiedParts):
    """Drive -> force or displacement -> motion of all bodies -> pose of the output point."""

    on_flexures: ClassVar[bool | None] = True
    names_files = tuple(("super_element", key) for key in MATRICES)

    kind: Literal["mechanism"]
    """Rigid bodies and flexures."""
    material: tuple[Material, ...] = ()
    """`[[material]]` tables."""
    pattern: tuple[Pattern, ...] = ()
    """`[[pattern]]` tables."""
    body: tuple[Body, ...]
    """`[[body]]` tables."""
    element: tuple[AnyElement, ...] = ()
    """`[[element]]` tables."""
    super_element: tuple[SuperElement, ...] = ()
    """`[[super_element]]` tables: parts by their stiffness and mass from a finite-element program."""
    actuator: tuple[AnyActuator, ...]
    """`[[actuator]]` tables: all push, all heat, or all prescribe displacements."""
    output: Output
    """`[output]`: what is followed."""
    reading: tuple[Reading, ...] = ()
    """`[[reading]]` tables: what is read beside the output."""
    load: tuple[Load, ...] = ()
    """`[[load]]` tables: what acts all the time. The pose counts from where the mechanism is drawn, without them."""
    gravity: Gravity | None = None
    """Acceleration of what falls, such as ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]: bodies, flexures and payloads then weigh."""
    dynamics: Dynamics | None = None
    """`[dynamics]`: where inertia counts."""
    kinematics: Literal["first_order", "second_order"] = "first_order"
    """Pose and force to first order in the displacements, or with finite rotations and with flexures that shorten as they bend."""
    _described: Mechanism | None = PrivateAttr(default=None)

    @classmethod
    def with_named_files(cls, table: dict[str, Any], path: Path) -> dict[str, Any]:
        """With the matrices of super-elements. Raises InputError."""
        return with_matrices(table, path)

    @classmethod
    def named_files(cls, table: dict[str, Any], path: Path) -> tuple[Path, ...]:
        """The files of the matrices of super-elements."""
        return matrix_files(table, path)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other values. What follows from them is worked out anew, but typical sizes stay those of the device that the file
        describes, whoever asked for them first: they are part of the copy's value."""
        copy = super().model_copy(update=update, deep=deep)
        for kind in type(self).__mro__:
            for name, member in vars(kind).items():
                if isinstance(member, cached_property):
                    vars(copy).pop(name, None)
        copy._described = self._described or self
        return copy

    @model_validator(mode="after")
    def _refers_to_what_there_is(self) -> Mechanism:
        return self._checked()

    def _checked(self) -> Mechanism:
        """Itself. Raises TableFaults."""
        joined_by = () if self.super_element else ("element",)
        empty = [key for key in ("body", *joined_by, "actuator") if not getattr(self, key)]
        if empty:
            raise TableFaults([Fault(key, f"there is none; add a [[{key}]] table") for key in empty])
        faults = name_faults(self)
        if len({a.kind for a in self.actuator}) > 1:
            faults.append(
                Fault(
                    "actuator",
                    "some push, some heat or some prescribe a displacement; give one kind, a stack as force with stiffness",
                )
            )
        if len({a.time_constant is None for a in self.actuator}) > 1:
            faults.append(Fault("actuator", "some have a time_constant and some do not; give one to all or to none"))
        if len({getattr(a, "heater_resistance", None) is None for a in self.actuator}) > 1:
            faults.append(
                Fault(
                    "actuator",
                    "some have a heater_resistance and some do not; the drives are all voltages or all powers",
                )
            )
        if not faults and len(self.output.channels) != len(self.placed_actuators):
            counts = f"{number_of(len(self.output.channels), 'channel')}, {number_of(len(self.placed_actuators), 'actuator')}"
            faults.append(Fault("output.channels", f"{counts}; follow as many channels as there are actuators"))
        faults += [] if faults else flexures_in_one_place(self.placed_elements, self.size)
        if not faults and (loose := mechanism.loose_bodies(len(self.bodies), self._joints)):
            faults.append(Fault("body", f"nothing joins {', '.join(self.bodies[i] for i in loose)} to the ground"))
        held_by = "springs and super-elements" if self.super_element else "springs"
        if not faults and (free := free_between_springs(self)):
            faults.append(
                Fault(
                    "body",
                    f"{held_by} leave {', '.join(free)} free in some direction; add a spring or a flexure there",
                )
            )
        if not faults and self.cubic_steps > MOST_STEPS:
            faults.append(
                Fault(
                    "element",
                    "at the largest travel the cubic springs push harder than the flexures beside them can hold (or soften "
                    "until nothing holds them); lower their k_3, or the travel",
                )
            )
        faults += second_order_faults(self)
        faults += [] if faults else self._unmoved()
        faults += [] if faults or self.dynamics is None else inertia_faults(self)
        faults += [] if faults else load_faults(self)
        if faults:
            raise TableFaults(faults)
        # Those of the file: a copy with other numbers keeps them
        _ = (self.channel_scale, self.reading_scale, self.cubic_steps)
        return self

    def _unmoved(self) -> list[Fault]:
        """Channels that no actuator moves, or that move only together."""
        moved = self._output_motion * np.array([self.size] * 3 + [1.0] * 3)[:, None]  # turns as displacements
        rows, channels = moved[[TWIST.index(c) for c in self.output.channels]], self.output.channels
        still = [c for c, row in zip(channels, rows, strict=True) if np.abs(row).max() <= MOVED * np.abs(moved).max()]
        if still:
            return [
                Fault(
                    "output.channels",
                    f"no actuator moves {', '.join(still)}; follow others, or push in another direction",
                )
            ]
        if np.linalg.cond(rows / np.abs(rows).max(axis=1, keepdims=True)) > 1 / MOVED:
            return [
                Fault(
                    "output.channels",
                    f"{', '.join(channels)} move only together; follow others, or place the actuators otherwise",
                )
            ]
        least = MOVED * max(farthest(a.travel) for a in self.actuator)
        unread = unloaded(self) + [
            r.name
            for r, seen in zip(self.placed_readings, self.reading_scale, strict=True)
            if r.section.of is None and seen * (1.0 if r.section.about is None else self.size) <= least
        ]
        told = f"no actuator moves (or loads) what {', '.join(unread)} reads; read in another direction"
        return [Fault("reading", told)] if unread else []

    @property
    def second_order(self) -> bool:
        """Whether pose and force are of second order at least."""
        return self.kinematics == "second_order" or self.geometric_stiffening

    @property
    def geometric_stiffening(self) -> bool:
        """Whether the energy is of fourth order, as an element states."""
        return any(getattr(e, "geometric_stiffening", False) for e in self.element)

    @cached_property
    def bodies(self) -> tuple[str, ...]:
        """The names of all bodies, copies with their number."""
        return tuple(b.name for b in self.placed_bodies)

    @_as_described
    def size(self) -> float:
        """The largest distance of an element's end, or of a port, from the origin [m]."""
        ends = [[x.si for x in e.at] for e in self.element] + [p.at for s in self.super_element for p in s.port]
        return max(float(np.linalg.norm(end)) for end in ends) or 1e-3

    def body_number(self, name: str, pattern: str, copy: int) -> int | None:
        """The number of a body as an element of a `pattern` names it, from its copy; None where there is none."""
        if name == GROUND_NAME:
            return GROUND
        copied = pattern and any(b.name == name and b.pattern == pattern for b in self.body)
        known = f"{name}_{copy}" if copied else name
        return self.bodies.index(known) if known in self.bodies else None

    def _between(self, copy: Copied, first: str, second: str) -> Placed:
        numbers = [self.body_number(name, copy.section.pattern, copy.copy) for name in (first, second)]
        ends = [GROUND if n is None else n for n in numbers]
        return Placed(**vars(copy), first=ends[0], second=ends[1])

    @cached_property
    def placed_bodies(self) -> tuple[Copied, ...]:
        """Every copy of every body, by its number."""
        return tuple(self._copies("body"))

    @cached_property
    def placed_elements(self) -> tuple[Placed, ...]:
        """Every copy of every element, pieces of a divided blade with all of it."""
        return with_runs(self._elements_apart, self.blade_runs)

    @cached_property
    def _elements_apart(self) -> tuple[Placed, ...]:
        return tuple(self._between(c, c.section.from_, c.section.to) for c in self._copies("element"))

    @_as_described
    def blade_runs(self) -> tuple[tuple[int, ...], ...]:
        """The numbers of the elements that are pieces of one blade, as the file describes them."""
        return blade_runs(self, self._elements_apart)

    @cached_property
    def placed_super_elements(self) -> tuple[Ported, ...]:
        """Every copy of every super-element."""
        found = []
        for c in self._copies("super_element"):
            numbers = [self.body_number(port.body, c.section.pattern, c.copy) for port in c.section.port]
            found.append(Ported(**vars(c), bodies=tuple(GROUND if n is None else n for n in numbers)))
        return tuple(found)

    @cached_property
    def placed_actuators(self) -> tuple[Placed, ...]:
        """Every copy of every actuator; one that prescribes a displacement names an element and no bodies, a heater those of its."""
        placed, elements = [], {e.name: e for e in self.element}
        for c in self._copies("actuator"):
            ends = (
                (c.section, "against", "on") if c.section.kind != "thermal" else (elements[c.section.on], "from_", "to")
            )
            placed.append(self._between(c, *(getattr(ends[0], key) for key in ends[1:])))
        return tuple(placed)

    @_as_described
    def channel_scale(self) -> tuple[float, ...]:
        """A typical size [rad, m] of each channel that is followed: what all actuators at the largest travel make of it, as the
        file describes it."""
        reach = np.abs(self._output_motion).sum(axis=1) * max(farthest(a.travel) for a in self.actuator)
        return tuple(float(reach[TWIST.index(c)]) for c in self.output.channels)

    @_as_described
    def cubic_steps(self) -> int:
        """Steps of Newton's method that find the stretch of the cubic springs, as the file describes them; above `MOST_STEPS` where
        so many do not."""
        if not any(isinstance(e, Spring) and e.cubic for e in self.element):
            return 0
        steps = nominal(self).cubic_steps()
        return MOST_STEPS + 1 if steps is None else steps + SPARE_STEPS if steps else 0

    @cached_property
    def placed_readings(self) -> tuple[Placed, ...]:
        """Every copy of every reading."""
        return tuple(
            self._between(c, c.section.against, c.section.body or GROUND_NAME) for c in self._copies("reading")
        )

    @cached_property
    def placed_loads(self) -> tuple[Placed, ...]:
        """Every copy of every load."""
        return tuple(self._between(c, c.section.against, c.section.on) for c in self._copies("load"))

    @_as_described
    def reading_scale(self) -> tuple[float, ...]:
        """A typical size [rad, m] of each reading, as `channel_scale`; or what it is of second order where that is more."""
        travel, n, c = (
            max(farthest(a.travel) for a in self.actuator),
            len(self.placed_actuators),
            nominal(self),
        )
        reach = np.abs(ca.DM(ca.evalf(ca.SX(c.reading_motion))).full()[:, :n]).sum(axis=1) * travel
        if self.second_order and len(reach):
            reach = np.maximum(reach, SecondOrder(c).sensed_reach())
        reach = np.maximum(reach, load_reach(self))
        return tuple(float(x) for x in reach)

    @property
    def _output_motion(self) -> np.ndarray:
        """The motion of the output point (6, n) per displacement of the axes, at home."""
        moved = ca.DM(ca.evalf(ca.SX(nominal(self).output_motion))).full()
        return moved[:, : len(self.placed_actuators)]

    @property
    def _joints(self) -> list[Element]:
        """The pairs of bodies that elements join."""
        pairs = [(e.first, e.second) for e in self.placed_elements]
        pairs += [(s.bodies[0], other) for s in self.placed_super_elements for other in s.bodies[1:]]
        return [Element(*pair, ca.DM.eye(6)) for pair in pairs]

    def loaded(self, loads: Sequence[Load], gravity: Gravity | None) -> Mechanism:
        """With more loads, and with gravity where it is given. Raises ValueError where they cannot be held."""
        falls = {} if gravity is None else {"gravity": gravity}
        return self.model_copy(update={"load": joined(self.load, loads)} | falls)._checked()

    def with_unstated_inertia(self) -> tuple[Mechanism, float] | None:
        """With a table [dynamics], where actuators push and move mass in every direction."""
        if self.dynamics is not None or not len(guyan_modes(self).frequencies):
            return None
        return self.model_copy(update={"dynamics": Dynamics(damping_ratio=ASSUMED_DAMPING)}), ASSUMED_DAMPING.si

    def structural_model(self) -> StructuralModel | None:
        """With the modes of the bodies while the axes are held."""
        return structural_model(self)

    def mode_shapes(self) -> tuple[ModeShape, ...]:
        """The modes of the bodies with the drives held."""
        return mode_shapes(self)

    def with_unstated_stretching(self) -> Mechanism | None:
        """With `geometric_stiffening`, where actuators push and a beam has none."""
        linear = self.actuator[0].kind == "displacement" or bool(self.super_element)
        elements = None if linear else stiffened(self.element)
        return None if elements is None else self.model_copy(update={"element": elements})

    def remarks(self) -> list[str]:
        """Remarks on flexures and loads outside of the range of their equations, and on inertia that the condensed model does not show."""
        return (
            size_remarks(self)
            + overlap_remarks(self.placed_elements)
            + inertia_remarks(self)
            + alone_remarks(self)
            + reach_remarks(self)
            + self.range_remarks()
        )

    def range_remarks(self) -> list[str]:
        """Where the stiffness under constant loads is off, the drives buckle a flexure, or what is of higher order counts."""
        return load_remarks(self) + buckling_remarks(self) + third_order_remarks(self) + pose_remarks(self)

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The condensed mechanism with the values `p`."""
        return mechanism_physics(Condensed(self, p))
