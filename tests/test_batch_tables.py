"""What a batch says of all its results: tables, progress, and what that takes of memory; a scheduler that is gone."""

from __future__ import annotations

import json
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path

import pytest
from conftest import AXIS_FILE
from recording_folders import SERVO, servo_poses

from ctrlgen.app import batch_tables
from ctrlgen.app.batch import BatchRow, Task, load_batch, run_batch
from ctrlgen.app.batch_tables import BatchTables, write_parquet
from ctrlgen.core.errors import InputError

HELD_OUT = {"reading.y": {"rms_before": 2.0, "rms_after": 0.5, "noise_floor": 0.25, "uncertainty": 0.1, "unit": "um"}}
CREEP = {"effect": "creep", "location": "y", "parameters": {"gain": {"value": 0.03, "ci95": [0.02, 0.04], "unit": "1"}}}
RECORD = {"verdict": "explained", "findings": [CREEP], "held_out": HELD_OUT, "implausible": []}


def test_the_tables_as_parquet_hold_every_result_and_every_number(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: pip install '.[recordings]'")
    rows = [
        BatchRow("a", "done", "explained", "creep at y", "reading.y", 2.0, 0.5, None, "um"),
        BatchRow("b", "failed", error="=no"),
    ]
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "diagnosis.json").write_text(json.dumps(RECORD))
    assert write_parquet(rows, tmp_path)
    table = pq.read_table(tmp_path / "results.parquet").to_pylist()
    assert [(r["name"], r["state"], r["before"], r["noise"], r["error"]) for r in table] == [
        ("a", "done", 2.0, None, ""),
        ("b", "failed", None, None, "=no"),
    ]
    numbers = {n["quantity"]: n for n in pq.read_table(tmp_path / "numbers.parquet").to_pylist()}
    assert set(numbers) == {"error before: reading.y", "error after: reading.y", "noise: reading.y", "creep at y: gain"}
    gain = numbers["creep at y: gain"]
    assert (gain["name"], gain["value"], gain["low"], gain["high"], gain["unit"]) == ("a", 0.03, 0.02, 0.04, "1")
    assert (numbers["noise: reading.y"]["value"], numbers["noise: reading.y"]["low"]) == (0.25, None)
    assert {p.name for p in tmp_path.iterdir()} == {"a", "results.parquet", "numbers.parquet"}


def test_numbers_are_written_in_parts(tmp_path, monkeypatch):
    pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: pip install '.[recordings]'")
    monkeypatch.setattr(batch_tables, "ROWS_AT_ONCE", 3)
    rows = [BatchRow(str(k), "done") for k in range(7)]
    write_parquet(rows, tmp_path)
    assert pq.ParquetFile(tmp_path / "results.parquet").num_row_groups == 3
    assert pq.read_table(tmp_path / "results.parquet")["name"].to_pylist() == list("0123456")


def test_without_pyarrow_the_other_tables_are_there(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert not write_parquet([], tmp_path) and not list(tmp_path.iterdir())


def test_the_progress_is_counted_and_not_written_all_the_time(tmp_path):
    tables = BatchTables(["a", "b", "c"], tmp_path)
    tables.write({})
    assert (tmp_path / "results.csv").read_text().startswith("name,verdict,findings,")
    rows = {"b": BatchRow("b", "done", "explained"), "a": BatchRow("a", "failed")}
    tables.told(rows)
    assert json.loads((tmp_path / "batch.json").read_text())["done"] == 0  # a moment ago
    tables.written -= batch_tables.SECONDS
    tables.told(rows)
    assert json.loads((tmp_path / "batch.json").read_text()) == {
        "total": 3,
        "done": 2,
        "failed": 1,
        "verdicts": {"explained": 1},
    }
    assert [line.split(",")[0] for line in (tmp_path / "results.csv").read_text().splitlines()] == ["name", "a", "b"]


@pytest.mark.long
def test_the_results_of_a_batch_are_not_kept_in_memory(tmp_path, monkeypatch):
    """240 results of 100 kB: what grows is the line of each in the table."""
    folder = servo_poses(tmp_path / "run", 0.0, 0)
    tasks = [Task(f"r{k}", str(AXIS_FILE), (str(folder),), 0) for k in range(240)]
    made = {"device": "0" * 64}
    monkeypatch.setattr(Task, "made_from", lambda self: made)
    monkeypatch.setattr(
        Task, "__call__", lambda self: {"diagnosis.json": json.dumps(RECORD).encode(), "report.html": bytes(100_000)}
    )
    peaks = []

    def told(done: int, _: int) -> None:
        if done % 80 == 0 and done:
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.reset_peak()

    tracemalloc.start()
    try:
        rows = run_batch(tasks, tmp_path / "out", jobs=0, progress=told)
    finally:
        tracemalloc.stop()
    assert len(rows) == 240 and all(row.state == "done" for row in rows)
    assert peaks[2] - peaks[0] < 1e6  # 160 results of 100 kB would be 16 MB


@pytest.mark.long
def test_a_batch_goes_on_after_its_scheduler_was_killed(tmp_path):
    pytest.importorskip("distributed", reason="dask[distributed] is not installed: no scheduler to kill")
    (tmp_path / "table.toml").write_text(SERVO)
    for k in range(3):
        servo_poses(tmp_path / "runs" / f"run{k}", 1e-3 * k, k)
    (tmp_path / "jobs.toml").write_text(
        'laws = ["sensor_gain"]\n[[job]]\ndevice = "table.toml"\nrecordings = ["runs/*"]\n'
    )
    tasks, out = load_batch(tmp_path / "jobs.toml"), tmp_path / "out"
    with Scheduler(tmp_path / "first") as scheduler:

        def told(done: int, _: int) -> None:
            if done == 1:
                scheduler.kill()

        with pytest.raises(InputError, match="is gone; what is finished stays"):
            run_batch(tasks, out, scheduler=scheduler.address, progress=told)
    first = {p.parent.name for p in out.glob("[!.]*/diagnosis.json")}
    assert len(first) == 1 and json.loads((out / "batch.json").read_text())["done"] == 1
    with Scheduler(tmp_path / "second") as scheduler:
        rows = run_batch(tasks, out, scheduler=scheduler.address)
    assert {row.name for row in rows if row.state == "done before"} == first
    assert [row.state for row in rows].count("done") == 2


class Scheduler:
    """A scheduler of dask.distributed with one worker, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self.file = folder / "scheduler.json"
        command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
        self.processes = [self._started([*command, "--no-dashboard", "--scheduler-file", str(self.file)])]

    def _started(self, command: list[str]) -> subprocess.Popen[bytes]:
        return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.file.parent)

    def __enter__(self) -> Scheduler:
        end = time.monotonic() + 60
        self.address = ""
        while not self.address and time.monotonic() < end:
            time.sleep(0.1)
            try:
                self.address = json.loads(self.file.read_text())["address"]
            except (OSError, ValueError):
                continue
        command = [
            sys.executable,
            "-m",
            "distributed.cli.dask_worker",
            self.address,
            "--nthreads",
            "1",
            "--no-dashboard",
        ]
        self.processes.append(self._started([*command, "--no-nanny"]))
        return self

    def kill(self) -> None:
        self.processes[0].kill()
        self.processes[0].wait()

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
