"""Levels of noise to their statistical error: sd/sqrt(2 n) from n independent samples, by whatever source tells them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from ctrlgen.estimation.noise import Noise, NoiseSource, estimate_noise, ljung_box, stationary_deviation
from ctrlgen.estimation.noise_update import longest_stretch
from ctrlgen.estimation.quiet_stretches import without_lines
from ctrlgen.estimation.residual_noise import noise_from_residual
from ctrlgen.estimation.settings import NOISE_UPDATE
from ctrlgen.recordings.recording import Record, Recording

SIGMAS = 4.0  # once in 16 000
SETTLING = 0.0
COLOURS = {"white": (), "one pole": (0.6,), "alternating": (-0.5,), "a sensor that rings": (1.2, -0.6)}
every_colour = pytest.mark.parametrize("ar", COLOURS.values(), ids=COLOURS)


def noise(rng: np.random.Generator, n: int, sd: float, ar: tuple[float, ...] = ()) -> np.ndarray:
    """Autoregressive, with innovations `sd`."""
    return lfilter([1.0], [1.0, *(-a for a in ar)], sd * rng.standard_normal(n + 500))[500:]


def record(y: np.ndarray, role: str = "fit", drive: np.ndarray | None = None, h: float = 1e-3, **more) -> Record:
    y = np.reshape(y, (len(y), -1))
    u = np.zeros(len(y)) if drive is None else drive
    settled = not np.isfinite(h)
    time = np.arange(len(y)) * (1.0 if settled else h)
    return Record("r", role, time, h, np.reshape(u, (len(y), -1)), y, False, None, np.isfinite(y), **more)


def recording(*records: Record, stated: tuple[float | None, ...] | None = None, kind: str = "series") -> Recording:
    n_y = records[0].observed.shape[1]
    channels = tuple(f"reading.{i}" for i in range(n_y))
    return Recording("t", "any", kind, channels, ("um",) * n_y, stated or (None,) * n_y, records, ())


def moving(n: int) -> np.ndarray:
    """A drive that never rests and never repeats."""
    t = np.arange(n) / n
    return np.sin(2 * np.pi * 7 * t) + np.sin(2 * np.pi * 7 * np.sqrt(5) * t)


@every_colour
@pytest.mark.parametrize("h", [1e-4, 0.5])
def test_a_record_at_rest_tells_colour_and_level_of_every_sensor(ar, h, rng):
    """Of three sensors, one a thousand times as loud; whatever the rate."""
    n, sds = 20000, (3e-9, 3e-6, 5e-8)
    y = np.column_stack([noise(rng, n, sd, ar) for sd in sds])
    found = estimate_noise(recording(record(y, "rest", h=h)), SETTLING)
    assert found.sd == pytest.approx(np.array(sds), rel=SIGMAS / np.sqrt(2 * n))
    for sd, coefficients, floor in zip(sds, found.ar, found.floor, strict=True):
        assert len(coefficients) == len(ar)  # BIC adds one to white noise once in 600
        assert coefficients == pytest.approx(np.array(ar), abs=SIGMAS / np.sqrt(n))  # no coefficient is known worse
        # Correlated samples tell less of the level
        longer = (1 + np.sum(np.abs(ar))) / (1 - min(np.sum(np.abs(ar)), 0.9))
        assert floor == pytest.approx(stationary_deviation(sd, np.array(ar)), rel=SIGMAS * np.sqrt(longer / (2 * n)))
    assert found.known.all() and not found.guessed.any() and found.count == pytest.approx(n)


@pytest.mark.parametrize(
    "ar, level", [((), 1.0), ((0.6,), 1.25), ((1.2, -0.6), np.sqrt(1.6 / (0.4 * (1.6**2 - 1.2**2))))]
)
def test_the_level_of_coloured_noise_is_the_closed_form(ar, level):
    """Yule and Walker: 1/sqrt(1 - a^2), and sqrt((1 - b)/((1 + b)((1 - b)^2 - a^2))) of two coefficients a, b."""
    assert stationary_deviation(2.0, np.array(ar)) == pytest.approx(2.0 * level, rel=1e-9)


@every_colour
def test_periods_that_repeat_tell_the_noise_beside_any_motion(ar, rng):
    """The motion, a thousand times the noise, is the same in every period; differences of two hold twice its square."""
    P, periods, sd = 500, 41, 2e-9
    drive = np.tile(moving(P), periods)
    motion = lfilter([0.05], [1.0, -0.95], 1e-6 * drive)
    motion[:P] *= 1.5  # the first one is on its way
    found = estimate_noise(recording(record(motion + noise(rng, P * periods, sd, ar), drive=drive)), SETTLING)
    n = (periods - 1) // 2 * P
    assert "periods" in found.notes[0] and found.count[0] == n
    assert found.sd[0] == pytest.approx(sd, rel=SIGMAS / np.sqrt(2 * n))


@every_colour
def test_dwells_tell_the_noise_once_the_stage_has_settled(ar, rng):
    """Creep goes on in them; ten dwells, each with a slow way of a hundred times the noise."""
    length, wait, sd, h = 1500, 300, 2e-9, 1e-3
    drive = np.repeat(rng.uniform(-1, 1, 10), length)
    t = np.arange(length)
    each = 1e-6 * np.exp(-t / 60) + 2e-7 * np.log1p(t / 4000)  # to e^-5 of it after the wait
    y = np.tile(np.where(t < wait, each, each - 1e-6 * np.exp(-t / 60)), 10)
    found = estimate_noise(recording(record(y + noise(rng, 10 * length, sd, ar), drive=drive, h=h)), wait * h)
    n = 10 * (length - wait)
    assert "dwells" in found.notes[0] and found.count[0] == n
    # A polynomial of fourth degree takes five of 1200 samples with it, more of what is slow
    assert found.sd[0] == pytest.approx(sd, rel=SIGMAS / np.sqrt(2 * n) + 5 / 1200)


@pytest.mark.parametrize("loud", [2.0, 30.0])
def test_a_dwell_in_which_something_happened_is_left_out(loud, rng):
    drive = np.repeat(rng.uniform(-1, 1, 8), 1000)
    y = noise(rng, 8000, 1e-9)
    y[3000:4000] *= loud
    found = estimate_noise(recording(record(y, drive=drive)), SETTLING)
    assert found.sd[0] == pytest.approx(1e-9, rel=SIGMAS / np.sqrt(2 * 7000) + 5 / 1000)


@pytest.mark.parametrize("h", [1e-4, 0.5])
def test_the_fastest_part_of_readings_that_never_rest_tells_white_noise(h, rng):
    """Third differences, whose squares are 1 + 9 + 9 + 1 = 20 times those of the noise; of two sensors at once."""
    n, sds = 1_000_000, (3e-9, 7e-7)
    motion = 1e-5 * moving(n)[:, None]
    y = motion + np.column_stack([noise(rng, n, sd) for sd in sds])
    found = estimate_noise(recording(record(y, drive=moving(n), h=h)), SETTLING)
    assert found.guessed.all() and found.count == pytest.approx((n - 3) / 5)
    assert found.sd == pytest.approx(np.array(sds), rel=SIGMAS / np.sqrt(2 * n / 5))


def scatter(make, count: int = 150) -> tuple[float, float]:
    """Root mean square of how far estimates of unit noise are off, and what their own number of samples says of that."""
    found = [make(np.random.default_rng(seed)) for seed in range(count)]
    off = np.array([f.sd[0] for f in found]) - 1
    return float(np.sqrt(np.mean(off**2))), float(np.mean([1 / np.sqrt(2 * f.count[0]) for f in found]))


@pytest.mark.long
@pytest.mark.parametrize("source", ["rest", "periods", "dwells", "fastest"])
def test_an_estimate_knows_how_well_it_is_known(source):
    """150 recordings scatter as `count` says, to the scatter of that (6 %) and the roundness of its definition."""
    n = 3000

    def make(rng):
        if source == "rest":
            return estimate_noise(recording(record(noise(rng, n, 1.0), "rest")), SETTLING)
        if source == "periods":
            drive = np.tile(moving(200), 31)
            return estimate_noise(recording(record(noise(rng, len(drive), 1.0), drive=drive)), SETTLING)
        if source == "dwells":
            drive = np.repeat(rng.uniform(-1, 1, 4), 1000)
            return estimate_noise(recording(record(noise(rng, len(drive), 1.0), drive=drive)), SETTLING)
        return estimate_noise(recording(record(noise(rng, n, 1.0), drive=moving(n))), SETTLING)

    seen, said = scatter(make)
    assert 0.75 < seen / said < 1.25


def test_a_stated_deviation_stands_where_nothing_else_tells_and_yields_to_a_rest(rng):
    n = 4000
    y = 1e-6 * moving(n) + noise(rng, n, 2e-9)
    one = estimate_noise(recording(record(y, drive=moving(n)), stated=(5e-9,)), SETTLING)
    assert one.sd[0] == 5e-9 and one.known[0] and not one.guessed[0]
    rest = record(noise(rng, n, 2e-9), "rest")
    two = estimate_noise(recording(record(y, drive=moving(n)), rest, stated=(5e-9,)), SETTLING)
    assert two.sd[0] == pytest.approx(2e-9, rel=SIGMAS / np.sqrt(2 * n))


@pytest.mark.parametrize("at", [0.0, 0.2, 0.3])
@pytest.mark.parametrize("steps", [0.5, 1.8, 2.2, 3.0, 4.0, 6.0])
def test_a_rest_tells_the_noise_of_a_motion_beside_steps_of_any_size(steps, at, rng):
    """On the move a step q adds q^2/12 to the noise, however much of it a rest shows that stands `at` so many steps from the middle of
    one: to 8 %, as little is known of an end of a step that hardly any reading has left."""
    sd, n = 1e-9, 6000
    q = steps * sd
    rest = np.round(noise(rng, n, sd) / q + at) * q
    found = estimate_noise(recording(record(rest, "rest")), SETTLING)
    assert found.floor[0] == pytest.approx(np.hypot(sd, q / np.sqrt(12)), rel=0.08)


@pytest.mark.parametrize("steps", [2.5, 3.2])
def test_the_colour_of_what_a_rest_shows_beside_its_steps_is_kept(steps, rng):
    rest = np.round(noise(rng, 6000, 1e-9 * np.sqrt(1 - 0.6**2), (0.6,)) / (steps * 1e-9)) * steps * 1e-9
    found = estimate_noise(recording(record(rest, "rest")), SETTLING)
    assert len(found.ar[0]) and found.floor[0] == pytest.approx(1e-9 * np.hypot(1, steps / np.sqrt(12)), rel=0.08)


@pytest.mark.parametrize("repeats", [3, 20])
def test_poses_that_repeat_tell_the_noise_from_all_but_the_first_of_each(repeats, rng):
    places, sd = 40, 3e-8
    drive = np.tile(np.linspace(-1, 1, places), repeats)
    poses = record(1e-5 * drive**3 + noise(rng, len(drive), sd), drive=drive, h=np.inf)
    found = estimate_noise(recording(poses, kind="poses"), SETTLING)
    n = places * (repeats - 1)
    assert found.count[0] == n and found.sd[0] == pytest.approx(sd, rel=SIGMAS / np.sqrt(2 * n))


def test_a_simulation_that_runs_away_is_whitened_to_no_number_and_without_a_warning():
    noise = Noise(np.array([1e-9]), (np.array([0.5]),), (NoiseSource.REST,), ("",), np.array([np.inf]))
    white = noise.whiten(np.array([[1e-9], [3e-9], [1e300], [np.inf], [np.inf]]), np.ones((5, 1), bool))[:, 0]
    assert white[1] == pytest.approx(2.5) and np.array_equal(white[2:], [np.inf, np.nan, np.nan], equal_nan=True)


@every_colour
def test_whitened_noise_is_unit_white_noise_again(ar, rng):
    n = 20000
    y = noise(rng, n, 3e-9, ar)[:, None]
    found = estimate_noise(recording(record(y, "rest")), SETTLING)
    valid = np.ones_like(y, bool)
    valid[777] = False
    white, usable = found.whiten(y, valid), found.usable(valid)
    e = white[usable]
    assert np.std(e) == pytest.approx(1.0, rel=SIGMAS / np.sqrt(2 * n)) and ljung_box(e) > 1e-4
    order = len(found.ar[0])
    assert not usable[:order].any() and not usable[777 : 778 + order].any() and usable.sum() == n - 2 * order - 1
    assert not white[~usable].any()


def test_the_test_of_whiteness_rejects_as_often_as_it_says(rng):
    """Of white noise p is uniform: between 0 and 1 by Kolmogorov and Smirnov; of one pole of 0.1 it is tiny."""
    p = [ljung_box(rng.standard_normal(500)) for _ in range(400)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert ljung_box(noise(rng, 5000, 1.0, (0.1,))) < 1e-4


def test_a_line_is_taken_out_of_a_stretch_and_noise_is_left():
    """Of a line of 2.1 times the noise some 3 % of the power stay, as the frequency is sought among eight a bin; white noise
    alone stays as it is, to the last bit."""
    n = 4000
    white = np.random.default_rng(11).standard_normal(n)
    hum = 3 * np.sin(2 * np.pi * 2339 / 8 * np.arange(n) / n + 0.3)
    assert np.array_equal(without_lines(white), white)
    assert np.var(without_lines(white + hum)) == pytest.approx(np.var(white), abs=0.05 * np.var(hum))


@pytest.mark.parametrize("pole", [0.0, 0.6])
def test_a_residual_tells_the_noise_beside_a_line_and_white_noise_has_no_pole(pole):
    """A line of ten times the noise, at a frequency at which the device does not move."""
    n = 4000
    rng, t = np.random.default_rng(5), np.arange(4000)
    motion = noise(rng, n, 1.0, (0.99,))
    left = noise(rng, n, 1.0, (pole,)) + 10 * np.sin(2 * np.pi * 0.31 * t)
    sd, ar, worth = noise_from_residual(left, motion)
    assert sd == pytest.approx(1.0, abs=SIGMAS / np.sqrt(2 * worth))
    assert ar.size == 0 if pole == 0 else ar == pytest.approx([pole], abs=SIGMAS / np.sqrt(worth))


def test_the_longest_stretch_of_good_samples_bridges_a_few_others():
    """Half open, from its first good sample to behind its last."""
    assert longest_stretch(np.zeros(9, bool)) is None
    for others, stretch in ((NOISE_UPDATE.bridged, (2, 11 + NOISE_UPDATE.bridged)), (NOISE_UPDATE.bridged + 1, (2, 8))):
        good = np.r_[np.zeros(2), np.ones(6), np.zeros(others), np.ones(3), np.zeros(2)].astype(bool)
        assert longest_stretch(good) == stretch
