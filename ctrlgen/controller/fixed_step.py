"""The controller in integers, sample by sample: what codegen/templates/fixed.c.j2 computes, in the same integers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.fixed_point import FixedPoint
from ctrlgen.numerics.scaled_integers import shifted

WORD = 2**31  # a target is an int32_t


@dataclass(frozen=True)
class FixedState:
    """Integers of the states and of the displacement; samples until the device has settled, and until it is at rest whatever it was."""

    x: tuple[int, ...]
    z: tuple[int, ...]
    unsure: int = 0
    cooling: int = 0


@dataclass(frozen=True)
class FixedStep:
    """One answer in integers, and the state behind it."""

    status: ControllerStatus
    drive: tuple[int, ...]
    displacement: tuple[int, ...]
    state: tuple[int, ...]
    after: FixedState

    @property
    def numbers(self) -> tuple[int, ...]:
        """Drives, displacement and states, as the C's output has them."""
        return (*self.drive, *self.displacement, *self.state)


@dataclass(frozen=True)
class FixedController:
    """What the C does with the maps of `fixed`."""

    fixed: FixedPoint

    def rest(self) -> FixedState:
        """Of a cold device at rest."""
        home = np.zeros(self.fixed.displacement_ends.shape[1], dtype=int)
        return FixedState(_integers(self.fixed.state_of(home)), _integers(home))

    def forgotten(self) -> FixedState:
        """Of a device of which nothing is known."""
        return replace(self.rest(), cooling=self.fixed.unknown)

    def at(self, target: np.ndarray) -> FixedState:
        """Of a device that stands at a target (m,) in integers."""
        z = _clipped(self.fixed.displacement(target), self.fixed.displacement_ends)
        return FixedState(_integers(self.fixed.state_of(z)), _integers(z))

    def counts(self, target: np.ndarray) -> np.ndarray:
        """Targets (..., m) [SI] as integers, beyond those of 32 bits the largest; of what is no number 0."""
        with np.errstate(over="ignore"):  # the largest is then infinite, and clipped
            scaled = np.rint(np.nan_to_num(target, nan=0.0) * 2.0**self.fixed.bits.target)
        return np.clip(scaled, -WORD, WORD - 1).astype(np.int64)

    def step(self, state: FixedState, target: np.ndarray | None, settle: bool = False) -> FixedStep:
        """The answer to a target (m,) in integers; to none the device is kept where it is."""
        if state.cooling:
            rest = self.rest()
            drives = (0,) * self.fixed.drive_ends.shape[1]
            after = replace(state, cooling=state.cooling - 1)
            return FixedStep(ControllerStatus.UNSURE, drives, rest.z, rest.x, after)
        status, wanted = ControllerStatus.INPUT, np.array(state.z)
        if target is not None:
            wide, ends = self.fixed.displacement(target), self.fixed.displacement_ends
            beyond = _beyond(wide, ends, self.fixed.displacement_slack)
            status, wanted = ControllerStatus.DISPLACEMENT if beyond else ControllerStatus(0), _clipped(wide, ends)
        found, place = self._approach(state, wanted, settle)
        _, s, drive = self._broken(state, place, settle)
        moved = settle and bool(np.any(np.abs(s - np.array(state.x)) > self.fixed.known))
        unsure = max(state.unsure, self.fixed.settling) if moved else state.unsure
        status |= found | (ControllerStatus.UNSURE if unsure else ControllerStatus(0))
        after = FixedState(_integers(s), _integers(place), max(unsure - 1, 0))
        return FixedStep(status, _integers(drive), after.z, after.x, after)

    def _approach(self, state: FixedState, wanted: np.ndarray, settle: bool) -> tuple[ControllerStatus, np.ndarray]:
        """Limits that are in the way, and the place on the way to `wanted` that keeps them."""
        status, *_ = self._broken(state, wanted, settle)
        if not status:
            return status, wanted
        origin = np.zeros_like(wanted) if settle else np.array(state.z)
        trials, share = self.fixed.trials, 0

        def on_line(part: int) -> np.ndarray:
            return origin + np.array([shifted(int(way) * part, trials) for way in wanted - origin])

        for k in range(trials):
            part = 2 ** (trials - 1 - k)
            found, *_ = self._broken(state, on_line(share + part), settle)
            status |= found
            share += 0 if found else part
        return status, on_line(share)

    def _broken(
        self, state: FixedState, z: np.ndarray, settle: bool
    ) -> tuple[ControllerStatus, np.ndarray, np.ndarray]:
        """The limits that a displacement breaks, its states and its drives."""
        f, status = self.fixed, ControllerStatus(0)
        s = f.state_of(z)
        wide = f.settle_drive(s) if settle else f.step_drive(np.concatenate([state.x, s]))
        if _beyond(wide, f.drive_ends, f.drive_slack):
            status |= ControllerStatus.DRIVE
        if f.bound is not None and int(np.abs(f.bound(z)).sum()) > f.bound_limit:
            status |= ControllerStatus.COMPOSITE
        return status, s, _clipped(wide, f.drive_ends)


def _integers(values: Sequence[int] | np.ndarray) -> tuple[int, ...]:
    return tuple(int(v) for v in values)


def _beyond(wide: np.ndarray, ends: np.ndarray, slack: np.ndarray) -> bool:
    return bool(np.any((wide < ends[0] - slack) | (wide > ends[1] + slack)))


def _clipped(wide: np.ndarray, ends: np.ndarray) -> np.ndarray:
    return np.clip(wide, ends[0], ends[1])
