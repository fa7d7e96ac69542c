"""What the search believes of laws that act in one part of the motion alone: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.estimation.law_prior import ONE_IN_A_HUNDRED, ONE_IN_TEN, LawPrior, ParameterPrior, peaks

_REASON = (
    "A law in one part of the motion is rarer than one everywhere, and is suspected where most of the residual is. Neither the law nor "
    "its edge is of one form; 5 %: judgement."
)
_FORM = 0.05


def _edge(suggested: str) -> dict[str, ParameterPrior]:
    """Starts of the edge from the recording, wide and sharp."""
    edge = ParameterPrior(start_from_data=suggested, only_from_data=True)
    return {"edge": edge, "width": ParameterPrior((3e-4, 0.05))}


def _friction(where: dict[str, ParameterPrior], log_prior_odds: float) -> LawPrior:
    contact = {"reach": peaks(3e-4, 3e-3, 0.03), "smoothing": peaks(1e-4, 0.1)}
    return LawPrior(
        _REASON,
        log_prior_odds=log_prior_odds,
        model_form_error=_FORM,
        family="dry friction",
        in_a_region=True,
        parameters=contact | where,
    )


def _damping(where: dict[str, ParameterPrior]) -> LawPrior:
    return LawPrior(_REASON, log_prior_odds=ONE_IN_TEN, model_form_error=_FORM, in_a_region=True, parameters=where)


# it may happen at any time, and is as rare as any event
_FROM_A_MOMENT = {"moment": ParameterPrior(start_from_data="moments"), "rise": peaks(1.0)}
_ABOVE_A_SPEED = {"speed": ParameterPrior(start_from_data="speeds", only_from_data=True)}

IN_A_REGION: Mapping[str, LawPrior] = {
    "coulomb_above": _friction(_edge("edges_above"), ONE_IN_TEN),
    "coulomb_below": _friction(_edge("edges_below"), ONE_IN_TEN),
    "coulomb_after": _friction(_FROM_A_MOMENT, ONE_IN_A_HUNDRED),
    "viscous_above": _damping(_edge("edges_above")),
    "viscous_below": _damping(_edge("edges_below")),
    "viscous_at_speed": _damping(_ABOVE_A_SPEED),
}
