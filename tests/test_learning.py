"""Learning from runs: its judgement on simulated benches, what it refuses, and its command."""

from __future__ import annotations

import hashlib
import json
import shutil

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import SCENARIOS
from learning_bench import NOISE, RIGHT, Bench, refused, shortened, solved, write
from result_files import faults

from ctrlgen import InputError, learn
from ctrlgen.learning.lifted import Lifted
from ctrlgen.trajectory.solution import Solution


@pytest.fixture(scope="module")
def hundred(tmp_path_factory) -> Solution:
    """The circle in 200 samples."""
    folder = tmp_path_factory.mktemp("hundred")
    return solved(shortened("circle20", folder / "circle20", sample_rate="200 Hz", duration="1 s"))


@pytest.mark.long
def test_learning_brings_a_wrong_device_down_to_what_noise_allows(hundred, tmp_path):
    """From 360 nm to a few in two steps, and then it says that what is left is noise or not worth a run."""
    bench, u, seen = Bench(hundred, tmp_path), hundred.drive, []
    for _ in range(4):
        bench.run(u)
        found = learn(hundred.scenario, bench.runs)
        seen.append((bench.error(u), found))
        u = found.next.drive
        if found.stop:
            break
    errors = [error for error, _ in seen]
    assert errors[0] > 300e-9 and errors[1] < errors[0] / 10 and errors[2] < 6e-9
    assert seen[-1][1].stop
    last = seen[-1][1]
    for error, run in zip(errors, last.runs, strict=True):  # what is reported is what was there
        assert run.least["translation"] <= error + 2e-9 and run.most["translation"] >= error - 2e-9


@pytest.mark.long
def test_a_worse_run_is_not_gone_on_from_and_the_step_is_halved(hundred, tmp_path):
    bench = Bench(hundred, tmp_path)
    bench.run(hundred.drive)
    bench.run(np.clip(hundred.drive * 0.93, 0, None))  # a run that somebody else's drives made worse
    found = learn(hundred.scenario, bench.runs)
    assert found.base == 0 and found.step == 0.5 and not found.stop
    full = np.abs(learn(hundred.scenario, bench.runs[:1]).next.drive - hundred.drive).max()
    assert 0.3 * full < np.abs(found.next.drive - hundred.drive).max() < 0.7 * full


def exchanged(u: np.ndarray) -> np.ndarray:
    return u[:, [0, 3, 2, 1, 4, 5]]


def unplugged(u: np.ndarray) -> np.ndarray:
    return np.where(np.arange(6) == 4, 0.1, u)


def backward(u: np.ndarray) -> np.ndarray:
    return np.where(np.arange(6) == 0, 0.16 - u, u)


@pytest.mark.long
@pytest.mark.parametrize(
    ("wired", "names", "says"),
    [
        (exchanged, "drive.1Y, drive.2Y", "exchanged"),
        (unplugged, "drive.3X", "hardly acts"),
        (backward, "drive.1X", "the other way"),
    ],
)
def test_an_actuator_that_answers_otherwise_is_named_once_a_second_run_shows_it(hundred, tmp_path, wired, names, says):
    bench = Bench(hundred, tmp_path, wired)
    bench.run(hundred.drive)
    found = learn(hundred.scenario, bench.runs)  # one run says nothing of the answer
    step = np.abs(found.next.drive - hundred.drive).max()
    assert 0 < step <= 0.2 * hundred.drive.max() * (1 + 1e-9)
    bench.run(found.next.drive)
    (fault,) = refused(lambda: learn(hundred.scenario, bench.runs))
    assert names in fault and says in fault


def places(order: list[int], signs: list[int]):
    return lambda y: y[:, order] * signs


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (places([0, 1, 2, 3, 4, 5], [1, 1, 1, -1, 1, 1]), "delta_x moves against what the drives make of it"),
        (places([0, 1, 2, 3, 4, 5], [1, 1, 1, -1, -1, 1]), "delta_y moves against what the drives make of it"),
        (places([0, 1, 2, 4, 3, 5], [1, 1, 1, 1, 1, 1]), "delta_y moves as the drives make delta_x move"),
        (places([0, 1, 2, 4, 3, 5], [1, 1, 1, -1, 1, 1]), "delta_x moves against what the drives make of delta_y"),
    ],
)
def test_readings_that_are_turned_round_or_exchanged_are_refused_in_the_first_run(hundred, tmp_path, read, says):
    """Drives learnt from them led the stage 12 um away from a circle of 40 um that it missed by 3."""
    bench = Bench(hundred, tmp_path)
    bench.run(hundred.drive, read)
    assert any(says in fault for fault in refused(lambda: learn(hundred.scenario, bench.runs)))


