"""A load on a joint, and drives that reach another actuator: found where another simulator planted them, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import H, record
from recovery import Planted, fitter_of, recover
from scipy.linalg import block_diag
from scipy.signal import cont2discrete
from scipy.spatial.transform import Rotation

import ctrlgen
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis, hypotheses, nominal_physics

N = 1000
CENTRE, PULL = np.array([0.06, 0.0, -0.2]), np.array([0.0, 0.0, -9.81 * 9])  # of a load at home [m], its weight [N]


def joint() -> Device:
    own = {
        "mass": {"value": "1.4 kg*m^2", "sd": "0.1 kg*m^2"},
        "damping": {"value": "6 N*m*s/rad", "sd": "2 N*m*s/rad"},
        "stiffness": "2 N*m/rad",
        "stroke": "120 deg",
        "speed": "3 rad/s",
        "force": "60 N*m",
    }
    table = {"kind": "tested_axis", "name": "joint", "title": "a joint", "source": "round numbers", "mechanics": own}
    return validate(Device.library["tested_axis"], table, "device")


def torque_of_the_load(q: np.ndarray) -> np.ndarray:
    """About y, of a weight whose place a rotation gives."""
    turned = Rotation.from_rotvec(np.outer(-q, [0, 1, 0])).apply(CENTRE)
    return np.cross(turned, PULL)[:, 1] * -1


def on_a_joint(load) -> Fitter:
    rng, parts, t = np.random.default_rng(4), [], 0.01 * np.arange(N)
    for rates, role in (((0.7, 2.9), "fit"), ((0.5, 2.2), "hold_out")):
        w, size = np.array(rates), np.array([0.9, 0.25])
        moved = [(size * w**k * np.sin(t[:, None] * w + 1 + k * np.pi / 2)).sum(axis=1) for k in range(3)]
        y = 1.4 * moved[2] + 6 * moved[1] + 2 * moved[0] - load(moved[0]) + 0.3 * rng.standard_normal(N)
        parts.append(record(np.column_stack(moved), y, role, h=0.01))
    return fitter_of(joint(), ("reading.force",), ("N*m",), (0.3,), "series", parts)


def test_the_weight_of_a_load_is_found_by_its_torque_and_where_it_hangs():
    arm, fitter = np.hypot(*CENTRE[[0, 2]]), on_a_joint(torque_of_the_load)
    numbers = {"torque": -PULL[2] * arm, "phase": np.arctan2(CENTRE[0], -CENTRE[2])}
    recover(fitter, joint(), "gravity", Planted("stage:axis", numbers, within={"phase": 0.01}))


def suspects(fitter: Fitter, device: Device, *laws: str) -> list[Hypothesis]:
    there = hypotheses(device, nominal_physics(device), fitter.recording.channels, H, ambient=False)
    return [h for h in there if h.effect in laws]


@pytest.mark.parametrize("load", [lambda q: 0 * q, lambda q: -4 * q - 3 * q**3], ids=["none", "a spring"])
def test_no_weight_is_found_where_none_hangs(load):
    fitter = on_a_joint(load)
    among = suspects(fitter, joint(), "gravity", "stiffness", "stiffening", "coulomb")
    assert "gravity" in {h.effect for h in among}
    found = Searcher(fitter, Screen(fitter, among), lambda _: None).run(joint()).chosen
    assert "gravity" not in {h.effect for h in found.causes} and found.errors.is_noise


MIRROR = {"gx": "50 urad/V", "gy": "40 urad/V", "wx": "200 1/s", "wy": "310 1/s", "I": "1e-5 kg*m^2"}
OWN = np.array([200.0, 310.0]) ** 2


def mirror() -> Device:
    def force(u, p):
        return [p.I * p.wx**2 * p.gx * u.x, p.I * p.wy**2 * p.gy * u.y]

    return ctrlgen.user_device(
        "mirror",
        parameters=MIRROR,
        drive={"x": "5 V", "y": "5 V"},
        axes={"tx": "1 mrad", "ty": "1 mrad"},
        mass=lambda p: [p.I, p.I],
        force=force,
        restoring_force=lambda d, p: [p.I * p.wx**2 * d.tx, p.I * p.wy**2 * d.ty],
        damping_force=lambda v, p: [0.1 * p.wx * p.I * v.tx, 0.1 * p.wy * p.I * v.ty],
    )


def on_two_coils(mixed) -> Fitter:
    """Of the exact steps of two modes, what is asked of their drives mixed; nothing of it by the library."""
    w, rng, t, parts = np.sqrt(OWN), np.random.default_rng(6), H * np.arange(N), []
    A = block_diag(*([[0, 1], [-(k**2), -(0.1 * k)]] for k in w))
    B = np.zeros((4, 2))
    B[1, 0], B[3, 1] = OWN * np.array([50e-6, 40e-6])
    A, B, *_ = cont2discrete((A, B, np.eye(4), np.zeros((4, 2))), H)
    for hertz, role in (((1.3, 9.0, 2.1, 13.0), "fit"), ((0.7, 11.0, 1.9, 7.0), "hold_out")):
        a, b, c, d = (np.sin(2 * np.pi * f * t) for f in hertz)
        u, x, y = np.column_stack([2 * a + b, 2 * c + d]), np.zeros(4), []
        for row in u @ np.asarray(mixed).T:
            y.append(x[[0, 2]])
            x = A @ x + B @ row
        parts.append(record(u, np.array(y) + 1e-7 * rng.standard_normal((N, 2)), role))
    return fitter_of(mirror(), ("reading.tx", "reading.ty"), ("urad", "urad"), (1e-7, 1e-7), "series", parts)


def test_a_drive_that_reaches_another_actuator_is_found_with_its_share():
    fitter = on_two_coils([[1, 0.06], [0, 1]])
    recover(fitter, mirror(), "drive_crosstalk", Planted("actuator:x", {"share": 0.06}, "y"))


BOTH_WAYS = pytest.param([[1, 0.05], [-0.02, 1]], {("x", "y"), ("y", "x")}, marks=pytest.mark.long)


@pytest.mark.parametrize("mixed, found", [BOTH_WAYS, (np.eye(2), set())], ids=["both ways", "none"])
def test_crosstalk_is_told_from_a_stage_that_is_carried_along_each_way_by_itself(mixed, found):
    fitter = on_two_coils(mixed)
    among = suspects(fitter, mirror(), "drive_crosstalk", "coupling", "stiffness_coupling", "swapped")
    chosen = Searcher(fitter, Screen(fitter, among), lambda _: None).run(mirror()).chosen
    assert {(h.at, h.of) for h in chosen.causes} == found and chosen.errors.is_noise
    assert {h.effect for h in chosen.causes} <= {"drive_crosstalk"}


def test_crosstalk_of_unlike_drives_has_a_unit_and_of_like_ones_none():
    law = ctrlgen.effects.Effect.library["drive_crosstalk"]
    here = ctrlgen.effects.Channel("valve", "V", 5.0, "m", 0.1)
    there = ctrlgen.effects.Channel("coil", "A", 2.0, "m", 0.1)
    share = law.amplitude()
    assert here.paired_with(there).unit_of(share) == "V/A" and here.paired_with(here).unit_of(share) == "1"
    assert not law.applies_to(here.paired_with(here)) and law.applies_to(here.paired_with(there))
