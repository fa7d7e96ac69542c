"""Every law is recovered from a record that another simulator made: here those that the battery does not plant.

The simulators know the law by its definition, not by its expression: exact rotations, ramps, plays by the hundred, forces
in steps of a tenth of a sample.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest
from axis_records import AXIS, NOISE, SETTLING, H, move, record
from conftest import DEVICE, SCENARIOS
from misfits import recovered
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from scipy.stats import norm

import ctrlgen.effects  # noqa: F401
from battery import laws
from battery.hexapod_cases import FAULTS
from battery.plant_hexapod import Faults, Hexapod
from ctrlgen import load_device
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.effects import Effect
from ctrlgen.estimation import priors
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.recordings.recording import Recording

N = 2500
COMPONENTS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
TURNED, SHIFTED = 1e-6, 5e-9  # noise of a pose [rad, m]
ALSO = {
    "softening": "stiffening",
    "frame_turn": "frame_rotation_z",
    "step": "force_step",
    "viscous": "asymmetric_viscous",
}  # the battery's names for them
IN_THE_LOOP = {"link_load"}  # found on the finite-rotation plant of tests/test_loop.py
SMOOTHERS = {"empirical_history", "empirical_position", "empirical_speed"}  # written in tests/test_empirical_terms.py


@dataclass(frozen=True)
class Planted:
    """`truth` by parameter [SI]; `within` of itself, where the simulator's form is another than the law's, beside the noise."""

    at: str
    truth: dict[str, float]
    of: str | None = None
    within: dict[str, float] = field(default_factory=dict)


def given(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A drive to fit and one to hold out [V]."""
    t = H * np.arange(n)
    fit = 1.5 * np.sin(2 * np.pi * 2.3 * t) + 0.3 * np.sin(2 * np.pi * 13.1 * t + 1) + 0.2 * np.sin(2 * np.pi * 41 * t)
    return fit, 1.3 * np.sin(2 * np.pi * 1.7 * t)


# Of one axis: drive [V] and time [s] -> position [m]


def asymmetric_gain(u, t):
    return move(np.where(u > 0, 1.03 * u, 0.97 * u))


def reversed(u, t):
    return move(-u)


def drive_offset(u, t):
    return move(u + 0.05)


def cubic_sensor(u, t):
    y = move(u)
    return y + 2e6 * y**3


def stitching_error(u, t):
    """With the slope of 0.4 um on 2 um in its middle."""
    y = move(u)
    return y + 4e-7 * norm.cdf(np.sqrt(2 * np.pi) * (y - 2e-5) / 2e-6)


def sensor_step(u, t):
    return move(u) + 2e-7 * np.clip((t - 1.1) / 0.02 + 0.5, 0, 1)


def drive_hysteresis(u, t):
    """Two hundred plays, all alike in weight, where the law has eight: its numbers count in eighths."""
    radii = 0.4 * (np.arange(200) + 0.5) / 200
    play, out = np.zeros(200), []
    for volts in u:
        play = np.clip(play, volts - radii, volts + radii)
        out.append(volts + 0.1 * (play.mean() - volts))
    return move(np.array(out))


def asymmetric_hysteresis(u, t):
    """Dahl's friction of 2e4 N/m and 10 um, in the displacement warped by 0.5, in steps of a tenth of a sample."""
    L, r, a, k = AXIS.mechanics.stroke.si, 1e-5, 0.5, 2e4

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        slope = 1 + a * q / np.hypot(q, L)
        dw = slope * (q - before)
        z += dw * (1 - np.sign(dw) * z / r)
        return -k * z * slope, (z, q)

    return move(u, force)


def one_sided_stiffening(u, t):
    """2e8 N/m^2 beside a stiffness of 2e5 N/m: 10 % more of it at 100 um on the one side, less on the other."""
    return move(u, lambda time, q, v, memory: (-2e8 * (q + v * H / 20) ** 2, memory))  # in the middle of a step


