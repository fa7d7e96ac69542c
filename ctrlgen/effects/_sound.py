"""Whether a law of another package can be used: its names, units and bounds, and what its expressions give."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator
from types import SimpleNamespace

import casadi as ca
import numpy as np

from ctrlgen.core.names import is_name
from ctrlgen.core.units import to_si
from ctrlgen.effects._effect import Effect, Place
from ctrlgen.effects._family import Family
from ctrlgen.effects._law_inputs import LawInputs
from ctrlgen.effects._parameter import Channel, Param, State
from ctrlgen.effects._requirements import REQUIREMENTS
from ctrlgen.effects._shape_bounds import ShapeBounds

RESERVED = frozenset({"kind", "at", "of", "package"})
"""Keys of an [[effect]] table that are no parameter of its law."""
_ANYWHERE = Channel("axis", "m", 1.0, "m", 1.0, "other", "m", 1.0)
_AXES = 6


def faults_of(law: type[Effect]) -> list[str]:
    """Everything that keeps a law from being used, each in a sentence; none for one that is sound.

    Its expressions are tried at random values: they must be numbers, and vanish where the amplitude is off.
    """
    faults = list(_declared(law))
    return faults or list(_evaluated(law))


def _declared(law: type[Effect]) -> Iterator[str]:
    if not isinstance(getattr(law, "place", None), Place):
        yield "place is missing; state where it acts, such as place = Place.FORCE"
    if not str(getattr(law, "source", "")).strip():
        yield "source is missing; state where the law is published"
    if unknown := sorted(set(law.requires) - set(REQUIREMENTS)):
        yield f"requires {', '.join(unknown)}, which no device has; known are: {', '.join(sorted(REQUIREMENTS))}"
    for name in ("params", "states"):
        wanted = Param if name == "params" else State
        if not all(isinstance(number, wanted) for number in getattr(law, name)):
            yield f"{name} must be a tuple of {wanted.__name__}"
            return
    numbers: tuple[Param | State, ...] = (*law.params, *law.states)
    for number in numbers:
        yield from _number(number)
    for param in law.params:
        yield from _bounds(param)
    names = [number.name for number in law.params]
    if sum(p.off is not None for p in law.params) != 1 or len(set(names)) < len(names):
        yield "exactly one parameter must have an `off` value, and no two the same name"
    if not isinstance(law.family, Family | None):
        yield f"family must be a {Family.__name__}, such as Family.{Family.ELASTIC.name}"
    for name, ends in law.at_bounds.items():
        if name not in names:
            yield f"at_bounds states something of {name}, which is no parameter"
        elif not isinstance(ends, ShapeBounds):
            yield f"at_bounds: {name} must be stated as a {ShapeBounds.__name__}"
    if law.prior is not None:
        yield from _prior(law.prior, names)
    if law.term is Effect.term:
        yield "term() is missing: what the law adds at its place"


def _prior(prior: object, names: list[str]) -> Iterator[str]:
    """A prior is of `estimation`, which laws do not import: known by what it states."""
    parameters = getattr(prior, "parameters", None)
    if parameters is None:
        yield "prior must be a ctrlgen.estimation.law_prior.LawPrior"
        return
    for name in sorted({*parameters} - {*names}):
        yield f"prior states something of {name}, which is no parameter"


def _number(number: Param | State) -> Iterator[str]:
    if not is_name(number.name) or number.name in RESERVED:
        yield f"{number.name!r} cannot name a number of a law; letters, digits and _, and none of {', '.join(sorted(RESERVED))}"
    unit = number.unit if isinstance(number.unit, str) else ""
    if not unit.strip():
        yield f'{number.name} has no unit; write one, such as "N/travel", or "1" for a plain number'
        return
    try:
        to_si(1.0, _ANYWHERE.unit_of(number))
    except ValueError as error:
        yield f"{number.name}: {error}"


def _bounds(param: Param) -> Iterator[str]:
    try:
        low, high = (float(bound) for bound in param.bounds)
    except (TypeError, ValueError):
        yield f"{param.name}: bounds must be two numbers, lowest and highest"
        return
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        yield f"{param.name}: bounds {low:g} ... {high:g} must be finite, the lower one first"
    elif param.off is not None and not low <= param.off <= high:
        yield f"{param.name}: off = {param.off:g} is outside its bounds {low:g} ... {high:g}"


def _evaluated(law: type[Effect]) -> Iterator[str]:
    """What is wrong with the expressions at random values of all that a law may read."""
    values = {p.name: ca.SX.sym(p.name) for p in law.params}
    effect, symbols = law("axis", {}), _symbols(law)
    try:
        s, p = _inputs(law, symbols), SimpleNamespace(**values)
        new = effect.after_sample(s, p).items()
        s = s.with_states({name: ca.SX(value) for name, value in new if name not in effect.ramps()})
        parts = {"term()": effect.term(s, p), **{f"rates()[{k!r}]": v for k, v in effect.rates(s, p).items()}}
        expressions = {name: ca.SX(part) for name, part in parts.items()}
    # of a stranger's expressions
    except Exception as error:
        place = inspect.getsourcefile(law) or law.__module__
        yield f"its expressions cannot be evaluated: {type(error).__name__}: {error} ({place})"
        return
    for name, expression in expressions.items():
        if expression.shape != (1, 1):
            yield f"{name} must be one number, and is of shape {expression.shape}"
            return
    if not _vanishes(law, expressions["term()"], values, symbols):
        name = law.amplitude().name
        yield f"term() must be zero where {name} is at its off value, {law.amplitude().off:g}, and is not"


def _vanishes(
    law: type[Effect], term: ca.SX, values: dict[str, ca.SX], symbols: dict[str, ca.SX], tries: int = 20
) -> bool:
    """Whether the term is zero with the amplitude off, at random values of everything else."""
    amplitude, rng = law.amplitude(), np.random.default_rng(0)
    evaluate = ca.Function("term", [*values.values(), *symbols.values()], [term], {"allow_free": False})
    for _ in range(tries):
        numbers = [amplitude.off if p is amplitude else _ANYWHERE.si(rng.uniform(*p.bounds), p) for p in law.params]
        read = [rng.uniform(0.1, 2.0, symbol.shape) for symbol in symbols.values()]
        if float(evaluate(*numbers, *read)) != 0.0:
            return False
    return True


_ALONE = [
    "value",
    "ambient",
    "rate",
    "second_rate",
    "displacement",
    "velocity",
    "force",
    "temperature",
    "temperature_at_rest",
]  # numbers that a law may read
_OF_ALL = ["all", "displacements", "velocities", "accelerations"]


def _symbols(law: type[Effect]) -> dict[str, ca.SX]:
    every = {name: ca.SX.sym(name) for name in _ALONE} | {name: ca.SX.sym(name, _AXES) for name in _OF_ALL}
    kinematics = {name: ca.SX.sym(name, _AXES) for name in ("second_order_kinematics", "tangent_compliance")}
    return every | kinematics | {f"state {state.name}": ca.SX.sym(state.name) for state in law.states}


def _inputs(law: type[Effect], symbols: dict[str, ca.SX]) -> LawInputs:
    return LawInputs(
        **{name: symbols[name] for name in (*_ALONE, *_OF_ALL)},
        index=0,
        partner=1 if law.pairs else None,
        scale=1.0,
        travel=1.0,
        states=SimpleNamespace(**{state.name: symbols[f"state {state.name}"] for state in law.states}),
        sample_time=1e-3,
        second_order_kinematics=lambda: symbols["second_order_kinematics"],
        tangent_compliance=lambda: symbols["tangent_compliance"],
    )
