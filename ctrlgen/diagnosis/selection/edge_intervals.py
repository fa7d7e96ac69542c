"""Intervals of the edges of regions: wider than a fit of the law in its own form says.

A law that grows from nothing at its edge, as F = k s does of the depth s beyond it, is not quite of that form. With a relative error e of
the form, in the root mean square over the depths that the records visit,

    F = k (s + g s^2),   g = e rms(s)/rms(s^2),   s^2 = b s + c in the least squares:   the edge moves by g |c|.

Between two places that are visited an edge is told by nothing but the form of its law: there a fit is smooth, and its curvature says too
much. The interval of an edge therefore ends at a visited place on either side.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import difference, from_si
from ctrlgen.diagnosis.selection.candidate_terms import signals_along
from ctrlgen.diagnosis.selection.motion_regions import Along, along_region, motion_of
from ctrlgen.effects import Place, Side
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.estimation.settings import STATISTICS

Ends = tuple[float, float]
FEWEST = 3  # depths of which a parabola differs from a line


def edge_intervals(fitter: Fitter, fit: Fit, intervals: dict[str, Ends]) -> dict[str, Ends]:
    """Of the 95 % `intervals` of the free numbers of a fit by path, in their units, those of edges, widened."""
    wide: dict[str, Ends] = {}
    motion: dict[Along, np.ndarray] | None = None
    signals = None
    for u, edge in zip(fit.structure.free_parameters, fit.theta.tolist(), strict=True):
        if u.cause is None or (cause := fit.structure.causes[u.cause]).effect == PARAMETER:
            continue
        if (where := cause.law.acts_in) is None or u.name != where.at:
            continue
        signals = signals_along(fitter, fit) if signals is None else signals
        motion = motion_of(fitter, fit, signals) if motion is None else motion
        if (x := along_region(motion, fit, u.cause)) is None:
            continue
        if where.side is Side.OUTWARD and cause.law.place is Place.DRIVE:
            # a level with a sign is beside drives with theirs, of which a motion keeps the size
            i = cause.acts_on(fit.structure.device)[0]
            x = np.concatenate([record[Place.DRIVE, i][0] for record in signals])
        x, ends = np.abs(x) if where.side is Side.BOTH else x, intervals[u.path]
        if not where.over:
            below = where.side is Side.BELOW or (where.side is Side.OUTWARD and edge < 0)
            way = STATISTICS.z_95 * moved_by_form(edge - x if below else x - edge, cause.prior.model_form_error)
            ends = _wider(ends, float(from_si(edge, u.unit)), float(difference(way, u.unit)))
        wide[u.path] = out_to_visited(ends, np.unique(from_si(x, u.unit)))
    return wide


def moved_by_form(depth: np.ndarray, error: float) -> float:
    """How far an edge moves where the form of a law that grows with the `depth` (n,) beyond it, negative before it, is off by `error`."""
    s = depth[depth > 0]
    size = float(np.max(s, initial=0.0))
    if len(np.unique(s)) < FEWEST:
        return size
    s = s / size
    (_, c), *_ = np.linalg.lstsq(np.column_stack([s, np.ones(len(s))]), s**2, rcond=None)
    return float(error * np.sqrt(np.mean(s**2) / np.mean(s**4)) * abs(c) * size)


def _wider(ends: Ends, value: float, way: float) -> Ends:
    """The interval of a value that is also unsure by `way`, whatever it is unsure by alone."""
    low, high = (float(np.hypot(end - value, way)) for end in ends)
    return value - low, value + high


def out_to_visited(ends: Ends, places: np.ndarray) -> Ends:
    """The interval out to the next of the `places`, in order, on either side; as it is on one where none is."""
    low, high = ends
    below, above = np.searchsorted(places, low, side="right"), np.searchsorted(places, high, side="left")
    return (
        float(places[below - 1]) if below > 0 else low,
        float(places[above]) if above < len(places) else high,
    )
