"""An axis that turns is described, simulated and solved like one that moves; servos of any drive; processes in which nothing moves."""

from __future__ import annotations

import numpy as np
import pytest

import ctrlgen
from ctrlgen import build_model, load_device, user_device
from ctrlgen.core.errors import InputError

TABLE = """
kind = "axis"
name = "table"
title = "rotary table"
source = "data sheet"
[mechanics]
mass = "0.02 kg*m^2"
damping = "0.5 N*m*s/rad"
stiffness = "40 N*m/rad"
stroke = ["-20 deg", "30 deg"]
[actuator]
force_constant = "2 N*m/A"
drive_limit = "10 A"
"""
LOOP = '[loop]\nposition_gain = "50 1/s"\nvelocity_gain = "1 V*s/rad"\nintegral_gain = "3 V/(rad*s)"\n'
LINEAR = TABLE.replace("kg*m^2", "kg").replace("N*m*s/rad", "N*s/m").replace("N*m/rad", "N/m").replace("N*m/A", "N/A")
LINEAR = LINEAR.replace('["-20 deg", "30 deg"]', '["-349.06585 mm", "523.59878 mm"]')
SERVO = 'kind = "servo"\nname = "a"\ntitle = "a"\nsource = "a"\ntravel = "50 mm"\n[transducer]\ngain = "{}"\ndrive_limit = "{}"\n'
MOVE = (
    'title = "a"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n'
    '[path]\nkind = "line"\nend = {{ axis = "{}" }}\nsmooth = 3\n'
)


def described(folder, text: str):
    (folder / "device.toml").write_text(text)
    return load_device(folder / "device.toml")


def test_a_rotary_axis_is_the_linear_one_in_other_units(tmp_path):
    drive = 3 * np.sin(0.02 * np.arange(300))[:, None]
    turned, moved = (build_model(described(tmp_path, text)) for text in (TABLE, LINEAR))
    assert {name: signal.units for name, signal in turned.signals.items()} == {
        "drive": ("A",), "displacement": ("deg",), "force": ("N*m",), "pose": ("deg",), "reading": ("deg",),
    }  # fmt: skip
    a, b = (ctrlgen.simulate(model, drive, 1e-3) for model in (turned, moved))
    np.testing.assert_allclose(a.signals["reading"], b.signals["reading"], rtol=1e-9, atol=1e-15)


def test_a_path_of_a_rotary_axis_takes_the_drives_of_the_linear_one(tmp_path):
    drives = []
    for text, end in ((TABLE, "10 deg"), (LINEAR, "174.532925199433 mm")):
        described(tmp_path, text)
        (tmp_path / "scenario.toml").write_text(MOVE.format(end))
        scenario = ctrlgen.load_scenario(tmp_path / "scenario.toml")
        drives.append(ctrlgen.solve(scenario, build_model(scenario.device)).drive)
    np.testing.assert_allclose(*drives, rtol=0, atol=1e-9)


def test_numbers_of_another_kind_of_axis_are_refused_and_a_loop_may_turn(tmp_path):
    model = build_model(described(tmp_path, TABLE.replace("A", "V") + LOOP))
    assert model.signals["drive"].units == ("deg",)
    for text, said in {
        TABLE.replace(
            "40 N*m/rad", "40 N/um"
        ): "the axis is rotary, because its stroke is an angle: stiffness = '40 N/um'",
        TABLE.replace("2 N*m/A", "2 N/A"): "actuator.force_constant = '2 N/A' is of another axis",
        TABLE.replace("A", "V")
        + LOOP.replace("V*s/rad", "V/(m/s)"): "loop.velocity_gain = '1 V/(m/s)' is of another axis",
        LINEAR.replace("2 N/A", "2 N*m/A"): "the axis is linear, because its stroke is a length",
    }.items():
        with pytest.raises(InputError) as refused:
            described(tmp_path, text)
        assert said in str(refused.value), str(refused.value)


@pytest.mark.parametrize(
    "gain, limit, unit",
    [
        ("0.5 mm/A", "9 A", "A"),
        ("10 um/%", "100 %", "%"),
        ("3 um/N", "5 kN", "kN"),
        ("1 mm/rpm", "60 rpm", "rpm"),
        ("2 s", "9 mm/s", "mm/s"),
    ],
)
def test_a_servo_is_driven_by_any_quantity(tmp_path, gain, limit, unit):
    model = build_model(described(tmp_path, SERVO.format(gain, limit)))
    assert model.signals["drive"].units == (unit,) and model.signals["reading"].units == ("mm",)
    with pytest.raises(InputError, match="gives no position in mm"):
        described(tmp_path, SERVO.format(gain, "5 W"))


def level(u, x, p):
    return [(u.pump - p.k * x.level) / p.area]


def heat(u, x, p):
    return [(u.heater - p.g * (x.wall - x.inside)) / p.c, p.g * (x.wall - x.inside) / p.c]


def test_a_tank_and_an_oven_have_no_axes():
    numbers = {"area": ("0.5 m^2", "0.01 m^2"), "k": "0.02 m^2/s"}
    tank = user_device(
        "tank", parameters=numbers, state={"level": "2 m"}, drive={"pump": ("0 m^3/s", "0.1 m^3/s")}, rates=level
    )
    model = build_model(tank)
    assert model.signals["reading"].units == ("m",) and model.signals["reading"].channels == ("level",)
    run = ctrlgen.simulate(model, np.full((400, 1), 0.03), 1.0)
    np.testing.assert_allclose(run.signals["reading"][-1], 1.5 * (1 - np.exp(-399 * 0.04)), rtol=1e-3)
    oven = user_device(
        "oven", parameters={"c": "400 J/K", "g": "1 W/K"}, state={"wall": "100 K", "inside": "100 K"}, drive={"heater": "200 W"},
        reading={"inside": "100 K"}, rates=heat,
    )  # fmt: skip
    assert build_model(oven).signals["reading"].channels == ("inside",)
    with pytest.raises(TypeError, match="needs the arguments axes"):
        user_device("none", parameters={}, drive={"heater": "200 W"})
    with pytest.raises(TypeError, match="force is of axes"):
        user_device("none", parameters={}, state={"a": "1 m"}, drive={"b": "1 m"}, force=lambda u: u, rates=level)


@pytest.mark.long
def test_the_c_of_a_rotary_axis_does_what_the_model_does(tmp_path):
    described(tmp_path, TABLE)
    (tmp_path / "scenario.toml").write_text(MOVE.format("10 deg"))
    found = ctrlgen.run(tmp_path / "scenario.toml", tmp_path / "out")
    assert found.passed and found.comparison is not None
