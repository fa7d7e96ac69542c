"""Model-free shares: what part of a residual, in blocks not used to build it, is a function of what.

With y the residual of one channel at the drawn samples and f_K the smoother of one kind K of regressors, each with a mean,
predicted out of block (`cross_validation`),

    share(K) = (sum (y - m)^2 - sum (y - f_K)^2) / sum y^2,

m the mean out of block. Shares are of the whole energy sum y^2, so that the share of the constant, those of selected kinds
and the rest make up one. A share that chance could show is zero.

Free numbers of the device have moved to stand in for what is missing: of dry friction F sign(v), a fit of viscous damping c v
leaves F sign(v) - c v, which is no function of the direction. So the sensitivities dy/dp, where they are given, stand
beside every smoother and beside the mean, wherever they improve the prediction out of block. Where their stated deviations
hold them instead, they would stand in for physics, and are left out if the kinds predict as well without them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.blocks import make_blocks
from ctrlgen.diagnosis.shares.channel import (
    ChannelSmoothers,
    as_good,
    rates_of,
    select_kinds,
    without_spikes,
)
from ctrlgen.diagnosis.shares.cross_validation import Folds
from ctrlgen.diagnosis.shares.design import PRODUCTS, Kind
from ctrlgen.diagnosis.shares.regressors import build_design, own_axes
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, KindShare, SharesTable
from ctrlgen.diagnosis.shares.signals import Signals


class TooFewSamples(ValueError):
    """No channel has enough valid samples for shares."""


def model_free_shares(
    residuals: Sequence[np.ndarray],
    signals: Sequence[Signals],
    channels: Sequence[str],
    sensitivities: Sequence[np.ndarray] | None = None,
    seed: int = 0,
) -> SharesTable:
    """The shares of residuals (n, n_c), NaN where not valid, one array and one `Signals` a record.

    `channels` (n_c,) name the residuals; where `Signals.reading` has that name, the axes that move it count as its own and
    all others as other axes. `sensitivities` (n, n_c, k) of the readings by the k numbers that were fitted, one array a
    record. `seed` draws the samples. Raises TooFewSamples where no channel has twice `SHARES.fewest_blocks` valid samples, and
    ValueError where records and signals do not match.
    """
    if len({s.settled for s in signals}) != 1 or len(residuals) != len(signals):
        raise ValueError("give one Signals a record, all of time series or all of settled poses")
    blocks = make_blocks(residuals, signals[0].settled, seed)
    design = build_design(signals, blocks.rows)
    folds: dict[bytes, Folds] = {}
    rows = []
    for i, name in enumerate(channels):
        given = [np.asarray(part[:, i], float) for part in residuals]
        parts = given if signals[0].settled else without_spikes(given)
        usable = np.isfinite(blocks.drawn(parts))
        if usable.sum() < 2 * SHARES.fewest_blocks:
            continue
        key = usable.tobytes()
        if key not in folds:
            folds[key] = Folds(design, blocks, usable)
        numbers = blocks.drawn([S[:, i] for S in sensitivities]) if sensitivities else np.empty((len(usable), 0))
        axes = own_axes(signals, name)
        rates = rates_of(signals, name, blocks)
        smoothers = ChannelSmoothers(parts, design, folds[key], axes, numbers, signals[0].sample_time, rates)
        spikes = 1 - np.isfinite(np.concatenate(parts)).sum() / np.isfinite(np.concatenate(given)).sum()
        rows.append(_shares(name, smoothers, float(spikes)))
    if not rows:
        raise TooFewSamples("no channel has enough valid samples")
    return SharesTable(tuple(rows), blocks, design)


def _shares(name: str, channel: ChannelSmoothers, spikes: float) -> ChannelShares:
    """Shares alone, forward selection and ceiling of one channel."""
    named = [kind for kind in channel.kinds if kind is not Kind.PAST]
    selection = select_kinds(channel, named)
    channel, selected, joint = selection.channel, selection.kinds, selection.joint
    usable, total = channel.common.usable, max(float(channel.energy.sum()), 1e-300)
    alone = {kind: channel.fit([kind]) for kind in channel.kinds}
    rows, before = [], channel.base
    for place, kind in enumerate(selected, 1):
        after = channel.fit(selected[:place])
        others = [k for k in selected if k is not kind]
        alike = tuple(
            k for k in named if k not in selected and as_good(channel.fit([*others, k]), joint, channel.energy)
        )
        gain = float((before.squares - after.squares).sum()) / total
        rows.append(KindShare(kind, channel.share(channel.base, alone[kind]), gain, place, alike))
        before = after
    for kind, fit in alone.items():
        if kind not in selected:
            gain = channel.share(joint, channel.fit([*selected, kind])).share
            rows.append(KindShare(kind, channel.share(channel.base, fit), gain, None, ()))
    rows.sort(key=lambda row: (row.kind is Kind.PAST, -row.alone.share))
    told = {kind: channel.factors_of(kind, alone[kind].prediction) for kind in PRODUCTS if kind in alone}
    factors = {kind: names for kind, names in told.items() if names}
    # all columns at once cost more than they tell where there are few blocks
    whole = max((channel.whole_share(f) for f in (selection.everything, joint)), key=lambda s: s.share)
    return ChannelShares(
        channel=name,
        rms=float(np.sqrt(total / usable.sum())),
        axes=channel.axes,
        constant=float((channel.energy - channel.mean.squares).sum() / total),
        numbers=float((channel.mean.squares - channel.base.squares).sum() / total),
        kinds=tuple(rows),
        total=whole,
        rest=1 - whole.share,
        rest_own_past=next(row.additional for row in rows if row.kind is Kind.PAST),
        spikes=spikes,
        periods=channel.periods,
        residual=np.where(usable, channel.y, np.nan),
        predictions={kind: np.where(usable, fit.prediction, np.nan) for kind, fit in alone.items()},
        pitch_unit=channel.pitch_unit,
        factors=factors,
    )