@pytest.mark.parametrize(("begins", "ends"), [(200, 400), (250, 450), (310, 350), (1100, 1190)])
def test_a_repetition_that_was_not_read_counts_for_nothing(hundred, tmp_path, begins, ends):
    """Zero, or a straight line, in its place was taken for what repeats: the next run was off by 465 nm for 159."""
    whole, bench = Bench(hundred, tmp_path / "whole", noise=0), Bench(hundred, tmp_path / "unread", noise=0)

    def unread(y: np.ndarray) -> np.ndarray:
        y = y.copy()
        y[begins:ends, 3] = np.nan
        return y

    whole.run(hundred.drive)
    bench.run(hundred.drive, unread)
    of_all, of_rest = (learn(hundred.scenario, b.runs) for b in (whole, bench))
    assert of_rest.repeating == pytest.approx(of_all.repeating, abs=1e-12)  # m: the file's digits
    assert any("of 6 repetitions left out" in note for note in of_rest.notes)


def test_a_copy_of_a_run_is_no_further_run(hundred, tmp_path):
    bench = Bench(hundred, tmp_path)
    run = bench.run(hundred.drive)
    again = shutil.copytree(run, tmp_path / "again")
    once, twice = learn(hundred.scenario, [run]), learn(hundred.scenario, [run, again])
    assert np.array_equal(twice.repeating, once.repeating)
    assert any("again/run.csv: holds the readings of run0/run.csv to the last bit" in note for note in twice.notes)


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda y: np.roll(y, 10, axis=0), "its readings come 10"),
        (lambda y: np.roll(y, -10, axis=0), "samples sooner than the device as described"),
        (lambda y: y + 5e-6 * (np.arange(6) == 3), "delta_x by "),
    ],
)
@pytest.mark.parametrize("sensor", ["", RIGHT])
def test_a_zero_and_a_clock_that_nobody_stated_are_told_as_believed(tmp_path, read, says, sensor):
    solution = solved(shortened("circle20", tmp_path / "s", sensor, sample_rate="200 Hz", duration="1 s"))
    bench = Bench(solution, tmp_path)
    bench.run(solution.drive, read)
    assert any(says in note for note in learn(solution.scenario, bench.runs).notes) == (not sensor)


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rate": 150.0}, "the path runs at 200 Hz"),
        ({"rate": 200.2}, "the path runs at 200 Hz"),  # a fifth of a sample off at the end
        ({"length_unit": "um"}, "moves by 1e-06 of what is commanded"),
        ({"length_unit": "km"}, "check the column, its unit"),
        ({"length_unit": "km"}, 'if its numbers are in m, write unit = "m"'),
        ({"drive_unit": "mW"}, "have other units"),
        ({"record": "rows = [0, 150]"}, "less than one run"),
        ({"record": "rows = [50, 450]"}, "begins 50 samples after"),
        ({"record": 'between_samples = "linear"'}, "holds each drive"),
        ({"kind": "poses"}, "record a series"),
    ],
)
def test_a_recording_that_is_not_of_the_path_is_refused(hundred, tmp_path, changes, says):
    bench = Bench(hundred, tmp_path)
    bench.run(hundred.drive, **changes)
    assert any(says in fault for fault in refused(lambda: learn(hundred.scenario, bench.runs)))


def test_a_gap_that_goes_on_at_the_beginning_of_the_period_is_one_gap(hundred, tmp_path):
    """15 samples at the end and 15 at the beginning of each period are 30 in a row, of 200: a tenth can be bridged."""
    n = len(hundred.drive)
    y = np.tile(hundred.command, (3, 1))
    y[(np.arange(3 * n) + 15) % n < 30] = np.nan
    write(tmp_path / "run", hundred, np.tile(hundred.drive, (3, 1)), y)
    assert any(
        "was not read for 31 samples in a row" in fault
        for fault in refused(lambda: learn(hundred.scenario, tmp_path / "run"))
    )


