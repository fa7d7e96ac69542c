"""Describe a flexure nanopositioner once; solve its trajectories, generate its C, prove that the C is right.

outcome = ctrlgen.run("scenarios/circle20", "out/circle20")
print(outcome.passed, outcome.solution.tightest)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ctrlgen.version import __version__

if TYPE_CHECKING:
    from ctrlgen.app.batch import load_batch, run_batch
    from ctrlgen.app.scenario_pipeline import Outcome, run, verify
    from ctrlgen.budget.error_budget import ErrorBudget, error_budget
    from ctrlgen.budget.robust import solve
    from ctrlgen.calibration.calibrate import Calibration, calibrate
    from ctrlgen.controller.feedforward import Controller, ControllerStatus, ControllerStep
    from ctrlgen.controller.motion_feedforward import controller_of
    from ctrlgen.core.errors import CtrlgenError, Fault, Infeasibility, InputError, SolverError, ToolError, Unreachable
    from ctrlgen.devices import Device, load_device
    from ctrlgen.devices.user.user_device import user_device
    from ctrlgen.diagnosis.diagnosis_folder import diagnose
    from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
    from ctrlgen.diagnosis.selection.findings import Estimate, Finding
    from ctrlgen.firmware.folder import CFolder, generate
    from ctrlgen.learning.learn import Learning, learn
    from ctrlgen.model.assembly import build_model
    from ctrlgen.model.model import Model
    from ctrlgen.model.simulation import Trace, simulate
    from ctrlgen.model.virtual_sensors import SensorReadings, simulate_sensors
    from ctrlgen.path_timing.fastest import FastestPath, fastest
    from ctrlgen.recordings.reader import load_recordings
    from ctrlgen.recordings.recording import Record, Recording
    from ctrlgen.trajectory.scenario import Scenario, load_scenario
    from ctrlgen.trajectory.solution import Margin, Solution
    from ctrlgen.trajectory.workspace import Workspace
    from ctrlgen.verification.build_record import Build
    from ctrlgen.verification.comparison import Comparison, compare

_EXPORTS = {
    "app.batch": (
        "load_batch",
        "run_batch",
    ),
    "app.scenario_pipeline": (
        "Outcome",
        "run",
        "verify",
    ),
    "budget.error_budget": (
        "ErrorBudget",
        "error_budget",
    ),
    "budget.robust": ("solve",),
    "calibration.calibrate": (
        "Calibration",
        "calibrate",
    ),
    "core.errors": (
        "CtrlgenError",
        "Fault",
        "Infeasibility",
        "InputError",
        "SolverError",
        "ToolError",
        "Unreachable",
    ),
    "devices": (
        "Device",
        "load_device",
    ),
    "devices.user.user_device": ("user_device",),
    "diagnosis.diagnosis_folder": ("diagnose",),
    "diagnosis.evidence.diagnosis_result": ("Diagnosis",),
    "diagnosis.selection.findings": (
        "Estimate",
        "Finding",
    ),
    "firmware.folder": (
        "CFolder",
        "generate",
    ),
    "learning.learn": (
        "Learning",
        "learn",
    ),
    "model.assembly": ("build_model",),
    "controller.feedforward": (
        "Controller",
        "ControllerStatus",
        "ControllerStep",
    ),
    "controller.motion_feedforward": ("controller_of",),
    "model.model": ("Model",),
    "model.simulation": (
        "Trace",
        "simulate",
    ),
    "model.virtual_sensors": (
        "SensorReadings",
        "simulate_sensors",
    ),
    "path_timing.fastest": (
        "FastestPath",
        "fastest",
    ),
    "recordings.reader": ("load_recordings",),
    "recordings.recording": (
        "Record",
        "Recording",
    ),
    "verification.build_record": ("Build",),
    "trajectory.scenario": (
        "Scenario",
        "load_scenario",
    ),
    "trajectory.solution": (
        "Margin",
        "Solution",
    ),
    "trajectory.workspace": ("Workspace",),
    "verification.comparison": (
        "Comparison",
        "compare",
    ),
}
_MODULE = {name: module for module, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used, so that `import ctrlgen` is quick."""
    if name not in _MODULE:
        raise AttributeError(f"module 'ctrlgen' has no attribute {name!r}")
    return getattr(import_module(f"ctrlgen.{_MODULE[name]}"), name)


__all__ = [
    "Build",
    "CFolder",
    "Calibration",
    "Comparison",
    "Controller",
    "ControllerStatus",
    "ControllerStep",
    "CtrlgenError",
    "Device",
    "Diagnosis",
    "ErrorBudget",
    "Estimate",
    "FastestPath",
    "Fault",
    "Finding",
    "Infeasibility",
    "InputError",
    "Learning",
    "Margin",
    "Model",
    "Outcome",
    "Record",
    "Recording",
    "Scenario",
    "SensorReadings",
    "Solution",
    "SolverError",
    "ToolError",
    "Trace",
    "Unreachable",
    "Workspace",
    "__version__",
    "build_model",
    "calibrate",
    "compare",
    "controller_of",
    "diagnose",
    "error_budget",
    "fastest",
    "generate",
    "learn",
    "load_batch",
    "load_device",
    "load_recordings",
    "load_scenario",
    "run",
    "run_batch",
    "simulate",
    "simulate_sensors",
    "solve",
    "user_device",
    "verify",
]
