"""Learning from runs: its algebra against dense references, its statistics against closed forms, its judgement on simulated benches."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import SCENARIOS
from result_files import faults
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

from ctrlgen import InputError, build_model, learn, load_scenario, simulate, solve, user_device
from ctrlgen.core.units import base_unit
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.learning.learn import learn_from
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.norm_optimal import STEP_WEIGHT, Wanted, drive_scale, linear_programme, next_drives
from ctrlgen.learning.repeatability import Spectrum
from ctrlgen.learning.response import Change, regressed, response
from ctrlgen.learning.runs import Run, Runs, errors, first_differs
from ctrlgen.trajectory.inverse.violations import violations
from ctrlgen.trajectory.solution import Solution

NOISE = np.repeat([1e-5, 2e-8], 3)  # rad, m: of a sample
WRONG = {"actuator.expansion_slope": 3.6e-9}  # 20 % more: 3.6 % of the circle, as on the independent plant


def shortened(text: str, folder: Path, **keys: str) -> Path:
    """A shipped scenario with other lines, without what it expects."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = (SCENARIOS / text / "scenario.toml").read_text().partition("[[expect]]")[0].splitlines()
    lines = [next((f'{k} = "{v}"' for k, v in keys.items() if line.startswith(f"{k} =")), line) for line in lines]
    lines = [
        f'device = "{SCENARIOS / text / line.split(chr(34))[1]}"' if line.startswith("device =") else line
        for line in lines
    ]
    (folder / "scenario.toml").write_text("\n".join(lines) + "\n")
    return folder


def solved(folder: Path) -> Solution:
    scenario = load_scenario(folder)
    return solve(scenario, build_model(scenario.device))


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Solution:
    """The circle in 40 samples, small enough for dense matrices."""
    folder = tmp_path_factory.mktemp("small")
    return solved(shortened("circle20", folder / "circle20", sample_rate="100 Hz", duration="0.4 s"))


@pytest.fixture(scope="module")
def hundred(tmp_path_factory) -> Solution:
    """The circle in 200 samples."""
    folder = tmp_path_factory.mktemp("hundred")
    return solved(shortened("circle20", folder / "circle20", sample_rate="200 Hz", duration="1 s"))


class Bench:
    """A simulated bench: the device with other numbers, and drives that reach it as `wired` says."""

    def __init__(
        self, solution: Solution, folder: Path, wired=lambda u: u, periods: int = 6, noise: float = 1.0
    ) -> None:
        self.solution, self.folder, self.wired, self.periods, self.noise = solution, folder, wired, periods, noise
        self.model = build_model(changed(solution.model.device, WRONG))
        self.runs: list[Path] = []

    def reached(self, u: np.ndarray) -> np.ndarray:
        """(n, 6) [rad, m] in the second of two periods."""
        s, h, u = self.solution, self.solution.scenario.sample_time, self.wired(u)
        trace = simulate(self.model, np.vstack([u, u]), h, s.trace.x[0], s.trace.z[0])
        return trace.signals["pose"][len(u) : 2 * len(u)]

    def run(self, u: np.ndarray, **changes) -> Path:
        """A recording of `periods` periods; its folder."""
        y = np.tile(self.reached(u), (self.periods, 1))
        y = y + self.noise * NOISE * np.random.default_rng(len(self.runs)).standard_normal(y.shape)
        folder = self.folder / f"run{len(self.runs)}"
        write(folder, self.solution, np.tile(u, (self.periods, 1)), y, **changes)
        self.runs.append(folder)
        return folder

    def error(self, u: np.ndarray) -> float:
        """[m] rms length of the error of translation, without noise."""
        e = (self.reached(u) - self.solution.command)[:, 3:]
        return float(np.sqrt(np.mean(np.sum(e**2, axis=1))))


def refused(call) -> list[str]:
    """The faults with which it is refused."""
    with pytest.raises(InputError) as error:
        call()
    return [str(fault) for fault in error.value.faults]


