"""Describe a flexure nanopositioner once; solve its trajectories, generate its C, prove that the C is right.

outcome = ctrlgen.run("scenarios/circle20", "out/circle20")
print(outcome.passed, outcome.solution.tightest)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ctrlgen._version import __version__

if TYPE_CHECKING:
    from ctrlgen.app.pipeline import Outcome, run
    from ctrlgen.core.errors import CtrlgenError, InputError, SolverError, ToolError, Unreachable
    from ctrlgen.devices import load_device
    from ctrlgen.devices.user import user_device
    from ctrlgen.diagnosis.pipeline import diagnose
    from ctrlgen.diagnosis.selection.result import Diagnosis
    from ctrlgen.firmware.folder import generate
    from ctrlgen.model.assembly import build_model
    from ctrlgen.model.feedforward import Controller, ControllerStatus
    from ctrlgen.model.model import Model
    from ctrlgen.model.simulation import Trace, simulate
    from ctrlgen.model.virtual_sensors import SensorReadings, simulate_sensors
    from ctrlgen.recordings.reader import load_recordings
    from ctrlgen.trajectory.scenario import load_scenario
    from ctrlgen.trajectory.solution import Solution, solve
    from ctrlgen.verification.comparison import Comparison, compare

_EXPORTS = {
    "app.pipeline": ("Outcome", "run"),
    "core.errors": ("CtrlgenError", "InputError", "SolverError", "ToolError", "Unreachable"),
    "devices": ("load_device",),
    "devices.user": ("user_device",),
    "diagnosis.pipeline": ("diagnose",),
    "diagnosis.selection.result": ("Diagnosis",),
    "firmware.folder": ("generate",),
    "model.feedforward": ("Controller", "ControllerStatus"),
    "model.assembly": ("build_model",),
    "model.model": ("Model",),
    "model.simulation": ("Trace", "simulate"),
    "model.virtual_sensors": ("SensorReadings", "simulate_sensors"),
    "recordings.reader": ("load_recordings",),
    "trajectory.scenario": ("load_scenario",),
    "trajectory.solution": ("Solution", "solve"),
    "verification.comparison": ("Comparison", "compare"),
}
_MODULE = {name: module for module, names in _EXPORTS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used, so that `import ctrlgen` is quick."""
    if name not in _MODULE:
        raise AttributeError(f"module 'ctrlgen' has no attribute {name!r}")
    return getattr(import_module(f"ctrlgen.{_MODULE[name]}"), name)


__all__ = [
    "Comparison",
    "Controller",
    "ControllerStatus",
    "CtrlgenError",
    "Diagnosis",
    "InputError",
    "Model",
    "Outcome",
    "SensorReadings",
    "Solution",
    "SolverError",
    "ToolError",
    "Trace",
    "Unreachable",
    "__version__",
    "build_model",
    "compare",
    "diagnose",
    "generate",
    "load_device",
    "load_recordings",
    "load_scenario",
    "run",
    "simulate",
    "simulate_sensors",
    "solve",
    "user_device",
]
