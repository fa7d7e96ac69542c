"""What the search believes of stops and buffers, which are touched from one place on: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ctrlgen.estimation.law_prior import ONE_IN_TEN, LawPrior, ParameterPrior, peaks

OF_STOPS: Mapping[str, LawPrior] = {
    "damped_stop": LawPrior(
        "Rarer than a stop that gives back what it takes: judgement. Rubber is neither this law nor a spring and a dashpot; 10 %: "
        "judgement.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.1,
        refines=frozenset({"end_stop"}),
        parameters={"gap": peaks(-0.9, 0.9), "speed": peaks(0.03, 0.3)},
    ),
    "end_stop": LawPrior(
        "A contact is neither a spring nor Hertz's ball; 5 %: judgement. A spring is plainest. A stop beyond the peak is "
        "untouched; a soft one is a second spring, from where most of the residual is.",
        model_form_error=0.05,
        parameters={
            "gap": replace(peaks(-0.97, -0.9, -0.7, -0.4, 0.4, 0.7, 0.9, 0.97), start_from_data="edges_outward"),
            "power": ParameterPrior((1.0, 1.5), usual=1.0),
        },
    ),
}
