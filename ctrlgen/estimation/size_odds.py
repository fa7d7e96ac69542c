"""How likely a cause is of the size that was fitted: what is known beforehand, where readings alone do not tell causes apart.

With z the size in standard deviations s that are stated, or usual (`ctrlgen.devices.usual_deviation`), of a number of the device and of a
law whose row in the priors has a `deviation`,

    ln odds = max(ln z - 5/2 ln((1 + z^2/4) / (5/4)), ln 1/100)  for z > 1, else 0.

Of two causes that fit alike, sizes a_1 and a_2 have standard errors in one proportion to them, so that the ratio of their likelihoods,
integrated over the size, is p(z_1) z_1 / (p(z_2) z_2). p is Student's of four degrees of freedom: what is stated of a deviation is itself
known to about a half. p z is largest at z = 1, below which size speaks against nothing. One number in a hundred is wrong by any
size, as by a slip of the pen: that alone is left of a number that is set and not measured, such as a gain of a digital loop (s = 0).
Source: D. J. C. MacKay, Neural Comput. 4 (1992) 415 (Occam factors); K. L. Lange, R. Little, J. Taylor, J. Am. Stat. Assoc. 84 (1989) 881.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log

from ctrlgen.devices import Device
from ctrlgen.devices.section import Section
from ctrlgen.devices.usual_deviation import usual_deviation
from ctrlgen.effects import Place, is_group, means
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.free_parameters import nuisances
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, numbers
from ctrlgen.estimation.law_prior import ONE_IN_A_HUNDRED

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution: the sd of a stated sd is then about half of it. Judgement."""


@dataclass(frozen=True)
class Deviation:
    """Standard deviation `sd` [SI] of a size, 0 of a number that is set and not measured; and whether the device file states it."""

    sd: float
    stated: bool


def known_deviation(cause: Hypothesis, device: Device) -> Deviation | None:
    """By how much what a cause says is wrong is usually off; None where nothing is known of it."""
    if cause.effect == PARAMETER:
        section, number = next((section, number) for path, section, number in numbers(device) if path == cause.path)
        if number.sd is None and isinstance(section, Section) and section.relative_sd == 0.0:
            return Deviation(0.0, False)
        sd = nuisances(device).get(cause.path) or number.sd or usual_deviation(number)
        return Deviation(sd, bool(number.sd)) if sd else None
    amplitude = cause.law.amplitude()
    channel = cause.channel_on(device)
    for e in device.effect:
        same = e.at == cause.at or (is_group(e.at) and means(e.at, channel.name, channel.unit))
        here = e.kind == cause.effect and same
        if here and (known := e.values[amplitude.name].sd):
            return Deviation(known, True)
    usual = cause.prior.of(amplitude).deviation
    return None if usual is None else Deviation(channel.si(usual, amplitude), False)


def size_of(fit: Fit, k: int) -> tuple[float, Deviation] | None:
    """The size of cause k in standard deviations, infinite where these are 0, and these; None where nothing is known of them."""
    known = known_deviation(fit.structure.causes[k], fit.structure.device)
    if known is None:
        return None
    for unknown, value in zip(fit.structure.free_parameters, fit.theta, strict=True):
        if unknown.cause == k and unknown.amplitude:
            off = abs(float(value) - unknown.nominal)
            return (off / known.sd if known.sd else inf if off else 0.0), known
    return None


def odds_of_size(z: float) -> float:
    """ln of how many times less likely a size of z standard deviations is than the likeliest."""
    if z <= 1:
        return 0.0
    if z == inf:
        return ONE_IN_A_HUNDRED
    tail = log(z) - (FREEDOM + 1) / 2 * log((1 + z * z / FREEDOM) / (1 + 1 / FREEDOM))
    return max(tail, ONE_IN_A_HUNDRED)


def size_odds(fit: Fit) -> float:
    """ln odds of the sizes of all causes of a fit."""
    sizes = (size_of(fit, k) for k in range(len(fit.structure.causes)))
    return sum(odds_of_size(size[0]) for size in sizes if size is not None)


def prior_odds(fit: Fit) -> float:
    """ln odds beforehand of the causes of a fit: of their laws, and of their sizes."""
    return fit.structure.log_prior_odds + size_odds(fit)


def of_sensor(cause: Hypothesis) -> bool:
    """Whether a cause is an error of the reading and not of the motion."""
    return cause.effect != PARAMETER and cause.law.place is Place.SENSOR
