"""Every law is recovered from a record that another simulator made: here those that the battery does not plant."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, K, move, record
from conftest import DEVICE, SCENARIOS
from planted_axis import ON_AXIS, asymmetric_hysteresis, bouc_wen, drive_hysteresis, given
from planted_poses import FAR_OFF, IN_ORDER, ON_HEXAPOD, payload, warmed
from planted_regions import IN_A_REGION
from recovery import N, Planted, fitter_of, recover
from xy_stage import xy_stage

import ctrlgen.effects  # noqa: F401
from battery import laws
from battery.hexapod_cases import FAULTS
from battery.plant_hexapod import Hexapod
from ctrlgen import load_device
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.effects import Effect
from ctrlgen.estimation import priors
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis

COMPONENTS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
TURNED, SHIFTED = 1e-6, 5e-9  # noise of a pose [rad, m]
# The battery's names for them
ALSO = {
    "softening": "stiffening",
    "frame_turn": "frame_rotation_z",
    "step": "force_step",
    "viscous": "asymmetric_viscous",
}
IN_THE_LOOP = {"link_load"}  # found on the finite-rotation plant of tests/test_loop.py
SMOOTHERS = {"empirical_history", "empirical_position", "empirical_speed"}  # written in tests/test_empirical_terms.py


def poses_of(parts, kind) -> Fitter:
    channels = tuple(f"reading.{c}" for c in COMPONENTS)
    units, sds = ("urad",) * 3 + ("um",) * 3, np.repeat([TURNED, SHIFTED], 3)
    return fitter_of(hexapod(), channels, units, sds, kind, parts)


BELOW = ("coulomb_below", "viscous_below", "backlash_below", "stiffness_below")
ELSEWHERE = (
    "coulomb_after",
    "viscous_above",
    "viscous_on_stretch",
    "asymmetric_drive_hysteresis",
    "asymmetric_hysteresis",
    "slack_friction",
    "butterfly",
)


def quick_but(laws, *mirrored):
    """The laws as parameters; those that are others seen in a mirror, or in another place, are long."""
    return [pytest.param(law, marks=pytest.mark.long) if law.__name__ in mirrored else law for law in laws]


@pytest.mark.parametrize(
    "law",
    quick_but(ON_AXIS | IN_A_REGION, *BELOW, *ELSEWHERE),
    ids=lambda law: law.__name__,
)
def test_of_an_axis(law):
    rng, t = np.random.default_rng(3), H * np.arange(N)
    parts = [
        record(u, law(u, t) + NOISE * rng.standard_normal(N), role)
        for u, role in zip(given(N), ("fit", "hold_out"), strict=True)
    ]
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    recover(fitter, AXIS, law.__name__, (ON_AXIS | IN_A_REGION)[law])


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


@pytest.mark.long
@pytest.mark.parametrize("effect", ON_HEXAPOD)
def test_of_settled_poses(effect):
    settle(effect, *ON_HEXAPOD[effect])


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


@pytest.mark.long
def test_of_heaters_with_a_second_lag():
    rng, parts = np.random.default_rng(7), []
    for n, role in ((400, "fit"), (300, "hold_out")):
        u = np.repeat(rng.uniform(0.05, 0.5, (n // 50, 6)), 50, axis=0)
        y = warmed(u) * np.repeat([1, 1e-6], 3) + np.repeat([TURNED, SHIFTED], 3) * rng.standard_normal((n, 6))
        parts.append(record(u, y, role))
    recover(poses_of(parts, "series"), hexapod(), "second_pole", Planted("actuator:all", {"share": 0.1, "tau": 0.05}))


@pytest.mark.parametrize("scale", [0.2, -0.04])
def test_a_scale_of_an_angle_is_the_sensors_before_it_is_a_weights(scale):
    """At angles of a milliradian the moment of a weight is in proportion to the angle, as an error of the scale is."""
    rng, parts = np.random.default_rng(5), []
    for n, role in ((60, "fit"), (30, "hold_out")):
        u = rng.uniform(0.05, 0.5, (n, 6))
        y = Hexapod().settled(u) * np.array([1, 1, 1 + scale, 1e-6, 1e-6, 1e-6])
        parts.append(record(u, y + np.repeat([TURNED, SHIFTED], 3) * rng.standard_normal((n, 6)), role, h=np.inf))
    fitter = poses_of(parts, "poses")
    suspected = [
        Hypothesis(law, f"{at}:theta_z", "theta_z") for law, at in (("payload", "mechanism"), ("sensor_gain", "sensor"))
    ]
    found = Searcher(fitter, Screen(fitter, suspected), lambda _: None).run(hexapod())
    assert [c.effect for c in found.chosen.causes] == ["sensor_gain"]


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


@pytest.mark.parametrize(
    "law, truth, of_x",
    [
        ("squareness", {"angle": 0.004}, lambda x, y: 0.004 * y),
        ("cross_scale", {"rate": 400.0}, lambda x, y: 400 * x * y),
        ("arcuate_motion", {"rate": -160.0}, lambda x, y: -160 * y**2),
    ],
)
def test_of_two_axes_of_a_sensor(law, truth, of_x):
    """A grid plate that is not square; an axis that reads 0.4 permille more for each micrometre of the other; leaf springs of 3.75 mm."""
    rng, device, parts = np.random.default_rng(10), xy_stage("0.2", "100 V"), []
    for n, role in ((60, "fit"), (30, "hold_out")):
        u = rng.uniform(0, 100, (n, 2))
        y = 2e-7 * u + np.outer(of_x(*(2e-7 * u).T), [1, 0]) + SHIFTED * rng.standard_normal((n, 2))
        parts.append(record(u, y, role, h=np.inf))
    fitter = fitter_of(device, ("reading.delta_x", "reading.delta_y"), ("um", "um"), (SHIFTED, SHIFTED), "poses", parts)
    recover(fitter, device, law, Planted("sensor:delta_x", truth, "delta_y"))


def test_of_a_table_out_of_balance():
    rng, device = np.random.default_rng(6), load_device(SCENARIOS / "rotary_axis" / "device.toml")
    parts = []
    for n, role in ((60, "fit"), (30, "hold_out")):
        r = rng.uniform(-2, 2, n)
        parts.append(record(r, payload(r) + 2e-5 * rng.standard_normal(n), role, h=np.inf))
    fitter = fitter_of(device, ("reading.axis",), ("deg",), (2e-5,), "poses", parts)
    recover(fitter, device, "payload", Planted("mechanism:axis", {"share": 0.002, "lean": np.radians(40)}))


# Of two axes: what each takes for the other's motion (position, speed, acceleration)
SHARED = {
    "stiffness_coupling": ({"stiffness": 40.0}, 0),
    "damping_coupling": ({"damping": 2.0}, 1),
    "inertia_coupling": ({"inertia": -0.5}, 2),
}


@pytest.mark.long
@pytest.mark.parametrize("effect", SHARED)
def test_of_what_two_axes_share(effect):
    own = {
        "mass": "1 kg*m^2",
        "damping": "2 N*m*s/rad",
        "stiffness": "100 N*m/rad",
        "stroke": "0.1 rad",
        "speed": "1 rad/s",
        "force": "20 N*m",
    }
    table = {
        "kind": "tested_axes",
        "name": "pair",
        "title": "two axes",
        "source": "round numbers",
        "axis": [{"name": "a", **own}, {"name": "b", **own}],
    }
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


def test_of_a_reading_that_moves_in_the_warmth_alone():
    rng, t, parts = np.random.default_rng(3), H * np.arange(N), []
    for u, role in zip(given(N), ("fit", "hold_out"), strict=True):
        room = 2 * np.sin(2 * np.pi * 0.9 * t + rng.uniform(0, 6))
        y = move(u) + 3e-8 * np.maximum(room - 0.7, 0) + NOISE * rng.standard_normal(N)
        parts.append(replace(record(u, y, role), ambient=room))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    planted = Planted("sensor:axis", {"slope": 3e-8, "reference": 0.7}, within={"reference": 0.02})
    recover(fitter, AXIS, "temperature_sensitivity_above", planted)


@pytest.mark.parametrize("law", ["gain_of_temperature", "scale_of_temperature", "stiffness_of_temperature"])
def test_of_a_number_that_changes_with_the_warmth(law):
    """2 permille a kelvin of the drive, of the scale, or of the spring, whose force is that in the middle of each tenth of a sample."""
    rng, t, parts, slope = np.random.default_rng(3), H * np.arange(N), [], 2e-3
    for u, role in zip(given(N), ("fit", "hold_out"), strict=True):
        room = 2 * np.sin(2 * np.pi * 0.9 * t + rng.uniform(0, 6))
        softer = lambda now, q, v, memory: (-slope * room[int(now / H + 1e-6)] * K * (q + v * H / 20), memory)  # noqa: E731, B023
        y = {
            "gain_of_temperature": lambda: move(u * (1 + slope * room)),  # noqa: B023
            "scale_of_temperature": lambda: move(u) * (1 + slope * room),  # noqa: B023
            "stiffness_of_temperature": lambda: move(u, softer),  # noqa: B023
        }[law]() + NOISE * rng.standard_normal(N)
        parts.append(replace(record(u, y, role), ambient=room))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    at = {"gain": "actuator:axis", "scale": "sensor:axis", "stiffness": "stage:axis"}[law.partition("_")[0]]
    recover(fitter, AXIS, law, Planted(at, {"slope": slope}))


STATED = {
    "autocollimator",
    "face_tilt",
    "mirror_tilt",
    "plane_mirror",
}  # the mirrors: tests/test_mirrors.py
OF_EACH_RECORD = {
    "zero_per_record",
    "drift_per_record",
    "sensor_step_per_record",
}  # found in tests/test_of_each_record.py
ACROSS = {"waviness"}  # found in tests/test_waviness.py
# found in tests/test_finer_forms.py and tests/test_found_window.py
FINER = {
    "bouc_wen_of_power",
    "moving_average",
    "power_creep",
    "cogging_of_slots",
    "worn_backlash",
    "friction_of_load",
    "weighted_displacement_hysteresis",
    "weighted_drive_hysteresis",
    *(f"stribeck_{where}" for where in ("above", "after", "below")),
}


def test_a_zero_that_is_stated_to_be_free_is_fitted_in_every_record():
    """The stiffness is found from records whose means differ by more than its effect."""
    table = {
        "kind": "tested_axis",
        "name": "pull",
        "title": "a spring",
        "source": "round numbers",
        "mechanics": {
            "mass": "0 kg",
            "damping": "0 N*s/m",
            "stiffness": {"value": "1 N/um", "sd": "0.5 N/um"},
            "stroke": "50 um",
            "speed": "1 mm/s",
            "force": "50 N",
        },
        "effect": [{"kind": "zero_per_record", "at": "force", "share": 1.0}],
    }
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
    in_joints_and_drives = {"drive_crosstalk", "gravity"}  # tests/test_joints_and_drives.py
    here = in_joints_and_drives | {
        *(law.__name__ for law in ON_AXIS | IN_A_REGION),
        *ON_HEXAPOD,
        "squareness",
        "cross_scale",
        "arcuate_motion",
        *SHARED,
        *IN_ORDER,
        "clock_offset",
        "soft_coupling",  # tests/test_soft_coupling.py
        "eccentricity",  # tests/test_rotary_servo.py
        "feedthrough",  # tests/test_feedthrough.py
        "heater_resistance_of_second_order",  # tests/test_heat_loss.py
        "payload",
        "second_pole",
        "temperature_sensitivity_above",
        *(f"{what}_of_temperature" for what in ("gain", "scale", "stiffness")),
    }
    assert not set(Effect.library) - battery - here - STATED - OF_EACH_RECORD - ACROSS - FINER - IN_THE_LOOP - SMOOTHERS
