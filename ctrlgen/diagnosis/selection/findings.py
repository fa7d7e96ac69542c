"""The findings of a diagnosis: causes with the intervals of their numbers, shares and alternatives, and held-out errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from pydantic import Field

from ctrlgen.core.units import difference, from_si, to_si
from ctrlgen.diagnosis.selection.attribution import Attribution, ShareEntry
from ctrlgen.diagnosis.selection.edge_intervals import edge_intervals
from ctrlgen.diagnosis.selection.finding_region import RegionEntry, region_of
from ctrlgen.diagnosis.selection.law_titles import title
from ctrlgen.diagnosis.selection.of_each_record import told_in_records
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.verdict import terms_of_findings, unconfirmed
from ctrlgen.diagnosis.selection.way_covered import moves_one_way
from ctrlgen.diagnosis.settings import ATTRIBUTION, LUCK
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics
from ctrlgen.estimation.prediction_uncertainty import prediction_uncertainty
from ctrlgen.estimation.profile_likelihood import Profile
from ctrlgen.estimation.record_states import told_state
from ctrlgen.estimation.residual_tests import ResidualTests
from ctrlgen.estimation.robust_covariance import robust_deviations
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, in `unit`."""

    value: float
    ci95: tuple[float, float]
    unit: str


class Role(StrEnum):
    """What a law of the accepted model is to the reader."""

    CAUSE = "cause"
    MINOR = "minor"
    PART = "part"
    UNSEEN = "unseen"


class WorthEntry(Keys):
    """What a cause is worth in one channel, root mean square on the held-out records."""

    without: FiniteOrNull = Field(description="Error without the cause, the others refitted [unit].")
    with_it: FiniteOrNull = Field(description="Error with it [unit].")
    unit: str = Field(description="Unit of both.")
    share: Number = Field(
        description="Share of the channel's mismatch that it takes away; null where the channel shows none, or the share may be zero."
    )


class SupportEntry(Keys):
    """What the model-free shares of the residual before say of a cause."""

    family: str = Field(description="Family of the law.")
    share: FiniteOrNull = Field(description="Share of the residual that this family could account for.")
    leading: str = Field(description="The family with the largest share.")
    leading_share: FiniteOrNull = Field(description="Its share.")
    contradicted: bool = Field(description="Whether the shares speak against the cause.")


class ChanceEntry(Keys):
    """The chance that luck found a cause, by an exact test of signs on the held-out records."""

    by_luck: Number = Field(
        description="Chance of such a finding by luck in the whole search, at most: p times looks, at most 1. Null, as p and looks, where "
        "it cannot be judged, for the reason given."
    )
    p: Number = Field(
        description="Chance, over all signs, that noise agrees as well with what the cause changes beside all others; or, where sets of "
        "causes were refuted one by one, that of what refutes the set without it which is refuted least."
    )
    looks: Number = Field(description="For how many answers that the search could have given p counts.")
    stretches: int = Field(
        description="Independent stretches of the held-out records, or poses, over whose signs p is."
    )
    against: str = Field(
        description="noise: what is left were the set without the cause right. what no law reaches: more than noise is left, and the "
        "test takes it, too, for independent from stretch to stretch and as likely of either sign."
    )
    reason: str | None = Field(
        description="Why luck cannot be judged: what p could not show below 5 %; null where it can."
    )

    @property
    def certain(self) -> bool:
        """Whether luck is as good as excluded."""
        return self.by_luck is not None and self.by_luck <= LUCK.certain

    @property
    def weak(self) -> bool:
        """Whether the records could have excluded luck, and do not."""
        return not self.certain and self.reason is None


