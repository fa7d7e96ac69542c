"""Learning with a sensor that is wrong: what is left to it, what is taken out, what is refused; truth is known to the test alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from learning_bench import WRONG, Bench, refused, shortened, solved

from ctrlgen import build_model, learn, simulate, solve
from ctrlgen.budget.sensor_statement import Known, SensorStatement
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.effects import read_effect
from ctrlgen.learning.implied_pose import ImpliedPose
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.learning_page import verdict, write_learning
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.run_errors import RunErrors
from ctrlgen.learning.run_gate import belonging
from ctrlgen.learning.runs import Run, Runs, in_time
from ctrlgen.learning.sensor_budget import Feigned, SensorBudget, believed, sensor_budget
from ctrlgen.learning.sensor_words import sensor_words
from ctrlgen.learning.steady_drift import drift_of, without_drift
from ctrlgen.trajectory.scenario import model_of
from ctrlgen.trajectory.solution import Solution


@pytest.fixture(scope="module")
def circle(tmp_path_factory) -> Solution:
    """The circle in 200 samples, nothing stated of the sensor."""
    folder = tmp_path_factory.mktemp("sensor")
    return solved(shortened("circle20", folder / "circle20", sensor="", sample_rate="200 Hz", duration="1 s"))


def with_laws(solution: Solution, *laws: dict[str, object]) -> Solution:
    """The same path of a device whose readings have these laws."""
    device = solution.scenario.device.model_copy(update={"effect": tuple(map(read_effect, laws))})
    scenario = replace(solution.scenario, device=device)
    return solve(scenario, model_of(scenario))


LAWS = (
    {"kind": "sensor_gain", "at": "delta_x", "gain": {"value": "0.02", "sd": "0.001"}},
    {"kind": "cubic_sensor", "at": "delta_y", "curvature": "1e7 1/m^2"},
)


def test_the_pose_is_that_which_the_reading_implies_under_the_laws_of_the_sensor(circle):
    """A scale, a curve, a drift with the surroundings: readings of a pose that is off the modelled one give that pose back to rounding."""
    sensed = with_laws(circle, *LAWS)
    lifted = Lifted(sensed)
    implied, u = ImpliedPose(lifted), sensed.drive
    pose = lifted.run(u) + 1e-6 * np.sin(np.arange(lifted.n))[:, None] * np.array([10, 20, 30, 0.1, 0.2, 0.3])
    y = pose.copy()
    y[:, 3] *= 1.02
    y[:, 4] += 1e7 * pose[:, 4] ** 3
    y[7, 4] = np.nan
    found = implied.pose(y[None], u)[0]
    expected = np.where(np.isfinite(y), pose, np.nan)
    assert found == pytest.approx(expected, abs=1e-15, nan_ok=True)
    (off,) = implied.deviations(u)  # 0.1 % more of scale, and the pose is taken for 0.1/1.02 % less
    assert off[:, 3] == pytest.approx(-1e-3 / 1.02 * lifted.run(u)[:, 3], abs=1e-15) and not off[:, 4].any()


@pytest.mark.filterwarnings("ignore:.*changes no drive along a path")
def test_a_stated_delay_and_a_filter_are_taken_out_of_the_readings(circle):
    """A delay of 12.5 ms, 2.5 samples; a first-order filter by a large damping lags by 2 D tau = 16 ms."""
    late = with_laws(circle, {"kind": "delay", "at": "all", "delay": "12.5 ms"})
    lifted = Lifted(late)
    implied, k = ImpliedPose(lifted), np.arange(200)
    assert implied.late == pytest.approx(12.5e-3)
    mean = with_laws(circle, {"kind": "moving_average", "at": "all", "window": "25 ms"})
    assert ImpliedPose(Lifted(mean)).late == pytest.approx(implied.late)  # by half of its window
    y = np.sin(2 * np.pi * (k - 2.5) / 200)[None, :, None] * np.ones(6)
    moved = in_time(Run(("a",), late.drive, y), lifted, implied.late)
    assert moved[0, :, 0] == pytest.approx(np.sin(2 * np.pi * k / 200), abs=1e-7)  # the cubic between samples
    slow = with_laws(circle, {"kind": "low_pass", "at": "delta_x", "share": "1", "tau": "8 ms", "damping": "1"})
    lifted = Lifted(slow)
    u, start = slow.drive, slow.trace
    twice = simulate(slow.model, np.vstack([u, u]), lifted.sample_time, start.x[0], start.z[0]).signals
    pose, y = (twice[name][200:400] for name in ("pose", "reading"))
    assert np.abs(y - pose)[:, 3].max() > 0.5e-6
    found = ImpliedPose(lifted).pose(y[None], u)[0]
    assert found == pytest.approx(pose, abs=1e-10)


@pytest.mark.long
def test_what_is_left_to_the_sensor_never_lets_the_stage_be_worse(rng):
    """For every sensor within its budget the true deviation after, d - a, is no longer than before."""
    n, scale = 40, np.ones(2)
    lines = tuple(Feigned("a", "", "", rng.standard_normal((n, 2))) for _ in range(3))
    budget = SensorBudget(lines, 2.0, scale)
    for size in (0.1, 1.0, 3.0, 30.0):
        for _ in range(300):
            true = size * rng.standard_normal((n, 2))
            feigned = sum(2 * rng.choice([-1, rng.uniform(-1, 1), 1]) * line.deviation for line in lines)
            seen = true + feigned
            after = true - (seen - budget.of_sensor(seen))
            assert np.linalg.norm(after) <= np.linalg.norm(true) * (1 + 1e-12)
    large = 1e3 * lines[0].deviation
    assert budget.of_sensor(large) == pytest.approx(0, abs=1e-9)  # no sensor is so wrong: believed
    assert budget.of_sensor(0.5 * lines[0].deviation) == pytest.approx(0.5 * lines[0].deviation)
    one = SensorBudget(
        lines[:1], 2.0, scale
    )  # half as much again as it may feign: at the worst the third of it is true, and may be turned about
    assert one.of_sensor(3 * lines[0].deviation) == pytest.approx(lines[0].deviation)


def test_scales_of_one_size_are_told_apart_by_no_basis():
    """Two scales within their budgets: what an SVD of lines so nearly of one size takes for coordinates is turned by 45 degrees."""
    x, y = np.zeros((2, 100, 2))
    angle = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    x[:, 0], y[:, 1] = np.cos(angle), np.sin(angle)
    for mixed in (0.0, 1e-9, -1e-9):
        lines = (Feigned("x", "", "", x + mixed * y), Feigned("y", "", "", y + mixed * x))
        budget = SensorBudget(lines, 2.0, np.ones(2))
        seen = 1.6 * (x + y)
        assert budget.of_sensor(seen) == pytest.approx(seen, rel=1e-7)
        assert budget.of_sensor(3 * x) == pytest.approx(x, abs=1e-7)  # y takes no part


@pytest.mark.long
def test_the_condition_holds_for_lines_of_any_size_that_may_say_the_same(rng):
    """1/2 |a|^2 + sum |g_i . a| <= a . d to rounding, for lines from 1e-2 to 1e2 of the deviation, two of which are one line."""
    for _ in range(300):
        m, n = rng.integers(1, 8), rng.integers(3, 9)
        G = rng.standard_normal((m, n)) * 10 ** rng.uniform(-2, 2, n)
        G[:, 1] = (1 + 1e-13) * G[:, 0]
        d = G @ rng.uniform(-3, 3, n)
        a = believed(d, G)
        assert a @ a / 2 + np.abs(G.T @ a).sum() - a @ d < 1e-8 * (d @ d)
        for unit in (1e-9, 1e9):  # whatever they are told in
            assert believed(unit * d, unit * G) == pytest.approx(unit * a, abs=1e-8 * unit * np.linalg.norm(d))
    assert not believed(np.zeros(3), np.ones((3, 2))).any()


def test_the_budget_is_what_a_wrong_scale_zero_and_clock_make_of_the_readings(circle):
    """Where nothing is stated 0.5 % and half a sample, of what is read; as the readings of such a sensor less those of a right one."""
    lifted, observed = Lifted(circle), np.array([1, 1, 1, 1, 1, 0], bool)
    stated = SensorStatement(zero={"delta_x": Known(5e-9, "5 nm", "drift")})
    found = sensor_budget(lifted, ImpliedPose(lifted), stated, observed, LearningOptions())
    y = lifted.run(circle.drive) * observed
    late = np.fft.irfft(np.fft.rfft(y, axis=0) * np.exp(-2j * np.pi * np.fft.rfftfreq(200) * 0.5)[:, None], axis=0)
    by_name = {line.name: line.deviation for line in found.lines}
    assert by_name.pop("clock") == pytest.approx(
        late - y, abs=0.02 * np.abs(late - y).max()
    )  # it is linear in the delay
    zero = by_name.pop("zero of delta_x")
    assert np.all(zero[:, 3] == 5e-9) and not np.delete(zero, 3, axis=1).any()
    assert list(by_name) == [f"scale of {c}" for c in lifted.signal.channels[:5]]
    assert sum(by_name.values()) == pytest.approx(0.005 * y, rel=1e-12)


def scaled(y: np.ndarray) -> np.ndarray:
    return y * np.array([1, 1, 1, 1.008, 1.008, 1.008])


@pytest.mark.long
def test_a_scale_of_the_sensor_is_not_learnt_where_the_stage_is_right(circle, tmp_path):
    """Readings 0.8 % too large of a stage that follows its path: 0.8 % of 10 um were made of it."""
    bench = Bench(circle, tmp_path)
    bench.model = circle.model
    bench.run(circle.drive, scaled)
    found = learn(circle.scenario, bench.runs)
    before, after = bench.error(circle.drive), bench.error(found.next.drive)
    assert before < 1e-9 and after < 5e-9  # noise of five periods
    words = " ".join(sensor_words(found))
    assert "The true error may be up to" in verdict(found) and "are left to it" in words
    assert found.stop == "what is left of the error may be the sensor's" and "state it as [sensor]" in words
    write_learning(tmp_path / "out", found)
    assert "Where the sensor is known better, state it" in (tmp_path / "out" / "learning.html").read_text()
    assert found.of_group(found.left_to_sensor, found.groups[0]) == pytest.approx(
        0.008 * np.hypot(10, 20) * 1e-6, rel=0.05
    )


def test_with_the_scale_in_the_device_file_the_stage_is_learnt_and_stays_right(circle, tmp_path):
    """The same readings, of a stage that is 3.6 % off, by the diagnosed device: the true error falls as with a right sensor."""
    laws = [
        {"kind": "sensor_gain", "at": c, "gain": {"value": "0.008", "sd": "0.00001"}}
        for c in ("delta_x", "delta_y", "delta_z")
    ]
    diagnosed = with_laws(circle, *laws)
    bench = Bench(diagnosed, tmp_path)
    bench.model = build_model(changed(circle.model.device, WRONG))
    bench.run(diagnosed.drive, scaled)
    options = LearningOptions(sensor_clock=1e-6)
    found = learn(diagnosed.scenario, bench.runs, options=options)
    assert bench.error(found.next.drive) < 0.05 * bench.error(diagnosed.drive)


def fold(*parts):
    """One reading after another sensor's."""

    def read(y: np.ndarray) -> np.ndarray:
        for part in parts:
            y = part(y)
        return y

    return read


