"""Settings of `ctrlgen.estimation`: noise, simulation, fit, residual tests, uncertainty of the parameters."""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.estimation.settings_of_parts import (
    InitialMemorySettings,
    LeadingPartSettings,
    MotionSettings,
    ProfileSettings,
)


@dataclass(frozen=True)
class StatisticsSettings:
    """Levels that several steps share."""

    z_95: float = 1.959964
    """Half width of the two-sided 95 % interval of a normal variable, in standard deviations."""
    chance_excess: float = 4.0
    """A sum of n whitened squares is noise up to n + this many standard deviations sqrt(2 n) of chi-square. One-sided
    p = 3e-5: a diagnosis compares some tens of such sums."""
    noise_size_margin: float = 2.6
    """Standard deviations by which the noise may exceed its own estimate. A standard deviation estimated from N samples
    is known to 1/sqrt(2 N) of itself; 2.6 leaves one-sided p = 0.5 %."""
    mad_to_sd: float = 1.4826
    """Standard deviation of a normal variable over its median absolute deviation: 1/0.67449."""
    whiteness_lags: int = 20
    """Lags [samples] of the tests of whiteness. More than twice the longest autoregressive order of the noise."""
    fewest_per_lag: int = 5
    """Samples per lag that a test of whiteness needs, so that its chi-square approximation holds. Rule of thumb."""


@dataclass(frozen=True)
class NoiseSettings:
    """Noise estimated from rest, repeated periods, dwells or the fastest part of the readings."""

    longest_order: int = 8
    """Highest order [samples] of the autoregressive model that BIC may choose. Judgement: the filters of sensors and
    converters have fewer poles."""
    shortest_stretch: int = 200
    """Samples that a stretch must have: 25 for each of eight autoregressive coefficients."""
    quiet_share: float = 0.1
    """Share of the differences within the band of a low-pass, the smallest, that are taken as noise alone. Judgement: a noise
    that is too small is corrected by the residual, one that is too large hides physics."""
    dwell_degree: int = 4
    """Degree of the polynomial subtracted from a dwell. Creep and thermal lag go on there and are smooth. Judgement."""
    stated_samples: float = 1000.0
    """Samples that a stated standard deviation counts for, that is, it is trusted to 1/sqrt(2000) = 2 %. Judgement."""
    most_lines: int = 3
    """Sinusoids that are subtracted from a stretch at most: mains, its harmonic, one machine. Judgement."""
    level_bins: int = 15
    """Width [bins of the unpadded spectrum] over which the noise's spectrum counts as level. Judgement."""
    line_ratio: float = 40.0
    """Power of a line over the median around it. The bins of noise are exponential with median ln 2 of their mean: one
    bin in exp(40 ln 2) = 1e12 is higher."""
    loudest_stretch: float = 1.5
    """Variance of a stretch over the median variance of all, above which it is left out: something happened in it.
    200 samples know a variance to 10 %."""
    far_louder: float = 4.0
    """Median variance over that of the quietest tenth, above which most stretches hold more than noise. Judgement: noise of a long memory
    differs less."""
    moves_in_dwells: float = 3.0
    """Noise in dwells over the stated one, above which the device moves in them. Judgement: a stated noise is right to a factor of two."""
    slow_ratio: float = 3.0
    """Standard deviation of coloured noise over that of its innovations, above which a note says that the slow part may
    be motion of the device. Reached by a first-order model with coefficient 0.94. Judgement."""
    same_drive: float = 1e-9
    """Share of the drive's range below which two drives are equal: above rounding of nine written digits."""
    fewest_repeats: int = 6
    """Repeated poses beyond the first of each that tell a standard deviation: to 1/sqrt(12) = 29 %."""
    robust_cost: float = 5.0
    """The median of third differences knows the standard deviation as well as a sample variance of so many times fewer
    samples: 4.6 in 4000 simulated records of white noise."""


@dataclass(frozen=True)
class ResidualNoiseSettings:
    """Noise estimated from the residual at the frequencies at which the readings move least."""

    shortest: int = 200
    """Samples that a stretch must have: fewer leave too few quiet bins for two parameters."""
    smoothing_bins: int = 31
    """Bins of the running median that smooths a spectrum: its median is known to 1/(sqrt(31) ln 2) = 26 %. Judgement."""
    line_ratio: float = 10.0
    """Power over the running median, above which a bin is a line and is left out; noise exceeds it once in 1e3 bins,
    which costs nothing here."""
    largest_pole: float = 0.95
    """Largest magnitude of the coefficient a of the first-order model. Slower noise has its power where the device
    drifts, and the quiet bins do not determine it. Judgement."""
    agreement: float = 2.0
    """Power over the fitted noise up to which a further bin is added to the quiet ones. Judgement."""
    widenings: int = 4
    """Times that bins are added and the model is fitted again. Judgement."""
    window_bins: float = 2.0
    """Bins that the Blackman-Harris window makes dependent (equivalent noise bandwidth 2.0): so many times fewer
    independent bins (F. J. Harris, Proc. IEEE 66 (1978) 51)."""
    within_band: float = 0.8
    """Share of a low-pass's cut-off up to which its noise is seen: the filter of the columns takes 4 % of an amplitude
    there."""
    first_bin: int = 4
    """Lowest bin that is used: below, the main lobe of the Blackman-Harris window, four bins wide, holds the mean."""


