"""Many recordings in one command, and bootstrap replicates: wherever they run, whatever stops them."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import AXIS_FILE
from recording_folders import SERVO, axis_recording, servo_poses

import ctrlgen
from ctrlgen.app.batch import earlier, load_batch, run_batch
from ctrlgen.app.commands.cli import execute
from ctrlgen.core.errors import InputError
from ctrlgen.diagnosis.evidence.bootstrap import block_length, bootstrap, redrawn
from ctrlgen.recordings.recording import Record


@pytest.fixture
def jobs(tmp_path) -> Path:
    """A list of three diagnoses: one with a gain, one without, one that cannot be read."""
    (tmp_path / "table.toml").write_text(SERVO)
    for k, gain in enumerate((1e-3, 0.0)):
        servo_poses(tmp_path / "runs" / f"run{k}", gain, k)
    broken = servo_poses(tmp_path / "runs" / "wrong", 0.0, 9)
    (broken / "poses.csv").write_text("r,y\n1,1\n")
    (tmp_path / "jobs.toml").write_text('[[job]]\ndevice = "table.toml"\nrecordings = ["runs/*"]\n')
    return tmp_path / "jobs.toml"


def table_of(out: Path) -> dict[str, dict[str, str]]:
    with (out / "results.csv").open() as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def answers(out: Path) -> dict[str, bytes]:
    return {str(p.relative_to(out)): p.read_bytes() for p in sorted(out.rglob("*")) if p.is_file()}


@pytest.mark.long
def test_each_recording_gets_its_folder_and_its_line(jobs, tmp_path):
    out = tmp_path / "out"
    rows = run_batch(load_batch(jobs), out, jobs=2)
    assert [row.state for row in rows] == ["done", "done", "failed"]
    table = table_of(out)
    assert list(table) == [f"table--{name}" for name in ("run0", "run1", "wrong")]
    assert not table["table--run1"]["warning"]
    assert table["table--run1"]["verdict"] == "consistent" and table["table--run1"]["findings"] == ""
    assert table["table--run0"]["findings"] and float(table["table--run0"]["before"]) > 0.01
    assert "row" in table["table--wrong"]["error"] and not (out / "table--wrong").exists()
    for name in ("diagnosis.json", "report.html", "device.next.toml", "made_from.json"):
        assert (out / "table--run0" / name).is_file()
    assert not list(out.glob(".*"))


@pytest.mark.long
def test_what_is_there_is_kept_and_what_changed_is_made_again(jobs, tmp_path, monkeypatch):
    jobs.write_text('laws = ["sensor_gain", "bow"]\n' + jobs.read_text())
    out = tmp_path / "out"
    run_batch(load_batch(jobs)[:2], out, jobs=0)
    times = {p: p.stat().st_mtime_ns for p in out.rglob("diagnosis.json")}
    (tmp_path / "runs" / "run1" / "poses.csv").write_bytes((tmp_path / "runs" / "run0" / "poses.csv").read_bytes())
    told = []
    rows = run_batch(load_batch(jobs)[:2], out, jobs=0, progress=lambda done, of: told.append((done, of)))
    assert [row.state for row in rows] == ["done before", "done"] and told == [(1, 2), (2, 2)]
    assert {p.parent.name for p, at in times.items() if p.stat().st_mtime_ns != at} == {"table--run1"}
    assert run_batch(load_batch(jobs, seed=1)[:1], out, jobs=0)[0].state == "done"
    assert run_batch(load_batch(jobs, seed=1)[:1], out, jobs=0)[0].state == "done before"
    monkeypatch.setattr("ctrlgen.app.batch.code_hash", lambda: "of other code")
    assert run_batch(load_batch(jobs, seed=1)[:1], out, jobs=0)[0].state == "done"


def test_a_result_that_is_damaged_is_made_again(tmp_path):
    (tmp_path / "made_from.json").write_text('{"seed": 0}')
    for damaged in ("", "[]", "{}", '{"findings": 1}', "[" * 99_999):
        (tmp_path / "diagnosis.json").write_text(damaged)
        assert earlier("a", tmp_path, {"seed": 0}) is None
    (tmp_path / "made_from.json").write_text("[" * 99_999)
    assert earlier("a", tmp_path, {"seed": 0}) is None


def test_a_pattern_does_not_walk_through_whole_disks(tmp_path):
    (tmp_path / "table.toml").write_text(SERVO)
    for pattern in ("/**/*", "**", "x" * 5000, "[", "/*/" * 300):
        (tmp_path / "jobs.toml").write_text(f'[[job]]\ndevice = "table.toml"\nrecordings = ["{pattern[:1900]}"]\n')
        with pytest.raises(InputError, match="nothing matches"):
            load_batch(tmp_path / "jobs.toml")


def test_a_list_says_all_its_faults(tmp_path):
    (tmp_path / "table.toml").write_text(SERVO)
    servo_poses(tmp_path / "a" / "run", 0.0, 0)
    servo_poses(tmp_path / "b" / "run", 0.0, 0)
    job = '[[job]]\ndevice = "{}"\nrecordings = {}\n'
    text = job.format("none.toml", '["c*"]') + job.format("table.toml", '["a/run", "b/run", ["a/run", "nowhere"]]')
    (tmp_path / "jobs.toml").write_text('laws = ["creeep"]\n' + text)
    with pytest.raises(InputError) as caught:
        load_batch(tmp_path / "jobs.toml")
    for part in (
        "none.toml does not exist",
        "nothing matches 'c*'",
        "nothing matches 'nowhere'",
        "would have the result folder table--run",
        "laws: creeep is not a known effect",
    ):
        assert part in str(caught.value), part


def test_recordings_in_a_list_of_their_own_are_joined(jobs, tmp_path):
    (tmp_path / "joined.toml").write_text(
        '[[job]]\nname = "j"\ndevice = "table.toml"\nrecordings = [["runs/run0", "runs/run1"]]\n'
    )
    (task,) = load_batch(tmp_path / "joined.toml")
    assert task.name == "j--run0+run1" and len(task.recordings) == 2


@pytest.mark.long
@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGKILL])
def test_a_batch_that_is_stopped_goes_on_where_it_was(jobs, tmp_path, by):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "ctrlgen", "batch", str(jobs), "--out", str(out), "--jobs", "1"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not list(out.glob("[!.]*/diagnosis.json")) and time.monotonic() < end:  # not the draft of one
        time.sleep(0.02)
    process.send_signal(by)
    message = process.communicate(timeout=60)[1]
    if by == signal.SIGINT:
        assert process.returncode == 130 and "nothing was written that was not finished" in message
        told = json.loads((out / "batch.json").read_text())
        assert (told["total"], told["done"], told["failed"], sum(told["verdicts"].values())) == (3, 1, 0, 1)
    first = {p.parent.name for p in out.glob("[!.]*/diagnosis.json")}
    assert first == {"table--run0"}
    if by == signal.SIGINT:  # what is killed while it writes leaves the file it wrote to
        assert not list(out.glob(".*"))
    rows = {row.name: row.state for row in run_batch(load_batch(jobs), out, jobs=0)}
    assert rows == {"table--run0": "done before", "table--run1": "done", "table--wrong": "failed"}


def test_a_result_counts_that_was_there_when_the_batch_was_stopped_before_its_row(jobs, tmp_path, monkeypatch):
    out, task = tmp_path / "out", load_batch(jobs)[1]
    record = {"findings": [], "verdict": "consistent", "implausible": []}
    error = {"rms_before": 1.0, "rms_after": 1.0, "noise_floor": 1.0, "unit": "um"}
    content = json.dumps({**record, "held_out": {"y": error}}).encode()
    monkeypatch.setattr("ctrlgen.app.batch.work_on", lambda task: {"diagnosis.json": content})
    whole = ctrlgen.app.batch.whole_folder

    @contextmanager
    def stopped(folder):
        with whole(folder) as draft:
            yield draft
        raise KeyboardInterrupt

    monkeypatch.setattr("ctrlgen.app.batch.whole_folder", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_batch([task], out, jobs=0)
    told = json.loads((out / "batch.json").read_text())
    assert (told["total"], told["done"], told["failed"], told["verdicts"]) == (1, 1, 0, {"consistent": 1})
    assert list(table_of(out)) == [task.name]


def kill_a_worker_at_work(cluster, killed: list) -> None:
    """Waits until a worker has been at a diagnosis for a while, and kills its process."""
    end = time.monotonic() + 60
    while not killed and time.monotonic() < end:
        for worker in list(cluster.scheduler.workers.values()):
            mine = [task.key for task in worker.processing if task.key.startswith("ctrlgen-")]
            if mine:
                time.sleep(0.2)  # less than any diagnosis takes, so that one is always met in the middle
                if mine[0] in {task.key for task in worker.processing}:
                    nanny = next(n for n in cluster.workers.values() if n.worker_address == worker.address)
                    os.kill(nanny.pid, signal.SIGKILL)
                    killed.append(mine[0])
                    break
        time.sleep(0.01)


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_a_cluster_gives_the_same_though_a_worker_is_killed(jobs, tmp_path):
    distributed = pytest.importorskip("distributed", reason="dask[distributed] is not installed: no cluster")
    servo_poses(tmp_path / "runs" / "run2", -2e-3, 2)
    here, there, killed = tmp_path / "here" / "out", tmp_path / "there" / "out", []  # a page has its folder's name
    options = dict(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)
    with distributed.LocalCluster(**options) as cluster:
        killer = threading.Thread(target=kill_a_worker_at_work, args=(cluster, killed))
        killer.start()
        rows = run_batch(load_batch(jobs), there, scheduler=cluster.scheduler_address)
        killer.join()
    assert killed and [row.state for row in rows] == ["done", "done", "done", "failed"]
    run_batch(load_batch(jobs), here, jobs=0)
    assert answers(there) == answers(here)


@pytest.fixture(scope="module")
def creeping(tmp_path_factory):
    """A diagnosis of an axis that creeps."""
    axis = AXIS_FILE
    creep = '[[effect]]\nkind = "creep"\nat = "axis"\ngain = "0.03"\ntau = "0.2 s"\nslow = "0"\n'
    folder = axis_recording(tmp_path_factory.mktemp("axis"), axis.read_text() + creep)
    return ctrlgen.diagnose(axis, folder, laws=("creep", "drive_gain", "stiffening"))


@pytest.mark.long
def test_replicates_agree_with_the_slopes_where_the_noise_is_white(creeping):
    found = bootstrap(creeping.search, 24, seed=3, jobs=0)
    assert found.replicates == 24 and found.failed == () and list(found.vanished.values()) == [0.0]
    gain, fit = found.values["effect[0].gain"], creeping.search.chosen.fit
    assert gain.ci95[0] < 0.03 < gain.ci95[1]
    k = next(i for i, u in enumerate(fit.structure.free_parameters) if u.path == "effect[0].gain")
    of_slopes = 2 * 1.96 * np.sqrt(fit.covariance[k, k])
    assert 0.4 < (gain.ci95[1] - gain.ci95[0]) / of_slopes < 2.0
    said = creeping.values["effect[0].gain"].ci95  # with what the law's form may be off
    assert said[1] - said[0] > of_slopes
    assert found.values.keys() == creeping.values.keys()


@pytest.mark.long
def test_replicates_are_the_same_in_other_processes(creeping):
    a, b = (bootstrap(creeping.search, 4, seed=3, jobs=jobs) for jobs in (0, 2))
    assert a == b
    assert "too few" in a.note


@pytest.mark.long
def test_the_command_prints_and_keeps_the_intervals(jobs, tmp_path, monkeypatch, capsys):
    files = [str(tmp_path / "table.toml"), str(tmp_path / "runs" / "run0")]
    command = ["ctrlgen", "diagnose", *files, "--out", str(tmp_path / "out"), "--bootstrap", "20", "--jobs", "0"]
    command += ["--laws", "sensor_gain,bow"]
    monkeypatch.setattr(sys, "argv", command)
    assert execute() == 0
    printed = capsys.readouterr().out
    assert "20 replicates" in printed and "effect[0].gain" in printed and "vanished in 0 %" in printed
    found = json.loads((tmp_path / "out" / "bootstrap.json").read_text())
    low, high = found["values"]["effect[0].gain"]["ci95"]
    assert found["replicates"] == 20 and low < 1e-3 < high


def test_residuals_are_drawn_in_whole_blocks(rng):
    n = 400
    e = np.convolve(rng.standard_normal(n + 20), np.ones(21) / 21, "valid")[:, None]
    record = Record("r", "fit", np.arange(n), 1.0, e, e.copy(), False, None, np.ones((n, 1), bool))
    record.observed[7], record.valid[7] = np.nan, False
    assert block_length(record, np.zeros((n, 1))) >= 30
    assert block_length(replace(record, sample_time=np.inf), np.zeros((n, 1))) == 1
    drawn = redrawn(record, np.zeros((n, 1)), 40, rng)
    assert drawn.shape == (n, 1) and np.all(np.isfinite(drawn))
    assert np.abs(np.diff(drawn[:40, 0])).max() < 0.5 * np.ptp(e)


@pytest.mark.long
def test_a_unit_that_cannot_be_right_is_told_in_the_line_of_its_recording(jobs, tmp_path):
    file = tmp_path / "runs" / "run1" / "recording.toml"
    file.write_text(file.read_text().replace('column = "y", unit = "deg"', 'column = "y", unit = "rad"'))
    rows = run_batch(load_batch(jobs)[1:2], tmp_path / "out", jobs=0)
    assert 'write unit = "deg"' in rows[0].warning and 'write unit = "deg"' in str(table_of(tmp_path / "out"))
