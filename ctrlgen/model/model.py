"""The symbolic statement of a device's physics that simulation, inversion, optimisation, generated C and diagnosis read.

x are the states (temperatures, the effects' memories, velocities), z the stage displacements, u the drives, p the free
parameters. A stage in balance: x' = f(x, z, u, p), 0 = g(x, z, u, p). A stage with inertia: its velocities are states,
z' = v. All SX, SI inside. `ctrlgen.model.assembly` builds it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np

from ctrlgen.core.shown import Shown
from ctrlgen.devices import Device, Limit, Signal
from ctrlgen.effects import LawInputs
from ctrlgen.numerics.batched_evaluation import evaluate


@dataclass(frozen=True, eq=False)
class Law:
    """A part of the physics that every axis has: its C `name`, what it is, its value (n,), what states its equation and source."""

    name: str
    label: str
    expr: ca.SX
    documented: Sequence[Callable[..., Any]] = ()


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Model(Shown):
    """The physics of one device, symbolic; made by `build_model`."""

    name: str
    device: Device

    # Symbols
    x: ca.SX  # (n_x,) states: first `n_states` of the actuators, then those of the effects, then the velocities
    n_states: int
    z: ca.SX  # (n_axes,) stage displacements [m] or [rad]
    v: ca.SX  # (n_axes,) their velocities, the last of x; none without inertia
    u: ca.SX  # (n_u,) drives, or the references of a feedback loop
    p: ca.SX  # (n_free,) free parameters
    p_nominal: np.ndarray  # (n_free,) their nominal values
    ambient: ca.SX  # rise of the surroundings [K]: a symbol, or zero where none was asked for
    acceleration: ca.SX  # (n_axes,) stands for v' in what `law_inputs` gives; none without inertia

    # A feedback loop is evaluated at every sample and its output held until the next; without one the three are empty,
    # empty and the rates themselves
    held: ca.SX  # symbol of the output
    held_value: ca.SX  # its value at the beginning of a sample
    sampled_rates: ca.SX  # dx/dt in terms of `held`

    # Equations; `heat` stands for what the drive produces in the actuators, so that the inverse can solve for it first
    heat: ca.SX
    heat_of_drive: ca.SX
    rates_of_heat: ca.SX  # dx/dt (n_x,) in terms of `heat`
    balance: ca.SX  # (n_axes,) 0 = g(x, z, u) of a stage in balance, or the net force on each mass
    mass: ca.SX  # (n_axes, n_axes) M in M v' = balance; empty without inertia

    # Places in x of states that are not integrated, and of those that need an implicit integrator
    stepped: dict[int, ca.SX]  # change once a sample: place -> new value
    resting: dict[int, ca.SX]  # of these, where they come to rest only after many samples: place -> value at rest
    clocks: tuple[int, ...]  # count time
    not_inverted: tuple[str, ...]  # kinds of its effects that no controller can undo (`Effect.inverted`)
    set_valued_axes: tuple[int, ...]  # axes with inertia on which dry friction may hold the stage at rest
    bristles: tuple[int, ...]  # the states of that friction
    free_memories: tuple[int, ...]  # states of effects that begin differently in each record
    arbitrary_memories: tuple[int, ...]  # of these, where those of one record tell nothing of another

    # What is read from the equations
    # Drive, power, state where there are some, force, displacement, pose, reading; in this order
    signals: dict[str, Signal]
    force_parts: dict[str, ca.SX]  # parts of the restoring force by name
    limits: tuple[Limit, ...]
    bounds_formulas: tuple[tuple[float | ca.SX | None, float | ca.SX | None], ...]  # of each limit, in terms of p
    laws: tuple[Law, ...]  # parts of the equations that have a name
    rate_limits: tuple[Limit, ...]  # on the change by time of a drive, which is their `expr`
    # (n_u,) how much each drive counts where there are more than axes; none of an imposed motion
    drive_weights: np.ndarray
    # (place, channel, partner, states, order) -> what an effect's law reads there
    law_inputs: Callable[..., LawInputs]

    # Names and typical sizes, SI, per component
    x_names: tuple[str, ...]
    x_units: tuple[str, ...]
    rest: np.ndarray  # x of the device at rest
    rest_formula: ca.SX  # the same in terms of p
    x_scale: np.ndarray
    z_scale: np.ndarray
    u_scale: np.ndarray
    force_scale: float

    probability: float | None = None  # with which the limits, tightened by their reserves, hold; None: as described

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "of": self.device.title,
            "drives": ", ".join(self.signals["drive"].channels),
            "states": self.x.numel(),
            "signals": ", ".join(self.signals),
            "limits": len(self.limits) + len(self.rate_limits),
        }

    @cached_property
    def rates(self) -> ca.SX:
        """dx/dt (n_x,) as a function of x, z, u and p."""
        return ca.substitute(self.rates_of_heat, self.heat, self.heat_of_drive)

    @cached_property
    def settling(self) -> ca.SX:
        """(n_x,) zero at an equilibrium: the rates; for velocities, whose rates are the balance, and for states that change once a
        sample and clocks, which have no equilibrium, the states themselves, or how far they are from rest."""
        rows, first = self.rates[:], self.x.numel() - self.v.numel()
        for i in (*self.stepped, *self.clocks, *range(first, self.x.numel())):
            rows[i] = self.x[i] - self.resting.get(i, 0)
        return rows

    @cached_property
    def starting(self) -> ca.SX:
        """(n_x,) zero where an open path starts: settled, states that change once a sample one sample after zero, clocks at zero."""
        rows, stepped = self.settling[:], list(self.stepped)
        for i in self.stepped.keys() - self.resting.keys():
            rows[i] = self.x[i] - ca.substitute(self.stepped[i], self.x[stepped], ca.SX.zeros(len(stepped)))
        return rows

    @property
    def ambient_symbol(self) -> ca.SX:
        """`ambient` as an argument of a function: its symbol, or where it is zero a symbol that nothing depends on."""
        return self.ambient if self.ambient.is_symbolic() else ca.SX.sym("ambient")

    def closed(self, expr: ca.SX) -> ca.SX:
        """`expr` with the symbols of acceleration, heat and a held drive replaced by their values."""
        if self.inertial:
            expr = ca.substitute(ca.SX(expr), self.acceleration, self.rates_of_heat[-self.v.numel() :])
        return ca.substitute(ca.substitute(ca.SX(expr), self.heat, self.heat_of_drive), self.held, self.held_value)

    @cached_property
    def moved_by(self) -> frozenset[str]:
        """Names of all symbols in the equations of motion and the readings."""
        equations = ca.veccat(self.rates, self.balance, self.signals["reading"].expr, *self.stepped.values())
        return frozenset(symbol.name() for symbol in ca.symvar(equations))

    @property
    def inertial(self) -> bool:
        """Whether the stage has mass: it accelerates, instead of standing where its forces balance."""
        return self.v.numel() > 0

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the actuated axes."""
        return self.signals["displacement"].channels

    @cached_property
    def evaluate(self) -> ca.Function:
        """(x, z, u, p) -> every signal in the order of `signals`."""
        return ca.Function(
            f"{self.name}_signals",
            [self.x, self.z, self.u, self.p],
            [ca.densify(signal.expr) for signal in self.signals.values()],
            ["x", "z", "u", "p"],
            list(self.signals),
        )

    @cached_property
    def evaluate_limits(self) -> ca.Function:
        """(x, z, u, p) -> every limited quantity in the order of `limits`."""
        return ca.Function(
            f"{self.name}_limits",
            [self.x, self.z, self.u, self.p],
            [ca.densify(limit.expr) for limit in self.limits],
            ["x", "z", "u", "p"],
            [limit.name for limit in self.limits],
        )

    @cached_property
    def dynamics(self) -> ca.Function:
        """(x, z, u, p) -> (rates, balance)."""
        return ca.Function(
            f"{self.name}_dynamics",
            [self.x, self.z, self.u, self.p],
            [self.rates, self.balance],
            ["x", "z", "u", "p"],
            ["rates", "balance"],
        )

    @cached_property
    def x_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (n_x,) of the states, from the limits on a state itself; infinite where there is none."""
        return self._bounds(self.x)

    @cached_property
    def z_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (n_axes,) of the displacements."""
        return self._bounds(self.z)

    @cached_property
    def u_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (n_u,) of the drives."""
        return self._bounds(self.u)

    def _bounds(self, symbol: ca.SX) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.full(symbol.numel(), -np.inf), np.full(symbol.numel(), np.inf)
        for limit in self.limits:
            for _, i in _positions(limit, symbol):
                low[i], high[i] = max(low[i], limit.bounds[0]), min(high[i], limit.bounds[1])
        return low, high

    def bounds_formula(self, symbol: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Lower and upper bounds (n,) of x, z or u as formulas of p."""
        low, high = ([ca.SX(side)] * symbol.numel() for side in (-np.inf, np.inf))
        for limit, (lower, upper) in zip(self.limits, self.bounds_formulas, strict=True):
            for _, i in _positions(limit, symbol):
                if lower is not None:
                    low[i] = ca.SX(lower) if low[i].is_minus_inf() else ca.fmax(low[i], lower)
                if upper is not None:
                    high[i] = ca.SX(upper) if high[i].is_inf() else ca.fmin(high[i], upper)
        return ca.vertcat(ca.SX(0, 1), *low), ca.vertcat(ca.SX(0, 1), *high)

    def limited_variable(self, limit: Limit, channel: int) -> Literal["x", "z", "u", "rate"] | None:
        """Whether a limit is on one of the states, displacements or drives itself, or on the rate of a drive; None where it is on an
        expression of them."""
        if any(limit is limited for limited in self.rate_limits):
            return "rate"
        variables: tuple[tuple[Literal["x", "z", "u"], ca.SX], ...] = (("x", self.x), ("z", self.z), ("u", self.u))
        return next((name for name, s in variables if channel in dict(_positions(limit, s))), None)

    def limited_values(self, x: np.ndarray, z: np.ndarray, u: np.ndarray) -> list[np.ndarray]:
        """(n, channels) [SI] of each of the `limits` under the states x (n, n_x), displacements z (n, n_axes) and drives u (n, n_u)."""
        p = np.tile(self.p_nominal, (len(x), 1))
        return [np.asfortranarray(v) for v in evaluate(self.evaluate_limits.map(len(x)), x, z, u, p)]

    def limited_rates(self, u: np.ndarray, before: np.ndarray, sample_time: float) -> list[np.ndarray]:
        """(n,) [SI] of each of the `rate_limits`: the change by time of its drive to `u` (n, n_u) from the one `before` (n, n_u)."""
        change = (u - before) / sample_time
        return [change[:, i] for i in self.rate_places]

    @cached_property
    def rate_places(self) -> tuple[int, ...]:
        """The drive of each of the `rate_limits`, by its place in u."""
        return tuple(_positions(limit, self.u)[0][1] for limit in self.rate_limits)

    @cached_property
    def rate_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bounds (n_u,) of the drives' rates; infinite where there is none."""
        low, high = np.full(self.u.numel(), -np.inf), np.full(self.u.numel(), np.inf)
        for i, limit in zip(self.rate_places, self.rate_limits, strict=True):
            low[i], high[i] = limit.bounds
        return low, high

    def tightened(self, reserves: Mapping[str, tuple[float, float]], probability: float | None) -> Model:
        """The model with the bounds of the named limits moved inward by (below, above) [SI], which then hold with the `probability`:
        whatever reads its limits keeps the tightened ones."""
        reserved = [reserves.get(limit.name, (0.0, 0.0)) for limit in self.limits]
        limits = tuple(limit.tightened(*reserve) for limit, reserve in zip(self.limits, reserved, strict=True))
        formulas = tuple(
            (None if lower is None else lower + below, None if upper is None else upper - above)
            for (lower, upper), (below, above) in zip(self.bounds_formulas, reserved, strict=True)
        )
        return replace(self, limits=limits, bounds_formulas=formulas, probability=probability)

    def limited_as(self, other: Model) -> Model:
        """The model with the reserves of the `other` of the same device, but for its effects."""
        if other.probability is None:
            return self
        return self.tightened({limit.name: limit.reserve for limit in other.limits}, other.probability)

    @property
    def redundant(self) -> bool:
        """Whether there are more drives than axes, so that many drives hold one pose."""
        return len(self.drive_weights) > len(self.axes)

    def composite_limits(self) -> list[Limit]:
        """Limits on an expression, such as a stress, and not on a state, displacement or drive itself."""
        return [
            limit for limit in self.limits if not any(_positions(limit, symbol) for symbol in (self.x, self.z, self.u))
        ]


def _positions(limit: Limit, symbol: ca.SX) -> list[tuple[int, int]]:
    """Pairs (k, i) where component k of the limit is component i of `symbol` itself."""
    index_of = {symbol[i].element_hash(): i for i in range(symbol.numel())}
    pairs = ((k, limit.expr[k].element_hash()) for k in range(limit.expr.numel()) if limit.expr[k].is_symbolic())
    return [(k, index_of[key]) for k, key in pairs if key in index_of]
