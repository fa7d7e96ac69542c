"""The error budget of what the drives pass through: converters, jitter, lags, the player."""

from __future__ import annotations

import numpy as np
import pytest
from budget_cases import TRANSLATIONS, driven, lagging, largest_nm, pushed, stated

from ctrlgen import simulate
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.linear import drive_deviations
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.player.compression import compress


@pytest.mark.long
@pytest.mark.parametrize("bits, known", [(12, 9), (16, 0.46)])
def test_a_converter_is_as_rough_as_measured(circle, tmp_path, bits, known):
    given = stated(circle, f'[drive]\nconverter = {{ bits = {bits}, source = "chosen" }}', tmp_path)
    found = budget_of(circle, given, draws=0)
    (line,) = found.lines
    lsb = circle.model.u_bounds[1] / (2**bits - 1)
    deviation = driven(circle, {}, np.round(circle.drive / lsb) * lsb)
    assert largest_nm(deviation) == pytest.approx(known, rel=0.05)
    assert 1e9 * line.sensitivity["translation"] == pytest.approx(largest_nm(deviation), rel=1e-3)
    # LSB/sqrt(12), independent from sample to sample: the rms along the path of one circle knows it to some per cent, and the drives'
    # neighbours on a slow circle are not quite independent
    rms = np.sqrt(np.mean(found.combined**2)), np.sqrt(np.mean(deviation**2))
    assert rms[0] == pytest.approx(rms[1], rel=0.15)


@pytest.mark.long
def test_jitter_is_that_of_drives_that_change_late(circle, tmp_path, rng):
    sd, parts = 50e-6, 100  # s, steps of the simulation in a sample of 1 ms
    given = stated(circle, f'[drive]\njitter = {{ sd = "{sd} s", source = "chosen" }}', tmp_path)
    found = budget_of(circle, given, draws=0)
    u, n = circle.drive, len(circle.drive)
    late = rng.choice([0, 5, 10], n, p=[0.25, 0.5, 0.25])  # of 10 us: sd 35 us, mean 50 us
    before = np.roll(u, 1, axis=0)
    fine = np.concatenate(
        [np.vstack([np.tile(before[k], (late[k], 1)), np.tile(u[k], (parts - late[k], 1))]) for k in range(n)]
    )
    always = np.concatenate([np.vstack([np.tile(before[k], (5, 1)), np.tile(u[k], (parts - 5, 1))]) for k in range(n)])
    poses = [
        simulate(circle.model, drives, circle.scenario.sample_time / parts, circle.trace.x[0]).signals["pose"][
            : n * parts : parts
        ]
        for drives in (fine, always)
    ]
    rms = np.sqrt(np.mean((poses[0] - poses[1])[100:] ** 2, axis=0)) / np.std(10e-6 * np.array([0, 5, 5, 10]))
    expected = np.sqrt(np.mean(found.combined**2, axis=0)) / sd
    # the mean drive of a sample stands for its late change: exp(-a) a/(1 - exp(-a)) = 0.90 of it at a = h/tau = 0.2
    np.testing.assert_allclose(expected[TRANSLATIONS][:2], rms[TRANSLATIONS][:2], rtol=0.2)
    assert np.all(expected[TRANSLATIONS][:2] > rms[TRANSLATIONS][:2])


