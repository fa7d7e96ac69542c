"""A stage by its matrix at one point, measured or from finite elements: compliance, stiffness, or the Jacobian of its drives.

In n of the six directions of a point, T = C W: T (n,) are rotations and displacements, W (n,) the conjugate moments and forces. Unit
forces of the actuators are wrenches B (n, m) there, B_k = (n; p x n) of a force along n at p. Then the axes move by c = B' C B per
force, d = c f, and the point by

    T = C B c^-1 d,    f = (c^-1 + diag(k)) d

k being the stiffness of stacks beside their blocked force. With a stiffness K, C B solves K X = B: directions that it does not list are
held; those that a compliance does not list are not seen. A Jacobian is T = J u.

Source: reciprocity and energy as in `stated_matrix`; forces at a point, S1 section 2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.counts import number_of
from ctrlgen.core.units import same_dimension, show
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import BalancedPhysics, SensedPoints
from ctrlgen.devices.driven import proportional
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.matrix_actuator import MatrixActuator
from ctrlgen.devices.matrix_entries import Entry, entry_faults, units_of, with_units
from ctrlgen.devices.place import Direction, Place
from ctrlgen.devices.stated_matrix import matrix_faults, symmetric_note
from ctrlgen.devices.travel import ends_of
from ctrlgen.numerics.symmetric_solve import solve_symmetric
from ctrlgen.physics.rigid_bodies import point_force
from ctrlgen.physics.screw import TWIST, WRENCH, Matrix, TwistComponent, WrenchComponent, told_in

CONJUGATE = dict(zip(TWIST, (*WRENCH[3:], *WRENCH[:3]), strict=True))
NEAREST = 1e-3  # m: arm of a force whose moment counts as large as itself
FAINT = 1e-9  # of a force, below which rounding of its direction makes a component
MOVED = 1e-6  # of the largest motion, below which rounding moves a direction


class MatrixDevice(Device):
    """Drive -> force -> motion of a point by its compliance or stiffness; or drive -> motion by a Jacobian."""

    on_flexures: ClassVar[bool | None] = True

    kind: Literal["matrix"]
    """A matrix of one's own, measured or from finite elements."""
    directions: tuple[TwistComponent, ...] = Field(min_length=1)
    """Directions of the point that the matrix has, any of the six, in the order of its rows (of a stiffness: of its columns)."""
    loads: tuple[WrenchComponent, ...] = ()
    """Order of the loads in the columns of a compliance, the rows of a stiffness. Left out: as the directions, moments along rotations."""
    compliance: tuple[tuple[Entry, ...], ...] | None = None
    """Rows of directions per load, each entry with its unit, such as [["0.301 um/N", "7.1 urad/N"], ...], or 0."""
    stiffness: tuple[tuple[Entry, ...], ...] | None = None
    """In place of a compliance: rows of loads per direction, such as [["1.2 N/um", 0], ...]; directions left out are held."""
    jacobian: tuple[tuple[Entry, ...], ...] | None = None
    """In place of both: rows of directions per drive, a column for each actuator, such as [["1.2 um/V", "3 nm/V"], ...]."""
    at: Place = Field(default=("0 mm", "0 mm", "0 mm"), validate_default=True)
    """The point, in the frame in which actuators have their places. Left out: the origin."""
    channels: tuple[TwistComponent, ...] = Field(min_length=1)
    """Directions that are followed, as many as actuators."""
    readings: tuple[TwistComponent, ...] = ()
    """Directions that are read beside these; recordings name them, as in "reading.theta_z"."""
    actuator: tuple[MatrixActuator, ...] = Field(min_length=1)
    """`[[actuator]]` tables: all push, or all move by a Jacobian."""

    @model_validator(mode="after")
    def _describes_a_stage(self) -> MatrixDevice:
        forms = [key for key in ("compliance", "stiffness", "jacobian") if getattr(self, key) is not None]
        if len(forms) != 1:
            raise ValueError("give one matrix: compliance, stiffness or jacobian")
        faults = self._name_faults()
        for k, a in enumerate(self.actuator):
            faults += [f"actuator[{k}].{fault}" for fault in a.faults(self.pushes)]
        faults += [] if faults else self._entry_faults()
        if not faults and self.pushes:
            faults += matrix_faults(self.form, self._numbers(), self.directions, self._numbers(deviations=True))
        faults += [] if faults else self._unmoved()
        if faults:
            raise ValueError("; ".join(faults))
        object.__setattr__(self, self.form, with_units(getattr(self, self.form), *self._units()))
        return self

    @property
    def form(self) -> str:
        """Which matrix the file states: "compliance", "stiffness" or "jacobian"."""
        return next(key for key in ("compliance", "stiffness", "jacobian") if getattr(self, key) is not None)

    @property
    def pushes(self) -> bool:
        """Whether the actuators push."""
        return self.jacobian is None

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the actuators."""
        return tuple(a.name for a in self.actuator)

    @property
    def _load_order(self) -> tuple[str, ...]:
        return self.loads or tuple(CONJUGATE[name] for name in self.directions)

    def _name_faults(self) -> list[str]:
        faults = []
        for key, names in {
            "directions": self.directions,
            "actuator": self.axes,
            "channels": (*self.channels, *self.readings),
        }.items():
            faults += [f"{key}: {name!r} is named twice" for name in dict.fromkeys(names) if names.count(name) > 1]
        for key in ("channels", "readings"):
            unknown = [name for name in getattr(self, key) if name not in self.directions]
            if unknown:
                faults.append(
                    f"{key}: {', '.join(unknown)} is no direction of the matrix, which has {', '.join(self.directions)}"
                )
        if len(self.channels) != len(self.actuator):
            counts = f"{number_of(len(self.channels), 'channel')}, {number_of(len(self.actuator), 'actuator')}"
            faults.append(f"channels: {counts}; follow as many as there are actuators")
        if self.loads and not self.pushes:
            faults.append("loads: belong to a compliance or stiffness; the columns of a jacobian are the actuators")
        elif self.loads and sorted(self.loads) != sorted(CONJUGATE[name] for name in self.directions):
            wanted = ", ".join(CONJUGATE[name] for name in self.directions)
            faults.append(f"loads: must be those of the directions in any order: {wanted}")
        if len({a.time_constant is None for a in self.actuator}) > 1:
            faults.append("actuator: some have a time_constant and some do not; give one to all or to none")
        drive = self.actuator[0].drive_unit
        if not self.pushes and not all(same_dimension(a.drive_unit, drive) for a in self.actuator):
            faults.append("actuator: some have another drive; beside a jacobian all drives have one unit")
        return faults

    def _entry_faults(self) -> list[str]:
        """Rows and columns that are too few or too many, and entries in a wrong unit."""
        return entry_faults(self.form, getattr(self, self.form), *self._units())

    def _units(self) -> tuple[dict[str, str], dict[str, str]]:
        """The SI units of the rows and of the columns of the stated matrix, by their names."""
        directions, loads = units_of(self.directions), units_of(self._load_order)
        return {
            "compliance": (directions, loads),
            "stiffness": (loads, directions),
            "jacobian": (directions, {a.name: a.drive_unit for a in self.actuator}),
        }[self.form]

    def _numbers(self, deviations: bool = False) -> np.ndarray:
        """The matrix as the file states it [SI], directions by conjugate loads or by drives; or its `deviations`, 0 where none is."""
        rows = [[(e.sd or 0.0) if deviations else e.si for e in row] for row in getattr(self, self.form)]
        return np.array(self._ordered(rows))

    def _ordered(self, rows: Sequence[Sequence[Any]]) -> list[list[Any]]:
        """Rows of entries with the loads in the order of the directions."""
        places = [self._load_order.index(CONJUGATE[name]) for name in self.directions]
        if self.form == "stiffness":
            return [list(rows[i]) for i in places]
        return [[row[j] for j in places] if self.pushes else list(row) for row in rows]

    def _unmoved(self) -> list[str]:
        """Actuators that push alike, channels that none moves or that move only together."""
        m = self._motion(self.values())
        if np.linalg.cond(m.axes / np.sqrt(np.outer(np.diag(m.axes), np.diag(m.axes)))) > 1 / MOVED**2:
            return [
                f"actuator: as far as the matrix tells, {', '.join(self.axes)} push only together; place them otherwise"
            ]
        reach = np.abs(m.rows * self._travels)
        arm = max((reach[i].max() for i, name in enumerate(self.directions) if name[0] == "t"), default=0.0)
        arm = arm or 1.0  # nothing turns
        way = max((reach[i].max() for i, name in enumerate(self.directions) if name[0] == "d"), default=0.0)
        way = way or 1.0
        sized = reach / np.array([[arm if name[0] == "t" else way] for name in self.directions])
        followed = sized[[self.directions.index(name) for name in self.channels]]
        still = [name for name in (*self.channels, *self.readings) if sized[self.directions.index(name)].max() <= MOVED]
        if still:
            return [
                f"channels: no actuator moves {', '.join(still)}; follow or read others, or push in another direction"
            ]
        signed = followed * np.sign(m.rows[[self.directions.index(name) for name in self.channels]])
        if np.linalg.cond(signed / np.abs(signed).max(axis=1, keepdims=True)) > 1 / MOVED:
            return [
                f"channels: {', '.join(self.channels)} move only together; follow others, or place the actuators otherwise"
            ]
        return []

    @property
    def _ranges(self) -> list[tuple[float, float]]:
        """The displacements that each axis may have; of a Jacobian they are drives [SI]."""
        return [(a.low.si, a.high.si) if a.travel is None else ends_of(a.travel) for a in self.actuator]

    @property
    def _travels(self) -> np.ndarray:
        """(m,) largest displacement of each axis [SI]."""
        return np.abs(self._ranges).max(axis=1)

    def _motion(self, p: SimpleNamespace) -> _Motion:
        """At home with the numbers of the file."""
        c, rows = self._equations(p)
        return _Motion(*(ca.DM(ca.evalf(ca.SX(matrix))).full() for matrix in (c, rows)))

    def _equations(self, p: SimpleNamespace) -> tuple[Matrix, Matrix]:
        """c (m, m) displacement of the axes per force on them, and (n, m) motion of the point per displacement of the axes."""
        stated = ca.vertcat(*(ca.horzcat(*row) for row in self._ordered(getattr(p, self.form))))
        if not self.pushes:
            return ca.DM.eye(len(self.actuator)), stated
        symmetric, B = (stated + stated.T) / 2, self._pushes(p)
        moved = ca.mtimes(symmetric, B) if self.form == "compliance" else solve_symmetric(symmetric, B)
        c = ca.mtimes(B.T, moved)
        return c, ca.mtimes(moved, solve_symmetric(c, ca.DM.eye(len(self.actuator))))

    def _pushes(self, p: SimpleNamespace) -> Matrix:
        """B (n, m): what a unit force of each actuator is at the point, in the directions of the matrix."""
        return self._wrenches(p)[[WRENCH.index(CONJUGATE[name]) for name in self.directions], :]

    def _wrenches(self, p: SimpleNamespace) -> Matrix:
        """(6, m) of a unit force of each actuator at the point."""
        columns = []
        for a, numbers in zip(self.actuator, p.actuator, strict=True):
            columns.append(point_force(ca.vertcat(*numbers.at) - ca.vertcat(*p.at), ca.DM(_unit(a.along))))
        return ca.horzcat(*columns)

    def remarks(self) -> list[str]:
        """That the matrix was made symmetric, and where actuators push in directions that it does not have."""
        if not self.pushes:
            return []
        notes = symmetric_note(self.form, self._numbers())
        what = "which the stiffness holds" if self.form == "stiffness" else "of which the compliance says nothing"
        wrenches = np.abs(ca.DM(self._wrenches(self.values())).full()) / np.array([[1.0]] * 3 + [[NEAREST]] * 3)
        for a, wrench in zip(self.actuator, wrenches.T, strict=True):
            unseen = [
                load
                for name, load in CONJUGATE.items()
                if name not in self.directions and wrench[WRENCH.index(load)] > FAINT
            ]
            notes += [f"{a.name} also pushes by {', '.join(unseen)}, {what}"] if unseen else []
        return notes

    def lines(self) -> list[str]:
        """What `ctrlgen check` prints of it: stiffness of the axes, and what each moves."""
        m, lines = self._motion(self.values()), []
        if self.pushes:
            stiffness = [show(1 / c, "N/um") for c in np.diag(m.axes)]
            lines.append(
                f"stiffness at the actuators, each alone: {', '.join(map(' '.join, zip(self.axes, stiffness, strict=True)))}"
            )
        for name, row in zip(self.directions, m.rows, strict=True):
            per = [
                show(x, f"{told_in(name)}/{'um' if self.pushes else a.drive_unit}") + f" per {a.name}"
                for x, a in zip(row, self.actuator, strict=True)
            ]
            lines.append(f"{name}: {', '.join(per)}")
        return lines

    def physics(self, p: SimpleNamespace) -> BalancedPhysics:
        """The matrix with the values `p`."""
        sections, axes, n = self.actuator, self.axes, len(self.actuator)
        c, rows = self._equations(p)
        gains = [a.gain if self.pushes else 1.0 for a in p.actuator]
        sizes = [1.0 if a.gain is None else a.gain.si for a in sections]
        acting = proportional(axes, sections, gains, sizes, [a.time_constant for a in p.actuator])
        stacks = ca.vertcat(*(0.0 if not self.pushes or a.stiffness is None else a.stiffness for a in p.actuator))
        K = solve_symmetric(c, ca.DM.eye(n)) + ca.diag(stacks)
        reach = dict(
            zip(self.directions, np.abs(self._motion(self.values()).rows * self._travels).sum(axis=1), strict=True)
        )
        followed, read = ([self.directions.index(name) for name in names] for names in (self.channels, self.readings))
        units = {name: told_in(name) for name in TWIST}
        travel_unit = "um" if self.pushes else sections[0].drive_unit

        def limits(signal: SimpleNamespace) -> list[Limit]:
            return acting.limits(signal) + [
                Limit(f"travel_{a.name}", f"travel of {a.name}", (a.name,), travel_unit, signal.displacement[i], *span)
                for i, (a, span) in enumerate(zip(sections, self._ranges, strict=True))
            ]

        def sensed(names: tuple[str, ...], at: list[int]) -> SensedPoints:
            sizes = tuple(float(reach[name]) for name in names)
            return SensedPoints(names, tuple(units[name] for name in names), sizes, lambda d: ca.mtimes(rows[at, :], d))

        return BalancedPhysics(
            axes=axes,
            components=self.channels,
            pose_units=tuple(units[name] for name in self.channels),
            pose_scale=tuple(float(reach[name]) for name in self.channels),
            drive=acting.drive,
            state=acting.state,
            rest=acting.rest,
            displacement_scale=float(self._travels.max()),
            travel_unit=travel_unit,
            bipolar=any(a.low.si < 0 for a in sections),
            force_scale=acting.force_scale,
            force_unit="N" if self.pushes else sections[0].drive_unit,
            force=lambda u, x, d: acting.force(u, x),
            rates=acting.rates,
            restoring_force=lambda d: ca.mtimes(K, d),
            restoring_force_parts=lambda d: {"linear": ca.mtimes(K, d)},
            pose=lambda d: ca.mtimes(rows[followed, :], d),
            limits=limits,
            rate_limits=acting.rate_limits(sections),
            sensed=sensed(self.readings, read) if read else None,
        )


def _unit(along: Direction | None) -> np.ndarray:
    """(3,) of length one."""
    direction = np.array(along, float)
    return direction / np.linalg.norm(direction)


@dataclass(frozen=True, eq=False)
class _Motion:
    """`axes` (m, m) displacement per force of the axes, `rows` (n, m) motion of the point per displacement, in numbers [SI]."""

    axes: np.ndarray
    rows: np.ndarray
