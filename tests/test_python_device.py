"""Devices from a Python file: used wherever a device file is, changed by a TOML file, refused with the line that is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import ctrlgen as run_command

import ctrlgen
from ctrlgen import InputError, Unreachable, build_model, load_device, load_scenario, solve

STAGE = '''"""A piezo X-Y stage with levers, 0 to 150 V."""
import ctrlgen

device = ctrlgen.user_device(
    "xy_stage",
    title="piezo X-Y stage",
    parameters={"gain": ("0.2 N/V", "0.01 N/V"), "stiffness": {"value": "1 N/um", "source": "FEM"}, "cubic": "1e-4 N/um^3", "cross": "1 %"},
    drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
    axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
    force=lambda u, p: p.gain * u.vector,
    restoring_force=lambda d, p: p.stiffness * d.vector + p.cubic * d.vector**3,
    pose=lambda d, p: [d.x + p.cross * d.y, d.y - p.cross * d.x],
    limits={"stress": (lambda d, p: 1e13 * d.x, "250 MPa")},
)
'''
CIRCLE = """title = "circle"
device = "{device}"
sample_rate = "1 kHz"
duration = "0.05 s"
[path]
kind = "circle"
diameter = "{diameter}"
plane = ["x", "y"]
centre = {{ x = "12 um", y = "12 um" }}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "stage.py").write_text(STAGE)
    (tmp_path / "circle.toml").write_text(CIRCLE.format(device="stage.py", diameter="20 um"))
    return tmp_path


def test_a_scenario_may_name_a_python_file_which_is_part_of_its_origin(folder):
    scenario = load_scenario(folder / "circle.toml")
    solution = solve(scenario, build_model(scenario.device))
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-14
    assert solution.drive.min() > 0.0 and scenario.inputs["device"].text == STAGE


def test_limits_that_are_not_symmetric_and_on_expressions_are_kept_and_named(folder):
    for diameter, centre, says in (
        ("20 um", "4 um", "drive of x"),
        ("28 um", "14 um", "stress"),
        ("20 um", "22 um", "travel of x"),
    ):
        text = CIRCLE.format(device="stage.py", diameter=diameter).replace('x = "12 um"', f'x = "{centre}"')
        (folder / "circle.toml").write_text(text)
        scenario = load_scenario(folder / "circle.toml")
        with pytest.raises(Unreachable) as caught:
            solve(scenario, build_model(scenario.device))
        message = str(caught.value)
        assert says in message or (says == "travel of x" and "actuator x: needs" in message), message


def test_a_toml_file_changes_numbers_of_a_python_file_and_adds_effects(folder):
    (folder / "stage.toml").write_text(
        'kind = "python"\nfile = "stage.py"\n[mechanism]\nstiffness = "1.1 N/um"\n[[effect]]\nkind = "backlash"\nat = "x"\ngap = "0.5 um"\n'
    )
    device, own = load_device(folder / "stage.toml"), load_device(folder / "stage.py")
    changed = {path: q.text for path, q in device.quantities()}
    assert changed.pop("effect[0].gap") == "0.5 um" and changed.pop("mechanism.stiffness") == "1.1 N/um"
    assert changed == {path: q.text for path, q in own.quantities() if path != "mechanism.stiffness"}
    scenario = load_scenario(folder / "circle.toml", folder / "stage.toml")
    assert scenario.inputs["device_code"].text == STAGE and "1.1 N/um" in scenario.inputs["device"].text
    problem = scenario.bind(build_model(device))
    assert problem.inverse.trajectory(problem.motion).solved


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("import ctrlgen\n\nx = 1 / 0\n", "line 3: raised ZeroDivisionError"),
        ("def f(:\n", "line 1: raised SyntaxError"),
        ("x = 1\n", "device: is missing; end the file with device = ctrlgen.user_device(...)"),
        ("device = 3\n", "device: is int, and no device"),
        ("raise SystemExit(3)\n", "line 1: raised SystemExit"),
        (STAGE.replace('("0 V", "150 V")', '("150 V", "0 V")'), "drive.x: '150 V' is not below '0 V'"),
        (STAGE.replace('("0 V", "150 V")', '("0 V", "150 um")'), "are not of one dimension"),
        (STAGE.replace('("0 V", "150 V")', '("0 V",)'), "must be the lowest and the highest value"),
        (STAGE.replace('"250 MPa")},', '"250 MPa"), "other": 3},'), "limits.other: must be (law, largest value)"),
        (STAGE.replace("1e13 * d.x", "1e7 + 1e13 * d.x"), "limits.stress: is 1e+07 at home"),
        (
            STAGE.replace("1e13 * d.x", "1e13 * d.z"),
            "limits.stress: raised AttributeError: the displacement has no 'z'",
        ),
    ],
)
def test_what_is_wrong_with_a_python_file_is_said(folder, text, says):
    (folder / "stage.py").write_text(text)
    with pytest.raises(InputError) as caught:
        load_device(folder / "stage.py")
    assert says in str(caught.value)


