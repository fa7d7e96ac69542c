"""Every hypothesis of what the model leaves out: an effect of the library at a place of the device where it can act, or a
number of the device that is off.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product
from math import isfinite, log10
from types import MappingProxyType

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.names import meant
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device, DevicePhysics
from ctrlgen.devices.quantities import walk
from ctrlgen.devices.section import Section
from ctrlgen.effects import Channel, Effect, Family, Param, Place, group, laws, means, overlap
from ctrlgen.estimation.disturbance_inputs import unread_axes
from ctrlgen.estimation.law_prior import LawPrior
from ctrlgen.estimation.priors import DEFAULT, prior_of
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.model.effect_terms import available, channels, in_loop, partner_channels

DOMAIN = {
    Place.DRIVE: "actuator",
    Place.HEAT: "actuator",
    Place.FORCE: "stage",
    Place.DISPLACEMENT: "stage",
    Place.POSE: "mechanism",
    Place.SENSOR: "sensor",
}
USUAL_SAMPLE_TIME = 1e-3
"""Sample time [s] of the records for which bounds and starts of times are stated (`Param.paced`)."""
SECONDS_LATE, SAMPLES_LATE = 0.5, 100.0
"""Up to which a reading is taken to be late: a camera, a bus; samples where these are slow, the dead time of a process. Judgement."""
SECONDS_APART, SAMPLES_APART = 0.05, 50.0
"""Up to which the clocks of two recorders are taken to disagree; samples where these are slow. Judgement."""
PARAMETER = "parameter"
NOTHING: Mapping[str, float] = MappingProxyType({})
DEVICES_KEPT = 8
"""Devices of which what is derived is kept: a diagnosis has one, the bootstrap and the tests a few."""


@dataclass(frozen=True)
class DataHints:
    """What the recording shows at one channel [SI]: where the search may start.

    peaks: the largest value of the signal ("channel"), of the displacement ("travel") and of its rate ("travel/s"), and a
        twelfth of the duration ("s"). A limit beyond the peak leaves no trace in the recording.
    suggested: start values by the names of `ParameterPrior.start_from_data`, and the "lines" [Hz] of the residual's spectrum.
    duration: time [s] that the records take; infinite where it is not known.
    """

    peaks: dict[str, float] = field(default_factory=dict)
    suggested: dict[str, tuple[float, ...]] = field(default_factory=dict)
    duration: float = float("inf")


@dataclass(frozen=True)
class Hypothesis:
    """One effect at one place; or, where `effect` is "parameter", one number of the device, at `path`.

    location: where a report says it is, such as "actuator:1X".
    at, of: the channel on which the effect acts, or several of them (`effects.means`); for effects of pairs, the other channel. Of a
        number of the device empty, but for that of a law that the file has.
    count: how many of the same effect a structure has there already, where the effect is repeatable.
    highest: frequency [Hz] up to which samples are told from their aliases; infinite for settled poses, which have no clock.
    machine_odds: ln of how many times commoner the law is in a machine of these parts than in any.
    longest: delay [s] that is looked for, or offset of clocks: shortest in a loop, where each sample of a delay is a state of
        the simulation.
    longest_period: way [SI] of a law that repeats along one, up to which the records show that it does.
    time: typical displacement over the speed that occurs in the records [s], in which bounds per speed count (`Channel.time`).
    """

    effect: str
    location: str
    at: str = ""
    of: str | None = None
    path: str = ""
    count: int = 0
    highest: float = float("inf")
    machine_odds: float = field(default=0.0, compare=False)
    longest: float = float("inf")
    longest_period: float = field(default=float("inf"), compare=False)
    time: float = field(default=1.0, compare=False)

    def beside(self, causes: Sequence[Hypothesis]) -> Hypothesis | None:
        """The hypothesis to add to `causes`: itself, one more where it is there and repeatable, None where it cannot be added.

        A place has at most one form of one physics, and one cause of a law that is not repeatable. A reading has at most one shift in time
        of one law: another one, of it or of all, is the same number.
        """
        if any(
            (c.form_of, c.location) == (self.form_of, self.location) and c.effect != self.effect
            for c in causes
            if c.form_of
        ):
            return None
        if self.shifts and any(c.effect == self.effect and c.shifts and overlap(c.at, self.at) for c in causes):
            return None
        same = [c for c in causes if (c.effect, c.location, c.of) == (self.effect, self.location, self.of)]
        if not same:
            return self
        return replace(self, count=1 + max(c.count for c in same)) if self.prior.repeatable else None

    @property
    def form_of(self) -> str | None:
        """The physics of which a place has at most one form; None where the law shares its own with no other."""
        return self.prior.form_of

    @property
    def shifts(self) -> bool:
        """Whether it moves a signal in time."""
        return is_of_effect(self.path) if self.effect == PARAMETER else self.law.moves_in_time

    @property
    def sample_time(self) -> float:
        """The shortest sample time [s] of the records; 0 of settled poses, which have no clock."""
        return CANDIDATE_TERMS.highest_frequency / self.highest

    @property
    def finer(self) -> tuple[Hypothesis, ...]:
        """The finer forms of its law, and those that may stand in its place, there."""
        kinds = (kind for kind, law in sorted(laws().items()) if self.effect in prior_of(law).replaces)
        return tuple(replace(self, effect=kind) for kind in kinds)

    @property
    def pace(self) -> float:
        """The sample time of the records over a millisecond, to the nearest decade: starts of times are decades apart, and those of records
        that are thinned out by two should be the same. 1 for settled poses."""
        return 10.0 ** round(log10(self.sample_time / USUAL_SAMPLE_TIME)) if self.sample_time > 0 else 1.0

    @property
    def prior(self) -> LawPrior:
        """What the search believes of the law; the default for a number of the device."""
        return DEFAULT if self.effect == PARAMETER else prior_of(self.law)

    @property
    def law(self) -> type[Effect]:
        """The effect's class. Raises KeyError for a parameter."""
        return Effect.library[self.effect]

    def channel_on(self, device: Device) -> Channel:
        """The channel of `device` at which the effect acts; the first one where it acts at several."""
        physics = nominal_physics(device)
        channel = channels(physics, self.law.place)[self.acts_on(device)[0]]
        channel = replace(channel, time=self.time, pace=self.pace)
        if self.of is None:
            return channel
        return channel.paired_with(next(c for c in partner_channels(physics, self.law) if c.name == self.of))

    def acts_on(self, device: Device) -> list[int]:
        """The places, among the channels of `device`, of those on which the effect acts."""
        every = enumerate(channels(nominal_physics(device), self.law.place))
        meant = [(i, c) for i, c in every if means(self.at, c.name, c.unit)]
        return [i for i, c in meant if self.law.pairs or self.law.applies_to(c)] or [i for i, _ in meant]

    def shapes(
        self, channel: Channel, hints: DataHints, given: Mapping[str, float] = NOTHING
    ) -> list[dict[str, float]]:
        """Every combination of start values of the shape parameters, which are all but the amplitude [SI]; those `given` have one.

        A law without shape parameters has one empty combination.
        """
        shaped = [p for p in self.law.params if p is not self.law.amplitude()]
        starts = [[given[p.name]] if p.name in given else self._starts(p, channel, hints) for p in shaped]
        return [dict(zip((p.name for p in shaped), values, strict=True)) for values in product(*starts)]

    def secants(self, channel: Channel, hints: DataHints) -> list[float]:
        """The amplitudes [SI] to which the law is linearised from `off` too, where its prior gives some."""
        p = self.law.amplitude()
        return self._starts(p, channel, hints) if self.prior.of(p).start_values else []

    def _starts(self, p: Param, channel: Channel, hints: DataHints) -> list[float]:
        """Start values of one parameter [SI], those that the recording suggests included."""
        low, high = self.bounds(p, channel)
        prior = self.prior.of(p)
        suggested = [
            *hints.suggested.get(prior.suggestion(channel.partner), ()),
            *(hints.suggested.get("lines", ()) if p.unit == "Hz" else ()),
        ]
        if prior.scales_with_peak and p.unit in hints.peaks:
            starts_at = [*(value * hints.peaks[p.unit] for value in prior.start_values), *suggested]
            return [min(max(value, low), high) for value in starts_at]
        if prior.only_from_data:
            return [value for value in suggested if low <= value <= high]
        starts = prior.start_values or (() if suggested else (sum(p.bounds) / 2,))
        tried = [*(channel.si(value, p) for value in starts), *(value for value in suggested if value >= low)]
        if p.unit == "Hz":
            # what takes longer than the records for a period is a drift
            return [value for value in tried if value * hints.duration >= 1 and value <= high]
        return [value for value in tried if value <= high] or [(low + high) / 2]

    def bounds(self, p: Param, channel: Channel) -> tuple[float, float]:
        """The bounds of a parameter [SI] at this channel and this sampling rate."""
        low, high = (channel.si(b, p) for b in p.bounds)
        if p.unit == "Hz":
            return low, max(low, min(high, self.highest))
        if self.prior.period_up_to is not None and p.unit == "channel":
            seen = self.longest_period if isfinite(self.longest_period) else 0.0
            longest = max(channel.si(self.prior.period_up_to, p), seen)
            high = min(high, longest / 4 if p is self.law.amplitude() else longest)
            return max(low, -high), high
        if self.law.moves_in_time and p is self.law.amplitude():
            return low, max(low, min(high, self.longest))
        if p.unit == "s" and self.prior.of(p).scales_with_peak and self.law.place is not Place.SENSOR:
            # An actuated change within one sample shows its middle in the motion, not its duration.
            low = min(high, max(low, CANDIDATE_TERMS.highest_frequency / self.highest))
        return low, high


