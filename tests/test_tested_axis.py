"""Axes whose motion is imposed: one or several, linear or rotary."""

from __future__ import annotations

import numpy as np
import pytest

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis, hypotheses
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import build_model
from ctrlgen.model.simulation import trace
from ctrlgen.recordings.recording import Record, Recording

SECOND = {
    "mass": "2 kg*m^2",
    "damping": "3 N*m*s/rad",
    "stiffness": "50 N*m/rad",
    "stroke": "0.1 rad",
    "speed": "1 rad/s",
    "force": "5 N*m",
}
FIRST = {**SECOND, "mass": "1 kg*m^2", "damping": "0 N*m*s/rad", "stiffness": "100 N*m/rad"}
PAIR = {
    "kind": "tested_axes",
    "name": "pair",
    "title": "two rotary axes",
    "source": "round numbers",
    "axis": [{"name": "a", **FIRST}, {"name": "b", **SECOND}],
}
H, N = 1e-3, 400
T = H * np.arange(N)
A, B = 2 * np.pi * 5, 2 * np.pi * 8
ANGLE = np.column_stack([0.05 * np.sin(A * T), 0.08 * np.sin(B * T)])
SPEED = np.column_stack([0.05 * A * np.cos(A * T), 0.08 * B * np.cos(B * T)])
MOTION = np.hstack([ANGLE, SPEED, -ANGLE * [A**2, B**2]])


def device_of(*effects: dict, **changed) -> Device:
    table = {**PAIR, "effect": list(effects), **changed}
    return validate(Device.library[table["kind"]], table, "device.toml")


def torque(device: Device) -> np.ndarray:
    """The torque of both axes under `MOTION`, (N, 2), with the states of effects as they have become by then."""
    model = build_model(device, sample_time=H)
    return trace(model, T, ctrlgen.simulate(model, MOTION, H).x[:N], ANGLE, MOTION).signals["reading"]


