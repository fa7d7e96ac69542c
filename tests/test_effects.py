"""Theorems that hold for every effect in the library; no list is kept here."""

from __future__ import annotations

import inspect
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE, effect_device

import ctrlgen.effects
from ctrlgen import Controller, build_model, simulate
from ctrlgen.chain import channels
from ctrlgen.effect import Effect, Place, Where
from ctrlgen.simulation import trace
from ctrlgen.units import from_si

every_effect = pytest.mark.parametrize("effect", Effect.library.values(), ids=Effect.library)


def relative(effect: type[Effect]) -> bool:
    """Whether a parameter's unit depends on where the effect acts."""
    return any(p.relative for p in effect.params)


def table(effect: type[Effect], rng: np.random.Generator, *, off: bool = False, at: str | None = None) -> dict:
    """A device-file table with parameters drawn inside their bounds (a tenth of the way), or off."""
    device = ctrlgen.load_device(DEVICE)
    channel = (
        at if at not in (None, "all") else {Place.POSE: "delta_x", Place.SENSOR: "delta_x"}.get(effect.place, "2X")
    )
    where = next(w for w in channels(device.links(device.values()), effect.place) if w.channel == channel)
    values = {}
    for p in effect.params:
        unit, high = where.unit_of(p), from_si(where.si(p.bounds[1], p), where.unit_of(p))
        value = p.off if off and p.off is not None else rng.uniform(0.02, 0.1) * (high if high < 1e3 else 1.0)
        values[p.name] = f"{value!r} {'' if unit == '1' else unit}".strip()
    return {"kind": effect.kind, "at": at or channel, **values}


def states(model, rng, n: int = 40):
    """Random admissible x, z, u as rows."""
    x = model.rest + rng.uniform(0.1, 1, (n, model.x.numel())) * model.x_scale
    z = rng.uniform(0.1, 3, (n, model.z.numel())) * model.z_scale
    return x, z, rng.uniform(0.05, 0.5, (n, model.u.numel())) * model.u_scale


@every_effect
def test_vanishes_exactly_when_off(effect, rng, model):
    with_effect = build_model(
        effect_device(table(effect, rng, off=True, at=None if effect.pairs or relative(effect) else "all"))
    )
    x, z, u = states(with_effect, rng)
    n = model.x.numel()
    here, there = trace(with_effect, np.zeros(len(z)), x, z, u), trace(model, np.zeros(len(z)), x[:, :n], z, u)
    for role, values in there.signals.items():
        assert np.array_equal(here.signals[role], values), role
    rates, balance = with_effect.dynamics.map(len(z))(x.T, z.T, u.T, np.zeros((0, len(z))))
    bare_rates, bare_balance = model.dynamics.map(len(z))(x[:, :n].T, z.T, u.T, np.zeros((0, len(z))))
    assert np.array_equal(rates[:n, :].full(), bare_rates.full()) and np.array_equal(
        balance.full(), bare_balance.full()
    )


@every_effect
def test_does_something_when_on(effect, rng, model):
    with_effect = build_model(effect_device(table(effect, rng)))
    x, z, u = states(with_effect, rng)
    n = model.x.numel()
    everything = [v.full() for v in with_effect.dynamics.map(len(z))(x.T, z.T, u.T, np.zeros((0, len(z))))]
    bare = [v.full() for v in model.dynamics.map(len(z))(x[:, :n].T, z.T, u.T, np.zeros((0, len(z))))]
    here, there = trace(with_effect, np.zeros(len(z)), x, z, u), trace(model, np.zeros(len(z)), x[:, :n], z, u)
    assert any(
        not np.allclose(a, b, rtol=1e-9, atol=0)
        for a, b in [
            (everything[0][:n], bare[0]),
            (everything[1], bare[1]),
            *((here.signals[r], there.signals[r]) for r in there.signals),
        ]
    )


