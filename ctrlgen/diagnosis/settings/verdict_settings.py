"""Settings of the verdict, and of what stands first in the answer."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VerdictSettings:
    """Thresholds of the verdict."""

    most: float = 0.75
    """Share of the mismatch, of energy, that confirmed causes must take away to explain it partly. Judgement."""
    main_share: float = 0.25
    """Share of a cause, over the largest one, from which rivals of it make the whole answer ambiguous: which of two small
    causes it is does not change the main one. Judgement."""
    same_shape: float = 0.95
    """Squared correlation of a reading with the device as described from which on they differ by a factor alone. Judgement."""
    same_unit: float = 0.03
    """Distance of that factor from a power of a thousand, in such powers: a fifth of the factor. Judgement."""
    no_larger: float = 2.0
    """Mean square of what is left, over that of the noise, up to which it is no larger than the noise, so that no single reading shows
    it: 1.4 times the noise, root mean square."""
    unseen_share: float = 0.1
    """Share of the mismatch, of energy, up to which that is little: a third of the error. Judgement."""
    impossible_p: float = 1e-6
    """p of the device's stated numbers so far off by chance, below which they contradict the data sheet."""
    named_deviation: float = 2.0
    """Stated standard deviations from which on such a number is named."""
    considerable: float = 0.2
    """Share of the causes worth a fit, or of the laws offered, from which on it stands in the answer that errors kept them from being
    tried. Judgement."""
    far: float = 4.0
    """Stated standard deviations from which on a moved number of the device stands in the answer: chance moves one so far once in
    16,000."""
    beyond_guess: float = 10.0
    """Times the guess of a noise that nothing tells from which on what is left is doubted to be it. Judgement: slow noise of a sensor is
    several times its fastest part."""
    clock_deviations: float = 3.0
    """Standard deviations of a mass and a damping about those that wrong times would make, within which that may be it."""
    clock_off: float = 1.1
    """Times too long, or too short, from which the time is doubted: numbers of a device are known no better. Judgement."""
    undone: float = 0.1
    """Change of a number of the device that others must undo in the readings, for it to be told only beside them; and how much of the
    largest such other one moves to be named. Judgement."""
    as_read: float = 0.3
    """Share of what is read, root mean square, from which on so much noise would have been told. Judgement."""


@dataclass(frozen=True)
class StandingSettings:
    """What the model-free shares must say against a cause, so that it does not stand first."""

    near_zero: float = 0.05
    """Share of a family below which it has none: the half width of a usual interval."""
    far_below: float = 0.2
    """Share of a family over the largest one, below which it is far behind. Judgement."""
    clear: float = 0.5
    """Share of the largest family, below which the shares tell no family: the larger half."""
    as_much: float = 0.9
    """Share that a kind of a family predicts alone over that of the largest family, from which on the two are one signal to the shares.
    Judgement; of a piezo stack under a sine the history of travel predicts 97 % and the speed 97 %, selected first."""


STANDING = StandingSettings()
VERDICT = VerdictSettings()
