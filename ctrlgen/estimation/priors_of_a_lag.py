"""What the search believes of laws of which a signal lags behind itself, by plays or a slipping spring: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ctrlgen.estimation.law_prior import ONE_IN_TEN, LawPrior, ParameterPrior

HYSTERESIS = (
    "Forms of one loop. 2 %: nature leaves about a fiftieth of a loop beside any of them, judged on simulated cases."
)
_TAPER = ParameterPrior((0.5,))


def _reach(*multiples: float, peaks: bool = False) -> ParameterPrior:
    """Start values of the way after which plays follow."""
    return ParameterPrior(multiples, scales_with_peak=peaks)


def _reversible(*values: float) -> ParameterPrior:
    """Start values of the part of a loop that is none."""
    return ParameterPrior(values, proportional=True)


_ASYMMETRIC_LAG = LawPrior(
    "Rarer than a symmetric loop: judgement. Heaters have none. Begun with one branch wider, or the other. "
    + HYSTERESIS,
    log_prior_odds=ONE_IN_TEN,
    model_form_error=0.02,
    form_of="hysteresis",
    parameters={
        "reach": _reach(0.1, 0.4, peaks=True),
        "taper": ParameterPrior((0.5,)),
        "reversible": _reversible(0.0),
        "upper": ParameterPrior((-0.3, 0.3)),
        "lower": ParameterPrior((0.0,)),
        "side": ParameterPrior((0.0,)),
    },
)
_WEIGHTED_LAG = LawPrior(
    "A finer form of a hysteresis that is found, for weights of its plays that follow no power. " + HYSTERESIS,
    suspected=False,
    model_form_error=0.02,
    form_of="hysteresis",
    parameters={
        "reach": _reach(0.3, peaks=True),
        "reversible": _reversible(0.0),
        **{f"part{j}": ParameterPrior((0.3,)) for j in range(1, 8)},
    },
)

OF_A_LAG: Mapping[str, LawPrior] = {
    "asymmetric_displacement_hysteresis": _ASYMMETRIC_LAG,
    "asymmetric_drive_hysteresis": replace(_ASYMMETRIC_LAG, unless=frozenset({"heat"})),
    "displacement_bouc_wen": LawPrior(
        HYSTERESIS,
        model_form_error=0.02,
        form_of="hysteresis",
        parameters={"reach": _reach(0.01, 0.03, 0.1, 0.3, 1.0, peaks=True), "loop": ParameterPrior((0.55, 0.9))},
    ),
    "displacement_bouc_wen_of_power": LawPrior(
        "A finer form of a smooth loop that is found, for a knee that is no exponential. " + HYSTERESIS,
        suspected=False,
        refines=frozenset({"displacement_bouc_wen"}),
        model_form_error=0.02,
        form_of="hysteresis",
        parameters={
            "reach": _reach(0.1, 0.3, peaks=True),
            "loop": ParameterPrior((0.55, 0.9)),
            "power": ParameterPrior((1.5,)),
        },
    ),
    "displacement_hysteresis": LawPrior(
        HYSTERESIS,
        model_form_error=0.02,
        form_of="hysteresis",
        parameters={
            "reach": _reach(0.03, 0.1, 0.3, 1.0, peaks=True),
            "taper": _TAPER,
            "reversible": _reversible(0.0, 1.0),
        },
    ),
    "drive_hysteresis": LawPrior(
        "Rarer than hysteresis of the stage, which explains the same in a stage of constant stiffness: judgement. Heaters have none. "
        + HYSTERESIS,
        log_prior_odds=ONE_IN_TEN,
        unless=frozenset({"heat"}),
        model_form_error=0.02,
        form_of="hysteresis",
        parameters={"reach": _reach(0.03, 0.1, 0.3, 1.0), "taper": replace(_TAPER, start_values=(0.0,))},
    ),
    "weighted_displacement_hysteresis": replace(
        _WEIGHTED_LAG,
        refines=frozenset({"displacement_hysteresis", "displacement_bouc_wen", "asymmetric_displacement_hysteresis"}),
    ),
    "weighted_drive_hysteresis": replace(
        _WEIGHTED_LAG,
        refines=frozenset({"drive_hysteresis", "asymmetric_drive_hysteresis"}),
        log_prior_odds=ONE_IN_TEN,
        unless=frozenset({"heat"}),
    ),
}