def butterfly(u, t):
    """All of it, beside a tenth less of the drive, by the square of the polarisation of two hundred plays."""
    radii, limit = 0.4 * (np.arange(200) + 0.5) / 200, AXIS.actuator.drive_limit.si
    play, out = np.zeros(200), []
    for volts in u:
        play = np.clip(play, volts - radii, volts + radii)
        out.append(0.9 * volts + play.mean() ** 2 / limit)
    return move(np.array(out))


def directional_friction(u, t):
    """0.9 N forward and 0.5 N backward, built up over 3 um, in steps of a tenth of a sample."""

    def force(time, q, v, memory):
        z, way = memory or (0.0, 0.0)
        step = v * H / 10
        z, way = z + (step - abs(step) * z) / 3e-6, way + abs(step)
        return -0.7 * z - 0.2 * (1 - np.exp(-way / 3e-6)), (z, way)

    return move(u, force)


def bouc_wen(u, t):
    """F = -k z, dz = dd (1 - (beta sgn(dd z) + gamma)|z|), beta = 8e4/m, gamma = 2e4/m, in steps of a tenth of a sample."""

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        step = q - before
        z += step * (1 - (8e4 * np.sign(step * z) + 2e4) * abs(z))
        return -2e4 * z, (z, q)

    return move(u, force)


def slack_friction(u, t):
    """Eight sliders that yield at 1/36 ... 8/36 of 0.8 N after 1 ... 8 um, each behind a slack of 20 um, in steps of a tenth of a
    sample: a slider is dragged while its spring would carry more than it holds."""
    yields, half = 1e-6 * np.arange(1, 9), 1e-5
    slider = np.zeros(8)

    def force(time, q, v, memory):
        gap = q - slider
        bent = np.sign(gap) * np.maximum(np.abs(gap) - half, 0)
        dragged = np.abs(bent) > yields
        slider[dragged] += (bent - np.sign(bent) * yields)[dragged]
        bent = np.clip(bent, -yields, yields)
        return -0.8 * bent.sum() / yields.sum(), memory

    return move(u, force)


ON_AXIS = {
    asymmetric_gain: Planted("actuator:axis", {"gain": 0.03}),
    reversed: Planted("actuator:axis", {}),
    drive_offset: Planted("actuator:axis", {"offset": 0.05}),
    cubic_sensor: Planted("sensor:axis", {"curvature": 2e6}),
    stitching_error: Planted("sensor:axis", {"offset": 4e-7, "position": 2e-5, "width": 2e-6}, within={"width": 0.1}),
    sensor_step: Planted("disturbance:axis", {"offset": 2e-7, "moment": 1.1, "rise": 0.02}, within={"rise": 0.1}),
    butterfly: Planted(
        "actuator:axis", {"share": 1.0, "linear": 0.1, "reach": 0.4}, within={"share": 0.1, "linear": 0.2, "reach": 0.1}
    ),
    directional_friction: Planted(
        "stage:axis", {"force": 0.7, "skew": 2 / 7, "reach": 3e-6}, within={"force": 0.02, "skew": 0.05, "reach": 0.05}
    ),
    one_sided_stiffening: Planted("stage:axis", {"k2": 2e8}, within={"k2": 0.02}),
    slack_friction: Planted(
        "stage:axis", {"force": 0.8, "slack": 2e-5, "reach": 8e-6}, within={"force": 0.02, "slack": 0.02, "reach": 0.05}
    ),
    drive_hysteresis: Planted("actuator:axis", {"share": 0.1, "reach": 0.4}, within={"share": 0.1, "reach": 0.1}),
    bouc_wen: Planted(
        "stage:axis", {"stiffness": 2e4, "reach": 1e-5, "loop": 0.8}, within={"stiffness": 0.03, "reach": 0.03, "loop": 0.05}
    ),
    asymmetric_hysteresis: Planted(
        "stage:axis", {"stiffness": 2e4, "reach": 1e-5, "skew": 0.5}, within={"stiffness": 0.03, "reach": 0.03, "skew": 0.1}
    ),
}  # fmt: skip


# Of settled poses: heater powers [W] -> poses (theta; delta) [rad, um] of S1's hexapod, assembled as one structure


def posed(change):
    """A law of the pose alone."""
    return lambda u: change(Hexapod().settled(u))


