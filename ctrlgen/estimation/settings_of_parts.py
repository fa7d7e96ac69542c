"""Settings of where records and fits begin, of profiles, and of what goes with the motion, for `ctrlgen.estimation.settings`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InitialMemorySettings:
    """Where the plays of a hysteresis stood when a record began."""

    rows: int = 300
    """Samples at the beginning of a record, a quarter of it at most, that tell where plays stood before. Judgement."""
    worse: float = 1.5
    """Mean square there over that of the rest, from which on the beginning is wrong. Judgement."""
    ways_back: tuple[float, ...] = (0.05, 0.15, 0.4, 1.0, 2.0)
    """How far the motion came back since it last turned, in prior deviations of a place, where the search for that begins. Judgement."""
    far: float = 30.0
    """From where every play is dragged along, in the same."""
    sides: tuple[float, ...] = (-0.875, -0.625, -0.375, -0.125, 0.125, 0.375, 0.625, 0.875)
    """Places of a driven side in its gap, in halves of it, from which a search begins, so near that a step reaches the next. Judgement."""
    quarters: tuple[float, ...] = (0.0, 0.25, 0.5, -0.25)
    """Values of an arbitrary state, such as a phase, in its typical size, from one of which steps lead to the right one."""
    behind: tuple[float, ...] = (-0.5, -0.25, -0.1, -0.03, 0.03, 0.1, 0.25, 0.5)
    """How far what a rate limits is behind its drive when a record begins, in prior deviations, from which a search begins. Judgement."""


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


@dataclass(frozen=True)
class MotionSettings:
    """Whether a residual goes with the motion."""

    degree: int = 5
    """Degree of the polynomials of place and drive: bends as short as a fifth of the range are followed. Judgement."""
    standing: float = 0.02
    """Rate over the largest one at which the sign of the rate is half there: below, noise of a differentiated drive turns it. Judgement."""
    plays: tuple[float, ...] = (0.02, 0.1, 0.3)
    """Half widths of plays over half the range: what a hysteresis near and far from its reversals remembers."""
    lags: tuple[float, ...] = (4.0, 16.0, 64.0)
    """Time constants [samples] of the low-passes: creep and lags. Judgement."""
    samples_per_function: int = 5
    """Samples for each function that a test needs, as of a test of whiteness."""
    alike: float = 1e-3
    """Singular value over the largest one below which a direction of the functions is one of the others."""
    p: float = 1e-4
    """p of going so well with the motion by chance, below which a residual does: the chance of a false alarm for each diagnosis of noise
    that nothing else tells."""


@dataclass(frozen=True)
class ProfileSettings:
    """Settings of the profile likelihood."""

    first_distance: float = 2.0
    """Distance from the optimum of the first point [standard deviations by curvature]: just outside of 95 %."""
    doublings: int = 3
    """Times the distance is doubled while the profile stays below the 95 % level: up to 16 standard deviations."""
    refit_ratio: float = 1.4
    """Rise over the quadratic one above which the other parameters are refitted. Below, their linear prediction shifts
    the interval's end by less than 1 - 1/sqrt(1.4) = 15 %."""
    overshoot: float = 1.5
    """Root of the rise over the 95 % level above which the end of the interval is looked for again."""
    most_steps: int = 8
    """Times it is looked for again."""
    same_end: float = 0.05
    """Relative distance from the optimum by which two ends are the same."""
    most_refits: int = 6
    """Steps of the fit of the others at one value."""
    cost: float = 5e7
    """Samples times states times sensitivities that all profiles of a diagnosis may take. Bounds the time;
    what remains has its interval by curvature."""
    fewest_points: int = 4
    """Points that are evaluated whatever they cost."""
    largest_ratio: float = 2.0
    """Squared residual over the noise's above which the objective is no likelihood, and no profile is evaluated."""
