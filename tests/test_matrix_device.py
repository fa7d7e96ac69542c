"""A stage by its matrix: what it makes of the numbers of a file, and what it refuses."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import ROOT
from mechanism_files import HEAD, dm

from ctrlgen import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.model.assembly import build_model
from ctrlgen.physics.screw import TWIST

NOTCH, MEASURED = re.findall(r"```toml\n(.*?)```", (ROOT / "docs/howto/matrix_device.md").read_text(), re.DOTALL)
# S1 eq. (7), its symmetric part: theta_z/F_y = delta_y/M_z and theta_y/F_z = delta_z/M_y as the mean of both prints [SI]
Y, ZY = 301e-6, (7.10 + 7.11) / 2


def read(text: str, **changes: object) -> Device:
    table = tomllib.loads(text) | changes
    return validate(Device.library[table["kind"]], table, "device.toml")


def moved(device: Device, d: list[float]) -> np.ndarray:
    """What the readings are with the axes displaced by d."""
    physics = device.physics(device.values())
    return np.concatenate([dm(physics.pose(np.array(d))), dm(physics.sensed.at(np.array(d)))]).ravel()


def test_the_printed_notch_is_taken_by_its_mean_and_says_so():
    device = read(NOTCH)
    assert [r for r in device.remarks() if "0.14 %" in r and "not symmetric" in r]
    assert np.allclose(moved(device, [1e-6]), [1e-6, ZY / Y * 1e-6], rtol=1e-12)
    physics = device.physics(device.values())
    assert np.isclose(dm(physics.restoring_force(np.array([1e-6])))[0, 0], 1e-6 / Y, rtol=1e-12)
    assert {path for path, q in device.quantities() if q.sd} >= {"compliance[2][5]", "compliance[4][1]"}


def as_texts(matrix: np.ndarray, unit) -> list[list[str]]:
    return [[f"{x!r} {unit(i, j)}" for j, x in enumerate(map(float, row))] for i, row in enumerate(matrix)]


PUSHES = [
    {"name": "a", "at": ["3 mm", "1 mm", "0 mm"], "along": [0, 1, 1], "gain": "1 N/V", "low": "-1 V", "high": "1 V", "travel": "9 um",
     "stiffness": "0.3 N/um"},
    {"name": "b", "at": ["-2 mm", "0 mm", "4 mm"], "along": [1, 0, 0], "gain": "1 N/V", "low": "-1 V", "high": "1 V", "travel": "9 um"},
]  # fmt: skip


def test_compliance_stiffness_and_a_mechanism_of_one_element_are_the_same_stage():
    """Against the assembly of a mechanism, whose only element has this compliance, and its inverse as a stiffness; the order of rows
    and columns is the reader's."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(6, 6)) * np.array([[30.0]] * 3 + [[0.1]] * 3)  # (theta; delta) per (M; F), turns at some mm
    C = 1e-5 * (A @ A.T + np.diag(np.diag(A @ A.T)))
    order, si = rng.permutation(6), ["rad", "rad", "rad", "m", "m", "m", "N*m", "N*m", "N*m", "N", "N", "N"]
    loads = np.array(["M_x", "M_y", "M_z", "F_x", "F_y", "F_z"])
    common = {
        "kind": "matrix", "name": "m", "title": "t", "source": "s", "at": ["1 mm", "2 mm", "3 mm"],
        "directions": [TWIST[i] for i in order], "channels": ["delta_x", "theta_z"], "readings": ["theta_x"], "actuator": PUSHES,
    }  # fmt: skip
    shuffled = rng.permutation(6)
    yields = {
        "loads": loads[shuffled].tolist(),
        "compliance": as_texts(C[np.ix_(order, shuffled)], lambda i, j: f"{si[order[i]]}/({si[6 + shuffled[j]]})"),
    }
    holds = {
        "stiffness": as_texts(
            np.linalg.inv(C)[np.ix_(order, order)], lambda i, j: f"({si[6 + order[i]]})/{si[order[j]]}"
        )
    }
    rows = C[:, [3, 4, 5, 0, 1, 2]].tolist()  # columns (F; M)
    text = HEAD + (
        '[[body]]\nname = "s"\n[[element]]\nkind = "matrix"\nname = "e"\nfrom = "ground"\nto = "s"\nat = ["1 mm", "2 mm", "3 mm"]\n'
        f'compliance_si = {rows}\n[output]\nbody = "s"\nat = ["1 mm", "2 mm", "3 mm"]\nchannels = ["delta_x", "theta_z"]\n'
        '[[reading]]\nname = "theta_x"\nbody = "s"\nabout = [1, 0, 0]\n'
    )
    pushed = [a | {"kind": "force", "on": "s"} for a in PUSHES]
    drawn = read(text, actuator=pushed)
    d = [3e-6, -2e-6]
    expected, K = moved(drawn, d), dm(nominal(drawn).held_stiffness)
    for form in (yields, holds):
        device = validate(Device.library["matrix"], common | form, "device.toml")
        # the condition of the matrix times roundings
        assert np.allclose(moved(device, d), expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())
        physics = device.physics(device.values())
        assert np.allclose(dm(physics.restoring_force(np.array(d))), K @ np.array(d)[:, None], rtol=1e-8)


def test_a_jacobian_is_what_its_entries_say():
    device = read(MEASURED)
    u = np.array([100.0, 50.0])
    J = np.array([[0.21e-6, 3e-9], [-2e-9, 0.19e-6], [0.1e-6, 0.3e-6]])
    assert np.allclose(moved(device, u), J @ u, rtol=1e-12)
    assert {limit.text for limit in build_model(device).limits} >= {"0 V <= drive of px <= 120 V"}


