"""Every law's numbers: its term and rates against the equation of its record written out in numpy, its memory against what the
record says that it does."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE
from numpy import abs, cos, cross, exp, sign, sin, sqrt, tanh
from scipy.integrate import solve_ivp
from scipy.interpolate import BSpline

import ctrlgen.effects  # noqa: F401  fills the library
from ctrlgen import load_device
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record

ROUNDING = 1e-12
COUNT, H = 6, 0.01
TWO_PI = 2 * np.pi
EVENT = {"moment": 0.7, "rise": 0.4}


def event(s, p):
    """From 0 to 1, half at the moment; a logistic curve of scale T/(2 pi)."""
    return 1 / (1 + exp(-(s.t - p.moment) * TWO_PI / p.rise))


def turned(a: int, b: int):
    """What a rotation by p.angle from axis a toward b adds to component s.index."""

    def change(s, p):
        R = np.eye(3)
        R[[a, b], [a, b]], R[a, b], R[b, a] = cos(p.angle), -sin(p.angle), sin(p.angle)
        return np.concatenate([R @ s.all[:3], R @ s.all[3:]])[s.index] - s.value

    return change


def dead(s, p):
    e = np.hypot(p.rounding * p.width, 1e-6 * s.scale)
    return -(np.hypot(s.value + p.width, e) - np.hypot(s.value - p.width, e)) / 2


def clipped(s, p):
    e = p.level / 200
    return p.share * ((np.hypot(s.value + p.level, e) - np.hypot(s.value - p.level, e)) / 2 - s.value)


def gripping(s, p):
    """Springs that slip at r_j, each behind half the slack to either side."""
    r = p.reach * np.arange(1, 9) / 8
    plays = np.array([getattr(s, f"play{j}") for j in range(1, 9)]) + np.clip(s.start, -1, 1) * (r + p.slack / 2)
    e = s.displacement - plays
    return -p.force * np.sum(sign(e) * np.maximum(abs(e) - p.slack / 2, 0)) / r.sum()


WEIGHTS = {f"c{j}": float(np.cos(3 * j)) for j in range(1, 18)}


def bends(share):
    """Cubic B-splines on knots a fourteenth apart, held beyond 0 and 1."""
    knots = (np.arange(21) - 3) / 14
    return float(BSpline(knots, list(WEIGHTS.values()), 3)(np.clip(share, 0, 1)))


def remembered(s, p):
    j = np.arange(1, 9)
    lag = s.displacements[s.partner] - np.array([getattr(s, f"play{k}") for k in j])
    return p.size * float(np.array([WEIGHTS[f"c{k}"] for k in j]) @ (lag / (0.3 * j / 8)))


def stop(s, p):
    side, e = sign(p.gap), 1e-3 * s.travel
    x = max(side * (s.displacement - p.gap), 0.0)
    return -side * p.stiffness * x**2 / (x + e) * (1 + x / e) ** (p.power - 1)


def logarithmic(s, p):
    return p.gain / 2 * sum(min(max(2 * p.decades - j, 0), 1) * getattr(s, f"z{j}") for j in range(9))


def weighted(s, p, here):
    """sum_j w_j (here - play_j); each play is counted from where it began, at a share of its radius."""
    j = np.arange(1, 9)
    w, began = j**-p.taper, np.clip(s.start, -1, 1) * p.reach * j / 8
    return float(w @ (here - began - [getattr(s, f"play{k}") for k in j])) / w.sum()


def risen(drive):
    """What plays of reach 0.3 and taper 0.5 come to together once a drive has risen to `drive`."""
    j = np.arange(1, 9)
    return drive - float(j**-0.5 @ np.minimum(0.3 * j / 8, drive)) / (j**-0.5).sum()


def dahl_rate(s, p):
    v = s.velocity / p.smoothing
    return s.velocity * (1 - s.z / tanh(v)) / p.reach


def lugre_rate(s, p):
    g = 1 + (p.breakaway - 1) * exp(-((s.velocity / p.speed) ** 2))
    return (s.velocity - abs(s.velocity) * s.z / g) / p.reach


def second_mass(s, p):
    w, m = TWO_PI * p.frequency, p.stiffness / (TWO_PI * p.frequency) ** 2
    return p.stiffness * (s.q - s.displacement) + 2 * p.damping * w * m * (w * s.p - s.velocity)


def second_mass_rates(s, p):
    w = TWO_PI * p.frequency
    return {
        "q": w * s.p,
        "p": (w**2 * (s.displacement - s.q) + 2 * p.damping * w * (s.velocity - w * s.p)) / w,
    }


# kind: shape parameters, term, rates where it has some
LAWS = {
    "abbe_arm": ({}, lambda s, p: p.arm * s.all[s.partner]),
    "asymmetric_gain": ({}, lambda s, p: p.gain * abs(s.value)),
    "asymmetric_hysteresis": (
        {"reach": 0.3, "skew": 0.6},
        lambda s, p: -p.stiffness * s.z * (1 + p.skew * s.displacement / np.hypot(s.displacement, s.travel)),
    ),
    "asymmetric_viscous": ({}, lambda s, p: -abs(p.damping) * max(s.velocity * sign(p.damping), 0) * sign(p.damping)),
    "backlash": ({}, lambda s, p: 0.999 * (s.w + s.start * p.gap / 2 - s.displacement)),
    "bouc_wen": ({"reach": 0.3, "loop": 0.8}, lambda s, p: -p.stiffness * s.z),
    "bow": ({}, lambda s, p: p.curvature * s.value**2),
    "clock_offset": None,  # below: it shifts the recorded drive
    "coulomb": ({"reach": 0.02, "smoothing": 0.3}, lambda s, p: -p.force * s.z, lambda s, p: {"z": dahl_rate(s, p)}),
    "butterfly": (
        {"linear": 0.6, "reach": 0.3, "taper": 0.5},
        lambda s, p: p.share * (((s.value - weighted(s, p, s.value)) / risen(s.scale)) ** 2 * s.scale - 0.6 * s.value),
    ),
    "coupling": ({}, lambda s, p: p.gain * s.all[s.partner]),
    "damping_coupling": ({}, lambda s, p: -p.damping * s.velocities[s.partner]),
    "inertia_coupling": ({}, lambda s, p: -p.inertia * s.accelerations[s.partner]),
    "one_sided_stiffening": ({}, lambda s, p: -p.k2 * s.displacement**2),
    "stiffness_coupling": ({}, lambda s, p: -p.stiffness * s.displacements[s.partner]),
    "creep": (
        {"tau": 0.3, "slow": 0.2},
        lambda s, p: p.gain * (0.8 * s.z + 0.2 * s.w),
        lambda s, p: {"z": (s.value - s.z) / 0.3, "w": (s.value - s.w) / 1.2},
    ),
    "cubic_sensor": ({}, lambda s, p: p.curvature * s.value**3),
    "cyclic": ({"period": 0.4, "phase": 0.9}, lambda s, p: p.amplitude * sin(TWO_PI * s.value / 0.4 + 0.9)),
    "dead_zone": ({"rounding": 0.3}, dead),
    "degradation": ({"levels_off": 3.0}, lambda s, p: -p.rate * 3.0 * (1 - exp(-s.t / 3.0)) * s.value),
    "delay": None,  # below: exact for the polynomials that it interpolates by
    "drift": ({}, lambda s, p: p.rate * s.t),
    "drive_gain": ({}, lambda s, p: p.gain * s.value),
    "drive_hysteresis": ({"reach": 0.3, "taper": 0.5}, lambda s, p: -p.share * weighted(s, p, s.value)),
    "directional_friction": (
        {"skew": -0.4, "reach": 0.02}, lambda s, p: -p.force * (s.z - 0.4 * s.w),
        lambda s, p: {"z": (s.velocity - abs(s.velocity) * s.z) / 0.02, "w": abs(s.velocity) * (1 - s.w) / 0.02},
    ),
    "displacement_bouc_wen": ({"reach": 0.3, "loop": 0.8}, lambda s, p: -p.share * s.z),
    "displacement_hysteresis": (
        {"reach": 0.3, "taper": 0.5, "reversible": 0.7},
        lambda s, p: -p.share * (weighted(s, p, s.value) - 0.7 * s.value),
    ),
    "drive_offset": ({}, lambda s, p: p.offset),
    "empirical_history": ({"reach": 0.3, **WEIGHTS}, remembered),
    "empirical_position": (
        {"low": -0.4, "width": 0.9, **WEIGHTS}, lambda s, p: p.size * bends((s.displacements[s.partner] + 0.4) / 0.9),
    ),
    "empirical_speed": (
        {"speed": 0.3, **WEIGHTS}, lambda s, p: p.size * bends((1 + s.velocities[s.partner] / np.hypot(s.velocities[s.partner], 0.3)) / 2),
    ),
    "end_stop": ({"gap": -0.4, "power": 1.5}, stop),
    "expansion": ({}, lambda s, p: p.slope * (s.state - s.rest) * s.value),
    "finite_rotation": ({}, lambda s, p: p.share * s.second_order_kinematics()[s.index]),
    "force_step": (EVENT, lambda s, p: p.force * event(s, p)),
    "frame_rotation_x": ({}, turned(1, 2)),
    "frame_rotation_y": ({}, turned(2, 0)),
    "frame_rotation_z": ({}, turned(0, 1)),
    "heat_crosstalk": ({}, lambda s, p: p.share * (s.all.sum() - s.value)),
    "heater_resistance": ({}, lambda s, p: s.value / (1 + p.slope * (s.state - s.rest)) - s.value),
    "home_offset": ({}, lambda s, p: p.offset),
    "hysteresis": ({"reach": 0.3, "taper": 0.5}, lambda s, p: -p.stiffness * weighted(s, p, s.displacement)),
    "lever_ratio": ({}, lambda s, p: p.gain * s.value),
    "link_compliance": ({}, lambda s, p: p.tilt * s.all[s.partner]),
    "link_load": ({}, lambda s, p: p.share * s.tangent_compliance()[s.index]),
    "log_creep": (
        {"tau": 0.1, "decades": 3.25}, logarithmic,
        lambda s, p: {f"z{j}": (s.value - getattr(s, f"z{j}")) / (0.1 * sqrt(10.0) ** j) for j in range(9)},
    ),
    "lost_beams": (EVENT, lambda s, p: -p.share * s.value * event(s, p)),
    "lost_motion": ({}, lambda s, p: -p.compliance * s.force),
    "low_pass": (
        {"tau": 0.06, "damping": 0.7}, lambda s, p: p.share * (s.w - s.value),
        lambda s, p: {"w": s.v / 0.06, "v": (s.value - s.w - 1.4 * s.v) / 0.06},
    ),
    "payload": ({"lean": 0.4}, lambda s, p: p.share * (sin(s.value + 0.4) - sin(0.4))),
    "quadratic_damping": ({}, lambda s, p: -p.damping * s.velocity**2 * sign(s.velocity)),
    "quantisation": ({"quantum": 0.03}, lambda s, p: p.share * (0.03 * round(s.value / 0.03) - s.value)),
    "raised_point": (
        {}, lambda s, p: cross(s.all[:3], cross(s.all[:3], [0, 0, p.height]))[s.index - 3] / 2,
    ),
    "resonance": ({"frequency": 8.0, "damping": 0.2}, second_mass, second_mass_rates),
    "reversed": ({}, lambda s, p: -2 * p.share * s.value),
    "saturation": ({"level": 0.4}, clipped),
    "screw_motion": ({}, lambda s, p: p.share * cross(s.all[:3], s.all[3:])[s.index - 3] / 2),
    "second_pole": ({"tau": 0.3}, lambda s, p: p.share * (s.w - s.value), lambda s, p: {"w": (s.value - s.w) / 0.3}),
    "sensor_gain": ({}, lambda s, p: p.gain * s.value),
    "sensor_step": (EVENT, lambda s, p: p.offset * event(s, p)),
    "stiffening": ({}, lambda s, p: -p.k3 * s.displacement**3),
    "stiffness": ({}, lambda s, p: -p.stiffness * s.displacement),
    "stitching_error": (
        {"position": 0.2, "width": 0.3}, lambda s, p: p.offset / (1 + exp(-4 * (s.value - 0.2) / 0.3)),
    ),
    "stribeck": (
        {"breakaway": 1.8, "speed": 0.5, "reach": 0.02}, lambda s, p: -p.force * s.z,
        lambda s, p: {"z": lugre_rate(s, p)},
    ),
    "slack_friction": ({"slack": 0.2, "reach": 0.3}, gripping),
    "stuck": ({"level": 0.2}, lambda s, p: -p.share * (s.value - 0.2)),
    "swapped": ({}, lambda s, p: p.share * (s.all[s.partner] - s.value)),
    "temperature_sensitivity": ({"reference": 0.2}, lambda s, p: p.slope * (s.ambient - 0.2)),
    "thermal_lag": (
        {"tau": 0.3, "second": 0.2}, lambda s, p: p.share * (s.x - s.value),
        lambda s, p: {"v": (s.value - s.v) / 0.3, "w": (s.v - s.w) / 0.06, "x": (s.w - s.x) / 0.0216},
    ),
    "zero_per_record": ({}, lambda s, p: p.share * s.zero),
    "vibration": ({"frequency": 3.0, "phase": 0.9}, lambda s, p: p.amplitude * sin(TWO_PI * 3 * s.t + 0.9)),
}  # fmt: skip
AMPLITUDES = {"heater_resistance": 0.01, "expansion": 0.01}  # of a share, an angle, a gain: 0.3


def test_every_law_of_the_library_is_written_out_here():
    assert set(LAWS) == set(Effect.library)


def signals(rng: np.random.Generator, kind: str) -> SimpleNamespace:
    """What a law may read at component 4 of six, everything of order one; memories at random."""
    every, other = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6)
    index = 4 if Effect.library[kind].channel_unit != "rad" else 1
    names = [state.name for state in Effect.library[kind].states]
    return SimpleNamespace(
        value=every[index], rate=None, second_rate=None, all=every, index=index, partner=5 - index, ambient=rng.uniform(-3, 3),
        sample_time=H, rest=0.3, state=rng.uniform(0.5, 3), scale=1.3, travel=0.7,
        second_order_kinematics=lambda: other, tangent_compliance=lambda: other, displacement=rng.uniform(-1, 1), displacements=every,
        velocities=other, accelerations=other * every, velocity=rng.uniform(-1, 1), force=rng.uniform(-1, 1),
        **dict(zip(names, rng.uniform(-1, 1, len(names)), strict=True)),
    )  # fmt: skip


def parameters(kind: str, amplitude: float | None = None) -> SimpleNamespace:
    size = AMPLITUDES.get(kind, 0.3) if amplitude is None else amplitude
    return SimpleNamespace(**LAWS[kind][0], **{Effect.library[kind].amplitude().name: size})


def symbolic(s: SimpleNamespace) -> SimpleNamespace:
    """The same with vectors as the laws get them."""
    return SimpleNamespace(**{k: ca.DM(v) if isinstance(v, np.ndarray) else v for k, v in vars(s).items()})


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


def along(kind: str, path: np.ndarray, p: SimpleNamespace, velocity: float | None = None) -> np.ndarray:
    """The term of a law of samples at every displacement (or value) of `path`, from zero."""
    law = Effect.library[kind]("all", {})
    memory, found = {state.name: 0.0 for state in law.states}, []
    for d in path:
        s = SimpleNamespace(
            value=d, displacement=d, velocity=velocity, rate=None, second_rate=None, sample_time=H, travel=1.0, scale=1.0, **memory
        )  # fmt: skip
        new = {k: float(ca.DM(v)) for k, v in law.update(s, p).items()}
        memory |= new
        s.__dict__.update(new)
        found.append(float(ca.DM(law.term(s, p))))
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


def bent(z: float, step: float, b: float, r: float) -> float:
    """z after the way `step` by dz = dd (1 - (b sgn(dd z) + 1 - b) |z|/r), integrated."""
    way = sign(step)

    def slope(_, y):
        return way * (1 - (b * sign(way * y) + 1 - b) * abs(y) / r)

    return float(solve_ivp(slope, (0, abs(step)), [z], rtol=1e-10, atol=1e-13, max_step=1e-3).y[0, -1])


@pytest.mark.parametrize("b", [0.55, 0.8, 1.0])
def test_bouc_and_wens_law_is_solved_exactly_over_a_sample_of_any_length(b):
    p = SimpleNamespace(stiffness=2.0, reach=0.3, loop=b)
    z, before, path = 0.0, 0.0, np.array([0.2, 0.9, 0.5, -0.6, -0.5, 0.05, 0.1])
    for d, force in zip(path, along("bouc_wen", path, p), strict=True):
        z, before = bent(z, d - before, b, p.reach), d
        assert force == pytest.approx(-2 * z, abs=1e-6)  # the switch at z = 0 within a step of the integration


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
        rates = law.rates(SimpleNamespace(**held, **dict(zip(names, y, strict=True))), p)
        return [float(rates[name]) for name in names]

    y = solve_ivp(slope, (0, time), np.zeros(len(names)), method="Radau", rtol=1e-9, atol=1e-12).y[:, -1]
    return dict(zip(names, y, strict=True))


def force(kind: str, p: SimpleNamespace, time: float, **held) -> float:
    return float(Effect.library[kind]("all", {}).term(SimpleNamespace(**held, **settled(kind, p, time, **held)), p))


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


SHARES = np.array([0.2, 0.5, 0.9, 1.0, 1.7, 2.5, 4.3, 5.0])


def read_late(y, samples: np.ndarray, h: float, slopes: bool) -> np.ndarray:
    """What `delay` makes of the polynomial y at 9 h, for delays of `samples` h."""
    law = Effect.library["delay"]("all", {})
    memory = {state.name: 0.0 for state in law.states}
    for k in range(10):
        s = SimpleNamespace(value=y(k * h), sample_time=h, rate=None, second_rate=None, **memory)
        if slopes:
            s.rate, s.second_rate = y.deriv()(k * h), y.deriv(2)(k * h)
        memory |= law.update(s, None)
        s.__dict__.update(memory)
    return np.array([s.value + float(ca.DM(law.term(s, SimpleNamespace(delay=D * h)))) for D in samples])


def test_a_delay_is_exact_for_polynomials_of_fourth_degree_where_the_motion_gives_slopes(rng):
    y = np.polynomial.Polynomial(rng.uniform(-1, 1, 5))
    assert read_late(y, SHARES, 0.3, True) == pytest.approx(y((9 - SHARES) * 0.3), rel=1e-12)


def test_a_delay_without_slopes_is_exact_for_parabolas_beyond_a_sample_and_lines_within_it(rng):
    y = np.polynomial.Polynomial(rng.uniform(-1, 1, 3))
    older = SHARES[SHARES >= 1]
    assert read_late(y, older, 0.3, False)[1:] == pytest.approx(y((9 - older[1:]) * 0.3), rel=1e-12)
    line = np.polynomial.Polynomial(rng.uniform(-1, 1, 2))
    assert read_late(line, SHARES, 0.3, False) == pytest.approx(line((9 - SHARES) * 0.3), rel=1e-12)


def shifted(drive, tau: float, linear: bool) -> np.ndarray:
    """The drive (n, 1) of a record of 50 samples of 10 ms under an offset of the clocks of `tau` [s]."""
    time = 0.3 + H * np.arange(50)
    u, y = drive(time)[:, None], np.zeros((50, 1))
    given = Record("fit", "fit", time, H, u, y, linear, None, np.ones(y.shape, bool))
    simulator = Simulator(load_device(AXIS_FILE), (), ("reading.axis",), H, linear)
    assert simulator.aligned(given, np.zeros(0)) is given
    clocks = Hypothesis("clock_offset", "sensor:axis", "axis")
    stated = Structure(load_device(AXIS_FILE)).with_cause(clocks, {"offset": tau}).device_with_causes
    found = Simulator(stated, (), ("reading.axis",), H, linear).aligned(given, np.zeros(0)).drive
    free = Simulator(stated, ("effect[0].offset",), ("reading.axis",), H, linear)
    assert free.aligned(given, np.array([tau])).drive == pytest.approx(found, rel=1e-12)
    return found[:, 0]


@pytest.mark.parametrize("tau", [0.0047, 0.02, 0.033])
def test_clocks_that_do_not_agree_shift_the_drive(tau, rng):
    """Exact for a cubic of a drive that is linear between samples, and for the mean over a sample of one that is held."""
    cubic, line = (np.polynomial.Polynomial(rng.uniform(-1, 1, k)) for k in (4, 2))
    at = 0.3 + H * np.arange(50) + tau
    inside = (at >= 0.3) & (at <= 0.3 + 49 * H)
    assert shifted(cubic, tau, True)[inside] == pytest.approx(cubic(at)[inside], rel=1e-9)
    assert shifted(line, tau, False)[inside] == pytest.approx(line(at)[inside], rel=1e-12)
    beyond = shifted(line, tau, False)[~inside]
    assert beyond == pytest.approx(np.full(len(beyond), line(0.3 + 49 * H)))


def test_a_delay_of_more_than_five_samples_counts_as_five(rng):
    y = np.polynomial.Polynomial(rng.uniform(-1, 1, 5))
    assert read_late(y, np.array([7.0]), 0.3, True) == pytest.approx(y(4 * 0.3), rel=1e-12)


def test_contacts_count_from_where_they_touch():
    """Far beyond its corner e a spring is k (d - gap) but for e; Hertz's is e^-(1/2) k x^(3/2)."""
    law, s = Effect.library["end_stop"]("all", {}), SimpleNamespace(displacement=1.4, travel=1.0)
    spring = law.term(s, SimpleNamespace(stiffness=2.0, gap=0.4, power=1.0))
    assert float(spring) == pytest.approx(-2.0, rel=2e-3)  # e is a thousandth
    hertz = law.term(s, SimpleNamespace(stiffness=2.0, gap=0.4, power=1.5))
    assert float(hertz) == pytest.approx(-2.0 / sqrt(1e-3), rel=2e-3)
    assert float(law.term(s, SimpleNamespace(stiffness=2.0, gap=1.5, power=1.5))) == 0.0