@dataclass(frozen=True)
class Finding:
    """One cause that the device file leaves out.

    alternatives: other causes that explain the recording equally well in its place. share: of the mismatch, of energy, None
    where it was read from the data or may be zero. worth: by channel the held-out error without the cause and with it. source:
    publication of the effect's law. cause: the hypothesis. terms: numbers of further terms of the same law at the same place, such
    as harmonics. role: a `cause`; `minor`: above the noise and below a hundredth of the mismatch; `part`: it takes away nothing
    itself, and the finding `serves` needs it; `unseen`: only the records to fit can show it. title: what the law is called on this
    machine, empty where its own title serves. support: what the model-free shares say of it. chance: that luck found it, None where it was
    read from the data. in_each_record: what it is in each record, by the name of that, of a law that is another one in each.
    size_untold: whether the intervals of all its sizes hold that at which it is off: something acts there, which need not be this.
    """

    effect: str
    location: str
    parameters: dict[str, Estimate]
    alternatives: tuple[Hypothesis, ...]
    share: ShareEntry | None
    worth: dict[str, WorthEntry]
    source: str
    cause: Hypothesis
    terms: tuple[dict[str, Estimate], ...] = ()
    role: Role = Role.CAUSE
    serves: Hypothesis | None = None
    title: str = ""
    support: SupportEntry | None = None
    chance: ChanceEntry | None = None
    in_each_record: dict[str, Estimate] = field(default_factory=dict)
    size_untold: bool = False

    @property
    def numbers(self) -> list[tuple[str, Estimate]]:
        """Its parameters and those of its further terms, and what it is in each record, with their names."""
        of_law = [(name, e) for numbers in (self.parameters, *self.terms) for name, e in numbers.items()]
        told = told_state(self.cause.law).name if self.in_each_record else ""
        return [*of_law, *((f"{told} in {record}", e) for record, e in self.in_each_record.items())]

    @property
    def region(self) -> RegionEntry | None:
        """Where it acts; None for a number of the device or a law that acts everywhere."""
        return None if self.effect == PARAMETER else region_of(self.cause.law, self.parameters)

    @property
    def contradicted(self) -> bool:
        """Whether the model-free shares speak against it."""
        return self.support is not None and self.support.contradicted

    @property
    def of(self) -> str | None:
        """The other channel of an effect between two."""
        return self.cause.of


class ChannelErrorEntry(Keys):
    """Root mean square error of one channel on the held-out records."""

    rms_before: FiniteOrNull = Field(description="Of the device as described, refitted within its stated uncertainty.")
    rms_after: FiniteOrNull = Field(description="With the findings.")
    noise_floor: Number = Field(description="Standard deviation of the noise; null where it is not known.")
    unit: str = Field(description="Unit of all numbers here.")
    uncertainty: Number = Field(
        description="Prediction uncertainty that the fitted parameters alone cause; null where it is not known."
    )
    rms_refitted: FiniteOrNull = Field(
        description="With the findings, all numbers moved to these records within their uncertainty (under their posterior)."
    )
    goes_with_motion: Number = Field(
        description="Probability that noise goes so well with the drive and the motion by chance as what is left does, by which what is "
        "left is judged where neither a statement nor a rest tells the noise; null where one does."
    )
    counts_as: Number = Field(
        default=None,
        description="What stands for the noise in shares of all readings where it is not known: what is left of the readings of this "
        "unit in the records to fit; null where the noise is known.",
    )


def held_out_errors(search: SearchResult, known: np.ndarray, tests: ResidualTests) -> dict[str, ChannelErrorEntry]:
    """Held-out errors of the nominal and of the chosen model by channel, with what the `tests` of the chosen one say; `known` (n_y,) says
    whose noise is known."""
    errors, fitter = {}, search.fitter
    floor, unsure = fitter.noise.floor, prediction_uncertainty(fitter, search.chosen.fit)
    for i, (channel, unit) in enumerate(zip(fitter.recording.channels, fitter.recording.units, strict=True)):
        scale = difference(1.0, unit)
        rms = []
        for fit in (search.nominal.fit, search.chosen.fit, tests.refitted):
            squares = [
                ((r.observed - fitter.predict(fit, r))[:, i])[r.valid[:, i]] ** 2 for r in fitter.held_out_records
            ]
            rms.append(float(np.sqrt(np.mean(np.concatenate(squares)))) * scale if squares else float("nan"))
        noise = float(floor[i] * scale) if known[i] else None
        beside = float(unsure[i] * scale) if np.isfinite(unsure[i]) else None
        errors[channel] = ChannelErrorEntry(
            rms_before=rms[0],
            rms_after=rms[1],
            noise_floor=noise,
            unit=unit,
            uncertainty=beside,
            rms_refitted=rms[2],
            goes_with_motion=tests.by_motion.get(channel),
            counts_as=None if known[i] else float(floor[i] * scale),
        )
    return errors


