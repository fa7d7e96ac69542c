"""The advisory MISRA C:2012 rules that the generated C does not follow, each with its reason: the text of DEVIATIONS.md."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from typing import Any


@dataclass(frozen=True)
class Deviation:
    """A rule that is not followed: its `number`, patterns of the file names, what the code does, and why.

    `where`: only files in which this regular expression is found deviate.
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
        "2.5",
        ("*_online_???.h", "*_corrected_f??.h", "*_player_f??.h", "*_selftest_???.h", "*_vectors_???.h"),
        "constants of an interface that its own source does not read",
        "The caller uses them: number of the interface, version, device, rate, sizes, number of samples, status values, tolerances.",
    ),
    Deviation(
        "2.3",
        tuple(
            f"*_{piece}_f64.c" for piece in ("online", "checked", "corrected", "player", "plant", "selftest", "vectors")
        ),
        "the type ..._constants_in_double, which nothing uses",
        "It has no size, and the source does not compile, where a compiler's option rounds every constant to float; C99 has no "
        "_Static_assert.",
    ),
    Deviation(
        "19.2",
        ("*_online_f??.c", "*_corrected_f??.c", "*_plant_f??.c"),
        "the unions in square_root(), exponential() and logarithm(), by which the exponent of a number is halved, set or read",
        "C99 defines the result of reading the other member, both members have the same size, and it avoids a library call.",
        r"_(square_root|exponential|logarithm)\(",
    ),
    Deviation(
        "19.2",
        ("*_online_???.c", "*_corrected_f??.c", "*_player_f??.c", "*_selftest_f??.c", "*_plant_f??.c"),
        "the union in bits_of(), by which the bits of a number are read",
        "Whether a number is one is asked of its bits: options of compilers permit them to leave comparisons with NaN out, never "
        "those of integers. C99 defines the result of reading the other member, and both members have the same size.",
        "bits_of",
    ),
    Deviation(
        "19.2",
        ("*_online_f??.c",),
        "the union in number_at(), by which a number is read from its bits",
        "C99 defines the result of reading the other member, and both members have the same size whatever the order of bytes.",
        "number_at",
    ),
    Deviation(
        "19.2",
        ("*_corrected_f??.c",),
        "the unions of a stored number and its bits",
        "C99 defines the result of reading the other member, and both members have the same size whatever the order of bytes.",
        "float number; uint32_t bits",
    ),
    Deviation(
        "19.2",
        ("*_checked_f??.h",),
        "the union of a state and its words, over which the checksum is computed",
        "C99 defines the result of reading the other member, and both members have the same size. Bytes would take four times as long.",
    ),
    Deviation(
        "19.2",
        ("*_selftest_???.c",),
        "the unions in set_unusable() and run_targets(), by which NaN and infinity are written as bits",
        "C99 has no constant for them without a library header; a compiler may fold an operation that makes one, or it may trap.",
    ),
)
# Required, not advisory: only in the program that prints the outcome of the test on a computer. No firmware contains it.
HOST_ONLY = (
    Deviation(
        "21.6",
        ("test_*.c",),
        "printf",
        "The test runs on a computer and prints which vector disagrees. It is not part of the firmware.",
    ),
)


def permits(number: str, name: str) -> bool:
    """Whether DEVIATIONS.md lists rule `number` for the file `name`."""
    return any(deviation.covers(number, name) for deviation in (*DEVIATIONS, *HOST_ONLY))


def deviations_context(texts: Mapping[str, str]) -> dict[str, Any]:
    """What the template of DEVIATIONS.md needs; `texts`: name -> text of every generated C file."""

    def rows(deviations: Sequence[Deviation]) -> list[dict[str, Any]]:
        covered = [
            (d, [name for name, text in sorted(texts.items()) if d.covers(d.number, name) and re.search(d.where, text)])
            for d in deviations
        ]
        return [
            {"number": d.number, "files": files, "what": d.what, "reason": d.reason} for d, files in covered if files
        ]

    return {"advisory": rows(DEVIATIONS), "host": rows(HOST_ONLY)}
