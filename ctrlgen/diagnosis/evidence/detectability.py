"""Detectability: the smallest amplitude of each effect that a recording would have shown, and effects it cannot show.

An amplitude a has the score z = a/sd. It is detectable where |z| exceeds the threshold of the screen, and identifiable
where z^2 also exceeds what the search requires of a cause. An effect whose sensitivity lies in the span of the free
parameters' sensitivities is undetectable at any amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.core.units import difference, written_unit
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import DETECTABILITY, MODEL_SELECTION
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, numbers


@dataclass(frozen=True)
class SmallestDetectable:
    """The smallest detectable amplitude of one effect, at the location where it shows most.

    amplitude: name of the amplitude parameter.
    detectable_from: smallest amplitude that exceeds the screen's threshold [unit].
    identifiable_from: smallest amplitude that the search would also have accepted [unit].
    confusable_with: (effect, location) of hypotheses with nearly the same effect on the readings.
    by_location: detectable_from at every location [unit].
    """

    effect: str
    location: str
    amplitude: str
    detectable_from: float
    identifiable_from: float
    unit: str
    confusable_with: tuple[tuple[str, str], ...]
    by_location: dict[str, float]


@dataclass(frozen=True)
class Undetectable:
    """A cause that this recording cannot show, and what masks it."""

    effect: str
    location: str
    masked_by: str


@dataclass(frozen=True)
class Detectability:
    """The smallest detectable amplitudes by effect, and the undetectable causes."""

    smallest: dict[str, SmallestDetectable]
    undetectable: tuple[Undetectable, ...]


def detectability(fit: Fit, screened: Screened, n: float) -> Detectability:
    """Detectability of every hypothesis beside the causes of `fit`, from the screen of its residual over `n` samples.

    Where the residual exceeds the noise, the residual takes the place of the noise.
    """
    excess_factor = max(1.0, (fit.chi2 / max(n, 1)) ** 0.5)
    need = max(screened.threshold, MODEL_SELECTION.material_share * n**0.5)
    nominal = {path: number for path, _, number in numbers(fit.structure.device)}
    kinds: dict[str, dict[Hypothesis, tuple[float, float, str]]] = {}
    for suspect in screened.suspects:
        h = suspect.hypothesis
        sd = excess_factor * screened.amplitude_sd[h.effect, h.location]
        if h.effect == PARAMETER:
            unit, weight = written_unit(nominal[h.path].text), 1 / max(abs(nominal[h.path].si), 1e-300)
        else:
            where = h.channel_on(fit.structure.device)
            unit, weight = where.unit_of(h.law.amplitude()), 1 / abs(where.si(_span(h), h.law.amplitude()))
        kinds.setdefault(h.effect, {})[h] = (float(difference(sd, unit)), sd * weight, unit)
    beyond = [h for places in kinds.values() for h, (_, weight, _) in places.items() if screened.threshold * weight > 1]
    kinds = {kind: left for kind, p in kinds.items() if (left := {h: row for h, row in p.items() if h not in beyond})}
    smallest = {kind: _smallest(kind, places, screened, need) for kind, places in sorted(kinds.items())}
    free = {u.path for u in fit.structure.free_parameters}
    undetectable = tuple(
        Undetectable(h.effect, h.location, _masking_parameter(fit, k))
        for h, k in screened.undetectable.items()
        if h.path not in free
    )
    too_small = tuple(
        Undetectable(h.effect, h.location, "the noise: only an amplitude beyond its bounds would show") for h in beyond
    )
    return Detectability(smallest, undetectable + too_small)


def _span(h: Hypothesis) -> float:
    low, high = h.law.amplitude().bounds
    return high - low


def _smallest(
    kind: str, places: dict[Hypothesis, tuple[float, float, str]], screened: Screened, need: float
) -> SmallestDetectable:
    best = min(places, key=lambda h: places[h][1])
    sd, _, unit = places[best]
    own = next(s for s in screened.suspects if s.hypothesis == best)
    others = sorted(
        (s for s in screened.suspects if s.hypothesis != best), key=lambda s: -screened.confusability(own, s)
    )
    confusable_with = tuple(
        (s.hypothesis.effect, s.hypothesis.location)
        for s in others[:DETECTABILITY.most_alike] if screened.confusability(own, s) >= DETECTABILITY.alike
    )  # fmt: skip
    name = best.path.rpartition(".")[2] if kind == PARAMETER else best.law.amplitude().name
    by_location = {h.location: screened.threshold * value for h, (value, *_) in places.items()}
    return SmallestDetectable(
        kind, best.location, name, screened.threshold * sd, need * sd, unit, confusable_with, by_location
    )


def _masking_parameter(fit: Fit, column: int) -> str:
    """The free parameter `column` of the fit in words, or why there is none."""
    unknowns = fit.structure.free_parameters
    if column < 0:
        return "nothing: it does not affect these readings"
    if column >= len(unknowns):
        return "the initial states of the records"
    unknown = unknowns[column]
    if unknown.cause is None:
        return f"the device's parameter {unknown.path}"
    cause = fit.structure.causes[unknown.cause]
    return f"{cause.effect} at {cause.location}"
