"""Many pieces of work through one interface: in order or not, here or elsewhere, whatever dies on the way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter

import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.core.parallel import Failure, run_all

ITEMS = list(range(8))


def square(k: int) -> int:
    return k * k


def picky(k: int) -> int:
    if k == 3:
        raise ValueError("three is not to my taste")
    return k * k


class Dies:
    """Kills its own process when it meets item 2: once, or always."""

    def __init__(self, folder: str, always: bool = False) -> None:
        self.folder, self.always = folder, always

    def __call__(self, k: int) -> int:
        mark = os.path.join(self.folder, "died")
        if k == 2 and (self.always or not os.path.exists(mark)):
            open(mark, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return k * k


class Slow:
    """Takes a while, and leaves its process's id."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, k: int) -> int:
        open(os.path.join(self.folder, f"{k}.{os.getpid()}"), "w").close()
        time.sleep(0.4)
        return k * k


@pytest.mark.parametrize("jobs", [0, 1, 2])
def test_results_are_the_same_wherever_they_are_made(jobs):
    told = []
    found = dict(run_all(square, ITEMS, jobs=jobs, progress=lambda done, of: told.append((done, of))))
    assert found == {k: k * k for k in ITEMS} and told == [(k + 1, 8) for k in ITEMS]


def process_of(_: int) -> int:
    return os.getpid()


def test_processes_are_begun_anew_so_that_what_they_leave_in_memory_goes(monkeypatch):
    monkeypatch.setattr("ctrlgen.core.parallel.RENEWED", 3)
    found = dict(run_all(process_of, ITEMS, jobs=1))
    assert sorted(found) == ITEMS and sorted(Counter(found.values()).values()) == [2, 3, 3]


def test_a_process_that_is_killed_takes_its_workers_with_it(tmp_path):
    """They hold its standard output open as long as they live."""
    code = f"from test_parallel import *\nif __name__ == '__main__': dict(run_all(Slow({str(tmp_path)!r}), ITEMS * 99, jobs=1))"
    (tmp_path / "long_work.py").write_text(code)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])}
    command = [sys.executable, str(tmp_path / "long_work.py")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment)
    end = time.monotonic() + 60
    while not (started := list(tmp_path.glob("?.*"))) and time.monotonic() < end:
        time.sleep(0.02)
    assert started
    process.kill()
    process.communicate(timeout=20)


def test_nothing_to_do_is_done_at_once():
    assert list(run_all(square, [])) == []


@pytest.mark.parametrize("jobs", [0, 2])
def test_an_item_that_fails_does_not_lose_the_others(jobs):
    found = dict(run_all(picky, ITEMS, jobs=jobs))
    assert found.pop(3).what == "three is not to my taste"
    assert found == {k: k * k for k in ITEMS if k != 3}


def test_a_process_that_dies_loses_nothing(tmp_path):
    assert dict(run_all(Dies(str(tmp_path)), ITEMS, jobs=2)) == {k: k * k for k in ITEMS}


def test_an_item_that_always_kills_its_process_is_given_up_alone(tmp_path):
    found = dict(run_all(Dies(str(tmp_path), always=True), ITEMS[:5], jobs=2))
    lost = found.pop(2)
    assert isinstance(lost, Failure) and "died 3 times" in lost.what
    assert found == {k: k * k for k in ITEMS[:5] if k != 2}


def test_what_cannot_be_sent_is_refused_with_what_to_do():
    with pytest.raises(InputError, match="use jobs = 0"):
        list(run_all(lambda k: k, ITEMS, jobs=2))


def test_a_scheduler_that_does_not_answer_is_said(monkeypatch):
    pytest.importorskip("distributed", reason="dask[distributed] is not installed: no scheduler to ask")
    monkeypatch.setattr("ctrlgen.core.parallel.SCHEDULER_TIMEOUT", "1 s")
    with pytest.raises(InputError, match="does not answer"):
        list(run_all(square, ITEMS, scheduler="tcp://127.0.0.1:9"))


@pytest.fixture
def cluster():
    distributed = pytest.importorskip("distributed", reason="dask[distributed] is not installed: no cluster")
    options = dict(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)
    with distributed.LocalCluster(**options) as cluster:
        yield cluster


@pytest.mark.long
@pytest.mark.filterwarnings("default")
def test_a_cluster_loses_nothing_when_a_worker_is_killed(cluster, tmp_path):
    found, killed = {}, None
    for k, result in run_all(Slow(str(tmp_path)), ITEMS, scheduler=cluster.scheduler_address):
        found[k] = result
        if killed is None:
            killed = max(int(name.split(".")[1]) for name in os.listdir(tmp_path))
            os.kill(killed, signal.SIGKILL)
    assert found == {k: k * k for k in ITEMS}
    workers = {int(name.split(".")[1]) for name in os.listdir(tmp_path)}
    assert killed in workers and len(workers) >= 2
    again = dict(run_all(picky, ITEMS, scheduler=cluster.scheduler_address))
    assert again.pop(3).what == "three is not to my taste" and again == {k: k * k for k in ITEMS if k != 3}
