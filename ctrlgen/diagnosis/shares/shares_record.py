"""The model-free shares as diagnosis.json states them."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import Field

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.shares.families import ranking
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, SharesTable
from ctrlgen.reporting.result_file import FiniteOrNull, Keys

# 95 %
Interval = tuple[FiniteOrNull, FiniteOrNull]


class FractionEntry(Keys):
    """A part of a residual's energy."""

    value: FiniteOrNull = Field(description="The share.")
    ci95: Interval = Field(description="95 % interval, by a bootstrap over blocks.")


class KindShareEntry(Keys):
    """What one kind of signal explains of a residual, in blocks that were not used."""

    kind: str = Field(description="Kind of signal.")
    share: FiniteOrNull = Field(description="Share of the energy that it explains alone, beside a constant.")
    ci95: Interval = Field(description="95 % interval of share.")
    additional: FiniteOrNull = Field(description="What it adds to the kinds selected before it, or beside them all.")
    selected: int | None = Field(description="Place in the forward selection from 1; null where it was not selected.")
    alike: list[str] = Field(description="Kinds that would have done as well in its place.")


class ChannelSharesEntry(Keys):
    """Of what the residual of one channel is a function."""

    rms: FiniteOrNull = Field(description="Root mean square of the residual [unit].")
    unit: str = Field(description="Unit of rms.")
    own_axes: list[str] = Field(description="Axes that the channel sees; others are other axes.")
    constant: FiniteOrNull = Field(description="Share of the mean.")
    numbers: FiniteOrNull = Field(description="Share that other values of the device's own free numbers would add.")
    kinds: list[KindShareEntry] = Field(description="By falling share, the residual's own past last.")
    total: FiniteOrNull = Field(
        description="All kinds, constant and numbers: the ceiling of any law that is a function of them."
    )
    total_ci95: Interval = Field(description="95 % interval of total.")
    rest: FiniteOrNull = Field(description="1 - total.")
    rest_own_past: FiniteOrNull = Field(description="What the residual's own past adds: memory without a name.")
    spikes: FiniteOrNull = Field(description="Share of samples left out as spikes.")
    periods: dict[str, FiniteOrNull] = Field(description="Period of a pitch [SI of the axis] and of a line [s].")


class FamilyShareEntry(Keys):
    """A family of laws."""

    family: str = Field(description="Its name.")
    share: FiniteOrNull = Field(description="Share that it could account for; a signal can speak for several families.")


class SharesTableEntry(Keys):
    """The model-free shares of one residual."""

    channels: dict[str, ChannelSharesEntry] = Field(description="By channel.")
    blocks: int = Field(description="Blocks of the cross-validation and of the intervals.")
    same_as: dict[str, str] = Field(description="Drives that are another signal, which stands for them.")
    families: list[FamilyShareEntry] = Field(
        description="Families of laws that could account for it, the largest first."
    )


class SharesEntry(Keys):
    """How much of a residual is a function of what, whatever the law."""

    statements: list[str] = Field(description="What follows, in sentences.")
    reached: dict[str, FractionEntry] = Field(
        description="Share of the residual before that the findings take away, by channel; total of before is its ceiling."
    )
    before: SharesTableEntry = Field(description="Of what the device as described leaves.")
    after: SharesTableEntry = Field(description="Of what the model with the findings leaves.")


def table_record(table: SharesTable, units: Mapping[str, str], noise: dict[str, float]) -> SharesTableEntry:
    """A table without its samples. `units` of the readings, and standard deviations of their `noise` [SI], by channel."""
    return SharesTableEntry(
        channels={c.channel: _channel_record(c, units[c.channel]) for c in table.channels},
        blocks=table.blocks.count,
        same_as=table.design.same_as,
        families=[FamilyShareEntry(family=f.value, share=share) for f, share in ranking(table, noise)],
    )


def _channel_record(c: ChannelShares, unit: str) -> ChannelSharesEntry:
    """The shares of one channel, whose readings are in `unit`."""
    kinds = [
        KindShareEntry(
            kind=k.kind.value,
            share=k.alone.share,
            ci95=k.alone.ci95,
            additional=k.additional,
            selected=k.selected,
            alike=[other.value for other in k.alike],
        )
        for k in c.kinds
    ]
    return ChannelSharesEntry(
        rms=float(difference(c.rms, unit)),
        unit=unit,
        own_axes=sorted(c.axes),
        constant=c.constant,
        numbers=c.numbers,
        kinds=kinds,
        total=c.total.share,
        total_ci95=c.total.ci95,
        rest=c.rest,
        rest_own_past=c.rest_own_past,
        spikes=c.spikes,
        periods={kind.value: period for kind, period in c.periods.items()},
    )
