"""Settings of `ctrlgen.diagnosis.selection`: screen, search, model selection, verdict."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class ScreenSettings:
    """Score tests of all hypotheses."""

    free_direction: float = 1e-6
    """Singular value over the largest one, below which a direction of the free parameters is dependent on the others."""
    own_share: float = 1e-10
    """Share of a score's squares outside of the span of the free parameters, below which it cannot be told from them:
    rounding leaves that much."""
    least_reach: float = 1e-3
    """Standard deviations of all readings together that a law must move them by, at the largest amplitude that it may have, to be
    suspected: what does less is rounding, such as that of a lag in settled poses, and would need an amplitude without bounds."""
    false_alarm_quantile: float = 0.99
    """Quantile of the largest |z| among simulated records without mismatch that is the screen's threshold: one false
    alarm in a hundred rounds."""
    null_draws: int = 2000
    """Simulated records without mismatch: 20 of them lie above the threshold, which is so known to 22 % of its p."""
    most_lines: int = 3
    """Peaks of the residual's spectrum that are tried as frequencies of a candidate. Judgement."""
    spectrum_padding: int = 8
    """Zero padding of that spectrum: a peak is then within 1/16 of a bin."""
    event_times: int = 12
    """Equal parts of the records' time; an event is tried in the middle of each. Judgement: the fit refines it."""
    most_other_starts: int = 8
    """Further values of a candidate's shape parameters, beside the best, from which it may be fitted again. Judgement."""


@dataclass(frozen=True)
class SpatialPeriodSettings:
    """Periods and jumps of the residual along a path."""

    cells: int = 2**14
    """Equal cells into which the range of the path is divided."""
    finest_cells: int = 4
    """Cells of the shortest period: two are needed by the sampling theorem."""
    padding: int = 4
    """Zero padding of the spectrum along the path: a period is then right to 1/16 of a cycle over the whole path."""
    fewest_cycles: int = 20
    """Cycles within the path from which on a wave is sought apart from the slower ones, which trends feign."""
    fewest_slow_cycles: int = 3
    """Cycles within the path of the longest period: fewer are seen by the start values of the laws, if the path is the travel."""
    slowest_cycles: tuple[float, float] = (1.4, 3.2)
    """Cycles within a path that is short beside the typical size, about and below `fewest_slow_cycles`, between which one is sought."""
    slowest_tried: int = 361
    """How many of them are tried: the phase at a zero a hundred periods away is then right to a part of a turn."""
    short_path: float = 0.3
    """Path over the typical size, below which that is done: the start values of the laws are 1/20 of that size and more."""
    most_slow: int = 2
    """Periods between both that are tried. Judgement."""
    same_period: float = 1e-4
    """Relative difference below which two periods are one."""
    false_alarm_p: float = 1e-4
    """p of a peak so high anywhere in a spectrum without periods."""
    image: float = 0.8
    """Power of the image of a period, over that of the period itself, from which on samples do not tell which of both is there.
    One for even samples; places that jitter by a twelfth of their distance give 0.76. Judgement."""
    image_cells: int = 2**16
    """Equal cells of the path in which the samples' places are counted: four times those of the spectrum, so that the width of
    a cell takes 5 % off the image of its shortest period."""
    most: int = 3
    """Periods, and jumps, that are tried. Judgement."""
    jump_cells: int = 512
    """Equal cells of the path in which jumps are sought. Judgement."""
    jump_side: int = 16
    """Cells on either side of a place whose means are compared. Judgement."""
    kick: float = 1e-3
    """What is added to a drive for one sample, to see what the readings answer, in typical drives: little beside the motion. Judgement."""


@dataclass(frozen=True)
class SubsetSettings:
    """Sets of candidates that are tried together."""

    largest: int = 4
    """Candidates of the largest set."""
    beam: int = 200
    """Sets kept at each size."""
    own_share: float = 0.04
    """Share of a score's squares that must be left beside the others of its set: below, |cos| exceeds 0.98 and the
    amplitudes are arbitrary."""
    ridge: float = 1e-9
    """Added to the diagonal of the correlation matrix, so that sets of two dependent scores can be solved."""
    bound_margin: float = 0.35
    """How far beyond its bounds a linear estimate of an amplitude may lie, relative to their distance. The estimate is
    taken at zero amplitude, where the law may be bent. Judgement."""


