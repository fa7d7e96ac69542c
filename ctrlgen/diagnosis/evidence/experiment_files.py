"""Files of the next experiment: the drive as CSV, a recording.toml to complete, and a scenario for the solver."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.escaping import toml
from ctrlgen.core.units import difference
from ctrlgen.devices import BalancedPhysics
from ctrlgen.diagnosis.evidence.experiment_design import Experiment
from ctrlgen.diagnosis.evidence.ltv_linearisation import simulate_motion
from ctrlgen.diagnosis.settings import EXPERIMENT
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.model.model import Model

DRIVE, RECORDING, SCENARIO, COMMAND = "drive.csv", "recording.toml", "scenario.toml", "displacement.csv"


def files(fitter: Fitter, fit: Fit, chosen: Experiment, device_file: str) -> dict[str, str]:
    """Contents by file name. `device_file` is the path of the corrected device file, relative to these files.

    A device with inertia gets no scenario: the solver handles devices in quasi-static balance.
    """
    record = chosen.proposed
    simulator = fitter.simulator(fit.structure, record)
    texts = {DRIVE: _drive(simulator, chosen), RECORDING: _recording(fitter, simulator, chosen)}
    return texts | (_scenario(simulator, fit, chosen, device_file) if _solved(simulator.model) else {})


def _solved(m: Model) -> bool:
    """Whether the solver handles the device: quasi-static balance, and a platform with several pose channels."""
    return isinstance(m.device.physics(m.device.values()), BalancedPhysics) and len(m.signals["pose"].channels) > 1


def _csv(header: list[str], columns: np.ndarray) -> str:
    rows = [",".join(header), *(",".join(f"{value:.9g}" for value in row) for row in columns)]
    return "\n".join(rows) + "\n"


def _drive(simulator: Simulator, chosen: Experiment) -> str:
    signal, record = simulator.model.signals["drive"], chosen.proposed
    units = zip(record.drive.T, signal.units, strict=True)
    columns = [difference(u, unit) for u, unit in units]
    header = [f"{c} [{u}]" for c, u in zip(signal.channels, signal.units, strict=True)]
    if record.poses:
        return _csv(header, np.column_stack(columns))
    time = record.sample_time * np.arange(len(record.drive))
    return _csv(["time [s]", *header], np.column_stack([time, *columns]))


def _recording(fitter: Fitter, simulator: Simulator, chosen: Experiment) -> str:
    """A recording.toml for the experiment; the readings are to be added under the column names that it gives."""
    recording, record, signal = fitter.recording, chosen.proposed, simulator.model.signals["drive"]
    n = len(record.drive)
    cut = int(EXPERIMENT.fitted_share * n)
    lines = [
        f"# {chosen.candidates[0].description}. Add the readings to {DRIVE} as columns with the names below.",
        f"title  = {toml(f'next experiment after: {recording.title}')}",
        f"device = {toml(recording.device)}",
        f"kind   = {toml(recording.kind)}",
    ]
    timed = not record.poses
    for role, rows in (("fit", [0, cut]), ("hold_out", [cut, n])):
        lines += ["", "[[record]]", f'file = "{DRIVE}"', f'role = "{role}"', f"rows = {rows}"]
        if timed:
            start = toml(f"{rows[0] * record.sample_time:.9g} s")
            lines += ['time = { column = "time [s]", unit = "s" }', f"start = {start}"]
        elif np.isfinite(record.sample_time):
            lines.append(f'dwell = "{record.sample_time:.9g} s"')
        if timed:
            lines.append(f"between_samples = {toml('linear' if record.linear else 'held')}")
    lines += ["", "[columns]"]
    for c, u in zip(signal.channels, signal.units, strict=True):
        lines.append(f'"drive.{c}" = {{ column = "{c} [{u}]", unit = "{u}" }}')
    for name, u in zip(recording.channels, recording.units, strict=True):
        lines.append(f'"{name}" = {{ column = "{name} [{u}]", unit = "{u}" }}')
    return "\n".join(lines) + "\n"


def _scenario(simulator: Simulator, fit: Fit, chosen: Experiment, device_file: str) -> dict[str, str]:
    """A scenario whose command is the predicted displacement; the solver finds the drives from it."""
    m, record = simulator.model, chosen.proposed
    after = simulate_motion(simulator, record, fit.theta, None)[1]
    f = ca.Function("z", [ca.vertcat(m.x, m.z)], [m.z]).map(len(after))
    signal = m.signals["displacement"]
    z = f(after.T).full().T
    columns = np.column_stack([difference(c, u) for c, u in zip(z.T, signal.units, strict=True)])
    header = [f"{c} [{u}]" for c, u in zip(signal.channels, signal.units, strict=True)]
    rate = f'sample_rate = "{1 / record.sample_time:.9g} Hz"\n' if np.isfinite(record.sample_time) else ""
    text = (
        f"title = {toml(f'next experiment: {chosen.candidates[0].description}')}\n"
        f"device = {toml(device_file)}\n"
        f'follow = "displacement"\n{rate}\n[path]\nkind = "poses"\nfile = "{COMMAND}"\n'
    )
    return {SCENARIO: text, COMMAND: _csv(header, columns)}