def write(
    folder: Path, solution: Solution, u: np.ndarray, y: np.ndarray, rate: float | None = None, **keys: str
) -> Path:
    """run.csv and recording.toml of drives and readings of what is followed [SI]; the folder."""
    folder.mkdir(parents=True)
    m, kind, follow = solution.model, keys.get("kind", "series"), solution.scenario.file.follow
    drive, signal = m.signals["drive"], m.signals[follow]
    header = ",".join([*(f"u_{d}" for d in drive.channels), *signal.channels])
    np.savetxt(folder / "run.csv", np.hstack([u, y]), delimiter=",", header=header, comments="", fmt="%.17g")
    lines = ['title = "a run"', f'device = "{m.device.name}"', f'kind = "{kind}"', "[[record]]"]
    lines += ['file = "run.csv"', 'role = "fit"', keys.get("record", "")]
    if kind == "series":
        lines.append(f'sample_rate = "{rate or 1 / solution.scenario.sample_time:.9g} Hz"')
    lines.append("[columns]")
    for channel, unit in zip(drive.channels, drive.units, strict=True):
        given = keys.get("drive_unit", base_unit(unit))
        lines.append(f'"drive.{channel}" = {{ column = "u_{channel}", unit = "{given}" }}')
    for channel, unit in zip(signal.channels, signal.units, strict=True):
        given = keys.get("length_unit", "m") if base_unit(unit) == "m" else base_unit(unit)
        role = "reading" if follow == "pose" else follow
        lines.append(f'"{role}.{channel}" = {{ column = "{channel}", unit = "{given}" }}')
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    return folder


def dense(lifted: Lifted, u: np.ndarray, step: float) -> np.ndarray:
    """(n n_y, n n_u) the derivative of a run by its drives, by central differences."""
    columns = []
    for k in range(u.size):
        du = np.zeros(u.size)
        du[k] = step
        ends = [lifted.run(u + sign * du.reshape(u.shape)).ravel() for sign in (1, -1)]
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


@pytest.mark.long
def test_the_sparse_programme_is_the_dense_least_squares_of_the_lifted_system(small):
    """Without limits by the normal equations, with bounds of drives that are active by scipy's bounded least squares."""
    lifted = Lifted(small)
    at, W = lifted.linearise(small.drive), 1 / np.array(lifted.signal.scale)
    scale = drive_scale(at, W)
    G = np.tile(W, lifted.n)[:, None] * dense(lifted, small.drive, 1e-5) * np.tile(scale, lifted.n)
    turn = 2 * np.pi * np.arange(lifted.n) / lifted.n
    for size, active in ((2e-7, False), (2.4e-5, True)):
        d = np.zeros(small.command.shape)
        d[:, 3], d[:, 5] = size * np.cos(2 * turn), size
        wanted = Wanted(small.command - d, W, small.drive)
        found, _ = linear_programme(lifted, at, wanted, scale, np.zeros(at.limited.shape, bool))
        A = np.vstack([G, STEP_WEIGHT * np.eye(G.shape[1])])
        b = np.concatenate([-(W * d).ravel(), np.zeros(G.shape[1])])
        low, high = (np.tile(bound, (lifted.n, 1)) - small.drive for bound in small.model.u_bounds)
        best = lsq_linear(
            A, b, ((low / scale).ravel(), (high / scale).ravel()), method="bvls" if active else "trf", tol=1e-12
        )
        assert bool((best.active_mask != 0).any()) == active
        change = (found - small.drive) / scale
        # of the largest change: the differences' truncation, and IPOPT's barrier on an active bound
        assert change == pytest.approx(best.x.reshape(change.shape), abs=2e-3 * np.abs(best.x).max())


def test_the_linearised_run_is_the_derivative_of_the_run(small, rng):
    lifted = Lifted(small)
    at, du = lifted.linearise(small.drive), 1e-6 * rng.standard_normal(small.drive.shape)
    dv, dS = lifted.held(du), np.zeros(at.S.shape[1])
    for _ in range(3):  # until a closed path repeats
        dy = []
        for k in range(lifted.n):
            dS = at.A[k] @ dS + at.B[k] @ dv[k]
            dy.append(at.C[k] @ dS + at.D[k] @ dv[k])
    change = (lifted.run(small.drive + du) - lifted.run(small.drive - du)) / 2
    assert np.array(dy) / lifted.signal.scale == pytest.approx(change / lifted.signal.scale, abs=1e-9)


