"""Lines and points told apart without their colour: the one list, of drawings and of figures that zoom."""

from __future__ import annotations

from typing import Any

# pixels that are drawn and left out in turn
DASHES: tuple[tuple[int, ...], ...] = (
    (),
    (7, 4),
    (8, 3, 2, 3),
    (2, 3),
    (14, 5),
    (9, 3, 2, 3, 2, 3),
    (14, 3, 6, 3),
    (2, 2, 2, 8),
    (14, 3, 2, 3, 2, 3, 2, 3),
    (4, 10),
    (20, 4, 4, 4, 4, 4),
    (1, 8),
)
# Points, by the letters of matplotlib
MARKS = ("o", "s", "^", "D", "v", "x", "+", "*", "<", ">", "p", "h")
SOLID, DASHED, DASH_DOTTED, DOTTED = range(4)
LINE = 1.3  # width of a line; points
PER_WIDTH = 72 / 96 / LINE  # a pixel of the page, in the widths of such a line, in which matplotlib counts dashes


def dashes(k: int) -> Any:
    """The style of the k-th line, as matplotlib takes it."""
    pattern = DASHES[k % len(DASHES)]
    return (0, tuple(PER_WIDTH * n for n in pattern)) if pattern else "-"


def mark(k: int) -> str:
    """The marker of the k-th points, as matplotlib takes it."""
    return MARKS[k % len(MARKS)]
