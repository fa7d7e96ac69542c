"""Sparse regression: an empirical term for a residual that no known effect explains.

Each regressor is propagated through the LTV model of the device to whitened readings S (N, m), and fitted jointly with
the free parameters, r = S a + J delta. Regressors are added by forward selection while the gain exceeds BIC's penalty and
a share of the excess. The term describes the residual; it is not a cause and gets no physical name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.estimation.error_model import ErrorModel
from ctrlgen.diagnosis.estimation.fit import Fit, Fitter
from ctrlgen.diagnosis.estimation.noise import Noise
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.regressors import Scales, features, scales_of
from ctrlgen.diagnosis.settings import SPARSE_REGRESSION


@dataclass(frozen=True)
class EmpiricalTerm:
    """A sum of features at one axis.

    terms: coefficient [unit] by feature; d, v, u stand for position, speed and drives over `travel`, `speed`, `drives` (SI).
    held_out_gain: share of the held-out excess that the term explains.
    """

    label: str
    axis: str
    terms: dict[str, float]
    unit: str
    travel: float
    speed: float
    drives: tuple[float, ...]
    held_out_gain: float


def fit_empirical_term(fitter: Fitter, fit: Fit, models: list[LtvModel], i: int) -> EmpiricalTerm | None:
    """The term at axis `i` for the residual of `fit`; None where none is selected or the held-out excess does not fall."""
    to_fit = [a for a in models if a.record.role == "fit"]
    size = scales_of(to_fit, i)
    parts = [_slopes(fitter.error, a, i, size) for a in to_fit]
    names, S = parts[0][1], np.vstack([values for values, _ in parts])
    corner = np.concatenate([np.tile(fitter.error.corner, len(a.record.valid)) for a in to_fit])
    S = S * np.minimum(1.0, corner / np.maximum(np.abs(fit.residual[: len(S)]), 1e-300))[:, None]  # as in the fit
    scale = np.linalg.norm(fit.J, axis=0)
    scale[scale == 0] = 1.0
    J, n = fit.J / scale, len(S)  # the rows below the n readings are the prior, in which no regressor appears
    into = np.linalg.pinv(J.T @ J, rcond=1e-12) @ (J[:n].T @ S)
    G = S.T @ S - (J[:n].T @ S).T @ into
    c = S.T @ fit.residual[:n] - into.T @ (J.T @ fit.residual)
    a = _sparse(np.diag(S.T @ S), G, c, max(fit.chi2 - fit.n, 0.0), int(fit.n))
    if not np.any(a):
        return None
    delta = (into @ a / scale)[: len(fit.theta)]
    held = [
        _held(fitter, fit, h, _slopes(fitter.noise, h, i, size)[0] @ a, delta) for h in models if h.record.role != "fit"
    ]
    before, after = (sum(part) for part in zip(*held, strict=True))
    if not (before > 0 and 1 - after / before > SPARSE_REGRESSION.least_share):
        return None
    unit = models[0].units[i]
    terms = {name: float(difference(value, unit)) for name, value in zip(names, a, strict=True) if value}
    drives = tuple(float(u) for u in size.drives)
    return EmpiricalTerm(
        "empirical", models[0].axes[i], terms, unit, size.travel, size.speed, drives, float(1 - after / before)
    )


def _slopes(noise: Noise | ErrorModel, a: LtvModel, i: int, size: Scales) -> tuple[np.ndarray, list[str]]:
    """Whitened readings per unit [SI] of each regressor (n * n_y, m), and the regressors' names."""
    given = features(a, i, size)
    y = a.readings(np.column_stack(list(given.values())), np.full(len(given), i))
    return np.nan_to_num(noise.whiten(y, a.record.valid).reshape(-1, len(given))), list(given)


def _sparse(squares: np.ndarray, G: np.ndarray, c: np.ndarray, excess: float, n: int) -> np.ndarray:
    """Coefficients (m,) by forward selection, zero where a regressor was not chosen.

    G (m, m), c (m,): inner products of the regressors, projected off the free parameters, with one another and with the
    residual; squares (m,): of the regressors before projection; n: usable samples.
    """
    size = np.sqrt(np.where(squares > 0, squares, 1.0))
    G, c = G / np.outer(size, size), c / size
    chosen: list[int] = []
    explained, need = 0.0, max(SPARSE_REGRESSION.least_gain + np.log(max(n, 2)), SPARSE_REGRESSION.least_share * excess)
    while len(chosen) < SPARSE_REGRESSION.most_terms:
        gains = np.full(len(c), -np.inf)
        for j in range(len(c)):
            trial = [*chosen, j]
            if j not in chosen and np.linalg.eigvalsh(G[np.ix_(trial, trial)])[0] > SPARSE_REGRESSION.own_share:
                gains[j] = c[trial] @ np.linalg.solve(G[np.ix_(trial, trial)], c[trial]) - explained
        best = int(np.argmax(gains))
        if not gains[best] > need:
            break
        chosen.append(best)
        explained += gains[best]
    a = np.zeros(len(c))
    if chosen:
        a[chosen] = np.linalg.solve(G[np.ix_(chosen, chosen)], c[chosen])
    return a / size


def _held(fitter: Fitter, fit: Fit, held: LtvModel, term: np.ndarray, delta: np.ndarray) -> tuple[float, float]:
    """Excess squares of one held-out record without the term and with it; the initial state is refitted."""
    simulator = fit.structure.simulators(fitter.recording, fitter.cache)[held.record.timing]
    slopes = simulator.sensitivities(held.record, fit.theta)[1]
    Y = np.nan_to_num(fitter.noise.whiten(slopes, held.record.valid)).reshape(
        held.record.valid.size, -1 if slopes.size else 0
    )
    r = held.white.ravel()
    # fit.J is the derivative of the residual, so the parameters move by +delta where the term takes over their part
    changed = r - term - Y[:, : len(delta)] @ delta
    starts = Y[:, len(delta) :] * held.start_sd[held.start_sd > 0][None, : Y.shape[1] - len(delta)]
    with_prior = np.vstack([starts, np.eye(starts.shape[1])])
    x = np.linalg.lstsq(with_prior, np.concatenate([changed, np.zeros(starts.shape[1])]), rcond=None)[0]
    changed = changed - starts @ x
    n = float(held.usable.sum())
    return float(r @ r) - n, max(float(changed @ changed) - n, 0.0)
