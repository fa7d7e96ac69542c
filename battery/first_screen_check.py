"""Whether the first screen of a diagnosis contradicts diagnosis.json or itself: its sentences, numbers, next steps and notes.

Everything is read from the texts, as their reader would, and held to the tables.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

NUMBER = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"
UNIT = r"(?:\([^\s()]+\))?[^\s,;()]+"  # '(mN*m)/urad^3' too
# 'x unit (low unit ... high unit)', '82 % (75 ... 88 %)'
INTERVAL = re.compile(rf"(?<![\d.+^])({NUMBER})( {UNIT})? \(([<>] )?({NUMBER})(?: {UNIT})? \.\.\. ([<>] )?({NUMBER})")
WOULD = re.compile(rf"held-out error of (\S+) would be ({NUMBER}) (\S+) instead of ({NUMBER}) (\S+?)[:;]")
EXPLAINS = re.compile(rf"^(.*?) explains? (?:> )?({NUMBER}) %")
PART = re.compile(rf"\((?:> )?({NUMBER}) %\)")
PLURAL = re.compile(
    r"(?<![\d.,])1 (?:independent |more )?(?:samples|poses|stretches|outliers|spikes|records|rows|gaps|replicates)\b"
)
ONE_AS_MANY = re.compile(r"(?<![\d.,])1 of (?!1000 )\S+ \w+ (?:are|is \w+s)\b")
# no initial of a name
BETWEEN = re.compile(r"(?<=[\w)%]{2})[.?] (?=[A-Z])")
NO_NUMBER = re.compile(r"\b(?:nan|inf|null)\b")
BETTER, WORSE = "predicts the held-out recordings better", "too uncertain to predict the held-out"
SENTENCES, LONGEST = 3, 420  # of an answer: three lines of 140 characters
SURE = 1.05  # errors that differ by less are told alike
ROUNDING = 0.006


def screen_contradictions(
    d: dict[str, Any], answer: Sequence[str], numbers: Sequence[Sequence[str]], steps: Sequence[str]
) -> list[str]:
    """What contradicts diagnosis.json `d` or itself in the `answer`, the `numbers` (name, value) beside the figure and the next `steps`."""
    said, beside, then = ([_plain(text) for text in texts] for texts in (answer, map(": ".join, numbers), steps))
    statements = [] if d["shares"] is None else d["shares"]["statements"]
    every = [*said, *beside, *then, *map(_plain, statements), *map(_plain, d["notes"])]
    wrong = [] if " ".join(said) == _plain(d["sentence"]) else [f"another answer than diagnosis.json: {said}"]
    for part in (_length(said), _beside(d, beside), _steps(d, then), _statements(statements), *map(_words, every)):
        wrong += part
    return wrong


def _length(said: Sequence[str]) -> Iterator[str]:
    """An answer is three sentences and three lines at most."""
    count, size = sum(len(BETWEEN.split(text)) for text in said), len(" ".join(said))
    if count > SENTENCES or size > LONGEST:
        yield f"an answer of {count} sentences and {size} characters: {' '.join(said)}"


def _plain(text: str) -> str:
    return text.replace("\u00a0", " ")


def _words(text: str) -> Iterator[str]:
    """Intervals about their value, no share beyond the whole, numbers that are numbers, one thing in the singular."""
    for m in INTERVAL.finditer(text):
        value, low, high = (float(m.group(i)) for i in (1, 4, 6))
        reach = ROUNDING * max(abs(low), abs(high))
        if not (low - reach <= value <= high + reach) and not m.group(3) and not m.group(5):
            yield f"{value} is not within its interval: {m.group(0)}"
    for rule, what in ((PLURAL, "one is many"), (ONE_AS_MANY, "one is many"), (NO_NUMBER, "no number")):
        if found := rule.search(text):
            yield f"{what}: {found.group(0)!r} in {text!r}"


def _beside(d: dict[str, Any], told: Sequence[str]) -> Iterator[str]:
    """The numbers beside the figure are those of the tables."""
    entries = dict(text.split(": ", 1) for text in told)
    first = next(iter(entries))
    channel = first.removeprefix("held-out error of ").removesuffix(", as described")
    e = next((e for c, e in d["held_out"].items() if c.removeprefix("reading.") == channel), None)
    if e is None:
        yield f"{channel} is no reading of the table"
        return
    pairs = [(entries[first], e["rms_before"]), (entries["noise"], e["noise_floor"])]
    pairs += [(entries["with the findings"], e["rms_after"])] if d["findings"] else []
    for text, value in pairs:
        if not (text == "not known" if value is None else _is(text, value, e["unit"])):
            yield f"{channel}: {text} beside the figure and {value} {e['unit']} in the table"
    if not d["findings"]:
        if not _is(f"{e['rms_before']:.3g} {e['unit']}", e["rms_after"], e["unit"]):
            yield f"{channel}: {e['rms_before']} becomes {e['rms_after']} {e['unit']} by no finding"
        if more := set(entries) - {first, "noise"}:
            yield f"numbers of no finding: {more}"
        return
    for name, one in d["findings"][0]["parameters"].items():
        low, high = one["ci95"]
        text = entries.get(name)
        if text is None or low is None or high is None or not one["value"]:
            continue
        value = text.split(" ")[0]
        if re.fullmatch(NUMBER, value) and (float(value) < 0) != (one["value"] < 0) and float(value):
            yield f"{name}: {text} beside the figure and {one['value']} in the table"


def _steps(d: dict[str, Any], steps: Sequence[str]) -> Iterator[str]:
    """What to do next agrees with the errors; what was not taken would be better than what was, and is not in the answer."""
    errors = list(d["held_out"].values())
    pairs = [(e["rms_before"], e["rms_after"]) for e in errors if e["rms_before"] and e["rms_after"]]
    all_said = " ".join(steps)
    if BETTER in all_said and all(after > before * SURE for before, after in pairs):
        yield "the corrected device is said to predict better, and predicts every channel worse"
    if WORSE in all_said and (not d["findings"] or all(before > after * SURE for before, after in pairs)):
        yield f"the numbers of {len(d['findings'])} findings are said to be too uncertain, and no channel is predicted worse"
    if ("Nothing to correct" in all_said) != (d["verdict"] == "consistent"):
        yield f"{d['verdict']}, and the next step is: {steps[:1]}"
    for text in steps:
        for channel, would, unit, now, _ in WOULD.findall(text):
            e = next((e for c, e in d["held_out"].items() if c.removeprefix("reading.") == channel), None)
            if e is None or unit != e["unit"] or not _is(f"{now} {unit}", e["rms_after"], unit):
                yield f"{now} {unit} is not what is left in {channel}: {text}"
            if float(would) >= float(now):
                yield f"not taken although it would be no better: {text}"
        if text.startswith("Not taken: "):
            names = text.removeprefix("Not taken: ").partition(", although")[0].split(" and ")
            there = [f"{f['effect']} at {f['location']}" + (f" of {f['of']}" if f["of"] else "") for f in d["findings"]]
            if all(name in there for name in names):
                yield f"not taken, and found: {names}"


def _statements(statements: Sequence[str]) -> Iterator[str]:
    """What signals explain together is no less than what one of them does."""
    for text in map(_plain, statements):
        if (found := EXPLAINS.search(text)) is None or "No signal" in text:
            continue
        total, parts = float(found.group(2)), [float(p) for p in PART.findall(found.group(1))]
        if total < 1 or (parts and (max(parts) > total + 1 or sum(parts) > total + 5 + len(parts))):
            yield f"parts {parts} of {total} %: {text}"


def _is(text: str, value: float, unit: str) -> bool:
    shown, _, of = text.partition(" ")
    return (
        of == unit
        and bool(re.fullmatch(NUMBER, shown))
        and math.isclose(float(shown), value, rel_tol=ROUNDING, abs_tol=1e-12)
    )