def shifted(y: np.ndarray) -> np.ndarray:
    return y + np.array([0, 0, 0, 4e-7, -2e-7, 0])


def late(y: np.ndarray) -> np.ndarray:
    return np.roll(y, 1, axis=0)


def drifting(y: np.ndarray) -> np.ndarray:
    return y + np.arange(len(y))[:, None] / 200 * np.array([0, 0, 0, 1e-7, 0, 0])


@pytest.mark.long
def test_zero_clock_and_drift_of_later_runs_are_taken_out_and_named(circle, tmp_path):
    """A run whose zero is 400 nm off, one that is a sample late, one that drifts by 100 nm a period: what is learnt from all is that of the
    first, to the noise."""
    right = LearningOptions(sensor_scale=1e-6, sensor_clock=1e-6)
    bench = Bench(circle, tmp_path)
    bench.run(circle.drive)
    u = learn(circle.scenario, bench.runs, options=right).next.drive
    for name, read, says in (
        ("zero", shifted, "its zero is off that of"),
        ("clock", late, "samples later than those of run0"),
        ("drift", drifting, "drift steadily in each period, delta_x by 0.09"),
    ):
        tried = Bench(circle, tmp_path / name)
        tried.run(circle.drive)
        tried.run(u, read)
        found = learn(circle.scenario, tried.runs, options=right)
        assert any(says in note for note in found.notes), (name, found.notes)
        assert bench.error(found.next.drive) < 15e-9, name  # of 363 nm


