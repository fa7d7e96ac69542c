"""The co-simulation units: valid FMI, run by FMPy, equal to controller and model; the plant's C by itself."""

from __future__ import annotations

import re
import shutil
import subprocess
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import AXIS_FILE, SCENARIOS, effect_device

from ctrlgen import ControllerStatus, InputError, build_model, load_scenario, simulate
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.deviations import permits
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.fmi.fmu import write_fmus
from ctrlgen.firmware.fmi.plant import plant_of, write_plant

fmpy = pytest.importorskip("fmpy", reason="FMPy is missing, the units were not run: pip install 'ctrlgen[fmi]'")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

CREEP = {"kind": "creep", "at": "all", "gain": "0.03", "tau": "20 ms", "slow": "0.3"}
DELAY = {"kind": "delay", "at": "all", "delay": "2.5 ms"}


class Unit:
    """One instance of an FMU, stepped by its sample time; variables by name, or by the beginning of their names."""

    def __init__(self, path: Path, folder: Path, **start: bool) -> None:
        self.about = fmpy.read_model_description(str(path))
        if not folder.exists():  # a loaded library must not be written over
            fmpy.extract(str(path), str(folder))
        self.three = self.about.fmiVersion == "3.0"
        self.fmu = (FMU3Slave if self.three else FMU2Slave)(
            guid=self.about.guid, unzipDirectory=str(folder), modelIdentifier=self.about.coSimulation.modelIdentifier
        )
        self.fmu.instantiate()
        self.sample_time = float(self.about.defaultExperiment.stepSize)
        self.start_settled = start.get("start_settled", False)

    def references(self, what: str) -> list[int]:
        """Value references of the variable `what`, or of `what_...`, in their order."""
        found = [v.valueReference for v in self.about.modelVariables if v.name == what or v.name.startswith(f"{what}_")]
        assert found, what
        return found

    def set(self, what: str, values: np.ndarray) -> None:
        (self.fmu.setFloat64 if self.three else self.fmu.setReal)(self.references(what), list(map(float, values)))

    def get(self, what: str) -> np.ndarray:
        return np.array((self.fmu.getFloat64 if self.three else self.fmu.getReal)(self.references(what)))

    @property
    def status(self) -> int:
        return (self.fmu.getInt32 if self.three else self.fmu.getInteger)(self.references("status"))[0]

    def begin(self, what: str, values: np.ndarray, seen: str = "", at: float = 0.0) -> np.ndarray | None:
        """Initialized with these inputs; the output `seen` as it is before initialization ends."""
        if self.start_settled:
            self.fmu.setBoolean(self.references("start_settled"), [True])
        if self.three:
            self.fmu.enterInitializationMode(startTime=at)
        else:
            self.fmu.setupExperiment(startTime=at)
            self.fmu.enterInitializationMode()
        self.set(what, values)
        early = self.get(seen) if seen else None
        self.fmu.exitInitializationMode()
        self.time = at
        return early

    def step(self, samples: float = 1) -> None:
        size = samples * self.sample_time
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@pytest.fixture(scope="module", params=[3, 2], ids=["FMI 3.0", "FMI 2.0"])
def units(request, tmp_path_factory, compiler):
    """Controller and plant of the circle."""
    folder = tmp_path_factory.mktemp("fmu")
    made = write_fmus(load_scenario(SCENARIOS / "circle20"), folder / "out", request.param)
    assert [path.name for path in made.paths] == ["circle20_controller.fmu", "circle20_plant.fmu"] and made.binary
    return made.paths


@contextmanager
def opened(path: Path, folder: Path, **start: bool):
    """A unit, ended and freed afterwards."""
    unit = Unit(path, folder, **start)
    try:
        yield unit
    finally:
        unit.close()