def at(k, value):
    out = np.zeros(6)
    out[k] = value
    return out


def rotated(axis, angle):
    """Components in a frame turned about an axis."""
    R = Rotation.from_rotvec(angle * np.eye(3)["xyz".index(axis)]).as_matrix()
    return posed(lambda p: np.hstack([p[:, :3] @ R.T, p[:, 3:] @ R.T]))


def along_a_screw(p):
    """The translation of exp(twist)."""
    out = p.copy()
    for row, (theta, delta) in enumerate(zip(p[:, :3], p[:, 3:], strict=True)):
        w = np.array([[0, -theta[2], theta[1]], [theta[2], 0, -theta[0]], [-theta[1], theta[0], 0]])
        twist = np.zeros((4, 4))
        twist[:3, :3], twist[:3, 3] = w, delta
        out[row, 3:] = expm(twist)[:3, 3]
    return out


def raised(p, height=20e3):
    """The second order of where a point 20 mm above goes: beyond theta x h."""
    h = np.array([0, 0, height])
    go = Rotation.from_rotvec(p[:, :3]).apply(h) - h - np.cross(p[:, :3], h)
    return np.hstack([p[:, :3], p[:, 3:] + go])


def carried(u):
    """The third stage carries the platform 2 % further than it goes."""
    plant = Hexapod()
    return plant.pose(plant.displacement(plant.temperature(u)) * (1 + at(2, 0.02)))


def losing(u):
    """Every lever bends by 5 um/N times the bar's force, S1 eq. (4)."""
    plant = Hexapod()
    a, T = plant.n.actuator, plant.temperature(u)
    F = 2 * a.beams * (a.expansion + a.expansion_slope * T) * (T - a.ambient)
    F = F * a.young * a.beam_width * a.thickness * np.sin(a.beam_angle)
    return plant.pose(plant.displacement(T) - 5.0 * F)


ON_HEXAPOD = {
    "abbe_arm": (posed(lambda p: p + np.outer(p[:, 1] * 2e3, at(3, 1))), Planted("sensor:delta_x", {"arm": 2e-3}, "theta_y")),
    "link_compliance": (posed(lambda p: p + np.outer(p[:, 4] * 2e-5, at(0, 1))), Planted("mechanism:theta_x", {"tilt": 20.0}, "delta_y")),
    "frame_rotation_x": (rotated("x", 0.01), Planted("mechanism:all", {"angle": 0.01})),
    "frame_rotation_y": (rotated("y", -0.01), Planted("mechanism:all", {"angle": -0.01})),
    "screw_motion": (posed(along_a_screw), Planted("mechanism:all", {"share": 1.0})),
    "raised_point": (posed(raised), Planted("mechanism:all", {"height": 0.02})),
    "coupling": (lambda u: Hexapod(faults=Faults(coupling=at(2, 0.01))).settled(u), Planted("stage:2X", {"gain": 0.01}, "2Y")),
    "lever_ratio": (carried, Planted("stage:2X", {"gain": 0.02})),
    "lost_motion": (losing, Planted("stage:all", {"compliance": 5e-6})),
    "heater_resistance": (
        lambda u: Hexapod(faults=Faults(resistance=5e-5), voltage=True).settled(np.sqrt(u * Hexapod().n.actuator.heater_resistance)),
        Planted("actuator:all", {"slope": 5e-5}),
    ),
}  # fmt: skip


def warmed(u, late=0.1, tau=0.05, dt=H / 10):
    """A tenth of every heater's power comes with another 50 ms of delay: readings a sample apart, ten steps between them."""
    fine = np.repeat(u, 10, axis=0)
    keep = np.exp(-dt / tau)
    lagged = lfilter([0, 1 - keep], [1, -keep], fine, axis=0)
    lagged += (
        (fine - lagged) * (1 - keep) / 2
    )  # held through a step, of which the delayed heat has come half of the way
    return Hexapod().series((1 - late) * fine + late * lagged, dt)[::10]


def payload(r):
    """A table that gives way by 0.002 (sin(y + 40 deg) - sin(40 deg)) where it stands then [rad]."""
    y = r.copy()
    for _ in range(50):
        y = r + 0.002 * (np.sin(y + np.radians(40)) - np.sin(np.radians(40)))
    return y


