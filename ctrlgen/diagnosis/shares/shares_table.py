"""The table of model-free shares, as values, as JSON and as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.core.to_json import plain
from ctrlgen.core.units import difference
from ctrlgen.diagnosis.shares.blocks import Blocks
from ctrlgen.diagnosis.shares.regressors import Design, Kind

NAMED = 3  # kinds that do as well: so many are named in a line


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

    rms: of the residual [SI]. own: the axes that the channel sees.
    constant: share of the mean. numbers: what other values of the device's own free numbers would add to it, beyond what
        their stated deviations allowed; 0 where the kinds predict as well without them.
    kinds: by falling share alone, the own past last.
    total: of all kinds, with the constant and the numbers: the ceiling of any law that is a function of them.
    rest: 1 - total. rest_own_past: what the residual's own past adds to the selected kinds; this part of the rest lasts
        longer than a sample and has no name.
    spikes: share of the samples that were left out as such.
    periods: of a pitch [SI of the axis] and of a line [s], the middle one of the folds.
    residual, predictions: (N,) [SI] at the drawn samples, the latter by kind and out of block; NaN where not valid.
    """

    channel: str
    rms: float
    own: frozenset[str]
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


def as_json(table: SharesTable, units: Mapping[str, str] | None = None) -> dict[str, Any]:
    """The table in the types of JSON, without the samples: for diagnosis.json. `units` of the residuals by channel; SI without."""

    def row(kind: KindShare) -> dict[str, Any]:
        return {
            "kind": kind.kind.value, "share": kind.alone.share, "ci95": kind.alone.ci95, "additional": kind.additional,
            "selected": kind.selected, "alike": [k.value for k in kind.alike],
        }  # fmt: skip

    def shown(c: ChannelShares) -> tuple[float, str]:
        unit = (units or {}).get(c.channel, "")
        return (float(difference(c.rms, unit)) if unit else c.rms), unit

    rows = {
        c.channel: {
            "rms": rms, "unit": unit, "own_axes": sorted(c.own), "constant": c.constant, "numbers": c.numbers,
            "kinds": [row(k) for k in c.kinds], "total": c.total.share, "total_ci95": c.total.ci95, "rest": c.rest,
            "rest_own_past": c.rest_own_past, "spikes": c.spikes,
            "periods": {kind.value: period for kind, period in c.periods.items()},
        }
        for c in table.channels
        for rms, unit in [shown(c)]
    }  # fmt: skip
    return plain({"channels": rows, "blocks": table.blocks.count, "same_as": table.design.same_as})


def as_text(table: SharesTable, least: float = 0.005) -> str:
    """The table as lines of text: the selected kinds in their order, then the others; those with a share below `least` are
    left out."""
    lines = []
    for c in table.channels:
        lines.append(
            f"{c.channel}: all kinds {c.total.share:.0%}, rest {c.rest:.0%}, of which {c.rest_own_past:.0%} has memory; "
            f"mean {c.constant:.0%}, the device's own numbers {c.numbers:.0%}"
        )
        for k in (*c.selected, *(k for k in c.kinds if not k.selected)):
            if max(k.alone.share, k.additional) < least:
                continue
            low, high = k.alone.ci95
            place = f", selected {k.selected}" if k.selected else ""
            others = [a.value for a in k.alike] if len(k.alike) <= NAMED else [f"one of {len(k.alike)} others"]
            alike = f" (or {', '.join(others)})" if others else ""
            alone = f"{k.alone.share:6.1%} ({low:.0%} ... {high:.0%})"
            lines.append(f"  {k.kind.value:20s} {alone:22s} adds {k.additional:6.1%}{place}{alike}")
    return "\n".join(lines)
