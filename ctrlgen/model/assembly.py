"""Device -> Model: a device's physics and its effects' terms, joined place by place into one symbolic statement.

u --(drive terms)--> drive --rates--> x --force(terms)--> balance with the stage --> z
  --(displacement terms)--> pose(terms) --> reading(terms)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import base_unit, show
from ctrlgen.devices import BalancedPhysics, Device, DevicePhysics, ImposedPhysics, InertialPhysics, Limit, Signal
from ctrlgen.devices.sensor import mounting_faults
from ctrlgen.effects import Place
from ctrlgen.model.effect_terms import EffectTerms
from ctrlgen.model.model import Law, Model

TYPICAL_RATE = 100.0  # 1/s: a typical velocity is a typical displacement times this
STROKE_POINTS = 65  # points of the stroke, ends included, at which the tangent stiffness is checked
NONE = ca.SX(0, 1)  # a vector without components
NO_RISE = ca.SX(0)  # the surroundings as they are described


def build_model(
    device: Device,
    free: Sequence[str] = (),
    ambient: ca.SX | None = None,
    sample_time: float | None = None,
    per_record: bool = False,
) -> Model:
    """The symbolic model of `device`; the parameters named in `free` stay symbols, the others are numbers.

    `free` are dotted paths as in `device.quantities()`; `ambient` is a symbol for the rise of the surroundings [K],
    where that is not zero; `sample_time` [s] is needed by effects that look back by samples. With `per_record` the
    constants of a record (where a play begins, a zero that is set anew) are states; without, they are zero. Raises InputError for a
    path that is no parameter or acts on nothing, an effect that does not fit the device, and a restoring force that
    does not rise over the stroke.
    """
    nominal = dict(device.quantities())
    unknown = [path for path in free if path not in nominal]
    if unknown:
        raise InputError(device.name, [Fault(path, "is not a parameter of this device") for path in unknown])
    counts = [path for path in free if nominal[path].whole]
    if counts:
        raise InputError(device.name, [Fault(path, "is a count and cannot be free") for path in counts])
    model = _assemble(device, free, NO_RISE if ambient is None else ambient, sample_time, per_record)
    outside = {f"effect[{k}].{e.amplitude().name}" for k, e in enumerate(device.effect) if e.shifts_drive}
    idle = [path for path in free if path not in model.moved_by and path not in outside]
    if idle:
        what = "appears in no equation of motion (a limit, a material of the wires' stress): it cannot be free"
        raise InputError(device.name, [Fault(path, what) for path in idle])
    _check_stiffness(model)
    return model


def movable(device: Device) -> tuple[str, ...]:
    """Paths of the parameters that act on motion or readings, not only on limits."""
    paths = [path for path, number in device.quantities() if not number.whole]
    model = _assemble(device, paths, NO_RISE, sample_time=1.0, per_record=True)
    return tuple(path for path in paths if path in model.moved_by)


def symbolic_model(device: Device, only: Sequence[str] | None = None) -> Model:
    """The model of `device` with its numbers as formulas: those `only`, or every number that is no count and not zero, or given when
    the C starts."""
    if only is not None:
        return _assemble(device, only, NO_RISE, sample_time=None, per_record=False)
    given = {constant.path for constant in device.given_at_start}
    paths = [path for path, number in device.quantities() if not number.whole and (number.si != 0 or path in given)]
    return _assemble(device, paths, NO_RISE, sample_time=None, per_record=False)


@dataclass(frozen=True)
class Assembly:
    """The equations of a device with its effects.

    `rates` of the device's own states and `balance`, zero or mass times acceleration, in terms of the symbol `heat`,
    whose value is `heat_of_drive`, and of `held`, the output of a feedback loop, whose value is `held_value`.
    `own_force` is the device's force on the axes, damping included, without its effects.
    """

    signals: dict[str, Signal]
    rates: ca.SX
    balance: ca.SX
    heat: ca.SX
    heat_of_drive: ca.SX
    held: ca.SX = NONE
    held_value: ca.SX = NONE
    own_force: ca.SX = NONE


def _assemble(
    device: Device, free: Sequence[str], ambient: ca.SX, sample_time: float | None, per_record: bool
) -> Model:
    """The model of `device` with the parameters `free` as symbols: the one place where a Model is made."""
    nominal = dict(device.quantities())
    own_symbols, physics = _physics(
        device.model_copy(update={"effect": ()}), tuple(path for path in free if not path.startswith("effect["))
    )
    symbols = {path: own_symbols[path] if path in own_symbols else ca.SX.sym(path) for path in free}
    values = device.values(symbols)
    p, p_nominal = ca.vertcat(NONE, *symbols.values()), np.array([nominal[path].si for path in free])
    n = len(physics.axes)
    inertial = isinstance(physics, InertialPhysics)
    z, v, a = ca.SX.sym("d", n), ca.SX.sym("v", n if inertial else 0), ca.SX.sym("a", n if inertial else 0)
    velocity = physics.drive.expr[n : 2 * n] if isinstance(physics, ImposedPhysics) else v
    terms = EffectTerms(device, physics, values, z, velocity, a, ambient, sample_time, per_record)
    faults = mounting_faults(device.sensor, *physics.readings[:2]) + terms.faults
    if faults:
        raise InputError(device.name, faults)
    join: dict[type, Callable[..., Any]] = {
        BalancedPhysics: _balanced,
        InertialPhysics: partial(_inertial, v=v),
        ImposedPhysics: _imposed,
    }
    parts = join[type(physics)](physics, terms, z)

    state, memories = physics.state, terms.memories()
    own_x = NONE if state is None else state.expr
    first = own_x.numel()  # place in x of the effects' states
    mass, acceleration = ca.SX(0, 0), NONE
    if isinstance(physics, InertialPhysics):
        mass, acceleration = _mass(physics.mass), _acceleration(physics.mass, parts.balance)
    memory_rates = ca.vertcat(NONE, *(m.rates[s.name] for m, s, _ in memories))
    rates = ca.vertcat(parts.rates, memory_rates, acceleration)

    def closed(expr: ca.SX) -> ca.SX:
        """`expr` without the symbols of the acceleration and of a held drive."""
        return ca.substitute(ca.substitute(ca.SX(expr), a, acceleration), parts.held, parts.held_value)

    signals = {name: replace(signal, expr=closed(signal.expr)) for name, signal in parts.signals.items()}
    limits = physics.limits(_limited(physics, signals, own_x, z))
    return Model(
        name=device.name,
        device=device,
        x=ca.vertcat(own_x, *(symbol for *_, symbol in memories), v),
        n_states=first,
        z=z,
        v=v,
        u=physics.drive.expr,
        p=p,
        p_nominal=p_nominal,
        ambient=ambient,
        acceleration=a,
        held=parts.held,
        held_value=parts.held_value,
        heat=parts.heat,
        heat_of_drive=closed(parts.heat_of_drive),
        rates_of_heat=closed(rates),
        sampled_rates=ca.substitute(rates, parts.heat, parts.heat_of_drive),
        balance=closed(parts.balance),
        mass=mass,
        stepped={first + k: closed(m.stepped[s.name]) for k, (m, s, _) in enumerate(memories) if s.stepped},
        clocks=tuple(first + k for k, (_, s, _) in enumerate(memories) if s.clock),
        set_valued_axes=_set_valued_axes(terms, v, parts.own_force),
        bristles=tuple(first + k for k, (m, s, _) in enumerate(memories) if m.effect.set_valued and not s.stepped),
        free_memories=tuple(
            first + k for k, (m, s, _) in enumerate(memories) if s.free or (m.effect.set_valued and not s.stepped)
        ),
        signals=signals,
        force_parts=physics.restoring_force_parts(z),
        limits=tuple(_with_numbers(limit, p, p_nominal) for limit in limits),
        bounds_formulas=tuple((limit.lower, limit.upper) for limit in limits),
        laws=tuple(
            Law(name, f"{label} [{physics.force_unit}] of an axis", closed(expr), physics.documented.get(of, ()))
            for name, label, of, expr in _named_forces(physics, z, v)
        ),
        rate_limits=physics.rate_limits,
        drive_weights=_drive_weights(physics),
        law_inputs=terms.law_inputs,
        x_names=(
            *(() if state is None else (f"{state.name}_{channel}" for channel in state.channels)),
            *(symbol.name() for *_, symbol in memories),
            *(f"velocity_{axis}" for axis in physics.axes[: v.numel()]),
        ),
        x_units=tuple(
            base_unit(unit)
            for unit in (
                *(() if state is None else state.units),
                *(m.channel.unit_of(s) for m, s, _ in memories),
                *(f"({physics.travel_unit})/s",) * v.numel(),
            )
        ),
        rest=np.concatenate([_numbers(physics.rest, p, p_nominal), np.zeros(len(memories) + v.numel())]),
        rest_formula=ca.vertcat(NONE, *physics.rest, *(0.0,) * (len(memories) + v.numel())),
        x_scale=np.array([
            *(() if state is None else state.scale),
            *(m.channel.si(s.scale, s) for m, s, _ in memories),
            *(TYPICAL_RATE * physics.displacement_scale,) * v.numel(),
        ]),
        z_scale=np.full(n, physics.displacement_scale),
        u_scale=np.array(physics.drive.scale),
        force_scale=physics.force_scale,
    )  # fmt: skip


def _named_forces(physics: DevicePhysics, z: ca.SX, v: ca.SX) -> Iterator[tuple[str, str, str, ca.SX]]:
    """C name, label, map and value of the device's own forces."""
    yield "restoring_force", "restoring force", "restoring_force", physics.restoring_force(z)
    if isinstance(physics, BalancedPhysics):
        x = NONE if physics.state is None else physics.state.expr
        yield "actuator_force", "actuator force", "force", physics.force(physics.drive.expr, x, z)
    if isinstance(physics, InertialPhysics) and physics.damping_force is not None:
        yield "damping_force", "damping force", "damping_force", physics.damping_force(v)


