"""Logs of devices as their models move them, and what is said of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from conftest import DEVICES

from ctrlgen import build_model, load_device, simulate
from ctrlgen.core.errors import InputError
from ctrlgen.core.units import from_si
from ctrlgen.recordings.moved import moved
from ctrlgen.recordings.plausibility import implausible
from ctrlgen.recordings.reader import load_recordings

N = 1200


@dataclass(frozen=True)
class Log:
    """A device, how often it is sampled [s], infinite for poses, and the units in which its log is written, by role and channel."""

    file: str
    step: float
    drive: str
    readings: dict[str, str]


HEXAPOD = {c: "um" if c.startswith("d") else "urad" for c in ("theta_x", "theta_y", "delta_x", "delta_y", "delta_z")}
LOGS = {
    "axis": Log("flexure_axis.toml", 1e-3, "V", {"axis": "um"}),
    "heaters": Log("mems_hexapod.toml", 1e-3, "W", HEXAPOD),
    "levers": Log("xy_lever_stage.toml", 5e-4, "V", {"delta_x": "um", "delta_y": "um"}),
    "mirror": Log("tip_tilt_mirror.toml", 1e-4, "V", {"theta_x": "mrad", "theta_y": "mrad"}),
    "poses": Log("meso_hexapod.toml", np.inf, "um", {"theta_x": "deg", "theta_z": "deg", "delta_x": "um"}),
    "guide": Log("parallelogram.toml", 1e-3, "A", {"delta_x": "um"}),
}


def write_log(log: Log, folder):
    """Steps of every drive over the middle of its range, each a hundredth of the record long or a pose, and what the model reads."""
    model, rng = build_model(load_device(DEVICES / log.file)), np.random.default_rng(3)
    low, high = model.u_bounds
    poses, n = np.isinf(log.step), 60 if np.isinf(log.step) else N
    levels = rng.uniform(0.3, 0.7, (n if poses else N // 12, len(low)))
    u = low + (high - low) * (levels if poses else np.repeat(levels, 12, axis=0))
    signal, drives = model.signals["reading"], model.signals["drive"]
    seen = simulate(model, u, 1e3 if poses else log.step).signals["reading"]
    y = seen[1:] if poses else seen[:-1]
    places = [signal.channels.index(c) for c in log.readings]
    columns = [from_si(u[:, j], log.drive) for j in range(len(low))]
    columns += [from_si(y[:, i], unit) for i, unit in zip(places, log.readings.values(), strict=True)]
    names = [f"u{j}" for j in range(len(low))] + list(log.readings)
    rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))
    (folder / "log.csv").write_text(",".join(names) + "\n" + rows + "\n")
    kind = "poses" if poses else "series"
    lines = ['title = "t"', f'device = "{model.device.name}"', f'kind = "{kind}"']
    lines += [
        "[[record]]",
        'file = "log.csv"',
        'role = "fit"',
        *([] if poses else [f'sample_rate = "{1 / log.step:g} Hz"', 'between_samples = "held"']),
    ]
    lines += ["[columns]"]
    lines += [f'"drive.{c}" = {{ column = "u{j}", unit = "{log.drive}" }}' for j, c in enumerate(drives.channels)]
    lines += [f'"reading.{c}" = {{ column = "{c}", unit = "{unit}" }}' for c, unit in log.readings.items()]
    return folder, model, "\n".join(lines) + "\n"


def said_of(text: str, folder, model) -> list[str]:
    (folder / "recording.toml").write_text(text)
    try:
        seen = moved(load_recordings([folder / "recording.toml"], model, hold_out=False), model)
    except InputError as error:  # a drive that the device's limits exclude
        return [f"{fault.where}: {fault.what}" for fault in error.faults]
    assert seen is not None
    return implausible(seen)
