"""Rows of the table on regions, gaps and hidden spikes, and on what any answer must keep: numbers against the best, no false names."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from battery.judge import Judgement
from battery.judge_further import NEAR_BEST, TOLD, Evidence, Further
from battery.rows import Row, mean, number, share

UNSET = "none set"
KNOWN = ("single", "weak", "multiple", "hexapod_single", "messy", "memory", "forms", "regional", "gaps", "spikes")
# Where no law acts in a region only, nor one of a background
BACKGROUNDS = ("messy", "memory", "regional")
EVERYWHERE = ("clean", "hexapod_clean", "null", *(k for k in KNOWN if k not in BACKGROUNDS))
WITHIN, CPU = 1.1, 1.3  # held-out error and CPU seconds with rows missing over those of the whole record


def further_rows(judged: Sequence[Judgement]) -> list[Row]:
    """Goals of the third part of DIAGNOSIS.md."""

    def of(*kinds: str) -> list[Further]:
        return [j.further for j in judged if j.kind in kinds and j.further]

    def rough(kind: str, what: Callable[[Judgement], bool]) -> list[bool]:
        return [what(j) for j in judged if j.kind == kind]

    best = [f.over_best for f in of(*KNOWN) if f.over_best is not None]
    edges = [inside for f in of("regional") if f.located for inside in f.located.edges]
    regions = [f.located.f1 for f in of("regional") if f.located]
    off = [c.off for j in judged if j.kind in KNOWN for c in j.covered if c.off is not None]
    memory = [j.memory for j in judged if j.memory is not None]
    return [
        share("regional, law first", rough("regional", _law), ">= 90 %", 0.90),
        share("regional, region overlaps by 0.8", rough("regional", _region), ">= 90 %", 0.90),
        mean("regional, localisation F1, mean", regions, ">= 0.80", 0.80),
        share("regional, coverage of the ends' 95 % intervals", edges, ">= 88 %", 0.88),
        share("regional, nothing beside it", rough("regional", lambda j: j.rough.nothing_beside), UNSET),
        share("region stated where none is", [f.false_region for f in of(*EVERYWHERE)], "<= 2 %", most=0.02),
        *_gap_rows(judged),
        share("hidden spikes, cause first", rough("spikes", lambda j: j.rough.first), UNSET),
        share("hidden spikes, held-out error <= 1.5 x least possible", rough("spikes", _near_best), UNSET),
        share("hidden spikes, told within a tenth", rough("spikes", _told), UNSET),
        share("several causes, all named", _several(judged), ">= 85 %", 0.85),
        share("messy, false name above 5 % share", [f.false_name for f in of("messy")], "<= 3 %", most=0.03),
        number("held-out error / best achievable, median", best, 0.5, "<= 1.02", 1.02),
        number("held-out error / best achievable, 90th percentile", best, 0.9, "<= 1.5", 1.5),
        number("a number off the planted one, relative, median", off, 0.5, UNSET),
        share("held-out error worse than before", [j.further.worse for j in judged if j.further], "0 %", most=0.0),
        number("largest memory [GB]", memory, 1.0, "<= 1.5", 1.5),
    ]


def _law(j: Judgement) -> bool:
    return j.further is not None and j.further.located is not None and j.further.located.law


def _region(j: Judgement) -> bool:
    return j.further is not None and j.further.located is not None and j.further.located.found


def _near_best(j: Judgement) -> bool:
    return bool(j.further and j.further.over_best is not None and j.further.over_best <= NEAR_BEST)


def _told(j: Judgement) -> bool:
    return bool(j.further and j.further.spikes is not None and abs(j.further.spikes - 1) <= TOLD)


def _several(judged: Sequence[Judgement]) -> list[bool]:
    """Of cases with several dominant causes of at least the noise; one that failed names none."""
    cases = [j for j in judged if j.kind in {"multiple", "messy", "memory"}]
    return [bool(j.further and j.further.all_named) for j in cases if not j.further or j.further.all_named is not None]


def _gap_rows(judged: Sequence[Judgement]) -> list[Row]:
    """Each case with rows missing beside the whole record of its set."""
    whole = {j.set_of: j for j in judged if j.way == "none"}
    rows = []
    for what, ways, goal in (("1 % of rows missing", ("single", "runs"), "100 %"), ("a long gap", ("long",), UNSET)):
        pairs = [(j, whole[j.set_of]) for j in judged if j.way in ways and j.set_of in whole]
        least = 1.0 if goal != UNSET else None
        rows += [
            share(f"{what}, same finding", [_same(*pair) for pair in pairs], goal, least),
            share(f"{what}, held-out error within 10 %", [_near(*pair) for pair in pairs], goal, least),
            share(
                f"{what}, CPU within 1.3 x", [a.cpu <= CPU * b.cpu for a, b in pairs if a.cpu and b.cpu], goal, least
            ),
        ]
    return rows


def _same(a: Judgement, b: Judgement) -> bool:
    return bool(a.further and b.further and a.further.first == b.further.first)


def _near(a: Judgement, b: Judgement) -> bool:
    errors = [j.further.over_best if j.further else None for j in (a, b)]
    return errors[0] is not None and errors[1] is not None and errors[0] <= WITHIN * errors[1]


def evidence_table(judged: Sequence[Judgement]) -> list[str]:
    """How often the first family of the model-free shares is right, by its share, and beside it the finding; where both may be
    wrong, how the two should be weighed."""
    known = [j.further.evidence for j in judged if j.further and j.further.evidence]
    lines = [
        "| first family's share | cases | family wrong | finding wrong | family wrong, finding right | against a right finding |"
    ]
    lines += ["|---|---|---|---|---|---|"]
    for low, high in ((0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 10.0)):
        rows = [e for e in known if low <= e.share < high]
        lines.append(f"| {low:g} to {min(high, 1):g} | {len(rows)} | {_counts(rows)} |")
    return [*lines, f"| all | {len(known)} | {_counts(known)} |"]


def _counts(rows: Sequence[Evidence]) -> str:
    columns = (
        [not e.right for e in rows],
        [not e.named for e in rows],
        [e.named and not e.right for e in rows],
        [e.named and e.against for e in rows],
    )
    return " | ".join(str(sum(c)) for c in columns)
