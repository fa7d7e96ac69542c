"""A law is recovered: screened where it acts, fitted from there and held out, with the numbers that were planted."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from axis_records import SETTLING, H
from misfits import recovered

from ctrlgen.devices import Device
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.recordings.recording import Recording

N = 2500


@dataclass(frozen=True)
class Planted:
    """`truth` by parameter [SI]; `within` of itself, where the simulator's form is another than the law's, beside the noise."""

    at: str
    truth: dict[str, float]
    of: str | None = None
    within: dict[str, float] = field(default_factory=dict)


def at(k, value):
    out = np.zeros(6)
    out[k] = value
    return out


def noisy(n: int) -> float:
    """The squares of n deviations of noise, four of their own deviations above the mean."""
    return n + 4 * np.sqrt(2 * n)


def recover(fitter: Fitter, device: Device, effect: str, planted: Planted) -> None:
    """Screened where it acts and fitted from there: the numbers planted, and what is left is noise, fitted and held out, but
    for the form of the law, of which its effect says how far nature's may be."""
    highest = CANDIDATE_TERMS.highest_frequency / H if fitter.recording.kind == "series" else np.inf
    cause = Hypothesis(effect, planted.at, planted.at.partition(":")[2], planted.of, highest=highest)
    nominal, candidate = recovered(fitter, device, cause)
    fit, rough = candidate.fit, cause.prior.model_form_error**2
    for left, without in ((candidate.fitted, nominal.fitted), (candidate.held_out, nominal.held_out)):
        most = noisy(float(np.sum(left.n_plain))) + rough * float(np.sum(without.plain))
        assert np.sum(left.plain) < most and np.sum(left.plain) < 0.3 * np.sum(without.plain)
    sd = np.sqrt(np.diag(fit.covariance))
    found = {u.name: (fit.theta[k], sd[k]) for k, u in enumerate(fit.structure.free_parameters) if u.cause == 0}
    for parameter, truth in planted.truth.items():
        value, deviation = found[parameter]
        assert abs(value - truth) < 4 * deviation + planted.within.get(parameter, 0.005) * abs(truth), parameter


def fitter_of(device, channels, units, sds, kind, parts) -> Fitter:
    recording = Recording("t", device.name, kind, channels, units, tuple(sds), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, SETTLING))