def test_creep_in_decades_is_a_step_of_its_gain_a_decade():
    p = SimpleNamespace(gain=0.05, tau=0.01, decades=4.0)
    at = [force("log_creep", p, t, value=2.0) for t in (0.1, 1.0)]
    assert at[1] - at[0] == pytest.approx(2.0 * 0.05, rel=0.03)  # within 3 % of a decade's


def test_a_bristle_stands_where_it_is_at_standstill():
    """0/0 is kept away: no force grows or fades while nothing moves."""
    p = SimpleNamespace(force=0.4, reach=0.02, smoothing=0.1)
    held = SimpleNamespace(velocity=0.0, z=0.6)
    rate = float(Effect.library["coulomb"]("all", {}).rates(held, p)["z"])
    assert rate == pytest.approx(-0.1 * 0.6 / 0.02, rel=1e-9)  # v_s/r: a contact loaded for long creeps


@pytest.mark.parametrize("way", [0.1, 1.0])
def test_a_rise_is_half_over_at_its_moment(way):
    """4 % at its begin, 96 % at its end."""
    law = Effect.library["sensor_step"]("all", {})
    p = SimpleNamespace(offset=1.0, moment=3.0, rise=way)
    at = [float(law.term(SimpleNamespace(t=t), p)) for t in (3.0 - way / 2, 3.0, 3.0 + way / 2)]
    assert at == pytest.approx([0.0414, 0.5, 0.9586], abs=1e-4)  # (1 -+ tanh(pi/2))/2, to the digits written


@pytest.mark.parametrize(
    "first, then, why",
    [
        ("bow", "cyclic", "the fringes of a bent scale are counted along the bent scale"),
        ("cubic_sensor", "cyclic", "the same"),
        ("drift", "cyclic", "what drifts moves the target along the fringes"),
        ("temperature_sensitivity", "cyclic", "the same"),
        ("cyclic", "low_pass", "the readout follows the fringe signal"),
        ("low_pass", "delay", "a filtered reading is sent"),
        ("delay", "quantisation", "digits are what arrives"),
        ("delay", "stuck", "what no longer changes is what arrives"),
    ],
)
def test_a_reading_passes_the_laws_in_the_order_of_its_chain(first, then, why):
    assert Effect.library[first].order < Effect.library[then].order, why


def test_the_force_of_dry_friction_at_standstill_is_whatever_holds_the_stage():
    assert {kind for kind, law in Effect.library.items() if law.set_valued} == {
        "coulomb",
        "directional_friction",
        "stribeck",
    }


def test_an_event_is_looked_for_on_either_side_of_the_zero_of_time():
    events = [p for law in Effect.library.values() for p in law.params if p.name == "moment"]
    assert events and all(p.bounds[0] == -p.bounds[1] for p in events)
