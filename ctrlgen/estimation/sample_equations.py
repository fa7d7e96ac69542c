"""The equations of one sample, with everything that depends on the parameters alone computed once for a record.

F(S, u, u+, e, p) and H(S, u, e, p) become functions of constants c(p) instead of p. Where the model holds much that depends
on p alone (a Jacobian of struts, for instance), c holds those results; else c = p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca

from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.model.discretisation import Sample, one_step_map
from ctrlgen.model.integrators import ExponentialRungeKutta, ImplicitRadau, integrator_of
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import ImplicitRoots


@dataclass(frozen=True, eq=False)
class SampleEquations:
    """S at the next sample, `following`, and the readings `y`, as expressions in `given`: S, u, u+, ambient, c, and in the symbols of
    `roots`, which `one` inserts.

    `constants` is p -> c, dc/dp. A model with inertia takes the `steps` of its integrator within the sample, under a drive
    that is `linear` or held; `model` states its rates in terms of c. A sample is one of settled `poses`, or of a series.
    """

    constants: ca.Function
    model: Model
    steps: ExponentialRungeKutta | ImplicitRadau | None
    linear: bool
    following: ca.SX
    y: ca.SX
    given: list[ca.SX]
    poses: bool
    roots: ImplicitRoots

    def one(self, name: str, values: Sequence[ca.SX], options: dict[str, Any] | None = None) -> ca.Function:
        """The function `given` -> `values`, such as `following`, `y` and their derivatives."""
        return ca.Function(name, self.given, self.roots.inserted(values), options or {})

    @property
    def integrator(self) -> ExponentialRungeKutta | ImplicitRadau:
        """The steps of a model with inertia. Raises ValueError for one without."""
        if self.steps is None:
            raise ValueError("a model in balance takes no integrator steps")
        return self.steps


def build_sample_equations(
    model: Model,
    y: ca.SX,
    sample_time: float,
    linear: bool,
    poses: bool = False,
    finer: int = 1,
    of_device: Sequence[int] = (),
) -> SampleEquations:
    """The sample equations of `model` with readings `y` (n_y,) for records of one `Timing`, in `finer` times its integrator's steps.
    `of_device`: the places in p of the device's own numbers."""
    stepped, resting = (ca.vertcat(ca.SX(0, 1), *those.values()) for those in (model.stepped, model.resting))
    expressions = [model.sampled_rates, model.held_value, stepped, resting, y]
    roots = ImplicitRoots()
    sample = None if model.inertial else _one_step(model, sample_time, linear, poses, finer, roots)
    if sample is not None:
        following = ca.vertcat(sample.x, sample.z)
        # read at the end of the dwell
        if poses:
            y = ca.substitute(y, ca.vertcat(model.x, model.z, model.u), ca.vertcat(following, sample.u_next))
        expressions = [following, y, *roots.values]
    in_symbols, symbols, parametric = ca.extract_parametric(expressions, model.p, {"extract_trivial": True})
    c, value = model.p, model.p
    if ca.Function("work", [model.p], parametric).n_instructions() > SIMULATION.parametric_operations:
        expressions = in_symbols
        c, value = ca.vertcat(ca.SX(0, 1), *symbols), ca.vertcat(ca.SX(0, 1), *parametric)
    constants = _with_jacobian(value, model.p, of_device)
    if sample is None:
        rates, held, *placed, y = expressions
        stepped, resting = (
            dict(zip(those, ca.vertsplit(values), strict=True))
            for those, values in zip((model.stepped, model.resting), placed, strict=True)
        )
        nominal = constants(model.p_nominal)[0].full().ravel()
        numbers = {"p": c, "p_nominal": nominal, "sampled_rates": rates, "held_value": held}
        model = replace(model, **numbers, stepped=stepped, resting=resting)
        sample = _one_step(model, sample_time, linear, poses, finer, roots)
        following = ca.vertcat(sample.x, sample.z)
    else:
        following, y, *roots.values = expressions
    # before differentiation: afterwards it takes ten times as long
    following, y, *roots.values = ca.cse([following, y, *roots.values])
    given = [ca.vertcat(model.x, model.z), model.u, sample.u_next, model.ambient_symbol, c]
    steps = integrator_of(model, sample_time, finer) if model.inertial else None
    return SampleEquations(constants, model, steps, linear, following, y, given, poses, roots)


def _with_jacobian(value: ca.SX, p: ca.SX, of_device: Sequence[int]) -> ca.Function:
    """p (k,) -> `value` (n_c,), dvalue/dp. What depends on the device's numbers alone is differentiated once for all structures: that of
    a hexapod's struts takes as long as the rest of each of the many structures that a search tries."""
    if not of_device or ca.Function("value", [p], [value]).n_instructions() <= SIMULATION.parametric_operations:
        return ca.Function("constants", [p], [value, ca.jacobian(value, p)])
    numbers = ca.vertcat(*(p[i] for i in of_device))
    (beside,), symbols, core = ca.extract_parametric([value], numbers, {"extract_trivial": True})
    s = ca.vertcat(ca.SX(0, 1), *symbols)
    derived = _core(ca.Function("core", [numbers], [ca.vertcat(ca.SX(0, 1), *core)]).serialize())
    others = ca.Function("beside", [p, s], [beside, ca.jacobian(beside, p), ca.jacobian(beside, s)])
    at = ca.MX.sym("p", p.numel())
    c, c_p = derived(at[list(of_device)])
    values, by_p, by_c = others(at, c)
    places = ca.Sparsity.triplet(len(of_device), p.numel(), list(range(len(of_device))), list(of_device))
    return ca.Function("constants", [at], [values, by_p + by_c @ c_p @ ca.DM(places, 1.0)])


@lru_cache(maxsize=SIMULATION.kept_cores)
def _core(serialised: str) -> ca.Function:
    """A function of the device's numbers, as text, with its Jacobian."""
    value = ca.Function.deserialize(serialised)
    p = ca.SX.sym("p", value.numel_in(0))
    return ca.Function("core", [p], [value(p), ca.jacobian(value(p), p)])


def _one_step(model: Model, sample_time: float, linear: bool, poses: bool, finer: int, roots: ImplicitRoots) -> Sample:
    newton_steps = SIMULATION.pose_newton_steps if poses else SIMULATION.newton_steps
    return one_step_map(model, sample_time, linear, newton_steps, poses, finer, roots)