def estimated_values(
    fit: Fit, profiles: tuple[Profile, ...] = (), moves: np.ndarray | None = None
) -> dict[str, Estimate]:
    """Every free parameter of a fit with its 95 % interval, by path, in the unit of its file.

    The interval is that of the parameter's profile likelihood where one was evaluated to its ends, else the wider of that and the
    curvature's. It includes the model-form error of an amplitude's law and, as a standard deviation, what one law more would move the
    number by, its `moves` (k,): several that were not taken may act at once.
    """
    estimates, profiled = {}, {p.path: p for p in profiles}
    moves = np.zeros(len(fit.theta)) if moves is None else moves
    rows = zip(fit.structure.free_parameters, fit.theta, robust_deviations(fit), moves, strict=True)
    for unknown, value, s, moved in rows:
        way, form = np.full(2, STATISTICS.z_95 * s), 0.0
        if profile := profiled.get(unknown.path):
            seen = np.abs([to_si(end, unknown.unit) - value for end in profile.ci95])
            way = seen if profile.verified else np.maximum(way, seen)
        cause = fit.structure.cause_of(unknown) if unknown.amplitude else None
        if cause is not None and cause.effect != PARAMETER:
            form = STATISTICS.z_95 * cause.prior.model_form_error * (value - unknown.nominal)
        size = value - unknown.nominal if unknown.amplitude else 0.0
        below, above = np.hypot(np.hypot(way, form), _ways(size, STATISTICS.z_95 * moved))
        ends = (value, max(value - below, unknown.low), min(value + above, unknown.high))
        value, low, high = (float(from_si(v, unknown.unit)) for v in ends)
        # units round: a number at its bound is within its interval
        estimates[unknown.path] = Estimate(value, (min(low, value), max(high, value)), unknown.unit)
    return estimates


def _ways(size: float, moved: float) -> tuple[float, float]:
    """How far below and above a number may be that one law more would move by `moved`. An amplitude of some `size`, 0 of other numbers,
    goes toward nothing by factors: that the law acts is confirmed elsewhere, and the interval tells how much it does."""
    toward_nothing = abs(size) * (1 - np.exp(-moved / abs(size))) if size else moved
    return (toward_nothing, moved) if size > 0 else (moved, toward_nothing)


def finding_estimates(
    fitter: Fitter, fit: Fit, profiles: tuple[Profile, ...] = (), moves: np.ndarray | None = None
) -> dict[str, Estimate]:
    """The `estimated_values`, the edges of regions with the intervals of `edge_intervals`."""
    estimates = estimated_values(fit, profiles, moves)
    wide = edge_intervals(fitter, fit, {path: e.ci95 for path, e in estimates.items()})
    return estimates | {path: replace(estimates[path], ci95=ends) for path, ends in wide.items()}


def findings(search: SearchResult, shares: Attribution, profiles: tuple[Profile, ...] = ()) -> tuple[Finding, ...]:
    """The causes of the chosen model with intervals, shares and alternatives, that with the largest share first; of shares that are
    nearly the same, that without which most is left, the others fitted again.

    Causes of one law at one place, such as harmonics, are one finding, with the numbers of the largest first, and its alternatives.
    """
    causes = search.chosen.causes
    estimates = finding_estimates(search.fitter, search.chosen.fit, profiles, search.final_screen.moves)
    unseen = set(unconfirmed(search))
    rows = []
    for first, *others in terms_of_findings(search):
        cause, share = causes[first], shares.shares[first]
        served = shares.serves[first] if shares.serves else None
        role = _role(share, cause in unseen, shares.rest is None, served is not None)
        rows.append(
            Finding(
                cause.effect,
                cause.location,
                _numbers_of(search, first, estimates),
                _alternatives(search, first),
                share,
                _worth(search, first, shares),
                "parameter of the device file" if cause.effect == PARAMETER else cause.law.source,
                cause,
                tuple(_numbers_of(search, k, estimates) for k in others),
                role,
                causes[served] if role is Role.PART and served is not None else None,
                _title(search, cause),
                in_each_record=_in_each_record(search, cause),
                size_untold=size_untold(search, (first, *others), estimates),
            )
        )
    main = _leading(search, rows)
    return tuple(
        sorted(rows, key=lambda f: (f.role is not Role.CAUSE, f is not main, -(f.share.value if f.share else 0.0)))
    )


def _leading(search: SearchResult, rows: list[Finding]) -> Finding | None:
    causes = [(f, f.share.value) for f in rows if f.role is Role.CAUSE and f.share is not None]
    left = {
        c: float(np.sum(t.predicted.plain_mean))
        for c, t in zip(search.chosen.causes, search.without_cause, strict=True)
    }
    first = leading([share for _, share in causes], [left[f.cause] for f, _ in causes])
    return None if first is None else causes[first][0]


