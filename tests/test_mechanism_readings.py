"""Readings of a mechanism beside those of its output: where a sensor stands on a body, in recordings and their diagnosis."""

from __future__ import annotations

import re

import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import DEVICE
from held_blades import EI, E, L, T, W
from mechanism_files import PARALLELOGRAM, blade, chain, dm, loaded, with_values

import ctrlgen
from ctrlgen import InputError, build_model, run
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.model.simulation import simulate

TILT = '[[reading]]\nname = "tilt"\nbody = "stage"\nabout = [0, 0, 1]\n'
EDGE = '[[reading]]\nname = "edge"\nbody = "stage"\nat = ["0 mm", "15 mm", "0 mm"]\nalong = [2, 0, 0]\n'

CELL = '[[reading]]\nname = "cell"\nof = "left"\nload = "F_y"\n'

# Pushed 10 mm too high
TURNING = PARALLELOGRAM.replace('at = ["0 mm", "-10 mm", "0 mm"]', 'at = ["0 mm", "0 mm", "0 mm"]')


def read(model, drive: float) -> dict[str, float]:
    """Readings at rest."""
    trace = simulate(model, np.array([[drive]]), 1.0)
    names = model.signals["reading"].channels
    return dict(zip(names, trace.signals["reading"][-1], strict=True))


def test_a_point_above_the_output_moves_by_the_turn_of_the_body_more(tmp_path):
    """Pushed 10 mm too high the stage turns; the edge 15 mm above the output moves by 15 mm of that turn less (x = -theta y)."""
    text = TURNING + TILT + EDGE
    seen = read(build_model(loaded(tmp_path, text)), 0.1)
    assert abs(seen["tilt"]) > 1e-8
    assert seen["edge"] == pytest.approx(seen["delta_x"] - 15e-3 * seen["tilt"], rel=1e-9)


def test_a_sensor_between_two_bodies_reads_their_difference(tmp_path):
    """The stretch of k_b, F/k_b, with the cubic spring beside body a."""
    gap = '[[reading]]\nname = "gap"\nbody = "b"\nagainst = "a"\nat = ["5 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
    device = loaded(tmp_path, chain('F_x_per_delta_x3 = "1e-3 N/um^3"') + gap)
    assert read(build_model(device), 40.0)["gap"] == pytest.approx(40.0 * 0.2e-6, rel=1e-9)


def test_copies_of_a_reading_go_round_and_to_the_mirror_with_their_pattern(tmp_path):
    text = (DEVICE.parent / "tip_tilt_mirror.toml").read_text()
    probe = '[[reading]]\nname = "probe"\npattern = "leg"\nbody = "mirror"\nat = ["12 mm", "0 mm", "0 mm"]\nalong = [0, 0, 1]\n'
    device = loaded(tmp_path, text + probe)
    c = Condensed(*with_values(device))
    motion = dm(c.output_motion)
    angles = np.radians([0, 120, 240])
    wanted = motion[5] + 12e-3 * (np.sin(angles)[:, None] * motion[0] - np.cos(angles)[:, None] * motion[1])
    assert dm(c.reading_motion) == pytest.approx(wanted, abs=1e-12)
    assert build_model(device).signals["reading"].channels[-3:] == ("probe_1", "probe_2", "probe_3")
    mirrored = '[[pattern]]\nname = "both"\nmirror = "y"\n'
    mirrored += '[[reading]]\nname = "tilt"\npattern = "both"\nbody = "mirror"\nabout = [1, 0, 0]\n'
    rows = dm(Condensed(*with_values(loaded(tmp_path, text + mirrored))).reading_motion)
    assert rows[1] == pytest.approx(-rows[0], abs=1e-12) and np.abs(rows).max() > 1e-3


