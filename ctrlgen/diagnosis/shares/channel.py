"""One channel's residual, predicted out of block from any kinds of regressor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.ndimage import median_filter

from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.blocks import Blocks
from ctrlgen.diagnosis.shares.cross_validation import (
    Folds,
    FoldsOfChannel,
    OutOfBlock,
    bootstrap_interval,
    standard_error,
    stands_out,
)
from ctrlgen.diagnosis.shares.design import Columns, Design, Kind
from ctrlgen.diagnosis.shares.periodic import line_columns, pitch_columns, strongest_line, strongest_pitch
from ctrlgen.diagnosis.shares.regressors import standardised
from ctrlgen.diagnosis.shares.shares_table import Share
from ctrlgen.diagnosis.shares.signals import Signals


class ChannelSmoothers:
    """The smoothers of one channel.

    parts: its residual (n,) a record, NaN where not valid. numbers: the sensitivities (N, k) by the device's free numbers.
    sample_time [s]: infinite for settled poses. rates: of the predicted reading (N, r), see `rates_of`.
    `mean` and `base` are the predictions by the mean, and by the mean with the numbers where these say more than chance.
    """

    def __init__(
        self,
        parts: Sequence[np.ndarray],
        design: Design,
        common: Folds,
        axes: frozenset[str],
        numbers: np.ndarray,
        sample_time: float,
        rates: np.ndarray,
    ) -> None:
        self.design, self.common, self.axes, self.sample_time = design, common, axes, sample_time
        self.blocks: Blocks = common.blocks
        self.rates = rates
        self.parts = [np.nan_to_num(part) for part in parts]
        self.y = self.blocks.drawn(self.parts)
        self.energy = self.blocks.sums(np.where(common.usable, self.y**2, 0.0))
        self.every_fold = np.tile(self.y, (common.count, 1))
        self.kinds = design.kinds(axes)
        self.fitted: dict[tuple[frozenset[Kind], int], OutOfBlock] = {}
        numbers = standardised(numbers)[:, np.ptp(numbers, axis=0) > 0]
        extra, self.periods, self.pitch_unit = self._found_in_residual()
        self.folds = common.with_columns([np.column_stack([numbers, *one.values()]) for one in extra])
        first = design.X.shape[1]
        self.free = np.arange(first, first + numbers.shape[1])
        first += numbers.shape[1]
        for kind, columns in extra[0].items():
            self.kinds[kind] = np.arange(first, first + columns.shape[1])
            first += columns.shape[1]
        self.mean = mean_or_zero(self.folds, self.y, self.energy)
        self.refitted = self.fit([])
        self.base = self.refitted if stands_out(self.mean.squares - self.refitted.squares) else self.mean

    def without_numbers(self) -> ChannelSmoothers:
        """The same without the device's numbers beside its kinds."""
        bare = copy(self)
        bare.free = self.free[:0]
        bare.base = bare.refitted = self.mean
        return bare

    def fit(self, kinds: Iterable[Kind], targets: np.ndarray | None = None) -> OutOfBlock:
        """The residual, or `targets` (folds, N), from the columns of some kinds and the mean; with the device's numbers beside
        them where that predicts better."""
        chosen = frozenset(kinds)
        alone = self._fit(chosen, targets, self.free[:0])
        if not len(self.free):
            return alone
        return min(alone, self._fit(chosen, targets, self.free), key=lambda f: f.squares.sum())

    def _fit(self, kinds: frozenset[Kind], targets: np.ndarray | None, free: np.ndarray) -> OutOfBlock:
        """The fit of a set of kinds beside the columns `free`; those of the residual itself are kept."""
        key = kinds, len(free)
        if targets is None and key in self.fitted:
            return self.fitted[key]
        columns = [self.kinds[kind] for kind in self.kinds if kind in kinds]
        chosen = np.concatenate(columns) if columns else np.zeros(0, int)
        prediction = self.folds.fit(chosen, self.every_fold if targets is None else targets, free)
        if targets is None:
            self.fitted[key] = prediction
        return prediction

    def says_more(self, before: OutOfBlock, after: OutOfBlock) -> bool:
        """Whether a prediction says more than another one, and more than the mean and the numbers, which stand beside every
        kind, and that not by chance."""
        others = [before] if before.squares.sum() <= self.refitted.squares.sum() else [before, self.refitted]
        return all(stands_out(other.squares - after.squares) for other in others)

    def share(self, before: OutOfBlock, after: OutOfBlock) -> Share:
        """The share that one prediction has beyond another, 0 where chance could show it."""
        return share_of(before.squares - after.squares, self.energy, self.says_more(before, after))

    def whole_share(self, after: OutOfBlock) -> Share:
        """The share that a prediction has with all that it stands beside, mean and numbers, 0 where chance could show it."""
        gain = self.energy - after.squares
        return share_of(gain, self.energy, stands_out(gain))

    def factors_of(self, kind: Kind, prediction: np.ndarray) -> tuple[str, ...]:
        """What the two signals are called of the one product that makes up most of a `prediction` (N,) by products of this kind; nothing
        where none does."""
        usable = self.common.usable
        p = prediction[usable] - np.mean(prediction[usable])

        def part(block: Columns) -> float:
            x = block.values[usable, 0] - np.mean(block.values[usable, 0])
            return float((x @ p) ** 2 / max(float((x @ x) * (p @ p)), 1e-300))

        best = max(self.design.of_kind(kind, self.axes), key=part, default=None)
        return best.factors if best is not None and part(best) > SHARES.one_product else ()

    def _found_in_residual(self) -> tuple[list[dict[Kind, np.ndarray]], dict[Kind, float], str]:
        """The columns of own past, pitch and line of each fold, the median of the folds' periods, and the unit of the axis of the pitch."""
        extra: list[dict[Kind, np.ndarray]] = []
        lines: list[float] = []
        # by axis: a turn and a way have no median
        pitches_of: dict[int, list[float]] = {}
        past, along = self._past(), list(self.design.of_kind(Kind.POSITION, self.axes))
        positions = [block.abscissa for block in along]
        without = self.every_fold
        # the trend with position would pass for a long pitch
        if positions:
            plain = self.common.with_columns([np.empty((len(self.y), 0))] * self.common.count)
            without = plain.left(plain.fit(self.kinds[Kind.POSITION], self.every_fold), self.every_fold)
        longest = max(map(len, self.parts))
        rates = {Kind.RATE: standardised(self.rates)} if self.rates.size else {}
        for k in range(self.common.count):
            columns = {Kind.PAST: past, **rates}
            if positions and len(self.y) > 8 * SHARES.longest_pitch:
                y = np.where(self.common.train[k], without[k], 0.0)
                spacings = [strongest_pitch(x, y) for x in positions]
                pitches = [standardised(pitch_columns(x, p)) for x, p in zip(positions, spacings, strict=True)]
                best = int(np.argmax([np.sum((c.T @ y) ** 2) for c in pitches]))
                columns[Kind.PITCH] = pitches[best]
                pitches_of.setdefault(best, []).append(spacings[best])
            if np.isfinite(self.sample_time) and longest > 4 * SHARES.line_periods:
                frequency = strongest_line(self._without_fold(k))
                columns[Kind.LINE] = line_columns(self.blocks.rows, frequency)
                lines.append(self.sample_time / frequency)
            extra.append(columns)
        # the axis of most folds
        axis = max(pitches_of, key=lambda i: len(pitches_of[i]), default=None)
        found = {Kind.PITCH: [] if axis is None else pitches_of[axis], Kind.LINE: lines}
        periods = {kind: float(np.median(values)) for kind, values in found.items() if values}
        return extra, periods, "" if axis is None else along[axis].unit

    def _without_fold(self, k: int) -> list[np.ndarray]:
        """The residual (n,) of every record at its own rate about its mean, zero in fold k."""
        out = []
        for i, (part, rows) in enumerate(zip(self.parts, self.blocks.rows, strict=True)):
            fold = self.blocks.fold[self.blocks.record == i]
            kept = fold[np.searchsorted(rows, np.arange(len(part))).clip(max=len(rows) - 1)] != k
            out.append(np.where(kept, part - part[kept].mean(), 0.0) if kept.any() else np.zeros_like(part))
        return out

    def _past(self) -> np.ndarray:
        """The residual some samples before (N, lags), zero before the first one."""
        columns = []
        for lag in SHARES.past:
            shifted = [np.concatenate([np.zeros(min(lag, len(p))), p[:-lag]])[: len(p)] for p in self.parts]
            columns.append(self.blocks.drawn(shifted))
        return standardised(np.column_stack(columns))


