"""Settings of the regions of a motion in which a residual is, and of the laws that act in one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RegionSettings:
    """Regions of the motion in which most of what is left over is."""

    cells: int = 64
    """Cells of as many samples along a coordinate, between which an edge may lie."""
    fewest_in_cell: int = 4
    """Samples of a cell, below which nothing is said."""
    outlying: float = 0.99
    """Quantile of the residual's size beyond which it counts no more."""
    least_ratio: float = 1.5
    """Mean square inside over that outside, from which a region counts. Judgement."""
    draws: int = 99
    """Residuals in random order: chance exceeds the largest of them once in a hundred recordings."""
    usual_quantile: float = 0.95
    """Quantile of the largest contrast along one quantity in these, in which contrasts of that quantity count: five of them lie above."""
    blocks: int = 200
    """Stretches of a residual without memory that are put in random order. Judgement."""
    memories: float = 4.0
    """Correlation times of the residual that a stretch holds at least: what is cut at its ends is then a part of it. Judgement."""
    fewest_blocks: int = 20
    """Stretches at least, whatever the memory: fewer have too few orders. Judgement."""
    most_rows: int = 20000
    """Readings that are looked at: of more, every second, third and so on."""
    longest: float = 0.4
    """Cells of the longest stretch between two edges, over all: a longer one is what lies beyond one edge, or the other. Judgement."""
    shortest: int = 2
    """Cells of the shortest region."""
    least_outside: float = 0.1
    """Cells outside of a region, over all, which the numbers must be told by. Judgement."""
    least_inside: float = 0.002
    """Share of the samples inside, below which nothing is known of a region: a few. Judgement."""
    most_inside: float = 0.98
    """The same above which nothing is known outside of it. Judgement."""
    ridge: float = 1e-10
    """Added to the scaled slopes' products, where a number acts inside a region alone."""
    most: int = 2
    """Stretches that are tried. Judgement."""
    edges: tuple[float, ...] = (0.1, 0.25, 0.5, 0.75, 0.9)
    """Quantiles of a quantity at which an edge is tried that no residual shows: a fit moves it from there. Judgement."""
    silent: float = 2.0
    """Mean square outside of a region, over the least one, up to which that part is as quiet. Judgement."""
    score: float = 0.8
    """Share of the largest z^2 of the laws everywhere that one in a region which nothing showed must reach to be tried. Judgement."""
    share: float = 0.25
    """Share of the squares that a law everywhere leaves, which one in a region that nothing showed may leave to come before it: half the
    error. Judgement."""


REGIONS = RegionSettings()
