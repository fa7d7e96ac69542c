"""Work divided among forks: order, errors, what keeps its identity, and that a diagnosis does not depend on their number."""

from __future__ import annotations

import os
import sys
import time

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter

from ctrlgen.core.forks import JOBS_VARIABLE, in_forks, usable_cores
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.estimation.checkpoint import Checkpoint

forked = pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="processes are not forked on this system")
several = pytest.mark.parametrize("jobs", [1, 2, 5])


@several
def test_results_come_in_the_order_of_the_items(jobs):
    def slowest_first(k):
        time.sleep(0.02 * (4 - k) * (jobs > 1))
        return k * np.ones(3)

    begun = []
    results = in_forks(slowest_first, range(4), jobs, begun.append)
    assert [r.tolist() for r in results] == [[k] * 3 for k in range(4)]
    assert sorted(begun) == [0, 1, 2, 3]


@several
def test_the_first_error_in_order_is_raised_here(jobs):
    def fails(k):
        if k:
            raise ValueError(f"item {k}")

    with pytest.raises(ValueError, match="item 1"):
        in_forks(fails, range(3), jobs)


@several
def test_a_shared_object_is_not_copied(jobs):
    shared, own = np.ones(3), np.zeros(3)
    for first, second in in_forks(lambda _: (shared, own), range(2), jobs, shared=(shared,)):
        assert first is shared
        assert (second is own) == (jobs == 1)


@forked
def test_work_is_done_elsewhere_and_what_it_changes_stays_there():
    here = [os.getpid()]

    def change(_):
        here.append(0)
        return os.getpid(), usable_cores()

    assert all(pid != here[0] and cores == 1 for pid, cores in in_forks(change, range(3), 2))
    assert len(here) == 1


@forked
def test_a_fork_that_dies_is_told():
    with pytest.raises(RuntimeError, match="2 of 3"):
        in_forks(lambda k: k or os._exit(9), [1, 0, 0], 2)


@forked
def test_a_result_that_cannot_be_sent_is_told():
    with pytest.raises(RuntimeError, match="cannot be sent"):
        in_forks(lambda k: lambda: k, range(2), 2)


@forked
@pytest.mark.parametrize("given, cores", [("3", 3), ("0", 1), ("many", len(os.sched_getaffinity(0)))])
def test_the_number_of_processes_may_be_given_in_the_environment(monkeypatch, given, cores):
    monkeypatch.setenv(JOBS_VARIABLE, given)
    assert usable_cores() == cores


@forked
def test_a_diagnosis_is_the_same_in_any_number_of_processes_and_can_be_continued(tmp_path):
    """A stage with a force that depends on its position, and a kept file of the fits."""
    fitter = axis_fitter(lambda t, q, v, memory: (-2e12 * q**3, memory))
    answers, files = [], []
    for jobs in (0, 2):
        kept = Checkpoint(tmp_path / f"{jobs}.unfinished", {"seed": 0})
        found = diagnose_recording(AXIS, fitter.recording, jobs=jobs, checkpoint=kept)
        answers.append([(f.effect, f.location, f.share, f.parameters) for f in found.findings])
        files.append(sorted((tmp_path / f"{jobs}.unfinished").read_text().splitlines()))
    assert answers[0] == answers[1] and answers[0]
    assert files[0] == files[1] and len(set(files[0])) == len(files[0]) > 5