def share_of(gain: np.ndarray, energy: np.ndarray, shown: bool = True) -> Share:
    """The share of a decrease of the squares by block (B,) with its interval; zero unless `shown`."""
    total, (low, high) = float(energy.sum()), bootstrap_interval(gain, energy)
    if shown and total > 0:
        return Share(float(gain.sum()) / total, (low, high))
    return Share(0.0, (0.0, high))


def rates_of(signals: Sequence[Signals], channel: str, blocks: Blocks) -> np.ndarray:
    """First and second derivative (N, 2) of the predicted reading of a channel, by which it changes when it comes late or goes
    through a filter; none for settled poses or where no reading is given."""
    if signals[0].settled or any(channel not in s.reading for s in signals):
        return np.empty((sum(map(len, blocks.rows)), 0))
    first = [s.derivative(s.reading[channel]) for s in signals]
    second = [s.derivative(values) for s, values in zip(signals, first, strict=True)]
    return np.column_stack([blocks.drawn(first), blocks.drawn(second)])


@dataclass(frozen=True, eq=False)
class Selection:
    """The selected kinds of a `channel` in the order in which each adds most, their `joint` prediction and that of all kinds."""

    channel: ChannelSmoothers
    kinds: list[Kind]
    joint: OutOfBlock
    everything: OutOfBlock


