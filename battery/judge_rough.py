"""Judges cases where the world is rough: is the dominant cause first, at its place, with its share, and nothing false above it?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from battery.accepted import in_si, is_right, place_is_right
from battery.plant_hexapod import COMPONENTS

# Events, lines and slow or periodic curves: each fits something of whatever is left.
ARTEFACTS = (
    "force_step",
    "sensor_step",
    "sensor_step_per_record",
    "lost_beams",
    "stuck",
    "vibration",
    "drift",
    "drift_per_record",
    "degradation",
    "cyclic",
    "raised_point",
    "stitching_error",
)
NEAR = 0.05  # a share is right within five points
EQUAL = 0.1  # dominant causes whose shares differ by less may come in either order


@dataclass(frozen=True)
class Rough:
    """One case. `first`: the finding with the largest share is a dominant cause; `in_set`: it or an alternative of it is; `place`:
    it stands where a dominant cause is; `share`: the largest cause is named, its share within five points; `artefact`: one that
    nobody planted stands above a dominant cause; `nothing_beside`: every finding was planted; `answered`: the verdict is partly or
    explained; `over_best`: held-out error over the least possible."""

    first: bool = False
    in_set: bool = False
    place: bool = False
    share: bool = False
    artefact: bool = False
    nothing_beside: bool = False
    answered: bool = False
    over_best: float | None = None


def judge_rough(answer: dict[str, Any], diagnosis: dict[str, Any]) -> Rough:
    """The judgement of a messy case, or of one with memory."""
    truths, small = as_weighed(answer, diagnosis), answer["background"]
    findings, dominant = by_share(diagnosis), leading(truths)
    first = findings[0] if findings else None
    named = first is not None and any(_right(first, t) for t in dominant)
    rivals = [] if first is None else [first, *first.get("alternatives", [])]
    largest = next((f for f in findings if _right(f, truths[0])), None)
    return Rough(
        first=named,
        in_set=any(_right(r, t) for r in rivals for t in dominant),
        place=first is not None and any(all(place_is_right(first.get("location", ""), t)) for t in dominant),
        share=largest is not None and any(abs(share_of(largest) - truths[0][key]) <= NEAR for key in SHARES),
        artefact=_artefact_above(findings, truths, small),
        nothing_beside=all(any(_right(f, t) for t in [*truths, *small]) for f in findings),
        answered=diagnosis["verdict"] in {"partly", "explained"},
        over_best=over_best(answer, diagnosis),
    )


SHARES = ("share", "share_varying")  # with each record's zero point counted as mismatch, and without: both are right


def as_weighed(answer: dict[str, Any], diagnosis: dict[str, Any]) -> list[dict[str, Any]]:
    """The planted causes, the largest share first. Where nobody states the noise of readings in two units, a share of all of them
    depends on how the units count beside each other: they count by what the diagnosis says of each."""
    planted, errors = answer["planted"], diagnosis.get("held_out", {})
    channels = [f"reading.{name}" for name in COMPONENTS]
    if not set(channels) <= set(errors) or any(errors[c].get("counts_as") is None for c in channels):
        return planted
    counts = np.array([in_si(errors[c]["counts_as"], errors[c]["unit"]) for c in channels])
    noise = np.repeat([answer["noise"]["sd"][0], 1e-6 * answer["noise"]["sd"][1]], 3)  # [rad, um]
    weights = (noise / counts) ** 2
    both = zip(SHARES, ("parts", "parts_varying"), ("before_parts", "before_parts_varying"), strict=True)
    shares = {
        key: [float(weights @ t[parts] / (weights @ answer[before])) for t in planted] for key, parts, before in both
    }
    weighed = [t | {key: of[k] for key, of in shares.items()} for k, t in enumerate(planted)]
    return sorted(weighed, key=lambda t: -t["share"])


def by_share(diagnosis: dict[str, Any]) -> list[dict[str, Any]]:
    """The findings, that with the largest share first."""
    return sorted(diagnosis.get("findings", []), key=share_of, reverse=True)


def leading(truths: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The dominant causes that may stand first."""
    return [t for t in truths if any(t[key] > max(u[key] for u in truths) - EQUAL for key in SHARES)]


def share_of(finding: dict[str, Any]) -> float:
    """Of a finding; none counts as least."""
    share = finding.get("share")
    return -np.inf if share is None or share["value"] is None else float(share["value"])


def _right(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    return is_right(finding["effect"], finding.get("location", ""), truth)


def _artefact_above(findings: list[dict[str, Any]], truths: list[dict[str, Any]], small: list[dict[str, Any]]) -> bool:
    """Whether an artefact that is not among the laws planted has a larger share than a dominant cause, or one is not named."""
    false = [f for f in findings if f["effect"] in ARTEFACTS and not any(_right(f, t) for t in [*truths, *small])]
    real = [max((share_of(f) for f in findings if _right(f, t)), default=-np.inf) for t in truths]
    return any(share_of(f) > min(real) for f in false)


def over_best(answer: dict[str, Any], diagnosis: dict[str, Any], key: str = "rms_after") -> float | None:
    """Held-out error with the findings over that of a model with the dominant causes exact; all channels, over the noise."""
    if "sd" not in answer.get("noise", {}):
        return None
    sd = np.atleast_1d(answer["noise"]["sd"])
    squares = []
    for channel, error in diagnosis.get("held_out", {}).items():
        noise = sd[0] if len(sd) == 1 or ".theta" in channel else 1e-6 * sd[1]  # [m], or [rad, um]
        if error[key] is not None:
            squares.append((in_si(error[key], error["unit"]) / noise) ** 2)
    return float(np.sqrt(np.mean(squares) / (answer.get("least_error", 0.0) ** 2 + 1))) if squares else None
