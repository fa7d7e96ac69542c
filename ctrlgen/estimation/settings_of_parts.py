"""Settings of the parts of records on which fits begin, for `ctrlgen.estimation.settings`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LeadingPartSettings:
    """The beginning of records on which fits begin."""

    shares: tuple[float, ...] = (0.25, 0.5)
    """Shares of a record that are tried, the shortest first: on a quarter a descent takes a quarter of the time. Judgement."""
    shortest: int = 2000
    """Samples of such a part at least: with fewer a step takes as long as what goes around it."""
    longest: float = 0.6
    """Share of all samples up to which beginning there pays: a third of the steps is left on all of them."""
    tail: float = 0.01
    """Share of the values on either side that do not count in a range: noise and single steps reach far. Judgement."""
    missing: float = 0.25
    """Share of the range of the whole record that may be missing on either side of that of its part: half the amplitude shows where a
    descent should go. Judgement."""
    negligible: float = 1.0
    """Squared standard deviations for each free number: a step on the part that promises less ends there. The optimum of a part is off
    by that much in its own objective."""
    kept: int = 4
    """Recordings whose part is kept at a time: a search marks its samples again a few times."""
