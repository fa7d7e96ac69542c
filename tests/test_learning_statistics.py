"""The statistics of learning from runs against closed forms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrlgen import build_model, load_scenario, solve, user_device
from ctrlgen.learning.learn import learn_from
from ctrlgen.learning.learning_options import LearningOptions
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.norm_optimal import drive_scale
from ctrlgen.learning.repeatability import Spectrum
from ctrlgen.learning.response import Change, regressed, response
from ctrlgen.learning.run_errors import RunErrors
from ctrlgen.learning.runs import Run, Runs, first_differs


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
        "plate",
        parameters={"k": "1 N/um", "g": "1 N/V"},
        drive={"a": "100 V", "b": "100 V"},
        axes={"x": "100 um", "y": "100 um"},
        force=lambda u, p: [p.g * (u.a + 0.5 * u.b), p.g * u.b],
        restoring_force=lambda d, p: p.k * d.vector,
    )
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
        change = Change(u, then, y, np.full(2, noise), np.ones(2, bool), np.zeros((0, lifted.n, 2)))
        found = response(lifted, [change])
        assert found.unexplained == pytest.approx(0.09 / 0.49, abs=known)


def test_how_a_drive_acts_is_told_by_what_no_run_hides(tmp_path, rng):
    """Drive b acts the other way; both drives changed on the mean too, but the second run's zeros are not known."""
    lifted = plate(tmp_path)
    u, n = lifted.solution.drive, lifted.n
    then = u + 3 + rng.standard_normal(u.shape)
    first = lifted.run(u)
    second = lifted.run(u + (then - u) * np.array([1, -1]))
    second -= (second - first).mean(axis=0)
    seen = [y + 1e-12 * rng.standard_normal((3, n, 2)) for y in (first, second)]
    runs = of((u, then), seen)
    hidden = tuple(np.ones((n, 1)) * row for row in np.eye(2))
    later = replace(runs.runs[1], hidden=hidden)
    found = RunErrors(lifted, replace(runs, runs=(runs.runs[0], later)), LearningOptions()).response(2)
    assert found is not None and found.gain == pytest.approx([1, -1], abs=1e-6)
    assert list(found.reasons) == ["drive.b"]


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


@pytest.mark.parametrize("freedom", [1, 2, 9])
def test_noise_passes_the_threshold_once_in_seven_thousand(freedom, rng):
    """A block of six: chi-squared of six over that of the standard error, 400,000 draws; 57 are expected, within three sigma."""
    spectrum, draws = Spectrum(1000, True), 400_000
    assert np.bincount(spectrum.block)[10] == 6
    ratio = rng.chisquare(6, draws) / (rng.chisquare(6 * freedom, draws) / freedom)
    assert 34 <= np.sum(ratio > spectrum.threshold(freedom)[spectrum.block == 10][0]) <= 80