@pytest.mark.long
def test_a_run_of_another_path_is_refused_by_name(circle, tmp_path):
    """Its readings under the drives of this path (a file of another run), or its drives and its readings."""
    bench = Bench(circle, tmp_path)
    bench.run(circle.drive)
    bench.run(circle.drive, lambda y: y * np.array([1, 1, 1, 0.7, 1, 1]))
    (fault,) = refused(lambda: learn(circle.scenario, bench.runs))
    assert "run1" in fault and "of another path" in fault
    other = Bench(circle, tmp_path / "other")
    other.run(circle.drive)
    smaller = circle.drive.mean(axis=0) + 0.7 * (circle.drive - circle.drive.mean(axis=0))
    other.run(smaller)
    (fault,) = refused(lambda: learn(circle.scenario, other.runs))
    assert "run1" in fault and "another scenario" in fault


@pytest.mark.parametrize("periods", [2, 3, 6])
def test_a_drift_is_told_from_noise_and_from_a_start_that_settles(periods, rng):
    """Of 200 records with noise alone next to none drift; 1 a period in noise of 3 is found to its standard error; a transient is none."""
    n, none = 200, np.array([np.nan])
    path = np.sin(2 * np.pi * np.arange(n) / n)[:, None] * 100
    seen, found = 0, []
    for _ in range(200):
        y = path + 3 * rng.standard_normal((periods, n, 1))
        seen += bool(drift_of(y, none).any())
        k = (np.arange(periods * n) / n).reshape(periods, n, 1)
        found.append(drift_of(y + 5 * k, none)[0])
        settling = y + 60 * np.exp(-k * 8)
        assert not drift_of(settling, none).any()
    assert seen <= 2
    assert np.mean(np.array(found) != 0) > 0.9 and np.mean([f for f in found if f]) == pytest.approx(5, abs=0.15)
    steady = without_drift(path + 5 * k, np.array([5.0]))
    assert steady == pytest.approx(np.broadcast_to(path, steady.shape), abs=1e-9)


