"""The co-simulation units: valid FMI, run by FMPy, and what they answer to calls of every kind."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENARIOS
from fmu_units import Unit, apart, fmpy, opened, run_plant

from ctrlgen import ControllerStatus, InputError, build_model, load_scenario, simulate
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.fmi.fmu import write_fmus


@pytest.fixture(scope="module", params=[3, 2], ids=["FMI 3.0", "FMI 2.0"])
def units(request, tmp_path_factory, compiler):
    """Controller and plant of the circle."""
    folder = tmp_path_factory.mktemp("fmu")
    made = write_fmus(load_scenario(SCENARIOS / "circle20"), folder / "out", request.param)
    assert [path.name for path in made.paths] == ["circle20_controller.fmu", "circle20_plant.fmu"] and made.binary
    return made.paths


@pytest.mark.long
def test_the_units_are_valid_fmi(units):
    for path in units:
        assert fmpy.validation.validate_fmu(str(path)) == []
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


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_a_controller_whose_drives_have_rates_starts_settled_however_many_samples_that_takes(tmp_path, compiler):
    """100 V at 10 V a sample, then four drives that trace a circle of three axes."""
    scenario = load_scenario(SCENARIOS / "tilt_platform")
    command = scenario.bind(build_model(scenario.device)).samples
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
            with pytest.raises(fmpy.fmi1.FMICallException):
                one.fmu.doStep(currentCommunicationPoint=one.time, communicationStepSize=samples * 1e-3)
        with pytest.raises(fmpy.fmi1.FMICallException):
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
                with pytest.raises(fmpy.fmi1.FMICallException):
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
        with pytest.raises(fmpy.fmi1.FMICallException):
            plant.step()
        plant.set("drive", circle.drive[0])
        plant.step()
        assert np.all(np.isfinite(plant.get("pose")))


def test_outputs_and_foreign_tokens_are_not_taken(units, circle, tmp_path):
    with opened(units[1], tmp_path / "p") as plant:
        plant.begin("drive", circle.drive[0])
        with pytest.raises(fmpy.fmi1.FMICallException):
            plant.set("pose", np.zeros(6))
        with pytest.raises(fmpy.fmi1.FMICallException):
            plant.fmu.setBoolean(plant.references("start_settled"), [True])
    unit = Unit(units[1], tmp_path / "q")
    unit.fmu.guid = "{another}"
    with pytest.raises(Exception, match="nstantiate"):
        unit.fmu.instantiate()


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
        assert fmpy.validation.validate_fmu(str(path)) == []
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
    exchange = {
        "fmi2EnterEventMode",
        "fmi2NewDiscreteStates",
        "fmi2EnterContinuousTimeMode",
        "fmi2CompletedIntegratorStep",
        "fmi2SetTime",
        "fmi2SetContinuousStates",
        "fmi2GetDerivatives",
        "fmi2GetEventIndicators",
        "fmi2GetContinuousStates",
        "fmi2GetNominalsOfContinuousStates",
    }
    assert ours == official - exchange
