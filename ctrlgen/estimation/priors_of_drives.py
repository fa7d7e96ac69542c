"""What the search believes of laws of a drive: rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.estimation.law_prior import (
    LEVELLING_OFF,
    ONE_IN_TEN,
    SECOND_ORDER_FILTER,
    LawPrior,
    ParameterPrior,
    peaks,
)
from ctrlgen.estimation.priors_of_a_lag import HYSTERESIS

OF_DRIVES: Mapping[str, LawPrior] = {
    "amplifier_lag": LawPrior(
        "As a filter of a reading, of the drive: behind a stage without play or friction the two are one, and most of what is slow "
        "in a loop is a filter of its readings: judgement.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.005,
        parameters=SECOND_ORDER_FILTER,
    ),
    "asymmetric_gain": LawPrior(
        "Rarer than a gain that is wrong in both directions: judgement.", log_prior_odds=ONE_IN_TEN
    ),
    "asymmetric_slew_rate": LawPrior(
        "As a rate that is the same both ways, of which it is a finer form.",
        refines=frozenset({"slew_rate"}),
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "rate": peaks(0.03, 0.2, 0.8),
            "excess": ParameterPrior((-1.0, 1.0)),
        },
    ),
    "back_emf": LawPrior(
        "Most amplifiers of a motor control its current: judgement. A coil is at a voltage or it is not.",
        log_prior_odds=ONE_IN_TEN,
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "emf": ParameterPrior((0.03, 0.3)),
            "tau": ParameterPrior((5e-4, 2e-3, 1e-2)),
        },
    ),
    "butterfly": LawPrior(
        "Actuators without bias are rare: judgement. " + HYSTERESIS,
        log_prior_odds=ONE_IN_TEN,
        unless=frozenset({"heat"}),
        model_form_error=0.02,
        form_of="hysteresis",
        parameters={
            "linear": ParameterPrior((0.0, 1.0)),
            "reach": ParameterPrior((0.03, 0.1, 0.3, 1.0)),
            "taper": ParameterPrior((0.0,)),
        },
    ),
    **dict.fromkeys(
        ("cubic_drive", "square_drive"),
        LawPrior(
            "Most amplifiers and coils are straighter than sensors and flexures: judgement. In balance a curve of the drive is one of "
            "the displacement.",
            log_prior_odds=ONE_IN_TEN,
            unless=frozenset({"balanced"}),
        ),
    ),
    "dead_zone": LawPrior(
        "Between contacts that open (0.03) and an electronic crossover (1).",
        parameters={"rounding": ParameterPrior((0.3,))},
    ),
    "drive_crosstalk": LawPrior(
        "Rarer than a stage that carries its neighbour, which is just the same where drives are displacements: judgement.",
        log_prior_odds=ONE_IN_TEN,
        unless=frozenset({"displacement_command"}),
    ),
    "drive_offset": LawPrior("As common as a wrong gain.", constant=True),
    "drive_quantisation": LawPrior(
        "Steps that show are rarer than a wrong gain: judgement. A converter has steps or it has none; where what is left does not repeat "
        "along the drive, they are not suspected.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.03,
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "quantum": ParameterPrior(start_from_data="drive_levels", only_from_data=True),
            "grid": ParameterPrior((-0.25, 0.0, 0.25, 0.5)),
            "rounding": ParameterPrior((0.1,)),
        },
    ),
    "notch": LawPrior(
        "Who puts a notch into a controller knows it; one that is forgotten is rarer than a lag: judgement.",
        log_prior_odds=ONE_IN_TEN,
        model_form_error=0.005,
        parameters={
            "share": ParameterPrior(plausible_range=(0.5, 1.5)),
            "tau": ParameterPrior((1e-3, 3e-3, 1e-2, 5e-2)),
            "damping": ParameterPrior((0.5, 2.0)),
        },
    ),
    "one_sided_saturation": LawPrior(
        "As a limit both ways, and rarer: judgement.",
        log_prior_odds=ONE_IN_TEN,
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "level": peaks(-0.9, -0.7, -0.4, -0.2, 0.2, 0.4, 0.7, 0.9),
        },
    ),
    "reversed": LawPrior(
        "A wiring fault is rarer than a wrong gain: judgement. A lead is swapped or it is not.",
        log_prior_odds=ONE_IN_TEN,
        domain="mechanism",
        parameters={"share": ParameterPrior(fixed_range=(0.9, 1.1))},
    ),
    "saturation": LawPrior(
        "A limit beyond the peak shows nowhere; one far below it would have been noticed. An amplifier clips or it does not.",
        form_of="saturation",
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "level": peaks(0.2, 0.4, 0.6, 0.8, 0.9, 0.97),
        },
    ),
    "slew_rate": LawPrior(
        "An amplifier slews or it does not; a step of the drive within a sample is hundreds of times as fast: judgement.",
        parameters={
            "share": ParameterPrior(fixed_range=(0.5, 1.5)),
            "rate": peaks(3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97),
        },
    ),
    "soft_saturation": LawPrior(
        "Rarer than a limit that is run into: judgement. Measured curves differ from any form of theirs: tanh by 0.5 % of what it takes "
        "away, of which 1 % is twice. A curve is there or it is not; it bends already where its limit is beyond the peak.",
        log_prior_odds=-1.0,
        model_form_error=0.01,
        form_of="saturation",
        parameters=LEVELLING_OFF,
    ),
    "swapped": LawPrior(
        "A wiring fault is rarer than a wrong gain: judgement. Two leads are exchanged or they are not.",
        log_prior_odds=ONE_IN_TEN,
        domain="mechanism",
        parameters={"share": ParameterPrior(fixed_range=(0.9, 1.1))},
    ),
}
