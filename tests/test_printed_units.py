"""The units that the generated C and its README print beside numbers, which are SI."""

from __future__ import annotations

import re

import pytest
from conftest import ROOT, SCENARIOS

from ctrlgen import build_model, generate, load_scenario
from ctrlgen.core.units import common_base_unit

OF_KIND = {
    "axis": "flexure_axis_line",
    "mechanism": "parallelogram_line",
    "mems_hexapod": "coupled_dof",
    "meso_hexapod": "meso_circle",
    "rrr_stage": "rrr_circle",
    "user": "tilt_platform",
}
NOTCH = re.search(r"```toml\n(.*?)```", (ROOT / "docs/howto/matrix_device.md").read_text(), re.DOTALL)[1]


def units_of(folder) -> tuple[str, list[str]]:
    """The unit that the README's example prints and those of the drives in its table."""
    text = (folder.path / "README.md").read_text()
    row = re.search(r"^\| `out\.drive\[.*", text, re.MULTILINE)[0]
    return re.search(r"drive\[%d\] = %g (.*)\\n", text)[1], re.findall(r"\[([^]]*)\](?:, | \|$)", row)


@pytest.fixture
def scenario(request, tmp_path):
    """The scenario of a name, or a line of the matrix of docs/howto/matrix_device.md."""
    if request.param != "matrix":
        return load_scenario(SCENARIOS / request.param)
    (tmp_path / "device.toml").write_text(NOTCH)
    path = '[path]\nkind = "line"\nstart = { delta_y = "1 um" }\nend = { delta_y = "2 um" }\n'
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "device.toml"\nsample_rate = "200 Hz"\nduration = "0.5 s"\n{path}'
    )
    return load_scenario(tmp_path)


@pytest.mark.parametrize("scenario", [*OF_KIND.values(), "matrix"], indirect=True)
def test_the_example_of_the_readme_prints_the_unit_of_the_interface_table(tmp_path, scenario):
    folder = generate(scenario, build_model(scenario.device), tmp_path / "c")
    printed, listed = units_of(folder)
    assert listed and {printed} == set(listed)
    for path in folder.path.rglob("*.[ch]"):
        assert not re.search(r"(deviation .* |\[|/\* )[num]m\b", path.read_text()), path.name


def test_every_kind_of_device_with_a_scenario_is_tried_above():
    folders = [path.parent for path in SCENARIOS.glob("*/scenario.toml")]
    assert {load_scenario(folder).device.kind for folder in folders} == set(OF_KIND)


def test_drives_of_different_units_are_said_to_be_in_si():
    assert common_base_unit(("um", "mm")) == "m" and common_base_unit(("mV", "A")) == "SI"