def test_what_is_out_of_reach_is_followed_as_near_as_the_limits_allow(small):
    """30 um higher than the circle no drive holds: the stage's stroke ends before. Every limit of the device is kept."""
    lifted = Lifted(small)
    d = np.zeros(small.command.shape)
    d[:, 5] = -3e-5
    u = next_drives(lifted, Wanted(small.command - d, 1 / np.array(lifted.signal.scale), small.drive))
    S = lifted.states(u)
    x, z = np.split(S, [small.model.x.numel()], axis=1)
    broken = [v for v in violations(small.model, x, z, u) if v.share > 1e-4]  # the last programme's curvature
    assert not broken
    assert lifted.run(u)[:, 5].mean() > small.command[:, 5].mean() + 5e-6


def test_a_drive_changes_no_faster_than_it_may(tmp_path):
    """A stage without memory that is to make up for a jump: its drives ramp at the rate that is allowed."""
    device = user_device(
        "stage", parameters={"gain": "0.2 N/V", "k": "1 N/um"}, drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")}, force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector, drive_rate={"x": "4000 V/s"},
    )  # fmt: skip
    path = 'kind = "circle"\ndiameter = "10 um"\ncentre = { x = "10 um", y = "10 um" }\nplane = ["x", "y"]\n'
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "stage"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n[path]\n{path}'
    )
    solution = solve(load_scenario(tmp_path, device), build_model(device))
    lifted = Lifted(solution)
    d = np.where(np.arange(100)[:, None] < 50, 2e-6, 0.0) * np.ones(solution.command.shape[1])
    u = next_drives(lifted, Wanted(solution.command - d, 1 / np.array(lifted.signal.scale), solution.drive))
    fastest = np.abs(np.diff(np.vstack([u[-1:], u]), axis=0)).max(axis=0) * 1e3
    assert fastest[0] == pytest.approx(4000, rel=1e-6) and fastest[1] > 8000


@pytest.mark.parametrize("n", [2, 7, 40, 41])
@pytest.mark.parametrize("periodic", [True, False])
def test_coefficients_keep_the_sum_of_squares_and_give_the_samples_back(n, periodic, rng):
    spectrum, x = Spectrum(n, periodic), rng.standard_normal((n, 2))
    c = spectrum.coefficients(x)
    assert np.sum(c**2) == pytest.approx(np.sum(x**2)) and spectrum.samples(c) == pytest.approx(x)


def test_the_standard_error_is_that_of_the_mean_of_repetitions(rng):
    spectrum = Spectrum(1000, True)
    found = spectrum.repeated(3.0 * rng.standard_normal((8, 1000, 1)), np.array([np.nan]), np.ones(1))
    assert np.sqrt(np.mean(found.se**2)) == pytest.approx(3 / np.sqrt(8), rel=0.05)  # 7000 degrees of freedom: 0.8 %


def test_noise_of_one_repetition_is_read_off_its_highest_frequencies(rng):
    spectrum, k = Spectrum(1000, True), np.arange(1000)
    motion = 1e3 * np.sin(2 * np.pi * k / 1000)[:, None]
    found = spectrum.repeated((motion + 3 * rng.standard_normal((1000, 1)))[None], np.array([np.nan]), np.ones(1))
    assert found.se == pytest.approx(3, rel=0.15)  # the median of 500


def test_readings_at_a_quarter_of_the_samples_leave_twice_the_stated_noise_in_what_they_can_show(rng):
    """Noise of 3 at every fourth sample and straight lines between: the slowest twenty coefficients of 400 runs, which these lines keep."""
    spectrum, k, share = Spectrum(1000, True), np.arange(1000), np.full(1, 0.25)
    runs = [np.interp(k, k[::4], 3 * rng.standard_normal(250), period=1000)[:, None] for _ in range(400)]
    scatter = np.std([spectrum.coefficients(run)[:20] for run in runs])
    found = spectrum.repeated(runs[0][None], np.array([3.0]), share)
    assert found.se[:20] == pytest.approx(scatter, rel=0.03)  # 8000 numbers: 0.8 %
    assert not found.se[300:].any() and not found.mean[300:].any()  # above a quarter the lines make images


