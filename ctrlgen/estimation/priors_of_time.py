"""What the search believes of laws that are functions of time: events, drifts, lines, what is lost little by little; rows of `priors`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ctrlgen.estimation.law_prior import ONE_IN_A_HUNDRED, ONE_IN_TEN, LawPrior, ParameterPrior, peaks

EVENT = {"moment": ParameterPrior(start_from_data="moments"), "rise": peaks(1.0)}  # it may happen at any time
EVENTS_ARE_RARE = (
    "An event at any time. Laws that act always come first among equals: most of a hundred records have no event, and a step fits "
    "something of any structured residual. Judgement."
)

_VIBRATION = LawPrior(
    "From outside. Frequencies of mains and rotating machines, and the lines of the residual's spectrum. Rarer than a pitch, "
    "which is the same at one speed: judgement.",
    log_prior_odds=ONE_IN_TEN,
    form_of="vibration",
    repeatable=True,
    of_time=True,
    domain="disturbance",
    parameters={
        "frequency": ParameterPrior((10.0, 16.7, 25.0, 33.0, 50.0, 60.0, 100.0, 120.0)),
        "phase": ParameterPrior((0.0, 90.0)),
    },
)

_SENSOR_STEP = LawPrior(
    EVENTS_ARE_RARE,
    log_prior_odds=ONE_IN_A_HUNDRED,
    of_time=True,
    domain="disturbance",
    parameters=EVENT,
)

OF_TIME: Mapping[str, LawPrior] = {
    "degradation": LawPrior(
        "From a loss that ends within the recording to a steady one.",
        parameters={"levels_off": ParameterPrior((3.0, 30.0, 1e4))},
    ),
    "drift": LawPrior(
        "What drifts also wanders; 10 %: judgement. As rare as an event: it follows any residual that has a slow part.",
        log_prior_odds=ONE_IN_A_HUNDRED,
        model_form_error=0.1,
        form_of="drift",
        of_time=True,
    ),
    "drift_per_record": LawPrior(
        "As rare as one drift of all records, and a number for each of them. Rooms and amplifiers warm up anew: judgement.",
        log_prior_odds=ONE_IN_A_HUNDRED,
        model_form_error=0.1,
        form_of="drift",
        of_time=True,
        of_each_record=True,
        parameters={"share": ParameterPrior(fixed_range=(0.8, 1.2))},
    ),
    "force_step": LawPrior(
        EVENTS_ARE_RARE, log_prior_odds=ONE_IN_A_HUNDRED, of_time=True, domain="disturbance", parameters=EVENT
    ),
    "lost_beams": LawPrior(EVENTS_ARE_RARE, log_prior_odds=ONE_IN_A_HUNDRED, of_time=True, parameters=EVENT),
    "sensor_step": _SENSOR_STEP,
    "sensor_step_per_record": replace(
        _SENSOR_STEP,
        reason="Of one record, of which no other tells: where a step of all of them explains as much, it is that. "
        + EVENTS_ARE_RARE,
        log_prior_odds=ONE_IN_A_HUNDRED + ONE_IN_TEN,
        of_each_record=True,
        parameters=EVENT | {"share": ParameterPrior(fixed_range=(0.8, 1.2))},
    ),
    "stiffness_drift": LawPrior(
        "As `degradation`, which it is in slow motion, and rarer: judgement. In balance both are one.",
        log_prior_odds=ONE_IN_TEN,
        unless=frozenset({"balanced"}),
        parameters={"levels_off": ParameterPrior((3.0, 30.0, 1e4))},
    ),
    "vibration": _VIBRATION,
    "vibration_per_record": replace(
        _VIBRATION,
        reason="Where the records do not tell whether their phases differ, they do not: judgement. "
        + _VIBRATION.reason,
        log_prior_odds=ONE_IN_TEN - 1.0,
    ),
    "warm_up": LawPrior(
        "A drift that levels off, as rare as one and as far from its form. From within a twelfth of the recording to far beyond it.",
        log_prior_odds=ONE_IN_A_HUNDRED,
        model_form_error=0.1,
        form_of="drift",
        of_time=True,
        parameters={"tau": peaks(1.0, 4.0, 16.0)},
    ),
}