@dataclass(frozen=True)
class NoiseUpdateSettings:
    """Noise model updated from the residual of a fit."""

    guessed_refits: int = 2
    """Fits of the described device after which guessed noise is estimated again from the residual: each makes the next
    residual whiter. Judgement."""
    largest_residual: float = 1.3
    """Root mean square of the residual over the noise, below which the residual's colour is taken as the noise's. A
    larger residual holds physics that was left out. Judgement."""
    stated_factor: float = 3.0
    """Factor by which a stated noise may be wrong: half of the true one is a common mistake, and is known with its scatter.
    Judgement."""
    stated_margin: float = 0.05
    """Relative difference of the residual from the stated noise up to which the statement stands: data sheets round."""
    noise_alone_p: float = 1e-4
    """p of whiteness, steady variance and no correlation with the drive, above which a residual is noise alone: three tests a
    record."""
    fewest_poses: int = 30
    """Readings of settled poses that tell a standard deviation: to 1/sqrt(60) = 13 %."""
    poses_per_feature: int = 4
    """Readings for each function of the drive by which the residual of poses is tested: Judgement."""
    pose_alone_p: float = 1e-2
    """p of each test of settled poses, above which their residual is noise alone: a few dozen poses tell little, and to leave a noise
    as it was stated hides nothing."""
    pose_lags: int = 5
    """Poses over which their residual is tested for memory. Judgement."""
    bridged: int = 3
    """Samples in a row without a reading that a straight line bridges where guessed noise is taken from a residual: one in a hundred
    changes a variance by half a hundredth. Judgement."""
    other_colour_p: float = 1e-4
    """p of whiteness at rest below which the colour found in the residual is not that of the noise."""


@dataclass(frozen=True)
class OutlierSettings:
    """Isolated outliers of the residual."""

    threshold: float = 7.0
    """Standard deviations, by the median absolute deviation, of the deviation from the median of the samples around. Normal
    noise does that once in 4e11 samples."""
    around: int = 7
    """Samples whose median an outlier deviates from: three on either side."""
    local: int = 51
    """Samples over which the local deviation is taken: its median is known to 17 %."""
    largest_share: float = 0.01
    """Share of a channel's samples; where more stand out, they are no isolated faults and all are kept. Judgement."""
    largest_share_again: float = 0.03
    """The same against a model that was accepted, which leaves less that could be taken for one. Beyond, every third median of the
    samples around would hold another one. Judgement."""
    explained: float = 4.0
    """Standard deviations of the noise up to which a reading that was marked before is explained by another model: normal noise
    has one in 16 000 beyond."""
    widest: int = 2
    """Samples of one outlier. A mechanism cannot leave and return within two samples."""
    neighbour_share: float = 0.3
    """Share of an outlier that the samples beside it may have: a mass that is pushed moves before and after. Judgement."""
    fewest_by_motion: int = 5
    """Outliers of a channel that tell whether they come with the motion: of fewer, the test below rejects nothing."""
    by_motion_p: float = 1e-5
    """p below which outliers do: three tests of each channel and record."""
    beyond_noise: float = 4.0
    """Standard deviations of the whitened residual from which an isolated sample is counted as a small spike: normal noise has
    one in 16 000."""
    beyond_noise_p: float = 1e-4
    """Probability that normal noise has so many of them, below which they are told: a few dozen channels are looked at."""


@dataclass(frozen=True)
class PoseOutlierSettings:
    """Outliers of settled poses, which have no neighbours in time."""

    threshold: float = 7.0
    """Robust standard deviations of the channel's residual, as of a series."""
    fewest: int = 20
    """Poses that a channel must have: their median absolute value is known to 25 %."""
    largest_share: float = 0.03
    """Share of a channel's poses; where more stand out, all are kept, as of a series."""
    nearest: int = 2
    """Nearest poses by drive, each over its range, that must have little of it: what acts in a region acts there, too. Judgement."""


