"""Columns of regressors by kind, and the design of a smoother: all columns at the drawn samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import pairwise

import numpy as np

from ctrlgen.diagnosis.settings import SHARES


class Kind(Enum):
    """Kinds of regressor, in the order in which they are preferred where two predict alike.

    First laws that act always, the simpler before what contains it; then memory of time, products, and last what fits
    something of any residual: a pitch, a trend, a line.
    """

    DIRECTION = "direction of motion"
    PROPORTION = "position, in proportion"
    POSITION = "position"
    SPEED = "speed"
    ACCELERATION = "acceleration"
    RATE = "rate of the reading"
    DRIVE = "drive"
    TRAVEL_HISTORY = "travel history"
    DRIVE_HISTORY = "drive history"
    OTHER_AXIS = "other axis"
    DRIVE_LAG = "low-passed drive"
    PRODUCT = "product of two"
    WARM_PRODUCT = "product with temperature"
    TEMPERATURE = "temperature"
    RECORD = "record"
    PITCH = "place in a pitch"
    TIME = "time"
    LINE = "phase of a line"
    PAST = "own past"


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns (N, p) of unit variance and zero mean of one kind, made of one signal, or of two.

    `axes`: the axes that the signal belongs to. `signal` and `unit` name `abscissa` (N,), over which a figure shows them; if
    `of_abscissa`, they are functions of it and are held beyond its range, else each column is clamped to its own range. `factors`: what
    the two signals of a product are called.
    """

    kind: Kind
    signal: str
    unit: str
    axes: frozenset[str]
    abscissa: np.ndarray
    values: np.ndarray
    factors: tuple[str, ...] = ()

    @property
    def of_abscissa(self) -> bool:
        """Whether the columns are splines of the abscissa."""
        return self.kind in (
            Kind.PROPORTION,
            Kind.POSITION,
            Kind.SPEED,
            Kind.ACCELERATION,
            Kind.DRIVE,
            Kind.TEMPERATURE,
            Kind.TIME,
        )


PRODUCTS = (Kind.PRODUCT, Kind.WARM_PRODUCT)


@dataclass(frozen=True, eq=False)
class Design:
    """All columns at the drawn samples: X (N, P), its blocks, and the drives that are no signals of their own (`same_as`)."""

    X: np.ndarray
    blocks: tuple[Columns, ...]
    axes: tuple[str, ...]
    same_as: dict[str, str]

    def clamped(self, train: np.ndarray, test: np.ndarray) -> np.ndarray:
        """The columns (P, samples) at the `test` samples, none of them beyond what the `train` samples have seen."""
        X = self.X[test].T.copy()
        for block, places in zip(self.blocks, self.places, strict=True):
            if block.of_abscissa:
                x, seen = block.abscissa[test], np.flatnonzero(train)
                for end, beyond in ((np.argmin, np.less), (np.argmax, np.greater)):
                    last = seen[end(block.abscissa[seen])]
                    out = beyond(x, block.abscissa[last])
                    X[np.ix_(places, out)] = block.values[last][:, None]
            else:
                seen_values = block.values[train]
                X[places] = np.clip(X[places], seen_values.min(axis=0)[:, None], seen_values.max(axis=0)[:, None])
        return X

    def one_way(self, channel_axes: frozenset[str]) -> bool:
        """Whether the `channel_axes` move in one direction only, so that dry friction and an offset are one."""
        turning = [b for b in self.of_kind(Kind.DIRECTION, channel_axes) if np.ptp(np.sign(b.abscissa)) == 2]
        return bool(channel_axes) and not any(
            min(np.mean(b.abscissa > 0), np.mean(b.abscissa < 0)) > SHARES.one_way for b in turning
        )

    @cached_property
    def places(self) -> list[np.ndarray]:
        """The columns of X of each block."""
        ends = np.cumsum([0, *(b.values.shape[1] for b in self.blocks)])
        return [np.arange(a, b) for a, b in pairwise(ends)]

    def kinds(self, channel_axes: frozenset[str]) -> dict[Kind, np.ndarray]:
        """Columns of X by kind, for a channel that sees the `channel_axes`."""
        places_by_kind: dict[Kind, list[np.ndarray]] = {}
        for block, places in zip(self.blocks, self.places, strict=True):
            if (kind := kind_for(block, channel_axes)) is not None:
                places_by_kind.setdefault(kind, []).append(places)
        return {kind: np.concatenate(places_by_kind[kind]) for kind in Kind if kind in places_by_kind}

    def of_kind(self, kind: Kind, channel_axes: frozenset[str]) -> Iterator[Columns]:
        """The blocks of one kind, for a channel that sees the `channel_axes`."""
        return (block for block in self.blocks if kind_for(block, channel_axes) is kind)


def kind_for(block: Columns, channel_axes: frozenset[str]) -> Kind | None:
    """The kind of a block for a channel that sees the `channel_axes`: what belongs to another axis counts as that; None where it
    is not looked at."""
    if not block.axes or block.axes & channel_axes:
        return block.kind
    return Kind.OTHER_AXIS if block.kind in (Kind.POSITION, Kind.SPEED, Kind.ACCELERATION) else None
