"""Folders of a recording to diagnose: a recording.toml and its columns, of an axis, a hexapod in settled poses and a turntable."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import ctrlgen
from ctrlgen.core.units import from_si
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Record

STEP = 1e-3
SERIES_RECORD = '[[record]]\nfile = "{0}.csv"\nrole = "{0}"\ntime = {{ column = "t", unit = "s" }}\n'
PARTS = {"fit": [0, 25], "hold_out": [25, 40]}
SERVO = 'kind = "servo"\nname = "table"\ntitle = "a table"\nsource = "an example"\ntravel = "90 deg"\n'
SERVO_RECORD = '[[record]]\nfile = "poses.csv"\nrole = "{}"\nrows = [{}, {}]\n'
SERVO_HEAD = (
    'title = "{}"\ndevice = "table"\nkind = "poses"\n[columns]\n"drive.axis" = {{ column = "r", unit = "deg" }}\n'
    '"reading.axis" = {{ column = "y", unit = "deg", noise = "0.001 deg" }}\n'
)


def axis_recording(folder: Path, true: str, title: str = "creeping axis") -> Path:
    """Two records of the axis described by the text `true`, with 5 nm of noise; the nominal model is AXIS_FILE."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "true.toml").write_text(true)
    model, rng = ctrlgen.build_model(ctrlgen.load_device(folder / "true.toml")), np.random.default_rng(3)
    t = STEP * np.arange(1200)
    drives = {
        "fit": sum(np.sin(2 * np.pi * f * t + f) for f in (0.8, 1.7, 3.1, 7, 19, 47, 95)) / 4,
        "hold_out": np.repeat(rng.uniform(-1, 1, 6), 100),
    }
    for role, u in drives.items():
        trace = ctrlgen.simulate(model, u[:, None], STEP)
        y = from_si(trace.signals["reading"][:-1, 0], "nm") + 5 * rng.standard_normal(len(u))
        rows = np.column_stack([STEP * np.arange(len(u)), u, y])
        np.savetxt(folder / f"{role}.csv", rows, delimiter=",", header="t,u,y", comments="")
    (folder / "recording.toml").write_text(
        f'title = "{title}"\ndevice = "flexure_axis"\nkind = "series"\n[columns]\n'
        '"drive.axis" = { column = "u", unit = "V" }\n"reading.axis" = { column = "y", unit = "nm", noise = "5 nm" }\n'
        + "".join(SERIES_RECORD.format(role) for role in drives)
    )
    return folder


def poses_recording(folder: Path, device) -> Path:
    """Settled poses of a meso-scale hexapod with a noise of 10 nm and 10 nrad."""
    rng, n = np.random.default_rng(5), 40
    model = ctrlgen.build_model(device)
    channels = tuple(f"reading.{c}" for c in model.signals["pose"].channels)
    units = model.signals["pose"].units
    drives = rng.uniform(-400e-6, 400e-6, (n, 6))
    none = np.zeros((n, 6))
    record = Record("", "fit", np.arange(n), np.inf, drives, none, False, None, none == 0)
    pose = Simulator(device, (), channels, np.inf, False).simulate(record, np.zeros(0)) + 1e-8 * rng.standard_normal(
        (n, 6)
    )
    axes = model.signals["drive"].channels
    columns = [from_si(drives, "um"), *(from_si(pose[:, [i]], unit) for i, unit in enumerate(units))]
    header = ",".join((*axes, *channels))
    np.savetxt(folder / "poses.csv", np.hstack(columns), delimiter=",", header=header, comments="")
    lines = [f'"drive.{a}" = {{ column = "{a}", unit = "um" }}' for a in axes]
    for channel, unit in zip(channels, units, strict=True):
        noise = from_si(1e-8, unit)
        lines.append(f'"{channel}" = {{ column = "{channel}", unit = "{unit}", noise = "{noise:.9g} {unit}" }}')
    records = [f'[[record]]\nfile = "poses.csv"\nrole = "{r}"\nrows = {rows}\n' for r, rows in PARTS.items()]
    head = 'title = "turned strut"\ndevice = "meso_hexapod"\nkind = "poses"\n[columns]\n'
    (folder / "recording.toml").write_text(head + "\n".join(lines) + "\n" + "".join(records))
    return folder


def servo_poses(folder: Path, gain: float, seed: int) -> Path:
    """90 settled poses of a table whose reading is off by a share `gain`."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    r = rng.uniform(-80, 80, 90)
    table = np.column_stack([r, (1 + gain) * r + 1e-3 * rng.standard_normal(90)])
    np.savetxt(folder / "poses.csv", table, delimiter=",", header="r,y", comments="")
    parts = SERVO_RECORD.format("fit", 0, 60) + SERVO_RECORD.format("hold_out", 60, 90)
    (folder / "recording.toml").write_text(SERVO_HEAD.format(folder.name) + parts)
    return folder
