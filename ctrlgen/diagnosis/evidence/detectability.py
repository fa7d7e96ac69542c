"""Detectability: the smallest amplitude of each effect that a recording would have shown, and effects it cannot show.

An amplitude a has the score z = a/sd. It is detectable where |z| exceeds the threshold of the screen, and identifiable
where z^2 also exceeds what the search requires of a cause. An effect whose sensitivity lies in the span of the free
parameters' sensitivities is undetectable at any amplitude.
"""

from __future__ import annotations

from pydantic import Field

from ctrlgen.core.units import difference, written_unit
from ctrlgen.diagnosis.selection.cause_entry import EffectAt
from ctrlgen.diagnosis.selection.confusable import look_alike
from ctrlgen.diagnosis.selection.screen import Screened
from ctrlgen.diagnosis.settings import MODEL_SELECTION
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, numbers
from ctrlgen.reporting.result_file import FiniteOrNull, Keys


class SmallestDetectableEntry(EffectAt):
    """The smallest amplitude of one effect that this recording would have shown, at the location where it shows most."""

    amplitude: str = Field(description="Name of the amplitude parameter.")
    detectable_from: FiniteOrNull = Field(description="Smallest amplitude that exceeds the screen's threshold [unit].")
    identifiable_from: FiniteOrNull = Field(description="Smallest amplitude that would also have been named [unit].")
    unit: str = Field(description="Unit of the amplitude.")
    confusable_with: list[tuple[str, str]] = Field(description="[effect, location] of what it would be taken for.")
    by_location: dict[str, FiniteOrNull] = Field(description="detectable_from at every location [unit].")


class UndetectableEntry(EffectAt):
    """A cause that this recording cannot show."""

    masked_by: str = Field(description="The free parameter, or the reason, that hides it.")


class DetectabilityEntry(Keys):
    """What this recording could have shown besides the findings."""

    smallest: dict[str, SmallestDetectableEntry] = Field(description="By effect.")
    undetectable: list[UndetectableEntry] = Field(description="Causes that this recording cannot show.")


def detectability(fit: Fit, screened: Screened, n: float) -> DetectabilityEntry:
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
    masked = {h: _masking_parameter(fit, k) for h, k in screened.undetectable.items() if h.path not in free}
    masked |= dict.fromkeys(beyond, "the noise: only an amplitude beyond its bounds would show")
    undetectable = [UndetectableEntry(effect=h.effect, location=h.location, masked_by=why) for h, why in masked.items()]
    return DetectabilityEntry(smallest=smallest, undetectable=undetectable)


def _span(h: Hypothesis) -> float:
    low, high = h.law.amplitude().bounds
    return high - low


def _smallest(
    kind: str, places: dict[Hypothesis, tuple[float, float, str]], screened: Screened, need: float
) -> SmallestDetectableEntry:
    """The smallest detectable amplitude of one `kind` of effect, from (sd [unit], sd over its range, unit) by place."""
    best = min(places, key=lambda h: places[h][1])
    sd, _, unit = places[best]
    suspect = next(s for s in screened.suspects if s.hypothesis == best)
    confusable_with = [(s.hypothesis.effect, s.hypothesis.location) for s in look_alike(screened, suspect)]
    name = best.path.rpartition(".")[2] if kind == PARAMETER else best.law.amplitude().name
    by_location = {h.location: screened.threshold * value for h, (value, *_) in places.items()}
    return SmallestDetectableEntry(
        effect=kind,
        location=best.location,
        amplitude=name,
        detectable_from=screened.threshold * sd,
        identifiable_from=need * sd,
        unit=unit,
        confusable_with=confusable_with,
        by_location=by_location,
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