@dataclass(frozen=True)
class SearchSettings:
    """Forward-backward search with swaps."""

    most_causes: dict[str, int] = field(default_factory=lambda: {"poses": 24, "series": 8})
    """Causes of a model at most, by kind of recording. Poses have many independent offsets. Judgement."""
    most_noise_updates: int = 8
    """Updates of the noise from the residual at most."""
    most_markings: int = 4
    """Times that spikes are marked again against what was accepted: each teaches the next less. Judgement."""
    usual_amplitudes: tuple[float, ...] = (1.0, 1.5, 2.0, 3.0)
    """Amplitudes, over that of the fit, at which a law in its usual shape is begun: amplitude and shape stand for one another, and
    samples that just touch a threshold make several optima. Judgement."""
    same_screen: float = 0.01
    """Relative change of the errors up to which a screen stays: scores change by as much. Judgement."""
    same_numbers: float = 0.1
    """Change of the free numbers, in standard deviations, up to which it does: scores are projected off the slopes of these numbers, and
    only change to second order. Judgement."""
    same_noise: float = 0.05
    """Relative change of the noise below which it counts as unchanged."""
    same_noise_size: float = 0.02
    """The same of noise that only the misfit tells: it is the yardstick of everything else. Judgement."""
    least_of_each_record: float = 0.5
    """Share of what is left of a reading that zeros, drifts or a jump of its records must take away to be tried. Judgement: most of it."""
    beside_jump: float = 0.02
    """Share of a run before and after a jump in which its size shows at once. Judgement."""
    fewest_beside_jump: int = 5
    """Samples of them at least: they know a jump of the size of the noise to 60 %, and one that is most of what is left far better."""
    sharp_jump: float = 0.7
    """Of the size of a jump, over the whole run, that shows close to it. A sine of one period in the run shows a sixth. Judgement."""
    candidates_per_round: int = 6
    """Single candidates fitted a round, and as many sets of each size."""
    far_off: float = 0.1
    """Residual over the motion that is read, both root mean squares, from which on the scores, of a linear model, tell little of which
    cause a fit reaches: the others are simulated too. Judgement: a tenth of the motion moves what acts on it by about as much."""
    far_off_factor: float = 4.0
    """By which their amplitude is raised or lowered as long as that comes nearer: an amplitude within twice of the best begins a fit.
    Judgement."""
    far_off_steps: int = 8
    """Times at most: five decades. Judgement."""
    far_off_fits: int = 3
    """Of them fitted, those that come nearest. Judgement."""
    cheap_factor: int = 3
    """Times as many for settled poses, whose fits are cheap."""
    regional_per_round: int = 3
    """Laws in a region fitted a round, beside them. Judgement."""
    candidate_steps: int = 8
    """Levenberg-Marquardt steps of a candidate at first; the promising ones are fitted until they converge."""
    causes_of_little: int = 2
    """Causes at once that are tried where what is left is too little to be worth a name but as a whole. Judgement."""
    converged_candidates: int = 2
    """Candidates a round that are fitted until they converge although they look useless: corners and events need many steps."""
    rival_share: float = 0.5
    """Share of what a cause explains that a rival must promise by its score to be fitted: shape parameters between the
    start values lose so much."""
    rival_margin: float = 60.0
    """By how much the criterion T of a rival that is fitted to its end may be worse, by the records to fit. Judgement."""
    rival_reach: float = 2.0
    """Objective of such a rival, over that of the model, that is allowed in any case. Judgement."""
    most_rivals: int = 8
    """Rivals fitted for a cause, beside those in a region: some of them meet an objection."""
    bound_slack: float = 9.0
    """Difference of the criterion by which a rival may be worse than what explains alike, where the cause has come to stand for
    something else (`other_laws`): three standard deviations more. Judgement."""
    most_searches_without: int = 2
    """Causes that have come to stand for something else, at most, without which is searched again: each search costs about as much
    as the first. Judgement."""
    most_searches_beside: int = 2
    """Refused candidates, at most, beside which is searched where nothing is accepted: each search costs about as much as the first.
    Judgement."""
    nearly_best: float = 0.9
    """Share of what the best candidate explains from which on another is fitted to the end before both are compared."""
    longest_shift: int = 64
    """Samples by which a signal may be early or late where a fit of it begins: what a camera or a bus is late by at usual rates. A fit
    goes on from there. Judgement."""
    shift_share: int = 8
    """The shifts tried are a sample apart, or this part of themselves: within half a period of a signal of a few periods, where
    neighbouring optima are told apart. Judgement."""
    halvings: int = 3
    """How often an amplitude from which no fit can begin is halved: the screen that promises it is linear. Judgement."""
    restarts: int = 4
    """Other shapes of a law from which it is fitted again, those that begin best: the valleys of one law. Judgement."""
    near_restarts: int = 2
    """The same of shapes that differ in one number. Judgement."""
    same_start: float = 10.0
    """Multiple of a positive shape's lower bound up to which a fit that is begun again there begins where it is. Judgement: of shapes
    over decades, one."""
    beside_clocks: int = 4
    """Candidates, the best first, beside which an offset of the clocks is tried: each such trial is a fit. Judgement."""
    generous_promise: float = 4.0
    """Times what it promises that a shift may take away. Where large residuals are limited it was 2.2 times as much, of a shift by a third
    of a sample; 1.04 times of one by seven or twenty samples."""
    subset_share: float = 0.1
    """Share of what the best smaller set leaves that a larger one must promise beyond it to be fitted. Judgement."""
    smallest_score: float = 0.25
    """Share of the largest z^2 below which candidates are not tried, unless nothing else is."""


