"""The quantities of a motion along which a region is sought, and what a region found suggests to the laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ctrlgen.diagnosis.selection.regions import Region
from ctrlgen.diagnosis.settings import REGIONS
from ctrlgen.effects import Place, Side
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, nominal_physics
from ctrlgen.model.effect_terms import channels

Along = tuple[str, Place | None, int]
"""A quantity: position, the same between two ends (stretch), distance from home, speed or size of the drive at a place and its channel;
time or temperature."""


def motion_of(
    fitter: Fitter, fit: Fit, signals: Sequence[Mapping[tuple[Place, int], np.ndarray]]
) -> dict[Along, np.ndarray]:
    """Every quantity (n,) over the records to fit of a time series; `signals` by place of each record as of `signals_along`."""
    records = fitter.fit_records
    if fitter.recording.kind == "poses" or not records:
        return {}
    along: dict[Along, np.ndarray] = {("time", None, 0): np.concatenate([r.time for r in records])}
    if all(r.ambient is not None for r in records):
        along["temperature", None, 0] = np.concatenate([r.ambient for r in records if r.ambient is not None])
    for place, i in signals[0]:
        value, displacement, velocity, _ = np.hstack([record[place, i] for record in signals])
        if place is Place.DRIVE:
            along["drive", place, i] = np.abs(value)
        if place is Place.FORCE:
            along["position", place, i], along["distance", place, i] = displacement, np.abs(displacement)
            along["stretch", place, i] = displacement
            along["speed", place, i] = np.abs(velocity)
    names = [c.name for c in channels(nominal_physics(fit.structure.device), Place.SENSOR)]
    for i, channel in enumerate(fitter.recording.channels):
        if (name := channel.removeprefix("reading.")) in names:
            read = np.concatenate([np.where(r.valid[:, i], r.observed[:, i], 0.0) for r in records])
            along["position", Place.SENSOR, names.index(name)] = along["stretch", Place.SENSOR, names.index(name)] = (
                read
            )
    return along


def on_either_side(motion: Mapping[Along, np.ndarray]) -> dict[Along, tuple[Region, ...]]:
    """By quantity of `motion` what lies beyond each of a few quantiles of it, on either side: where an edge may be that no residual
    shows, since a law which acts nearly everywhere, or leaves motion that rings on, is loud everywhere."""
    return {
        key: tuple(
            Region(low, high, 0.0)
            for edge in np.unique(np.quantile(x, REGIONS.edges)).tolist()
            for low, high in ((edge, np.inf), (-np.inf, edge))
        )
        for key, x in motion.items()
        # a stretch has two ends
        if key[0] != "stretch" and key[1] is not Place.SENSOR and np.ptp(x) > 0
    }


def _moved(place: Place) -> Place:
    """The place whose axis moves as that of a law at `place`."""
    return Place.FORCE if place is Place.DISPLACEMENT else place


def suggested(regions: Mapping[Along, tuple[Region, ...]], place: Place, i: int) -> dict[str, tuple[float, ...]]:
    """What the regions found suggest to laws at one place, by the names of `ParameterPrior.start_from_data`."""

    moved = _moved(place)

    def at(quantity: str, where: Place | None = moved, index: int = i) -> tuple[Region, ...]:
        return regions.get((quantity, where, index), ())

    def beyond(found: tuple[Region, ...]) -> tuple[float, ...]:
        return tuple(region.low for region in found if np.isinf(region.high))

    above = beyond(at("position"))
    below = tuple(region.high for region in at("position") if np.isinf(region.low))
    stretches = at("stretch")
    return {
        "since": beyond(at("time", None, 0)),
        "warmer": beyond(at("temperature", None, 0)),
        "edges_above": above,
        "edges_below": below,
        "edges_outward": (*(x for x in above if x > 0), *(x for x in below if x < 0)),
        "edges_beyond": beyond(at("distance")),
        "speeds": beyond(at("speed")),
        "drives": beyond(at("drive")),
        "middles": tuple((r.low + r.high) / 2 for r in stretches),
        "lengths": tuple(r.high - r.low for r in stretches),
    }


def along_region(motion: Mapping[Along, np.ndarray], fit: Fit, k: int) -> np.ndarray | None:
    """The quantity (n,) [SI] of whose region the law of cause k is; None where the records do not show it, and for laws that act
    everywhere."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER or (where := cause.law.acts_in) is None:
        return None
    place: Place | None = _moved(cause.law.place)
    i = cause.acts_on(fit.structure.device)[0]
    if where.quantity in ("time", "temperature"):
        place, i = None, 0
    return motion.get((where.quantity, place, i))


def no_region(motion: Mapping[Along, np.ndarray], fit: Fit, k: int) -> str | None:
    """Why cause k does not act in a region alone: the records lie wholly inside it, or outside; None where they do not, and for laws that
    act everywhere."""
    cause = fit.structure.causes[k]
    if cause.effect == PARAMETER or not cause.prior.in_a_region or (where := cause.law.acts_in) is None:
        return None
    x, values = along_region(motion, fit, k), fit.values(k)
    if x is None:
        return None
    edge = values[where.at]
    if where.side is Side.AROUND:
        half = values[where.length] / 2
        inside = np.abs(x - edge) < half
        visited = min(np.mean(x < edge - half), np.mean(x > edge + half))
        # a reading that is off at the end of its scale has no law of one edge
        if cause.law.place is not Place.SENSOR and visited < REGIONS.least_inside:
            return "one of its ends lies beyond all that was recorded, so that nothing tells it from the law beyond one edge"
    elif where.side is Side.BOTH:
        inside = np.abs(x) > edge
    else:
        inside = x < edge if where.side is Side.BELOW else x > edge
    share = float(np.mean(inside))
    if REGIONS.least_inside <= share <= REGIONS.most_inside:
        return None
    return f"{100 * share:.3g} % of the samples are in its region, so that nothing tells it from the law everywhere, or from none"
