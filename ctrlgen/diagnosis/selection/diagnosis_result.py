"""The answer of a diagnosis: verdict, findings with intervals, held-out errors, and how they were found."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ctrlgen.core.units import difference, from_si, to_si
from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import changed, written
from ctrlgen.diagnosis.selection.attribution import Attribution, Share
from ctrlgen.diagnosis.selection.candidate_model import SearchResult
from ctrlgen.diagnosis.selection.verdict import unconfirmed
from ctrlgen.diagnosis.shares.empirical_terms import EmpiricalTerm
from ctrlgen.diagnosis.shares.gather import ResidualShares
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.prediction_uncertainty import prediction_uncertainty
from ctrlgen.estimation.profile_likelihood import Profile
from ctrlgen.estimation.residual_tests import ResidualTests
from ctrlgen.estimation.robust_covariance import robust_deviations
from ctrlgen.estimation.settings import STATISTICS
from ctrlgen.estimation.spikes import Spikes
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, in `unit`."""

    value: float
    ci95: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class Worth:
    """Root mean square error of one channel on the held-out records, `without` a cause and `with_it` [unit]."""

    without: float
    with_it: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """One cause that the device file leaves out.

    alternatives: other causes that explain the recording equally well in its place. share: of the mismatch, of energy, None
    where it was read from the data. worth: by channel the held-out error without the cause and with it. source: publication
    of the effect's law. cause: the hypothesis.
    """

    effect: str
    location: str
    parameters: dict[str, Estimate]
    alternatives: tuple[Hypothesis, ...]
    share: Share | None
    worth: dict[str, Worth]
    source: str
    cause: Hypothesis


