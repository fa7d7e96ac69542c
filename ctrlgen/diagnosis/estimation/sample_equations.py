"""What a model does in one sample, in numbers that stay as they are through a record.

What depends on the parameters p alone (a Jacobian of struts, say) is such a number: it is computed once for a record,
not once a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ctrlgen.diagnosis.settings import SIMULATION
from ctrlgen.model.discretisation import Sample, one_step_map
from ctrlgen.model.integrators import ExponentialRungeKutta, ImplicitRadau, integrator_of
from ctrlgen.model.model import Model


@dataclass(frozen=True, eq=False)
class SampleEquations:
    """`constants` p -> c, dc/dp; S at the next sample (`following`) and the readings y in terms of `given`: S, u, u at the
    next sample, ambient, c. With inertia `model` moves in terms of c, too, by `steps`, the drive `linear` or held."""

    constants: ca.Function
    model: Model
    steps: ExponentialRungeKutta | ImplicitRadau | None
    linear: bool
    following: ca.SX
    y: ca.SX
    given: list[ca.SX]

    @property
    def integrator(self) -> ExponentialRungeKutta | ImplicitRadau:
        """The steps of a model with inertia. Raises ValueError for one without."""
        if self.steps is None:
            raise ValueError("a model in balance takes no steps")
        return self.steps


def build_sample_equations(model: Model, y: ca.SX, sample_time: float, linear: bool) -> SampleEquations:
    """Of `model` with readings `y`, settled where `sample_time` is infinite."""
    moving = [model.sampled_rates, model.held_value, ca.vertcat(ca.SX(0, 1), *model.stepped.values()), y]
    after = None if model.inertial else _after(model, sample_time, linear)
    if after is not None:
        following = ca.vertcat(after.x, after.z)
        if not np.isfinite(sample_time):  # a settled pose is read after it has settled
            y = ca.substitute(y, ca.vertcat(model.x, model.z, model.u), ca.vertcat(following, after.u_next))
        moving = [following, y]
    rows, symbols, parametric = ca.extract_parametric(moving, model.p, {"extract_trivial": True})
    c, value = model.p, model.p
    if ca.Function("work", [model.p], parametric).n_instructions() > SIMULATION.parametric_operations:
        moving, c, value = rows, ca.vertcat(ca.SX(0, 1), *symbols), ca.vertcat(ca.SX(0, 1), *parametric)
    constants = ca.Function("constants", [model.p], [value, ca.jacobian(value, model.p)])
    if after is None:
        rates, held, stepped, y = moving
        stepped = dict(zip(model.stepped, ca.vertsplit(stepped), strict=True))
        nominal = constants(model.p_nominal)[0].full().ravel()
        model = replace(model, p=c, p_nominal=nominal, sampled_rates=rates, held_value=held, stepped=stepped)
        after = _after(model, sample_time, linear)
        following = ca.vertcat(after.x, after.z)
    else:
        following, y = moving
    following, y = ca.cse([following, y])  # before they are differentiated: afterwards it takes ten times as long
    given = [ca.vertcat(model.x, model.z), model.u, after.u_next, model.ambient_symbol, c]
    steps = integrator_of(model, sample_time) if model.inertial else None
    return SampleEquations(constants, model, steps, linear, following, y, given)


def _after(model: Model, sample_time: float, linear: bool) -> Sample:
    return one_step_map(
        model,
        sample_time,
        linear,
        SIMULATION.newton_steps if np.isfinite(sample_time) else SIMULATION.pose_newton_steps,
    )
