"""Judges regions, gaps, spikes, what stands beside the truth, and whether the model-free shares point to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from battery.accepted import EVIDENCE, is_right
from battery.judge_rough import by_share, leading, over_best, share_of
from battery.region import Region, edges_covered, overlap, stated

ENOUGH = 0.8  # overlap of a region that is found
MOVING = 0.02  # of the rms speed: slower, a direction says nothing
FALSE = 0.05  # share from which on a false name counts
WORSE = 1.01  # held-out error after over that before, from which on an answer makes it worse
NEAR_BEST = 1.5  # held-out error over the least possible
ALIKE = 0.005  # by which shares of families may differ that one signal speaks for
TOLD = 0.1  # by which the number of spikes told may differ from those planted


@dataclass(frozen=True)
class Located:
    """A law in a region: whether the first finding is of that `law`, the `overlap` of the region that it states, as text `stated`, and
    whether the interval of each of its ends holds the true one, `edges`."""

    law: bool
    overlap: float
    stated: str
    edges: tuple[bool, ...] = ()

    @property
    def found(self) -> bool:
        """Whether the region is found."""
        return self.overlap >= ENOUGH

    @property
    def f1(self) -> float:
        """Harmonic mean of the share of the stated samples that are in the true region, and of the true ones that are stated: of the
        overlap J it is 2 J/(1 + J)."""
        return 2 * self.overlap / (1 + self.overlap)


@dataclass(frozen=True)
class Evidence:
    """The model-free shares: the `family` with the largest `share`, whether it, or one alike, is a dominant cause's (`right`).

    `named`: the first finding is a dominant cause; `against`: the shares are said to speak against it.
    """

    family: str
    share: float
    right: bool
    named: bool
    against: bool


@dataclass(frozen=True)
class Further:
    """One case. `first`: effect and place of the first finding; `over_best`: held-out error over the least possible, `worse` than before;
    `all_named`: every dominant cause is found, where there are several; `false_name`: one with a share above 5 %; `false_region`:
    a region on a law that acts everywhere, or on none; `spikes`: told over planted."""

    first: tuple[str, str] | None
    over_best: float | None
    worse: bool
    all_named: bool | None
    false_name: bool
    false_region: bool
    located: Located | None
    evidence: Evidence | None
    spikes: float | None


def judge_further(answer: dict[str, Any], diagnosis: dict[str, Any], spare: Sequence[dict[str, Any]]) -> Further:
    """The judgement; `spare`: findings that nobody planted."""
    findings, truths = by_share(diagnosis), answer["planted"]
    after, before = (over_best(answer, diagnosis, key) for key in ("rms_after", "rms_before"))
    first = findings[0] if findings else None
    told = sum(s["count"] for s in diagnosis.get("spikes", {}).values())
    return Further(
        first=(first["effect"], first.get("location", "")) if first else None,
        over_best=after,
        worse=after is not None and before is not None and after > WORSE * before,
        all_named=all(any(_right(f, t) for f in findings) for t in truths) if len(truths) > 1 else None,
        false_name=any(share_of(f) > FALSE for f in spare),
        false_region=any(stated(f) is not None and not any(_right(f, t) for t in truths) for f in findings),
        located=_located(answer, findings) if "region" in answer else None,
        evidence=_evidence(answer, diagnosis, first) if "share" in (truths or [{}])[0] else None,
        spikes=told / answer["hidden_spikes"] if "hidden_spikes" in answer else None,
    )


def _right(finding: Mapping[str, Any], truth: dict[str, Any]) -> bool:
    return is_right(finding["effect"], finding.get("location", ""), truth)


def _located(answer: dict[str, Any], findings: Sequence[dict[str, Any]]) -> Located:
    """Of the first finding that is right; a law everywhere is in a region of all samples."""
    truth, region = answer["planted"][0], Region(**answer["region"])
    hit = next((f for f in findings if _right(f, truth)), None)
    law = hit is not None and hit is findings[0]
    if hit is None:
        return Located(law, 0.0, "")
    found = stated(hit)
    edges = tuple(edges_covered(hit, region))
    return Located(
        law, agreement(region, found, answer["samples"]), "everywhere" if found is None else str(found), edges
    )


def agreement(true: Region, found: Region | None, samples: Mapping[str, Mapping[str, Any]]) -> float:
    """Overlap of the regions on the held-out record; on all records for time, and only where it moves for a direction."""
    quantities = {true.of, found.of if found else true.of}
    roles = ("fit", "hold_out") if "time" in quantities else ("hold_out",)
    at = {of: np.concatenate([samples[role][of] for role in roles]) for of in samples["hold_out"]}
    if "temperature" in at:
        at["rise"] = at["temperature"] - np.mean(samples["fit"]["temperature"])
    if found is not None and not found.measured(at):
        return 0.0
    keep = np.ones(len(at["time"]), bool)
    if "velocity" in quantities:
        keep = np.abs(at["velocity"]) > MOVING * np.sqrt(np.mean(np.square(at["velocity"])))
    inside = keep if found is None else found.mask(at) & keep
    return overlap(true.mask(at) & keep, inside)


def _evidence(answer: dict[str, Any], diagnosis: dict[str, Any], first: dict[str, Any] | None) -> Evidence | None:
    families = ((diagnosis.get("shares") or {}).get("before") or {}).get("families") or []
    if not families:
        return None
    first_of = {f["family"] for f in families if f["share"] >= families[0]["share"] - ALIKE}
    truths = leading(answer["planted"])
    kinds = {family for t in truths for family in EVIDENCE.get(t.get("family") or t["name"], ())}
    support = (first or {}).get("support") or {}
    return Evidence(
        family=families[0]["family"],
        share=float(families[0]["share"] or 0.0),
        right=bool(first_of & kinds),
        named=first is not None and any(_right(first, t) for t in truths),
        against=bool(support.get("contradicted")),
    )
