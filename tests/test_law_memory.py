"""What laws with a memory remember: backlash, plays, friction, Bouc-Wen and Dahl, bristles and creep against closed forms."""

from __future__ import annotations

import tomllib
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE
from law_inputs import law_inputs
from numpy import abs, exp, sign, tanh
from scipy.integrate import solve_ivp
from written_laws import parameters
from written_terms import H

import ctrlgen.effects  # noqa: F401  fills the library
from ctrlgen import build_model
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.effects import Effect
from ctrlgen.effects.bouc_wen_of_power import taken_up

EVENT = '\n[[effect]]\nkind = "coulomb_after"\nat = "axis"\n{}\n'


def along(kind: str, path: np.ndarray, p: SimpleNamespace, velocity: float | None = None) -> np.ndarray:
    """The term of a law of samples at every displacement (or value) of `path`, from zero."""
    law = Effect.library[kind]("all", {})
    memory, found = {state.name: 0.0 for state in law.states}, []
    for d in path:
        s = law_inputs(
            value=d,
            displacement=d,
            velocity=velocity,
            rate=None,
            second_rate=None,
            sample_time=H,
            travel=1.0,
            scale=1.0,
            **memory,
        )
        new = {k: float(ca.DM(v)) for k, v in law.update(s, p).items()}
        memory |= new
        found.append(float(ca.DM(law.term(s.with_states(new), p))))
    return np.array(found)


THERE_AND_BACK = np.concatenate([np.linspace(0, 1, 401), np.linspace(1, -1, 801)[1:], np.linspace(-1, 0.4, 561)[1:]])


def test_backlash_stands_still_until_the_gap_is_crossed():
    gap = 0.3
    carried = THERE_AND_BACK + along("backlash", THERE_AND_BACK, parameters("backlash", gap)) / 0.999
    up, down = THERE_AND_BACK[200], THERE_AND_BACK[800]
    assert carried[200] == pytest.approx(up - gap / 2) and carried[800] == pytest.approx(down + gap / 2)
    assert carried[400 + 60] == pytest.approx(1 - gap / 2)  # 0.15 back of 1: half the gap


def test_a_play_of_a_piezo_stack_lags_by_its_radius_at_most():
    """All eight follow once the way is longer than twice the reach: share g behind by the mean radius."""
    p = parameters("drive_hysteresis", 0.2)
    w = np.arange(1, 9) ** -p.taper
    behind = 0.2 * float(w @ (p.reach * np.arange(1, 9) / 8)) / w.sum()
    found = along("drive_hysteresis", THERE_AND_BACK, p)
    assert found[400] == pytest.approx(-behind) and found[1200] == pytest.approx(behind)
    assert along("hysteresis", THERE_AND_BACK, parameters("hysteresis", 0.2))[400] == pytest.approx(-behind)


def test_a_slewing_amplifier_gives_mean_and_first_moment_of_its_ramp_in_each_sample():
    """Against the ramp in a thousand steps a sample: whole samples of it, one in which it ends, one in which it is short, and back."""
    law, p, fine = Effect.library["slew_rate"]("all", {}), SimpleNamespace(share=0.25, rate=32.0), 1000
    part = (np.arange(fine) + 0.5) / fine
    memory = {state.name: 0.0 for state in law.states}
    out, lines = 0.0, []
    for u in [0.8, 0.8, 0.8, 0.9, 0.9, -2.0, 0.7]:
        s = law_inputs(value=u, sample_time=H, scale=1.0, travel=1.0, **memory)
        memory |= {k: float(ca.DM(v)) for k, v in law.update(s, p).items()}
        s = s.with_states(memory)
        slope = float(ca.DM(law.rates(s, p)["w"])) * H
        line = [float(ca.DM(law.term(s.with_states(memory | {"w": slope * x}), p))) for x in (0.0, 1.0)]
        ramp = out + np.sign(u - out) * np.minimum(p.rate * H * part, abs(u - out)) - u
        lines.append((sum(line) / 2, (line[1] - line[0]) / 12))
        assert lines[-1] == pytest.approx((0.25 * ramp.mean(), 0.25 * np.mean((part - 0.5) * ramp)), abs=1e-6)
        out += np.clip(u - out, -p.rate * H, p.rate * H)
    assert max(abs(slope) for _, slope in lines) > 0.25 * 0.32 / 13  # of a whole sample of ramp: R h/12


def test_springs_that_slip_pull_alone_and_stiffly_right_after_a_reversal():
    p = parameters("hysteresis", 0.2)
    found = along("hysteresis", np.array([0.0, 1.0, 0.999]), p)
    assert found[2] - found[1] == pytest.approx(0.2 * 0.001)
    virgin = along("hysteresis", np.array([0.0, 0.1]), p)[1]  # r_j = 0.3 j/8: the first two slip
    w = np.arange(1, 9) ** -p.taper
    assert virgin == pytest.approx(-0.2 * float(w @ np.minimum(0.1, 0.3 * np.arange(1, 9) / 8)) / w.sum())


