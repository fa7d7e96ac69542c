"""What the search believes of laws by which a reading follows late, forgets or rings: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.estimation.law_prior import ONE_IN_TEN, SECOND_ORDER_FILTER, LawPrior, ParameterPrior

OF_FILTERS: Mapping[str, LawPrior] = {
    "high_pass": LawPrior(
        "A leak acts on the whole reading: one that is fitted to a part of it stands for something else. From a coupling to a "
        "charge amplifier.",
        model_form_error=0.005,
        parameters={
            "share": ParameterPrior(plausible_range=(0.8, 1.2)),
            "tau": ParameterPrior((0.02, 0.15, 1.0, 8.0, 60.0)),
        },
    ),
    "low_pass": LawPrior(
        "No filter has exactly two poles; 0.5 %: judgement.",
        model_form_error=0.005,
        parameters=SECOND_ORDER_FILTER,
    ),
    "moving_average": LawPrior(
        "To second order in the frequency it is a filter of two poles, or a delay, which are commoner and are named where they are enough: "
        "judgement. Error of the interpolation between samples: 0.1 %, judgement, as of a delay.",
        log_prior_odds=ONE_IN_TEN,
        suspected=False,
        refines=frozenset({"low_pass", "delay"}),
        also_in_place_of=frozenset({"notch", "amplifier_lag"}),
        model_form_error=0.001,
    ),
    "soft_coupling": LawPrior(
        "A load has more than one mode; 1 %: judgement. Of an axis whose mass is described it is a resonance. Octaves, lightly and "
        "well damped.",
        unless=frozenset({"velocity"}),
        model_form_error=0.01,
        parameters={
            "share": ParameterPrior(fixed_range=(0.8, 1.2)),
            "frequency": ParameterPrior((5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0)),
            "damping": ParameterPrior((0.02, 0.15)),
        },
    ),
}
