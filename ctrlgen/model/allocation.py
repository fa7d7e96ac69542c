"""More drives than axes: which of the many drives that give one force is taken, in closed form.

The drives with the least effort sum_i w_i (u_i / r_i)^2, r_i the range of drive i and w_i its weight, that push with the forces f,
where the law is linear in them, B u = f, are

    u = W^-1 B^T (B W^-1 B^T)^-1 f,      W = diag(w_i / r_i^2),

the weighted pseudo-inverse. With it the device has one drive f for each axis and is inverted as any other. Limits are not looked at here:
`ctrlgen.trajectory.inverse.redundant` keeps them. Source: T. A. Johansen, T. I. Fossen, Automatica 49 (2013) 1087 (control allocation).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices.limit import ranges
from ctrlgen.model.inverse import NEWTON_STEPS, Inverse, invert
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import newton_root

INDEPENDENT = 1e-9  # smallest over largest singular value of B in typical sizes, below which drives push only together


def drive_ranges(model: Model) -> np.ndarray:
    """(n_u,) r_i [SI]; the range of a drive without limits counts as twice its typical size."""
    return ranges(model.u_bounds, 2 * model.u_scale)


def effort_weights(model: Model) -> np.ndarray:
    """(n_u,) w_i / r_i^2 [SI]."""
    return model.drive_weights / drive_ranges(model) ** 2


@dataclass(frozen=True)
class Allocation:
    """`ganged`: the model with one drive for each axis, the force f on it; `drive` (z, f) -> u (n_u,)."""

    ganged: Model
    drive: ca.Function


def why_not_ganged(model: Model) -> str | None:
    """Why the least effort has no closed form; None where it has one."""
    if model.n_states:
        return "has actuators with states of their own"
    slope = ca.jacobian(model.balance, model.u)
    if ca.depends_on(slope, ca.vertcat(model.u, model.x)):
        return "has forces that are not linear in the drives"
    if model.inertial and ca.depends_on(slope, model.z):
        return "has inertia and forces whose slope by the drives changes with the displacement, while drives are held"
    memories = ca.vertcat(model.rates[: model.x.numel() - model.v.numel(), :], *model.stepped.values())
    if ca.depends_on(memories, model.u):
        return "has effects that remember the drives"
    return None


def allocate(model: Model) -> Allocation:
    """The closed form of the least effort. Raises InputError where there is none, and where the drives do not push the axes
    independently."""
    if (why := why_not_ganged(model)) is not None:
        what = f"has more drives than axes and {why}: the drives of least effort have no closed form"
        raise InputError(model.name, [Fault("drive", f"{what}; use the player of a solved path")])
    B = ca.substitute(ca.jacobian(model.balance, model.u), model.p, ca.DM(model.p_nominal))
    at_home = ca.Function("B", [model.z], [B])(0 * model.z_scale).full() * model.u_scale / model.force_scale
    sizes = np.linalg.svd(at_home, compute_uv=False)
    if not sizes.min() > INDEPENDENT * sizes.max():
        what = "do not push the axes independently of one another at home, however many there are; add one that pushes otherwise"
        raise InputError(model.name, [Fault("drive", what)])
    f = ca.SX.sym("f", len(model.axes))
    weighted = ca.mtimes(ca.diag(1 / effort_weights(model)), B.T)
    u = ca.mtimes(weighted, ca.solve(ca.mtimes(B, weighted), f))

    def of(e: ca.SX) -> ca.SX:
        return ca.substitute(ca.SX(e), model.u, u)

    ganged = replace(
        model,
        u=f,
        u_scale=np.full(f.numel(), model.force_scale),
        drive_weights=np.ones(f.numel()),
        rate_limits=(),
        limits=tuple(replace(limit, expr=of(limit.expr)) for limit in model.limits),
        signals={name: replace(s, expr=of(s.expr)) for name, s in model.signals.items()},
        heat_of_drive=of(model.heat_of_drive),
        rates_of_heat=of(model.rates_of_heat),
        sampled_rates=of(model.sampled_rates),
        balance=of(model.balance),
        stepped={i: of(e) for i, e in model.stepped.items()},
        resting={i: of(e) for i, e in model.resting.items()},
    )
    return Allocation(ganged, ca.Function("least_effort", [model.z, f], [u], ["z", "f"], ["u"], {"cse": True}))


def ganged_as(model: Model, other: Model) -> Model:
    """`model`, or its ganged one where the `other` of the same device, but for its effects, is one."""
    return allocate(model).ganged if model.u.numel() > other.u.numel() else model


def inverse_of(model: Model, follow: str, sample_time: float | None) -> Inverse:
    """`invert`; of a model with more drives than axes with the drives of least effort. Raises InputError as `allocate`."""
    if not model.redundant:
        return invert(model, follow, sample_time)
    allocation = allocate(model)
    if model.x.numel() > model.v.numel():
        what = "has more drives than axes and effects with memories: there is no controller for it; use the player of a solved path"
        raise InputError(model.name, [Fault("drive", what)])
    inverse = invert(allocation.ganged, follow, sample_time)
    x, z, wanted, u = (
        ca.SX.sym(n, k)
        for n, k in (("x", model.x.numel()), ("z", model.z.numel()), ("w", model.z.numel()), ("u", model.u.numel()))
    )
    state = ca.SX(0, 1)
    drive = allocation.drive(wanted, inverse.drive(x, z, wanted, state))
    balance = ca.substitute(
        model.balance, ca.vertcat(model.x, model.u, model.p), ca.vertcat(x, u, ca.DM(model.p_nominal))
    )
    settled, one_step = (newton_root(ca.substitute(balance, model.z, z), z, z, steps) for steps in (NEWTON_STEPS, 1))
    still = inverse.advance(x, z, ca.SX.zeros(len(model.axes), 1))  # nothing remembers the drive
    return replace(
        inverse,
        drive=ca.Function(
            "drive", [x, z, wanted, state], [drive], ["x", "z", "wanted", "state"], ["result"], {"cse": True}
        ),
        advance=ca.Function("advance", [x, z, u], [still], ["x", "z", "drive"], ["result"], {"cse": True}),
        settle=ca.Function("settle", [x, z, u], [settled], ["x", "z", "drive"], ["result"], {"cse": True}),
        newton=ca.Function("newton", [x, z, u], [one_step], ["x", "z", "drive"], ["result"], {"cse": True}),
    )
