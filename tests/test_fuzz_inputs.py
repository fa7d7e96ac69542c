"""Every kind of input, mutated by its structure: a clear message or a usable answer; no traceback, no hang, nothing foreign."""

from __future__ import annotations

import json
import re
import signal
import time
import tomllib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENARIOS
from hostile_texts import FOREIGN, UNSEEN
from mutated_inputs import garbled, mutated, written

from ctrlgen import build_model, load_device, load_recordings, load_scenario
from ctrlgen.app.batch import load_batch
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.core.errors import CtrlgenError
from ctrlgen.core.files import read_toml
from ctrlgen.devices import Device
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.firmware.package import verify_package
from ctrlgen.model.model import Model
from ctrlgen.trajectory.infeasibility import check_feasible

HANG = 10.0
"""Seconds that reading an input may take, whatever is in it."""
QUICK, LONG = 5, 110
"""Mutations of each input in `make test`, and in the tests marked `long`: about 100 and 2,000 together."""
SOLVED = 300
"""Samples up to which a path that can be read is also looked at by the inverse: more are work, and no hang."""

DEVICES = [
    *sorted((SCENARIOS / "devices").glob("*.toml")),
    *(
        SCENARIOS / name / "device.toml"
        for name in ("flexure_2dof", "piezo_stack", "rotary_axis", "emps", "servo_motor")
    ),
]
PATHS = ["circle20", "raster", "mirror_spiral", "rrr_circle", "flexure_axis_line", "tripod_tilt", "dynamic_circle"]
AXIS = SCENARIOS / "devices" / "flexure_axis.toml"
RECORDING = """title = "an axis"
device = "flexure_axis"
source = "made up"
kind = "series"
low_pass = "300 Hz"
[[record]]
file = "run.csv"
role = "fit"
time = { column = "t", unit = "s" }
rows = [0, 200]
lead_in = 3
conditions = { ambient = "22 degC" }
[[record]]
file = "run.csv"
role = "hold_out"
time = { column = "t", unit = "s" }
rows = [200, 400]
gap = "linear"
[columns]
"drive.axis" = { column = "u", unit = "V", scale = 2.0, later = "1 ms" }
"reading.axis" = { column = "y", unit = "um", noise = "10 nm", tolerance = "20 nm" }
"""
POSES = "delta_x [um],delta_z [um],theta_x [urad]\n" + "".join(f"{k % 3},{20 + k % 2},{10 * k}\n" for k in range(12))
JOBS = (
    'seed = 1\nlaws = ["creep"]\n[[job]]\ndevice = "device.toml"\nrecordings = ["run*", ["run", "run"]]\nname = "a"\n'
)


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fails where the block takes longer; interrupts Python that does."""

    def late(*_: Any) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    begin = time.monotonic()
    try:
        yield
        assert time.monotonic() - begin < seconds, "hangs"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@cache
def model_of(path: Path) -> Model:
    return build_model(load_device(path))


def names_of(model: Model) -> list[str]:
    """Everything of a model that is written into C, columns and pages without being a text for readers."""
    signals = [text for s in model.signals.values() for text in (s.name, s.label, *s.columns, *s.channels, *s.units)]
    return [
        model.name,
        *model.axes,
        *model.x_names,
        *signals,
        *(limit.text for limit in model.limits),
        *limits_of(model),
    ]


def limits_of(model: Model) -> list[str]:
    return [f"{c.path} {c.name} {c.unit} {c.range_text}" for c in model.device.given_at_start]


def read_device(file: Path) -> None:
    model = build_model(load_device(file))
    for name in names_of(model):
        assert FOREIGN not in name and re.fullmatch(r"[\w .,:;/^*()\[\]<>=%°|'+-]*", name), name


def read_scenario(folder: Path) -> None:
    scenario = load_scenario(folder)
    problem = scenario.bind(model_of(scenario.inputs["device"].path.resolve()))
    assert re.fullmatch(r"[a-z][a-z0-9_]*", scenario.controller_name)
    samples = problem.samples
    assert np.all(np.isfinite(samples))
    if len(samples) <= SOLVED:
        check_feasible(problem)


def refused_or_read(read: Any, *arguments: Any, how: str) -> None:
    """Reads; a refusal has a message that a terminal shows as it is, and that a person can read."""
    try:
        with within(HANG), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(*arguments)
    except CtrlgenError as error:
        message = str(error)
        assert not any(odd in message for odd in UNSEEN), how
        assert "\x1b" not in message and len(message) < 30_000, how
    except Exception as error:
        error.add_note(how)
        raise


rounds = pytest.mark.parametrize(
    ("count", "first"), [(QUICK, 0), pytest.param(LONG, QUICK, marks=pytest.mark.long)], ids=["quick", "long"]
)


@pytest.mark.parametrize("path", DEVICES, ids=lambda path: f"{path.parent.name}-{path.stem}")
@rounds
def test_devices(path, count, first, tmp_path):
    table = tomllib.loads(path.read_text())
    for seed in range(first, first + count):
        changed = mutated(table, seed)
        (tmp_path / "device.toml").write_text(written(changed.table))
        refused_or_read(read_device, tmp_path / "device.toml", how=f"seed {seed}: {changed.how}")


@pytest.mark.parametrize("name", PATHS)
@rounds
def test_scenarios(name, count, first, tmp_path):
    table = tomllib.loads((SCENARIOS / name / "scenario.toml").read_text())
    table["device"] = str((SCENARIOS / name / table["device"]).resolve())
    for seed in range(first, first + count):
        changed = mutated(table, seed)
        (tmp_path / "scenario.toml").write_text(written(changed.table))
        refused_or_read(read_scenario, tmp_path, how=f"seed {seed}: {changed.how}")


@rounds
def test_recordings_and_their_logs(count, first, tmp_path):
    model, table = model_of(AXIS), tomllib.loads(RECORDING)
    rows = "".join(f"{k / 1000},{np.sin(k / 5):.6f},{20 * np.sin(k / 5 - 0.1):.5f}\n" for k in range(400))
    log = f"t,u,y\n{rows}".encode()
    for seed in range(first, first + 2 * count):
        changed = mutated(table, seed)
        (tmp_path / "recording.toml").write_text(written(changed.table) if seed % 2 else RECORDING)
        (tmp_path / "run.csv").write_bytes(log if seed % 2 else garbled(log, seed))
        how = str(changed.how) if seed % 2 else "the log"
        refused_or_read(load_recordings, [tmp_path], model, how=f"seed {seed}: {how}")


@rounds
def test_lists_of_poses(count, first, tmp_path):
    device = SCENARIOS / "devices" / "mems_hexapod.toml"
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{device}"\n[path]\nkind = "poses"\nfile = "p.csv"\n'
    )
    for seed in range(first, first + count):
        (tmp_path / "p.csv").write_bytes(garbled(POSES.encode(), seed))
        refused_or_read(read_scenario, tmp_path, how=f"seed {seed}")


@rounds
def test_uncertainties(count, first, tmp_path):
    scenario = load_scenario(SCENARIOS / "circle20")
    model = model_of(scenario.inputs["device"].path.resolve())
    table = tomllib.loads((SCENARIOS / "circle20" / "uncertainty.toml").read_text())
    for seed in range(first, first + count):
        changed = mutated(table, seed)
        (tmp_path / "u.toml").write_text(written(changed.table))
        refused_or_read(load_uncertainties, scenario, model, tmp_path / "u.toml", how=f"seed {seed}: {changed.how}")


@rounds
def test_constants_of_a_specimen(count, first, tmp_path):
    table = tomllib.loads((SCENARIOS / "devices" / "mems_hexapod_run_time.toml").read_text())
    for seed in range(first, first + count):
        changed = mutated(table["run_time"], seed)
        (tmp_path / "device.toml").write_text(written({**table, "run_time": changed.table}))

        def read() -> None:
            device: Device = load_device(tmp_path / "device.toml")
            for c in device.given_at_start:
                assert re.fullmatch(r"[a-z][a-z0-9_]*", c.name) and c.low < c.high

        refused_or_read(read, how=f"seed {seed}: {changed.how}")


@rounds
def test_lists_of_diagnoses(count, first, tmp_path):
    (tmp_path / "device.toml").write_text(AXIS.read_text())
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "recording.toml").write_text(RECORDING)
    for seed in range(first, first + count):
        changed = mutated(tomllib.loads(JOBS), seed)
        (tmp_path / "jobs.toml").write_text(written(changed.table))
        refused_or_read(load_batch, tmp_path / "jobs.toml", how=f"seed {seed}: {changed.how}")


@rounds
def test_toml_that_is_damaged(count, first, tmp_path):
    content = AXIS.read_bytes()
    for seed in range(first, first + count):
        (tmp_path / "a.toml").write_bytes(garbled(content, seed))
        refused_or_read(read_toml, tmp_path / "a.toml", how=f"seed {seed}")


@rounds
def test_what_a_diagnosis_and_a_package_left_behind(count, first, tmp_path):
    """The fits of an interrupted diagnosis, the manifest of generated C: files of ours that anybody may have changed."""
    made_from = {"code": "1"}
    fits = json.dumps(made_from) + '\n["a", [1.0, 2.0]]\n["b", [3.0]]\n'
    manifest = json.dumps({"name": "a", "files": {"a.c": "0", "b.h": "1"}})
    for seed in range(first, first + count):
        (tmp_path / "fits").write_bytes(garbled(fits.encode(), seed))
        refused_or_read(Checkpoint, tmp_path / "fits", made_from, how=f"seed {seed}")
        (tmp_path / "manifest.json").write_bytes(garbled(manifest.encode(), seed))
        refused_or_read(verify_package, tmp_path, how=f"seed {seed}")
