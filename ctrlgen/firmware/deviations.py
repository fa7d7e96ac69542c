"""The advisory MISRA C:2012 rules that the generated C does not follow, each with its reason: the text of DEVIATIONS.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Any


@dataclass(frozen=True)
class Deviation:
    """Rule `number`, the files (patterns of names) it is not followed in, what stands there, and why.

    `where`: a word of the C without which a file follows the rule after all.
    """

    number: str
    files: tuple[str, ...]
    what: str
    reason: str
    where: str = ""

    def covers(self, number: str, name: str) -> bool:
        """Whether it permits a finding of rule `number` in the file `name`."""
        return number == self.number and any(fnmatch(name, pattern) for pattern in self.files)


DEVIATIONS = (
    Deviation(
        "5.9", ("*_online_f??.c", "*_player_f??.c", "*_selftest_f??.c"),
        "names of static functions and tables that several of these files have",
        "Each file is complete without the others, and a name that no other file can see cannot be mistaken by the "
        "linker. The same step has the same name in float and double, so the two can be compared line by line.",
    ),
    Deviation(
        "2.5", ("*_player_f??.h", "*_selftest_f??.h", "*_vectors_f??.h"),
        "constants of an interface that its own source does not read",
        "They are for the caller: the number of samples, the status to compare with, the tolerance.",
    ),
    Deviation(
        "19.2", ("*_online_f??.c", "*_plant_f??.c"),
        "the unions in root(), exponential() and logarithm(), by which the exponent of a number is halved, set or read",
        "C99 defines what is read from another member; it spares a library call, and both members have the same bytes.",
        "union",
    ),
    Deviation(
        "19.2", ("*_selftest_f??.c",),
        "the union by which NaN and infinity are written as bits",
        "C99 has no constant for them without a library header, and an operation that makes one may be folded or may trap.",
    ),
)  # fmt: skip
# Required, not advisory: only in the program that prints the outcome of the test on a computer. No firmware contains it.
HOST_ONLY = (
    Deviation(
        "21.6", ("test_*.c",),
        "printf",
        "The test runs on a computer and says which vector disagrees. It is no part of the firmware.",
    ),
)  # fmt: skip


def permits(number: str, name: str) -> bool:
    """Whether DEVIATIONS.md lists rule `number` for the file `name`."""
    return any(deviation.covers(number, name) for deviation in (*DEVIATIONS, *HOST_ONLY))


def deviations_context(texts: Mapping[str, str]) -> dict[str, Any]:
    """What the template of DEVIATIONS.md needs; `texts`: name -> text of every generated C file."""

    def rows(deviations: Sequence[Deviation]) -> list[dict[str, Any]]:
        found = [
            (d, [name for name, text in sorted(texts.items()) if d.covers(d.number, name) and d.where in text])
            for d in deviations
        ]
        return [{"number": d.number, "files": files, "what": d.what, "reason": d.reason} for d, files in found if files]

    return {"advisory": rows(DEVIATIONS), "host": rows(HOST_ONLY)}
