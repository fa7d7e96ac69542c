"""A recording of 5 million rows and six channels, read and diagnosed: processor time and peak memory, by format."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.measure import Note, peak_memory
from benchmarks.samples import SCENARIO, Disagreement
from ctrlgen import build_model, diagnose, load_device, simulate
from ctrlgen.core.units import from_si
from ctrlgen.recordings.reader import load_recordings

ROWS, GROUP, STEP = 5_000_000, 100, 1e-5  # of the recorder; rows of a sample of the controller; s of a row
DEVICE = SCENARIO.parent / "devices" / "tip_tilt_mirror.toml"
MEMORY_AIM = 1536.0  # MB
FORMATS = ("csv", "npy", "h5", "parquet")
AT_ONCE = 100_000  # rows that are written at once


def run(repeat: int) -> list[Note]:
    """One read of each format, and one diagnosis, each in a process of its own."""
    found = []
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        for ending in FORMATS:
            folder = Path(scratch) / ending
            _child("write", ending, folder)
            for what in ("read", "diagnose") if ending == "csv" else ("read",):
                done = _child(what, ending, folder)
                found.append(
                    Note(
                        f"{ROWS} rows x {done['channels']} of {ending}, {what}: {done['seconds']:.0f} s of processor time, peak "
                        f"{done['peak']:.0f} MB (aim: < {MEMORY_AIM:.0f} MB), {done['rows']} rows after thinning"
                    )
                )
            for file in folder.iterdir():
                file.unlink()
    return found


def _child(what: str, ending: str, folder: Path) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.long_recording", what, ending, str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Disagreement(f"{what} {ending}: {done.stderr[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1])


def write(ending: str, folder: Path, rows: int = ROWS) -> None:
    """Three stacks that a controller sets every hundred rows, and three readings of the pose."""
    model, rng = build_model(load_device(DEVICE)), np.random.default_rng(1)
    readings = [model.signals["reading"].channels.index(c) for c in ("theta_x", "theta_y", "delta_z")]
    coarse = -(-rows // GROUP)
    t = GROUP * STEP * np.arange(coarse)[:, None]
    f = np.array([0.31, 0.37, 0.43])
    u = model.u_bounds[1] * (0.5 + 0.1 * np.sin(2 * np.pi * f * t) + 0.05 * np.sin(2 * np.pi * 3.1 * f * t))
    y = simulate(model, u, GROUP * STEP).signals["reading"][:-1, readings]
    noise = 0.003 * np.ptp(y, axis=0)
    folder.mkdir(parents=True)
    assert np.all(u > model.u_bounds[0]) and np.all(u < model.u_bounds[1])
    units = ["V"] * 3 + ["urad", "urad", "um"]
    names = [f"u{k}" for k in range(3)] + [f"y{k}" for k in range(3)]

    def part(a: int, b: int) -> np.ndarray:
        k = np.arange(a, b)
        columns = [STEP * k, *(u[k // GROUP, j] for j in range(3))]
        columns += [y[k // GROUP, j] + noise[j] * rng.standard_normal(b - a) for j in range(3)]
        return np.column_stack([columns[0], *(from_si(c, unit) for c, unit in zip(columns[1:], units, strict=True))])

    _written(ending, folder, ["t", *names], part, rows)
    channels = [f"drive.{c}" for c in model.signals["drive"].channels]
    channels += [f"reading.{model.signals['reading'].channels[i]}" for i in readings]
    column = (lambda k: k + 1) if ending == "npy" else (lambda k: f'"{names[k]}"')
    lines = ['title = "long"', f'device = "{model.device.name}"', 'kind = "series"', "[[record]]", 'role = "fit"']
    lines += [f'file = "log.{ending}"', f'sample_rate = "{1 / STEP:.9g} Hz"', 'between_samples = "held"', "[columns]"]
    lines += [f'"{c}" = {{ column = {column(k)}, unit = "{units[k]}" }}' for k, c in enumerate(channels)]
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")


def _written(ending: str, folder: Path, names: list[str], part, rows: int) -> None:
    """The file, in parts, so that it takes no memory to write."""
    path, parts = folder / f"log.{ending}", [(a, min(a + AT_ONCE, rows)) for a in range(0, rows, AT_ONCE)]
    if ending == "csv":
        import pandas

        with path.open("w") as file:
            file.write(",".join(names) + "\n")
            for a, b in parts:
                pandas.DataFrame(part(a, b)).to_csv(file, header=False, index=False, float_format="%.8g")
    elif ending == "npy":
        array = np.lib.format.open_memmap(path, "w+", float, (rows, len(names)))
        for a, b in parts:
            array[a:b] = part(a, b)
        array.flush()
    elif ending == "h5":
        import h5py

        with h5py.File(path, "w") as file:
            for name in names:
                file.create_dataset(name, (rows,))
            for a, b in parts:
                values = part(a, b)
                for k, name in enumerate(names):
                    file[name][a:b] = values[:, k]
    else:
        import pyarrow as pa
        import pyarrow.parquet as pq

        with pq.ParquetWriter(path, pa.schema([(name, pa.float64()) for name in names])) as file:
            for a, b in parts:
                file.write_table(pa.table(dict(zip(names, part(a, b).T, strict=True))))


def main(what: str, ending: str, folder: str, rows: str = str(ROWS)) -> None:
    """One step, in a process of its own; its last line says what it took."""
    if what == "write":
        write(ending, Path(folder), int(rows))
        print("{}")
        return
    begin, model = time.process_time(), build_model(load_device(DEVICE))
    recording = load_recordings([folder], model)
    if what == "diagnose":
        diagnose(model.device, recording, jobs=0)
    done = {
        "seconds": time.process_time() - begin,
        "peak": peak_memory(),
        "rows": sum(len(r.time) for r in recording.records),
        "channels": len(recording.channels) + len(recording.drives),
        "notes": recording.notes,
    }
    print(json.dumps(done))


if __name__ == "__main__":
    main(*sys.argv[1:])
