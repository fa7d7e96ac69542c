"""Work divided among forks: order, errors, what keeps its identity, and that a diagnosis does not depend on their number."""

from __future__ import annotations

import os
import signal
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, H, axis_fitter, record

import ctrlgen
from ctrlgen.core.forks import JOBS_VARIABLE, in_forks, usable_cores
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.recordings.recording import Recording

forked = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are forked on Linux alone")
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
def test_the_work_of_a_fork_that_dies_is_done_here():
    here = os.getpid()

    def work(k):
        if k == 1 and os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    assert in_forks(work, range(6), 2) == list(range(6))


@forked
def test_work_whose_result_cannot_be_sent_is_done_here():
    assert [result() for result in in_forks(lambda k: lambda: k, range(3), 2)] == [0, 1, 2]


@forked
@pytest.mark.parametrize("given, cores", [("3", 3), ("0", 1), ("many", None)])
def test_the_number_of_processes_may_be_given_in_the_environment(monkeypatch, given, cores):
    monkeypatch.setenv(JOBS_VARIABLE, given)
    assert usable_cores() == (cores or len(os.sched_getaffinity(0)))


@forked
@pytest.mark.parametrize("jobs", [1, 2])
def test_an_item_recalls_the_fits_of_those_before_all_items_and_of_no_other(tmp_path, jobs):
    checkpoint = Checkpoint(tmp_path / "unfinished", {})
    fitter = SimpleNamespace(checkpoint=checkpoint, recording=SimpleNamespace(kind="series"), noise=None, errors=None)
    trials = Trials(fitter, None, lambda _: None, jobs)

    def fit(_, key):
        known = sorted(checkpoint.optima)
        checkpoint.keep(key, np.ones(1))
        return known

    assert trials.each(fit, ["a", "b", "c"]) == [[], [], []]
    assert trials.each(fit, ["d", "e"]) == [["a", "b", "c"]] * 2
    assert set(Checkpoint(tmp_path / "unfinished", {}).optima) == set(checkpoint.optima) == set("abcde")


def cubic_axis():
    """A stage with inertia whose force depends on its position."""
    return AXIS, axis_fitter(lambda t, q, v, memory: (-2e12 * q**3, memory)).recording


def bent_mirror():
    """A mirror in balance, one volt for each 7.5 mrad, whose reading is bent by a tenth."""
    device = ctrlgen.user_device(
        "mirror",
        parameters={"stiffness": ("2 N*m/rad", "0.02 N*m/rad"), "motor": ("15 mN*m/V", "0.1 mN*m/V")},
        drive={"motor": "20 V"},
        axes={"tilt": "100 mrad"},
        force=lambda u, p: p.motor * u.motor,
        restoring_force=lambda d, p: p.stiffness * d.tilt,
    )
    t, noise, rng = H * np.arange(800), 1e-5, np.random.default_rng(3)
    records = []
    for role, slow in (("fit", 2.3), ("hold_out", 3.1)):
        u = 8 * np.sin(2 * np.pi * slow * t) + 2 * np.sin(2 * np.pi * 7 * slow * t)
        tilt = 7.5e-3 * u
        records.append(record(u, tilt + 1.3 * tilt**2 + noise * rng.standard_normal(len(t)), role))
    return device, Recording("t", "mirror", "series", ("reading.tilt",), ("mrad",), (noise,), tuple(records), ())


@pytest.mark.long
@forked
@pytest.mark.parametrize("recorded", [pytest.param(cubic_axis, marks=pytest.mark.exhaustive), bent_mirror])
def test_a_diagnosis_is_the_same_in_any_number_of_processes_and_can_be_continued(tmp_path, recorded):
    device, recording = recorded()
    answers, files = [], []
    for jobs in (0, 2):
        kept = Checkpoint(tmp_path / f"{jobs}.unfinished", {"seed": 0})
        found = diagnose_recording(device, recording, jobs=jobs, checkpoint=kept)
        answers.append([(f.effect, f.location, f.share, f.parameters) for f in found.findings])
        files.append(sorted((tmp_path / f"{jobs}.unfinished").read_text().splitlines()))
    assert answers[0] == answers[1] and answers[0]
    assert files[0] == files[1] and len(set(files[0])) == len(files[0]) > 5