@lru_cache(maxsize=16)  # a diagnosis builds hundreds of models of one device, each with other effects
def _physics(without_effects: Device, free: tuple[str, ...]) -> tuple[dict[str, ca.SX], DevicePhysics]:
    """The symbols of the numbers `free` and the physics with them; models of one device share both."""
    symbols = {path: ca.SX.sym(path) for path in free}
    return symbols, without_effects.physics(without_effects.values(symbols))


def _balanced(physics: BalancedPhysics, terms: EffectTerms, z: ca.SX) -> Assembly:
    """Forces in balance: 0 = force - restoring force."""
    displacement, pose, reading = _carried(physics, terms, z)
    u, x = physics.drive.expr, NONE if physics.state is None else physics.state.expr
    drive = terms.added(Place.DRIVE, u)
    produced = physics.heating_power(drive)
    heat = ca.SX.sym("heat", produced.numel())  # an unknown of its own, so that the inverse need not solve for squares
    arriving = terms.added(Place.HEAT, heat)
    force = physics.force(drive, x, z)
    balance = terms.added(Place.FORCE, force) - physics.restoring_force(z)
    signals = {"drive": physics.drive}
    if physics.power is not None:
        signals["power"] = physics.power.signal("power", physics.axes, ca.substitute(arriving, heat, produced))
    if physics.state is not None:
        signals["state"] = physics.state
    signals |= _mechanical(physics, force, displacement, pose, reading)
    return Assembly(signals, physics.rates(x, arriving), balance, heat, produced)