@every_effect
def test_does_not_depend_on_the_choice_of_units(effect, rng):
    """Rescale kg, m, s, K (and W for a drive, as its own unit) at random: the term must scale like its place."""
    place_unit = {
        Place.DRIVE: "V",
        Place.HEAT: "W",
        Place.FORCE: "N",
        Place.DISPLACEMENT: "m",
        Place.POSE: "m",
        Place.SENSOR: "m",
    }[effect.place]
    where = Where("1X", place_unit, 1.0, "m", 1.0)
    numbers = {p.name: where.si(rng.uniform(0.2, 0.8) * p.bounds[1], p) for p in effect.params}
    value, others = rng.uniform(0.5, 2, 2)
    displacement, temperature = rng.uniform(0.5, 2, 2)
    memory = {s.name: rng.uniform(0.5, 2) for s in effect.states}

    def law(scale: dict[str, float]) -> tuple[float, list[float]]:
        def factor(unit: str) -> float:
            return dimension_factor(unit, scale)

        every = np.array([others, value, others, others, value, others]) * factor(place_unit)
        s = SimpleNamespace(
            value=value * factor(place_unit), all=ca.DM(every), index=1,
            displacement=displacement * factor("m"), state=temperature * factor("K"),
            **{state.name: memory[state.name] * factor(where.unit_of(state)) for state in effect.states},
        )  # fmt: skip
        p = SimpleNamespace(**{q.name: numbers[q.name] * factor(where.unit_of(q)) for q in effect.params})
        instance = effect("all", {})
        rates = instance.rates(s, p)
        return float(instance.term(s, p)), [float(rates[state.name]) for state in effect.states]

    one = dict.fromkeys(("kg", "m", "s", "K", "A"), 1.0)
    term, rates = law(one)
    for _ in range(5):
        scale = dict(zip(one, 10 ** rng.uniform(-2, 2, 5), strict=True))
        scaled_term, scaled_rates = law(scale)
        assert scaled_term == pytest.approx(term * dimension_factor(place_unit, scale), rel=1e-9)
        for state, rate, scaled in zip(effect.states, rates, scaled_rates, strict=True):
            assert scaled == pytest.approx(rate * dimension_factor(f"{where.unit_of(state)}/s", scale), rel=1e-9)


def dimension_factor(unit: str, scale: dict[str, float]) -> float:
    """How a number in SI base units grows when the base units shrink by `scale`."""
    import pint

    registry = pint.get_application_registry()
    powers = registry.Unit("" if unit == "1" else unit).dimensionality
    names = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[temperature]": "K", "[current]": "A"}
    return float(np.prod([scale[names[dimension]] ** power for dimension, power in powers.items()]))


@every_effect
def test_the_inverse_follows_without_knowing_the_effect(effect, rng, model):
    """Controller with the effect -> model with the effect: the pose is the commanded one."""
    with_effect = build_model(effect_device(table(effect, rng)))
    controller = Controller(with_effect, "pose", 1e-3)
    angle = 2 * np.pi * np.arange(60) / 60
    targets = np.column_stack(
        [0 * angle, 0 * angle, 0 * angle, 4e-6 * np.cos(angle), 4e-6 * np.sin(angle), 25e-6 + 0 * angle]
    )
    step = controller.step(controller.rest(), targets[0], settle=True)
    start, state, drives = step.state[0], step.state, []
    for target in targets[1:]:
        step = controller.step(state, target)
        assert step.status == 0
        state = step.state
        drives.append(step.drive)
    reached = simulate(with_effect, np.array(drives), 1e-3, start).signals["pose"]
    error = np.abs(reached - targets)
    assert (
        error[:, 3:].max() < 1e-11 and error[:, :3].max() < 1e-12
    )  # a hundredth of a nanometre; the issue's own limits


@every_effect
def test_has_an_equation_a_source_bounds_and_fits_on_a_screen(effect):
    lines = Path(inspect.getfile(effect)).read_text().splitlines()
    assert len(lines) < 60
    assert effect.__doc__ and "=" in effect.__doc__
    assert effect.source
    for p in effect.params:
        assert p.doc and p.bounds[0] < p.bounds[1]
        assert p.off is None or p.bounds[0] <= p.off <= p.bounds[1]


def test_the_library_is_the_folder():
    files = {path.stem for path in Path(ctrlgen.effects.__path__[0]).glob("*.py")} - {"__init__"}
    assert set(Effect.library) == files


def test_an_effect_without_an_off_value_is_refused():
    with pytest.raises(TypeError, match="off"):
        type("Broken", (Effect,), {"params": (), "place": Place.DRIVE, "source": "none"})
