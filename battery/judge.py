"""Compares one diagnosis with one answer: which names, which places, which intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from battery.accepted import ROUGH_TRUTHS, SAME_LAW, TRUTHS, in_si, is_right, place_is_right
from battery.judge_further import Further, judge_further
from battery.judge_rough import Rough, judge_rough

ROUGH = ("messy", "memory", "forms", "regional", "gaps", "spikes")


class Number(NamedTuple):
    """A number of a finding beside the planted one: whether its 95 % interval holds that, and how far `off` it is, relative to it; None
    where zero was planted."""

    law: str
    name: str
    inside: bool
    off: float | None


@dataclass
class Judgement:
    """One case. `named`: (truth, name given or 'none'); its `covered` numbers; `places`: (channel, place) right;
    `bands`: whether a line's frequency lies in the band with the largest excess; `rough`: of messy cases and memory, the latter as
    `series` or poses, `alone` or over a background; `luck`: of each finding whether it is there, and the chance that luck found it;
    `contradictions` within the file; `further`: None where it failed; `set_of` gaps and the `way` in which rows are missing; `cpu` [s]
    and largest `memory` [GB] of the command."""

    case: str
    kind: str
    verdict: str
    exact: bool = False
    in_set: bool = False
    wrong: bool = False
    alarmed: bool = False
    abstained: bool = False
    admitted: bool = False
    named: list[tuple[str, str]] = field(default_factory=list)
    places: list[tuple[bool, bool]] = field(default_factory=list)
    bands: list[bool] = field(default_factory=list)
    covered: list[Number] = field(default_factory=list)
    ratio: float | None = None
    seconds: float | None = None
    autocorrelated: bool = False
    rough: Rough | None = None
    luck: list[tuple[bool, float | None]] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)
    series: bool = True
    alone: bool = True
    further: Further | None = None
    set_of: str | None = None
    way: str | None = None
    cpu: float | None = None
    memory: float | None = None


def _covered(finding: dict[str, Any], truth: dict[str, Any]) -> list[Number]:
    if finding["effect"] not in {truth["name"], SAME_LAW.get(truth["name"])}:
        return []
    out = []
    given = finding.get("parameters", {})
    known = ROUGH_TRUTHS if "share" in truth else TRUTHS
    for aliases, value in known.get(truth["name"], {}).items():
        name = next((n for n in aliases if n in given), None)
        interval = given[name].get("ci95") if name else None
        if not interval or any(end is None for end in interval):
            continue
        unit, planted = given[name].get("unit") or "", value(truth)
        low, high = (in_si(float(end), unit) for end in interval)
        off = abs(in_si(float(given[name]["value"]), unit) / planted - 1) if planted else None
        out.append(Number(truth["name"], str(name), low <= planted <= high, off))
    return out


def judge(answer: dict[str, Any], diagnosis: dict[str, Any] | None, seconds: float | None = None) -> Judgement:
    """A diagnosis that is missing (crash, time-out) is wrong in every count, and on clean data a false alarm."""
    truths = answer["planted"]
    j = Judgement(answer["case"], answer["class"], "failed", seconds=seconds)
    j.autocorrelated = answer.get("noise", {}).get("phi", 0) > 0
    j.series, j.alone = answer.get("device") in {"axis", "servo"}, not answer.get("rough")
    j.set_of, j.way = answer.get("set"), answer.get("way")
    j.rough = Rough() if j.kind in ROUGH else None
    if diagnosis is None:
        j.alarmed, j.named = True, [(t["name"], "failed") for t in truths]
        return j
    j.verdict = diagnosis["verdict"]
    findings = list(diagnosis.get("findings", []))
    j.alarmed = bool(findings) or j.verdict != "consistent"
    j.abstained = j.verdict == "unexplained"
    left, exact, near = list(findings), 0, 0
    for truth in truths:
        hit = next((f for f in left if is_right(f["effect"], f.get("location", ""), truth)), None)
        exact += hit is not None
        if hit is None:
            hit = next((f for f in left if _among(f, truth) and len(f["alternatives"]) == 1), None)
            near += hit is not None
        j.named.append((truth["name"], hit["effect"] if hit else "none"))
        if hit:
            left.remove(hit)
            j.places.append(place_is_right(_location(hit, truth), truth))
            j.covered += _covered(hit, truth)
    if [t["name"] for t in truths] == ["vibration"]:  # other laws have no band of their own
        j.bands = [_in_band(diagnosis.get("residual_location", {}), truths[0]["shape"]["frequency"])]
    left = [f for f in left if not any(_harmonic(f, t) or _cubic(f, t) for t in truths)]
    left = [
        f
        for f in left
        if not any(is_right(f["effect"], f.get("location", ""), t) for t in answer.get("background", []))
    ]
    spare = [f for f in left if not any(_among(f, t) for t in truths)]
    j.named += [("nothing", f["effect"]) for f in spare]
    j.wrong = bool(spare)
    j.luck = [(f not in spare, f["chance"]["by_luck"]) for f in findings if f.get("chance")]
    j.exact = exact == len(truths) and not left
    j.in_set = exact + near == len(truths) and not left
    j.further = judge_further(answer, diagnosis, spare)
    if j.kind in ROUGH:
        j.rough = judge_rough(answer, diagnosis)
    names = {f["effect"] for f in findings} | {a["effect"] for f in findings for a in f.get("alternatives", [])}
    j.admitted = (
        j.verdict == "ambiguous" and any(_among(f, t, own=True) for f in findings for t in truths) and len(names) > 1
    )
    ratios = [c["rms_after"] / c["noise_floor"] for c in diagnosis.get("held_out", {}).values() if c.get("noise_floor")]
    j.ratio = max(ratios) if ratios else None
    return j


def _among(finding: dict[str, Any], truth: dict[str, Any], own: bool = False) -> bool:
    """Whether an alternative of the finding is right (or, with `own`, the finding itself)."""
    rivals = [*finding.get("alternatives", []), *([finding] if own else [])]
    return any(is_right(r["effect"], r.get("location", ""), truth) for r in rivals)


def _in_band(location: dict[str, Any], frequency: float) -> bool:
    """Whether the band with the largest excess over the noise, before any correction, holds the frequency [Hz]."""
    bands = location.get("before", {}).get("by_frequency", [])
    largest = max(bands, key=lambda b: b["excess"] or 0.0, default={"low": math.inf, "high": -math.inf})
    return largest["low"] <= frequency <= largest["high"]


def _harmonic(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a further finding is the second harmonic that the plant's cyclic error has too."""
    period = finding.get("parameters", {}).get("period")
    if finding["effect"] != truth["name"] or not truth.get("shape", {}).get("second") or period is None:
        return False
    half = truth["shape"]["period"] / 2
    return abs(in_si(float(period["value"]), period["unit"]) - half) < 0.01 * half


def _cubic(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a further finding is the cubic part that the plant's bow has too, its interval over the planted one."""
    curvature, shape = finding.get("parameters", {}).get("curvature"), truth.get("shape", {})
    if (finding["effect"], truth["name"]) != ("cubic_sensor", "bow") or not shape.get("cubic") or curvature is None:
        return False
    planted = truth["amplitude"] * shape["cubic"] / shape["span"] ** 3
    low, high = (in_si(float(end), curvature["unit"]) for end in curvature["ci95"])
    return finding.get("location") == truth["location"] and low <= planted <= high


def _location(finding: dict[str, Any], truth: dict[str, Any]) -> str:
    """Where the finding, or the alternative of it that is right, stands."""
    for one in (finding, *finding.get("alternatives", [])):
        if is_right(one["effect"], one.get("location", ""), truth):
            return one.get("location", "")
    return finding.get("location", "")
