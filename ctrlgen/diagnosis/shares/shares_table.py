"""The table of model-free shares, by channel and kind of regressor."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ctrlgen.diagnosis.shares.blocks import Blocks
from ctrlgen.diagnosis.shares.design import Design, Kind


@dataclass(frozen=True)
class Share:
    """Part of a residual's energy with its 95 % interval over blocks; 0 where chance could show it."""

    share: float
    ci95: tuple[float, float]


@dataclass(frozen=True)
class KindShare:
    """The share of one kind of regressor alone, and what it adds to the selected ones before it, or beside them all.

    Of selected kinds what they add makes up the share of all selected ones; of a pair that shows only together the first may
    add nothing, or less. `selected`: its place in the forward selection from 1, None where it was not selected. `alike`:
    kinds that would have done as well in its place.
    """

    kind: Kind
    alone: Share
    additional: float
    selected: int | None
    alike: tuple[Kind, ...]


@dataclass(frozen=True, eq=False)
class ChannelShares:
    """The shares of one channel, of the energy sum y^2 of its residual.

    rms: of the residual [SI]. axes: those that the channel sees.
    constant: share of the mean. numbers: what other values of the device's own free numbers would add to it, beyond what
        their stated deviations allowed; 0 where the kinds predict as well without them.
    kinds: by falling share alone, the own past last.
    total: of all kinds, with the constant and the numbers: the ceiling of any law that is a function of them.
    rest: 1 - total. rest_own_past: what the residual's own past adds to the selected kinds; this part of the rest lasts
        longer than a sample and has no name.
    spikes: share of the samples that were left out as such.
    periods: of a pitch [SI of the axis] and of a line [s], the middle one of the folds. pitch_unit: in which the axis of the pitch is
        told; empty where there is no pitch, or no unit.
    factors: of products, by kind, the two signals of the one that makes up most of what all of that kind predict.
    residual, predictions: (N,) [SI] at the drawn samples, the latter by kind and out of block; NaN where not valid.
    """

    channel: str
    rms: float
    axes: frozenset[str]
    constant: float
    numbers: float
    kinds: tuple[KindShare, ...]
    total: Share
    rest: float
    rest_own_past: float
    spikes: float
    periods: dict[Kind, float]
    residual: np.ndarray
    predictions: dict[Kind, np.ndarray]
    pitch_unit: str = ""
    factors: dict[Kind, tuple[str, ...]] = field(default_factory=dict)

    @property
    def selected(self) -> tuple[KindShare, ...]:
        """The selected kinds in the order of the selection."""
        return tuple(sorted((k for k in self.kinds if k.selected), key=lambda k: k.selected or 0))


@dataclass(frozen=True, eq=False)
class SharesTable:
    """The shares of every channel over the same blocks, and the columns at the drawn samples."""

    channels: tuple[ChannelShares, ...]
    blocks: Blocks
    design: Design

    def of(self, channel: str) -> ChannelShares:
        """The shares of one channel by name."""
        return next(c for c in self.channels if c.channel == channel)
