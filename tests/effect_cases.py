"""Every law of the library where it acts on a device, in modest sizes: what the tests of all laws share."""

from __future__ import annotations

import tomllib
from functools import cache
from itertools import product
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE, DEVICE
from law_inputs import law_inputs

from ctrlgen.core.files import validate
from ctrlgen.core.units import from_si
from ctrlgen.devices import Device
from ctrlgen.effects import Channel, Effect, LawInputs, Param, Place
from ctrlgen.estimation.priors import prior_of
from ctrlgen.model.effect_terms import available, channels, partner_channels

TESTED = {
    "kind": "tested_axis",
    "name": "tested",
    "title": "an axis under test",
    "source": "round numbers",
    "mechanics": {
        "mass": "1 kg",
        "damping": "30 N*s/m",
        "stiffness": "0.2 N/um",
        "stroke": "100 um",
        "speed": "5 mm/s",
        "force": "20 N",
    },
}
TURNED = {
    **TESTED,
    "name": "turned",
    "title": "a joint under test",
    "mechanics": {
        "mass": "1 kg*m^2",
        "damping": "3 N*m*s/rad",
        "stiffness": "20 N*m/rad",
        "stroke": "90 deg",
        "speed": "3 rad/s",
        "force": "60 N*m",
    },
}
PAIR = {
    **{key: TESTED[key] for key in ("title", "source")},
    "kind": "tested_axes",
    "name": "pair",
    "axis": [{"name": name, **TESTED["mechanics"]} for name in ("a", "b")],
}
SAMPLE_TIME = 1e-3
MODEST = 0.5  # typical sizes: a tenth of the bounds where they are narrower than ten of these
every_effect = pytest.mark.parametrize("effect", Effect.library.values(), ids=Effect.library)


@cache
def tables() -> tuple[dict, ...]:
    """A device with heaters and no inertia, one with inertia, one whose motion is imposed, along a way and about a joint, two of
    these."""
    files = (DEVICE, AXIS_FILE)
    return (*(tomllib.loads(path.read_text()) for path in files), TESTED, TURNED, PAIR)


def device_of(table: dict, *effects: dict) -> Device:
    return validate(Device.library[table["kind"]], {**table, "effect": list(effects)}, "device with effects")


@cache
def place_of(effect: type[Effect]) -> tuple[dict, list[Channel]]:
    """The first device on which the effect can act, and every channel (and partner) there."""
    for table in tables():
        device = device_of(table)
        physics = device.physics(device.values())
        places = channels(physics, effect.place)
        if effect.pairs:
            places = [w.paired_with(other) for w in places for other in partner_channels(physics, effect)]
        places = [w for w in places if effect.applies_to(w)]
        if places and effect.requires <= available(physics, SAMPLE_TIME):
            return table, places
    raise AssertionError(f"{effect.kind} acts on no device that is known here")


SUGGESTED = {
    "drive_levels": (0.05, 0.2),
    "moments": (0.3, 1.0, 3.0),
    "jump_positions": (-0.3, 0.1, 0.6),
    "periods_across": (0.3, 0.7),
    "edges_above": (-0.3, 0.2),
    "edges_below": (-0.2, 0.3),
    "edges_beyond": (0.2, 0.5),
    "speeds": (0.1, 3.0),
    "drives": (0.1, 0.4),
    "since": (0.3, 1.0),
    "warmer": (-0.3, 0.2),
    "middles": (-0.3, 0.4),
    "lengths": (0.1, 0.6),
    "reading_ends": (-0.3, 0.2),
}


def shapes(effect: type[Effect], where: Channel) -> list[dict[str, float]]:
    """Every combination of the shape parameters' start values, SI; of what records suggest, a few."""
    shaped = [p for p in effect.params if p.off is None]
    return [
        dict(zip((p.name for p in shaped), [where.si(v, p) for v, p in zip(values, shaped, strict=True)], strict=True))
        for values in product(*(starts(effect, p) for p in shaped))
    ]


