"""Every law's numbers: its term and rates against the equation of its record written out in numpy."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from law_inputs import law_inputs
from numpy import sqrt
from written_laws import AMPLITUDES, LAWS, parameters
from written_terms import ROUNDING, H

import ctrlgen.effects  # noqa: F401  fills the library
from ctrlgen.effects import Effect, LawInputs


def test_every_law_of_the_library_is_written_out_here():
    assert set(LAWS) == set(Effect.library)


def signals(rng: np.random.Generator, kind: str) -> SimpleNamespace:
    """What a law may read at component 4 of six, everything of order one; memories at random."""
    every, other = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6)
    index = 4 if Effect.library[kind].channel_unit != "rad" else 1
    names = [state.name for state in Effect.library[kind].states]
    turns = index == 1 and Effect.library[kind].partner_unit == "channel"
    return SimpleNamespace(
        value=every[index],
        rate=None,
        second_rate=None,
        all=every,
        index=index,
        partner=2 if turns else 5 - index,
        ambient=rng.uniform(-3, 3),
        sample_time=H,
        temperature_at_rest=0.3,
        temperature=rng.uniform(0.5, 3),
        holding_heat=rng.uniform(0.5, 3),
        scale=1.3,
        travel=0.7,
        second_order_kinematics=lambda: other,
        tangent_compliance=lambda: other,
        displacement=rng.uniform(-1, 1),
        displacements=every,
        velocities=other,
        drives=other,
        accelerations=other * every,
        velocity=rng.uniform(-1, 1),
        force=rng.uniform(-1, 1),
        **dict(zip(names, rng.uniform(-1, 1, len(names)), strict=True)),
    )


def symbolic(s: SimpleNamespace) -> LawInputs:
    """The same as the laws get it."""
    return law_inputs(**{k: ca.DM(v) if isinstance(v, np.ndarray) else v for k, v in vars(s).items()})


WRITTEN = [kind for kind, law in LAWS.items() if law]


@pytest.mark.parametrize("kind", WRITTEN)
def test_a_law_says_what_its_record_says(kind, rng):
    law, (_, term, *rates) = Effect.library[kind]("all", {}), LAWS[kind]
    signed = law.amplitude().bounds[0] < 0
    for _ in range(30):
        s = signals(rng, kind)
        p = parameters(kind, AMPLITUDES.get(kind, 0.3) * rng.uniform(0.3, 1) * (rng.choice([-1, 1]) if signed else 1))
        found = float(ca.DM(law.term(symbolic(s), p)))
        assert found == pytest.approx(float(term(s, p)), rel=1e-9, abs=ROUNDING)
        wanted = rates[0](s, p) if rates else {}
        assert {k: float(ca.DM(v)) for k, v in law.rates(symbolic(s), p).items()} == pytest.approx(wanted, rel=1e-9)


def test_contacts_count_from_where_they_touch():
    """Beyond its corner, a thousandth of e, a spring is k (d - gap); far beyond e Hertz's is e^-(1/2) k x^(3/2)."""
    law, s = Effect.library["end_stop"]("all", {}), law_inputs(displacement=1.4, travel=1.0)
    spring = law.term(s, SimpleNamespace(stiffness=2.0, gap=0.4, power=1.0))
    assert float(spring) == pytest.approx(-2.0, rel=2e-6)  # the corner is a thousandth of a thousandth
    touched = law.term(law_inputs(displacement=0.4004, travel=1.0), SimpleNamespace(stiffness=2.0, gap=0.4, power=1.0))
    assert float(touched) == pytest.approx(-8e-4, rel=3e-3)  # and at less than e it is that spring already
    hertz = law.term(s, SimpleNamespace(stiffness=2.0, gap=0.4, power=1.5))
    assert float(hertz) == pytest.approx(-2.0 / sqrt(1e-3), rel=2e-3)
    assert float(law.term(s, SimpleNamespace(stiffness=2.0, gap=1.5, power=1.5))) == 0.0


@pytest.mark.parametrize("way", [0.1, 1.0])
def test_a_rise_is_half_over_at_its_moment(way):
    """4 % at its begin, 96 % at its end."""
    law = Effect.library["sensor_step"]("all", {})
    p = SimpleNamespace(offset=1.0, moment=3.0, rise=way)
    at = [float(law.term(law_inputs(t=t), p)) for t in (3.0 - way / 2, 3.0, 3.0 + way / 2)]
    assert at == pytest.approx([0.0414, 0.5, 0.9586], abs=1e-4)  # (1 -+ tanh(pi/2))/2, to the digits written


@pytest.mark.parametrize(
    "first, then, why",
    [
        ("bow", "cyclic", "the fringes of a bent scale are counted along the bent scale"),
        ("cubic_sensor", "cyclic", "the same"),
        ("drift", "cyclic", "what drifts moves the target along the fringes"),
        ("temperature_sensitivity", "cyclic", "the same"),
        ("cyclic", "low_pass", "the readout follows the fringe signal"),
        ("cyclic", "feedthrough", "what the fringes give is wired beside the drive"),
        ("feedthrough", "low_pass", "what is picked up is filtered with the rest"),
        ("low_pass", "delay", "a filtered reading is sent"),
        ("low_pass", "moving_average", "what is filtered is sampled and averaged"),
        ("moving_average", "delay", "a mean is sent"),
        ("delay", "quantisation", "digits are what arrives"),
        ("delay", "stuck", "what no longer changes is what arrives"),
    ],
)
def test_a_reading_passes_the_laws_in_the_order_of_its_chain(first, then, why):
    assert Effect.library[first].order < Effect.library[then].order, why


@pytest.mark.parametrize(
    "first, then, why",
    [
        ("one_sided_saturation", "slew_rate", "what is clipped is reached at a rate"),
        ("slew_rate", "amplifier_lag", "what slews is followed late"),
        ("drive_gain", "amplifier_lag", "the amplifier follows what it is told, scaled"),
    ],
)
def test_a_drive_passes_the_laws_in_the_order_of_its_chain(first, then, why):
    assert Effect.library[first].order < Effect.library[then].order, why


def test_an_event_is_looked_for_on_either_side_of_the_zero_of_time():
    events = [p for law in Effect.library.values() for p in law.params if p.name == "moment"]
    assert events and all(p.bounds[0] == -p.bounds[1] for p in events)
