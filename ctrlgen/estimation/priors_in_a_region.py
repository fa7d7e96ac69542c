"""What the search believes of laws that act in one part of the motion alone: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ctrlgen.estimation.law_prior import CREEPING, ONE_IN_A_HUNDRED, ONE_IN_TEN, LawPrior, ParameterPrior, peaks

_REASON = (
    "A law in one part of the motion is rarer than one everywhere, and is suspected where most of the residual is. Neither the law nor "
    "its edge is of one form; 5 % an edge: judgement."
)
_FORM = 0.05
_TWO_ENDS = _FORM * 2**0.5


def _seen(suggested: str) -> ParameterPrior:
    """Starts where the recording suggests some."""
    return ParameterPrior(start_from_data=suggested, only_from_data=True)


def _edge(suggested: str) -> dict[str, ParameterPrior]:
    """Starts of the edge from the recording, wide and sharp."""
    return {"edge": _seen(suggested), "width": ParameterPrior((3e-4, 0.05))}


def _stretch() -> dict[str, ParameterPrior]:
    """The same of a stretch with two ends."""
    return {"position": _seen("middles"), "length": _seen("lengths"), "width": ParameterPrior((3e-4, 0.05))}


def _friction(where: dict[str, ParameterPrior], log_prior_odds: float) -> LawPrior:
    contact = {"reach": peaks(3e-4, 3e-3, 0.03), "smoothing": CREEPING}
    return LawPrior(
        _REASON,
        log_prior_odds=log_prior_odds,
        model_form_error=_FORM,
        form_of="dry friction",
        in_a_region=True,
        parameters=contact | where,
    )


def _law(**where: ParameterPrior) -> LawPrior:
    return LawPrior(_REASON, log_prior_odds=ONE_IN_TEN, model_form_error=_FORM, in_a_region=True, parameters=where)


# it may happen at any time, and is as rare as any event
_FROM_A_MOMENT = {"moment": _seen("since"), "rise": peaks(1.0)}


def _backlash(suggested: str) -> LawPrior:
    """Play that opens within a part of the travel."""
    gap = peaks(1e-3, 0.01, 0.1)
    return _law(gap=gap, edge=_seen(suggested), width=ParameterPrior((0.05, 0.2)))


_FRICTIONS = {
    "coulomb_above": _friction(_edge("edges_above"), ONE_IN_TEN),
    "coulomb_below": _friction(_edge("edges_below"), ONE_IN_TEN),
    "coulomb_after": _friction(_FROM_A_MOMENT, ONE_IN_A_HUNDRED),
    "coulomb_on_stretch": replace(
        _friction(_stretch(), ONE_IN_TEN),
        model_form_error=_TWO_ENDS,
        in_place_of=frozenset({"coulomb_above", "coulomb_below"}),
    ),
}


def _falling(kind: str) -> LawPrior:
    """Friction in a region that falls with the speed: a finer form of the law `kind`, which does not."""
    plain = _FRICTIONS[kind]
    contact = {"breakaway": ParameterPrior((1.2, 1.8)), "speed": peaks(0.01, 0.05, 0.2), "reach": peaks(1e-3, 0.01)}
    where = {name: row for name, row in plain.parameters.items() if name not in ("reach", "smoothing")}
    return replace(plain, suspected=False, refines=frozenset({kind}), parameters=contact | where)


IN_A_REGION: Mapping[str, LawPrior] = {
    "backlash_above": _backlash("edges_above"),
    "backlash_below": _backlash("edges_below"),
    **_FRICTIONS,
    "drive_gain_beyond": _law(level=_seen("drives")),
    "local_error": replace(
        _law(position=_seen("middles"), length=_seen("lengths"), rounding=ParameterPrior((0.003, 0.03))),
        repeatable=True,
    ),
    "stiffness_above": _law(edge=_seen("edges_above")),
    "stiffness_below": _law(edge=_seen("edges_below")),
    "stiffness_beyond": _law(edge=_seen("edges_beyond")),
    "stribeck_above": _falling("coulomb_above"),
    "stribeck_below": _falling("coulomb_below"),
    "stribeck_after": _falling("coulomb_after"),
    "temperature_sensitivity_above": _law(reference=_seen("warmer")),
    "viscous_above": _law(**_edge("edges_above")),
    "viscous_below": _law(**_edge("edges_below")),
    "viscous_on_stretch": replace(
        _law(**_stretch()), model_form_error=_TWO_ENDS, in_place_of=frozenset({"viscous_above", "viscous_below"})
    ),
    "viscous_at_speed": _law(speed=_seen("speeds")),
}