EMPIRICAL = {"low": -3.0, "width": 6.0, "speed": 10.0, "reach": 0.3} | {
    f"c{j}": float(np.sin(2 * j)) for j in range(1, 18)
}


def starts(effect: type[Effect], p: Param) -> tuple[float, ...]:
    if effect.kind.startswith("empirical_"):  # no fit begins with them
        return (EMPIRICAL[p.name],)
    prior = prior_of(effect).of(p)
    return prior.start_values or SUGGESTED[prior.start_from_data]


def size(effect: type[Effect], where: Channel, rng: np.random.Generator) -> float:
    """A modest amplitude, SI."""
    p = effect.amplitude()
    return rng.uniform(0.2, 1.0) * where.si(min(0.1 * p.bounds[1], MODEST), p)


def written(effect: type[Effect], where: Channel, values: dict[str, float]) -> dict:
    """The [[effect]] table with `values` [SI]."""
    units = {p.name: where.unit_of(p) for p in effect.params}
    texts = {k: f"{from_si(v, units[k])!r} {'' if units[k] == '1' else units[k]}".strip() for k, v in values.items()}
    if effect.pairs:
        return {"kind": effect.kind, "at": where.name, "of": where.partner, **texts}
    return {"kind": effect.kind, "at": "all" if effect.place is Place.POSE else where.name, **texts}


def partner_unit(effect: type[Effect]) -> str:
    """Of the other channel of a pair."""
    alike = effect.partner_unit == "channel" and isinstance(effect.channel_unit, str)
    return effect.channel_unit if alike else effect.partner_unit or "m"


class Law:
    """One effect's law alone, on channel `index` of six, walked along given signals; everything of typical size 1.

    One sample: (memories, signals, parameters) -> (memories, term), stepped ones by `update`, rates by Runge-Kutta's steps
    or, of bristles, exactly.
    """

    PER_CHANNEL, ALONE = 6, ("displacement", "velocity", "force", "state", "ambient", "time")
    REST, INDEX, PARTNER = 0.3, 4, 1  # as of delta_y and theta_y
    STEPS = 4  # a sample: lags of a fifth of it are followed

    def __init__(self, effect: type[Effect], h: float, index: int = INDEX, still: bool = False) -> None:
        self.effect, self.h = effect, h
        self.where = Channel("1X", place_unit(effect), 1.0, "m", 1.0, "1Y", partner_unit(effect), 1.0)
        alike = effect.partner_unit == "channel"
        self.index = 1 if effect.channel_unit == "rad" else index
        self.partner = {"rad": 2 if alike else 4, "m": 3 if alike else self.PARTNER}.get(
            effect.channel_unit, self.PARTNER
        )
        memory = ca.SX.sym("memory", len(effect.states))
        signals = ca.SX.sym("signals", self.PER_CHANNEL + len(self.ALONE))
        p = ca.SX.sym("p", len(effect.params))
        held = {k: signals[self.PER_CHANNEL + i] for i, k in enumerate(self.ALONE)}

        def law(m: ca.SX) -> tuple[list[ca.SX], list[ca.SX], ca.SX]:
            return apply(effect, self.seen(m, signals[: self.PER_CHANNEL], held), ca.vertsplit(p))

        stepped, _, term = law(memory)
        after = ca.vertcat(*stepped) if stepped else memory

        def f(m: ca.SX) -> ca.SX:
            return ca.vertcat(ca.SX(0, 1), *law(m)[1])

        if effect.set_valued:  # bristles: linear in themselves, far faster than a sample
            a = f(memory)
            slope = h * ca.diag(ca.jacobian(a, memory))
            after = after + h * a * ca.if_else(slope < -1e-6, (ca.exp(slope) - 1) / slope, 1.0)
        elif effect.rates is not Effect.rates:
            part = h / self.STEPS
            moving = memory
            for _ in range(self.STEPS):
                a = f(moving)
                b = f(moving + part / 2 * a)
                c = f(moving + part / 2 * b)
                d = f(moving + part * c)
                moving = moving + part / 6 * (a + 2 * b + 2 * c + d)
            after = after + moving - memory
        clocks = [i for i, s in enumerate(effect.states) if s.clock]
        for i in clocks:
            after[i] = held["time"] if still else memory[i] + h
        after[[i for i, s in enumerate(effect.states) if s.ramp]] = 0
        self.one = ca.Function("one", [memory, signals, p], [after, term], ["m", "s", "p"], ["next", "term"])
        self.whole = ca.Function("whole", [memory, signals, p], [ca.vertcat(after, term)], ["m", "s", "p"], ["result"])

    def seen(self, memory, every, held: dict) -> LawInputs:
        return law_inputs(
            value=every[self.index],
            rate=None,
            second_rate=None,
            all=every,
            index=self.index,
            partner=self.partner,
            ambient=held["ambient"],
            sample_time=self.h,
            temperature_at_rest=self.REST,
            scale=1.0,
            travel=1.0,
            second_order_kinematics=lambda: every,
            tangent_compliance=lambda: every,
            displacements=every,
            velocities=every,
            drives=every,
            accelerations=every,
            displacement=held["displacement"],
            velocity=held["velocity"],
            force=held["force"],
            temperature=held["state"],
            holding_heat=every[self.index],
            **{s.name: memory[i] for i, s in enumerate(self.effect.states)},
        )

    def walk(self, signals: np.ndarray, start: np.ndarray | None = None) -> ca.Function:
        """(parameters) -> the term at every row of `signals`."""
        p = ca.MX.sym("p", len(self.effect.params))
        start = np.zeros(len(self.effect.states)) if start is None else start
        _, terms = self.one.mapaccum(len(signals))(start, signals.T, ca.repmat(p, 1, len(signals)))
        return ca.Function("walk", [p], [terms.T])

    def numbers(self, shape: dict[str, float], amplitude: float) -> list[float]:
        values = {**shape, self.effect.amplitude().name: amplitude}
        return [values[q.name] for q in self.effect.params]


