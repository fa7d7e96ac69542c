"""Recordings to be read: a healthy record, its recording.toml, and what is refused of it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.reader import load_recordings

AXES = ("1X", "1Y", "2X", "2Y", "3X", "3Y")
N = 400


def samples(n: int = N, seed: int = 1) -> dict[str, np.ndarray]:
    """Columns of a healthy record in reader's units: slow heater powers [W], a noisy reading [um], a temperature [degC]."""
    rng = np.random.default_rng(seed)
    t = 0.001 * np.arange(n)
    drives = {f"u{a}": 0.2 + 0.1 * np.sin(2 * np.pi * (3 + k + 0.1 * seed) * t) for k, a in enumerate(AXES)}
    read = 2 * np.sin(2 * np.pi * 3.3 * t + seed) + 0.01 * rng.standard_normal(n)
    tilt = 1e-4 * np.cos(2 * np.pi * 5 * t) + 1e-6 * rng.standard_normal(n)
    return {"t": t, **drives, "x": read, "tilt": tilt, "T": 23 + 0.001 * np.arange(n)}


def csv_text(columns: dict[str, np.ndarray]) -> str:
    cells = [["" if math.isnan(v) else repr(float(v)) for v in column] for column in columns.values()]
    return "\n".join([",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]) + "\n"


COLUMNS = {
    **{f"drive.{a}": {"column": f"u{a}", "unit": "W"} for a in AXES},
    "reading.delta_x": {"column": "x", "unit": "um", "noise": "10 nm"},
}


def toml(value) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + " }"
    return json.dumps(value)


def described(folder, *records: dict, columns=COLUMNS, device="mems_hexapod", kind="series"):
    """recording.toml in `folder`; a record without time gets the column t."""
    lines = [f'title = "test"\ndevice = "{device}"\nkind = "{kind}"\n']
    for record in records:
        if kind == "series" and not {"time", "sample_rate"} & set(record):
            record = {**record, "time": {"column": "t", "unit": "s"}}
        lines += ["[[record]]", *(f"{k} = {toml(v)}" for k, v in record.items() if v is not None)]
    lines += ["[columns]", *(f"{json.dumps(k)} = {toml(v)}" for k, v in columns.items())]
    (folder / "recording.toml").write_text("\n".join(lines))
    return folder


def two(folder, fit: dict[str, np.ndarray], **record):
    """A recording of `fit` and a healthy held-out record."""
    (folder / "fit.csv").write_text(csv_text(fit))
    (folder / "held.csv").write_text(csv_text(samples(seed=2)))
    return described(folder, {"file": "fit.csv", "role": "fit", **record}, {"file": "held.csv", "role": "hold_out"})


def refused(*arguments) -> dict[str, str]:
    """Where -> what of the faults; load_recordings must refuse."""
    with pytest.raises(InputError) as raised:
        load_recordings(*arguments)
    return {fault.where: fault.what for fault in raised.value.faults}