def test_a_zero_has_the_unit_of_its_place():
    """Found otherwise it is told, and written into the next file, as a number that the file takes: of its row, of another, or in SI."""
    text = MEASURED.replace('"3 nm/V"', "0").replace('["0.1 urad/V", "0.3 urad/V"]', "[0, 0]")
    device = read(text, readings=[])
    units = {path: q.text for path, q in device.quantities() if path.startswith("jacobian") and not q.si}
    assert units == {"jacobian[0][1]": "0 um/V", "jacobian[2][0]": "0 rad/V", "jacobian[2][1]": "0 rad/V"}
    assert read(text, readings=[], jacobian=[["0.21 um/V", units["jacobian[0][1]"]], ["-2 nm/V", "0.19 um/V"], [0, 0]])
    notch = read(NOTCH)
    assert all(q.text != "0" for path, q in notch.quantities() if path.startswith("compliance"))


WRONG = {
    (r'"-0.802 rad/N"', '"0.802 rad/N"'): "rows theta_y and delta_z: what stands across the diagonal differs by",
    (r'"9.12e-2 rad/\(N', '"-9.12e-2 rad/(N'): "not positive definite: on the diagonal theta_x must be above zero",
    (r'"7.10 rad/N"', '"7.10 um/N"'): r"compliance\[2\]\[1\]: theta_z per F_y = '7.10 um/N' has the wrong unit",
    (r'"7.1[01] ', '"7.4 '): "a load along theta_z, delta_y together would gain energy",
    (r'"F_y", "F_z", "M_x"', '"F_y", "F_y", "M_x"'): "loads: must be those of the directions in any order",
    (r'channels = \["delta_y"\]', 'channels = ["delta_x"]'): "no actuator moves delta_x",
    (r'channels = \["delta_y"\]', 'channels = ["delta_y", "delta_z"]'): "2 channels, 1 actuator",
    (r", 0, 0\],", ", 0],"): "must have 6 rows of 6 entries",
    (r"gain = \{.*\}", ""): "gain: is missing",
    (r"compliance = ", "jacobian = [[0]]\ncompliance = "): "give one matrix",
}


def test_what_is_no_matrix_is_refused_by_its_rows():
    for (old, new), says in WRONG.items():
        text, count = re.subn(old, new, NOTCH)
        assert count, old
        with pytest.raises(InputError, match=says):
            read(text)
    # measured to 5 %, entries may differ by more than what is printed: by three standard deviations of their difference
    apart = NOTCH.replace('"7.11 um/(N*um)"', '{ value = "6.7 um/(N*um)", sd = "5 %" }')
    assert any("not symmetric by 5.5 %" in remark for remark in read(apart).remarks())
    with pytest.raises(InputError, match="rows theta_z and delta_y"):
        read(NOTCH.replace('"7.11 um/(N*um)"', '"6.7 um/(N*um)"'))
    both = re.sub(r"name = .py.", 'name = "px"', MEASURED)
    with pytest.raises(InputError, match="'px' is named twice"):
        read(both)
    alike = [tomllib.loads(NOTCH)["actuator"][0] | {"name": name} for name in "ab"]
    with pytest.raises(InputError, match="a, b push only together"):
        read(NOTCH, actuator=alike, channels=["delta_y", "theta_z"], readings=[])
    with pytest.raises(InputError, match="delta_x, delta_y move only together"):
        read(MEASURED, jacobian=[["2 um/V", "1 um/V"], ["4 nm/V", "2 nm/V"], ["1 urad/V", "3 urad/V"]])
    with pytest.raises(InputError, match="a jacobian states the motion per drive"):
        read(MEASURED + 'gain = "1 N/V"\n')


def test_a_subset_of_directions_tells_what_else_is_pushed():
    hinge = read(
        NOTCH,
        directions=["theta_z"], loads=["M_z"], compliance=[["0.178 rad/(N*um)"]], channels=["theta_z"], readings=[],
        actuator=[PUSHES[0] | {"at": ["100 um", "0 um", "0 um"], "along": [0, 1, 0]}],
    )  # fmt: skip
    assert hinge.remarks() == ["a also pushes by F_y, of which the compliance says nothing"]
    slider = read(
        NOTCH,
        directions=["delta_y"], loads=["F_y"], compliance=[["0.301 um/N"]], channels=["delta_y"], readings=[],
        actuator=[PUSHES[0] | {"at": ["100 um", "0 um", "0 um"], "along": [0, 1, 0]}],
    )  # fmt: skip
    assert slider.remarks() == ["a also pushes by M_z, of which the compliance says nothing"]
    physics = hinge.physics(hinge.values())
    assert np.isclose(dm(physics.pose(np.array([1e-6])))[0, 0], 1e-6 / 100e-6)  # an arm of 100 um


@pytest.mark.long
def test_the_c_of_both_does_what_the_model_does(tmp_path):
    for name, text, path in (
        ("notch", NOTCH, 'kind = "line"\nstart = { delta_y = "3 um" }\nend = { delta_y = "11 um" }'),
        (
            "measured",
            MEASURED,
            'kind = "circle"\ndiameter = "10 um"\ncentre = { delta_x = "12 um", delta_y = "11 um" }',
        ),
    ):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "device.toml").write_text(text)
        scenario = f'title = "t"\ndevice = "device.toml"\nsample_rate = "200 Hz"\nduration = "0.5 s"\n[path]\n{path}\n'
        (folder / "scenario.toml").write_text(scenario)
        done = ctrlgen("run", folder, "--out", tmp_path / f"out_{name}")
        assert done.returncode == 0 and "comparisons within tolerance" in done.stdout, done.stdout + done.stderr
