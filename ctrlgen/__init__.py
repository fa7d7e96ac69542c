"""Describe a flexure nanopositioner once; solve its trajectories, generate its C, prove that the C is right.

outcome = ctrlgen.run("scenarios/circle20", "out/circle20")
print(outcome.passed, outcome.solution.tightest)
"""

from ctrlgen._version import __version__
from ctrlgen.comparison import Comparison, compare
from ctrlgen.controller import Controller, Status
from ctrlgen.devices import load_device
from ctrlgen.errors import CtrlgenError, InputError, SolverError, ToolError, Unreachable
from ctrlgen.firmware import generate
from ctrlgen.job import Outcome, run
from ctrlgen.model import Model, build_model
from ctrlgen.scenario import load_scenario
from ctrlgen.simulation import Trace, simulate
from ctrlgen.solution import Solution, solve

__all__ = [
    "Comparison", "Controller", "CtrlgenError", "InputError", "Model", "Outcome", "Solution", "SolverError", "Status", "ToolError",
    "Trace", "Unreachable", "__version__", "build_model", "compare", "generate", "load_device", "load_scenario", "run", "simulate", "solve",
]  # fmt: skip