def noisy(n: int) -> float:
    """The squares of n deviations of noise, four of their own deviations above the mean."""
    return n + 4 * np.sqrt(2 * n)


def recover(fitter: Fitter, device: Device, effect: str, planted: Planted) -> None:
    """Screened where it acts and fitted from there: the numbers planted, and what is left is noise, fitted and held out, but
    for the form of the law, of which its effect says how far nature's may be."""
    highest = CANDIDATE_TERMS.highest_frequency / H if fitter.recording.kind == "series" else np.inf
    cause = Hypothesis(effect, planted.at, planted.at.partition(":")[2], planted.of, highest=highest)
    nominal, candidate = recovered(fitter, device, cause)
    fit, rough = candidate.fit, cause.prior.model_form_error**2
    for left, without in ((candidate.fitted, nominal.fitted), (candidate.held_out, nominal.held_out)):
        most = noisy(float(np.sum(left.n_plain))) + rough * float(np.sum(without.plain))
        assert np.sum(left.plain) < most and np.sum(left.plain) < 0.3 * np.sum(without.plain)
    sd = np.sqrt(np.diag(fit.covariance))
    found = {u.name: (fit.theta[k], sd[k]) for k, u in enumerate(fit.structure.free_parameters) if u.cause == 0}
    for parameter, truth in planted.truth.items():
        value, deviation = found[parameter]
        assert abs(value - truth) < 4 * deviation + planted.within.get(parameter, 0.005) * abs(truth), parameter


def fitter_of(device, channels, units, sds, kind, parts) -> Fitter:
    recording = Recording("t", device.name, kind, channels, units, tuple(sds), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, SETTLING))


def poses_of(parts, kind) -> Fitter:
    channels = tuple(f"reading.{c}" for c in COMPONENTS)
    units, sds = ("urad",) * 3 + ("um",) * 3, np.repeat([TURNED, SHIFTED], 3)
    return fitter_of(hexapod(), channels, units, sds, kind, parts)


@pytest.mark.parametrize("law", ON_AXIS, ids=lambda law: law.__name__)
def test_of_an_axis(law):
    rng, t = np.random.default_rng(3), H * np.arange(N)
    parts = [
        record(u, law(u, t) + NOISE * rng.standard_normal(N), role)
        for u, role in zip(given(N), ("fit", "hold_out"), strict=True)
    ]
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    recover(fitter, AXIS, law.__name__, ON_AXIS[law])


@pytest.mark.long
@pytest.mark.parametrize("law", [drive_hysteresis, bouc_wen, asymmetric_hysteresis], ids=lambda law: law.__name__)
def test_of_an_axis_by_a_law_whose_shape_starts_from_the_defaults(law, monkeypatch):
    """As a law without start values in the table does; that the simulator's form is another one stays known."""
    rows = {kind: replace(row, parameters={}) for kind, row in priors.PRIORS.items()}
    monkeypatch.setattr(priors, "PRIORS", rows)
    test_of_an_axis(law)


@cache
def hexapod() -> Device:
    return load_device(DEVICE)


@pytest.mark.parametrize("effect", ON_HEXAPOD)
def test_of_settled_poses(effect):
    settle(effect, *ON_HEXAPOD[effect])


FAR_OFF = {  # as far as a rig that was put up by hand
    "abbe_arm": (posed(lambda p: p + np.outer(p[:, 1] * 0.4e6, at(3, 1))), Planted("sensor:delta_x", {"arm": 0.4}, "theta_y")),
    "frame_rotation_x": (rotated("x", 0.08), Planted("mechanism:all", {"angle": 0.08})),
}  # fmt: skip


@pytest.mark.parametrize("effect", FAR_OFF)
def test_of_settled_poses_far_off(effect):
    settle(effect, *FAR_OFF[effect])