def test_each_axis_takes_its_own_torque():
    expected = MOTION[:, 4:] * [1, 2] + SPEED * [0, 3] + ANGLE * [100, 50]
    assert torque(device_of()) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize(
    "effect, expected",
    [
        (
            {"kind": "quadratic_damping", "at": "a", "damping": "1 N*m*s^2/rad^2"},
            lambda: np.abs(SPEED[:, 0]) * SPEED[:, 0],
        ),
        ({"kind": "stiffening", "at": "a", "k3": "1000 N*m/rad^3"}, lambda: 1000 * ANGLE[:, 0] ** 3),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_law_acts_on_the_axis_where_it_stands(effect, expected):
    """It adds its torque there, by that axis' own motion, and nothing to the other axis."""
    added = torque(device_of(effect)) - torque(device_of())
    assert added[:, 0] == pytest.approx(expected(), abs=1e-6 * np.abs(expected()).max())
    assert not added[:, 1].any()


def test_what_moves_with_both_axes_takes_torque_of_both():
    """d_a = z_a + g z_b: a takes F_a = m d_a'' + k d_a, and b by virtual work g F_a beside its own."""
    found = torque(device_of({"kind": "coupling", "at": "a", "of": "b", "gain": 0.2}))
    first = MOTION[:, 4] + 0.2 * MOTION[:, 5] + 100 * (ANGLE[:, 0] + 0.2 * ANGLE[:, 1])
    second = 2 * MOTION[:, 5] + 3 * SPEED[:, 1] + 50 * ANGLE[:, 1] + 0.2 * first
    assert found == pytest.approx(np.column_stack([first, second]), abs=1e-9 * np.abs(first).max())


@pytest.mark.parametrize(
    "effect, motion",
    [
        ({"kind": "stiffness_coupling", "stiffness": "40 N*m/rad"}, lambda: 40 * ANGLE),
        ({"kind": "damping_coupling", "damping": "2 N*m*s/rad"}, lambda: 2 * SPEED),
        ({"kind": "inertia_coupling", "inertia": "-0.5 N*m*s^2/rad"}, lambda: -0.5 * MOTION[:, 4:]),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_what_two_axes_share_takes_torque_of_each_for_the_motion_of_the_other(effect, motion):
    added = torque(device_of({"at": "a", "of": "b", **effect})) - torque(device_of())
    assert added == pytest.approx(motion()[:, ::-1], abs=1e-9 * np.abs(motion()).max())


def test_dry_friction_of_the_second_axis_has_the_sign_of_its_own_speed():
    friction = {"kind": "coulomb", "at": "b", "force": "0.5 N*m", "reach": "1e-5 rad", "smoothing": "1e-4 rad/s"}
    added = torque(device_of(friction)) - torque(device_of())
    before = SPEED[:-1, 1]  # a state follows the speed held over the sample before
    moving = np.abs(before) > 0.1
    assert not added[:, 0].any()
    assert added[1:, 1][moving] == pytest.approx(0.5 * np.sign(before[moving]), abs=5e-3)


def test_every_number_and_every_law_has_a_place_of_its_own():
    device = device_of()
    found = hypotheses(device, device.physics(device.values()), ("reading.a", "reading.b"), H, ambient=False)
    places = [(h.effect, h.location, h.of) for h in found]
    assert len(set(places)) == len(places)
    assert {"stage:a.mass", "stage:b.mass"} <= {location for _, location, _ in places}
    shared = [place for place in places if place[0].endswith("_coupling")]
    assert shared == [(f"{x}_coupling", "stage:a", "b") for x in ("damping", "inertia", "stiffness")]
    for law in ("coulomb", "stiffening", "one_sided_stiffening", "hysteresis", "coupling"):
        assert {"stage:a", "stage:b"} <= {location for effect, location, _ in places if effect == law}, law


def test_an_axis_of_mixed_units_is_refused_with_the_unit_to_write():
    one = {"kind": "tested_axis", "mechanics": {**FIRST, "mass": "1 kg", "force": "1 N"}}
    for table, said in (
        ({"axis": [{"name": "a", **FIRST}, {"name": "a", **SECOND}]}, "two axes are named 'a'"),
        (
            {"axis": [{"name": "a", **FIRST}, {"name": "b", **SECOND, "mass": "1 kg"}]},
            "mass = '1 kg' should be in kg*m^2",
        ),
        ({"axis": [{"name": "a", **FIRST}, {"name": "2b", **SECOND}]}, "axis[1].name"),
        ({"axis": []}, "axis"),
        ({k: v for k, v in PAIR.items() if k != "axis"} | one, "force = '1 N' should be in N*m"),
    ):
        with pytest.raises(InputError) as error:
            validate(
                Device.library[table.get("kind", "tested_axes")],
                {**({} if "kind" in table else PAIR), **table},
                "device.toml",
            )
        assert said in str(error.value), str(error.value)


def test_linear_and_rotary_axes_are_not_mixed():
    linear = {
        "mass": "1 kg",
        "damping": "0 N*s/m",
        "stiffness": "1 N/um",
        "stroke": "1 mm",
        "speed": "1 mm/s",
        "force": "1 N",
    }
    with pytest.raises(InputError, match="'a' and 'b' are not both linear or both rotary"):
        device_of(axis=[{"name": "a", **FIRST}, {"name": "b", **linear}])


def test_laws_can_be_screened_where_no_number_is_free_and_the_axis_has_no_stiffness():
    """What acts on the displacement then reaches nothing, as where the stiffness itself is barred as a cause; friction does."""
    device = device_of(axis=[{"name": "a", **FIRST}, {"name": "b", **SECOND, "stiffness": "0 N*m/rad"}])
    rng, parts = np.random.default_rng(3), []
    for role in ("fit", "hold_out"):
        y = torque(device) + [0.0, 0.5] * np.sign(SPEED) + 1e-3 * rng.standard_normal((N, 2))
        parts.append(Record(role, role, T, H, MOTION, y, False, None, np.ones((N, 2), bool)))
    names = ("reading.a", "reading.b")
    recording = Recording("t", device.name, "series", names, ("N*m", "N*m"), (1e-3, 1e-3), tuple(parts), ())
    fitter = Fitter(recording, estimate_noise(recording, 0.1))
    friction, play = Hypothesis("coulomb", "stage:b", "b"), Hypothesis("backlash", "stage:b", "b")
    screened = Screen(fitter, [friction, play]).run(fitter.fit(Structure(device), steps=0))
    assert [s.hypothesis for s in screened.suspects] == [friction] and abs(screened.suspects[0].z) > 1e2
    assert screened.undetectable == {play: -1} and not screened.dropped
