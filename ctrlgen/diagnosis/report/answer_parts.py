"""The parts of an answer, and how it is kept to a few lines: what matters least is told shorter first, and in full in the notes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

# characters of an answer: three lines of 140
LONGEST = 420


class Yields(IntEnum):
    """What gives way in an answer that is too long, in this order. Judgement: first what a table beside it holds, last what changes how
    the rest is to be read."""

    UNCERTAINTY = 1
    RINGING = 2
    WHAT_NOISE = 3
    HOW_UNLIKELY = 4
    INTERVAL_OF_SHARE = 5
    SECOND_NUMBER = 6
    SECOND_BESIDE = 7
    WHY_UNTRIED = 8
    FURTHER_MOVED = 9
    HOW_WEIGHED = 10
    HOW_UNEVEN = 11
    TITLE = 12
    FURTHER_CHANNELS = 13
    FURTHER_RIVALS = 14
    BESIDE = 15
    WHAT_TO_CHECK = 16
    UNTRIED = 17
    UNEVEN = 18
    INTERVALS = 19
    KIND = 20
    PITCH = 21
    MOVED = 22
    UNCERTAINTY_THAT_DECIDES = 23


@dataclass(frozen=True)
class Part:
    """A part of a sentence: its `text`; the `shorter` ones that may stand for it, with what has to yield for them; and the sentence of the
    notes where it does, empty where a table has all of it."""

    text: str
    shorter: tuple[tuple[Yields, str], ...] = ()
    note: str = ""


@dataclass(frozen=True)
class Composed:
    """The `sentences` of an answer, and the `notes` on what had no room in them."""

    sentences: tuple[str, ...]
    notes: tuple[str, ...]


def composed(sentences: Sequence[Sequence[Part]], longest: int = LONGEST) -> Composed:
    """The sentences made of parts, of which some yield, in the order of `Yields` and of two the latter, until all are no longer than
    `longest` or none can yield any more; what has room again where a larger one had to yield is told after all. A sentence whose parts are
    all empty is left out."""
    parts = [part for sentence in sentences for part in sentence]
    step = [0] * len(parts)

    def told() -> tuple[str, ...]:
        forms = iter(p.text if k == 0 else p.shorter[k - 1][1] for p, k in zip(parts, step, strict=True))
        texts = ["".join(next(forms) for _ in sentence) for sentence in sentences]
        return tuple(_sentence(text) for text in texts if text)

    yielded: list[tuple[Yields, int]] = []
    while len(" ".join(told())) > longest:
        left = [(p.shorter[k][0], -i) for i, (p, k) in enumerate(zip(parts, step, strict=True)) if k < len(p.shorter)]
        if not left:
            break
        yielded.append(min(left))
        step[-yielded[-1][1]] += 1
    for _, place in reversed(yielded):
        step[-place] -= 1
        # of one part the last form first
        if len(" ".join(told())) > longest:
            step[-place] += 1
    notes = tuple(p.note for p, k in zip(parts, step, strict=True) if k and p.note)
    return Composed(told(), notes)


def _sentence(text: str) -> str:
    """The joined parts as a sentence: nothing before the first, a capital, an end."""
    text = text.removeprefix("; ")
    return text[0].upper() + text[1:] + ("" if text.endswith("?") else ".")
