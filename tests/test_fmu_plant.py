"""The plant as a co-simulation unit and in C: it moves as the model."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS, effect_device
from fmu_units import CREEP, DELAY, MEAN, apart, axis_scenario, fmpy, opened, run_plant

from ctrlgen import build_model, load_scenario, simulate
from ctrlgen.firmware.c.deviations import permits
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.fmi.fmu import write_fmus
from ctrlgen.firmware.fmi.plant import plant_of, write_plant


@pytest.mark.long
@pytest.mark.parametrize("name", ["meso_circle", "rrr_circle"])
def test_plants_without_memory_or_with_coupled_stages_move_as_the_model(name, compiler, tmp_path, rng):
    scenario = load_scenario(SCENARIOS / name)
    model = build_model(scenario.device)
    made = write_fmus(scenario, tmp_path / "out")
    low, high = model.u_bounds
    drives = low + rng.uniform(0.3, 0.6, size=(60, len(low))) * (high - low)
    expected = simulate(model, drives, scenario.sample_time)
    with opened(made.paths[1], tmp_path / "unit") as unit:
        ours = run_plant(unit, drives, ["pose", "displacement"])
    assert apart(ours["pose"], expected.signals["pose"]) < 1e-12
    assert apart(ours["displacement"], expected.signals["displacement"]) < 1e-12


@pytest.mark.parametrize("effect", [CREEP, DELAY, MEAN], ids=["creep", "delay", "mean"])
def test_memories_of_effects_are_in_the_plant(effect, circle, compiler, tmp_path):
    scenario = replace(load_scenario(SCENARIOS / "circle20"), device=effect_device(effect))
    plant = plant_of(scenario)
    sources = tmp_path / "c"
    name = write_plant(scenario, plant, Real.DOUBLE, sources)
    drives = circle.drive[:100]
    expected = simulate(plant.model, drives, 1e-3).signals
    ours = run_c(compiler, sources, name, plant, drives, Real.DOUBLE)
    assert apart(ours, expected["reading"]) < 1e-12
    assert apart(simulate(circle.model, drives, 1e-3).signals["reading"], expected["reading"]) > 1e-3


@pytest.mark.parametrize("real", list(Real))
def test_the_plant_in_c_compiles_strictly_in_both_arithmetics(real, circle, compiler, tmp_path):
    plant = plant_of(circle.scenario)
    name = write_plant(circle.scenario, plant, real, tmp_path)
    expected = simulate(plant.model, circle.drive, 1e-3).signals["reading"]
    ours = run_c(compiler, tmp_path, name, plant, circle.drive, real)
    if real is Real.DOUBLE:
        assert apart(ours, expected) < 1e-12
    else:  # as much as a float controller may miss its pose by
        off = np.abs(ours - expected).max(axis=0)
        assert np.all(off[:3] < 1e-8) and np.all(off[3:] < 1e-10), off
        text = re.sub(r"/\*.*?\*/", "", (tmp_path / f"{name}.c").read_text(), flags=re.DOTALL)
        assert "double" not in text and not re.search(r"\d\.\d+(e-?\d+)?[^\de.f]", text)


def run_c(compiler: str, folder: Path, name: str, plant, drives: np.ndarray, real: Real) -> np.ndarray:
    """The readings of the plant's C, at the start and at the end of every sample."""
    m, channels = plant.model, len(plant.model.signals["reading"].channels)
    rows = ",\n".join("{" + ", ".join(real.literal(v) for v in row) + "}" for row in drives)
    show = f'for (i = 0; i < {channels}; i++) {{ (void)printf("%.17g ", (double)out.reading[i]); }}'
    (folder / "main.c").write_text(f"""#include "{name}.h"
#include <stdio.h>
static const {real.value} drives[{len(drives)}][{m.u.numel()}] = {{ {rows} }};
int main(void)
{{
    {name}_state state;
    {name}_output out;
    uint32_t status = {name}_init(&state, drives[0]);
    int k;
    int i;
    status |= {name}_signals(&state, drives[0], &out);
    {show}
    for (k = 0; k < {len(drives)}; k++) {{
        status |= {name}_step(&state, drives[k], &out);
        {show}
    }}
    return (int)status;
}}
""")
    sources = [str(folder / "main.c"), str(folder / f"{name}.c")]
    built = subprocess.run([compiler, *FLAGS, *sources, "-o", str(folder / "main")], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([folder / "main"], capture_output=True, text=True)
    assert done.returncode == 0, done
    return np.array(done.stdout.split(), dtype=float).reshape(-1, channels)


HYSTERETIC = """
[[effect]]
kind = "bouc_wen"
at = "axis"
stiffness = "0.01 N/um"
reach = "2 um"
loop = "0.7"
"""
STICKING = """
[[effect]]
kind = "coulomb"
at = "axis"
force = "0.5 N"
reach = "0.1 um"
smoothing = "0.1 mm/s"
"""
CONTROLLED = """
[loop]
position_gain = "100 1/s"
velocity_gain = "10 V/(m/s)"
integral_gain = "1e4 V/(m*s)"
"""


@pytest.mark.long
@pytest.mark.parametrize(
    "more", ["", HYSTERETIC, STICKING, CONTROLLED], ids=["bare", "hysteresis", "dry friction", "in closed loop"]
)
def test_a_plant_with_inertia_moves_as_the_model_and_has_a_controller_where_its_motion_says_all(
    more, compiler, tmp_path, rng
):
    (tmp_path / "axis").mkdir()
    scenario = axis_scenario(tmp_path / "axis", more)
    made = write_fmus(scenario, tmp_path / "out")
    controller = [] if more else ["axis_controller.fmu"]
    assert [path.name for path in made.paths] == [*controller, "axis_plant.fmu"]
    assert ("no controller" in made.remark) == bool(more)
    assert all(fmpy.validation.validate_fmu(str(path)) == [] for path in made.paths)
    model = build_model(scenario.device)
    drives = 0.3 * rng.normal(size=(200, 1)) * model.u_scale
    expected = simulate(model, drives, scenario.sample_time).signals["pose"]
    with opened(made.paths[-1], tmp_path / "unit") as unit:
        ours = run_plant(unit, drives, ["pose"])["pose"]
    assert np.ptp(expected) > 1e-7 and apart(ours, expected) < 1e-12


@pytest.mark.long
@pytest.mark.parametrize("kind", ["circle", "rrr_circle", "axis"])
def test_nothing_required_by_misra_is_reported_for_a_plant(kind, circle, tmp_path):
    if not shutil.which("cppcheck"):
        pytest.skip("cppcheck is missing, MISRA was not checked: apt-get install cppcheck")
    made = {"circle": lambda: circle.scenario, "axis": lambda: axis_scenario(tmp_path)}
    scenario = made[kind]() if kind in made else load_scenario(SCENARIOS / kind)
    name = write_plant(scenario, plant_of(scenario), Real.DOUBLE, tmp_path)
    path = str(tmp_path / f"{name}.c")
    command = ["cppcheck", "--addon=misra", "--std=c99", "--quiet", "--template={id} {line}", path]
    done = subprocess.run(command, capture_output=True, text=True)
    found = {line.split()[0] for line in done.stderr.splitlines()}
    assert "misra-c2012-8.9" in found  # an advisory that the tables earn: the rules were read
    found = {rule for rule in found if not permits(rule.removeprefix("misra-c2012-"), f"{name}.c")}
    assert found <= ADVISORY, (found - ADVISORY, done.stderr[:2000])


# Advisory, not required: one return, objects in blocks, unused names of headers, external linkage, one break a loop.
ADVISORY = {
    "misra-c2012-15.5",
    "misra-c2012-8.7",
    "misra-c2012-2.5",
    "misra-c2012-15.4",
    "misra-c2012-8.9",
    "misra-c2012-2.3",
}