def select_kinds(channel: ChannelSmoothers, kinds: Sequence[Kind]) -> Selection:
    """The kinds that say most. Where other values of the device's numbers would take away much that their stated deviations
    do not allow, these stand in for physics: they are left out where the kinds predict as well without them."""
    selection = forward_selection(channel, kinds)
    if channel.base is channel.mean:
        return selection
    bare = forward_selection(channel.without_numbers(), kinds)
    return bare if as_good(bare.joint, selection.joint, channel.energy) else selection


def forward_selection(channel: ChannelSmoothers, kinds: Sequence[Kind]) -> Selection:
    """Selected kinds, each beside those before it.

    The record comes after all others: a constant for each record stands in for whatever differs between them, such as the
    direction of motion where each moves one way.
    """
    chosen: list[Kind] = []
    now, everything = channel.base, channel.fit(kinds)
    for offered in ([kind for kind in kinds if kind is not Kind.RECORD], kinds):
        chosen, now = _selected(channel, offered, everything, chosen, now)
    return Selection(channel, _in_order(channel, chosen), now, everything)


def _selected(
    channel: ChannelSmoothers, kinds: Sequence[Kind], everything: OutOfBlock, chosen: list[Kind], now: OutOfBlock
) -> tuple[list[Kind], OutOfBlock]:
    """The selection that goes on from `chosen`, which predict `now`.

    The kinds that predict best what the selected ones leave are tried jointly with these, and the simplest of the good ones
    is taken, until it adds less than `SHARES.least_gain`. Where none adds that much although all kinds together say more,
    pairs are tried: a function of place and one of the direction may show only together. After each step a kind that
    contains what others say, as the history of travel contains direction and position, gives way to a simpler one, or to none.
    """
    while len(chosen) < SHARES.most_steps and (left := [kind for kind in kinds if kind not in chosen]):
        remains = channel.folds.left(now, channel.every_fold)
        # to rank them
        alone = {kind: channel.without_numbers().fit([kind], remains).squares.sum() for kind in left}
        ranked = sorted(left, key=lambda kind: alone[kind])
        many = sum(map(len, channel.kinds.values())) > SHARES.many_columns
        few = SHARES.joint_candidates if many and chosen else None
        added = _best_addition(channel, chosen, now, [(kind,) for kind in ranked[:few]])
        if not added and channel.says_more(now, everything):
            several = SHARES.paired_candidates if many else None
            added = _best_addition(channel, chosen, now, list(combinations(ranked[:several], 2)))
        trial = _simplified(channel, [*chosen, *added], left) if added else chosen
        after = channel.fit(trial)
        # nothing was added, or gave way to what was there before
        if after.squares.sum() >= now.squares.sum():
            break
        chosen, now = trial, after
    return chosen, now


