"""Device -> Model: one symbolic statement of the physics that everything else reads.

    u --(drive terms)--> drive --rates--> x --force(terms)--> balance with the stage --> z
      --(displacement terms)--> pose(terms) --> reading(terms)

x are the states (temperatures, the effects' memories, velocities), z the stage displacements, held by
the algebraic force balance 0 = g(x, z), u the drives. Where the stage has inertia, g accelerates it instead.
All SX, SI inside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, log2
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import show
from ctrlgen.devices import Device, Limit, Signal
from ctrlgen.model.assembly import Chain
from ctrlgen.numerics.phi_functions import driven, driven_lags, held_gain

LONGEST_STEP = 1024.0  # times the fastest of coupled states' rates
LONGEST_RAMP = 2.0**20  # the same where the displacement couples the lags: 20 doublings leave 1e-10 of rounding


@dataclass(frozen=True)
class Model:
    """The physics of one device, symbolic.

    `x` (n_x,), `z` (n_axes,), `u` (n_u,), `p` (n_free,): symbols. The first `n_states` of x are the actuators'
    (temperatures), then come the effects' memories, then the velocities `v` (n_axes,; none without inertia: z' = v).
    `rates_of_heat` dx/dt (n_x,) in terms of the `heat` that `heat_of_drive` (u) produces, and `balance` 0 = g(x, z, u)
    (n_axes,). `stepped` gives, for states that change once a sample, the new value by their place in x; `clocks` are
    the places of those that count time. `sticking`: axes with inertia where dry friction may hold; `bristles`: places
    in x of its states. `ambient` is the rise of the surroundings [K], zero unless it was asked for.
    `acceleration`: the symbol of v', for what `seen` gives.
    With a loop the drive is computed at every sample and `held`: its symbol, its `held_value`, and the rates in its terms.
    `seen` (place, channel, partner, states, stage) is what an effect's law would read there.
    `signals` by their role, in the order of the chain: drive, what the device adds (power), state where there
    is one, force, displacement, pose, reading. `rest` and the scales are SI numbers per component.
    """

    name: str
    device: Device
    x: ca.SX
    n_states: int
    z: ca.SX
    v: ca.SX
    u: ca.SX
    p: ca.SX
    p_nominal: np.ndarray
    ambient: ca.SX
    stepped: dict[int, ca.SX]
    clocks: tuple[int, ...]
    sticking: tuple[int, ...]
    bristles: tuple[int, ...]
    acceleration: ca.SX
    held: ca.SX
    held_value: ca.SX
    sampled_rates: ca.SX
    x_names: tuple[str, ...]
    x_units: tuple[str, ...]
    heat: ca.SX
    heat_of_drive: ca.SX
    rates_of_heat: ca.SX
    balance: ca.SX
    signals: dict[str, Signal]
    force_parts: dict[str, ca.SX]
    limits: tuple[Limit, ...]
    rest: np.ndarray
    x_scale: np.ndarray
    z_scale: np.ndarray
    u_scale: np.ndarray
    force_scale: float
    seen: Callable[..., SimpleNamespace]

    @cached_property
    def rates(self) -> ca.SX:
        """dx/dt (n_x,) as a function of x, z, u and p."""
        return ca.substitute(self.rates_of_heat, self.heat, self.heat_of_drive)

    @cached_property
    def settling(self) -> ca.SX:
        """What is zero (n_x,) at an equilibrium: the rates; of memories by samples and clocks, which never rest, themselves."""
        rows = self.rates[:]
        for i in (*self.stepped, *self.clocks):
            rows[i] = self.x[i]
        return rows

    @property
    def ambient_symbol(self) -> ca.SX:
        """`ambient` as an argument of a function: the symbol, or one that nothing depends on."""
        return self.ambient if self.ambient.is_symbolic() else ca.SX.sym("ambient")

    def closed(self, expr: ca.SX) -> ca.SX:
        """An effect's expression without the symbols of acceleration, heat and a held drive."""
        if self.inertial:
            expr = ca.substitute(ca.SX(expr), self.acceleration, self.rates_of_heat[-self.v.numel() :])
        return ca.substitute(ca.substitute(ca.SX(expr), self.heat, self.heat_of_drive), self.held, self.held_value)

    @cached_property
    def moved_by(self) -> frozenset[str]:
        """Names of all symbols in the equations of motion and the readings."""
        moving = ca.veccat(self.rates, self.balance, self.signals["reading"].expr, *self.stepped.values())
        return frozenset(symbol.name() for symbol in ca.symvar(moving))

    @property
    def inertial(self) -> bool:
        """Whether the displacement accelerates, rather than standing in balance."""
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
            [signal.expr for signal in self.signals.values()],
            ["x", "z", "u", "p"],
            list(self.signals),
        )

    @cached_property
    def evaluate_limits(self) -> ca.Function:
        """(x, z, u, p) -> every limited quantity in the order of `limits`."""
        return ca.Function(
            f"{self.name}_limits",
            [self.x, self.z, self.u, self.p],
            [limit.expr for limit in self.limits],
            ["x", "z", "u", "p"],
            [limit.name for limit in self.limits],
        )

    @cached_property
    def dynamics(self) -> ca.Function:
        """(x, z, u, p) -> (rates, balance)."""
        return ca.Function(
            f"{self.name}_dynamics", [self.x, self.z, self.u, self.p], [self.rates, self.balance],
            ["x", "z", "u", "p"], ["rates", "balance"],
        )  # fmt: skip

    def step(self, sample_time: float, rates: ca.SX | None = None) -> ca.SX:
        """x after one `sample_time` [s] with u and z held: x + h phi_1(h A) f, A = df/dx, phi_1(M) = M^-1 (e^M - 1).

        Exact for first-order lags. Where states act on one another phi_1 is summed to order 12, enough for
        |h A| <= 1, and doubled beyond. Raises InputError for a step a thousand times too long.
        """
        after = self._lag(sample_time, self.rates if rates is None else rates)
        for i, value in self.stepped.items():
            after[i] = value
        return after

    def ramp(self, sample_time: float, A: ca.SX, rates: Sequence[ca.SX]) -> ca.SX:
        """x after one `sample_time` h [s] in which the drive goes linearly from u to the next sample's, A = df/dx.

        `rates` f of the present x under the drive at the beginning, the middle and the end of the sample, or, where f is
        linear in the drive, at the beginning and the end: x + h (phi_1(hA) f_0 + phi_2(hA) f' + phi_3(hA) f''), f' and f''
        those of the parabola through them. Exact for rates linear in x and quadratic in u. Raises InputError as `step` does.
        """
        begin, end = rates[0], rates[-1]
        values = [begin, end - begin]
        if len(rates) == 3:
            values = [begin, 4 * rates[1] - 3 * begin - end, 4 * (begin - 2 * rates[1] + end)]
        if _alone(A):
            after = self.x + driven_lags(ca.diag(A), values, sample_time)
        else:
            after = self.x + driven(A, values, sample_time, self._doublings(A, sample_time, LONGEST_RAMP))
        for i, value in self.stepped.items():
            after[i] = value
        return after

    def _lag(self, sample_time: float, rates: ca.SX) -> ca.SX:
        A = ca.jacobian(rates, self.x)
        h = sample_time
        if _alone(A):
            rate = ca.diag(A)
            gain = ca.vertcat(*(held_gain(rate[i], h) for i in range(self.x.numel())))
            return self.x + gain * rates
        return self.x + driven(A, [rates], h, self._doublings(A, h))

    def _doublings(self, A: ca.SX, h: float, longest: float = LONGEST_STEP) -> int:
        """How often the sample time must be halved before |h A| is at most 1."""
        norm = float(
            ca.norm_inf(
                ca.Function("A", [self.x, self.z, self.u, self.p], [A])(self.rest, 0, 0, self.p_nominal)
                * (self.x_scale[None, :] / self.x_scale[:, None])
            )
        )
        if h * norm > longest:
            what = f"{h:g} s is too long for the fastest coupled state; use {longest / norm:.2g} s or less"
            raise InputError(self.name, [Fault("sample time", what)])
        return max(0, ceil(log2(h * norm))) if norm else 0

    @cached_property
    def x_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound of each state: the limits that are that state itself."""
        return self._bounds(self.x)

    @cached_property
    def z_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound of each displacement."""
        return self._bounds(self.z)

    @cached_property
    def u_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper bound of each drive."""
        return self._bounds(self.u)

    def _bounds(self, symbol: ca.SX) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.full(symbol.numel(), -np.inf), np.full(symbol.numel(), np.inf)
        for limit in self.limits:
            for _, i in _positions(limit, symbol):
                if limit.lower is not None:
                    low[i] = max(low[i], limit.lower)
                if limit.upper is not None:
                    high[i] = min(high[i], limit.upper)
        return low, high

    def composite_limits(self) -> list[Limit]:
        """Limits on expressions rather than on one variable."""
        return [
            limit for limit in self.limits
            if not any(_positions(limit, symbol) for symbol in (self.x, self.z, self.u))
        ]  # fmt: skip


def _alone(A: ca.SX) -> bool:
    """Whether no state acts on another."""
    return (A.sparsity() + ca.Sparsity.diag(A.size1())).is_diag()


def _positions(limit: Limit, symbol: ca.SX) -> list[tuple[int, int]]:
    """Pairs (k, i) where component k of the limit is component i of `symbol` itself."""
    place = {symbol[i].element_hash(): i for i in range(symbol.numel())}
    pairs = ((k, limit.expr[k].element_hash()) for k in range(limit.expr.numel()) if limit.expr[k].is_symbolic())
    return [(k, place[key]) for k, key in pairs if key in place]


def build_model(
    device: Device, free: Sequence[str] = (), ambient: ca.SX | None = None, sample_time: float | None = None
) -> Model:
    """The symbolic model of `device`; the parameters named in `free` stay symbols, the others are numbers.

    `free` are dotted paths as in `device.quantities()`; `ambient` is a symbol for the rise of the surroundings [K],
    where that is not zero; `sample_time` [s] is needed by effects that look back by samples. Raises InputError for a path or an effect's
    channel that the device does not have.
    """
    nominal = dict(device.quantities())
    unknown = [path for path in free if path not in nominal]
    if unknown:
        raise InputError(device.name, [Fault(path, "is not a parameter of this device") for path in unknown])
    counts = [path for path in free if nominal[path].whole]
    if counts:
        raise InputError(device.name, [Fault(path, "is a count and cannot be free") for path in counts])
    symbols = {path: ca.SX.sym(path) for path in free}
    p = device.values(symbols)
    links = device.links(p)
    chain = Chain(device, links, p, ca.SX(0) if ambient is None else ambient, sample_time)
    chosen = ca.vertcat(*symbols.values()) if symbols else ca.SX(0, 1)
    model = Model(**chain.parts(chosen, np.array([nominal[f].si for f in free])))
    idle = [path for path in free if path not in model.moved_by]
    if idle:
        what = "appears in no equation of motion (a limit, a material of the wires' stress): it cannot be free"
        raise InputError(device.name, [Fault(path, what) for path in idle])
    _check_stiffness(model)
    return model


def movable(device: Device) -> tuple[str, ...]:
    """Paths of the numbers that act on motion or readings, not only on limits."""
    paths = [path for path, number in device.quantities() if not number.whole]
    symbols = {path: ca.SX.sym(path) for path in paths}
    p = device.values(symbols)
    parts = Chain(device, device.links(p), p, ca.SX(0), 1.0).parts(
        ca.vertcat(*symbols.values()), np.array([dict(device.quantities())[k].si for k in paths])
    )
    model = Model(**parts)
    return tuple(path for path in paths if path in model.moved_by)


def _check_stiffness(model: Model) -> None:
    """Refuses a device whose restoring force does not rise over the whole stroke: its displacement would have no one value."""
    if model.inertial:
        return
    slope = ca.Function("slope", [model.x, model.z, model.u, model.p], [ca.diag(ca.jacobian(model.balance, model.z))])
    low, high = model.z_bounds
    if not (np.all(np.isfinite(low)) and np.all(np.isfinite(high))):
        return
    for share in np.linspace(0, 1, 65):
        z = low + share * (high - low)
        value = slope(model.rest, z, 0, model.p_nominal).full().ravel()
        bad = np.flatnonzero(~(value < 0))
        if bad.size:
            axis, where = model.axes[bad[0]], show(z[bad[0]], "um")
            what = f"the restoring force of {axis} does not rise at {where}; soften less, or lower the stroke"
            raise InputError(model.name, [Fault("stiffness", what)])