@dataclass(frozen=True)
class ChannelError:
    """Root mean square error of one channel on the held-out records [unit].

    rms_before: of the device as described, refitted within its stated uncertainty. rms_after: with the findings.
    noise_floor: standard deviation of the noise, None where it is not known.
    uncertainty: prediction uncertainty that the fitted parameters alone cause, None where it is not known.
    """

    rms_before: float
    rms_after: float
    noise_floor: float | None
    unit: str
    uncertainty: float | None = None


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The answer: verdict, findings and supporting analyses; `search` and `fitter` hold how it was found.

    attribution: shares of the causes and of the rest. shares: of what the residual is a function, whatever the law, before and
    after; None where the records are too short. empirical_terms: smoothers of what no law reaches. spikes: isolated outliers, of
    the channels that have some.
    """

    verdict: str
    findings: tuple[Finding, ...]
    attribution: Attribution
    shares: ResidualShares | None
    empirical_terms: tuple[EmpiricalTerm, ...]
    held_out: dict[str, ChannelError]
    residual_tests: ResidualTests
    residual_location: dict[str, Any]
    detectability: dict[str, Any]
    next_experiment: dict[str, Any] | None
    search_history: tuple[dict[str, Any], ...]
    spikes: tuple[Spikes, ...]
    notes: tuple[str, ...]
    device: Device
    recording: Recording
    search: SearchResult
    fitter: Fitter
    profiles: tuple[Profile, ...] = ()
    extra: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def values(self) -> dict[str, Estimate]:
        """Every fitted number by its path in `corrected`, uncertain ones of the device included, with 95 % intervals.

        A device written in Python has no file: this is what to put into its code.
        """
        return estimated_values(self.search.chosen.fit, self.profiles)

    @property
    def unconfirmed(self) -> tuple[Hypothesis, ...]:
        """Causes that the held-out records do not confirm."""
        return unconfirmed(self.search)

    @cached_property
    def corrected(self) -> Device:
        """The device with all findings, then what was detected directly, then empirical terms: as device.next.toml describes it."""
        fit = self.search.chosen.fit
        own = {
            u.path: float(v) for u, v in zip(fit.structure.free_parameters, fit.theta, strict=True) if u.cause is None
        }
        starts = tuple(fit.values(k) for k in range(len(fit.structure.causes)))
        device = changed(Structure(fit.structure.device, fit.structure.causes, starts).device_with_causes, own)
        beside = [f for f in self.findings if f.cause not in fit.structure.causes]
        read = [
            f.cause.law(
                f.cause.at, {n: written(float(to_si(e.value, e.unit)), e.unit) for n, e in f.parameters.items()}
            )
            for f in beside
        ]
        left = (term.effect for term in self.empirical_terms)
        return device.model_copy(update={"effect": (*device.effect, *read, *left)})


def held_out_errors(search: SearchResult, known: np.ndarray) -> dict[str, ChannelError]:
    """Held-out errors of the nominal and of the chosen model by channel; `known` (n_y,) says whose noise is known."""
    found, fitter = {}, search.fitter
    floor, unsure = fitter.noise.floor, prediction_uncertainty(fitter, search.chosen.fit)
    for i, (channel, unit) in enumerate(zip(fitter.recording.channels, fitter.recording.units, strict=True)):
        scale = difference(1.0, unit)
        rms = []
        for model in (search.nominal, search.chosen):
            squares = [
                ((r.observed - fitter.predict(model.fit, r))[:, i])[r.valid[:, i]] ** 2 for r in fitter.held_out_records
            ]
            rms.append(float(np.sqrt(np.mean(np.concatenate(squares)))) * scale if squares else float("nan"))
        noise = float(floor[i] * scale) if known[i] else None
        beside = float(unsure[i] * scale) if np.isfinite(unsure[i]) else None
        found[channel] = ChannelError(rms[0], rms[1], noise, unit, beside)
    return found


def estimated_values(fit: Fit, profiles: tuple[Profile, ...] = ()) -> dict[str, Estimate]:
    """Every free parameter of a fit with its 95 % interval, by path, in the unit of its file.

    An interval includes the model-form error of an amplitude's law, and is at least as wide as the parameter's profile
    likelihood gives.
    """
    found, profiled = {}, {p.path: p for p in profiles}
    for unknown, value, s in zip(fit.structure.free_parameters, fit.theta, robust_deviations(fit), strict=True):
        cause = fit.structure.cause_of(unknown) if unknown.amplitude else None
        if cause is not None and cause.effect != PARAMETER:
            s = np.hypot(s, cause.prior.model_form_error * (value - unknown.nominal))
        ends = (value, max(value - STATISTICS.z_95 * s, unknown.low), min(value + STATISTICS.z_95 * s, unknown.high))
        value, low, high = (float(from_si(v, unknown.unit)) for v in ends)
        if unknown.path in profiled:
            below, above = profiled[unknown.path].ci95
            low, high = min(low, below), max(high, above)
        found[unknown.path] = Estimate(value, (low, high), unknown.unit)
    return found


def findings(search: SearchResult, shares: Attribution, profiles: tuple[Profile, ...] = ()) -> tuple[Finding, ...]:
    """The causes of the chosen model with intervals, shares and alternatives, that with the largest share first."""
    fit, rows = search.chosen.fit, []
    estimates = estimated_values(fit, profiles)
    for k, cause in enumerate(fit.structure.causes):
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
        rivals = tuple(t.cause for t in search.rivals[k] if t.cause)
        source = "parameter of the device file" if cause.effect == PARAMETER else cause.law.source
        worth = _worth(search, k)
        rows.append(Finding(cause.effect, cause.location, parameters, rivals, shares.shares[k], worth, source, cause))
    return tuple(sorted(rows, key=lambda f: -(f.share.value if f.share else 0.0)))


def _worth(search: SearchResult, k: int) -> dict[str, Worth]:
    """The held-out error without cause k, the others refitted, and with it, of each channel."""
    recording, floor = search.fitter.recording, search.fitter.noise.floor
    without, with_it = (np.sqrt(t.held_out.plain_mean) * floor for t in (search.without_cause[k], search.chosen))
    return {
        channel: Worth(float(a) * difference(1.0, unit), float(b) * difference(1.0, unit), unit)
        for channel, unit, a, b in zip(recording.channels, recording.units, without, with_it, strict=True)
    }