def _best_addition(
    channel: ChannelSmoothers, chosen: Sequence[Kind], now: OutOfBlock, trials: Sequence[tuple[Kind, ...]]
) -> tuple[Kind, ...]:
    """The simplest good one of some sets of kinds beside those chosen; none where none adds `SHARES.least_gain`."""
    least = SHARES.least_gain * float(channel.energy.sum())
    fits = {trial: channel.fit([*chosen, *trial]) for trial in trials}
    good = {
        trial: fit
        for trial, fit in fits.items()
        if (now.squares - fit.squares).sum() >= least and channel.says_more(now, fit)
    }
    return simplest(good, channel.energy) if good else ()


def simplest(fits: dict[tuple[Kind, ...], OutOfBlock], energy: np.ndarray) -> tuple[Kind, ...]:
    """Of the sets of kinds within one standard error of the best, the first in the order of `Kind`, by the last of each set."""
    best = min(fits.values(), key=lambda f: f.squares.sum())
    order = list(Kind).index
    alike = [trial for trial, fit in fits.items() if as_good(fit, best, energy)]
    return min(alike, key=lambda trial: sorted((order(kind) for kind in trial), reverse=True))


def _simplified(channel: ChannelSmoothers, chosen: list[Kind], left: Sequence[Kind]) -> list[Kind]:
    """The selected kinds without those that the others make needless, or with simpler ones in their place."""
    order = list(Kind).index
    for kind in list(chosen):
        others, now = [k for k in chosen if k is not kind], channel.fit(chosen)
        simpler = [k for k in left if order(k) < order(kind) and k not in chosen]
        trials = [others] * bool(others) + [[*others, k] for k in simpler]
        chosen = next((trial for trial in trials if as_good(channel.fit(trial), now, channel.energy)), chosen)
    return chosen


def _in_order(channel: ChannelSmoothers, chosen: Sequence[Kind]) -> list[Kind]:
    """The selected kinds in the order in which each adds most."""
    ordered: list[Kind] = []
    now = channel.base
    while left := [kind for kind in chosen if kind not in ordered]:
        best = _best_addition(channel, ordered, now, [(kind,) for kind in left])
        ordered += best or [min(left, key=lambda kind: channel.fit([*ordered, kind]).squares.sum())]
        now = channel.fit(ordered)
    return ordered


def as_good(one: OutOfBlock, best: OutOfBlock, energy: np.ndarray) -> bool:
    """Whether one prediction is within `SHARES.alike` standard errors of the best, or within what does not matter."""
    more = one.squares - best.squares
    return bool(more.sum() <= max(SHARES.alike * standard_error(more), SHARES.least_gain * energy.sum()))


def mean_or_zero(folds: FoldsOfChannel, y: np.ndarray, energy: np.ndarray) -> OutOfBlock:
    """The prediction by the mean out of block, or by zero where that is nearer, as it is for a drift about zero."""
    mean = folds.constant(y)
    if mean.squares.sum() <= energy.sum():
        return mean
    nothing = np.zeros(0)
    return OutOfBlock(np.zeros_like(y), energy, mean.columns, tuple((nothing, 0.0) for _ in mean.models))


def without_spikes(parts: list[np.ndarray]) -> list[np.ndarray]:
    """Residuals (n,) a record with isolated samples far from the median of their neighbours set to NaN, where these are rare.

    F. R. Hampel's identifier, J. Am. Stat. Assoc. 69 (1974) 383, with one deviation for all samples.
    """
    away = [np.abs(p - median_filter(np.nan_to_num(p), SHARES.spike_window, mode="nearest")) for p in parts]
    size = SHARES.spike * 1.4826 * float(np.nanmedian(np.concatenate(away)))
    far = [a > size for a in away]
    if not 0 < np.mean(np.concatenate(far)) <= SHARES.most_spikes:
        return parts
    return [np.where(f, np.nan, p) for p, f in zip(parts, far, strict=True)]