def settle(effect: str, plant, planted: Planted) -> None:
    rng, parts = np.random.default_rng(5), []
    for n, role in ((60, "fit"), (30, "hold_out")):
        u = rng.uniform(0.05, 0.5, (n, 6))
        y = plant(u) * np.repeat([1, 1e-6], 3) + np.repeat([TURNED, SHIFTED], 3) * rng.standard_normal((n, 6))
        parts.append(record(u, y, role, h=np.inf))
    recover(poses_of(parts, "poses"), hexapod(), effect, planted)


def test_of_heaters_with_a_second_lag():
    rng, parts = np.random.default_rng(7), []
    for n, role in ((400, "fit"), (300, "hold_out")):
        u = np.repeat(rng.uniform(0.05, 0.5, (n // 50, 6)), 50, axis=0)
        y = warmed(u) * np.repeat([1, 1e-6], 3) + np.repeat([TURNED, SHIFTED], 3) * rng.standard_normal((n, 6))
        parts.append(record(u, y, role))
    recover(poses_of(parts, "series"), hexapod(), "second_pole", Planted("actuator:all", {"share": 0.1, "tau": 0.05}))


def played(u, radius=2e-5):
    """A fifth of the way through two hundred plays, which stood at the upper end when the record began."""
    radii = radius * (np.arange(200) + 0.5) / 200
    play, out = radii.copy(), []
    for d in u:
        play = np.clip(play, d - radii, d + radii)
        out.append(0.8 * d + 0.2 * play.mean())
    return np.array(out)


def yielding(u):
    """d - z/5, dz = dd (1 - (4e4 sgn(dd z) + 1e4)|z|/m), in two hundred steps from pose to pose."""
    z, before, out = 0.0, 0.0, []
    for d in u:
        step = (d - before) / 200
        for _ in range(200):
            z += step * (1 - (4e4 * np.sign(step * z) + 1e4) * abs(z))
        before = d
        out.append(d - 0.2 * z)
    return np.array(out)


IN_ORDER = {  # of poses, whose order is the memory
    "displacement_hysteresis": (played, Planted("stage:axis", {"share": 0.2, "reach": 2e-5}, within={"share": 0.1, "reach": 0.1})),
    "displacement_bouc_wen": (yielding, Planted("stage:axis", {"share": 0.2, "reach": 2e-5, "loop": 0.8}, within={"loop": 0.05})),
}  # fmt: skip


@pytest.mark.parametrize("effect", IN_ORDER)
def test_of_poses_one_after_the_other(effect):
    rng, (law, planted) = np.random.default_rng(9), IN_ORDER[effect]
    table = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "100 um"}
    device, parts = validate(Device.library["servo"], table, "device"), []
    for n, role in ((120, "fit"), (60, "hold_out")):
        u = rng.uniform(-1e-4, 1e-4, n)
        parts.append(record(u, law(u) + SHIFTED * rng.standard_normal(n), role, h=np.inf))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (SHIFTED,), "poses", parts)
    recover(fitter, device, effect, planted)


def test_of_a_table_out_of_balance():
    rng, device = np.random.default_rng(6), load_device(SCENARIOS / "rotary_axis" / "device.toml")
    parts = []
    for n, role in ((60, "fit"), (30, "hold_out")):
        r = rng.uniform(-2, 2, n)
        parts.append(record(r, payload(r) + 2e-5 * rng.standard_normal(n), role, h=np.inf))
    fitter = fitter_of(device, ("reading.axis",), ("deg",), (2e-5,), "poses", parts)
    recover(fitter, device, "payload", Planted("mechanism:axis", {"share": 0.002, "lean": np.radians(40)}))


SHARED = {  # of two axes: what each takes for the other's motion (position, speed, acceleration)
    "stiffness_coupling": ({"stiffness": 40.0}, 0),
    "damping_coupling": ({"damping": 2.0}, 1),
    "inertia_coupling": ({"inertia": -0.5}, 2),
}


@pytest.mark.parametrize("effect", SHARED)
def test_of_what_two_axes_share(effect):
    own = {
        "mass": "1 kg*m^2", "damping": "2 N*m*s/rad", "stiffness": "100 N*m/rad",
        "stroke": "0.1 rad", "speed": "1 rad/s", "force": "20 N*m",
    }  # fmt: skip
    table = {
        "kind": "tested_axes", "name": "pair", "title": "two axes", "source": "round numbers",
        "axis": [{"name": "a", **own}, {"name": "b", **own}],
    }  # fmt: skip
    device = validate(Device.library["tested_axes"], table, "device")
    truth, order = SHARED[effect]
    rng, parts, t = np.random.default_rng(8), [], H * np.arange(N)
    for w, role in (((5, 8), "fit"), ((3, 7), "hold_out")):
        rate = 2 * np.pi * np.array(w)
        moved = [0.05 * rate**k * np.sin(t[:, None] * rate + k * np.pi / 2) for k in range(3)]
        y = 100 * moved[0] + 2 * moved[1] + moved[2] + next(iter(truth.values())) * moved[order][:, ::-1]
        parts.append(record(np.hstack(moved), y + 1e-3 * rng.standard_normal(y.shape), role))
    fitter = fitter_of(device, ("reading.a", "reading.b"), ("N*m", "N*m"), (1e-3, 1e-3), "series", parts)
    recover(fitter, device, effect, Planted("stage:a", truth, "b"))


@pytest.mark.long
@pytest.mark.parametrize("samples", [2, 7])
def test_of_two_clocks(samples):
    """Readings that come early, which no stage can; the screen cannot see it."""
    rng, parts = np.random.default_rng(3), []
    for u, role in zip(given(N), ("fit", "hold_out"), strict=True):
        late = u[np.clip(np.arange(N) + samples, 0, N - 1)]
        parts.append(record(u, move(late) + NOISE * rng.standard_normal(N), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    clocks, creep = Hypothesis("clock_offset", "sensor:axis", "axis"), Hypothesis("creep", "stage:axis", "axis")
    found = Searcher(fitter, Screen(fitter, [clocks, creep]), lambda _: None).run(AXIS).chosen
    assert found.causes == (clocks,) and found.errors.is_noise
    assert found.fit.values(0)["offset"] == pytest.approx(samples * H, abs=1e-5)


STATED = {"zero_per_record"}


def test_a_zero_that_is_stated_to_be_free_is_fitted_in_every_record():
    """The stiffness is found from records whose means differ by more than its effect."""
    table = {
        "kind": "tested_axis", "name": "pull", "title": "a spring", "source": "round numbers",
        "mechanics": {
            "mass": "0 kg", "damping": "0 N*s/m", "stiffness": {"value": "1 N/um", "sd": "0.5 N/um"},
            "stroke": "50 um", "speed": "1 mm/s", "force": "50 N",
        },
        "effect": [{"kind": "zero_per_record", "at": "force", "share": 1.0}],
    }  # fmt: skip
    device, parts, rng = validate(Device.library["tested_axis"], table, "device"), [], np.random.default_rng(10)
    for zero, role in ((12.0, "fit"), (-7.0, "fit"), (3.0, "hold_out")):
        d = rng.uniform(0, 5e-5, 300)
        moved = np.column_stack([d, 0 * d, 0 * d])
        parts.append(record(moved, 1.2e6 * d + zero + 0.01 * rng.standard_normal(300), role))
    fitter = fitter_of(device, ("reading.force",), ("N",), (0.01,), "series", parts)
    fitter, fit = fitter.described(device)
    assert fit.theta == pytest.approx([1.2e6], rel=1e-4)
    assert [float(states[0]) for states in fit.initial_states] == pytest.approx([12.0, -7.0], abs=0.01)
    held = parts[-1]
    assert np.std(held.observed - fitter.predict(fit, held)) < 0.012
    assert np.mean(held.observed - fitter.predict(fit, held)) == pytest.approx(0.0, abs=0.01)


def test_no_law_is_left_out():
    battery = {ALSO.get(name, name) for name in (*laws.DRAW, *FAULTS)}
    here = {
        *(law.__name__ for law in ON_AXIS),
        *ON_HEXAPOD,
        *SHARED,
        *IN_ORDER,
        "clock_offset",
        "payload",
        "second_pole",
    }
    assert not set(Effect.library) - battery - here - STATED - IN_THE_LOOP - SMOOTHERS