@pytest.mark.parametrize(("repetitions", "motion"), [(2, 0.0), (5, 0.2), (5, 2.0)])
def test_what_repeats_scatters_about_the_truth_as_stated(repetitions, motion, rng):
    """The sum of squares of a motion in noise, 400 times: no bias beyond what 400 tell, and the stated standard deviation, which 400 tell
    to 3.5 %. Of two repetitions it is 17 % more, as (s^2)^2 is of an s^2 with six degrees of freedom."""
    spectrum, found = Spectrum(200, True), []
    true = motion * np.sin(2 * np.pi * np.arange(200) / 50)[:, None]
    for _ in range(400):
        errors = true + rng.standard_normal((repetitions, 200, 1))
        found.append(spectrum.repeated(errors, np.array([np.nan]), np.ones(1)).energy(np.ones(1)))
    total, variance = np.array(found).T
    assert total.mean() == pytest.approx(np.sum(true**2), abs=4 * total.std() / np.sqrt(400))
    assert 0.92 * total.std() < np.sqrt(variance.mean()) < 1.25 * total.std()


@pytest.mark.parametrize("repetitions", [2, 3, 10])
def test_noise_passes_the_shrinkage_as_rarely_however_few_repetitions_there_are(repetitions, rng):
    """By Cai's threshold a block of six passes once in 7000; a line of ten standard errors passes nearly whole."""
    spectrum, passed, blocks = Spectrum(1000, True), 0, 0
    for _ in range(20):
        found = spectrum.repeated(rng.standard_normal((repetitions, 1000, 1)), np.array([np.nan]), np.ones(1))
        factor = spectrum.shrinkage(found.mean, found.se, found.freedom)
        passed, blocks = passed + len(np.unique(spectrum.block[factor[:, 0] > 0])), blocks + spectrum.block[-1] + 1
    assert passed <= 6  # 0.5 expected of 3340
    mean = found.mean.copy()
    mean[1] = 30 * found.se[1, 0]
    assert spectrum.shrinkage(mean, found.se, np.inf)[1] > 0.95


def plate(folder: Path) -> Lifted:
    """Two drives on two axes in balance, x = a + 0.5 b and y = b in um for V, at 600 separate positions."""
    device = user_device(
        "plate", parameters={"k": "1 N/um", "g": "1 N/V"}, drive={"a": "100 V", "b": "100 V"}, axes={"x": "100 um", "y": "100 um"},
        force=lambda u, p: [p.g * (u.a + 0.5 * u.b), p.g * u.b], restoring_force=lambda d, p: p.k * d.vector,
    )  # fmt: skip
    points = ", ".join(f'{{ x = "{k % 7} um", y = "{k % 5} um" }}' for k in range(600))
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "plate"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    return Lifted(solve(load_scenario(folder, device), build_model(device)))


def test_what_a_device_leaves_unexplained_is_its_share_without_the_noise(tmp_path, rng):
    """A device that answers with 0.7 of what is described leaves 0.3^2/0.7^2 of the squares of what was seen, with next to no noise and
    with two thirds as much of it, from which 1200 numbers tell it to 0.03."""
    lifted = plate(tmp_path)
    u = lifted.solution.drive
    then = u + rng.standard_normal(u.shape)
    moved = lifted.run(then) - lifted.run(u)
    for noise, known in ((1e-9, 1e-3), (0.6e-6, 0.1)):
        y = 0.7 * moved + noise * rng.standard_normal(moved.shape)
        found = response(lifted, [Change(u, then, y, np.full(2, noise), np.ones(2, bool))])
        assert found.unexplained == pytest.approx(0.09 / 0.49, abs=known)


def test_noise_of_both_runs_is_no_other_answer_of_the_device(tmp_path, rng):
    """A device that answers as described; the change that is seen has the noise of two runs in it, each a quarter of the squares of what
    moved. 1200 numbers tell that to 0.03."""
    lifted = plate(tmp_path)
    runs = (lifted.solution.drive, lifted.solution.drive + rng.standard_normal(lifted.solution.drive.shape))
    moved = lifted.run(runs[1]) - lifted.run(runs[0])
    sd = np.sqrt(np.mean(moved**2) / 4 * 3)  # of one of three repetitions
    seen = [lifted.run(u) + sd * rng.standard_normal((3, *moved.shape)) for u in runs]
    found = learn_from(lifted, of(runs, seen), "t", {})
    assert found.response.unexplained < 0.09