def selected_laws(names: Sequence[str] | None = None) -> tuple[type[Effect], ...]:
    """The effects of these names, all for None, in alphabetical order. Raises InputError for a name that is no effect's."""
    unknown = sorted(set(names or ()) - set(laws()))
    if unknown:
        faults = [Fault(name, f"is not a known effect; {meant(name, sorted(laws()))}") for name in unknown]
        raise InputError("laws", faults)
    return tuple(law for name, law in sorted(laws().items()) if names is None or name in names)


def hypotheses(
    device: Device,
    physics: DevicePhysics,
    observed: tuple[str, ...],
    sample_time: float | None,
    ambient: bool,
    laws: Sequence[type[Effect]] | None = None,
) -> list[Hypothesis]:
    """Every effect of `laws` (None: all) that can act on `device` and reach the channels `observed`, then every number that may
    be off.

    `sample_time` [s] is None for settled poses; `ambient` says whether the recording has the temperature of the surroundings.
    """
    laws = selected_laws() if laws is None else laws
    unread = unread_axes(device, physics)
    effects = [h for law in laws for h in _of_law(law, device, physics, observed, sample_time, ambient, unread)]
    return effects + list(_numbers(device, physics, observed, sample_time))


def _of_law(
    law: type[Effect],
    device: Device,
    physics: DevicePhysics,
    observed: tuple[str, ...],
    sample_time: float | None,
    ambient: bool,
    unread: frozenset[int],
) -> Iterator[Hypothesis]:
    """The hypotheses of one law; none of a displacement on which, as on that of the axes `unread`, nothing that is read depends."""
    there = available(physics, sample_time) - (frozenset() if ambient else {"ambient"})
    prior = prior_of(law)
    if not prior.suspected or prior.unless & there or _needs_a_clock(law, sample_time):
        return
    if not law.requires <= there or (law.place is Place.HEAT and "heat" not in there):
        return
    domain = prior.domain or DOMAIN[law.place]
    highest = CANDIDATE_TERMS.highest_frequency / sample_time if sample_time else float("inf")
    longest = _longest_shift(law, physics, sample_time)
    places = channels(physics, law.place)
    seen = {channel.removeprefix("reading.") for channel in observed}
    if law.place is Place.SENSOR:
        places = [channel for channel in places if channel.name in seen]
    every = len(places)
    if law.place is Place.DISPLACEMENT:
        places = [channel for i, channel in enumerate(places) if i not in unread]
    if law.pairs:
        for k, channel in enumerate(places):
            for j, other in enumerate(partner_channels(physics, law)):
                if law.applies_to(channel.paired_with(other)) and not (law.symmetric and j < k):
                    yield Hypothesis(law.kind, f"{domain}:{channel.name}", channel.name, other.name, highest=highest)
        return
    fitting = [channel for channel in places if law.applies_to(channel)]
    stated = _stated_once(law, device)
    fitting = [c for c in fitting if not any(means(e.at, c.name, c.unit) for e in stated)]
    for channel in () if prior.acts_on_all or prior.of_one_body else fitting:
        yield Hypothesis(law.kind, f"{domain}:{channel.name}", channel.name, highest=highest, longest=longest)
    whole = len(places) == every and (prior.acts_on_all or law.place is not Place.SENSOR)
    for at in _together(law, physics, fitting) if (prior.of_one_reference or whole) and not stated else ():
        yield Hypothesis(law.kind, f"{domain}:{at}", at, highest=highest, longest=longest)