@dataclass(frozen=True)
class ConfusableSettings:
    """What makes two causes confusable."""

    cosine: float = 0.98
    """|cos| of the projected sensitivities from which on they look alike: a linear estimate of one amplitude beside the other then
    has five times the standard deviation of one alone."""
    criterion: float = 9.0
    """Difference of the criterion T below which two models explain alike: three standard deviations."""
    most_listed: int = 3
    """Causes that are listed as alike at most."""
    form_samples: float = 6.0
    """Independent samples of an error of form in a channel: a smooth curve over the way with as many bends. Two models whose errors differ
    by less than a factor of 1.5 in both kinds of records are then not told apart. Judgement."""
    unfinished: float = 3.0
    """Multiple of the criterion within which a rival that was fitted for a few steps is fitted to its end: it leaves less then."""


@dataclass(frozen=True)
class ModelSelectionSettings:
    """Comparison of two candidate models, and what a further cause must show."""

    least_gain: float = 12.0
    """Decrease of the objective that a further cause must bring beside the price of its parameters. Chi-square with one
    degree of freedom exceeds it with p = 5e-4, for the cause was chosen among many."""
    least_confirmed: float = 2.0
    """z^2 by which the held-out records must confirm a cause, at least."""
    largest_contradiction: float = 4.0
    """z^2 by which the held-out records may contradict a cause that they cannot show: two standard deviations."""
    hidden_share: float = 0.5
    """Share of the decrease that comes from the stated numbers' penalty, above which the device hid the cause."""
    material_share: float = 0.1
    """Root mean square of a cause's effect on the records to fit, over the noise; smaller causes are not named. Design
    goal."""
    hidden_penalty: float = 16.0
    """Penalty of the device's stated numbers, beyond twice their count, that makes them suspect of hiding a cause: one
    number four standard deviations off."""
    worthwhile_share: float = 0.01
    """Share of the held-out excess over the noise that a further cause must explain: less is of no use to anyone. Judgement."""
    above_discrepancy: float = 0.05
    """The same where more than noise is left: less is within what the discrepancy of the other laws may feign. Judgement."""
    bent: float = 10.0
    """Stated standard deviations from which on a number of the device does the part of a cause that is missing. Judgement: those of data
    sheets are guesses, and one that is five off is common."""
    least_share: float = 0.01
    """Share of the whole mismatch of a channel, of energy on the held-out records, that a further cause must explain where more
    than noise is left: a tenth of the error. Judgement."""
    block_draws: int = 1000
    """Bootstrap samples of the blocks: they know a p of 5 % to 0.7 %."""
    block_p: float = 0.1
    """p of the bootstrap above which a gain is not that of the recording as a whole."""
    tie: float = 2.0
    """Difference of the criterion below which the commoner law is taken: a factor e of likelihood."""
    much: float = 0.75
    """Share of what is left in a channel, of energy on the held-out records, that a cause takes away to count although it is a
    small part of the whole mismatch: without it the error is twice as large. Judgement."""
    least_further_share: float = 0.25
    """The same of one more term of a law that is there already, such as a harmonic. Judgement."""
    beyond_form_error: float = 9.0
    """Energy on the held-out records without a cause, over that with it, from which on it is no model-form error of another law,
    although the sizes would allow that: a law in place of another's error rarely takes away more than eight ninths of it.
    Judgement."""
    worse: float = 1.02
    """Energy on the held-out records with the causes, over that of the device as described, from which on the answer is no better
    than that device: a hundredth of the error."""
    most_of_mismatch: float = 0.9
    """Share of the mismatch: a cause that explains so much of the records to fit need not be confirmed by held-out
    records that do not show it; and where accepted causes explain so much, only singles and pairs are searched (time
    series). Judgement."""
    vague_factor: float = 5.0
    """Factor on the model-form error of the other laws, for a cause whose amplitude may be zero. Judgement."""


