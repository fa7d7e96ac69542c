"""Whether a diagnosis.json contradicts itself: sums, words against numbers, verdict against errors, units, bounds.

Everything is worked out from the file alone, as its reader would: shares from the squares of the errors that the tables state,
the numbers of the sentence from those tables.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

SUM = 1e-6  # by which shares that make up one may differ from it
NEARLY = 0.1  # difference of shares that do not say which cause is the main one
SQUARES = 0.02  # by which a share may differ from that of the squares, which leave out what the tables round
LEAST = 0.01  # of the mismatch: below, nothing is a cause
MOST = 0.75  # of the mismatch, which a partial answer takes away
LUCK = 0.05  # chance up to which a cause is told without a word of doubt
NOISE = 1.5  # times the noise: more is not explained
BY_MOTION = 1e-4  # chance of going so well with the motion: less is no noise
HELD_OUT = re.compile(r"Held-out error of (\S+): (\S+) (\S+?)(?: -> (\S+) \S+?)?, noise (?:not known|(\S+) \S+?)[.;]")
TAKES = re.compile(r"it takes away ((?:[<>] )?[\d.]+ %)")
LEFT = re.compile(r"[Ll]eft: (\S+) (\S+) in (\S+), (\S+) times the noise")
ALIKE = (
    {"pm", "nm", "um", "mm", "m"},
    {"nrad", "urad", "mrad", "rad", "deg"},
    {"uN", "mN", "N", "kN"},
    {"mN*m", "N*m"},
)
HEADS = {
    "explained": "Explained",
    "partly": "Partly explained",
    "ambiguous": "Ambiguous",
    "unexplained": "Unexplained",
    "consistent": "Consistent",
}


def contradictions(diagnosis: dict[str, Any]) -> list[str]:
    """What contradicts itself in the content of a diagnosis.json; nothing where all of it agrees."""
    parts = (_shares, _terms, _channels, _causes, _verdict, _sentence, _numbers, _luck)
    return [text for part in parts for text in part(diagnosis)]


def _shares(d: dict[str, Any]) -> Iterator[str]:
    """Shares of the whole: none negative, all one with what is left, the largest first."""
    rest, explained = d["attribution"]["rest"], d["attribution"]["explained"]
    shares = [f["share"] for f in d["findings"] if f["share"] is not None]
    for f in d["findings"]:
        share, name = f["share"], _name(f)
        if share is None:
            if f["role"] == "cause" and rest is not None and f["parameters"] and _fitted(f):
                yield f"{name} is a cause without a share"
            continue
        low, high = share["ci95"]
        if not 0 <= low <= share["value"] <= high <= 1 + SUM:
            yield f"{name}: the share {share['value']} is not within {low} ... {high}, or these not within 0 ... 1"
        if f["role"] == "cause" and (low <= 0 or share["value"] < LEAST):
            yield f"{name}: a share of {share['value']} ({low} ... {high}) makes no cause"
    if rest is None:
        if shares:
            yield "shares of no mismatch"
        return
    if abs(explained - max(1 - rest["value"], 0.0)) > SUM:
        yield f"explained {explained} and left {rest['value']} are not one"
    whole = sum(s["value"] for s in shares)
    if shares and abs(whole - explained) > SUM:
        yield f"the shares make up {whole}, not {explained}"
    standing = [f for f in d["findings"] if f["role"] == "cause" and f["share"] is not None]
    standing = [f for f in standing if not (f["support"] and f["support"]["contradicted"])]
    causes = [f["share"]["value"] for f in standing]
    if causes[1:] != sorted(causes[1:], reverse=True):
        yield f"shares are not in their order: {causes}"
    if causes and causes[0] < max(causes):
        first, largest = standing[0], standing[causes.index(max(causes))]
        needed = any(w["without"] > largest["worth"][channel]["without"] for channel, w in first["worth"].items())
        if causes[0] <= max(causes) - NEARLY or not needed:
            yield f"the largest share is not first: {causes}"


def _terms(d: dict[str, Any]) -> Iterator[str]:
    """Empirical terms: each leaves less than there was, and takes away no more than that."""
    for t in d["empirical_terms"]:
        if not 0 < t["share"] <= 1 or not t["rms_after"] < t["rms_before"]:
            yield f"{t['effect']} of {t['channel']}: a share of {t['share']}, {t['rms_before']} to {t['rms_after']}"


def _channels(d: dict[str, Any]) -> Iterator[str]:
    """Shares of each channel: what is left is the square of the error after over that before, less noise."""
    account = d["attribution"]
    for channel, left in account["left"].items():
        e = d["held_out"][channel]
        noise = e["noise_floor"] or 0.0
        if account["held_out"]:
            before, after = (max(e[key] ** 2 - noise**2, 0.0) for key in ("rms_before", "rms_after"))
            if before > 0 and abs(left - after / before) > SQUARES * max(1.0, left):
                yield f"{channel}: {left} of the mismatch is said to be left; its errors say {after / before}"
        parts = [f["worth"][channel]["share"] for f in d["findings"] if channel in f["worth"]]
        taken = sum(p for p in parts if p is not None)
        if any(p is not None and p < 0 for p in parts) or (
            d["findings"] and any(p is not None for p in parts) and abs(taken - max(1 - left, 0.0)) > SUM
        ):
            yield f"{channel}: shares {parts} and {left} left are not one"
    for f in d["findings"]:
        for channel, worth in f["worth"].items():
            if worth["unit"] != d["held_out"][channel]["unit"]:
                yield f"{_name(f)}: {channel} in {worth['unit']} here and {d['held_out'][channel]['unit']} there"
            elif not _same(worth["with_it"], d["held_out"][channel]["rms_after"]):
                yield f"{_name(f)}: with it {worth['with_it']} are left in {channel}, not {d['held_out'][channel]['rms_after']}"


def _causes(d: dict[str, Any]) -> Iterator[str]:
    """Findings: each once, none its own alternative, parts of findings that are there."""
    names = [_name(f) for f in d["findings"]]
    for name, count in Counter(names).items():
        if count > 1:
            yield f"{name} is found {count} times"
    for f in d["findings"]:
        others = [_name(a) for a in f["alternatives"]]
        if _name(f) in others or len(set(others)) < len(others):
            yield f"{_name(f)}: explains as well as itself, or an alternative stands twice"
        if (f["role"] == "part") != (f["serves"] is not None) or (f["role"] == "part" and f["share"] is not None):
            yield f"{_name(f)}: role {f['role']}, serves {f['serves']}, share {f['share']}"
        if f["serves"] is not None and (_name(f["serves"]) not in names or _name(f["serves"]) == _name(f)):
            yield f"{_name(f)} is part of {_name(f['serves'])}, which is no finding"


def _verdict(d: dict[str, Any]) -> Iterator[str]:
    """The word against the errors."""
    verdict, errors = d["verdict"], d["held_out"].values()
    tolerated = "within the stated tolerance" in d["sentence"]
    known = all(e["noise_floor"] for e in errors)
    quiet = known and not any(map(_loud, errors))
    chance = "which chance allows" in d["sentence"]
    # told of the worst channel
    moved = (
        known
        and "with them moved within it" in d["sentence"]
        and all(e["rms_refitted"] is not None and e["rms_refitted"] <= NOISE * e["noise_floor"] for e in errors)
    )
    # size does not tell there, and the sentence says so
    judged = [e["goes_with_motion"] for e in errors if e["goes_with_motion"] is not None]
    untold = all(e["goes_with_motion"] is not None for e in errors if _loud(e))
    untold &= not judged or min(judged) * len(judged) >= BY_MOTION
    untold &= "the noise was neither stated nor recorded at rest" in d["sentence"]
    little = "too little to name" in d["sentence"] and known and all(map(_little, errors))
    if verdict == "explained" and not (quiet or tolerated or chance or little or untold):
        yield "explained, and more than noise is left"
    if verdict == "explained" and any(f["role"] == "unseen" for f in d["findings"]):
        yield "explained by what no held-out record shows"
    if verdict in {"explained", "partly"} and d["findings"] and d["findings"][0]["size_untold"]:
        yield f"{verdict} by {_name(d['findings'][0])}, whose size may be zero"
    if verdict in {"explained", "partly", "ambiguous"} and not d["findings"]:
        yield f"{verdict} by nothing"
    if verdict == "consistent" and d["findings"]:
        yield "consistent, with findings"
    if verdict == "consistent" and known and not (quiet or tolerated or moved or untold):
        yield "consistent, and more than noise is left"
    if verdict == "partly" and not quiet and known and d["attribution"]["explained"] < MOST and not tolerated:
        yield f"partly explained, and {d['attribution']['explained']} of the mismatch is taken away"
    worse = [
        math.log(e["rms_after"] / e["rms_before"]) for e in errors if e["rms_after"] and e["rms_before"] and not quiet
    ]
    if d["findings"] and worse and min(worse) > math.log(NOISE):
        yield "the findings make every held-out error worse"


def _sentence(d: dict[str, Any]) -> Iterator[str]:
    """The sentence: head, names and numbers are those of the verdict, the findings and the tables."""
    said = d["sentence"].replace("\u00a0", " ")
    if d["implausible"]:
        asked, head, rest = said.partition(f" {HEADS[d['verdict']]}: ")
        whole = f"Check this first: {d['implausible'][0].removesuffix('.')}"
        # a long one goes on in the notes
        begun = asked.removesuffix(".").removesuffix(" (see the notes)")
        if not asked.startswith(whole) and not (begun.startswith("Check this first: ") and whole.startswith(begun)):
            yield f"what cannot be right of the recording does not come first: {said[:40]}"
        said = head.lstrip() + rest
    if not said.startswith(HEADS[d["verdict"]] + ":"):
        yield f"the sentence does not begin as {d['verdict']}: {said[:40]}"
    if re.search(r"takes away (?:-[\d.]+|0|100) %|:\w+ \((?:-[\d.]+|0|100) %\)", said):
        yield f"a share that is none, all or negative: {said}"
    found = HELD_OUT.search(said)
    if found is None:
        yield f"no held-out error is said: {said}"
    else:
        channel, before, unit, after, noise = found.groups()
        e = next((e for c, e in d["held_out"].items() if c.removeprefix("reading.") == channel), None)
        if e is None or unit != e["unit"]:
            yield f"{channel} in {unit} is no reading of the table"
        else:
            told = (
                ("before", before, "rms_before"),
                ("after", after or before, "rms_after"),
                ("noise", noise, "noise_floor"),
            )
            for what, text, key in told:
                if (text is None) != (e[key] is None) or (text is not None and not _same(float(text), e[key])):
                    yield f"{channel}: {what} is {text} in the sentence and {e[key]} in the table"
    main = d["findings"][0] if d["findings"] else None
    if "it takes away all" in said and (main is None or main["share"] is None or main["share"]["value"] < 1):
        yield f"the main cause takes away all in the sentence and {main and main['share']} in the table"
    if takes := TAKES.search(said):
        share = None if main is None or main["share"] is None else 100 * main["share"]["value"]
        text = takes.group(1)
        if share is None or (text[0] not in "<>" and abs(float(text.split()[0]) - share) > 0.51):
            yield f"the main cause takes away {text} in the sentence and {share} % in the table"
    if left := LEFT.search(said):
        size, unit, channel, ratio = left.groups()
        e = d["held_out"].get(f"reading.{channel}", d["held_out"].get(channel))
        if e is None or unit != e["unit"] or not _same(float(size), e["rms_after"]):
            yield f"{size} {unit} is not what the table says is left in {channel}"
        elif not _same(float(ratio), e["rms_after"] / e["noise_floor"], 0.06):
            yield f"{ratio} times the noise is not {e['rms_after'] / e['noise_floor']}"
    if (
        main is not None
        and d["verdict"] not in {"consistent"}
        and main["effect"] != "parameter"
        and main["effect"] not in said
    ):
        yield f"the sentence does not name {main['effect']}"


def _numbers(d: dict[str, Any]) -> Iterator[str]:
    """Numbers within their intervals, with a unit; counts within their wholes."""
    for f in d["findings"]:
        for numbers in (f["parameters"], *f["terms"]):
            for name, e in numbers.items():
                low, high = e["ci95"]
                if e["value"] is None or not e["unit"] or not (low is None or low <= e["value"]):
                    yield f"{_name(f)}: {name} = {e['value']} {e['unit']} ({low} ... {high})"
                elif high is not None and e["value"] > high:
                    yield f"{_name(f)}: {name} = {e['value']} {e['unit']} is above {high}"
                read = d["held_out"].get(f"reading.{f['location'].removeprefix('sensor:')}")
                both = {e["unit"], read["unit"]} if read and name != "phase" else set()
                along = (
                    d["held_out"].get(f"reading.{f['of']}") if f.get("of") else None
                )  # a way of the other axis of a pair
                if along and e["unit"] == along["unit"]:
                    continue
                if len(both) > 1 and any(both <= alike for alike in ALIKE):
                    yield f"{_name(f)}: {name} in {e['unit']}, which is read in {read['unit']}"
    for channel, s in d["spikes"].items():
        if not 0 < s["count"] <= s["samples"] or not _same(s["per_thousand"], 1000 * s["count"] / s["samples"]):
            yield f"{channel}: {s['count']} spikes of {s['samples']} samples, {s['per_thousand']} in a thousand"
    if d["shares"] is not None:
        for when in ("before", "after"):
            for channel, c in d["shares"][when]["channels"].items():
                if abs(c["total"] + c["rest"] - 1) > SUM:
                    yield f"{channel} {when}: total {c['total']} and rest {c['rest']} are not one"


def _luck(d: dict[str, Any]) -> Iterator[str]:
    """The chance that luck found a cause: what it is made of, and what the verdict and the sentence say of it."""
    for f in d["findings"]:
        c, name = f["chance"], _name(f)
        if c is None:
            continue
        if (c["by_luck"] is None) != (c["p"] is None) or (c["by_luck"] is None and not c["reason"]):
            yield f"{name}: not tested for luck, without a reason, or with a p of {c['p']}"
        if c["by_luck"] is None or c["p"] is None:
            continue
        if not 0.5 ** c["stretches"] * (1 - SUM) <= c["p"] <= 1:
            yield f"{name}: {c['stretches']} stretches have no p of {c['p']}"
        if not min(c["p"] * c["looks"], 1) * (1 - SUM) <= c["by_luck"] <= 1:
            yield f"{name}: p {c['p']} times {c['looks']} answers is not {c['by_luck']}"
        if c["reason"]:
            yield f"{name}: by luck {c['by_luck']}, and it cannot be judged: {c['reason']}"
    main = d["findings"][0] if d["findings"] else None
    if main is None or main["role"] == "unseen" or d["verdict"] == "consistent":
        return
    told = "luck" in d["sentence"].partition(", beside ")[0]
    if told != _doubted(main):
        yield f"{_name(main)} may be luck: {_doubted(main)}; the sentence says {told}"
    if d["verdict"] == "explained" and _doubted(main) and not main["chance"]["reason"]:
        yield f"explained by {_name(main)}, which may be luck"


def _doubted(finding: dict[str, Any]) -> bool:
    c = finding["chance"]
    return c is not None and (c["by_luck"] is None or c["by_luck"] > LUCK)


def _loud(e: dict[str, Any]) -> bool:
    """Whether an error is more than its noise."""
    return e["rms_after"] is None or not e["noise_floor"] or e["rms_after"] > NOISE * e["noise_floor"]


def _little(e: dict[str, Any]) -> bool:
    """Whether an error beyond noise is below a hundredth of what it was, in squares, or near the noise."""
    noise = e["noise_floor"] ** 2
    return e["rms_after"] ** 2 - noise <= max(LEAST * (e["rms_before"] ** 2 - noise), (NOISE**2 - 1) * noise)


def _same(a: float, b: float | None, share: float = 0.006) -> bool:
    return b is not None and math.isclose(a, b, rel_tol=share, abs_tol=1e-12)


def _fitted(finding: dict[str, Any]) -> bool:
    """Whether the numbers were fitted: those that were read off the readings have no interval and no share."""
    return any(e["ci95"][0] != e["ci95"][1] for e in finding["parameters"].values())


def _name(cause: dict[str, Any]) -> str:
    return f"{cause['effect']} at {cause['location']}" + (f" of {cause['of']}" if cause.get("of") else "")
