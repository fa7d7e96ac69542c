"""Device -> Model: one symbolic statement of the physics that everything else reads.

    u --(drive terms)--> drive --rates--> x --force(terms)--> balance with the stage --> z
      --(displacement terms)--> pose(terms) --> reading(terms)

x are the states (temperatures, then the effects' memories), z the stage displacements, held by
the algebraic force balance 0 = g(x, z), u the drives. All SX, SI inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.devices import Device, Limit, Links, Signal
from ctrlgen.devices.sensor import mounting_faults
from ctrlgen.effect import Effect, Place
from ctrlgen.errors import Fault, InputError
from ctrlgen.units import base_unit, same_dimension, show


@dataclass(frozen=True)
class Model:
    """The physics of one device, symbolic.

    `x` (n_x,), `z` (n_axes,), `u` (n_axes,), `p` (n_free,): symbols. The first `n_states` of x are the actuators'
    (temperatures), the others effects' memories. `rates_of_heat` dx/dt (n_x,) in terms of the `heat` that
    `heat_of_drive` (u) produces, and `balance` 0 = g(x, z, u) (n_axes,).
    `signals` by their role, in the order of the chain: drive, what the device adds (power), state where there
    is one, force, displacement, pose, reading. `rest` and the scales are SI numbers per component.
    """

    name: str
    device: Device
    x: ca.SX
    n_states: int
    z: ca.SX
    u: ca.SX
    p: ca.SX
    p_nominal: np.ndarray
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

    @cached_property
    def rates(self) -> ca.SX:
        """dx/dt (n_x,) as a function of x, z, u and p."""
        return ca.substitute(self.rates_of_heat, self.heat, self.heat_of_drive)

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

        Exact for first-order lags. Where states act on one another phi_1 is summed to order 12,
        enough for |h A| <= 1. Raises InputError beyond that, asking for a shorter sample time.
        """
        rates = self.rates if rates is None else rates
        A = ca.jacobian(rates, self.x)
        h = sample_time
        if A.sparsity().is_diag():
            rate = ca.diag(A)
            gain = ca.vertcat(*(_phi_1(rate[i], h) for i in range(self.x.numel())))
            return self.x + gain * rates
        norm = float(
            ca.norm_inf(ca.Function("A", [self.x, self.z, self.u, self.p], [A])(self.rest, 0, 0, self.p_nominal))
        )
        if h * norm > 1:
            raise InputError(
                self.name,
                [
                    Fault(
                        "sample time",
                        f"{h:g} s is too long for the fastest coupled state; use {1 / norm:.2g} s or less",
                    )
                ],
            )
        term = total = h * rates
        for order in range(2, 13):
            term = h / order * ca.mtimes(A, term)
            total += term
        return self.x + total

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


def _phi_1(rate: ca.SX, h: float) -> ca.SX:
    """(e^(rate h) - 1)/rate, or h where the rate is identically zero."""
    return h if rate.is_zero() else (ca.exp(rate * h) - 1) / rate


def _positions(limit: Limit, symbol: ca.SX) -> list[tuple[int, int]]:
    """Pairs (k, i) where component k of the limit is component i of `symbol` itself."""
    place = {symbol[i].element_hash(): i for i in range(symbol.numel())}
    pairs = ((k, limit.expr[k].element_hash()) for k in range(limit.expr.numel()) if limit.expr[k].is_symbolic())
    return [(k, place[key]) for k, key in pairs if key in place]


