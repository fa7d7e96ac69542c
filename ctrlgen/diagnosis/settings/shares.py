"""Settings of `ctrlgen.diagnosis.shares`: how much of a residual is a function of what, whatever the law."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SharesSettings:
    """Blocks, smoothers and selection of the model-free shares."""

    most_samples: int = 4000
    """Samples of a channel over all records, one drawn from each of as many equal stretches: a share of 0.3 % is then three
    standard errors, and six channels take seconds."""
    fewest_blocks: int = 10
    """Blocks over all records at the least: a 95 % interval from fewer means little."""
    most_blocks: int = 40
    """Blocks over all records at the most."""
    correlation_times: float = 4.0
    """Length of a block in correlation times of the residual: at its middle exp(-2) = 14 % of a neighbour's influence remains."""
    correlated: float = 0.37
    """Autocorrelation at which the correlation time ends: 1/e, the usual definition."""
    folds: int = 10
    """Parts into which the blocks are dealt in turn; each part is predicted from the others."""
    spline_columns: int = 8
    """Cubic B-splines of one signal of a time series: bends as short as a fifth of its range are followed. Judgement."""
    spline_columns_many: int = 5
    """The same where a kind has more than two signals, to bound the number of columns."""
    spline_columns_poses: int = 3
    """The same for settled poses: a cubic, which 20 poses can bear."""
    ridges: tuple[float, ...] = (1e-6, 1e-4, 1e-2, 1e-1, 1.0)
    """Ridge weights tried, over the columns' unit variance; the one with the smallest error out of block is taken."""
    free_ridge: float = 1e-6
    """Largest ridge on the device's own free numbers, which the fit has left at their optimum: small enough to let them
    move with a smoother, large enough for numbers that the recording cannot tell apart."""
    chance_p: float = 0.025
    """Probability that a share is shown where there is none: one-sided test of the decreases by block with random signs."""
    sign_draws: int = 2000
    """Draws of the random signs: fifty of them lie beyond the limit."""
    draws: int = 400
    """Draws of the block bootstrap: ten lie beyond each end of a 95 % interval."""
    most_steps: int = 5
    """Kinds that the forward selection adds at the most: more than five are a background, not an answer. Judgement."""
    least_gain: float = 0.01
    """Share of the residual's energy that a further kind must add. Judgement: a hundredth does not matter to a reader."""
    many_columns: int = 150
    """Columns of all kinds beyond which not every kind is tried jointly with those already selected: bounds the time."""
    joint_candidates: int = 3
    """Kinds then tried jointly, the best by their gain on what the selected ones leave."""
    paired_candidates: int = 6
    """Kinds then tried in pairs: fifteen pairs."""
    alike: float = 1.0
    """Standard errors of the difference by block within which two kinds predict alike and the simpler one is preferred
    (the one-standard-error rule of Breiman et al., Classification and Regression Trees (1984), 3.4.3)."""
    plays: tuple[float, ...] = (0.005, 0.01, 0.025, 0.06, 0.15, 0.3, 0.5, 0.8)
    """Half widths of the play operators over half the range of their input: about a factor of two from near-reversal to
    most of the stroke."""
    standing: float = 0.001
    """Speed over the largest one below which an axis counts as standing; of settled poses the step over the range."""
    one_way: float = 0.01
    """Share of the samples that move backward up to which an axis counts as moving one way: a few swings at a start."""
    lags: int = 5
    """Time constants of the low-passed drive, logarithmic from four samples to the longest one."""
    longest_lag: float = 0.08
    """The longest of them over the longest record: less than a block where there are the fewest. In 60 random walks over
    random motion a lag of a third or a sixth of the record got a share above 5 % in 8 and 9, one of a twelfth in 1."""
    pose_lags: tuple[float, ...] = (1.0, 3.0)
    """The same in poses, for settled poses."""
    one_product: float = 0.5
    """Share of what all products of two signals predict that one has, from which it is named."""
    same_signal: float = 0.9995
    """Correlation of a drive with a position, speed or acceleration above which it is that signal and no further regressor:
    what differs is then below 3 % of it."""
    own_axis: float = 0.1
    """Part of a reading that an axis moves, over the largest such part, from which the axis counts as the reading's own."""
    shortest_pitch: int = 200
    """Periods of a pitch within the range of travel at the most: twenty of 4000 samples a period."""
    longest_pitch: int = 3
    """Periods of a pitch within the range of travel at the least: fewer are a bend, which splines follow."""
    line_periods: int = 10
    """Periods of a line in time within the longest record at the least."""
    past: tuple[int, ...] = (1, 2, 3, 5, 8, 13)
    """Lags [samples] of the residual's own past."""
    spike: float = 6.0
    """Robust standard deviations from the median of its neighbours beyond which a sample is a spike: of a million normal
    ones none."""
    spike_window: int = 7
    """Samples of that median: three in succession can still be a spike."""
    most_spikes: float = 0.01
    """Share of samples up to which such samples are spikes; more of them are structure and are kept. Judgement."""
    told: float = 0.05
    """Share below which a sentence does not name what has it: the half width of a usual interval. Judgement."""
    more_than_noise: float = 1.2
    """Residual over noise from which a channel may get an empirical term: below, a term saves less than a tenth of the error."""
    empirical_channels: int = 3
    """Channels that may get empirical terms, those with the largest residual: bounds the time."""
    turning_speeds: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3, 1.0)
    """Speeds v_c of `empirical_speed` that are tried, over the typical speed: from a change of sign to a curve."""
    reaches: tuple[float, ...] = (0.4, 0.1, 0.025)
    """Widest plays of `empirical_history` that are tried, over the range of the travel: most of it to what a joint yields."""
    weight_ridges: tuple[float, ...] = (1.0, 0.1, 0.01, 1e-3, 1e-4)
    """Ridges on the weights of an empirical term that are tried, weights counted in the residual's deviation: from weights of its
    own size to free ones."""
    mostly: float = 0.5
    """Share from which on a residual is mostly a function of something: the larger half."""


SHARES = SharesSettings()
