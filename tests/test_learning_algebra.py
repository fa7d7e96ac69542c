"""The algebra of learning from runs against dense references."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from learning_bench import Bench, shortened, solved
from scipy.optimize import lsq_linear

from ctrlgen import build_model, learn, load_scenario, solve, user_device
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.norm_optimal import STEP_WEIGHT, Wanted, drive_scale, linear_programme, next_drives
from ctrlgen.learning.runs import Run, errors
from ctrlgen.trajectory.inverse.violations import violations
from ctrlgen.trajectory.solution import Solution


@pytest.fixture(scope="module")
def small(tmp_path_factory) -> Solution:
    """The circle in 40 samples, small enough for dense matrices."""
    folder = tmp_path_factory.mktemp("small")
    return solved(shortened("circle20", folder / "circle20", sample_rate="100 Hz", duration="0.4 s"))


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
        "stage",
        parameters={"gain": "0.2 N/V", "k": "1 N/um"},
        drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
        drive_rate={"x": "4000 V/s"},
    )
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


def lag(folder: Path) -> Lifted:
    """A heater that follows its drive within 5 ms moves one axis by 0.2 um/W: an open path of 15 samples of 1 ms."""
    device = user_device(
        "heater",
        parameters={"g": "0.2 N/W", "k": "1 N/um", "tau": "5 ms"},
        drive={"a": ("-50 W", "50 W")},
        axes={"x": "50 um"},
        state={"A": "50 W"},
        force=lambda x, p: [p.g * x.A],
        restoring_force=lambda d, p: p.k * d.vector,
        rates=lambda u, x, p: [(u.a - x.A) / p.tau],
    )
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
        np.concatenate([W * target[:, 0], STEP_WEIGHT / s * now[:, 0]]),
        rcond=None,
    )[0]
    at = lifted.linearise(about)
    assert drive_scale(at, np.array([W])) == pytest.approx([s])
    found, _ = linear_programme(
        lifted, at, Wanted(target, np.array([W]), now), np.array([s]), np.zeros(at.limited.shape, bool)
    )
    assert found[:-1, 0] == pytest.approx(best[:-1], abs=1e-5)  # W, of 50: rounding; the last one reaches no sample


def test_the_error_that_is_predicted_is_that_of_the_next_run(small, tmp_path):
    """On a device that answers by 2 % otherwise, with next to no noise: a tenth of what the step takes away."""
    bench = Bench(small, tmp_path, periods=3, noise=1e-3)
    bench.run(small.drive)
    found = learn(small.scenario, bench.runs)
    before, after = (bench.reached(u) - small.command for u in (small.drive, found.next.drive))
    assert np.abs(after - before)[:, 3:].max() > 0.5 * np.abs(before[:, 3:]).max()
    assert found.predicted_error[:, 3:] == pytest.approx(after[:, 3:], abs=0.1 * np.abs(after - before)[:, 3:].max())


def test_between_the_last_reading_and_the_first_of_the_next_period_an_error_is_a_straight_line(small):
    """1 nm at sample 37 and 6 nm at sample 42 = 2 of the next period: 2, 3, 4, 5 nm at 38, 39, 0, 1."""
    y = small.command.copy()
    y[[38, 39, 0, 1]] = np.nan
    y[37], y[2] = small.command[37] + 1e-9, small.command[2] + 6e-9
    e, share = errors(Run(("one",), small.drive, y[None]), Lifted(small))
    assert e[0, [37, 38, 39, 0, 1, 2], 3] == pytest.approx(1e-9 * np.arange(1, 7)) and share[3] == pytest.approx(0.9)