@pytest.mark.long
def test_a_recording_of_a_reading_on_a_body_names_what_the_description_leaves_out(tmp_path):
    """The edge's sensor alone has a wrong gain: 8 % is planted, in the output nothing."""
    text = TURNING + EDGE
    model, rng = build_model(loaded(tmp_path, text)), np.random.default_rng(4)
    files = []
    for name in ("fit", "hold_out"):
        u = 0.4 * np.cumsum(rng.normal(size=600)) / 12
        u = np.clip(u - u.mean(), -0.6, 0.6)
        y = simulate(model, u[:, None], 1e-3).signals["reading"][1:]
        y = y * [1.0, 1.08] + 2e-8 * rng.normal(size=y.shape)
        table = np.column_stack([np.arange(600) * 1e-3, u, y * 1e6])
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="t,u,x,edge", comments="")
        files.append(f'[[record]]\nfile = "{name}.csv"\nrole = "{name}"\ntime = {{ column = "t", unit = "s" }}\n')
    (tmp_path / "recording.toml").write_text(
        'title = "t"\ndevice = "m"\nsource = "a test"\nkind = "series"\n' + "".join(files) + "[columns]\n"
        '"drive.coil" = { column = "u", unit = "A" }\n"reading.delta_x" = { column = "x", unit = "um", noise = "20 nm" }\n'
        '"reading.edge" = { column = "edge", unit = "um", noise = "20 nm" }\n'
    )
    found = ctrlgen.diagnose(
        tmp_path / "device.toml",
        tmp_path / "recording.toml",
        laws=("sensor_gain", "drive_gain", "home_offset", "cubic_sensor"),
        jobs=0,
    )
    assert found.verdict == "explained"
    assert [(f.effect, f.location) for f in found.findings] == [("sensor_gain", "sensor:edge")]
    (gain,) = (e.value for e in found.findings[0].parameters.values())
    assert gain == pytest.approx(0.08, abs=0.002)


@pytest.mark.long
def test_check_prints_and_draws_the_readings(tmp_path):
    (tmp_path / "device.toml").write_text(TURNING + EDGE + TILT)
    said = run_command("check", tmp_path / "device.toml", "--figure", tmp_path / "m.svg")
    assert said.returncode == 0 and "  tilt: -" in said.stdout and "urad/um per coil" in said.stdout
    assert "edge" in (tmp_path / "m.svg").read_text()


@pytest.mark.long
def test_a_sensor_may_stand_on_a_reading_and_c_is_generated_beside_it(tmp_path):
    sensor = '[[sensor]]\nkind = "displacement"\nat = "edge"\nmodel = "3316"\n'
    (tmp_path / "device.toml").write_text(PARALLELOGRAM + EDGE + sensor)
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n'
        '[path]\nkind = "line"\nend = { delta_x = "40 um" }\n'
    )
    assert run(tmp_path, tmp_path / "out").passed


@pytest.mark.parametrize(
    ("reading", "says"),
    [
        (EDGE.replace('"edge"', '"delta_x"'), "reading: 'delta_x' is named twice"),
        (EDGE.replace('"stage"', '"table"'), "reading[0].body: 'table' is no body"),
        (EDGE.replace("along = [2, 0, 0]", "along = [0, 0, 0]"), "along: is zero"),
        (EDGE.replace("along = [2, 0, 0]", "along = [0, 0, 1]"), "what edge reads"),
        (EDGE.replace("along = [2, 0, 0]", "about = [0, 0, 1]"), "a rotation has no point"),
        (EDGE + "about = [0, 0, 1]\n", "give either along"),
        (EDGE + 'pattern = "leg"\n', "reading[0].pattern: 'leg' is no pattern"),
        (CELL.replace('"left"', '"lft"'), "reading[0].of: 'lft' is no element"),
        (CELL + 'body = "stage"\n', "of: the load of an element is read by itself; leave out body"),
        (CELL.replace('"F_y"', '"F_z"'), "no actuator moves (or loads) what cell reads"),
        (CELL.replace('of = "left"', 'body = "stage"'), "load: belongs to of"),
        ('[[reading]]\nname = "cell"\nalong = [1, 0, 0]\nat = ["0 mm", "0 mm", "0 mm"]\n', "body: is missing"),
    ],
)
def test_a_reading_that_cannot_be_is_refused(tmp_path, reading, says):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, PARALLELOGRAM + reading)
    assert says in str(caught.value)