@dataclass(frozen=True)
class HeldSettings:
    """Stretches in which a reading is held although the model moves."""

    shortest: int = 5
    """Equal readings in a row, as of a channel that is clipped."""
    moves: float = 7.0
    """Standard deviations of the noise by which the model moves meanwhile, and leaves the reading: as of an outlier."""
    noise_ratio: float = 1.3
    """Robust standard deviation of the residual elsewhere over the noise: everything else is explained, but for what the stretches
    themselves bend the fit. Judgement."""
    beyond: float = 1e-3
    """Share of the residual elsewhere that may be beyond `moves`: small spikes. Judgement."""
    most: int = 5
    """Stretches of one record. Friction holds a stage at every reversal. Judgement."""
    largest_share: float = 0.1
    """Share of a record's readings in such stretches. Judgement."""


@dataclass(frozen=True)
class SimulationSettings:
    """Simulation of a record with its sensitivities."""

    kept: int = 32
    """Compiled simulators kept at a time. One of a hexapod takes some 2 MB, and a search uses some hundreds: of messy poses 32 keep it
    at 0.8 GB where 128 keep it at 1.0, in 3 % less time."""
    kept_splines: int = 8
    """Splines through the drives of records kept at a time: a search has as many records in turn. Judgement."""
    kept_predictions: int = 16
    """Predictions of records kept at a time: what one fit is judged by, on as many records. Judgement."""
    start_newton_steps: int = 12
    """Newton steps from home to the first displacement in balance, unrolled. Later samples start from the one before."""
    settling_samples: int = 2000
    """Samples at most under the first drive of a record after which its actuators are taken to have settled there. Judgement."""
    newton_steps: int = 4
    """Newton steps a sample of a device in balance: from the sample before, each doubles the digits."""
    pose_newton_steps: int = 8
    """Newton steps a settled pose: poses lie farther apart than samples."""
    settling_sample_time: float = 1e-3
    """Sample time [s] of the model from which the settling time is read, delays left out of it."""
    shortest_spline: int = 4
    """Samples that a cubic spline through a drive needs."""
    parametric_operations: int = 500
    """Operations on parameters alone from which on they are evaluated once a record: passing their results to every sample
    costs time, too. Judgement."""
    kept_cores: int = 8
    """Functions of a device's own numbers kept with their Jacobian: of those to fit and of those suspected, with a record's readings.
    Judgement."""


@dataclass(frozen=True)
class FitSettings:
    """Least squares on the records to fit."""

    max_steps: int = 40
    """Levenberg-Marquardt steps of one fit at most. Judgement."""
    residual_limit: float = 1e8
    """Whitened residual that stands for a larger or undefined one, where a simulation has diverged."""
    reading_limit: float = 1e30
    """Reading [SI] that stands for a larger or undefined one: its square is still a double."""
    poor_start_rms: float = 100.0
    """Root mean square of the whitened residual above which the described device is fitted from further starting values.
    So large a mismatch may be a local optimum. Judgement."""
    restart_amplitude: float = 0.01
    """Share of a new cause's suspected amplitude at which a fit starts again that ended above the model nested in it."""
    longest_log_step: float = 1.5
    """Largest step of a parameter that is fitted by its logarithm: a factor of 4.5. Judgement."""
    start_size: float = 0.3
    """Standard deviation of a record's initial state, as a share of the state's typical size. Judgement."""
    start_reach: float = 1e3
    """Bound of an initial state, in those standard deviations: only the prior holds it."""
    nuisance_reach: float = 100.0
    """Bound of an uncertain number of the device, in its stated standard deviations: only the prior holds it."""
    smallest_share: float = 1e-3
    """An uncertain number keeps its sign, and at least this share of its nominal value."""
    suspected_reach: float = 0.9
    """Share of a suspected number of the device by which it may be smaller; ten times as much by which it may be larger:
    from a tenth to ten times."""
    suspected_step: float = 1e-3
    """Share of a number's typical size that counts as one while it is fitted or screened. Judgement."""
    suspected_angle: float = 0.5
    """The same for an angle [rad], whose nominal value may be zero."""


@dataclass(frozen=True)
class HeldOutRefitSettings:
    """Parameters refitted to the held-out records under their posterior from the fit."""

    max_steps: int = 4
    """Gauss-Newton steps of a comparison of structures."""
    max_steps_tests: int = 20
    """Gauss-Newton steps before the residual tests, which need the minimum itself."""
    halvings: int = 6
    """Halvings of a step that does not lower the objective."""
    max_steps_to_begin: int = 20
    """Levenberg-Marquardt steps to the initial states of a record after the first: of a hexapod whose heaters are hot, under a large
    discrepancy, 7 to 12 were needed. Judgement."""
    unsettled: float = 0.01
    """Share of the objective by which the first step brings less than it promised, and brings at all, from which on others follow."""
    settled: float = 0.1
    """Decrease of the objective [squared standard deviations] below which the refit ends."""