def test_runs_that_belong_together_are_left_as_they_are(circle, rng):
    """Two of one path with noise: no zero, no clock; NaN stays NaN."""
    lifted = Lifted(circle)
    y = np.tile(circle.command, (3, 1, 1)) + np.repeat([1e-5, 2e-8], 3) * rng.standard_normal((3, 200, 6))
    y[0, 3, 4] = np.nan
    runs = Runs(
        (Run(("a",), circle.drive, y), Run(("b",), circle.drive, y[::-1])), np.full(6, np.nan), np.ones(6, bool), ()
    )
    found = belonging(runs, lifted, "t")
    assert found.notes == () and np.array_equal(found.runs[0].y, y, equal_nan=True)


def test_a_late_run_and_one_with_another_zero_read_as_the_others_do(circle, rng):
    """Of three the second comes a sample late, 314 nm of the path, and the zero of the third is off by 400 nm."""
    lifted, noise = Lifted(circle), np.repeat([1e-5, 2e-8], 3)
    y = [np.tile(circle.command, (3, 1, 1)) + noise * rng.standard_normal((3, 200, 6)) for _ in range(3)]
    zero = np.array([0, 0, 0, 4e-7, -2e-7, 0])
    read = zip("abc", (y[0], np.roll(y[1], 1, axis=1), y[2] + zero), strict=True)
    runs = Runs(tuple(Run((name,), circle.drive, of) for name, of in read), np.full(6, np.nan), np.ones(6, bool), ())
    found = belonging(runs, lifted, "t")
    clock, zeros = found.notes
    # a and c are on time alike: noise decides which of them the clock is counted from
    assert clock.startswith("b: its readings come ") and clock.partition("later than those of ")[2][:3] in (
        "a; ",
        "c; ",
    )
    assert float(clock.split()[4]) == pytest.approx(1, abs=0.02)
    assert zeros.startswith("c: its zero is off that of a, delta_x by 0.4")
    for run in found.runs:  # the noise of three repetitions, to a quarter: 200 samples tell it to 5 %
        assert np.all(np.sqrt(np.mean((run.y.mean(axis=0) - circle.command) ** 2, axis=0)) < 1.25 * noise / np.sqrt(3))


@pytest.mark.long
def test_in_noise_it_says_how_many_repetitions_are_needed_and_these_are_enough(circle, tmp_path):
    """Noise of 3.6 um a sample, ten times the error of 363 nm: two periods teach nothing; with as many as it asks for, asked again where
    they show that less repeats than might have, a step is taken that takes away more than half of the error."""
    options = LearningOptions(sensor_scale=1e-6, sensor_clock=1e-6)
    periods, before = 2, np.inf
    for asked in range(4):
        bench = Bench(circle, tmp_path / f"asked{asked}", periods=periods, noise=180)
        bench.run(circle.drive)
        found = learn(circle.scenario, bench.runs, options=options)
        before, after = bench.error(circle.drive), bench.error(found.next.drive)
        if after < 0.5 * before:
            break
        (note,) = (note for note in found.notes if "repetitions" in note)
        periods = int(note.split("about ")[1].split()[0])
    assert asked and periods < 200 and after < 0.5 * before