def test_a_step_that_comes_late_leaves_both_heaters_behind_together(tmp_path):
    """Late by dt, a state that rises by V lacks V dt/tau, which decays with tau; x lacks what both do, y nothing, because one clock
    delays both. 1 %: the drive is taken as late by its mean over the sample, h/2 tau. Of 3000 draws the sd is known to 1.3 %."""
    solution, given = lagging(tmp_path, '[drive]\njitter = { sd = "50 us", source = "chosen" }')
    assert solution.drive[[3, 4, 30]] == pytest.approx(np.array([[0, 0], [10, 10], [10, 10]]), abs=1e-6)
    found = budget_of(solution, given, draws=3000)
    since = np.arange(40) - 5  # the first sample that the step reaches
    lacking = np.where(since < 0, 0.0, 2 * 0.2e-6 * 10 * 50e-6 / 0.1 * np.exp(-since * 1e-3 / 0.1))
    assert found.combined[:, 0] == pytest.approx(lacking, rel=0.01, abs=1e-15)
    assert np.abs(found.combined[:, 1]).max() < 1e-6 * lacking.max()
    drawn = found.drawn.pose.std(axis=0)
    assert drawn[:, 0] == pytest.approx(lacking[found.drawn.kept], rel=0.05, abs=1e-15)
    assert drawn[:, 1].max() < 1e-6 * lacking.max()


def test_a_converter_of_four_bits_has_sixteen_levels_from_limit_to_limit(tmp_path):
    """-1000 to 1000 V in 15 steps, none of them at 0 V; each drive is taken to the nearest, and the error is uniform over one step. The
    sd of 4000 draws is known to 1 %."""
    solution, given = pushed(
        tmp_path, '[drive]\nconverter = { bits = 4, source = "chosen" }', np.linspace(-90.0, 90.0, 19)
    )
    levels = np.linspace(-1000, 1000, 16)
    path = UncertainPath(solution, given)
    nearest = levels[np.argmin(np.abs(path.drive - levels), axis=1)]
    assert path.rounded()[:, 0] == pytest.approx(nearest) and path.lsb() == pytest.approx(2000 / 15)
    found = budget_of(solution, given, draws=4000)
    step = 0.2e-6 * 2000 / 15
    assert found.combined == pytest.approx(np.full((19, 1), step / np.sqrt(12)))
    off = found.drawn.pose
    assert 0.49 * step < np.abs(off).max() <= 0.5 * step * (1 + 1e-6)
    assert off.std() == pytest.approx(step / np.sqrt(12), rel=0.04)


def test_drives_in_single_precision_are_off_by_what_numpys_are(circle, tmp_path):
    """Root mean square over 6000 drives that follow no binary pattern: their rounding to float32 is known to 1 % of its size."""
    path = UncertainPath(circle, stated(circle, '[drive]\narithmetic = "float"', tmp_path))
    sd, together = drive_deviations(path, "arithmetic")
    rounding = path.drive.astype(np.float32) - path.drive
    assert not together and np.sqrt(np.mean(rounding**2)) == pytest.approx(np.sqrt(np.mean(sd**2)), rel=0.04)


@pytest.mark.long
def test_replayed_drives_are_within_what_is_counted_for_the_player(circle, tmp_path):
    """The drives that the player's C computes, simulated for two laps; and draws that are uniform within the tolerance."""
    given = stated(circle, "[drive]\nplayer = true", tmp_path)
    found = budget_of(circle, given, draws=2000)
    (line,) = found.lines
    played = compress(circle)[Real.FLOAT].drives(np.arange(len(circle.drive)))
    deviation = driven(circle, {}, played)
    off = {g.name: np.abs(deviation[:, g.channels]) for g in found.groups}
    tolerances = {"translation": 1e-10, "rotation": 1e-8}  # docs/player.md
    for name, a in tolerances.items():
        assert line.sensitivity[name] == pytest.approx(a) and line.peak[name] == pytest.approx(a / 3**0.5)
        assert 0 < off[name].max() < a
        assert np.sqrt(np.mean(off[name] ** 2, axis=0)).max() < line.rms[name]  # a bound
    assert off["translation"].max() > 0.01 * tolerances["translation"]  # the tables are no better than they must be
    drawn = found.drawn.pose[:, :, TRANSLATIONS]
    assert np.abs(drawn).max() < 1.001e-10 + 1e-12 and drawn.std() == pytest.approx(1e-10 / 3**0.5, rel=0.01)
    assert all(s.sd == 0 for s in found.safeties)
