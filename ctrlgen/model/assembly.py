"""Device -> Model: a device's physics and its effects' terms as one symbolic statement; `equations` joins them place by place."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.one_or_several import several
from ctrlgen.core.units import show
from ctrlgen.devices import Device, DevicePhysics, ImposedPhysics, InertialPhysics, Limit, Signal
from ctrlgen.devices.quantities import shared_path
from ctrlgen.devices.sensor import mounting_faults
from ctrlgen.effects import Place
from ctrlgen.model.effect_terms import EffectTerms
from ctrlgen.model.equations import NONE, equations_of, named_forces
from ctrlgen.model.model import Law, Model
from ctrlgen.model.state_vector import at_nominal, components, memory_places
from ctrlgen.numerics.batched_evaluation import evaluate

STROKE_POINTS = 65  # points of the stroke, ends included, at which the tangent stiffness is checked
NO_RISE = ca.SX(0)  # the surroundings as they are described


def build_model(
    device: Device,
    free: str | Sequence[str] = (),
    ambient: ca.SX | None = None,
    sample_time: float | None = None,
    per_record: bool = False,
    apart: Collection[int] = (),
) -> Model:
    """The symbolic model of `device`; the parameters named in `free`, one or several, stay symbols, the others are numbers.

    `free` are dotted paths as in `device.quantities()` or, of how far single copies are off, as in `device.copies(path)`; `ambient` is
    a symbol for the rise of the surroundings [K], where that is not zero; without a `sample_time` [s] effects that look back by
    samples do nothing, as at rest. With `per_record` the
    constants of a record (where a play begins, a zero that is set anew) are states; without, they are zero. The effects `apart`, by
    their places in the file, add no term; see `Effect.apart`. Raises InputError for a
    path that is no parameter or acts on nothing, an effect that does not fit the device, and a restoring force that
    does not rise over the stroke.
    """
    free = several(free)
    _check_free(device, free)
    model = _assemble(device, free, NO_RISE if ambient is None else ambient, sample_time, per_record, apart)
    told_apart = (k for k, e in enumerate(device.effect) if e.shifts_drive or e.asks or k in apart)
    outside = {f"effect[{k}].{device.effect[k].amplitude().name}" for k in told_apart}
    idle = [path for path in free if path not in model.moved_by and path not in outside]
    if idle:
        what = "appears in no equation of motion (a limit, a material of the wires' stress): it cannot be free"
        raise InputError(device.name, [Fault(path, what) for path in idle])
    _check_stiffness(model)
    return model


def model_of_numbers(device: Device, free: Sequence[str], ambient: ca.SX) -> Model:
    """The model of `device` with the numbers `free` as symbols, those too that act on limits alone, or on nothing (see `Model.moved_by`);
    `ambient` as for `build_model`. Raises as that, but for a path that acts on nothing."""
    _check_free(device, free)
    model = _assemble(device, free, ambient, sample_time=None, per_record=False)
    _check_stiffness(model)
    return model


def _check_free(device: Device, free: Sequence[str]) -> None:
    """Refuses what is no parameter of the device, or a count. Raises InputError."""
    nominal = dict(device.quantities())
    unknown = [
        path for path in free if path not in (nominal if path == shared_path(path) else _deviations(device, path))
    ]
    if unknown:
        raise InputError(device.name, [Fault(path, "is not a parameter of this device") for path in unknown])
    counts = [path for path in free if nominal[shared_path(path)].whole]
    if counts:
        raise InputError(device.name, [Fault(path, "is a count and cannot be free") for path in counts])


def _deviations(device: Device, path: str) -> tuple[str, ...]:
    return device.copies(shared_path(path))


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


def _assemble(
    device: Device,
    free: Sequence[str],
    ambient: ca.SX,
    sample_time: float | None,
    per_record: bool,
    apart: Collection[int] = (),
) -> Model:
    """The model of `device` with the parameters `free` as symbols: the one place where a Model is made."""
    nominal = dict(device.quantities())
    own_symbols, physics = _physics(
        device.model_copy(update={"effect": ()}), tuple(path for path in free if not path.startswith("effect["))
    )
    symbols = {path: own_symbols[path] if path in own_symbols else ca.SX.sym(path) for path in free}
    p, p_nominal = (
        ca.vertcat(NONE, *symbols.values()),
        np.array(
            [nominal[path].si if path in nominal else 0.0 for path in free]  # a copy as described deviates by nothing
        ),
    )
    n = len(physics.axes)
    n_v = n if isinstance(physics, InertialPhysics) else 0
    z, v, a = ca.SX.sym("d", n), ca.SX.sym("v", n_v), ca.SX.sym("a", n_v)
    velocity = physics.drive.expr[n : 2 * n] if isinstance(physics, ImposedPhysics) else v
    values = device.values(symbols)
    terms = EffectTerms(device, physics, values, z, velocity, a, ambient, sample_time, per_record, apart)
    faults = mounting_faults(device.sensor, *physics.readings[:2]) + terms.faults
    if faults:
        raise InputError(device.name, faults)
    equations = equations_of(physics, terms, z, v)

    def closed(expr: ca.SX) -> ca.SX:
        """`expr` without the symbols of the acceleration and of a held drive."""
        inertial = ca.substitute(ca.SX(expr), a, equations.acceleration)
        return ca.substitute(inertial, equations.held, equations.held_value)

    memories = terms.memories()
    x = components(physics, memories, v)
    n_states = len(x) - len(memories) - n_v
    places = memory_places(memories, n_states, closed)
    memory_rates = (m.rates[s.name] for m, s, _ in memories)
    rates = ca.vertcat(equations.rates, *memory_rates, equations.acceleration)
    signals = {name: replace(signal, expr=closed(signal.expr)) for name, signal in equations.signals.items()}
    limits = physics.limits(_limited(physics, signals, z))
    return Model(
        name=device.name,
        device=device,
        x=ca.vertcat(NONE, *(c.symbol for c in x)),
        n_states=n_states,
        z=z,
        v=v,
        u=physics.drive.expr,
        p=p,
        p_nominal=p_nominal,
        ambient=ambient,
        acceleration=a,
        held=equations.held,
        held_value=equations.held_value,
        heat=equations.heat,
        heat_of_drive=closed(equations.heat_of_drive),
        rates_of_heat=closed(rates),
        sampled_rates=ca.substitute(rates, equations.heat, equations.heat_of_drive),
        balance=closed(equations.balance),
        mass=equations.mass,
        stepped=places.stepped,
        resting=places.resting,
        clocks=places.clocks,
        not_inverted=tuple(sorted({m.effect.kind for m in terms.members if not m.effect.inverted})),
        set_valued_axes=_set_valued_axes(terms, v, equations.own_force),
        bristles=places.bristles,
        free_memories=places.free,
        arbitrary_memories=places.arbitrary,
        signals=signals,
        force_parts=physics.restoring_force_parts(z),
        limits=tuple(_with_numbers(limit, p, p_nominal) for limit in limits),
        bounds_formulas=tuple((limit.lower, limit.upper) for limit in limits),
        laws=tuple(
            Law(name, f"{label} [{physics.force_unit}] of an axis", closed(expr), physics.documented.get(of, ()))
            for name, label, of, expr in named_forces(physics, z, v)
        ),
        rate_limits=terms.rate_limits(),
        drive_weights=_drive_weights(physics),
        law_inputs=terms.law_inputs,
        x_names=tuple(c.name for c in x),
        x_units=tuple(c.unit for c in x),
        rest=at_nominal([c.rest for c in x], p, p_nominal),
        rest_formula=ca.vertcat(NONE, *(c.rest for c in x)),
        x_scale=np.array([c.scale for c in x]),
        z_scale=np.full(n, physics.displacement_scale),
        u_scale=np.array(physics.drive.scale),
        force_scale=physics.force_scale,
    )


@lru_cache(maxsize=16)  # a diagnosis builds hundreds of models of one device, each with other effects
def _physics(without_effects: Device, free: tuple[str, ...]) -> tuple[dict[str, ca.SX], DevicePhysics]:
    """The symbols of the numbers `free` and the physics with them; models of one device share both."""
    symbols = {path: ca.SX.sym(path) for path in free}
    return symbols, without_effects.told_physics(without_effects.values(symbols))


def _limited(physics: DevicePhysics, signals: dict[str, Signal], z: ca.SX) -> SimpleNamespace:
    """The expressions that `DevicePhysics.limits` may read, by name."""
    return SimpleNamespace(
        drive=physics.drive.expr,
        command=signals.get("command", physics.drive).expr,
        state=NONE if physics.state is None else physics.state.expr,
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


def _with_numbers(limit: Limit, p: ca.SX, p_nominal: np.ndarray) -> Limit:
    """A limit whose bounds may hold free parameters, at their nominal values."""
    if not any(isinstance(bound, ca.SX) for bound in (limit.lower, limit.upper)):
        return limit
    lower, upper = (
        None if bound is None else float(at_nominal([bound], p, p_nominal)[0]) for bound in (limit.lower, limit.upper)
    )
    return replace(limit, lower=lower, upper=upper)


def _check_stiffness(model: Model) -> None:
    """Refuses a device whose restoring force does not rise over the whole stroke: several displacements would balance one
    force."""
    if model.inertial:
        return
    low, high = model.z_bounds
    if not (np.all(np.isfinite(low)) and np.all(np.isfinite(high))):
        return
    slope = ca.densify(ca.diag(ca.jacobian(model.balance, model.z)))
    stiffness = ca.Function("stiffness", [model.x, model.z, model.u, model.p, model.ambient_symbol], [slope])
    stroke = low + np.linspace(0, 1, STROKE_POINTS)[:, None] * (high - low)
    rest, u, p = (np.tile(v, (STROKE_POINTS, 1)) for v in (model.rest, 0 * model.u_scale, model.p_nominal))
    (values,) = evaluate(stiffness.map(STROKE_POINTS), rest, stroke, u, p, np.zeros((STROKE_POINTS, 1)))
    for z, value in zip(stroke, values, strict=True):
        bad = np.flatnonzero(~(value < 0))  # NaN too
        if bad.size:
            k = bad[0]
            axis, displacement = model.axes[k], show(z[k], model.signals["displacement"].units[k])
            what = f"the restoring force of {axis} does not rise at {displacement}; soften less, or lower the stroke"
            raise InputError(model.name, [Fault("stiffness", what)])
