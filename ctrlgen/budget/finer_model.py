"""The difference to a finer model: the same drives on another description of the same device.

e_k = y'_k - y_k, y' the followed signal of the finer model under the drives computed for the device as described, y that of the
device as described. It is known with its sign: a systematic effect (GUM 3.2.3), to be stated beside the combined standard uncertainty or
corrected, not added to its variance (GUM F.2.4.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np

from ctrlgen.budget.linear import Propagated
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.core.errors import Fault, InputError, SolverError
from ctrlgen.devices import Device, Signal, load_device
from ctrlgen.model.discretisation import settling_time, shortest_half_period
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate, trace
from ctrlgen.trajectory.scenario import Input, Scenario, device_inputs, model_of

FORGOTTEN = 2.0  # settling times: it begins at rest, farther off than the deviation is long
MOST_STEPS = 2_000_000  # of a simulation that fits into memory
REPEATED = 1e-6  # typical sizes by which a closed path may end elsewhere than it began
SETTLED = 1e6  # s, of a pose of a row of equilibria: longer than any actuator's memory


@dataclass(frozen=True)
class FinerModel:
    """Another description of a scenario's device, with the files that it was read from."""

    model: Model
    inputs: dict[str, Input]


@dataclass(frozen=True)
class ModelDifference:
    """By how much the followed signal of a finer model differs along the path: `deviation` (n, channels) [SI], signed."""

    finer: FinerModel
    deviation: np.ndarray


def load_finer(scenario: Scenario, model: Model, finer: Device | Path | str) -> FinerModel:
    """A device, or that of a file, with the drives and the followed channels of the scenario's `model`. Raises InputError."""
    inputs, device = dict[str, Input](), finer
    if not isinstance(device, Device):
        path = Path(device)
        device = load_device(path)
        inputs = device_inputs(path, "finer")
    source = inputs["finer"].path if inputs else device.name
    other = model_of(scenario.on(device))
    faults = []
    for role in ("drive", scenario.file.follow):
        signal, finer_signal = model.signals[role], other.signals.get(role)
        if _channels(signal) != (() if finer_signal is None else _channels(finer_signal)):
            shown = "none" if finer_signal is None else ", ".join(finer_signal.columns)
            what = f"has {', '.join(signal.columns)} in {model.name} and {shown} in the finer model; describe the same device"
            faults.append(Fault(role, what))
    if other.inertial and scenario.sample_time is None:
        what = f"has inertia, but the scenario is a row of equilibria: give it sample_rate and duration, or leave {other.name} out"
        faults.append(Fault("finer", what))
    if faults:
        raise InputError(source, faults)
    return FinerModel(other, inputs)


def _channels(signal: Signal) -> tuple[tuple[str, str], ...]:
    return tuple(zip(signal.channels, signal.units, strict=True))


def difference_to(finer: FinerModel, path: UncertainPath, linear: Propagated) -> ModelDifference:
    """y' - y along the path. A closed path has been run until it repeats, an open one begins at rest under the drive that holds its
    start. Raises SolverError where the finer model does not move under these drives."""
    model, scenario = finer.model, path.solution.scenario
    h = SETTLED if scenario.sample_time is None else scenario.sample_time
    period = path.n * h if scenario.closed else 0.0
    drives, before = path.drives_after(FORGOTTEN * settling_time(model) + period)
    x = model.rest.astype(float)
    x[list(model.clocks)] -= (before + 1) * (0.0 if scenario.sample_time is None else h)
    # held drives may be given in parts: the steps of a model with inertia are of less than half a period
    parts = max(1, ceil(h / shortest_half_period(model)))
    if parts * len(drives) > MOST_STEPS:
        what = f"takes {parts * len(drives)} steps until it has forgotten its start, more than {MOST_STEPS}; give it damping"
        raise SolverError(f"the finer model under the drives of {scenario.name} {what}, or a scenario of fewer samples")
    try:
        moved = simulate(model, np.repeat(drives, parts, axis=0), h / parts, x)
    except SolverError as error:
        raise SolverError(f"the finer model under the drives of {scenario.name}: {error}") from error
    if scenario.closed and np.any(np.abs(moved.z[-1] - moved.z[-1 - parts * path.n]) > REPEATED * model.z_scale):
        what = "does not repeat: it forgets its start too slowly"
        raise SolverError(
            f"the finer model under the drives of {scenario.name} {what}; give it damping, or make the path open"
        )
    on_path = slice(-parts * (path.n - 1) - 1, None, parts)  # the samples of the path
    states = moved.time[on_path], moved.x[on_path], moved.z[on_path]
    reached = trace(model, *states, drives[-path.n :]).signals[scenario.file.follow]
    return ModelDifference(finer, reached - linear.nominal["pose"])
