"""Numbers put together of two whole ones without the zeros between: 12.7 for 12 s and 7 ms, as `%d.%d` prints it."""

from __future__ import annotations

import re
from collections.abc import Sequence

FRACTION = re.compile(r"(?:^|\d)[.,](\d+)\s*(?:[AaPp]\.?[Mm]\.?|Z)?$", re.ASCII)
FEWEST = 30
"""Different fractions of more than one digit of which none begins with a zero: of numbers written whole 1 in 10 does, so that 1 in 24
such columns passed; and these would have to end in zeros at different lengths as well, which no usual way to write numbers does."""


def unpadded(cells: Sequence[str]) -> str:
    """What is wrong with cells whose fractions lack the zeros in front; empty for others.

    A program that drops zeros at the end leaves none there, one that keeps them writes one length: fractions of several lengths that end
    in zeros and never begin with one are whole numbers.
    """
    found = {m[1]: cell for cell in cells if (m := FRACTION.search(cell))}
    longer = [fraction for fraction in found if len(fraction) > 1]
    most = max(map(len, found), default=0)
    short = next((f for f in sorted(found, key=lambda f: (not f.strip("0"), len(f))) if len(f) < most), None)
    padded = any(f.startswith("0") for f in longer)
    if len(longer) < FEWEST or padded or short is None or not any(f.endswith("0") for f in longer):
        return ""
    if not any(f.endswith("0") and len(f) < most for f in longer) and most > 2:
        return ""
    right = found[short][: -len(short)] + short.zfill(most)
    what = f"writes {found[short]!r} beside {found[next(f for f in longer if len(f) == most)]!r}, fractions that never have a zero in front"
    return f"{what}, as '%d.%d' prints whole numbers: {found[short]!r} is rather {right!r}; write the zeros (%0{most}d)"