def apart(ours: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, per channel's largest size."""
    size = np.maximum(np.max(np.abs(expected), axis=0), 1e-300)
    return float(np.max(np.abs(ours - expected) / size))


def run_plant(unit: Unit, drives: np.ndarray, roles: list[str]) -> dict[str, np.ndarray]:
    """Outputs at the start and at the end of every sample."""
    unit.begin("drive", drives[0])
    rows = {role: [unit.get(role)] for role in roles}
    for drive in drives:
        unit.set("drive", drive)
        unit.step()
        for role in roles:
            rows[role].append(unit.get(role))
    return {role: np.array(values) for role, values in rows.items()}


def test_the_units_are_valid_fmi(units):
    for path in units:
        assert validate_fmu(str(path)) == []
    about = fmpy.read_model_description(str(units[1]))
    drive = next(v for v in about.modelVariables if v.name == "drive_1X")
    heat = next(u for u in about.unitDefinitions if u.name == "W")
    assert (drive.unit, heat.baseUnit.kg, heat.baseUnit.m, heat.baseUnit.s) == ("W", 1, 2, -3)
    display = next(u for u in about.unitDefinitions if u.name == "K").displayUnits[0]
    assert (display.name, display.factor, display.offset) == ("degC", 1.0, -273.15)


@pytest.mark.long
def test_the_same_input_gives_the_same_bytes(units, tmp_path):
    fmi = 3 if fmpy.read_model_description(str(units[0])).fmiVersion == "3.0" else 2
    again = write_fmus(load_scenario(SCENARIOS / "circle20"), tmp_path / "out", fmi)
    for path, other in zip(units, again.paths, strict=True):
        assert path.read_bytes() == other.read_bytes(), path.name


def test_the_controller_answers_as_the_reference(units, circle, tmp_path):
    controller, (path, _) = controller_of(circle.model, "pose", 1e-3), units
    state, ours, expected = controller.rest(), [], []
    with opened(path, tmp_path / "unit") as unit:
        unit.begin("target", circle.command[0])
        for target in circle.command[:400]:
            step = controller.step(state, target)
            state = step.state
            unit.set("target", target)
            unit.step()
            ours.append(np.concatenate([unit.get("drive"), unit.get("displacement"), unit.get("state")]))
            expected.append(np.concatenate([step.drive, step.displacement, step.actuator_state]))
            assert unit.status == step.status
    assert apart(np.array(ours), np.array(expected)) < 1e-12


def test_the_plant_moves_as_the_model(units, circle, tmp_path):
    expected = simulate(circle.model, circle.drive, 1e-3)
    roles = [role for role in expected.signals if role != "drive"]
    with opened(units[1], tmp_path / "unit") as unit:
        ours = run_plant(unit, circle.drive, roles)
    for role in roles:
        now = slice(1, None) if role == "power" else slice(None)  # a feedthrough shows the drive that has just acted
        there = circle.drive if role == "power" else expected.signals[role]
        assert apart(ours[role][now], there) < 1e-12, role


def test_coupled_they_trace_the_circle(units, circle, tmp_path):
    """Settled at the first pose, then controller before plant at every sample: within what the report promises."""
    path = np.vstack([circle.command[1:], circle.command[:1]])
    with (
        opened(units[0], tmp_path / "c", start_settled=True) as controller,
        opened(units[1], tmp_path / "p", start_settled=True) as plant,
    ):
        controller.begin("target", circle.command[0])
        plant.begin("drive", controller.get("drive"))
        reached = [plant.get("pose")]
        for target in path:
            controller.set("target", target)
            controller.step()
            assert controller.status == 0
            plant.set("drive", controller.get("drive"))
            plant.step()
            reached.append(plant.get("pose"))
    off = np.abs(np.array(reached) - np.vstack([circle.command[:1], path])).max(axis=0)
    assert np.all(off[:3] < 1e-12) and np.all(off[3:] < 1e-11), off


def test_a_controller_whose_drives_have_rates_starts_settled_however_many_samples_that_takes(tmp_path, compiler):
    """100 V at 10 V a sample, then four drives that trace a circle of three axes."""
    scenario = load_scenario(SCENARIOS / "tilt_platform")
    command = scenario.command(build_model(scenario.device))
    paths = write_fmus(scenario, tmp_path / "out").paths
    with (
        opened(paths[0], tmp_path / "c", start_settled=True) as controller,
        opened(paths[1], tmp_path / "p", start_settled=True) as plant,
    ):
        controller.begin("target", command[0])
        plant.begin("drive", controller.get("drive"))
        assert controller.status == 0 and controller.get("drive").shape == (4,) and np.all(controller.get("drive") > 50)
        reached = [plant.get("pose")]
        for target in command[1:]:
            controller.set("target", target)
            controller.step()
            assert controller.status == 0
            plant.set("drive", controller.get("drive"))
            plant.step()
            reached.append(plant.get("pose"))
    off = np.abs(np.array(reached) - command).max(axis=0)
    assert np.all(off[:2] < 1e-12) and off[2] < 1e-11, off  # rad, m: as the circle's


def test_fmpys_own_loop_runs_the_plant(units, circle):
    names = [f"drive_{axis}" for axis in circle.model.axes]
    rows = [(1e-3 * k, *drive) for k, drive in enumerate(circle.drive[:50])]
    given = np.array(rows, dtype=[("time", float), *((name, float) for name in names)])
    outputs = ["state_1X", "pose_delta_z"]
    done = fmpy.simulate_fmu(str(units[1]), stop_time=0.05, output_interval=1e-3, input=given, output=outputs)
    expected = simulate(circle.model, circle.drive[:50], 1e-3)
    assert len(done) == 51
    assert apart(done["state_1X"], expected.signals["state"][:, 0]) < 1e-9
    assert apart(done["pose_delta_z"], expected.signals["pose"][:, 5]) < 1e-9


def test_a_communication_step_may_be_several_samples_and_nothing_else(units, circle, tmp_path):
    with opened(units[1], tmp_path / "a") as one, opened(units[1], tmp_path / "b") as other:
        one.begin("drive", circle.drive[0])
        other.begin("drive", circle.drive[0])
        one.step(3)
        for _ in range(3):
            other.step()
        assert np.array_equal(one.get("pose"), other.get("pose"))
        before = one.get("pose")
        for samples in (0.5, 1.3, 1.5, 0.0, -1.0, np.nan):
            with pytest.raises(FMICallException):
                one.fmu.doStep(currentCommunicationPoint=one.time, communicationStepSize=samples * 1e-3)
        with pytest.raises(FMICallException):
            one.fmu.doStep(currentCommunicationPoint=one.time + 1e-3, communicationStepSize=1e-3)
        assert np.array_equal(one.get("pose"), before)
        one.step()
        assert not np.array_equal(one.get("pose"), before)


def test_a_state_can_be_kept_and_sent_and_foreign_ones_are_refused(units, circle, tmp_path):
    paths = {"drive": units[1], "target": units[0]}
    inputs = {"drive": circle.drive, "target": circle.command}
    for what, path in paths.items():
        with opened(path, tmp_path / what) as unit, opened(path, tmp_path / f"{what}2") as other:
            unit.begin(what, inputs[what][0])
            other.begin(what, inputs[what][7])
            unit.step()
            three = unit.three
            kept = unit.fmu.getFMUState() if three else unit.fmu.getFMUstate()
            sent = unit.fmu.serializeFMUState(kept) if three else unit.fmu.serializeFMUstate(kept)
            unit.step(5)
            later = unit.get("displacement")
            (unit.fmu.setFMUState if three else unit.fmu.setFMUstate)(kept)
            unit.time = 1e-3
            assert not np.array_equal(unit.get("displacement"), later)
            unit.step(5)
            assert np.array_equal(unit.get("displacement"), later)
            (unit.fmu.freeFMUState if three else unit.fmu.freeFMUstate)(kept)
            received = (other.fmu.deserializeFMUState if three else other.fmu.deSerializeFMUstate)(sent)
            (other.fmu.setFMUState if three else other.fmu.setFMUstate)(received)
            (other.fmu.freeFMUState if three else other.fmu.freeFMUstate)(received)
            other.time = 1e-3
            other.step(5)
            assert np.array_equal(other.get("displacement"), later)
            for wrong in (bytes(len(sent)), sent[:-1]):
                with pytest.raises(FMICallException):
                    (other.fmu.deserializeFMUState if three else other.fmu.deSerializeFMUstate)(wrong)


def test_two_instances_of_one_library_do_not_disturb_each_other(units, circle, tmp_path):
    drives = circle.drive[:20]
    with opened(units[1], tmp_path / "a") as alone:
        expected = run_plant(alone, drives, ["pose"])["pose"]
    with opened(units[1], tmp_path / "b") as one, opened(units[1], tmp_path / "b") as other:
        one.begin("drive", drives[0])
        other.begin("drive", drives[-1])
        for k, drive in enumerate(drives):
            one.set("drive", drive)
            one.step()
            other.set("drive", drives[-1 - k])
            other.step()
            assert np.array_equal(one.get("pose"), expected[k + 1])
        assert not np.array_equal(other.get("pose"), expected[-1])


def test_a_reset_unit_starts_anew(units, circle, tmp_path):
    with opened(units[1], tmp_path / "unit") as unit:
        first = run_plant(unit, circle.drive[:5], ["pose"])["pose"]
        unit.fmu.reset()
        assert np.array_equal(run_plant(unit, circle.drive[:5], ["pose"])["pose"], first)


def test_what_is_not_a_number_is_answered_safely(units, circle, tmp_path):
    with opened(units[0], tmp_path / "c", start_settled=True) as controller:
        controller.begin("target", circle.command[0])
        assert controller.status == 0 and np.all(controller.get("drive") > 0)
        controller.set("target", np.full(6, np.nan))
        controller.step()
        assert controller.status == ControllerStatus.INPUT and np.all(controller.get("drive") == 0)
        controller.set("target", circle.command[1])
        controller.step(40)
        assert controller.status == 0 and np.all(controller.get("drive") > 0)
    with opened(units[1], tmp_path / "p") as plant:
        plant.begin("drive", circle.drive[0])
        plant.set("drive", np.full(6, np.nan))
        with pytest.raises(FMICallException):
            plant.step()
        plant.set("drive", circle.drive[0])
        plant.step()
        assert np.all(np.isfinite(plant.get("pose")))


def test_outputs_and_foreign_tokens_are_not_taken(units, circle, tmp_path):
    with opened(units[1], tmp_path / "p") as plant:
        plant.begin("drive", circle.drive[0])
        with pytest.raises(FMICallException):
            plant.set("pose", np.zeros(6))
        with pytest.raises(FMICallException):
            plant.fmu.setBoolean(plant.references("start_settled"), [True])
    unit = Unit(units[1], tmp_path / "q")
    unit.fmu.guid = "{another}"
    with pytest.raises(Exception, match="nstantiate"):
        unit.fmu.instantiate()


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


@pytest.mark.parametrize("effect", [CREEP, DELAY], ids=["creep", "delay"])
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


def axis_scenario(folder: Path, more: str = ""):
    """A scenario on the axis with inertia, with `more` in its device file."""
    (folder / "device.toml").write_text(AXIS_FILE.read_text() + more)
    (folder / "scenario.toml").write_text(
        'title = "a line"\ndevice = "device.toml"\nsample_rate = "2 kHz"\n'
        'duration = "0.1 s"\n[path]\nkind = "line"\nstart = {}\nend = { axis = "10 um" }\n'
    )
    return load_scenario(folder)


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
    assert all(validate_fmu(str(path)) == [] for path in made.paths)
    model = build_model(scenario.device)
    drives = 0.3 * rng.normal(size=(200, 1)) * model.u_scale
    expected = simulate(model, drives, scenario.sample_time).signals["pose"]
    with opened(made.paths[-1], tmp_path / "unit") as unit:
        ours = run_plant(unit, drives, ["pose"])["pose"]
    assert np.ptp(expected) > 1e-7 and apart(ours, expected) < 1e-12


def test_settling_finds_the_equilibrium(units, circle, tmp_path):
    drives = circle.drive[250]
    with opened(units[1], tmp_path / "unit", start_settled=True) as unit:
        early = unit.begin("drive", drives, seen="pose")
        pose = unit.get("pose")
        assert np.array_equal(early, pose)
        unit.step(10)
        assert np.max(np.abs(unit.get("pose") - pose)) < 1e-15
    long = simulate(circle.model, np.tile(drives, (3, 1)), 100.0).signals["pose"][-1]
    assert apart(pose[None], long[None]) < 1e-9


def test_a_scenario_without_sample_rate_is_refused(tmp_path):
    with pytest.raises(InputError, match="sample_rate"):
        write_fmus(load_scenario(SCENARIOS / "xy_stage_force"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_without_a_compiler_there_are_sources_only_and_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    made = write_fmus(load_scenario(SCENARIOS / "circle20"), tmp_path / "out")
    assert made.binary is None and "no C compiler" in made.remark
    for path in made.paths:
        assert validate_fmu(str(path)) == []
        assert fmpy.supported_platforms(str(path)) in ([], ["c-code"])


@pytest.mark.long
@pytest.mark.parametrize("fmi", [3, 2])
def test_the_calls_are_declared_as_in_the_standards_own_headers(fmi, compiler, tmp_path):
    """Our types are cut out and the official header, which FMPy brings, is put in their place: no prototype conflicts."""
    headers = Path(fmpy.__file__).parent / "c-code"
    made = write_fmus(load_scenario(SCENARIOS / "circle20"), tmp_path / "out", fmi)
    fmpy.extract(str(made.paths[1]), str(tmp_path / "unit"))
    text = (tmp_path / "unit" / "sources" / "circle20_plant.c").read_text()
    start, end = text.index(f"/* The types of FMI {fmi}.0"), text.index("/* One instance. */")
    swapped = text[:start] + f'#include "fmi{fmi}Functions.h"\n' + text[end:]
    (tmp_path / "swapped.c").write_text(swapped)
    folders = [f"-I{headers}", f"-I{tmp_path / 'unit' / 'sources'}"]
    words = [compiler, "-std=c99", "-fsyntax-only", *folders, str(tmp_path / "swapped.c")]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:2000]
    official = set(re.findall(rf"\b(fmi{fmi}\w+)TYPE\b", (headers / f"fmi{fmi}FunctionTypes.h").read_text()))
    ours = set(re.findall(rf"FMI{fmi}\((fmi{fmi}\w+)\)\(", text))
    exchange = {"fmi2EnterEventMode", "fmi2NewDiscreteStates", "fmi2EnterContinuousTimeMode", "fmi2CompletedIntegratorStep",
                "fmi2SetTime", "fmi2SetContinuousStates", "fmi2GetDerivatives", "fmi2GetEventIndicators",
                "fmi2GetContinuousStates", "fmi2GetNominalsOfContinuousStates"}  # fmt: skip
    assert ours == official - exchange


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
