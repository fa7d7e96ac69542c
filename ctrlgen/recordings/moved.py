"""What a device was driven with and what it read, as it is held beside the device's own linear response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.model.assembly import build_model
from ctrlgen.model.linear_system import LinearSystem, linear_system
from ctrlgen.model.model import Model
from ctrlgen.recordings.recording import Recording

MOST_ROWS = 4000  # of a stretch that are simulated: a unit is wrong in all of them
MOST_STRETCHES = 4


@dataclass(frozen=True)
class Stretch:
    """`u` (n, n_u) and `y` (n, n_y) [SI], NaN where nothing was read, every `step` [s], infinite for settled poses; `linear`: the drive is
    linear between samples; `name` of its record."""

    u: np.ndarray
    y: np.ndarray
    step: float
    linear: bool
    name: str = ""


@dataclass(frozen=True)
class Moved:
    """`drives` and `readings` are (name, unit), names as "drive.axis"; `stretches` in which something moves."""

    model: Model
    drives: tuple[tuple[str, str], ...]
    readings: tuple[tuple[str, str], ...]
    stretches: tuple[Stretch, ...]

    @cached_property
    def bare(self) -> Model:
        """The device without its effects."""
        return build_model(self.model.device.model_copy(update={"effect": ()}))

    @cached_property
    def system(self) -> LinearSystem:
        """The device without its effects, about the mean of the drives within its bounds."""
        return self.system_about(np.mean([s.u.mean(axis=0) for s in self.stretches], axis=0))

    def system_about(self, u: np.ndarray) -> LinearSystem:
        """The device without its effects, at rest about the drives u (n_u,) [SI] as far as its bounds allow them."""
        bare = self.bare
        outputs = ca.vertcat(*(bare.signals[role].expr[k] for role, k in (_place(n, bare) for n, _ in self.readings)))
        return linear_system(bare, outputs, bare.rest, np.zeros(bare.z.numel()), np.clip(u, *bare.u_bounds))

    @cached_property
    def sizes(self) -> np.ndarray:
        """(n_u,) [SI] what each drive can span: its bounds, or where it has none its typical size."""
        low, high = self.model.u_bounds
        return np.where(np.isfinite(high - low), high - low, np.array(self.model.signals["drive"].scale))

    @cached_property
    def scales(self) -> np.ndarray:
        """(n_y,) [SI] the typical size of each reading."""
        places = (_place(name, self.model) for name, _ in self.readings)
        return np.array([self.model.signals[role].scale[k] for role, k in places])

    def spans(self) -> np.ndarray:
        """(n_u,) [SI] what each drive was seen to span."""
        return np.ptp(np.concatenate([s.u for s in self.stretches]), axis=0)

    def stepped(self, factor: float) -> Moved:
        """The same rows, each `factor` times as long."""
        return replace(self, stretches=tuple(replace(s, step=factor * s.step) for s in self.stretches))


def _place(name: str, model: Model) -> tuple[str, int]:
    """The signal of a reading named "role.channel", and its place in it."""
    role, _, channel = name.partition(".")
    return role, model.signals[role].channels.index(channel)


def moved(recording: Recording, model: Model) -> Moved | None:
    """The drives and readings of a recording; None where nothing of it can be held beside the model."""
    drives = tuple(zip(recording.drives, recording.drive_units, strict=False))
    places = [i for i, name in enumerate(recording.channels) if name.partition(".")[0] in ("reading", "pose")]
    readings = tuple((recording.channels[i], recording.units[i]) for i in places)
    stretches = [
        Stretch(r.drive, np.where(r.valid, r.observed, np.nan)[:, places], r.sample_time, r.linear, r.name)
        for r in recording.records
        if r.role != "rest"
    ]
    return moved_of(model, drives, readings, stretches)


def moved_of(
    model: Model,
    drives: tuple[tuple[str, str], ...],
    readings: tuple[tuple[str, str], ...],
    stretches: Sequence[Stretch],
) -> Moved | None:
    """The busiest rows of the longest stretches; None where a drive is not known or nothing moves."""
    known = [s for s in stretches if len(s.u) > 1 and np.isfinite(s.u).all() and np.isfinite(s.y).any()]
    if len(drives) != model.u.numel() or not known:
        return None
    longest = sorted(known, key=lambda s: len(s.u), reverse=True)[:MOST_STRETCHES]
    return Moved(model, drives, readings, tuple(map(_busiest, longest)))


def _busiest(s: Stretch) -> Stretch:
    """The rows among which the drives move most, where there are more than are simulated."""
    n = len(s.u)
    if n <= MOST_ROWS:
        return s
    way = np.abs(np.diff(s.u, axis=0)) / np.maximum(np.ptp(s.u, axis=0), 1e-300)
    done = np.concatenate([[0.0], np.cumsum(way.sum(axis=1))])
    first = int(np.argmax(done[MOST_ROWS:] - done[: n - MOST_ROWS]))
    rows = slice(first, first + MOST_ROWS)
    return replace(s, u=s.u[rows], y=s.y[rows])
