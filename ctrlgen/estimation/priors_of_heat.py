"""What the search believes of laws of heat, which changes what an actuator does: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.estimation.law_prior import ONE_IN_TEN, LawPrior, ParameterPrior

OF_HEAT: Mapping[str, LawPrior] = {
    "coil_heating": LawPrior(
        "A coil on a body is two thermal masses: 2 %. Most coils are driven by a current, which their heat does not change: judgement.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.02,
        parameters={"tau": ParameterPrior((0.3, 3.0, 30.0, 300.0))},
    ),
    "heat_loss": LawPrior(
        "No power of the rise is radiation: 1 %, as its file says. Starts: silicon that conducts less, a coefficient, radiation.",
        model_form_error=0.01,
        parameters={"power": ParameterPrior((0.6, 1.0, 1.6), usual=1.0)},
    ),
    "heater_resistance": LawPrior(form_of="heater resistance"),
    "heater_resistance_of_second_order": LawPrior(
        "A resistance that is straight enough is commoner: judgement. No resistance is a parabola; 1 %: judgement. Starts: silicon that "
        "turns at 300 K, platinum.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.01,
        form_of="heater resistance",
        parameters={"curvature": ParameterPrior((-1.7e-3, -1.5e-4))},
    ),
    "second_pole": LawPrior(
        "Time constants from a chip's to a room's.",
        parameters={"tau": ParameterPrior((2e-3, 0.01, 0.05, 0.3, 2.0, 20.0))},
    ),
    "thermal_lag": LawPrior(
        "Three time constants stand for a continuous body; 2 %: judgement. Their ratio: between one mass and a rod (1/9) and above.",
        model_form_error=0.02,
        parameters={
            "tau": ParameterPrior((0.01, 0.05, 0.3, 1.0, 3.0, 10.0, 60.0)),
            "second": ParameterPrior((0.05, 0.3)),
        },
    ),
}
