"""A model with inertia without it: in balance at every moment, its actuators' states as before.

    0 = F(x, z, u) - restoring_force(z)   in place of   m z'' = F(x, z, u) - restoring_force(z) - damping_force(z')

What it needs of the drives is a feedforward without inertia, which leaves a stage to vibrate after a fast motion.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.model import Model

UNDAMPED = 1e-9  # damping ratio, below which it is rounding
OVERDAMPED = 0.999  # damping ratio, above which nothing vibrates


def quasi_static(model: Model) -> Model:
    """`model`, which has inertia, in balance. Raises InputError for a device with a feedback loop, with effects that have memories, or with
    dry friction, which have no static drive."""
    n_states = model.n_states
    inside = {
        "a feedback loop": bool(model.held.numel()),
        "effects with memories": model.x.numel() > n_states + model.v.numel(),
        "dry friction": bool(model.set_valued_axes),
    }
    if faults := [name for name, there in inside.items() if there]:
        what = f"is static, but the device has {' and '.join(faults)}, whose drive depends on the motion: leave it out"
        raise InputError(model.name, [Fault("feedforward", what)])

    def of(e: ca.SX) -> ca.SX:
        return ca.substitute(ca.SX(e), model.v, ca.SX.zeros(model.v.numel()))

    none = ca.SX(0, 1)
    return replace(
        model,
        x=model.x[:n_states, :],
        v=none,
        acceleration=none,
        mass=ca.SX(0, 0),
        rates_of_heat=of(model.rates_of_heat[:n_states, :]),
        sampled_rates=of(model.sampled_rates[:n_states, :]),
        balance=of(model.balance),
        signals={name: replace(s, expr=of(s.expr)) for name, s in model.signals.items()},
        limits=tuple(replace(limit, expr=of(limit.expr)) for limit in model.limits),
        x_names=model.x_names[:n_states],
        x_units=model.x_units[:n_states],
        rest=model.rest[:n_states],
        rest_formula=model.rest_formula[:n_states, :],
        x_scale=model.x_scale[:n_states],
    )


def natural_modes(model: Model, x: np.ndarray, z: np.ndarray, u: np.ndarray) -> list[tuple[float, float]]:
    """(undamped natural frequency [Hz], damping ratio) of each mode that vibrates, of a `model` with inertia linearised at the states
    x (n_x,), displacements z (n_axes,) and drives u (n_u,) [SI]; those damped least first, of equals the slowest."""
    y, F = ca.vertcat(model.x, model.z), ca.vertcat(model.rates, model.v)
    A = ca.Function("A", [model.x, model.z, model.u, model.p], [ca.jacobian(F, y)])(x, z, u, model.p_nominal).full()
    poles = np.linalg.eigvals(A)
    poles = poles[poles.imag > 0]
    modes = [(float(abs(s)) / (2 * np.pi), float(max(-s.real / abs(s), 0.0))) for s in poles]
    damped = [(f, ratio if ratio > UNDAMPED else 0.0) for f, ratio in modes if ratio < OVERDAMPED]
    return sorted(damped, key=lambda mode: (round(mode[1], 6), mode[0]))