def test_a_reading_may_move_in_second_order_alone(tmp_path):
    """-0.6 y^2/l of leaf springs that bend, seen along them: refused of the linear mechanism, where nothing moves it."""
    along = '[[reading]]\nname = "parasitic"\nbody = "stage"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\n'
    with pytest.raises(InputError, match="what parasitic reads"):
        loaded(tmp_path, PARALLELOGRAM + along)
    device = loaded(
        tmp_path, PARALLELOGRAM.replace("[[material]]", 'kinematics = "second_order"\n[[material]]', 1) + along
    )
    trace = simulate(build_model(device), np.full((2, 1), 0.2), 1e-3)
    y, nearer = trace.signals["reading"][-1]
    assert nearer == pytest.approx(-0.6 * y**2 / 20e-3, rel=1e-3)
    assert any(re.search(r"parasitic 2\.7\d* um", line) for line in summary(device))  # at 300 um


def test_the_loads_in_blades_are_those_of_the_textbook(tmp_path):
    """Each guided blade of a pair has half the force across, F/2, and F l/4 at its ends, which tension and pressure balance where the coil
    pushes at their ends; a constant load along them is tension of half."""
    cells = CELL + '[[reading]]\nname = "bent"\nof = "left"\nload = "M_z"\n[[reading]]\nname = "pulled"\nof = "right"\n'
    down = '[[load]]\nname = "w"\non = "stage"\nat = ["0 mm", "0 mm", "0 mm"]\nforce = ["0 N", "0.3 N", "0 N"]\n'
    model = build_model(loaded(tmp_path, TURNING + cells))
    assert model.signals["reading"].units[1:] == ("N", "N*m", "N")
    change = read(model, 0.05)
    still = read(build_model(loaded(tmp_path, TURNING + cells + down)), 0.0)
    # the blades' stretching turns the stage by a little
    assert abs(change["cell"]) == pytest.approx(12 * EI / L**3 * change["delta_x"], rel=1e-3)
    assert abs(change["bent"]) == pytest.approx(6 * EI / L**2 * change["delta_x"], rel=1e-3)
    assert abs(change["bent"]) == pytest.approx(abs(change["cell"]) * L / 2, rel=1e-3)
    assert abs(change["cell"]) == pytest.approx(0.05, rel=1e-3)
    assert abs(change["pulled"]) * 20e-3 == pytest.approx(2 * abs(change["bent"]), rel=1e-3)
    assert still["pulled"] == pytest.approx(0.15, rel=1e-3)


def test_a_blade_that_is_held_has_the_tension_of_its_stretch(tmp_path):
    """E A 0.6 (y/l)^2 of blades on both sides of a stage, which none of them lets come nearer; at a twentieth of their thickness."""
    both = blade("left", -10) + blade("right", 10)
    held = both + both.replace('"left"', '"left_2"').replace('"right"', '"right_2"').replace("[0, 1, 0]", "[0, -1, 0]")
    text = PARALLELOGRAM.replace(both, held.replace("slender = true", "slender = true\ngeometric_stiffening = true"))
    model = build_model(loaded(tmp_path, text + CELL.replace('load = "F_y"\n', "")))
    seen = read(model, 0.02)
    y = seen["delta_x"]
    assert y < T / 15
    pushed_on_one_side = read(model, -0.02)  # what is linear in y, from the coil beside the blades' middle, goes
    tension = (seen["cell"] + pushed_on_one_side["cell"]) / 2
    assert tension == pytest.approx(0.6 * E * T * W * (y / L) ** 2, rel=0.01)