def test_friction_behind_a_slack_slides_lets_go_and_grips_again():
    """Back from 1 the last contact lets go after r, the first grips again after its r/8 and the slack, the last slides after 2 r and
    the slack."""
    p = SimpleNamespace(force=0.4, slack=0.2, reach=0.1)
    path = np.array([0.0, 1.0, 0.9 + 1e-3, 0.9 - 1e-9, 0.8, 0.7875 + 1e-9, 0.7875 - 1e-3, 0.6 + 1e-3, 0.6, 0.0])
    found = along("slack_friction", path, p)
    assert found[[1, 8, 9]] == pytest.approx([-0.4, 0.4, 0.4])
    assert found[[3, 4, 5]] == pytest.approx(0.0, abs=1e-7)
    assert -0.01 < found[2] < 0 < found[6] < 0.01 and 0.39 < found[7] < 0.4


def bent(z: float, step: float, b: float, r: float, n: float = 1.0) -> float:
    """z after the way `step` by dz = dd (1 - (b sgn(dd z) + 1 - b) |z/r|^n), integrated."""
    way = sign(step)

    def slope(_, y):
        return way * (1 - (b * sign(way * y) + 1 - b) * abs(y / r) ** n)

    return float(solve_ivp(slope, (0, abs(step)), [z], rtol=1e-9, atol=1e-11, max_step=0.05).y[0, -1])


@pytest.mark.parametrize("b", [0.55, 0.8, 1.0])
def test_bouc_and_wens_law_is_solved_exactly_over_a_sample_of_any_length(b):
    p = SimpleNamespace(stiffness=2.0, reach=0.3, loop=b)
    z, before, path = 0.0, 0.0, np.array([0.2, 0.9, 0.5, -0.6, -0.5, 0.05, 0.1])
    for d, force in zip(path, along("bouc_wen", path, p), strict=True):
        z, before = bent(z, d - before, b, p.reach), d
        assert force == pytest.approx(-2 * z, abs=1e-6)  # the switch at z = 0 within a step of the integration


@pytest.mark.parametrize(("b", "n"), [(0.55, 1.0), (0.8, 1.5), (1.0, 2.0), (0.7, 5.0), (1.0, 5.0)])
def test_bouc_and_wens_law_of_any_power_is_solved_to_a_thousandth_over_a_sample_of_any_length(b, n):
    """Among others from r a part of the way to zero, and from zero about r on, where the slope changes most within a step."""
    p = SimpleNamespace(stiffness=2.0, reach=0.3, loop=b, power=n)
    z, before = 0.0, 0.0
    path = np.array([0.36, 0.9, 0.8, 0.5, -0.6, -0.5, 0.05, 0.1, 0.13, 2.0, 1.87, 1.7, 1.8, 2.3, 2.16, 4.0, 2.0])
    for d, force in zip(path, along("bouc_wen_of_power", path, p), strict=True):
        z, before = bent(z, d - before, b, p.reach, n), d
        assert force == pytest.approx(-2 * z, abs=2 * 1e-3 * p.reach)
        assert abs(force) <= 2 * p.reach


def test_a_knee_driven_on_stays_at_its_reach_and_comes_back_to_it_from_beyond():
    y, way = ca.SX.sym("y"), ca.SX.sym("way")
    then = ca.Function("then", [y, way], [y + taken_up(y, way, ca.SX(2.0))])
    driven = then.mapaccum(1000)(0.0, np.full(1000, 5.0)).full().ravel()
    assert 0.9999 < driven[0] < 1 and np.all(driven <= 1)
    # dy/dw = 1 - y^2 from 1.1
    assert float(then(1.1, 0.7)) == pytest.approx(1 / np.tanh(0.7 + np.arctanh(1 / 1.1)), abs=5e-3)


def test_skewed_hysteresis_is_dahls_law_in_the_warped_displacement():
    p = SimpleNamespace(stiffness=2.0, reach=0.3, skew=0.6)
    z, before, path = 0.0, 0.0, np.array([0.2, 0.9, 0.5, -0.6, -0.5, 0.05, 0.1])
    for d, force in zip(path, along("asymmetric_hysteresis", path, p), strict=True):
        w = d + 0.6 * (np.hypot(d, 1) - 1)
        z, before = bent(z, w - before, 1.0, p.reach), w
        assert force == pytest.approx(-2 * z * (1 + 0.6 * d / np.hypot(d, 1)), abs=1e-6)


