"""Theorems that hold for every effect in the library; no list is kept here."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pint
import pytest
from effect_cases import (
    SAMPLE_TIME,
    Law,
    apply,
    device_of,
    every_effect,
    place_of,
    place_unit,
    rich,
    shapes,
    size,
    written,
)
from law_inputs import law_inputs

import ctrlgen.effects
from ctrlgen import build_model
from ctrlgen.core.units import same_dimension
from ctrlgen.effects import Channel, Effect, Place

# The rest, which shifts the drive, is in test_law_delays
IN_THE_MODEL = {kind: effect for kind, effect in Effect.library.items() if not effect.shifts_drive}
every_law = pytest.mark.parametrize("effect", IN_THE_MODEL.values(), ids=IN_THE_MODEL)


class Everything:
    """All equations and signals of a device with and without the effect, its parameters free."""

    def __init__(self, effect: type[Effect], where: Channel, rng: np.random.Generator) -> None:
        table = place_of(effect)[0]
        values = {**shapes(effect, where)[0], effect.amplitude().name: size(effect, where, rng)}
        ambient = ca.SX.sym("ambient")
        free = [f"effect[0].{p.name}" for p in effect.params]
        self.effect, self.where = effect, where
        device = device_of(table, written(effect, where, values))
        self.model = build_model(device, free, ambient=ambient, sample_time=SAMPLE_TIME, per_record=True)
        self.bare = build_model(device_of(table), ambient=ambient)
        n, memories = self.bare.n_states, self.model.x.numel() - self.bare.x.numel()
        own = [*range(n), *range(n + memories, self.model.x.numel())]
        m = self.model
        with_it = [m.rates[own], m.balance, *(signal.expr for signal in m.signals.values())]
        self.with_effect = ca.Function("f", [m.x, m.z, m.u, m.p, ambient], [ca.vertcat(*with_it)])
        b = self.bare
        without = [b.rates, b.balance, *(signal.expr for signal in b.signals.values())]
        self.without = ca.Function("f", [b.x, b.z, b.u, ambient], [ca.vertcat(*without)])
        count = 40
        self.x = (m.rest + rng.uniform(0.1, 1, (count, m.x.numel())) * m.x_scale).T
        self.z = (rng.uniform(0.1, 3, (count, m.z.numel())) * m.z_scale).T
        self.u = (rng.uniform(0.05, 0.5, (count, m.u.numel())) * m.u_scale).T
        self.ambient = rng.uniform(1, 5, (1, count))
        self.own = own

    def evaluate(self, shape: dict[str, float], amplitude: float) -> np.ndarray:
        values = {**shape, self.effect.amplitude().name: amplitude}
        p = np.tile([[values[q.name]] for q in self.effect.params], (1, self.x.shape[1]))
        return self.with_effect(self.x, self.z, self.u, p, self.ambient).full()

    def nominal(self) -> np.ndarray:
        return self.without(self.x[self.own], self.z, self.u, self.ambient).full()


@every_law
def test_vanishes_exactly_when_off_and_only_then(effect, rng):
    amplitude = effect.amplitude()
    for where in place_of(effect)[1]:
        everything = Everything(effect, where, rng)
        nominal, acts = everything.nominal(), False
        for shape in shapes(effect, where):
            assert np.array_equal(everything.evaluate(shape, where.si(amplitude.off, amplitude)), nominal)
            there = everything.evaluate(shape, size(effect, where, rng))
            acts |= not np.allclose(there, nominal, rtol=1e-9, atol=0)
        if acts:
            return
    raise AssertionError("nothing happens at any channel")


MOTION = {"stiffness": "m", "damping": "m/s", "inertia": "m/s^2"}  # what a cross term counts per


CONSTANT = ("drive_offset", "home_offset", "zero_per_record")


@every_law
def test_can_be_seen_in_the_slope_of_its_amplitude(effect):
    """What is only suspected is judged by d(term)/d(amplitude) at `off`: it must not vanish there for every shape."""
    signals = rich(600, 1e-3)
    amplitude = effect.amplitude()
    position = effect.params.index(amplitude)
    for index in (4, 5):
        law = Law(effect, 1e-3, index)
        walk = law.walk(signals, np.array([float(s.free) for s in effect.states]))
        p = ca.MX.sym("p", len(effect.params))
        slope = ca.Function("slope", [p], [ca.jacobian(walk(p), p)[:, position]])
        for shape in shapes(effect, law.where):
            found = slope(law.numbers(shape, law.where.si(amplitude.off, amplitude))).full()
            assert np.all(np.isfinite(found))
            if np.ptp(found) > 1e-6 or (effect.kind in CONSTANT and np.abs(found).max() > 0):
                return
    raise AssertionError("the slope is zero, or the same at all times, for every shape in the grid")


@pytest.mark.long
@pytest.mark.parametrize("effect", [e for e in Effect.library.values() if e.place is Place.FORCE], ids=lambda e: e.kind)
def test_makes_no_energy(effect, rng):
    """Around a closed path of the displacement, from rest, everything else standing still."""
    count, h = 20001, 1e-4
    signals = rich(count, h)
    signals[:, : Law.PER_CHANNEL], signals[:, -3:] = 0.7, (1.1, 0.0, 1.0)
    law = Law(effect, h, still=True)
    d = signals[:, Law.PER_CHANNEL]
    start = np.array([1.0 if s.clock else 0.0 for s in effect.states])
    walk = law.walk(signals, start)
    keeps = not effect.states and "velocity" not in effect.requires
    for shape in shapes(effect, law.where):
        F = walk(law.numbers(shape, size(effect, law.where, rng))).full().ravel()
        steps = np.diff(d)
        done, moved = np.sum((F[1:] + F[:-1]) / 2 * steps), np.sum(np.abs(F[1:] * steps))
        assert effect.active or done <= 1e-6 * moved, shape  # the rule of the trapezoid at the corners of a law
        assert not keeps or abs(done) <= 1e-6 * moved, shape


@every_effect
def test_does_not_depend_on_the_choice_of_units(effect, rng):
    """Rescale kg, m, s, K, A at random: the term and the memories must scale like their place and their unit."""
    law = Law(effect, 1e-2)
    where, unit = law.where, place_unit(effect)
    shape = shapes(effect, where)
    numbers = law.numbers(shape[rng.integers(len(shape))], size(effect, where, rng))
    memory = rng.uniform(0.5, 2, len(effect.states))
    every, held = rng.uniform(0.5, 2, 6), dict(zip(Law.ALONE, rng.uniform(0.5, 2, len(Law.ALONE)), strict=True))
    way = "rad" if effect.channel_unit == "N*m" else "m"
    units = {"displacement": way, "velocity": "m/s", "force": "N", "state": "K", "ambient": "K", "time": "s"}
    every_unit = (
        ["rad"] * 3 + ["m"] * 3
        if "spatial" in effect.requires or (effect.pairs and effect.channel_unit)
        else [unit] * 6
    )
    if effect.partner_unit not in (None, "channel"):
        every_unit[law.partner] = effect.partner_unit
    if effect.pairs and effect.place is Place.DRIVE and effect.partner_unit is None:
        every_unit[law.partner] = where.partner_unit
    if effect.pairs and effect.place is Place.FORCE:  # by the motion of the other axis, in the amplitude's name
        every_unit = [MOTION[effect.amplitude().name]] * 6
    if effect.partner_place is Place.DISPLACEMENT:
        every_unit = ["m/s" if "velocity" in effect.requires else "m"] * 6

    def evaluated(scale: dict[str, float]) -> tuple[list[float], list[float], float]:
        def factor(unit: str) -> float:
            return dimension_factor(unit, scale)

        s = law.seen(
            [m * factor(where.unit_of(q)) for m, q in zip(memory, effect.states, strict=True)],
            ca.DM([e * factor(u) for e, u in zip(every, every_unit, strict=True)]),
            {k: v * factor(units[k]) for k, v in held.items()},
        )
        sizes = {"sample_time": 1e-2 * factor("s"), "scale": factor(unit), "travel": factor("m")}
        s = replace(s, temperature_at_rest=Law.REST * factor("K"), **sizes)
        values = [number * factor(where.unit_of(q)) for number, q in zip(numbers, effect.params, strict=True)]
        after, rates, term = apply(effect, s, values)
        return [float(a) for a in after], [float(r) for r in rates], float(term)

    one = dict.fromkeys(("kg", "m", "s", "K", "A"), 1.0)
    after, rates, term = evaluated(one)
    for _ in range(5):
        scale = dict(zip(one, 10 ** rng.uniform(-2, 2, 5), strict=True))
        scaled_after, scaled_rates, scaled_term = evaluated(scale)
        assert scaled_term == pytest.approx(term * dimension_factor(unit, scale), rel=1e-9)
        for q, a, b in zip(effect.states, after, scaled_after, strict=True):
            assert b == pytest.approx(a * dimension_factor(where.unit_of(q), scale), rel=1e-9)
        for q, a, b in zip(effect.states, rates, scaled_rates, strict=True):
            assert b == pytest.approx(a * dimension_factor(f"{where.unit_of(q)}/s", scale), rel=1e-9)


def dimension_factor(unit: str, scale: dict[str, float]) -> float:
    """How a number in SI base units grows when the base units shrink by `scale`; an angle stays an angle."""
    registry = pint.get_application_registry()
    powers = registry.Unit("" if unit == "1" else unit).dimensionality
    names = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[temperature]": "K", "[current]": "A"}
    return float(
        np.prod([scale[names[dimension]] ** power for dimension, power in powers.items() if dimension in names])
    )


@every_effect
def test_has_an_equation_a_source_bounds_and_fits_on_a_screen(effect):
    lines = Path(inspect.getfile(effect)).read_text().splitlines()
    assert len(lines) < 60
    assert effect.__doc__ and "=" in effect.__doc__
    assert "old" in effect.__doc__  # "Holds for ..."
    assert effect.source
    assert sum(p.off is not None for p in effect.params) == 1
    where = place_of(effect)[1][0]
    for p in effect.params:
        assert p.doc and p.bounds[0] < p.bounds[1]
        assert p.off is None or p.bounds[0] <= p.off <= p.bounds[1]
        assert same_dimension(where.unit_of(p), where.unit_of(p))  # a unit that is known
    for state in effect.states:
        assert not (state.clock and state.stepped) and where.si(state.scale, state) > 0


@pytest.mark.parametrize("D", [2.0, 3.25, 4.5, 6.0, 7.0])
def test_logarithmic_creep_follows_the_logarithm_for_so_many_decades(D):
    """After a unit step, tau = 1 s; 3 % of a decade's, as its file says."""
    law = Effect.library["log_creep"]("all", {})
    one, p = (
        law_inputs(**{z.name: 0.0 for z in law.states}, value=1.0),
        SimpleNamespace(gain=1.0, tau=1.0, decades=D),
    )
    rates = law.rates(one, p)

    def after(t: float) -> float:
        moved = {name: 1 - np.exp(-float(rate) * t) for name, rate in rates.items()}
        return float(law.term(law_inputs(**moved), p))

    for t in np.geomspace(3.0, 10 ** (D - 1.5), 20):
        apart = max(0.5, D / 9)
        assert after(t) == pytest.approx(np.log10(t) + apart / 2 + 0.25, abs=0.03 if D <= 6 else 0.05)
    assert after(1e12) == pytest.approx(D)


def test_the_library_is_the_folder():
    files = {path.stem for path in Path(ctrlgen.effects.__path__[0]).glob("*.py") if not path.stem.startswith("_")}
    assert {law.__module__.rpartition(".")[2] for law in Effect.library.values()} == files


def test_an_effect_is_called_as_its_class_and_titled_by_its_file_or_itself():
    coulomb, turned = Effect.library["coulomb"], Effect.library["frame_rotation_x"]
    assert coulomb.title == "Dry friction"
    assert turned.title == "The platform's frame stands rotated about x against the drawing"
    titles = [law.title for law in Effect.library.values()]
    assert len(set(titles)) == len(titles)  # a report says which one it is
    for kind, law in Effect.library.items():
        assert kind == law.kind and kind.replace("_", "") == law.__name__.lower()


def test_an_effect_without_an_off_value_is_refused():
    with pytest.raises(TypeError, match="off"):
        type("Broken", (Effect,), {"params": (), "place": Place.DRIVE, "source": "none"})