def _inertial(physics: InertialPhysics, terms: EffectTerms, z: ca.SX, v: ca.SX) -> Assembly:
    """Newton's second law, with the feedback loop if there is one: mass a = force - restoring force - damping force."""
    displacement, pose, reading = _carried(physics, terms, z)
    u, x, n = physics.drive.expr, NONE if physics.state is None else physics.state.expr, len(physics.axes)
    loop, signals, held, command = physics.feedback, {"drive": physics.drive}, NONE, NONE
    if loop is None:
        drive = produced = terms.added(Place.DRIVE, u)
    else:
        measured = reading if loop.measures == "reading" else z
        command, held = loop.control_law(u, measured, v, x), ca.SX.sym("held", n)
        drive, produced = terms.added(Place.DRIVE, held), u - measured
        signals["command"] = loop.command.signal("command", physics.axes, command)
    heat = ca.SX.sym("heat", produced.numel())
    arriving = terms.added(Place.HEAT, heat)
    force, rates = physics.dynamics(drive, x, z, v)
    damping = physics.damping_force(v) if physics.damping_force else ca.SX(n, 1)
    balance = terms.added(Place.FORCE, force) - physics.restoring_force(z) - damping
    if physics.state is not None:
        signals["state"] = physics.state
    signals |= _mechanical(physics, force, displacement, pose, reading)
    rates = rates if loop is None else loop.rates(x, arriving)
    return Assembly(signals, rates, balance, heat, produced, held, command, force - damping)


