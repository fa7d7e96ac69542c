"""Laws in series: what stands behind a play moves as the play lets it, and what it takes is carried through the play."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from axis_records import record

from ctrlgen import build_model
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.estimation.simulator import Simulator

H = 0.01
TESTED = {
    "kind": "tested_axis",
    "name": "tested",
    "title": "an axis in a test machine",
    "source": "round numbers",
    "mechanics": {
        "mass": "2 kg",
        "damping": "30 N*s/m",
        "stiffness": "5 N/mm",
        "stroke": "10 mm",
        "speed": "100 mm/s",
        "force": "60 N",
    },
}
SERVO = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "100 um"}
PLAY = {"kind": "backlash", "at": "axis", "gap": "10 um"}
CREEP = {"kind": "creep", "at": "axis", "gain": "0.2", "tau": "0.3 s", "slow": "0"}


def made(table: dict, *effects: dict) -> Device:
    return validate(Device.library[table["kind"]], table | {"effect": list(effects)}, "device")


def played(d: np.ndarray, gap: float) -> np.ndarray:
    """What is dragged through a gap, of whose motion inside it a thousandth passes."""
    w, out = 0.0, []
    for value in d:
        w = min(max(w, value - gap / 2), value + gap / 2)
        out.append(value + 0.999 * (w - value))
    return np.array(out)


@pytest.mark.parametrize("effects", [(CREEP, PLAY), (PLAY, CREEP)], ids=["creep first in the file", "play first"])
def test_what_creeps_stands_behind_the_play_whatever_the_order_in_the_file(effects):
    """y = B(u), reading y + 0.2 lag(y): the lag of what the play lets through, exact for a command that is held."""
    u = np.repeat([0.0, 4e-5, 3.5e-5, 1e-5, 3e-5], 40)
    y = played(u, 1e-5)
    lag, wanted = 0.0, []
    for value in y:
        wanted.append(value + 0.2 * lag)  # read as the command is given
        lag = value + (lag - value) * np.exp(-H / 0.3)
    simulator = Simulator(made(SERVO, *effects), (), ("reading.axis",), H)
    read = simulator.simulate(record(u, np.zeros_like(u), "fit", h=H), np.zeros(0))[:, 0]
    before = 0.2 * 5e-6  # by which a creep before the play, of the command itself, would be off in the end
    assert np.abs(read - wanted).max() < 1e-3 * before


@pytest.mark.parametrize(
    "first, let_through",
    [
        (
            {"kind": "dead_zone", "width": "10 um", "rounding": "0.01"},
            lambda u: np.sign(u) * np.maximum(abs(u) - 1e-5, 0.0),
        ),
        ({"kind": "saturation", "share": "1", "level": "40 um"}, lambda u: np.clip(u, -4e-5, 4e-5)),
    ],
    ids=["dead zone", "limit"],
)
@pytest.mark.parametrize("law, gains", [("asymmetric_gain", (1.3, 0.7)), ("drive_gain", (1.3, 1.3))])
def test_a_gain_acts_on_what_a_dead_zone_or_a_limit_lets_through(first, let_through, law, gains):
    """f(u) times the gain of its sign. Beside each other, a dead zone would be off by 0.3 of its width and a limit by 0.3 of the
    excess."""
    u = np.array([0.0, 8e-6, 3e-5, 7e-5, -3e-5, -7e-5])
    device = made(SERVO, {"kind": law, "at": "axis", "gain": "0.3"}, first | {"at": "axis"})
    simulator = Simulator(device, (), ("reading.axis",), H)
    read = simulator.simulate(record(u, np.zeros_like(u), "fit", h=H), np.zeros(0))[:, 0]
    through = let_through(u)
    assert np.abs(read - np.where(through > 0, *gains) * through).max() < 1e-7  # corners are round by a hundredth


def test_a_play_before_a_tested_axis_carries_no_force_while_it_is_crossed():
    """Pulled through a gap of 4 mm at 50 mm/s and back: m a + c v + k w of what is dragged; nothing in the gap but what the
    thousandth of the motion takes that an inverse needs."""
    device = made(TESTED, {"kind": "backlash", "at": "axis", "gap": "4 mm"})
    t = H * np.arange(200)
    z = 5e-3 * np.sin(2 * np.pi * t)
    v = 5e-3 * 2 * np.pi * np.cos(2 * np.pi * t)
    a = -((2 * np.pi) ** 2) * z
    w = played(z, 4e-3)
    moving = np.abs(np.diff(w, prepend=0.0)) > 0.5 * np.abs(np.diff(z, prepend=0.0))
    simulator = Simulator(device, (), ("reading.force",), H)
    read = simulator.simulate(record(np.column_stack([z, v, a]), np.zeros_like(t), "fit", h=H), np.zeros(0))[:, 0]
    steady = moving & np.roll(moving, 1) & np.roll(moving, -1)  # the samples in which it engages are part of each
    assert np.abs(read - (2 * a + 30 * v + 5e3 * w))[steady].max() < 1e-3 * 5e3 * 5e-3
    crossing = ~moving & ~np.roll(moving, 1) & ~np.roll(moving, -1)
    assert crossing.sum() > 40 and np.abs(read[crossing]).max() < 2e-3 * 5e3 * 5e-3


@pytest.mark.parametrize("rounded", [1e-9, 1e-4])
def test_a_play_that_touches_carries_the_whole_force_at_rest(rounded):
    """Pulled 5 mm through a gap of 3 mm and held there, and read in steps of 0.1 mm as an encoder gives: k w all the time."""
    device = made(TESTED, {"kind": "backlash", "at": "axis", "gap": "3 mm"})
    z = np.round(np.minimum(2.5e-2 * H * np.arange(60), 5e-3) / rounded) * rounded
    none = np.zeros_like(z)
    simulator = Simulator(device, (), ("reading.force",), H)
    read = simulator.simulate(record(np.column_stack([z, none, none]), none, "fit", h=H), np.zeros(0))[:, 0]
    held = z > 2e-3
    wanted = 5e3 * (z - 1.5e-3)[held]
    assert np.abs(read[held] - wanted).max() < 2e-3 * 17.5  # a thousandth of the motion inside the gap


def test_creep_behind_a_tested_axis_is_damped_as_its_own_motion_is():
    """At a hold the creeping goes on: k d + c d' with d' = g (z - lag)/tau."""
    device = made(TESTED, {"kind": "creep", "at": "axis", "gain": "2", "tau": "100 ms", "slow": "0"})
    z = np.full(30, 2e-3)
    none = np.zeros_like(z)
    simulator = Simulator(device, (), ("reading.force",), H)
    read = simulator.simulate(record(np.column_stack([z, none, none]), none, "fit", h=H), np.zeros(0))[:, 0]
    lag = 2e-3 * (1 - np.exp(-H * np.arange(30) / 0.1))
    d, speed = 2e-3 + 2 * lag, 2 * (2e-3 - lag) / 0.1
    assert read == pytest.approx(5e3 * d + 30 * speed - 2 * speed / 0.1, rel=1e-3)


def test_a_lever_before_a_tested_axis_takes_force_and_motion_by_its_ratio():
    """d = 1.1 z: the machine feels 1.1 (m 1.1 a + c 1.1 v + k 1.1 z), as energy demands."""
    model = build_model(made(TESTED, {"kind": "lever_ratio", "at": "axis", "gain": "0.1"}))
    z, v, a = 3e-3, 0.04, -0.7
    force = ca.Function("force", [model.u, model.z], [model.signals["force"].expr])([z, v, a], z)
    assert float(force) == pytest.approx(1.1**2 * (2 * a + 30 * v + 5e3 * z), rel=1e-12)