def test_drives_that_do_not_repeat_are_refused(hundred, tmp_path):
    n = len(hundred.drive)
    u = np.vstack([hundred.drive, 0.9 * hundred.drive])
    write(tmp_path / "run", hundred, u, np.vstack([hundred.command, hundred.command]))
    (fault,) = refused(lambda: learn(hundred.scenario, tmp_path / "run"))
    assert f"do not repeat after {n} samples" in fault


def test_readings_at_a_part_of_the_samples_and_a_multiple_of_the_rate_are_taken(hundred, tmp_path):
    """Recorded at twice the rate, and read at every fourth row alone."""
    bench = Bench(hundred, tmp_path, periods=3)
    y = np.repeat(np.tile(bench.reached(hundred.drive), (3, 1)), 2, axis=0)
    y = y + NOISE * np.random.default_rng(1).standard_normal(y.shape)
    y[np.arange(len(y)) % 4 != 0] = np.nan
    write(tmp_path / "fast", hundred, np.repeat(np.tile(hundred.drive, (3, 1)), 2, axis=0), y, rate=400.0)
    found = learn(hundred.scenario, tmp_path / "fast")
    (run,) = found.runs
    files = {
        f"fast/{file.name}": hashlib.sha256(file.read_bytes()).hexdigest() for file in (tmp_path / "fast").iterdir()
    }
    assert files.items() <= found.inputs.items() and len(files) == 2  # the measurements too
    assert found.notes == ()  # samples without a reading are bridged, and no news
    assert run.repeats == 3 and run.repeating["translation"] == pytest.approx(bench.error(hundred.drive), rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("name", ["raster", "rrr_circle", "xy_stage_force", "flexure_axis_line"])
def test_open_paths_more_devices_and_settled_poses_are_learnt(name, tmp_path):
    """The described device with a disturbance that repeats: after one step the model's own run ends where it is cancelled."""
    keys = {"raster": {"sample_rate": "100 Hz"}, "rrr_circle": {"sample_rate": "1 kHz"}}.get(name, {})
    solution = solved(shortened(name, tmp_path / name, **keys))
    lifted, n = Lifted(solution), len(solution.command)
    scale = np.array(lifted.signal.scale)
    bump = 1e-3 * np.abs(solution.command).max(axis=0) * np.sin(np.pi * np.arange(n) / n)[:, None] ** 4
    static = solution.scenario.sample_time is None
    times = 3 if static or lifted.closed else 1
    y, u = (np.tile(values, (times, 1)) for values in (lifted.run(solution.drive) + bump, solution.drive))
    folder = write(tmp_path / "run", solution, u, y, kind="poses" if static else "series")
    found = learn(solution.scenario, folder)
    assert not found.stop
    after = (lifted.run(found.next.drive) + bump - solution.command) / scale
    assert np.sqrt(np.mean(after**2)) < 0.1 * np.sqrt(np.mean((bump / scale) ** 2))


@pytest.mark.long
def test_the_command_writes_a_page_drives_and_the_player_and_its_json_keeps_to_the_schema(hundred, tmp_path):
    bench = Bench(hundred, tmp_path)
    bench.run(hundred.drive)
    out = tmp_path / "out"
    done = ctrlgen("learn", hundred.scenario.path, *bench.runs, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "next" in done.stdout and "translation" in done.stdout
    record = json.loads((out / "learning.json").read_text())
    assert not faults(record, "learning")
    rows = (out / "drives.csv").read_text().splitlines()
    assert rows[0].startswith("time [s],") and len(rows) == 1 + len(hundred.drive)
    assert list((out / "c").glob("*_player_f64.c")) and "<svg" in (out / "learning.html").read_text()
    names = list(record["drives"])
    table = np.array([row.split(",") for row in rows[1:]], float)[:, 1:]
    assert table == pytest.approx(np.array([record["drives"][name] for name in names]).T, rel=1e-11)


@pytest.mark.long
@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "Missing argument"),
        (("nowhere",), "nowhere"),
        (("SCENARIO",), "describes a scenario"),
    ],
)
def test_wrong_words_get_one_message(words, says):
    folder = SCENARIOS / "circle20"
    done = ctrlgen("learn", folder, *(folder / "scenario.toml" if word == "SCENARIO" else word for word in words))
    assert done.returncode and says in done.stderr and "Traceback" not in done.stderr


def test_nothing_is_learnt_from_none():
    with pytest.raises(InputError):
        learn(SCENARIOS / "circle20", [])
