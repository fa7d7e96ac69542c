"""A scenario whose path is the samples of another one under another law of time, and its files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ctrlgen.core.escaping import toml
from ctrlgen.core.files import write_text
from ctrlgen.core.units import Quantity, from_si
from ctrlgen.model.model import Model
from ctrlgen.trajectory.paths import Poses
from ctrlgen.trajectory.scenario import Input, Scenario


def retimed(
    scenario: Scenario, model: Model, samples: np.ndarray, rate: Quantity, title: str, how: str = "fastest"
) -> Scenario:
    """`scenario` with the path `samples` (n, channels) [SI] at the sample `rate`: a list of poses, periodic where its path is closed;
    its name ends on `how` they are timed.

    Its files are to lie beside the device's.
    """
    file, closed, name = scenario.file, scenario.file.path.closed, f"{scenario.name}_{how}"
    signal = model.signals[file.follow]
    moved = [i for i in range(len(signal.channels)) if np.any(samples[:, i])] or [0]
    shown = np.column_stack([from_si(samples[:, i], signal.units[i]) for i in moved])
    heads = ",".join(f"{signal.channels[i]} [{signal.units[i]}]" for i in moved)
    table = "\n".join([heads, *(",".join(repr(float(v)) for v in row) for row in shown)]) + "\n"
    device = scenario.inputs["device"]
    folder = device.path.parent
    lines = [
        f"title = {toml(title)}",
        f"device = {toml(device.path.name)}",
        f'follow = "{file.follow}"',
        *([f'controller = "{file.controller}"'] if file.controller else []),
        f"sample_rate = {toml(rate.text)}",
        "",
        "[path]",
        'kind = "poses"',
        f'file = "{name}.csv"',
        *(["periodic = true"] if closed else []),
    ]
    poses = Poses(
        kind="poses", file=f"{name}.csv", periodic=closed, folder=folder, listed=tuple(map(tuple, samples.tolist()))
    )
    timing = {
        "sample_rate": rate,
        "duration": None,
        "points": None,
        "path": poses,
        "angles": None,
        "pivot": None,
        "shaping": None,
    }
    changed = {"title": title, "device": device.path.name, "outcome": "solved", "expect": ()} | timing
    inputs = {
        **scenario.inputs,
        "scenario": Input(folder / f"{name}.toml", "\n".join(lines) + "\n"),
        "poses": Input(folder / f"{name}.csv", table),
    }
    return replace(
        scenario, name=name, path=inputs["scenario"].path, file=file.model_copy(update=changed), inputs=inputs
    )


def write_inputs(folder: Path, scenario: Scenario) -> None:
    """The files of a scenario, side by side in a folder."""
    for read in scenario.inputs.values():
        write_text(folder / read.path.name, read.text)
