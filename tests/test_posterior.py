"""What a fit says of its parameters, within their bounds."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, fitter_of

from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.posterior import Posterior
from ctrlgen.estimation.prediction_uncertainty import prediction_uncertainty
from ctrlgen.estimation.structure import Structure

RUBBING = {"force": 0.05, "reach": 3e-8, "smoothing": 1e-10}  # the sharpest corner
STRUCTURE = Structure(AXIS).with_cause(Hypothesis("coulomb", "stage:axis", "axis"), RUBBING)
NAMES = [p.name for p in STRUCTURE.free_parameters]
FORCE, CORNER = NAMES.index("force"), NAMES.index("smoothing")


def fit_with(J: np.ndarray) -> Fit:
    return Fit(STRUCTURE, STRUCTURE.start, (), 0.0, 1500, np.zeros(0), J, 0.0)


def slopes(**by_name: float) -> np.ndarray:
    """Slopes of as many readings as parameters: of one each, in units of a tenth of its range unless given."""
    free = STRUCTURE.free_parameters
    sizes = [by_name.get(p.name, 0.1 * (p.high - p.low) if p.cause is not None else p.sd) for p in free]
    return np.diag(1 / np.array(sizes))


def test_a_well_determined_number_has_the_deviation_of_the_curvature():
    posterior = Posterior.of(fit_with(slopes(force=1e-6)))
    assert posterior.sd[FORCE] == pytest.approx(1e-6, rel=1e-6)
    # by its logarithm
    sharp = Posterior.of(fit_with(slopes(smoothing=1e-12)))
    assert sharp.sd[CORNER] == pytest.approx(1e-2, rel=1e-4) and sharp.x(STRUCTURE.start)[CORNER] == np.log(1e-10)


def test_a_number_that_the_readings_hardly_show_is_somewhere_within_its_bounds():
    p = STRUCTURE.free_parameters[CORNER]
    posterior = Posterior.of(fit_with(slopes(smoothing=1e6)))
    assert posterior.sd[CORNER] == pytest.approx(np.log(p.high / p.low) / np.sqrt(12), rel=1e-6)
    unshown = slopes()
    unshown[CORNER, CORNER] = 0.0
    assert Posterior.of(fit_with(unshown)).sd[CORNER] == 0.0


def test_a_step_that_ends_at_a_bound_is_the_best_of_the_other_numbers():
    """Two numbers of which the records see a sum: the corner cannot become sharper, so the force alone follows."""
    posterior = Posterior.of(fit_with(slopes(force=1e-3, smoothing=1e-10)))
    H, gradient = np.zeros((len(NAMES), len(NAMES))), np.zeros(len(NAMES))
    both = [FORCE, CORNER]
    H[np.ix_(both, both)] = 100.0
    gradient[both] = -100.0
    step = posterior.step(STRUCTURE.start, gradient, H)
    assert step[CORNER] == 0.0 and step[FORCE] / posterior.sd[FORCE] == pytest.approx(-100 / 101, rel=1e-3)
    inward = posterior.step(STRUCTURE.start, -gradient, H)
    assert inward[CORNER] > 0 and inward[FORCE] / posterior.sd[FORCE] == pytest.approx(100 / 201, rel=0.01)
    moved = posterior.moved(STRUCTURE.start, inward)
    assert moved[CORNER] == pytest.approx(1e-10 * np.exp(inward[CORNER])) and posterior.penalty(moved) > 0
    assert posterior.penalty(STRUCTURE.start) == 0.0


def test_a_corner_sharper_than_the_records_tell_costs_nothing_and_predicts_as_surely():
    """A law beside it without such a number: the held-out records and the error of its prediction are the same."""
    fitter = fitter_of(n=400)
    sharp, fixed = fitter.fit(STRUCTURE, steps=0), list(STRUCTURE.free_parameters)
    del fixed[CORNER]
    without = fitter.fit(Structure(AXIS, STRUCTURE.causes, STRUCTURE.starts, free=tuple(fixed)), steps=0)
    refits = [refit_to_held_out(fitter, fit, 4) for fit in (sharp, without)]
    left = [fitter.held_out_squares(r.fit) + r.penalty + r.log_det for r in refits]
    assert left[0] == pytest.approx(left[1], abs=2.0)
    assert prediction_uncertainty(fitter, sharp) == pytest.approx(prediction_uncertainty(fitter, without), rel=0.1)