def of(drives, seen) -> Runs:
    """Runs whose noise is not stated."""
    runs = tuple(Run((f"run {j}",), u, y) for j, (u, y) in enumerate(zip(drives, seen, strict=True)))
    return Runs(runs, np.full(2, np.nan), np.ones(2, bool), ())


def test_the_next_error_is_predicted_from_how_the_device_has_answered(tmp_path, rng):
    """A tenth less than described: of what the next step moves a ninth is expected to be left, once it is meant to take all away."""
    lifted = plate(tmp_path)
    u, n = lifted.solution.drive, lifted.n
    off = 1e-6 * np.sin(np.pi * np.arange(n) / n)[:, None] ** 2 * np.ones(2)
    first, then = lifted.run(u) + off, u - 0.3 * np.ones(2) * np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    second = first + 0.9 * (lifted.run(then) - lifted.run(u))
    seen = [y + 1e-12 * rng.standard_normal((3, n, 2)) for y in (first, second)]
    found = learn_from(lifted, of((u, then), seen), "t", {})
    assert found.base == 1 and found.response.unexplained == pytest.approx(1 / 81, rel=0.01)
    moved = lifted.run(found.next.drive) - lifted.run(then)
    assert np.abs(second + moved - lifted.solution.command).max() < 0.01 * np.abs(moved).max()
    rms = np.sqrt(np.mean(np.sum(moved**2, axis=1)))
    assert found.predicted["translation"] == pytest.approx(rms / 9, rel=0.02)


