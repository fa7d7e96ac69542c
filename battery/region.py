"""Regions of the operating range: which samples they hold, how far two agree, and which one a finding states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from battery.accepted import in_si

Array = np.ndarray
SIZE = " size"


@dataclass(frozen=True)
class Region:
    """Samples whose quantity `of` lies between `low` and `high`, SI. Quantities: position, velocity, drive, temperature, its rise over the
    mean of the record to fit, time on the common clock; `... size`: its size; speed, that of the velocity."""

    of: str
    low: float
    high: float

    def mask(self, samples: Mapping[str, Array]) -> Array:
        """(n,) whether each of the samples is in it; `samples` holds (n,) of position, velocity, drive, temperature and time."""
        x = _quantity(self.of, samples)
        return (x >= self.low) & (x <= self.high)

    def measured(self, samples: Mapping[str, Array]) -> bool:
        """Whether the samples hold its quantity."""
        return _base(self.of) in samples


def _base(of: str) -> str:
    return "velocity" if of == "speed" else of.removesuffix(SIZE)


def _quantity(of: str, samples: Mapping[str, Array]) -> Array:
    x = samples[_base(of)]
    return np.abs(x) if of == "speed" or of.endswith(SIZE) else x


def overlap(a: Array, b: Array) -> float:
    """Samples in both over those in either."""
    either = int((a | b).sum())
    return float((a & b).sum() / either) if either else 1.0


# Ends of the names of effects that act beyond one number of theirs: the quantity, that number, and the side
ENDINGS = {
    "_above": ("position", "edge", 1),
    "_below": ("position", "edge", -1),
    "_after": ("time", "moment", 1),
    "_at_speed": ("speed", "speed", 1),
}
ONE_WAY = 0.5  # skew from which on friction acts in one direction


def stated(finding: Mapping[str, Any]) -> Region | None:
    """The region that a finding states, or None where its law acts everywhere."""
    if finding.get("region"):
        return _told(finding["region"])
    effect = finding["effect"]

    def value(name: str) -> float | None:
        e = finding.get("parameters", {}).get(name)
        return None if e is None or e["value"] is None else in_si(float(e["value"]), e["unit"])

    for ending, (of, number, side) in ENDINGS.items():
        edge = value(number)
        if effect.endswith(ending) and edge is not None:
            return Region(of, edge, np.inf) if side > 0 else Region(of, -np.inf, edge)
    gap, level, place, skew = value("gap"), value("level"), value("position"), value("skew")
    if effect == "end_stop" and gap is not None:
        return Region("position", gap, np.inf) if gap > 0 else Region("position", -np.inf, gap)
    if effect == "saturation" and level is not None:
        return Region("drive size", level, np.inf)
    if effect == "stitching_error" and place is not None:
        return Region("position", place, np.inf)
    if effect == "directional_friction" and skew is not None and abs(skew) > ONE_WAY:
        return Region("velocity", 0.0, np.inf) if skew > 0 else Region("velocity", -np.inf, 0.0)
    return None


def edges_covered(finding: Mapping[str, Any], true: Region) -> list[bool]:
    """Of each end that the finding tells with an interval and that is true: whether the interval holds it; of the same quantity only."""
    entry, found = finding.get("region"), stated(finding)
    if not entry or found is None or found.of != true.of:
        return []
    out = []
    for end, value in (("lower", true.low), ("upper", true.high)):
        interval = entry[end] and entry[end]["ci95"]
        if np.isfinite(value) and interval and None not in interval:
            low, high = (in_si(float(e), entry["unit"]) for e in interval)
            out.append(low <= value <= high)
    return out


def _told(entry: Mapping[str, Any]) -> Region:
    """The region as a finding tells it: `quantity`, whether its `size` is meant, `lower` and `upper` end, `unit`."""
    ends = [
        None if entry[end] is None else in_si(float(entry[end]["value"]), entry["unit"]) for end in ("lower", "upper")
    ]
    low, high = (default if e is None else e for e, default in zip(ends, (-np.inf, np.inf), strict=True))
    of = "rise" if entry["quantity"] == "temperature" else entry["quantity"]
    return Region(of + (SIZE if entry["size"] and of != "speed" else ""), low, high)
