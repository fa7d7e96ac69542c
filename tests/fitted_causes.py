"""Causes, and a fit that has them, made of numbers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ctrlgen.estimation.hypothesis import Hypothesis

CREEP, DRIFT, GAIN, REVERSED = (
    Hypothesis(effect, place, "axis")
    for effect, place in (
        ("creep", "stage:axis"),
        ("drift", "sensor:axis"),
        ("drive_gain", "actuator:axis"),
        ("reversed", "actuator:axis"),
    )
)


def fitted(causes=(), theta=(), free_parameters=(), penalty=0.0) -> SimpleNamespace:
    structure = SimpleNamespace(
        causes=causes,
        free_parameters=free_parameters,
        cause_of=lambda parameter: causes[parameter.cause],
        plausible_range=lambda unknown: None,
        device=SimpleNamespace(parts=lambda physics: None),
    )
    return SimpleNamespace(
        structure=structure,
        theta=np.array(theta),
        penalty=penalty,
        J=np.zeros((0, len(theta))),
        covariance=np.diag(np.full(len(theta), 1e-4)),
    )