def settled(kind: str, p: SimpleNamespace, time: float, **held) -> dict[str, float]:
    """A law's memories after `time` [s] with everything held, from rest."""
    law = Effect.library[kind]("all", {})
    names = [state.name for state in law.states]

    def slope(_, y):
        rates = law.rates(law_inputs(**held, **dict(zip(names, y, strict=True))), p)
        return [float(rates[name]) for name in names]

    y = solve_ivp(slope, (0, time), np.zeros(len(names)), method="Radau", rtol=1e-9, atol=1e-12).y[:, -1]
    return dict(zip(names, y, strict=True))


def force(kind: str, p: SimpleNamespace, time: float, **held) -> float:
    return float(Effect.library[kind]("all", {}).term(law_inputs(**held, **settled(kind, p, time, **held)), p))


@pytest.mark.parametrize("v", [-2.0, -0.1, 0.01, 0.3, 5.0])
def test_dry_friction_that_slides_is_its_force_whatever_the_way_it_yields(v):
    """Coulomb f tanh(v/v_s); Stribeck f (1 + (b - 1) exp(-(v/v_s)^2)): against the motion, after many reaches."""
    p = SimpleNamespace(force=0.4, reach=0.02, smoothing=0.1)
    way = 40 * 0.02 / abs(v)
    assert force("coulomb", p, way, velocity=v) == pytest.approx(-0.4 * tanh(v / 0.1), rel=1e-6)
    p = SimpleNamespace(force=0.4, reach=0.02, skew=0.3)
    assert force("directional_friction", p, way, velocity=v) == pytest.approx(-0.4 * (sign(v) + 0.3), rel=1e-6)
    p = SimpleNamespace(force=0.4, reach=0.02, speed=0.2, breakaway=1.8)
    wanted = -0.4 * sign(v) * (1 + 0.8 * exp(-((v / 0.2) ** 2)))
    assert force("stribeck", p, way, velocity=v) == pytest.approx(wanted, rel=1e-6)


def test_dry_friction_builds_up_over_its_reach():
    """Dahl from rest: F = -f (1 - exp(-d/r)) for v well above v_s."""
    p = SimpleNamespace(force=0.4, reach=0.02, smoothing=1e-3)
    for share in (0.1, 1.0, 3.0):
        assert force("coulomb", p, share * 0.02, velocity=1.0) == pytest.approx(-0.4 * (1 - exp(-share)), rel=1e-6)


def test_what_comes_late_comes_whole():
    """Long after a step: creep g, the filter's reading the thing read, heat and lag what they are told."""
    held = {"value": 0.7, "displacement": 0.7, "velocity": 0.0}
    assert force("creep", parameters("creep", 0.2), 60.0, **held) == pytest.approx(0.2 * 0.7)
    for kind in ("low_pass", "thermal_lag", "second_pole", "resonance"):
        assert force(kind, parameters(kind, 1.0), 60.0, **held) == pytest.approx(0.0, abs=1e-8)


def test_creep_in_decades_is_a_step_of_its_gain_a_decade():
    p = SimpleNamespace(gain=0.05, tau=0.01, decades=4.0)
    at = [force("log_creep", p, t, value=2.0) for t in (0.1, 1.0)]
    assert at[1] - at[0] == pytest.approx(2.0 * 0.05, rel=0.03)  # within 3 % of a decade's


def test_a_bristle_stands_where_it_is_at_standstill():
    """0/0 is kept away: no force grows or fades while nothing moves."""
    p = SimpleNamespace(force=0.4, reach=0.02, smoothing=0.1)
    held = law_inputs(velocity=0.0, z=0.6)
    rate = float(Effect.library["coulomb"]("all", {}).rates(held, p)["z"])
    assert rate == pytest.approx(-0.1 * 0.6 / 0.02, rel=1e-9)  # v_s/r: a contact loaded for long creeps


def test_the_force_of_dry_friction_at_standstill_is_whatever_holds_the_stage():
    assert {kind for kind, law in Effect.library.items() if law.set_valued} == {
        "coulomb",
        "coulomb_above",
        "coulomb_after",
        "coulomb_below",
        "coulomb_on_stretch",
        "directional_friction",
        "friction_of_load",
        "stribeck",
        "stribeck_above",
        "stribeck_after",
        "stribeck_below",
    }


def test_no_record_has_a_clock_of_its_own():
    """Friction from a moment on: how far it is bent when a record begins is not known, what time it is then is."""
    text = "force = '0.2 N'\nreach = '3 um'\nsmoothing = '10 um/s'\nmoment = '1 s'\nrise = '10 ms'"
    device = validate(Device.library["axis"], tomllib.loads(AXIS_FILE.read_text() + EVENT.format(text)), "device")
    model = build_model(device)
    assert len(model.clocks) == 1 and not set(model.clocks) & {*model.bristles, *model.free_memories}
    assert len(model.bristles) == 1 and set(model.bristles) <= set(model.free_memories)