def _stated_once(law: type[Effect], device: Device) -> list[Effect]:
    """The laws of this kind that the file of `device` has, where a reading has one at most: of a second shift in time the file's number is
    the sum, what is rounded stays so, and a zero that is free is."""
    once = law.moves_in_time or law.in_steps or prior_of(law).of_each_record
    return [e for e in device.effect if e.kind == law.kind] if once else []


def _longest_shift(law: type[Effect], physics: DevicePhysics, sample_time: float | None) -> float:
    """How long a delay, or an offset of clocks, is looked for [s]; infinite of other laws, and without a clock."""
    if not (law.moves_in_time and sample_time):
        return float("inf")
    if law.shifts_drive:
        return max(SAMPLES_APART * sample_time, SECONDS_APART)
    if in_loop(physics):
        return CANDIDATE_TERMS.samples_in_loop * sample_time
    return max(SAMPLES_LATE * sample_time, SECONDS_LATE)


def _needs_a_clock(law: type[Effect], sample_time: float | None) -> bool:
    """Whether all of a law is in time, of which settled poses tell nothing: at rest, what creeps or forgets is a gain, and what goes by
    speed or rings does nothing."""
    return sample_time is None and law.family in (Family.TIMING, Family.CREEP, Family.DYNAMICS)


def _together(law: type[Effect], physics: DevicePhysics, fitting: Sequence[Channel]) -> list[str]:
    """The `at` of channels at which one number of the law may act: all, or more than one of those that measure the same, since the scale
    of an angle says nothing of that of a way; when things are, and how a body stands, is one for all."""
    if prior_of(law).acts_on_all:
        return ["all"]
    if law.moves_in_time:
        return ["all"] if len(fitting) > 1 else []
    units = [c.unit for c in channels(physics, law.place) if law.applies_to(c)]
    groups = Counter(group(units, channel.unit) for channel in fitting)
    several = [at for at, count in groups.items() if count > 1]
    return [*several, "all"] if prior_of(law).of_one_body and "all" not in several else several