@dataclass(frozen=True)
class PrecedenceSettings:
    """Laws that act with the motion before those that are functions of time alone."""

    nearly_as_much: float = 0.5
    """Share of the squares that an event, a drift or a line takes away which a law that acts with the motion must take away to
    come first where both leave more than noise: the search adds the other where it is still needed. Judgement."""
    speed_parts: int = 12
    """Equal parts of a record in each of which the mean speed is taken: long beside a pitch, which bends the reading. Judgement."""
    moving: float = 0.1
    """Speed, over the largest, from which a part counts as in motion. Judgement."""
    even_speed: float = 0.3
    """Range of the middle 60 % of the speeds, over their median, up to which a motion has one speed. A pitch of several hundred
    periods is then no line; it is tried as one all the same. Judgement."""


@dataclass(frozen=True)
class ObjectionsSettings:
    """What speaks against taking a cause for what its name says."""

    apart: float = 0.5
    """Cycles by which two lines must part within the records to fit: nearer, they beat as one."""
    at_bound: float = 1e-6
    """Share of an amplitude's range within which it is at its bound; of a shape see `SHAPE_AT_BOUND`."""
    told_shape: float = 1.0
    """Standard deviations by which all readings together must depend on a shape, per factor of e, to tell it."""
    told_loop: float = 3.0
    """Standard deviations by which all readings together must show a loop beside a part in proportion: three, which chance shows once
    in 370."""
    fewest_periods: float = 10.0
    """Periods of a line that the longest record to fit must hold: of fewer, any slow change looks like one.
    Judgement."""
    fewest_pitches: float = 1.5
    """Periods along a reading that it must cover: with less, nothing repeats and any curve looks like a part of one."""
    least_turn: float = 0.25
    """Turns that a reading must cover to show what repeats once a turn: in less than a quarter that is a gain and a bow. Judgement."""
    harmonic: float = 0.25
    """Cycles within the records to fit between a line and a harmonic of a periodic drive, below which they are one."""
    repeats: float = 0.9
    """Autocorrelation of a measured drive after a period, from which on it counts as periodic: a tenth of its power may be
    noise. Judgement."""
    sharp: float = 0.02
    """Rise of an event over the length of the record, above which it is no event: a fiftieth is what a figure of the record
    shows as a step. Judgement."""
    onset_samples: float = 5.0
    """Samples between an event and the onset of motion, below which they are one."""
    rest_samples: float = 20.0
    """Samples that a drive must stand before or after an onset: less is a reversal."""
    standing: float = 1e-4
    """Change of a drive from sample to sample, over its range, up to which it stands still. Judgement."""
    largest_drift: float = 0.2
    """Drift within the longest record to fit, over the range of the reading, above which it is none: a sensor that moves by a
    fifth of the motion would have been noticed. Judgement."""
    shortest_period: float = 3.0
    """Shortest period along a reading, in its quantisation steps: a shorter one is that of the rounding."""


