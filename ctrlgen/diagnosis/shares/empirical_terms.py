"""Empirical terms: smoothers of what no law reaches, as effects of the device file.

Where a channel's residual is a function of a displacement, a speed or the last reversals, and no confirmed law takes it away, the
function itself corrects the device inside the range recorded. Its weights c minimise

    |W (e - Y c)|^2 + lambda |c|^2,    Y = d(reading)/dc,

e the residual of the records to fit, W the whitening by noise and discrepancy, lambda by cross-validation. All other numbers
and the initial states stay as found, so that a term takes nothing from a named cause. A term is kept if it takes away more of the
held-out records' blocks than chance would, and a share of what is left there that a reader would be told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.cross_validation import stands_out
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.gather import ResidualShares, gather
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, SharesTable
from ctrlgen.diagnosis.shares.signals import Signals
from ctrlgen.effects import Effect
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import Hypothesis, nominal_physics
from ctrlgen.estimation.misfit import misfit
from ctrlgen.model.effect_terms import available

READING = "reading."


@dataclass(frozen=True, eq=False)
class EmpiricalTerm:
    """One smoother as an effect of the device. `share`: of what was left of `channel` on the held-out records that it takes away,
    of energy beyond noise where that is known; `rms_before`, `rms_after` there [unit]; `kind` of the function."""

    effect: Effect
    channel: str
    kind: Kind
    share: float
    rms_before: float
    rms_after: float
    unit: str


@dataclass(frozen=True, eq=False)
class _Smoother:
    """A law on one axis and the numbers [SI] that it may have but for its weights, one mapping a trial."""

    kind: Kind
    cause: Hypothesis
    trials: tuple[dict[str, float], ...]


def empirical_terms(fitter: Fitter, fit: Fit, shares: ResidualShares | None) -> tuple[EmpiricalTerm, ...]:
    """The terms that the held-out records confirm beside the model `fit`, whose residual has these shares."""
    if shares is None:
        return ()
    terms: list[EmpiricalTerm] = []
    signals = [gather(fitter, fit, record)[1] for record in fitter.fit_records]
    for channel in _worst(fitter, fit, shares.after):
        tried: set[tuple[str, str | None]] = set()
        for smoother in _smoothers(fit, shares.after, channel, signals):
            if (smoother.cause.effect, smoother.cause.of) in tried:
                continue
            tried.add((smoother.cause.effect, smoother.cause.of))
            smoothed = _fitted(fitter, fit, smoother)
            if (term := _confirmed(fitter, fit, smoothed, smoother.kind, channel.channel)) is not None:
                terms.append(term)
                fit = smoothed
    return tuple(terms)


def _worst(fitter: Fitter, fit: Fit, table: SharesTable) -> list[ChannelShares]:
    """The channels of the pose, on which the terms act, whose residual is more than noise, the largest in noise units first."""
    floor = dict(zip(fitter.recording.channels, fitter.noise.floor.tolist(), strict=True))
    pose = {f"{READING}{name}" for name in nominal_physics(fit.structure.device).components}
    size = {c.channel: c.rms / floor[c.channel] for c in table.channels if c.channel in pose}
    far = [c for c in table.channels if size.get(c.channel, 0.0) > SHARES.more_than_noise]
    return sorted(far, key=lambda c: -size[c.channel])[: SHARES.empirical_channels]


def _smoothers(fit: Fit, table: SharesTable, channel: ChannelShares, signals: Sequence[Signals]) -> Iterator[_Smoother]:
    """For each kind that says much of a channel, the law that can hold it, on the axis that says most."""
    offered = available(nominal_physics(fit.structure.device))
    at = channel.channel.removeprefix(READING)
    for row in channel.selected:
        axis = _axis(table, channel, row.kind) if row.additional >= SHARES.told and row.kind in _LAWS else None
        if axis is None:
            continue
        law = Effect.library[_LAWS[row.kind]]
        # of a stage without inertia the direction is what its last reversals leave
        if not law.requires <= offered:
            law = Effect.library["empirical_history"]
        d, v = (np.concatenate(parts) for parts in _position_and_speed(signals, axis))
        ranges: dict[str, list[dict[str, float]]] = {
            "empirical_position": [{"low": float(d.min()), "width": float(np.ptp(d))}],
            "empirical_speed": [{"speed": share * float(np.std(v))} for share in SHARES.turning_speeds],
            "empirical_history": [{"reach": share * float(np.ptp(d))} for share in SHARES.reaches],
        }
        rest = {p.name: 0.0 for p in law.params} | {law.amplitude().name: channel.rms}
        trials = tuple(rest | numbers for numbers in ranges[law.kind])
        # a speed is looked for about those that occur
        time = nominal_physics(fit.structure.device).displacement_scale / (float(np.std(v)) or np.inf) or 1.0
        yield _Smoother(row.kind, Hypothesis(law.kind, f"mechanism:{at}", at, axis, time=time), trials)


def _position_and_speed(signals: Sequence[Signals], axis: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
    return [s.position[axis] for s in signals], [s.speed_of(axis) for s in signals]


_LAWS = {
    Kind.PROPORTION: "empirical_position",
    Kind.POSITION: "empirical_position",
    Kind.OTHER_AXIS: "empirical_position",
    Kind.DRIVE: "empirical_position",
    Kind.DIRECTION: "empirical_speed",
    Kind.SPEED: "empirical_speed",
    Kind.TRAVEL_HISTORY: "empirical_history",
    Kind.DRIVE_HISTORY: "empirical_history",
}


def _axis(table: SharesTable, channel: ChannelShares, kind: Kind) -> str | None:
    """The axis whose columns of one kind, alone and in least squares, leave least of a channel's residual."""
    y = channel.residual
    usable = np.isfinite(y)
    named = {Kind.DRIVE: Kind.POSITION, Kind.DRIVE_HISTORY: Kind.TRAVEL_HISTORY}.get(kind, kind)
    left: dict[str, float] = {}
    for block in table.design.of_kind(named, channel.axes):
        if kind is Kind.OTHER_AXIS and block.kind is not Kind.POSITION:
            continue
        X = np.column_stack([np.ones(usable.sum()), block.values[usable]])
        rest = y[usable] - X @ np.linalg.lstsq(X, y[usable], rcond=1e-8)[0]
        for axis in block.axes:
            left[axis] = min(left.get(axis, np.inf), float(rest @ rest))
    return min(left, key=lambda axis: left[axis]) if left else None