def runs_of(circle: Solution, rng: np.random.Generator, *parts: tuple[float, np.ndarray]) -> tuple[Lifted, Runs]:
    """Runs of three periods under the circle's drives times a number, that read the model's own pose and another deviation (n, 6)."""
    lifted, noise = Lifted(circle), np.repeat([1e-7, 2e-10], 3)
    runs = []
    for k, (share, off) in enumerate(parts):
        drive = circle.drive * share
        y = np.tile(lifted.run(drive) + off, (3, 1, 1)) + noise * rng.standard_normal((3, lifted.n, 6))
        runs.append(Run((f"{k}",), drive, y))
    return lifted, Runs(tuple(runs), np.full(6, np.nan), np.ones(6, bool), ())


def test_a_run_whose_zero_was_taken_out_says_nothing_of_it_and_wins_nothing_by_it(circle, rng):
    """All runs are 50 nm too far in z, and the first 40 nm off at the third harmonic. The zero of the second is 400 nm off: with it the
    50 nm go, and read as the first has them, moved by the drives as the model is, some 6 nm. The third has a larger third harmonic than
    the second, which a zero does not hide. Of what the best run hides no step is taken."""
    k = 2 * np.pi * np.arange(200) / 200
    z, third = np.eye(6)[5], np.sin(3 * k)[:, None] * np.eye(6)[4]
    parts = [
        (1.0, 5e-8 * z + 4e-8 * third),
        (1.0003, 4.5e-7 * z + 1e-8 * third),
        (1.0001, 5e-8 * z + 2e-8 * third),
    ]
    lifted, runs = runs_of(circle, rng, *parts)
    found = belonging(runs, lifted, "t")
    assert [len(run.hidden) for run in found.runs] == [0, 1, 0]
    job = RunErrors(lifted, found, LearningOptions())
    for run, (share, _) in enumerate(parts):
        moved = lifted.run(circle.drive * share).mean(axis=0) - circle.command.mean(axis=0)
        assert job.result(run).error[:, 5].mean() == pytest.approx(5e-8 + moved[5], abs=1e-9)
    assert moved[5] > 1e-9 and job.base == 1 and job.is_worse(2, 1) and job.is_worse(0, 2)
    job.leave_to(SensorBudget((), 2.0, job.scale))
    assert abs(job.result(1).error[:, 5].mean()) < 1e-9 and job.base == 1


def test_runs_at_odds_about_a_zero_that_the_first_does_not_tell_hide_it(circle, rng):
    """Later drives are a tenth lower, which moves z by 2 um, so that 100 nm against the first may be the device's answer; between later
    runs nothing explains them. Of two both say nothing, of three the one that is alone."""
    z = np.eye(6)[5]
    parts = [(1.0, 0 * z), (0.9, 0 * z), (0.9001, 1e-7 * z), (0.9002, 0 * z)]
    for count, hidden in ((3, [0, 1, 1]), (4, [0, 0, 1, 0])):
        lifted, runs = runs_of(circle, rng, *parts[:count])
        found = belonging(runs, lifted, "t")
        assert [len(run.hidden) for run in found.runs] == hidden and not found.notes


def test_what_a_sensor_may_feign_of_what_learning_has_left_is_not_learnt(circle, rng):
    """The first run reads 5 % of scale too much and is believed; the second less than 1 % in z, which a scale good to 0.5 % may feign
    alone: no step by it."""
    y = circle.command * np.array([0, 0, 0, 1, 1, 1])
    lifted, runs = runs_of(circle, rng, (1.0, 0.05 * y), (0.949, 0.05 * y))
    job = RunErrors(lifted, runs, LearningOptions())
    lines = tuple(Feigned(f"{i}", "", "", 0.005 * y * np.eye(6)[i]) for i in (3, 4, 5))
    sensor = SensorBudget(lines, 2.0, job.scale)
    read = (lifted.run(circle.drive * 0.949) + 0.05 * y - circle.command)[:, 3:]
    left = job.leave_to(sensor)[:, 3:]
    assert job.base == 1
    of_scale = [np.sum(of * y[:, 3:], axis=0) / np.sum(y[:, 3:] ** 2, axis=0) for of in (read, left)]
    within = np.abs(of_scale[0]) < 0.01
    assert within.any() and of_scale[1][within] == pytest.approx(of_scale[0][within], rel=0.02)
