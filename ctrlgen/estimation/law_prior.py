"""What can be believed of a law beforehand: how common it is, how far its form may be from nature, where a fit of it may start.

`priors` has a row of these for each law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, log

from ctrlgen.effects import Param

ONE_IN_TEN = -2.3  # ln(1/10)
ONE_IN_A_HUNDRED = -4.6
ACROSS = "periods_across"


@dataclass(frozen=True)
class ParameterPrior:
    """Where the search looks for one parameter. Numbers count in the unit of the parameter's bounds.

    start_values: values from which a fit may start; of an amplitude, values at which the law is also linearised (by the secant
        from `off`), for laws whose effect is not proportional to a small amplitude.
    scales_with_peak: the start values are multiples of the largest value in the recording of the signal of that unit: the
        channel's, the travel's, their rates, or, for a time, one twelfth of the recording's duration.
    start_from_data: starts that the recording suggests are tried too: "spatial_periods" (periods along the path that stand out of
        the residual), "drive_levels" (of the drive after which it repeats), "jump_positions" (places along the path at which it
        jumps), "moments" (times spread over the recording); where most of the residual is, by a test whose level holds:
        "edges_above", "edges_below", "edges_outward", "edges_beyond" (ways from home), "speeds", "drives", "since" (a time) and
        "warmer" (a temperature) beyond which it is, "middles" and "lengths" of stretches of the reading; "reading_ends", at which
        readings pile up; "periods_across", of a pair: periods along the reading of the other channel. Frequencies in Hz always take the
        lines of the residual's spectrum as well.
    only_from_data: the law is not suspected where the recording suggests no start.
    plausible_range: of an amplitude: a fit that ends outside is another cause under this law's name, and is rejected.
    usual: of a shape: the value of the plain form of the law, which is taken where the fit does not exclude it: what the records to fit
        leave open, records that go farther show.
    again_at_low: of a positive shape: a fit is begun again at its lower bound, and that is kept where both kinds of records together want
        it: what records to fit hardly tell, held-out records do (`selection.begun_again`).
    fixed_range: of an amplitude: the law is present or absent. Its amplitude is set to the middle of the range, not fitted.
    deviation: of an amplitude: its standard deviation among devices whose file states none (`estimation.size_odds`).
    proportional: of a shape: it adds a part in proportion to the signal, and what the law adds is nothing else where there is no loop.
    """

    start_values: tuple[float, ...] = ()
    scales_with_peak: bool = False
    start_from_data: str = ""
    only_from_data: bool = False
    plausible_range: tuple[float, float] | None = None
    fixed_range: tuple[float, float] | None = None
    proportional: bool = False
    usual: float | None = None
    again_at_low: bool = False
    deviation: float | None = None

    def suggestion(self, partner: str | None) -> str:
        """The name of its starts among those that the recording suggests; of a pair with the `partner`."""
        return f"{ACROSS} {partner}" if self.start_from_data == ACROSS else self.start_from_data


def peaks(*multiples: float) -> ParameterPrior:
    """Start values in multiples of the peak in the recording."""
    return ParameterPrior(multiples, scales_with_peak=True)


CREEPING = ParameterPrior((1e-4, 0.1), scales_with_peak=True, again_at_low=True)
"""Of the speed below which a contact creeps under a lasting load."""

SECOND_ORDER_FILTER = {
    "share": ParameterPrior(plausible_range=(0.7, 1.3)),
    "tau": ParameterPrior((1e-3, 8e-3, 0.06, 0.5)),
    "damping": ParameterPrior((0.7, 4.0)),
}
"""Of a filter of a reading or of a drive: it acts on the whole of it, and one that is fitted to a part stands for something else. In
firmware, y += (new - y)/2^k, it lets a quarter through at once where k = 2."""

LEVELLING_OFF = {
    "share": ParameterPrior(fixed_range=(0.5, 1.5)),
    "level": peaks(0.6, 1.5),
    "sharpness": ParameterPrior((1.2, 2.5, 6.0)),
}
"""Of a curve of a drive or of a reading: between iron and an amplifier that nearly clips."""


@dataclass(frozen=True)
class LawPrior:
    """What the search believes of one law.

    log_prior_odds: ln of how many times commoner the law is than a wrong gain; decides among causes that explain alike.
    model_form_error: error of the law's form after its parameters are fitted, as a share of what the law explains.
    form_of: name of the physics of which laws are forms, finer than their `Effect.family`; a place has at most one form of it.
    refines: the plainer laws of which this is a finer form, with more numbers or for signals that change faster. It is never suspected
        itself, but tried in the place of one of them that is among the causes, where that leaves more than noise.
    in_place_of: laws of which it is no form, that are nearly the same: it is tried in their place where more than noise is left with them.
    also_in_place_of: laws at the same channel, of the drive too, that may each be a part of what it does: it is tried in the place of
        them, and of them and those that it refines together.
    unless: what a device must not have (words of `Effect.requires`) for the law to be suspected there: another law says the same.
    suspected: False for what a device file may state, and no recording shows beside what else it shows.
    in_a_region: the law is another one in a part of the motion: it is tried beside the others and never takes their turn.
    repeatable: the law may act more than once at one place, as harmonics do.
    acts_on_all: the law is suspected at all channels at once only.
    of_one_body: a rigid body has the law as a whole: it is suspected at no channel alone, at those that measure the same, and at all of
        them with one number.
    of_one_reference: the law of a sensor is suspected at all channels at once too, read or not: one thing they share may be wrong.
    of_time: what it does is a function of time alone (an event, a drift, a line), whatever the machine does. A law that acts with
        the motion comes first where it explains nearly as much.
    constant: what it does is the same whatever the machine does: where it is needed beside a law that acts with the motion, it is part
        of that one.
    of_each_record: what it does is told by numbers that are others in each record, of which no other record tells: it has no slope at zero
        by which a screen would see it, and is tried where it takes away most of what is left (`selection.of_each_record`).
    period_up_to: of a law that repeats along a reading, in typical sizes of that: the longest period that is looked for where the records
        do not show that a longer one repeats (`Hypothesis.longest_period`); an amplitude up to a quarter of either.
    once_a_turn: the law repeats with the turn of an axis: it is suspected where a good part of a turn is read.
    domain: where a finding is reported to be; by default what the law's place says.
    parameters: by name; one that is not listed gets `default_starts`.
    """

    reason: str = "Default: as common as a wrong gain, its form exact."
    log_prior_odds: float = 0.0
    model_form_error: float = 0.0
    form_of: str | None = None
    refines: frozenset[str] = frozenset()
    in_place_of: frozenset[str] = frozenset()
    also_in_place_of: frozenset[str] = frozenset()
    unless: frozenset[str] = frozenset()
    suspected: bool = True
    in_a_region: bool = False
    repeatable: bool = False
    acts_on_all: bool = False
    of_one_body: bool = False
    of_one_reference: bool = False
    of_time: bool = False
    constant: bool = False
    of_each_record: bool = False
    period_up_to: float | None = None
    once_a_turn: bool = False
    domain: str | None = None
    parameters: Mapping[str, ParameterPrior] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Raises TypeError for what a law of another package states in another form than this."""
        if wrong := [name for name, value in self.parameters.items() if not isinstance(value, ParameterPrior)]:
            raise TypeError(f"{wrong[0]} must be stated as a {ParameterPrior.__name__}")

    @property
    def replaces(self) -> frozenset[str]:
        """The laws in whose place it is tried where more than noise is left with them."""
        return self.refines | self.in_place_of

    @property
    def is_pitch(self) -> bool:
        """Whether the law repeats along a path."""
        return any(p.start_from_data == "spatial_periods" for p in self.parameters.values())

    @property
    def moments(self) -> tuple[str, ...]:
        """The numbers of an event that tell when it was; none of another law."""
        return tuple(name for name, p in self.parameters.items() if p.start_from_data == "moments")

    @property
    def in_time(self) -> bool:
        """Whether what the law does depends on the time at which it does it: a function of time, or one that begins at a moment."""
        return self.of_time or any(p.start_from_data in ("moments", "since") for p in self.parameters.values())

    def of(self, parameter: Param) -> ParameterPrior:
        """The row of one parameter of the law, or its default."""
        return self.parameters.get(parameter.name) or ParameterPrior(default_starts(parameter))


def default_starts(parameter: Param) -> tuple[float, ...]:
    """Three start values, at 1/6, 1/2 and 5/6 of the way between the bounds, on a logarithmic scale where both are positive
    and a decade or more apart; none for an amplitude."""
    low, high = parameter.bounds
    if parameter.off is not None:
        return ()
    if low > 0 and high >= 10 * low:
        return tuple(exp(log(low) + k / 6 * log(high / low)) for k in (1, 3, 5))
    return tuple(low + k / 6 * (high - low) for k in (1, 3, 5))
