"""Waves of positive amplitude: -A sin(x + phi) = A sin(x + phi + 180 deg), of which a fit ends in either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER

PHASE = "phase"
"""The number of a law by which it is a wave, in rad: with half a turn more it is the same law of the other sign."""


def with_positive_waves(candidate: CandidateModel) -> CandidateModel:
    """The same model, every wave of it told by a positive amplitude, its phase within half a turn of zero."""
    fit = positive(candidate.fit)
    return candidate if fit is candidate.fit else replace(candidate, fit=fit)


def positive(fit: Fit) -> Fit:
    """The same fit, whose readings stay as they are, with every wave of positive amplitude: the number and its slope change their sign."""
    theta, J = fit.theta.copy(), fit.J.copy()
    places = {(u.cause, u.name): i for i, u in enumerate(fit.structure.free_parameters) if u.cause is not None}
    for k, cause in enumerate(fit.structure.causes):
        size = None if cause.effect == PARAMETER else places.get((k, cause.law.amplitude().name))
        turn = places.get((k, PHASE))
        if size is not None and turn is not None and theta[size] < 0:
            even = (places.get((k, name)) for name in cause.law.of_even_harmonics)
            signed = [size, *(i for i in even if i is not None)]
            theta[signed] *= -1
            J[:, signed] *= -1
            theta[turn] = np.remainder(theta[turn] + 2 * np.pi, 2 * np.pi) - np.pi
    return fit if np.array_equal(theta, fit.theta) else replace(fit, theta=theta, J=J)
