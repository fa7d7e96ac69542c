"""The fastest motion along a path, against sums, simulations and searches that are written by hand and share no code with it."""

from __future__ import annotations

import json

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run
from conftest import SCENARIOS
from result_files import faults
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import ctrlgen
from ctrlgen import InputError, SolverError, build_model, load_scenario, solve, user_device
from ctrlgen.path_timing.binding import AT_BOUND, EXACTLY, bindings
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.drive_law import InertialLaw, bell_polynomials
from ctrlgen.path_timing.fastest_page import write_fastest
from ctrlgen.path_timing.feasibility import Followed
from ctrlgen.path_timing.intersample_error import error_between
from ctrlgen.path_timing.maximum_velocity import steps_in_time
from ctrlgen.path_timing.optimum import Optimiser, Optimum, Piece
from ctrlgen.path_timing.repetition import crossing, largest
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.paths import Poses

AXIS = SCENARIOS / "flexure_axis_line"
STIFFNESS, GAIN, RADIUS, RATE = 1e6, 0.2, 10e-6, 2e4  # of `stage`: N/m, N/V, m, V/s


@pytest.fixture(scope="module")
def circle20():
    """The fastest motion round NIST's circle, set-points every 0.1 ms."""
    return ctrlgen.fastest(SCENARIOS / "circle20", sample_rate="10 kHz")


@pytest.fixture(scope="module")
def temperatures(circle):
    """What the circle takes of the heaters at its 1000 places: rise (n, 6) [K], its slope by the share of the path, and the numbers."""
    number = {k: v.si for k, v in circle.model.device.quantities()}
    rise = circle.trace.signals["state"] - number["actuator.ambient"]
    waves = np.fft.rfftfreq(len(rise), 1 / len(rise))[:, None]
    slope = np.fft.irfft(2j * np.pi * waves * np.fft.rfft(rise, axis=0), len(rise), axis=0)
    return rise, slope, number


def slowness(temperatures):
    """(n,) the least time by share at each place: tau T' s' + T - T_amb = R P with 0 <= P <= P_max."""
    rise, slope, number = temperatures
    tau, hottest = (
        number["actuator.time_constant"],
        number["actuator.thermal_resistance"] * number["actuator.power_limit"],
    )
    return np.maximum(tau * slope / (hottest - rise), -tau * slope / rise).max(axis=1)


def test_the_circle_takes_the_integral_of_the_slowness_of_its_heaters(circle20, temperatures):
    """1e-4: the sum over 1000 places, whose kinks lie between them."""
    assert circle20.optimum.duration == pytest.approx(slowness(temperatures).mean(), rel=1e-4)


def test_the_circle_by_hand(circle20):
    """Three heaters cool one after the other, 120 degrees each: T = 3 tau ln(d_1/d_2) with the displacements d = 12.432 + 10 cos psi
    of S1's Jacobian at the places where two heaters are equally slow: 29.9 ms. 8 %: it leaves out the compliances, of 1 um, the law of
    force and the slope of the expansion."""

    def d(psi):
        return 12.432 + 10 * np.cos(psi)

    turn = 2 * np.pi / 3
    begin = brentq(lambda psi: np.sin(psi) / d(psi) - np.sin(psi + turn) / d(psi + turn), 0.5, 1.05)
    by_hand = 3 * 5e-3 * np.log(d(begin) / d(begin + turn))
    assert circle20.optimum.duration == pytest.approx(by_hand, rel=0.08)


def test_even_speed_is_that_of_the_slowest_place(circle20, temperatures):
    """Within two samples of 0.1 ms: drives are held, and a period is a whole number of samples."""
    assert abs(circle20.even - slowness(temperatures).max()) < 2e-4
    assert circle20.stated == circle20.even  # the scenario's own law of time is even


def test_set_points_come_within_two_samples_of_what_no_law_can_beat(circle20):
    assert 0 <= circle20.duration - circle20.optimum.duration < 2 * circle20.sample_time


def test_set_points_lie_on_the_path_and_keep_every_limit(circle20):
    """To rounding; the heaters' power is at its bound in most samples."""
    pose = circle20.solution.trace.signals["pose"]
    assert np.hypot(pose[:, 3], pose[:, 4]) == pytest.approx(10e-6, abs=1e-14)
    assert circle20.solution.drive.min() >= 0 and circle20.solution.tightest.distance >= 0
    assert np.mean(circle20.solution.drive.min(axis=1) < 1e-3) > 0.9  # of 1 W


