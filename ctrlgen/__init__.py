"""Describe a flexure nanopositioner once; solve its trajectories, generate its C, prove that the C is right.

outcome = ctrlgen.run("scenarios/circle20", "out/circle20")
print(outcome.passed, outcome.solution.tightest)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ctrlgen._version import __version__

if TYPE_CHECKING:
    from ctrlgen.controller import Controller, Status
    from ctrlgen.devices import load_device
    from ctrlgen.devices.user import user_device
    from ctrlgen.diagnosis.diagnosis import Diagnosis
    from ctrlgen.diagnosis.job import diagnose
    from ctrlgen.errors import CtrlgenError, InputError, SolverError, ToolError, Unreachable
    from ctrlgen.firmware.folder import generate
    from ctrlgen.job import Outcome, run
    from ctrlgen.model import Model, build_model
    from ctrlgen.readings import Record, record_readings
    from ctrlgen.recording import load_recordings
    from ctrlgen.scenario import load_scenario
    from ctrlgen.simulation import Trace, simulate
    from ctrlgen.solution import Solution, solve
    from ctrlgen.verification.comparison import Comparison, compare

_HOME = {
    "verification.comparison": ("Comparison", "compare"), "controller": ("Controller", "Status"), "devices": ("load_device",),
    "devices.user": ("user_device",),
    "diagnosis.diagnosis": ("Diagnosis",), "diagnosis.job": ("diagnose",), "recording": ("load_recordings",),
    "errors": ("CtrlgenError", "InputError", "SolverError", "ToolError", "Unreachable"), "firmware.folder": ("generate",),
    "job": ("Outcome", "run"), "model": ("Model", "build_model"), "readings": ("Record", "record_readings"), "scenario": ("load_scenario",),
    "simulation": ("Trace", "simulate"), "solution": ("Solution", "solve"),
}  # fmt: skip
_MODULE = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used, so that `import ctrlgen` is quick."""
    if name not in _MODULE:
        raise AttributeError(f"module 'ctrlgen' has no attribute {name!r}")
    return getattr(import_module(f"ctrlgen.{_MODULE[name]}"), name)


__all__ = [
    "Comparison",
    "Controller",
    "CtrlgenError",
    "Diagnosis",
    "InputError",
    "Model",
    "Outcome",
    "Record",
    "Solution",
    "SolverError",
    "Status",
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
    "record_readings",
    "run",
    "simulate",
    "solve",
    "user_device",
]