def apply(effect: type[Effect], s: LawInputs, numbers: list) -> tuple[list, list, ca.SX]:
    """Memories after the sample, their rates, and the term, as a model asks for them; the term sees the new ones."""
    p = SimpleNamespace(**dict(zip((q.name for q in effect.params), numbers, strict=True)))
    instance = effect("all", {})
    before = {state.name: getattr(s.states, state.name) for state in effect.states}
    s = s.with_states(instance.update(s, p))
    rates = {state.name: 0.0 for state in effect.states} | instance.rates(s, p)
    return [getattr(s.states, name) for name in before], [rates[name] for name in before], instance.term(s, p)


def place_unit(effect: type[Effect]) -> str:
    if effect.channel_unit:
        return effect.channel_unit if isinstance(effect.channel_unit, str) else effect.channel_unit[0]
    return {Place.DRIVE: "V", Place.HEAT: "W", Place.FORCE: "N"}.get(effect.place, "m")


def rich(count: int, h: float) -> np.ndarray:
    """Signals of many frequencies and about unit size, as a law reads them; the displacement ends where it began."""
    t = h * np.arange(count)
    period = h * (count - 1)
    w = 2 * np.pi / period
    d = 0.9 * np.sin(3 * w * t) + 0.4 * np.sin(7 * w * t) + 0.2 * np.sin(31 * w * t)
    v = w * (2.7 * np.cos(3 * w * t) + 2.8 * np.cos(7 * w * t) + 6.2 * np.cos(31 * w * t))
    every = [np.sin(k * w * t + k) + 0.3 * np.sin(11 * w * t * (1 + k)) for k in range(6)]
    state, room = 1.3 + np.sin(2 * w * t), np.sin(w * t)
    return np.column_stack([*every, d, v, d + 0.1 * d**3, state, room, 0 * t])