def leading(shares: Sequence[float], left: Sequence[float]) -> int | None:
    """Which of the causes with these `shares` is the main one: of those with nearly the largest that without which most is `left`, the
    others fitted again. Of two laws that take the same away, such as a loop and a lateness along a sine, the order of the shares is that
    of the numbers that happened to be fitted, and not of which law is needed. None of no causes."""
    near = [k for k, share in enumerate(shares) if share > max(shares) - ATTRIBUTION.as_large]
    return max(near, key=lambda k: left[k], default=None)


def _alternatives(search: SearchResult, k: int) -> tuple[Hypothesis, ...]:
    """What explains as well as cause `k`, each name once: a rival may be the cause itself, begun from elsewhere, or one of another term."""

    def name(h: Hypothesis) -> tuple[str, str, str | None]:
        return h.effect, h.location, h.of

    named = {name(t.cause): t.cause for t in reversed(search.rivals[k]) if t.cause}
    own = name(search.chosen.causes[k])
    return tuple(h for key, h in reversed(named.items()) if key != own)


def _title(search: SearchResult, cause: Hypothesis) -> str:
    """What the law of a cause is called on this machine; empty for a number of the device."""
    if cause.effect == PARAMETER:
        return ""
    device = search.chosen.fit.structure.device
    one_way = moves_one_way(search.fitter.recording, device)
    return title(cause.law, device.parts(nominal_physics(device)), one_way)


def _role(share: ShareEntry | None, unseen: bool, nothing_to_share: bool, is_served: bool) -> Role:
    if unseen:
        return Role.UNSEEN
    if share is None:
        return Role.CAUSE if nothing_to_share else Role.PART if is_served else Role.MINOR
    return Role.CAUSE if share.value >= ATTRIBUTION.least_share else Role.MINOR


def _numbers_of(search: SearchResult, k: int, estimates: dict[str, Estimate]) -> dict[str, Estimate]:
    """The numbers of cause k by name."""
    fit = search.chosen.fit
    cause = fit.structure.causes[k]
    number = cause.path.rpartition(".")[2]
    parameters = {
        number if cause.effect == PARAMETER else unknown.name: estimates[unknown.path]
        for unknown in fit.structure.free_parameters
        if unknown.cause == k
    }
    for p in () if cause.effect == PARAMETER else cause.law.params:
        if fixed := cause.prior.of(p).fixed_range:
            middle = sum(fixed) / 2
            parameters[p.name] = Estimate(middle, (middle, middle), p.unit)
    return parameters


def size_untold(search: SearchResult, terms: Sequence[int], estimates: dict[str, Estimate]) -> bool:
    """Whether the intervals of all sizes of the causes `terms` hold the value at which their law is off."""
    free = search.chosen.fit.structure.free_parameters
    sizes = [u for u in free if u.cause in terms and u.amplitude]
    ends = [(float(from_si(u.nominal, u.unit)), estimates[u.path].ci95) for u in sizes]
    return bool(ends) and all(low <= off <= high for off, (low, high) in ends)


def _in_each_record(search: SearchResult, cause: Hypothesis) -> dict[str, Estimate]:
    """What a cause is in each record, such as the zero of its reading, of one that is another there."""
    if not cause.prior.of_each_record:
        return {}
    fit = search.chosen.fit
    unit = cause.channel_on(fit.structure.device).unit_of(told_state(cause.law))
    told = told_in_records(search.fitter, fit, cause).items()
    return {
        name: Estimate(
            difference(value, unit), (difference(value - reach, unit), difference(value + reach, unit)), unit
        )
        for name, (value, reach) in told
    }


def _worth(search: SearchResult, k: int, shares: Attribution) -> dict[str, WorthEntry]:
    """The held-out error without cause k, the others refitted, and with it, of each channel, and its share there."""
    recording, floor = search.fitter.recording, search.fitter.noise.floor
    without, with_it = (np.sqrt(t.predicted.plain_mean) * floor for t in (search.without_cause[k], search.chosen))
    return {
        channel: WorthEntry(
            without=float(a) * difference(1.0, unit),
            with_it=float(b) * difference(1.0, unit),
            unit=unit,
            share=shares.channels[channel][k] if channel in shares.channels and shares.shares[k] else None,
        )
        for channel, unit, a, b in zip(recording.channels, recording.units, without, with_it, strict=True)
    }