def _mass(mass: tuple[float | ca.SX, ...] | ca.SX | ca.DM) -> ca.SX:
    """(n_axes, n_axes) from one number an axis or a matrix."""
    return ca.diag(ca.SX(ca.vertcat(*mass))) if isinstance(mass, tuple) else ca.SX(mass)


def _acceleration(mass: tuple[float | ca.SX, ...] | ca.SX | ca.DM, force: ca.SX) -> ca.SX:
    """(n_axes,) what a `force` (n_axes,) gives masses, or a matrix of them that axes share."""
    return force / ca.vertcat(*mass) if isinstance(mass, tuple) else ca.mtimes(ca.inv(mass), force)


def _imposed(physics: ImposedPhysics, terms: EffectTerms, z: ca.SX) -> Assembly:
    """Motion imposed, force read: the displacements are the first components of the drive.

    What stands behind the displacement effects moves by d(z, m), m their memories, with d' = J v + (dd/dm) m', J = dd/dz; by virtual
    work its force F takes J' F of the machine: none while a play is crossed.
    """
    n = len(physics.axes)
    drive = terms.added(Place.DRIVE, physics.drive.expr)
    v, a = drive[n : 2 * n], drive[2 * n :]
    displacement = terms.added(Place.DISPLACEMENT, z)
    carried = [m for m in terms.members if m.effect.place is Place.DISPLACEMENT]
    memories = [(m.states[s.name], m.rates[s.name]) for m in carried for s in m.effect.states if not s.stepped]
    memory, rate = (ca.vertcat(NONE, *part) for part in (zip(*memories, strict=True) if memories else ((), ())))
    velocity = ca.jtimes(displacement, z, v) + ca.jtimes(displacement, memory, rate)
    acceleration = ca.jtimes(displacement, z, a) + ca.jtimes(velocity, z, v) + ca.jtimes(velocity, memory, rate)
    motion = ca.vertcat(displacement, velocity, acceleration)
    behind = physics.force(motion, displacement) + physics.restoring_force(displacement)
    needed = ca.jtimes(displacement, z, behind, True)
    applied = needed - terms.added(Place.FORCE, ca.SX(n, 1))  # forces of effects act on the axis beside the machine
    force = terms.added(Place.POSE, applied)
    reading = terms.added(Place.SENSOR, force)
    signals = {"drive": physics.drive, **_mechanical(physics, applied, displacement, force, reading)}
    return Assembly(signals, NONE, drive[:n] - z, ca.SX.sym("heat", n), drive[:n])


