"""Settings of `ctrlgen.diagnosis.evidence`: where the residual is, unmodelled forces, the next experiment, bootstrap."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LtvModelSettings:
    """The model linearised along a motion."""

    block: int = 5000
    """Samples linearised at a time: bounds the memory."""
    standing: float = 1e-3
    """Speed over the fastest one, below which a stage counts as standing."""


@dataclass(frozen=True)
class LocalisationSettings:
    """Shares of the residual by reading, actuator, band, time, position and direction."""

    blocks: int = 60
    """Blocks of the bootstrap over all records: an interval's end is known to about 1/sqrt(120) = 9 %."""
    draws: int = 400
    """Draws of the bootstrap: ten lie beyond each end of a 95 % interval."""
    bands: int = 5
    """Frequency bands, logarithmic from one cycle a record to half the sampling rate."""
    times: int = 10
    """Equal parts of a record's time."""
    regions: int = 5
    """Parts of a coordinate with equal numbers of samples."""
    fewest_samples: int = 8
    """Samples in a cell that is reported."""
    position_degree: int = 5
    """Degree of the polynomial in position that is subtracted before the directions are compared. Judgement."""
    least_excess: float = 4.0
    """Standard deviations of chi-square of the whole excess, below which there is nothing to localise."""
    coherence_segments: int = 8
    """Segments of a record for the coherence with the drive, overlapping by half."""
    gathered: float = 0.95
    """Share of the squares of the residual that a stretch of one record must hold to be told. Judgement."""
    gathered_in: float = 0.4
    """Share of all samples above which such a stretch is none. Judgement."""
    of_motion: float = 0.5
    """Share of the motion's squares in such a stretch, above which the motion is why the residual lies there. Judgement."""
    stands_out: float = 0.1
    """Share of the excess by which one kind of coordinate must explain it better than the other. Judgement."""


@dataclass(frozen=True)
class SpectralLineSettings:
    """Odd, even and noise lines under a periodic drive."""

    excited: float = 1e-3
    """Amplitude over the drive's largest line from which on a line counts as excited."""
    answer_p: float = 1e-4
    """p below which lines count as above the noise."""
    highest: float = 3.0
    """Highest line that is looked at, over the highest excited one: a cubic law answers up to there."""


@dataclass(frozen=True)
class UnknownInputSettings:
    """The unknown disturbance along a record by Kalman smoother."""

    random_walks: tuple[float, ...] = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    """Variances of the disturbance's change a sample, in squares of its typical size; the most likely one is chosen."""
    pose_random_walks: tuple[float, ...] = (1e-3, 1e-2, 1e-1, 1.0, 10.0)
    """The same for settled poses, which lie farther apart."""
    tried_samples: int = 2000
    """Samples on which that variance is chosen: those with the largest residual."""
    most_samples: int = 20_000
    """Samples of one record that are smoothed: bounds time and memory."""
    missing_variance: float = 1e12
    """Variance of a sample that is not valid, over that of a valid one."""


@dataclass(frozen=True)
class MapSettings:
    """Maps of the unknown disturbance over position, velocity, temperature and time."""

    bins: int = 24
    """Bins of a map."""
    fewest_samples: int = 5
    """Samples in a bin that is shown."""
    most_axes: int = 2
    """Axes that a sentence describes, those with the largest disturbance."""


@dataclass(frozen=True)
class ExcitationSettings:
    """Drives of the next experiment."""

    strengths: tuple[float, ...] = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0)
    """Amplitudes that are tried, over the range of the drives; the largest that keeps every limit is taken."""
    limit_slack: float = 1e-6
    """Violation of a limit that counts as none, over the limit's own size: rounding."""
    lines: int = 15
    """Lines of a multisine, logarithmic and odd."""
    levels: tuple[float, ...] = (0.0, 1.0, 0.0, -1.0, 0.0, 0.5, 0.0, -0.5)
    """Levels of the drive of steps and rests."""
    slowest: float = 0.1
    """Slowest over fastest speed of a stroke at several speeds: a decade. Judgement."""
    band_share: float = 0.99
    """Share of the energy of a drive's changes that lies in its band: the hundredth is for the rounding of recorded numbers."""
    wider: float = 1.5
    """Each window that smooths a drive, over the one before. Judgement: at most half as much smoothing again as is needed."""
    both_ways: float = 0.5
    """Smaller over larger side of zero, from which on a drive counts as one of both signs, which rests at zero. Judgement."""
    rounding: float = 1e-9
    """Share of a range, rate or band that counts as rounding."""


@dataclass(frozen=True)
class ExperimentSettings:
    """The experiment that best separates rivals."""

    most_samples: int = 4000
    """Samples of a proposed series at most: bounds time."""
    most_poses: int = 100
    """Poses of a proposed list at most."""
    most_rivals: int = 2
    """Rivals of the chosen model that are compared."""
    suspects: int = 2
    """Rejected models that are compared where nothing explains the recording."""
    settles: float = 3.0
    """Standard deviations between two models' predictions that settle a doubt."""
    most_repeats: int = 30
    """Times that a proposed drive may have to be recorded: somebody has to do it. Judgement."""
    fitted_share: float = 0.6
    """Share of a proposed record that is to be fitted; the rest is held out."""


@dataclass(frozen=True)
class BootstrapSettings:
    """Settings of the residual block bootstrap."""

    percentiles: tuple[float, float] = (2.5, 97.5)
    """Ends of an interval [percent]."""
    fewest_replicates: int = 20
    """Replicates that a 95 % interval needs: half a replicate lies beyond each end."""
    fewest_blocks: int = 5
    """Blocks of a record at the least."""
    longest_lag: int = 200
    """Longest lag [samples] at which the residual's correlation is looked at."""
    correlated: float = 4.0
    """Standard deviations 1/sqrt(n) of a correlation above which it counts."""


@dataclass(frozen=True)
class LuckSettings:
    """The chance that luck found a cause."""

    certain: float = 0.05
    """Chance up to which a cause is told without a word of doubt: the usual level."""
    most_stretches: int = 100
    """Stretches of a record at the most: 2^-100 is less than any number of answers makes up for, and longer ones are more surely
    independent."""
    memories: float = 5.0
    """Length of a stretch in correlation times of the noise: with the gap, sums of neighbours correlate by half a per cent."""
    gap: float = 3.0
    """Gap before each, in the same: exp(-3) = 5 % of what was before it remains."""
    foretelling: float = 0.25
    """Share of a held-out record, its beginning, that tells a phase which no other record does; what it is told by is no evidence.
    Judgement."""
    white: float = 4.0
    """Standard deviations 1/sqrt(n) of the correlation from sample to sample up to which they count as independent."""
    most_causes: int = 4
    """Causes up to which every set of them is fitted where it must be: ten models beside those that the search knows."""
    doubt: float = 10.0
    """Standard deviations to which numbers that were fitted beside the cause are taken to be known, so that the held-out records tell
    them again: an error of two or three deviations does not count."""


LTV_MODEL = LtvModelSettings()
LOCALISATION = LocalisationSettings()
SPECTRAL_LINES = SpectralLineSettings()
UNKNOWN_INPUT = UnknownInputSettings()
MAPS = MapSettings()
EXCITATION = ExcitationSettings()
EXPERIMENT = ExperimentSettings()
BOOTSTRAP = BootstrapSettings()
LUCK = LuckSettings()
