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
from ctrlgen import InputError, build_model, load_scenario, solve
from ctrlgen.path_timing.binding import AT_BOUND, EXACTLY, bindings
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.drive_law import InertialLaw, bell_polynomials
from ctrlgen.path_timing.fastest_plots import draw_fastest
from ctrlgen.path_timing.optimum import Optimum, Piece
from ctrlgen.path_timing.repetition import crossing, largest
from ctrlgen.path_timing.retimed import retimed, write_inputs
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.paths import Poses

AXIS = SCENARIOS / "flexure_axis_line"


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


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_a_tripod_on_its_cone_is_faster_than_at_even_speed_and_keeps_its_currents():
    found = ctrlgen.fastest(SCENARIOS / "tripod_tilt")
    assert found.optimum.duration <= found.duration <= found.even
    assert np.abs(found.solution.drive).max() <= 0.8


# What becomes of it


def test_the_set_points_are_a_scenario_that_says_the_same(circle20, tmp_path):
    """A rounding: written in um with all digits."""
    write_inputs(tmp_path, circle20.solution.scenario)
    scenario = load_scenario(tmp_path / "circle20_fastest.toml")
    assert scenario.closed and scenario.name == "circle20_fastest"
    assert scenario.bind(build_model(scenario.device)).samples == pytest.approx(
        circle20.solution.command, rel=1e-14, abs=1e-20
    )


@pytest.fixture(scope="module")
def raster():
    """The fastest motion along a path with corners."""
    return ctrlgen.fastest(SCENARIOS / "raster", sample_rate="4 kHz")


@pytest.mark.long
def test_limits_that_bind_on_some_pieces_alone_are_drawn(raster):
    assert len(raster.curve.pieces) > 1
    assert set(draw_fastest(raster)) == {"path", "binding", "drives"}


@pytest.mark.long
def test_corners_are_set_points(raster):
    corners = raster.curve.samples(np.unique(np.concatenate(raster.curve.pieces)))
    off = np.abs(raster.solution.command[:, None] - corners).max(axis=2).min(axis=0)
    assert len(corners) == 22 and off.max() < 1e-15


def test_between_set_points_the_circle_is_left_by_the_sagitta_at_least(circle20):
    """R (1 - cos(dphi/2)) of the longest step; at most a few times that, as heaters do not move linearly."""
    longest = np.diff(circle20.share).max() * 2 * np.pi
    sagitta = 10e-6 * (1 - np.cos(longest / 2))
    assert sagitta / 4 < np.linalg.norm(circle20.between[3:5]) < 4 * sagitta


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


@pytest.mark.long
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


@pytest.fixture(params=["raster", "flexure_axis_line"])
def shaped(request, tmp_path):
    """A scenario that asks for shaping, of a device without inertia and of one with it."""
    source = load_scenario(SCENARIOS / request.param)
    shaping = '\n[shaping]\nkind = "ZV"\nfrequency = "200 Hz"\n'
    (tmp_path / "scenario.toml").write_text(source.inputs["scenario"].text + shaping)
    return load_scenario(tmp_path, source.inputs["device"].path)


def test_a_shaped_motion_is_refused(shaped):
    with pytest.raises(InputError, match="shaping: asks for a shaped motion, for which the fastest path is not"):
        ctrlgen.fastest(shaped)


def test_set_points_are_not_shaped_again(shaped):
    model = build_model(shaped.device)
    samples = np.linspace(0, 1e-6, 9)[:, None] * np.ones(len(model.signals[shaped.file.follow].channels))
    again = retimed(shaped, model, samples, shaped.file.sample_rate, "set-points")
    assert np.array_equal(again.bind(model).samples, samples)


def test_a_path_that_cannot_even_be_held_is_explained(tmp_path):
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace('"20 um"\ncentre', '"60 um"\ncentre')
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path, SCENARIOS / "devices" / "mems_hexapod.toml")
    with pytest.raises(ctrlgen.Unreachable, match="the actuator only pushes"):
        ctrlgen.fastest(scenario)


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