def _carried(physics: DevicePhysics, terms: EffectTerms, z: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """What follows the stages' displacement: that of the mechanism, the platform's pose and the readings, with effects."""
    displacement = terms.added(Place.DISPLACEMENT, z)
    pose = terms.added(Place.POSE, physics.pose(displacement))
    seen = pose if physics.sensed is None else ca.vertcat(pose, physics.sensed.at(displacement))
    return displacement, pose, terms.added(Place.SENSOR, seen)


def _mechanical(
    physics: DevicePhysics, force: ca.SX, displacement: ca.SX, pose: ca.SX, reading: ca.SX
) -> dict[str, Signal]:
    axes, n = physics.axes, len(physics.axes)
    (channels, reading_units, reading_scale), travel = physics.readings, (physics.displacement_scale,) * n
    units, sizes, lengths = (physics.force_unit,) * n, (physics.force_scale,) * n, (physics.travel_unit,) * n
    return {
        "force": Signal("force", "actuator force", axes, units, "F_", force, sizes),
        "displacement": Signal("displacement", "stage displacement", axes, lengths, "d_", displacement, travel),
        "pose": Signal("pose", "platform pose", physics.components, physics.pose_units, "", pose, physics.pose_scale),
        "reading": Signal("reading", "sensor reading", channels, reading_units, "reading_", reading, reading_scale),
    }


def _limited(physics: DevicePhysics, signals: dict[str, Signal], state: ca.SX, z: ca.SX) -> SimpleNamespace:
    """What `DevicePhysics.limits` reads."""
    return SimpleNamespace(
        drive=physics.drive.expr,
        command=signals.get("command", physics.drive).expr,
        state=state,
        force=signals["force"].expr,
        displacement=z,
        mechanism_displacement=signals["displacement"].expr,
    )


def _set_valued_axes(terms: EffectTerms, v: ca.SX, own_force: ca.SX) -> tuple[int, ...]:
    """Axes with inertia whose force has a set of values at standstill, by an effect, or is not linear in the velocity."""
    if not v.numel():
        return ()
    nonlinear = {i for i in range(v.numel()) if ca.depends_on(ca.jacobian(own_force[i], v[i]), v[i])}
    by_effect = {m.index for m in terms.members if m.effect.set_valued and m.effect.place is Place.FORCE}
    return tuple(sorted(nonlinear | by_effect))


def _drive_weights(physics: DevicePhysics) -> np.ndarray:
    """(n_u,) how much each drive counts; none of an imposed motion, which leaves nothing to choose."""
    if isinstance(physics, ImposedPhysics):
        return np.zeros(0)
    return np.array(physics.drive_weights or (1.0,) * len(physics.drive.channels))


def _numbers(values: Sequence[float | ca.SX], p: ca.SX, p_nominal: np.ndarray) -> np.ndarray:
    """Values that may hold free parameters, at their nominal ones."""
    return ca.Function("rest", [p], [ca.vertcat(*map(ca.SX, values), NONE)])(p_nominal).full().ravel()


def _with_numbers(limit: Limit, p: ca.SX, p_nominal: np.ndarray) -> Limit:
    """A limit whose bounds may hold free parameters, at their nominal values."""
    if not any(isinstance(bound, ca.SX) for bound in (limit.lower, limit.upper)):
        return limit
    lower, upper = (
        None if bound is None else float(_numbers([bound], p, p_nominal)[0]) for bound in (limit.lower, limit.upper)
    )
    return replace(limit, lower=lower, upper=upper)


def _check_stiffness(model: Model) -> None:
    """Refuses a device whose restoring force does not rise over the whole stroke: several displacements would balance one
    force."""
    if model.inertial:
        return
    stiffness = ca.Function(
        "stiffness", [model.x, model.z, model.u, model.p], [ca.diag(ca.jacobian(model.balance, model.z))]
    )
    low, high = model.z_bounds
    if not (np.all(np.isfinite(low)) and np.all(np.isfinite(high))):
        return
    for share in np.linspace(0, 1, STROKE_POINTS):
        z = low + share * (high - low)
        value = stiffness(model.rest, z, 0, model.p_nominal).full().ravel()
        bad = np.flatnonzero(~(value < 0))  # NaN too
        if bad.size:
            axis, displacement = model.axes[bad[0]], show(z[bad[0]], "um")
            what = f"the restoring force of {axis} does not rise at {displacement}; soften less, or lower the stroke"
            raise InputError(model.name, [Fault("stiffness", what)])