def build_model(device: Device, free: Sequence[str] = ()) -> Model:
    """The symbolic model of `device`; the parameters named in `free` stay symbols, the others are numbers.

    `free` are dotted paths as in `device.quantities()`. Raises InputError for a path or an effect's
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
    chain = _Chain(device, links, p)
    model = chain.model(
        ca.vertcat(*symbols.values()) if symbols else ca.SX(0, 1), np.array([nominal[f].si for f in free])
    )
    read = {symbol.name() for symbol in ca.symvar(ca.veccat(model.rates, model.balance, model.signals["reading"].expr))}
    idle = [path for path in free if path not in read]
    if idle:
        what = "appears in no equation of motion (a limit, a material of the wires' stress): it cannot be free"
        raise InputError(device.name, [Fault(path, what) for path in idle])
    _check_stiffness(model)
    return model


def _check_stiffness(model: Model) -> None:
    """Refuses a device whose restoring force does not rise over the whole stroke: its displacement would have no one value."""
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


def _numbers(values: Sequence[float | ca.SX], p: ca.SX, p_nominal: np.ndarray) -> np.ndarray:
    """Values that may hold free parameters, at their nominal ones."""
    return ca.Function("rest", [p], [ca.vertcat(*map(ca.SX, values), ca.SX(0, 1))])(p_nominal).full().ravel()


class _Chain:
    """Joins a device's links and its effects' terms, place by place."""

    def __init__(self, device: Device, links: Links, p: SimpleNamespace) -> None:
        self.device, self.links = device, links
        self.z = ca.SX.sym("d", len(links.axes))
        self.effects = [(effect, p.effect[k], k) for k, effect in enumerate(device.effect)]
        self.members: list[tuple[Effect, SimpleNamespace, int, dict[str, ca.SX]]] = []
        names, scales, units_ = [], [], []
        faults = mounting_faults(device.sensor, links.components, links.pose_units)
        for effect, values, k in self.effects:
            channels, units = self._channels(effect.place)
            chosen = (
                range(len(channels)) if effect.at == "all" else [i for i, c in enumerate(channels) if c == effect.at]
            )
            if effect.place is Place.HEAT and links.heat_signal is None:
                faults.append(Fault(f"effect[{k}].kind", f"{effect.kind} acts on heat, and this device has none"))
            if not chosen:
                faults.append(Fault(f"effect[{k}].at", f"{effect.at!r} is not one of {', '.join(channels)}, all"))
            for i in chosen:
                if effect.channel_unit and not same_dimension(effect.channel_unit, units[i]):
                    faults.append(
                        Fault(
                            f"effect[{k}].at",
                            f"{effect.kind} acts in {effect.channel_unit}, but {channels[i]} is in {units[i]}",
                        )
                    )
                states = {
                    state.name: ca.SX.sym(f"{effect.kind}_{k}_{state.name}_{channels[i]}") for state in effect.states
                }
                self.members.append((effect, values, i, states))
                names += [symbol.name() for symbol in states.values()]
                scales += [state.scale for state in effect.states]
                units_ += [state.unit for state in effect.states]
        if faults:
            raise InputError(device.name, faults)
        self.memory = ca.vertcat(*(symbol for *_, states in self.members for symbol in states.values()))
        self.memory_names, self.memory_scales, self.memory_units = tuple(names), scales, tuple(units_)
        self.memory_rates: dict[int, ca.SX] = {}

    def _channels(self, place: Place) -> tuple[tuple[str, ...], tuple[str, ...]]:
        if place in (Place.POSE, Place.SENSOR):
            return self.links.components, self.links.pose_units
        links = self.links
        unit = {
            Place.DRIVE: links.drive.units[0], Place.HEAT: links.heat_signal[1] if links.heat_signal else "1",
            Place.FORCE: links.force_unit, Place.DISPLACEMENT: "um",
        }[place]  # fmt: skip
        return self.links.axes, (unit,) * len(self.links.axes)

    def _with_terms(self, place: Place, before: ca.SX) -> ca.SX:
        """`before` plus every term of the effects at `place`; their rates are noted on the way."""
        total = ca.SX(before)
        for index, (effect, values, i, states) in enumerate(self.members):
            if effect.place is not place:
                continue
            s = SimpleNamespace(value=before[i], all=before, index=i, **states)
            if place not in (Place.POSE, Place.SENSOR):
                s.displacement = self.z[i]
                s.state = None if self.links.state is None else self.links.state.expr[i]
            total[i] += effect.term(s, values)
            rates = effect.rates(s, values)
            self.memory_rates[index] = ca.vertcat(*(rates[name] for name in states))
        return total

    def model(self, p: ca.SX, p_nominal: np.ndarray) -> Model:
        links, axes, n = self.links, self.links.axes, len(self.links.axes)
        u, z = links.drive.expr, self.z
        x = ca.SX(0, 1) if links.state is None else links.state.expr
        drive = self._with_terms(Place.DRIVE, u)
        produced = links.heat(drive)
        heat = ca.SX.sym("heat", n)  # an unknown of its own, so that the inverse need not take squares apart
        arriving = self._with_terms(Place.HEAT, heat)
        pushed = links.force(drive, x, z)
        balance = self._with_terms(Place.FORCE, pushed) - links.resistance(z)
        displacement = self._with_terms(Place.DISPLACEMENT, z)
        pose = self._with_terms(Place.POSE, links.pose(displacement))
        reading = self._with_terms(Place.SENSOR, pose)
        memory_rates = ca.vertcat(*(self.memory_rates[i] for i in sorted(self.memory_rates)))
        units, sizes = (links.force_unit,) * n, (links.force_scale,) * n
        posed = (links.components, links.pose_units)
        travel = (links.displacement_scale,) * n
        signals = {
            "drive": links.drive,
            **({} if links.state is None else {"state": links.state}),
            "force": Signal("force", "actuator force", axes, units, "F_", pushed, sizes),
            "displacement": Signal("displacement", "stage displacement", axes, ("um",) * n, "d_", displacement, travel),
            "pose": Signal("pose", "platform pose", *posed, "", pose, links.pose_scale),
            "reading": Signal("reading", "sensor reading", *posed, "reading_", reading, links.pose_scale),
        }
        if links.heat_signal is not None:
            label, unit, column, size = links.heat_signal
            power = Signal(
                "power", label, axes, (unit,) * n, column, ca.substitute(arriving, heat, produced), (size,) * n
            )
            signals = {"drive": signals.pop("drive"), "power": power, **signals}
        state_names = () if links.state is None else tuple(f"{links.state.name}_{axis}" for axis in axes)
        state_scale = () if links.state is None else links.state.scale
        return Model(
            name=self.device.name,
            device=self.device,
            x=ca.vertcat(x, self.memory),
            n_states=x.numel(),
            z=z,
            u=u,
            p=p,
            p_nominal=p_nominal,
            x_names=state_names + self.memory_names,
            x_units=tuple(base_unit(u) for u in (*(links.state.units if links.state else ()), *self.memory_units)),
            heat=heat,
            heat_of_drive=produced,
            rates_of_heat=ca.vertcat(links.rates(x, arriving), memory_rates),
            balance=balance,
            signals=signals,
            force_parts=links.resistance_parts(z),
            limits=tuple(
                links.limits(SimpleNamespace(drive=u, state=x, force=pushed, displacement=z, carried=displacement))
            ),
            rest=np.concatenate([_numbers(links.rest, p, p_nominal), np.zeros(len(self.memory_scales))]),
            x_scale=np.array([*state_scale, *self.memory_scales]),
            z_scale=np.full(n, links.displacement_scale),
            u_scale=np.array(links.drive.scale),
            force_scale=links.force_scale,
        )
