"""Names of columns that state a calculation: whether their numbers are before it or after it, no file tells."""

from __future__ import annotations

import re

from ctrlgen.core.units import same_dimension
from ctrlgen.recordings.formats.unit_texts import BEHIND, split_name, unit_of

NUMBER = r"\d*\.?\d+(?:[eE][+-]?\d+)?"
FACTORS = (
    re.compile(
        rf"(?P<said>(?:[*\u00d7\u00b7]|\\times|\\cdot)\s*(?:10\s*(?:\^|\*\*)\s*[({{]?[+-]?\d+[)}}]?|{NUMBER}))(?![^\W_]|[.^])"
    ),
    re.compile(rf"(?P<said>(?<![\w.]){NUMBER}\s*(?:[*\u00d7\u00b7]|\\times|\\cdot))\s*[^\W\d]"),
    re.compile(r"\S\s+(?P<said>x\s*(?:[1-9]\d+|10\^[+-]?\d+|\d*\.\d+|\d+\.?\d*[eE][+-]?\d+))(?![^\W_]|\.)"),
    re.compile(r"^(?P<said>-)\s*[^\W\d]"),
    re.compile(r"^(?P<said>1\s*/)\s*[^\W\d]"),
    re.compile(r"[^\W\d](?P<said>\s*\+\s*\d[\d.]*)$"),
    re.compile(r"(?P<said>\^\s*[2-9]|\*\*\s*\d|[\u00b2\u00b3])"),
    re.compile(r"(?<![^\W_])(?P<said>(?:log|log10|log2|ln|lg|exp|sqrt|abs|sin|cos|tan|diff|fft)\s*\()", re.IGNORECASE),
)
"""A factor behind or in front of what it multiplies, a sign, an inverse, an offset, a power, a function."""
QUOTIENT = re.compile(rf"[^\s\d](?P<said>\s*/\s*(?!1$)(?=\d)(?:{NUMBER}))(?=$|_[A-Za-z]+$)")
"""Division by a number, or a number within a group."""


def formula_of(name: str, grouped: bool = False) -> str:
    """What a column's name says of a calculation with its numbers: `x*1e3 [um]`, `log10(x)`, `x [um] [mm]`; empty where it says nothing.
    `grouped`: a stroke in the name parts a group from a number in it, unless a unit stands behind in brackets."""
    bare = split_name(name)[0]
    if bare == name and unit_of(bare) is not None:
        return ""
    inner = BEHIND.match(bare)
    if bare != name and inner is not None and (first := unit_of(inner["unit"])) is not None:
        second = unit_of(split_name(name)[1] or "")
        if second not in (None, first) and same_dimension(first, second):
            return f"two units stand behind its name, {first} and {second}"
    patterns = (*FACTORS, QUOTIENT) if not grouped or BEHIND.match(name) is not None else FACTORS
    said = next((match["said"].strip() for pattern in patterns if (match := pattern.search(bare))), "")
    return f"its name states a calculation, {said!r}, which its numbers may be before or behind" if said else ""