def test_no_schedule_of_held_powers_is_shorter(temperatures):
    """A search over 3000 places: from each the furthest that powers held for 1 ms reach, T+ = T_amb + R P + (T - T_amb - R P) e^(-h/tau);
    the fewest such steps round the circle, from where the motion starts. Its grid may cost it a step."""
    found = ctrlgen.fastest(SCENARIOS / "circle20")
    rise, _, number = temperatures
    n = 3000
    spectrum = np.fft.rfft(rise, axis=0)
    fine = np.fft.irfft(np.vstack([spectrum, np.zeros((n // 2 + 1 - len(spectrum), 6))]), n, axis=0) * n / len(rise)
    kept, R = np.exp(-1e-3 / number["actuator.time_constant"]), number["actuator.thermal_resistance"]

    def reaches(a, steps):
        power = (fine[(a + steps) % n] - kept * fine[a]) / ((1 - kept) * R)
        good = np.all((power >= 0) & (power <= number["actuator.power_limit"]), axis=1)
        return len(steps) if good.all() else int(np.argmin(good))

    ahead = np.arange(1, n // 4)
    place, count = 0, 0
    while place < n:
        place, count = place + reaches(place % n, ahead), count + 1
    assert count - 1 <= len(found.share) - 1 <= count + 1


def test_at_every_place_one_limit_binds(circle20):
    """The powers of the three slow heaters for a third of the time each; near where they change over, one on the other side."""
    times = {b.side.name: b.share_of_time for b in circle20.bindings}
    assert sum(times.values()) == pytest.approx(1, abs=0.01)
    assert [times[name] for name in ("1X", "2X", "3X")] == pytest.approx([0.32] * 3, abs=0.02)
    assert all(not b.side.upper and b.side.limit.unit == "W" for b in circle20.bindings)


@pytest.mark.long
def test_a_circle_as_large_as_a_frequency_allows_takes_just_that_long(tmp_path):
    """0.2 %: scales are searched to 0.1 %. Its set-points are a scenario like any other, whose drives keep the limits."""
    found = ctrlgen.fastest(SCENARIOS / "circle20", sample_rate="10 kHz", frequency="50 Hz")
    largest = found.repetition.scale
    optimiser = Optimiser(found.solution.model, "pose", 1e-4)
    assert optimiser.along(found.curve.scaled(largest)).duration == pytest.approx(0.02, rel=2e-3)
    assert found.repetition.even < largest < 1
    assert found.repetition.even < found.repetition.sampled <= largest
    write_fastest(tmp_path, found)
    written = load_scenario(tmp_path / "at_frequency" / "scenario" / "circle20_repeated.toml")
    again = solve(written, build_model(written.device))
    assert len(again.command) == 200 and again.scenario.closed  # of 10 kHz, 50 times a second
    radius = np.ptp(again.command[:, 3]) / 2
    assert radius == pytest.approx(found.repetition.sampled * 10e-6, rel=1e-3)  # the largest of 200 points of a circle
    assert all(margin.distance >= 0 for margin in again.margins)


@pytest.mark.parametrize("scale", [0.013, 0.37, 1.0, 41.0])
def test_the_largest_scale_is_found_from_below(scale):
    """Within 0.1 %, and never above: where the time is the period, where the path is no longer possible, where a limit breaks."""
    for behind in (lambda s: 0.8 * (s - np.log(scale)), lambda s: -0.1 if s <= np.log(scale) else 10.0):
        assert 0.999 * scale <= crossing(behind, behind(0.0)) <= scale * (1 + 1e-12)
    assert 0.999 * scale <= largest(lambda tried: tried <= scale) <= scale


def test_no_scale_is_found_where_none_is_small_enough():
    assert crossing(lambda s: 1.0, 1.0) is None and largest(lambda scale: False) is None


# With inertia


def bang_bang(force):
    """[s] the least time of 50 um from rest to rest of 0.5 kg, 30 N s/m, 0.2 N/um under forces of +- `force`: one change of sign, where
    the two arcs of the phase plane meet (Bobrow)."""

    def arc(sign, start, end):
        def slope(_, y):
            return [y[1], (sign * force - 30 * y[1] - 0.2e6 * y[0]) / 0.5]

        def there(_, y):
            return y[0] - end

        there.terminal = True
        return solve_ivp(slope, (0, 0.1), start, events=there, rtol=1e-10, atol=1e-14, max_step=1e-5)

    def backwards(switch):
        def slope(_, y):  # in reversed time
            return [-y[1], -(-force - 30 * y[1] - 0.2e6 * y[0]) / 0.5]

        def there(_, y):
            return y[0] - switch

        there.terminal = True
        return solve_ivp(slope, (0, 0.1), [50e-6, 0], events=there, rtol=1e-10, atol=1e-14, max_step=1e-5)

    def gap(switch):
        return arc(1, [0, 0], switch).y[1, -1] - backwards(switch).y[1, -1]

    switch = brentq(gap, 5e-6, 45e-6, xtol=1e-12)
    return arc(1, [0, 0], switch).t[-1] + backwards(switch).t[-1]


@pytest.mark.long
def test_an_axis_with_inertia_comes_within_a_hundredth_of_full_force_one_way_and_the_other():
    """At 1 MHz the four samples in which its drive crosses its range cost a quarter of a per cent."""
    found = ctrlgen.fastest(AXIS, sample_rate="1 MHz")
    assert bang_bang(40.0) <= found.optimum.duration < 1.01 * bang_bang(40.0)
    assert found.duration < 1.01 * bang_bang(40.0)


def test_an_axis_with_inertia_is_there_and_at_rest():
    found = ctrlgen.fastest(AXIS)
    """10 pm, which the solver counts as none; the last drive is what holds 50 um, k d/k_f."""
    d, u = found.solution.trace.signals["displacement"][:, 0], found.solution.drive[:, 0]
    assert d[[0, -1]] == pytest.approx([0, 50e-6], abs=1e-11) and u[-1] == pytest.approx(1.0, abs=1e-6)
    assert np.abs(u).max() <= 4 and found.duration < found.stated < found.given


def test_the_derivatives_of_a_target_follow_from_those_of_the_path():
    """r(s(t)) = sin 3 s, s = t^2 + t: by the chain rule at t = 0.4, against the axis' own m a + c v + k d."""
    model = build_model(load_scenario(AXIS).device)
    law, t = InertialLaw(model, "pose"), 0.4
    s, speed = t**2 + t, [2 * t + 1, 2.0]
    place = 1e-6 * np.array([np.sin(3 * s), 3 * np.cos(3 * s), -9 * np.sin(3 * s)])
    v = place[1] * speed[0]
    a = place[1] * speed[1] + place[2] * speed[0] ** 2
    *_, u = law.at(ca.SX(place), ca.SX(speed))
    assert float(u) == pytest.approx((0.5 * a + 30 * v + 0.2e6 * place[0]) / 10, rel=1e-12)


def test_the_fourth_derivative_of_a_composition_is_faa_di_brunos():
    """B_4,1 ... B_4,4 = w4, 4 w1 w3 + 3 w2^2, 6 w1^2 w2, w1^4."""
    a, b, c, d = 0.7, -1.3, 2.1, 0.4
    found = ca.DM(bell_polynomials(4, ca.SX([a, b, c, d]))).full().ravel()
    assert found == pytest.approx([d, 4 * a * c + 3 * b**2, 6 * a**2 * b, a**4])


def test_a_tripod_on_its_cone_is_faster_than_at_even_speed_and_keeps_its_currents():
    found = ctrlgen.fastest(SCENARIOS / "tripod_tilt")
    assert found.optimum.duration <= found.duration <= found.even
    assert np.abs(found.solution.drive).max() <= 0.8


# Rates of drives


def both(rate):
    """The same rate of both drives [V/s]."""
    return {"x": f"{rate} V/s", "y": f"{rate} V/s"}


def stage(rate, **other):
    """A piezo X-Y stage, u = stiffness d/gain, whose drives change by `rate` at most."""
    words = dict(
        parameters={"gain": "0.2 N/V", "k": "1 N/um"},
        drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
        drive_rate=rate,
    )
    return user_device("stage", **(words | other))


def lagging(rate):
    """The same with amplifiers that follow within 1 ms."""
    return stage(
        rate, parameters={"gain": "0.2 N/V", "k": "1 N/um", "tau": "1 ms"}, state={"a": "150 V", "b": "150 V"},
        force=lambda x, p: [p.gain * x.a, p.gain * x.b], rates=lambda u, x, p: [(u.x - x.a) / p.tau, (u.y - x.b) / p.tau],
    )  # fmt: skip


ROUND = 'kind = "circle"\ndiameter = "20 um"\ncentre = { x = "15 um", y = "15 um" }\nplane = ["x", "y"]\n'
STRAIGHT = 'kind = "line"\nstart = { x = "5 um", y = "5 um" }\nend = { x = "15 um", y = "5 um" }\n'


def written(folder, device, path, rate="20 kHz"):
    text = f'title = "t"\ndevice = "{device.name}"\nfollow = "displacement"\nsample_rate = "{rate}"\nduration = "50 ms"\n[path]\n{path}'
    (folder / "scenario.toml").write_text(text)
    return load_scenario(folder, device)


def test_a_circle_under_rates_of_drives_takes_the_integral_of_the_faster_axis(tmp_path):
    """T = k R/(g r) int max(|sin|, |cos|) dphi = 4 sqrt(2) k R/(g r); at even speed 2 pi k R/(g r), less what chords cut off."""
    found = ctrlgen.fastest(written(tmp_path, stage(both(RATE)), ROUND))
    unit = STIFFNESS * RADIUS / (GAIN * RATE)
    assert found.optimum.duration == pytest.approx(4 * np.sqrt(2) * unit, rel=5e-3)
    assert found.even == pytest.approx(2 * np.pi * unit, rel=2e-2)
    assert {b.side.limit.name for b in found.bindings} == {"rate_x", "rate_y"}


def test_a_lag_under_a_rate_of_its_drive_takes_two_ramps(tmp_path):
    """From 25 V to 75 V, where the amplifier rests again: the drive rises for t1 and falls for t2, with the response of a lag to ramps."""
    found = ctrlgen.fastest(written(tmp_path, lagging(both(RATE)), STRAIGHT))
    tau, swing = 1e-3, STIFFNESS * 10e-6 / GAIN

    def left(t1):  # of the lag behind the drive, once the drive is where it ends: it must be zero
        t2 = t1 - swing / RATE
        behind = RATE * tau * (1 - np.exp(-t1 / tau))
        return -RATE * tau + (behind + RATE * tau) * np.exp(-t2 / tau)

    t1 = brentq(left, swing / RATE, 10e-3)
    assert found.optimum.duration == pytest.approx(2 * t1 - swing / RATE, rel=1e-2)


def test_a_lag_alone_takes_a_logarithm(tmp_path):
    """From 25 to 75 V behind an amplifier of 1 ms at its 150 V: tau ln((150 - 25)/(150 - 75)). 1e-4: trapezia over some hundred places."""
    found = ctrlgen.fastest(written(tmp_path, lagging(None), STRAIGHT, rate="200 kHz"))
    assert found.optimum.duration == pytest.approx(1e-3 * np.log(125 / 75), rel=1e-4)


@pytest.mark.parametrize("closed", [False, True])
def test_at_even_speed_every_sample_leads_as_far_also_beyond_the_end(closed):
    """Half a second for the path, 0.1 s a sample: a fifth of it, from its last place too."""
    share = np.linspace(0, 1, 11)
    steps = steps_in_time(share, share / 2, np.full(11, 2.0), 0.1, closed)
    assert steps == pytest.approx(np.full(11, 0.2))


def test_a_rate_that_never_binds_leaves_what_each_place_allows(tmp_path):
    """IPOPT over the whole path against the bound of each place: 0.5 %, of 216 intervals."""
    free = ctrlgen.fastest(written(tmp_path, lagging(None), ROUND))
    bound = ctrlgen.fastest(written(tmp_path, lagging(both(1e9)), ROUND))
    assert bound.optimum.duration == pytest.approx(free.optimum.duration, rel=5e-3)
    (piece,) = bound.optimum.pieces
    assert np.all(piece.speed <= piece.bound * (1 + 1e-6))


# What becomes of it


def test_the_set_points_are_a_scenario_that_says_the_same(circle20, tmp_path):
    """A rounding: written in um with all digits."""
    from ctrlgen.path_timing.retimed import write_inputs

    write_inputs(tmp_path, circle20.solution.scenario)
    scenario = load_scenario(tmp_path / "circle20_fastest.toml")
    assert scenario.closed and scenario.name == "circle20_fastest"
    assert scenario.bind(build_model(scenario.device)).samples == pytest.approx(
        circle20.solution.command, rel=1e-14, abs=1e-20
    )


@pytest.mark.long
def test_corners_are_set_points():
    found = ctrlgen.fastest(SCENARIOS / "raster", sample_rate="4 kHz")
    corners = found.curve.samples(np.unique(np.concatenate(found.curve.pieces)))
    off = np.abs(found.solution.command[:, None] - corners).max(axis=2).min(axis=0)
    assert len(corners) == 22 and off.max() < 1e-15


def test_between_set_points_the_circle_is_left_by_the_sagitta_at_least(circle20):
    """R (1 - cos(dphi/2)) of the longest step; at most a few times that, as heaters do not move linearly."""
    longest = np.diff(circle20.share).max() * 2 * np.pi
    sagitta = RADIUS * (1 - np.cos(longest / 2))
    assert sagitta / 4 < np.linalg.norm(circle20.between[3:5]) < 4 * sagitta


def test_between_set_points_the_distance_is_that_to_the_nearest_place_of_the_curve(tmp_path):
    """24 set-points round the circle, amplifiers with a lag of one sample: e^(-t/tau) written here, and the distance from a circle. 1 nm
    of 170: what the curve is more than its chords, R (1 - cos(pi/384)), is 0.3 nm; without the foot on the chord it would be 80."""
    scenario, h, turn = written(tmp_path, lagging(None), ROUND, "1 kHz"), 1e-3, np.linspace(0, 1, 25)
    model = build_model(scenario.device)
    curve = Curve(scenario, model)
    solution = solve(Followed.of(curve, model, scenario.file.sample_rate).scenario(turn, "t"), model)
    worst = np.zeros(2)
    for part in (0.25, 0.5, 0.75):
        u, volts = solution.drive, solution.trace.x
        off = GAIN / STIFFNESS * (u + (volts - u) * np.exp(-part * h / 1e-3)) - 15e-6
        away = off - RADIUS * off / np.linalg.norm(off, axis=1, keepdims=True)
        worst = np.maximum(worst, np.abs(away).max(axis=0))
    assert worst.min() > 50e-9 and error_between(curve, solution, turn) == pytest.approx(worst, abs=1e-9)


@pytest.mark.long
def test_memories_of_effects_are_kept_within_limits(tmp_path):
    """The law of time is found without the creep; what is confirmed and solved has it."""
    text = (SCENARIOS / "devices" / "mems_hexapod.toml").read_text()
    (tmp_path / "creeping.toml").write_text(
        text + '\n[[effect]]\nkind = "creep"\nat = "1X"\ngain = "0.05"\ntau = "0.2 s"\nslow = "0.3"\n'
    )
    found = ctrlgen.fastest(load_scenario(SCENARIOS / "circle20", tmp_path / "creeping.toml"), sample_rate="4 kHz")
    assert found.solution.model.x.numel() == 8 and found.solution.drive.min() >= 0
    assert any("without the memories" in note for note in found.notes)


def test_a_periodic_list_of_poses_has_the_derivatives_of_its_curve():
    """Of a sine at 64 samples a period: to what a quintic spline leaves."""
    t = 2 * np.pi * np.arange(64) / 64
    path = Poses(kind="poses", periodic=True, listed=tuple((float(v),) for v in np.sin(t)))
    tables = path.derivatives(Frame(("a",), ("m",)), 64, 2, np.arange(64) + 0.5)
    at = t + np.pi / 64
    rate = 2 * np.pi / 64
    for table, wanted in zip(tables, (np.sin(at), rate * np.cos(at), -(rate**2) * np.sin(at)), strict=True):
        assert table[:, 0] == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_the_command_writes_page_figures_numbers_scenario_and_player(tmp_path):
    done = run("fastest", AXIS, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "commanded drive" in done.stdout and "at even speed" in done.stdout
    record = json.loads((tmp_path / "out" / "fastest.json").read_text())
    assert faults(record, "fastest") == [] and record["times"]["even_speed"] is None
    assert (tmp_path / "out" / "fastest.html").read_text().count("<svg") == 3
    assert (tmp_path / "out" / "player" / "flexure_axis_line_fastest_player_f64.c").is_file()
    assert load_scenario(tmp_path / "out" / "scenario" / "flexure_axis_line_fastest.toml").sample_time == 5e-5


@pytest.mark.long
def test_the_command_says_how_large_a_circle_a_frequency_allows(tmp_path):
    done = run("fastest", SCENARIOS / "circle20", "--frequency", "50 Hz", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "largest circle at 50 Hz" in done.stdout and "commanded heater power" in done.stdout
    record = json.loads((tmp_path / "out" / "fastest.json").read_text())
    assert faults(record, "fastest") == []
    assert (
        record["times"]["continuous"]
        <= record["times"]["fastest"]
        < record["times"]["even_speed"]
        < record["times"]["stated"]
    )
    page = (tmp_path / "out" / "fastest.html").read_text()
    assert page.count("<svg") == 3 and "Largest circle at 50 Hz" in page
    assert (tmp_path / "out" / "player" / "circle20_fastest_player_f64.c").is_file()


# What is refused


@pytest.mark.parametrize(
    ("scenario", "options", "said"),
    [
        ("unreachable", {"sample_rate": "1 kHz"}, "state the path as a formula"),
        ("xy_stage_force", {}, "sample_rate: is missing"),
        ("parallelogram_line", {}, "without delay"),
        ("circle20", {"sample_rate": "fast"}, "does not start with a number"),
        ("circle20", {"sample_rate": "0 Hz"}, "is not above zero"),
        ("circle20", {"frequency": "20 ms"}, "wrong unit"),
        ("circle20", {"frequency": "400 Hz"}, "2.5 samples"),
        ("circle20", {"frequency": "1 mHz"}, "give a lower --sample-rate"),
        ("circle20", {"sample_rate": "1e300 Hz"}, "give a lower one"),
        ("circle20", {"sample_rate": "100 Hz"}, "is too low"),
    ],
)
def test_what_cannot_be_answered_is_refused_with_what_to_do(scenario, options, said):
    with pytest.raises((InputError, SolverError), match=said):
        ctrlgen.fastest(SCENARIOS / scenario, **options)


def test_a_path_that_cannot_even_be_held_is_explained(tmp_path):
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace('"20 um"\ncentre', '"60 um"\ncentre')
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path, SCENARIOS / "devices" / "mems_hexapod.toml")
    with pytest.raises(ctrlgen.Unreachable, match="the actuator only pushes"):
        ctrlgen.fastest(scenario)


def test_a_circle_of_two_axes_of_unlike_size_is_divided_evenly(tmp_path):
    """Sizes of 30 um and 0.3 mm: equal steps along the circle are equal angles, as lengths of one kind count alike. 1e-6: its length is
    summed over 4000 chords."""
    device = stage(both(RATE), axes={"x": ("-1 um", "30 um"), "y": ("-0.01 mm", "0.3 mm")})
    share = Curve(written(tmp_path, device, ROUND), build_model(device)).evenly(36)
    assert share == pytest.approx(np.linspace(0, 1, 37), abs=1e-6)


def test_an_open_motion_lasts_from_its_first_sample_to_its_last_and_a_closed_one_a_period(tmp_path):
    """1000 samples of 50 us: 999 steps of a line, which stands at its first sample at the time zero; of a circle the last leads back."""
    for path, steps in ((STRAIGHT, 999), (ROUND, 1000)):
        scenario = written(tmp_path, stage(both(RATE)), path)
        assert len(scenario.bind(build_model(scenario.device)).samples) == 1000
        found = ctrlgen.fastest(scenario)
        assert found.given == pytest.approx(steps * 50e-6)


def test_a_scaled_curve_keeps_its_middle():
    scenario = load_scenario(SCENARIOS / "circle20")
    half = Curve(scenario, build_model(scenario.device)).scaled(0.5)
    points = half.samples(np.linspace(0, 1, 9))
    assert np.hypot(points[:, 3], points[:, 4]) == pytest.approx(5e-6) and points[:, 5] == pytest.approx(20e-6)


def test_what_is_solved_is_what_the_ordinary_solver_finds(circle20):
    assert solve(circle20.solution.scenario, circle20.solution.model).drive == pytest.approx(
        circle20.solution.drive, abs=1e-9
    )


def test_a_limit_binds_between_nodes_that_are_both_at_it():
    """From the first to the last node of a run; a single node is a touch and takes no time; the nearness is that of how it was found."""
    times, share = np.array([0.0, 1.0, 3.0, 6.0, 10.0, 15.0, 21.0, 28.0]), np.linspace(0, 0.7, 8)
    far, law = 1.0, object()
    touched = np.array([far, 0.0, EXACTLY / 2, 0.0, far, far, 0.0, far])
    first, second = np.stack([touched, np.full(8, AT_BOUND / 2)], axis=1), np.full((8, 2), AT_BOUND / 2)
    second[:, 0] = far
    pieces = tuple(
        Piece(times, share, np.zeros(8), distances, None, own, None)
        for distances, own in ((first, None), (second, law))
    )
    longest, shortest = bindings(Optimum(pieces, ("touched", "held")))
    assert longest.side == "held" and longest.time == 28.0 and longest.runs == ((0.0, pytest.approx(0.7)),)
    assert shortest.side == "touched" and shortest.time == 5.0 and shortest.share_of_time == 5 / 56
    assert shortest.runs == ((pytest.approx(0.1), pytest.approx(0.3)),)