@dataclass(frozen=True)
class ResidualTestsSettings:
    """Model validation on the held-out records, the fitted ones and rest."""

    error_ratio: float = 1.10
    """Root mean square of the whitened held-out residual up to which a model is valid. Design goal."""
    whiteness_p: float = 1e-4
    """p below which a test of whiteness rejects: a diagnosis makes about a dozen of them."""
    noticed_ratio: float = 1.02
    """A rejected test of whiteness counts only where the error ratio exceeds this: long records reject residuals that
    are white for every practical purpose."""
    uneven: float = 5.0
    """Times as much that one record leaves as another, from which on it is no noise of both: a slow one differs by two
    or three. Judgement."""
    rest_p: float = 1e-6
    """p below which the residual at rest is not noise. Smaller than `whiteness_p`, for the noise was estimated there."""
    spike: float = 3.9
    """Standard deviations from which a sample at rest is a spike: normal noise has one in ten thousand."""
    rare: float = 0.005
    """Share of spikes below which they are left out of the test for heavy tails, as faults of a sensor. Judgement."""
    coarse_reading: float = 0.5
    """Quantisation step over the noise above which rest is not tested: the tests would see the steps."""
    size_p: float = 1e-3
    """p of so large a residual by chance, below which an error ratio above the limit counts: a short record exceeds the
    ratio by chance."""


@dataclass(frozen=True)
class DiscrepancySettings:
    """Discrepancy of the model, and the loss of single samples."""

    ratio: float = 1.1
    """Root mean square of the whitened residual up to which it is noise: the limit of the residual tests."""
    uncorrelated: float = 0.05
    """Correlation below which the sum of the correlation time ends: what follows is its own uncertainty."""
    fewest_independent: float = 30.0
    """Correlation times that a record holds at least: fewer do not tell the correlation time itself. Judgement."""
    updates: int = 10
    """Most times that discrepancy and fit are estimated in turn: three do where the numbers are nearly right, more in a stiff loop."""
    same: float = 0.05
    """Relative change of the errors' deviation below which they count as unchanged."""
    blocks: int = 20
    """Blocks of a record in which squares of two models are compared: enough for a bootstrap, long beside most memories. Judgement."""
    huber_corner: float = 3.0
    """Standard deviations from which on a sample counts by its size, no longer by its square. Normal noise exceeds 3 once in
    370 samples and loses 0.5 % of the efficiency (P. J. Huber)."""


@dataclass(frozen=True)
class RobustCovarianceSettings:
    """Sandwich covariance by blocks of time."""

    blocks: int = 40
    """Blocks of time; more where there are many parameters. They know a standard deviation to 1/sqrt(80) = 11 %."""
    blocks_per_parameter: int = 3
    """Fewest blocks per free parameter: with fewer, the sum of squared scores is almost singular."""
    agreement: float = 1.25
    """Sandwich over model standard deviation up to which the model's is kept: two of the sandwich's own 11 %."""


@dataclass(frozen=True)
class CandidateTermsSettings:
    """Candidate terms propagated along the motion of the current model, and their score."""

    highest_frequency: float = 0.49
    """Highest frequency of a candidate, as a share of the sampling rate: beyond one half it looks like a lower one, and
    at one half like nothing or an offset."""
    settled_time: float = 1e9
    """Sample time [s] of a settled pose: every lag has passed."""
    block: int = 500
    """Samples that are propagated at a time: their sensitivities stay in the processor's cache."""
    likely_screens: float = 3.0
    """Screens of a diagnosis, by which it is decided whether to compile what they evaluate: with one cause there are three."""
    diverged: float = 1e100
    """Magnitude of a state above which a candidate has diverged and is left out."""
    samples_in_loop: float = 8.0
    """Samples up to which a delay in the reading of a feedback loop is looked for: there each is a state of the simulation, and a loop
    that is later than that does not stand. Judgement."""


STATISTICS = StatisticsSettings()
NOISE = NoiseSettings()
RESIDUAL_NOISE = ResidualNoiseSettings()
NOISE_UPDATE = NoiseUpdateSettings()
OUTLIERS = OutlierSettings()
POSE_OUTLIERS = PoseOutlierSettings()
HELD = HeldSettings()
SIMULATION = SimulationSettings()
FIT = FitSettings()
INITIAL_MEMORY = InitialMemorySettings()
LEADING_PART = LeadingPartSettings()
MOTION = MotionSettings()
HELD_OUT_REFIT = HeldOutRefitSettings()
RESIDUAL_TESTS = ResidualTestsSettings()
PROFILE = ProfileSettings()
DISCREPANCY = DiscrepancySettings()
ROBUST_COVARIANCE = RobustCovarianceSettings()
CANDIDATE_TERMS = CandidateTermsSettings()