def _fitted(fitter: Fitter, fit: Fit, smoother: _Smoother) -> Fit:
    """The fit with the smoother beside its causes, its weights by ridge regression on the records to fit: the best of its trials."""
    records = fitter.fit_records
    begun = [fitter.begun(fit, r) for r in records]
    e = [np.where(r.valid, r.observed - read, 0.0) for r, (_, read) in zip(records, begun, strict=True)]
    whole = np.nan_to_num(
        np.concatenate([fitter.error.whiten(v, r.valid).ravel() for v, r in zip(e, records, strict=True)])
    )
    corner = np.concatenate([np.tile(fitter.error.corner, len(r.valid)) for r in records])
    # as in a fit, spikes bend nothing
    trust = np.minimum(1.0, corner / np.maximum(np.abs(whole), 1e-300))
    best, least = fit, np.inf
    # one simulator for all trials
    smooth, last = fit.restarted.with_cause(smoother.cause, smoother.trials[0]), len(fit.structure.causes)
    for numbers in smoother.trials:
        structure = smooth.restarted(last, numbers)
        free, theta = structure.free_parameters, structure.start.copy()
        weights = [k for k, p in enumerate(free) if p.cause == last and p.name.startswith("c")]
        slopes = [
            fitter.simulator(structure, r).sensitivities(r, theta, start)[1][:, :, weights]
            for r, (start, _) in zip(records, begun, strict=True)
        ]
        white = [
            fitter.error.whiten(Y, r.valid).reshape(-1, len(weights)) for Y, r in zip(slopes, records, strict=True)
        ]
        X = np.nan_to_num(np.vstack(white))
        # channels and samples that the term moves
        seen = np.abs(X).max(axis=1) > 0
        c, left = ridge_regression(trust[seen, None] * X[seen], trust[seen] * whole[seen])
        if left < least:
            theta[weights] = np.clip(c, [free[k].low for k in weights], [free[k].high for k in weights])
            weighed = smooth.restarted(last, numbers | {free[k].name: float(theta[k]) for k in weights})
            empty = np.zeros(0)
            best = replace(fit, structure=weighed, theta=theta, initial_states=(), residual=empty, J=empty)
            least = left
    return best


def ridge_regression(X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """The weights c (p,) that minimise |y - X c|^2 + lambda |c|^2, and V there; lambda is that of `SHARES.weight_ridges` with the least

        V = |y - X c|^2/(1 - tr H/N)^2,  H = X (X'X + lambda)^-1 X',

    N = |y|^2 the independent samples, as far as y is whitened rightly. G. H. Golub, M. Heath, G. Wahba, Technometrics 21 (1979)
    215: generalised cross-validation.
    """
    values, V = np.linalg.eigh(X.T @ X)
    values, b, best = np.maximum(values, 0.0), V.T @ (X.T @ y), (np.zeros(X.shape[1]), np.inf)
    for ridge in SHARES.weight_ridges:
        c = V @ (b / (values + ridge))
        free = 1 - float(np.sum(values / (values + ridge))) / max(float(y @ y), 1e-300)
        left = float(np.sum((y - X @ c) ** 2)) / max(free, 1e-3) ** 2
        best = min(best, (c, left), key=lambda pair: pair[1])
    return best


def taken_away(before: float, after: float, noise: float) -> float:
    """Of the energy `before` beyond that of the `noise`, zero where it is not known, the share that is not left `after`, one at most: by
    chance less may be left than noise."""
    return min((before - after) / (before - noise), 1.0) if before > noise else 0.0


def _confirmed(fitter: Fitter, before: Fit, after: Fit, kind: Kind, channel: str) -> EmpiricalTerm | None:
    """The term, if the held-out records confirm it."""
    i, records = fitter.recording.channels.index(channel), fitter.held_out_records
    begun = [fitter.begun(before, r) for r in records]
    corrected = [
        fitter.simulator(after.structure, r).simulate(r, after.theta, start)
        for r, (start, _) in zip(records, begun, strict=True)
    ]
    old, new = (
        misfit(fitter.noise, records, [r.observed - y for r, y in zip(records, read, strict=True)])
        for read in ([read for _, read in begun], corrected)
    )
    gain = old.plain[:, i] - new.plain[:, i]
    noise = float(old.n_plain[:, i].sum()) if fitter.noise.known[i] else 0.0
    share = taken_away(float(old.plain[:, i].sum()), float(new.plain[:, i].sum()), noise)
    if share < SHARES.told or not stands_out(gain):
        return None
    unit = fitter.recording.units[i]
    scale = float(fitter.noise.floor[i]) * float(difference(1.0, unit))
    rms = [scale * float(np.sqrt(m.plain_mean[i])) for m in (old, new)]
    effect = after.structure.device_with_causes.effect[-1]
    return EmpiricalTerm(effect, channel, kind, share, rms[0], rms[1], unit)