@dataclass(frozen=True)
class PiledReadingsSettings:
    """When readings pile up at an end of what a sensor reads (`ends_of_readings`)."""

    width: float = 8.0
    """Standard deviations of the noise in which those at one value are: four either way."""
    narrow: float = 0.05
    """Share of what the sensor reads that this may be at most: within more, any reading is near an end. Judgement."""
    fewest: int = 20
    """Readings below which a motion that turns there does it."""
    crowd: float = 6.0
    """Times as many as within the next such width: a sine has 2.4 times as many. Judgement."""
    moves: float = 0.01
    """Share of its range by which a drive goes on meanwhile, so that it is no dwell. Judgement."""


@dataclass(frozen=True)
class DirectDetectionSettings:
    """Causes read directly from the readings: dead channels, quantisation."""

    noticed: float = 0.5
    """Root mean square of the effect over the noise, from which it is reported."""
    dead_motion: float = 0.01
    """Motion predicted at a constant channel, over the channel's typical size, above which the channel is called dead."""


@dataclass(frozen=True)
class AttributionSettings:
    """Shares of the mismatch."""

    most_causes: int = 4
    """Causes up to which all orders are averaged: 16 subsets. Of more, coming first and coming last."""
    draws: int = 1000
    """Bootstrap samples of the blocks: they know the ends of a 95 % interval to a fifth of its width's standard deviation."""
    least_excess: float = 0.02
    """Mean square beyond the noise, over the noise's, below which held-out records show no mismatch to share."""
    diverged: float = 4.0
    """Energy of a subset, over that of the device without any, that stands for a larger one: a cause without its partner may
    diverge."""
    first_share: float = 0.05
    """Share of the error that comes back without a cause, from which on it is among those that come first. Judgement: half of what may
    be a cause whose amplitude is not certain."""
    comes_back: float = 0.5
    """Share of the error that comes back without a law, from which on the law is needed: a constant beside it is part of it, and its
    own share may be uncertain. Judgement."""
    updates: int = 2
    """Estimates of the discrepancy of a set of causes, after each of which the device's own numbers are fitted: those of the accepted
    model leave several times what they leave once they are fitted, and the second ends where the tables do to a per cent or two."""
    steps: int = 4
    """Levenberg-Marquardt steps of each of these fits, from the numbers of the accepted model. Judgement."""
    fixed: float = 1e-9
    """Range, over its typical size, of a number that stays as it is: rounding."""
    least_share: float = 0.01
    """Share of the mismatch below which nothing is called a cause: a tenth of the error. Judgement."""
    vague_share: float = 0.1
    """The same of a cause whose amplitude may be zero. Judgement."""
    as_large: float = 0.1
    """Difference of two shares below which they do not say which cause is the main one. Judgement."""


SCREEN = ScreenSettings()
SPATIAL_PERIODS = SpatialPeriodSettings()
SUBSETS = SubsetSettings()
SEARCH = SearchSettings()
CONFUSABLE = ConfusableSettings()
MODEL_SELECTION = ModelSelectionSettings()
PRECEDENCE = PrecedenceSettings()
OBJECTIONS = ObjectionsSettings()
PILES = PiledReadingsSettings()
DIRECT_DETECTION = DirectDetectionSettings()
ATTRIBUTION = AttributionSettings()