def why_not_offered(
    law: type[Effect],
    device: Device,
    physics: DevicePhysics,
    observed: tuple[str, ...],
    sample_time: float | None,
    ambient: bool,
) -> str:
    """Why `hypotheses` has none of this law; empty where it has some. Arguments as there."""
    unread = unread_axes(device, physics)
    if next(_of_law(law, device, physics, observed, sample_time, ambient, unread), None) is not None:
        return ""
    there = available(physics, sample_time) - (frozenset() if ambient else {"ambient"})
    prior = prior_of(law)
    if prior.refines:
        plainer = sorted(prior.refines | prior.also_in_place_of)
        return f"it is tried in place of {' or '.join(plainer)} alone"
    if not prior.suspected:
        return f"it is never suspected: {prior.reason}"
    if there_already := prior.unless & there:
        return f"the device has {' and '.join(sorted(there_already))}: {prior.reason}"
    if missing := law.requires - there:
        return f"it needs {' and '.join(sorted(missing))}, which the device or the recording does not have"
    if _needs_a_clock(law, sample_time):
        at_rest = "what creeps or is late cannot be told from a gain, and what goes by speed or rings does nothing"
        return f"the poses are settled and have no clock: at rest, {at_rest}"
    if law.place is Place.HEAT and "heat" not in there:
        return "no actuator of the device is heated"
    if _stated_once(law, device):
        return "the device file has it wherever it was recorded" + (
            ": its number is what may be off" if law.moves_in_time else ""
        )
    return "no channel that was recorded is one on which it can act"


def _numbers(
    device: Device, physics: DevicePhysics, observed: tuple[str, ...], sample_time: float | None
) -> Iterator[Hypothesis]:
    """Every number that is not a count; of a law, where a channel `observed` at a `sample_time` shows it."""
    for path, section, number in numbers(device):
        if number.whole:
            continue
        name = path.rpartition(".")[2]
        if isinstance(section, Effect):
            read = [c for c in channels(physics, section.place) if f"reading.{c.name}" in observed]
            if sample_time and any(means(section.at, c.name, c.unit) for c in read):
                yield Hypothesis(
                    PARAMETER,
                    f"{prior_of(type(section)).domain or DOMAIN[section.place]}:{section.at}.{name}",
                    at=section.at,
                    path=path,
                    highest=CANDIDATE_TERMS.highest_frequency / sample_time,
                    longest=max(_longest_shift(type(section), physics, sample_time), 2 * number.si),
                )
            continue
        # the name of one of several alike, such as axes
        owner = "" if isinstance(section, Device) else getattr(section, "name", "")
        yield Hypothesis(PARAMETER, f"{section.domain}:{f'{owner}.' if owner else ''}{name}", path=path)


def numbers(device: Device) -> Iterator[tuple[str, Section | Effect, Quantity]]:
    """Every number that may be off with what holds it: those outside the effects, and how far an effect of the file moves a signal in
    time, beside which no second one is suspected."""
    for path, owner, number in walk(device):
        shift = isinstance(owner, Effect) and owner.moves_in_time and path.endswith(f".{owner.amplitude().name}")
        if shift or isinstance(owner, Section):
            yield path, owner, number


def is_of_effect(path: str) -> bool:
    """Whether a number of the device is one of a law's."""
    return path.startswith("effect[")


@lru_cache(maxsize=DEVICES_KEPT)
def nominal_physics(device: Device) -> DevicePhysics:
    """The physics of a device with its own numbers, made once: a hexapod's takes a tenth of a second."""
    return device.told_physics(device.values())