def test_a_toml_file_that_names_no_python_file_or_an_unknown_number_is_refused(folder):
    for text, says in (
        ('kind = "python"\n', "file: must name the Python file"),
        ('kind = "python"\nfile = "other.py"\n', "does not exist"),
        ('kind = "python"\nfile = "stage.py"\n[mechanism]\nstifness = "1 N/um"\n', "did you mean 'stiffness'?"),
    ):
        (folder / "stage.toml").write_text(text)
        with pytest.raises(InputError) as caught:
            load_device(folder / "stage.toml")
        assert says in str(caught.value)


def with_ports(drive, axes, force):
    return ctrlgen.user_device(
        "stage",
        parameters={"k": "1 N/um", "g": "0.2 N/V"},
        drive=dict.fromkeys(drive, "100 V"),
        axes=dict.fromkeys(axes, "30 um"),
        force=force,
        restoring_force=lambda d, p: p.k * d.vector,
    )


@pytest.mark.parametrize(
    ("device", "says"),
    [
        (
            with_ports("abc", "xy", lambda u, p: [p.g * u.a * u.b, p.g * u.c]),
            "has 3 drives for 2 axes and has forces that are not linear",
        ),
        (with_ports("a", "xy", lambda u, p: [p.g * u.a, -0.5 * p.g * u.a]), "it moves only along x - 0.5 y"),
    ],
)
def test_more_or_fewer_drives_than_axes_are_refused_and_what_is_left_is_said(folder, device, says):
    (folder / "circle.toml").write_text(CIRCLE.format(device="stage", diameter="20 um"))
    scenario = load_scenario(folder / "circle.toml", device)
    with pytest.raises(InputError) as caught:
        solve(scenario, build_model(device))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    "path",
    [
        'kind = "circle"\ndiameter = "10 mrad"',
        'kind = "spiral"\ndiameter = "10 mrad"\nturns = 2',
        'kind = "raster"\nlength = "8 mrad"\nspacing = "1 mrad"\nlines = 3',
        'kind = "lissajous"\namplitudes = ["5 mrad", "3 mrad"]\nperiods = [1, 2]',
    ],
)
def test_every_path_is_also_one_of_angles(tmp_path, path):
    device = ctrlgen.user_device(
        "mirror",
        parameters={"k": "1 N*m/rad", "g": "1 mN*m/V"},
        drive={"a": "10 V", "b": "10 V"},
        axes={"tip": "20 mrad", "tilt": "20 mrad"},
        force=lambda u, p: p.g * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
    )
    file = tmp_path / "scenario.toml"
    file.write_text(
        f'title = "t"\ndevice = "mirror"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n[path]\n{path}\nplane = ["tip", "tilt"]\n'
    )
    solution = solve(load_scenario(file, device), build_model(device))
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-14
    assert solution.trace.signals["pose"].max() > 2e-3
    file.write_text(file.read_text().replace("mrad", "um"))
    with pytest.raises(InputError) as caught:
        solve(load_scenario(file, device), build_model(device))
    assert "is not of the dimension of tip" in str(caught.value)


@pytest.mark.long
def test_a_diagnosis_of_a_python_file_writes_the_next_device_as_toml(folder):
    model = build_model(load_device(folder / "stage.py"))
    rng = np.random.default_rng(2)
    lines = ['title = "t"', 'device = "xy_stage"', 'kind = "poses"', "[columns]"]
    lines += [
        f'"drive.{a}" = {{ column = "u{a}", unit = "V" }}\n"reading.{a}" = {{ column = "{a}", unit = "um" }}'
        for a in "xy"
    ]
    for role, count in (("fit", 30), ("hold_out", 15)):
        u = rng.uniform(10, 80, (count, 2))
        z = np.array([np.roots([1e-4, 0, 1, -0.2 * v])[-1].real for v in u.ravel()]).reshape(-1, 2)
        y = np.column_stack([z[:, 0] + 0.01 * z[:, 1], z[:, 1] - 0.01 * z[:, 0]])
        y[:, 0] *= 1.05  # the sensor of x reads too much
        y += 0.002 * rng.standard_normal(y.shape)
        np.savetxt(folder / f"{role}.csv", np.column_stack([u, y]), delimiter=",", header="ux,uy,x,y", comments="")
        lines += ["[[record]]", f'file = "{role}.csv"', f'role = "{role}"']
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    words = ("diagnose", folder / "stage.py", folder, "--out", folder / "report", "--laws", "sensor_gain,backlash")
    assert run_command(*words).returncode == 0
    after = load_device(folder / "report" / "device.next.toml")
    assert [e.kind for e in after.effect] == ["sensor_gain"] and after.effect[0].values["gain"].si == pytest.approx(
        0.05, abs=5e-3
    )
    assert model.device.name == after.name
