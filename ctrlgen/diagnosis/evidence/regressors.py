"""Regressors for an unknown force: dimensionless features of position, velocity, history and drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.settings import REGRESSORS


@dataclass(frozen=True, eq=False)
class Scales:
    """Scales of the features: largest displacement and speed of an axis [SI], largest drives (n_u,), largest time [s], and
    the time constants of the low-pass features [s]."""

    travel: float
    speed: float
    drives: np.ndarray
    time: float
    lags: tuple[float, ...]


def scales_of(to_fit: list[LtvModel], axis: int) -> Scales:
    """Scales of the records to fit for one axis."""
    travel, speed = (
        max(float(np.abs(getattr(a, k)[:, axis]).max()) for a in to_fit) for k in ("displacement", "velocity")
    )
    drives = np.max([np.abs(a.record.drive).max(axis=0) for a in to_fit], axis=0)
    h, longest = to_fit[0].record.sample_time, max(len(a.white) for a in to_fit)
    lags = () if to_fit[0].poses else tuple(np.geomspace(4 * h, longest * h / 3, REGRESSORS.lags))
    time = max(float(np.abs(a.record.time).max()) for a in to_fit)
    return Scales(travel or 1.0, speed or 1.0, np.where(drives > 0, drives, 1.0), time or 1.0, lags)


def features(model: LtvModel, axis: int, size: Scales) -> dict[str, np.ndarray]:
    """Features (n,) of order one by their formula; settled poses have no velocity and no history."""
    d = model.displacement[:, axis] / size.travel
    columns = {"1": np.ones_like(d), "d": d, "d^2": d**2, "d^3": d**3, "d^4": d**4, "d^5": d**5, "|d|": np.abs(d)}
    columns |= {f"max(d - {x:g}, 0)": np.maximum(d - x, 0) for x in REGRESSORS.stops}
    columns |= {f"min(d + {x:g}, 0)": np.minimum(d + x, 0) for x in REGRESSORS.stops}
    for k, u in enumerate((model.record.drive / size.drives).T):
        columns |= {f"u{k + 1}": u, f"u{k + 1}^2": u**2, f"u{k + 1}^3": u**3}
    for k, other in enumerate(model.displacement.T / size.travel):
        if k != axis:
            columns |= {f"d({model.axes[k]})": other, f"d d({model.axes[k]})": d * other}
    if model.poses:
        return columns
    v = model.velocity[:, axis] / size.speed
    columns |= {"v": v, "v|v|": v * np.abs(v), "v^3": v**3, "d v": d * v, "d^2 v": d**2 * v, "|v|": np.abs(v)}
    columns["sign(v)"] = np.tanh(v / REGRESSORS.soft_sign)
    columns["|d| sign(v)"] = np.abs(d) * columns["sign(v)"]
    plays = play(d, np.array(REGRESSORS.plays))
    columns |= {f"play(d, {r:g})": d - p for r, p in zip(REGRESSORS.plays, plays.T, strict=True)}
    for tau in size.lags:
        a = np.exp(-model.record.sample_time / tau)
        for name, x in (("d", d), ("d^2", d**2), ("u1^2", columns["u1^2"])):
            columns[f"lag({name}, {tau:.3g} s)"] = lfilter([0.0, 1 - a], [1.0, -a], x)
    columns["t"] = model.record.time / size.time
    return columns


def play(d: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Play operators p = max(d - r, min(d + r, p)) of half widths r: (n, len(r))."""
    p, out = np.full(len(r), d[0]), np.empty((len(d), len(r)))
    low, high = d[:, None] - r, d[:, None] + r
    for k in range(len(d)):
        p = np.maximum(low[k], np.minimum(high[k], p))
        out[k] = p
    return out
