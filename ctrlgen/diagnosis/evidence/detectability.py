"""What a recording could have shown: the smallest effect of each kind that would have been seen, and what stays hidden.

An amplitude a gives z = a/sd; it is seen where |z| exceeds the screen's threshold, and named where z^2 also exceeds what
the search asks for. A law whose slope lies in the span of the free numbers' slopes cannot be seen at any size.
"""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.core.units import difference, written_unit
from ctrlgen.diagnosis.estimation.fit import Fit
from ctrlgen.diagnosis.hypotheses.hypotheses import PARAMETER, Hypothesis, numbers
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import DETECTABILITY, MODEL_SELECTION


@dataclass(frozen=True)
class SmallestDetectable:
    """The smallest amplitude of one kind that would have been seen, `identifiable_from` which it would also have been named,
    in `unit`, at the place where it shows most; `confusable_with` what it would be taken for there."""

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
    """A cause that this recording cannot show, and what it hides behind."""

    effect: str
    location: str
    masked_by: str


@dataclass(frozen=True)
class Detectability:
    """`smallest` by kind, and the `hidden` causes."""

    smallest: dict[str, SmallestDetectable]
    undetectable: tuple[Undetectable, ...]


def detectability(fit: Fit, screened: Screened, n: int) -> Detectability:
    """What would have been seen besides the causes of `fit`, by the screen of its residual over `n` samples.

    Where `fit` leaves more than the noise, that counts as noise here.
    """
    louder = max(1.0, (fit.chi2 / max(n, 1)) ** 0.5)
    need = max(screened.threshold, MODEL_SELECTION.material_share * n**0.5)
    nominal = {path: number for path, _, number in numbers(fit.structure.device)}
    kinds: dict[str, dict[Hypothesis, tuple[float, float, str]]] = {}
    for suspect in screened.suspects:
        h = suspect.hypothesis
        sd = louder * screened.amplitude_sd[h.effect, h.location]
        if h.effect == PARAMETER:
            unit, weight = written_unit(nominal[h.path].text), 1 / max(abs(nominal[h.path].si), 1e-300)
        else:
            where = fit.structure.channel_of(h)
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
        Undetectable(h.effect, h.location, "the noise: it would show only beyond its bounds") for h in beyond
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
    """The free number in words."""
    unknowns = fit.structure.free_parameters
    if column < 0:
        return "nothing: it does not reach these readings"
    if column >= len(unknowns):
        return "what the records start with"
    unknown = unknowns[column]
    if unknown.cause is None:
        return f"the device's own {unknown.path}"
    cause = fit.structure.causes[unknown.cause]
    return f"{cause.effect} at {cause.location}"