def lag(folder: Path) -> Lifted:
    """A heater that follows its drive within 5 ms moves one axis by 0.2 um/W: an open path of 15 samples of 1 ms."""
    device = user_device(
        "heater", parameters={"g": "0.2 N/W", "k": "1 N/um", "tau": "5 ms"}, drive={"a": ("-50 W", "50 W")}, axes={"x": "50 um"},
        state={"A": "50 W"}, force=lambda x, p: [p.g * x.A], restoring_force=lambda d, p: p.k * d.vector,
        rates=lambda u, x, p: [(u.a - x.A) / p.tau],
    )  # fmt: skip
    points = ", ".join(f'{{ x = "{float(v)!r} um" }}' for v in 2 * np.sin(np.pi * np.arange(15) / 14) ** 2)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "heater"\nsample_rate = "1 kHz"\n[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    return Lifted(solve(load_scenario(folder, device), build_model(device)))


def test_of_an_open_path_the_next_drives_are_the_least_squares_of_the_samples_that_they_reach(tmp_path, rng):
    """y_k = a y_k-1 + (1 - a) 0.2 um/W u_k-1 from rest; what is wrong at the first sample cannot be mended, and the price of a step counts
    from the drives of the run, not from those about which the run is linearised."""
    lifted, a = lag(tmp_path), np.exp(-1 / 5)
    J = np.array([[0.2e-6 * (1 - a) * a ** (k - 1 - j) if j < k else 0.0 for j in range(15)] for k in range(15)])
    now = lifted.solution.drive
    about = now + rng.standard_normal(now.shape)
    target = lifted.solution.command + 1e-7 * rng.standard_normal((15, 1))
    W, s = 1 / 50e-6, 50e-6 / 0.2e-6
    best = np.linalg.lstsq(
        np.vstack([W * J, STEP_WEIGHT / s * np.eye(15)]),
        np.concatenate([W * target[:, 0], STEP_WEIGHT / s * now[:, 0]]), rcond=None,
    )[0]  # fmt: skip
    at = lifted.linearise(about)
    assert drive_scale(at, np.array([W])) == pytest.approx([s])
    found, _ = linear_programme(
        lifted, at, Wanted(target, np.array([W]), now), np.array([s]), np.zeros(at.limited.shape, bool)
    )
    assert found[:-1, 0] == pytest.approx(best[:-1], abs=1e-5)  # W, of 50: rounding; the last one reaches no sample


def test_a_drive_counts_by_what_it_moves_at_rest(tmp_path):
    """x = a + 0.5 b, y = b [um/V] in sizes of 10 and 20 um: a volt of a is 1/10, of b hypot(0.5/10, 1/20)."""
    lifted = plate(tmp_path)
    found = drive_scale(lifted.linearise(lifted.solution.drive), np.array([1 / 10e-6, 1 / 20e-6]))
    assert found == pytest.approx([10.0, 1 / np.hypot(0.05, 0.05)], rel=1e-6)


def test_gains_scatter_as_stated_where_residuals_are_correlated(rng):
    """Two drives, errors of autocorrelation 0.8^k: 200 estimates over their standard errors. Newey and West's are a little small; white
    noise's would be by a half."""
    scores, n = [], 400

    def slow(columns: int) -> np.ndarray:
        return lfilter([1], [1, -0.8], rng.standard_normal((n, columns)), axis=0)

    for _ in range(200):
        x = slow(2)[:, None]
        gain, se = regressed([x], [x @ [1.0, -0.5] + slow(1)])
        scores.append((gain - [1.0, -0.5]) / se)
    assert np.std(scores, axis=0) == pytest.approx([1.1, 1.1], abs=0.2)


def test_a_first_period_that_had_not_settled_is_told_from_noise(rng):
    """A transient of half the noise over 100 of 200 samples is more than noise makes; noise alone is kept, as are two periods."""
    transient = np.where(np.arange(200) < 100, 3.0, 0.0)[:, None]
    for periods in (3, 5):
        kept = [first_differs(rng.standard_normal((periods, 200, 1))) for _ in range(200)]
        assert sum(kept) == 0
        late = rng.standard_normal((periods, 200, 1))
        late[0] += transient
        assert first_differs(late) == 1
    assert first_differs(late[:2]) == 0


def test_the_error_that_is_predicted_is_that_of_the_next_run(small, tmp_path):
    """On a device that answers by 2 % otherwise, with next to no noise: a tenth of what the step takes away."""
    bench = Bench(small, tmp_path, periods=3, noise=1e-3)
    bench.run(small.drive)
    found = learn(small.scenario, bench.runs)
    before, after = (bench.reached(u) - small.command for u in (small.drive, found.next.drive))
    assert np.abs(after - before)[:, 3:].max() > 0.5 * np.abs(before[:, 3:]).max()
    assert found.predicted_error[:, 3:] == pytest.approx(after[:, 3:], abs=0.1 * np.abs(after - before)[:, 3:].max())


@pytest.mark.parametrize("freedom", [1, 2, 9])
def test_noise_passes_the_threshold_once_in_seven_thousand(freedom, rng):
    """A block of six: chi-squared of six over that of the standard error, 400,000 draws; 57 are expected, within three sigma."""
    spectrum, draws = Spectrum(1000, True), 400_000
    assert np.bincount(spectrum.block)[10] == 6
    ratio = rng.chisquare(6, draws) / (rng.chisquare(6 * freedom, draws) / freedom)
    assert 34 <= np.sum(ratio > spectrum.threshold(freedom)[spectrum.block == 10][0]) <= 80


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


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rate": 150.0}, "the path runs at 200 Hz"),
        ({"rate": 200.2}, "the path runs at 200 Hz"),  # a fifth of a sample off at the end
        ({"length_unit": "um"}, "moves by 1e-06 of what is commanded"),
        ({"length_unit": "km"}, "check the column, its unit"),
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


def test_between_the_last_reading_and_the_first_of_the_next_period_an_error_is_a_straight_line(small):
    """1 nm at sample 37 and 6 nm at sample 42 = 2 of the next period: 2, 3, 4, 5 nm at 38, 39, 0, 1."""
    y = small.command.copy()
    y[[38, 39, 0, 1]] = np.nan
    y[37], y[2] = small.command[37] + 1e-9, small.command[2] + 6e-9
    e, share = errors(Run(("one",), small.drive, y[None]), Lifted(small))
    assert e[0, [37, 38, 39, 0, 1, 2], 3] == pytest.approx(1e-9 * np.arange(1, 7)) and share[3] == pytest.approx(0.9)


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
