"""Whether a law that generalises another one says more of a recording than the plainer law does."""

from __future__ import annotations

from dataclasses import replace

from scipy import stats

from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.robust_covariance import robust_deviations
from ctrlgen.estimation.settings import STATISTICS


def may_be_plainer(fit: Fit, k: int, bounds_tell: bool = True) -> Hypothesis | None:
    """The plainer law that cause k generalises (`Effect.plainer`), at the same place; None where there is none, or where one of the
    numbers by which they differ has an interval without the value that it has in the plainer law.

    The interval is the one that is reported, of the model, or of the sandwich where that is wider, at 95 % over all these numbers
    (Bonferroni). Where `bounds_tell` is False a number that stopped at its bound, which is not measured, excludes nothing.
    """
    cause = fit.structure.causes[k]
    plain = plainer(cause)
    if plain is None or cause.law.plainer is None:
        return None
    relation, deviations = cause.law.plainer, robust_deviations(fit)
    channel = cause.channel_on(fit.structure.device)
    neutral = {p.name: channel.si(relation.where[p.name], p) for p in cause.law.params if p.name in relation.where}
    z = stats.norm.isf(stats.norm.sf(STATISTICS.z_95) / len(neutral))
    rows = zip(fit.structure.free_parameters, fit.theta, deviations, strict=True)
    there = ((u, v, sd) for u, v, sd in rows if u.cause == k and u.name in neutral)
    told = ((u, v, sd) for u, v, sd in there if bounds_tell or not any(u.shape_ends(float(v))))
    return None if any(abs(v - neutral[u.name]) > z * sd for u, v, sd in told) else plain


def plainer(cause: Hypothesis) -> Hypothesis | None:
    """The plainer law that a cause generalises (`Effect.plainer`), at the same place; None where there is none."""
    if cause.effect == PARAMETER or cause.law.plainer is None:
        return None
    return replace(cause, effect=cause.law.plainer.kind)


def left_beside(fit: Fit, k: int, plain: Hypothesis) -> dict[Hypothesis, dict[str, float]]:
    """The causes, with their numbers [SI], that say beside the `plain` law of cause k what that adds in proportion to the signal, where
    its 95 % interval excludes that it is none."""
    law, values, left = fit.structure.causes[k].law, fit.values(k), {}
    rows = zip(fit.structure.free_parameters, robust_deviations(fit), strict=True)
    deviations = {u.name: sd for u, sd in rows if u.cause == k}
    for name, kind in law.plainer.left.items() if law.plainer else ():
        if abs(values[name]) > STATISTICS.z_95 * deviations.get(name, 0.0):
            gain = replace(plain, effect=kind)
            left[gain] = {gain.law.amplitude().name: values[law.amplitude().name] * values[name]}
    return left


def plainer_start(fit: Fit, k: int, plain: Hypothesis) -> dict[str, float]:
    """The numbers [SI] with which the `plain` law of cause k does what cause k does, but for what they differ by."""
    law, channel = fit.structure.causes[k].law, plain.channel_on(fit.structure.device)
    relation = law.plainer
    if relation is None:
        raise ValueError(f"{law.kind} generalises no law of the library")
    numbers, start = law.as_plainer(fit.values(k)), {}
    for p in plain.law.params:
        value = channel.si(relation.beside[p.name], p) if p.name in relation.beside else numbers[p.name]
        low, high = plain.bounds(p, channel)
        start[p.name] = min(max(value, low), high)
    return start
