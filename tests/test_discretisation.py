"""One sample of a model against closed forms and fine integrations that share nothing with it, drives held and linear."""

from __future__ import annotations

from decimal import Decimal, localcontext
from itertools import pairwise
from math import factorial

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import ctrlgen
from ctrlgen import build_model, load_device
from ctrlgen.model.discretisation import balanced, one_step_map
from ctrlgen.numerics.phi_functions import increment, lag_increment, phi_matrices

H, TAU = 2e-3, 5e-3
ROUNDING = 1e-12  # of the largest value: what double precision leaves after some hundred operations


def pushed(*effects: dict, rates=None, force=None, tau: str = "5 ms", **parameters):
    """A stage in balance on a spring of 1 N/m, pushed by x' = (u - x)/tau, or by the `rates` and `force` given."""
    return ctrlgen.user_device(
        "pushed",
        parameters={"tau": tau, "spring": "1 N/m", **parameters},
        drive={"motor": "1 N"},
        axes={"way": "1 m"},
        state={"push": "1 N"},
        rates=rates or (lambda u, x, p: (u.motor - x.push) / p.tau),
        force=force or (lambda x: x.push),
        restoring_force=lambda d, p: p.spring * d.way,
        effect=list(effects),
    )


def walked(model, u: np.ndarray, h: float, linear: bool) -> tuple[np.ndarray, np.ndarray]:
    """States (n, n_x) and displacements (n, n_z) at the samples of the drive (n, n_u), from rest, in balance with the first drive."""
    one = one_step_map(model, h, linear)
    step = ca.Function("step", [model.x, model.z, model.u, one.u_next, model.p], [one.x, one.z])
    x, z = ca.DM(model.rest), ca.DM.zeros(model.z.numel())
    if not model.inertial:
        z = ca.Function("start", [model.x, model.z, model.u], [balanced(model, model.x, model.u)])(x, z, u[0])
    xs, zs = [x], [z]
    for before, after in pairwise(u):
        x, z = step(x, z, before, after, model.p_nominal)
        xs.append(x)
        zs.append(z)
    return np.hstack([x.full() for x in xs]).T, np.hstack([z.full() for z in zs]).T


def test_a_pose_is_read_at_the_end_of_its_dwell():
    """The push settles in a small part of the dwell; a joint then creeps toward where it was held."""
    dwell, slow, gain = 4.0, 7.0, 0.3
    model = build_model(
        pushed({"kind": "creep", "at": "way", "gain": gain, "tau": f"{slow} s", "slow": 0.0}, tau="1 ms")
    )
    one = one_step_map(model, dwell, poses=True)
    seen = model.signals["displacement"].expr
    step = ca.Function("step", [model.x, model.z, model.u, one.u_next, model.p], [one.x, one.z])
    read = ca.Function("read", [model.x, model.z], [seen])
    x, z, u, crept = ca.DM(model.rest), ca.DM.zeros(1), 0.0, 0.0
    for held in (0.4, 0.9, 0.1, 0.1):
        x, z = step(x, z, u, held, model.p_nominal)
        crept += (held - crept) * (1 - np.exp(-dwell / slow))
        assert abs(float(z) - held) < ROUNDING and abs(float(read(x, z)) - (held + gain * crept)) < ROUNDING
        u = held


def lti(A: np.ndarray, B: np.ndarray, u: np.ndarray, h: float, linear: bool) -> np.ndarray:
    """x' = A x + B u, (n, n_x), by one exponential of the states with the drive and its slope as further ones (Van Loan)."""
    n = len(A)
    large = np.zeros((n + 2, n + 2))
    large[:n, :n], large[:n, n], large[n, n + 1] = A, B, 1.0
    whole = expm(h * large)
    x = [np.zeros(n)]
    for before, after in pairwise(u):
        slope = (after - before) / h if linear else 0.0
        x.append((whole @ np.concatenate([x[-1], [before, slope]]))[:n])
    return np.array(x)


def broken_line(count: int) -> np.ndarray:
    return np.random.default_rng(3).uniform(-1, 1, count)


def test_a_lag_follows_a_ramp_as_its_closed_form():
    """x = s (t - tau (1 - e^(-t/tau))) after a ramp of slope s, 5 ms sampled at 2 ms."""
    t, slope = H * np.arange(40), 12.0
    x, z = walked(build_model(pushed()), slope * t[:, None], H, linear=True)
    exact = slope * (t - TAU * (1 - np.exp(-t / TAU)))
    assert np.abs(x[:, 0] - exact).max() < ROUNDING * exact.max()
    assert np.abs(z[:, 0] - exact).max() < ROUNDING * exact.max()  # in balance with the push there


def ramped_lag(ratio: Decimal) -> float:
    """1 - (1 - e^-r)/r: a lag after one sample of a ramp from 0 to 1, r samples per time constant; fifty digits."""
    with localcontext() as context:
        context.prec = 50
        return float(1 - (1 - (-ratio).exp()) / ratio)


@pytest.mark.parametrize("ratio", ["1e-9", "1e-4", "0.03", "0.99", "1.01", "17", "1e4"])
def test_a_ramp_loses_no_digits_however_long_the_lag_is(ratio):
    """Differences such as e^-r - 1 + r lose all of them for slow lags."""
    x, _ = walked(build_model(pushed(tau=f"{H / float(ratio)!r} s")), np.array([[0.0], [1.0]]), H, linear=True)
    assert x[1, 0] == pytest.approx(ramped_lag(Decimal(ratio)), rel=ROUNDING)


CHAIN = (
    {"kind": "thermal_lag", "at": "motor", "share": "0.3", "tau": "7 ms", "second": "0.2"},
    {"kind": "creep", "at": "way", "gain": "0.2", "tau": "11 ms", "slow": "0.25"},
    {"kind": "low_pass", "at": "way", "share": "1", "tau": "3 ms", "damping": "0.7"},
)


def chain() -> tuple[np.ndarray, np.ndarray]:
    """A and B of the chain: push; v, w, x of the lag; z, w of the creep; w, v of the filter."""
    A, B = np.zeros((8, 8)), np.zeros(8)
    A[0, 0], A[0, 3], B[0] = -1 / TAU, 0.3 / TAU, 0.7 / TAU
    for k, tau in enumerate((7e-3, 1.4e-3, 0.36 * 1.4e-3)):
        A[1 + k, 1 + k] = -1 / tau
        if k:
            A[1 + k, k] = 1 / tau
        else:
            B[1] = 1 / tau
    A[4, [0, 4]] = np.array([1, -1]) / 11e-3
    A[5, [0, 5]] = np.array([1, -1]) / 44e-3
    read = np.zeros(8)
    read[[0, 4, 5]] = 1.0, 0.2 * 0.75, 0.2 * 0.25
    A[6, 7] = 1 / 3e-3
    A[7] = read / 3e-3
    A[7, 6], A[7, 7] = -1 / 3e-3, -1.4 / 3e-3
    return A, B


@pytest.mark.parametrize("h", [1e-4, 2e-3, 0.05])
def test_a_chain_of_lags_under_a_linear_drive_is_exact(h):
    """Heat behind the drive, creep of the displacement and a sensor's filter, which follow the drive through the balance."""
    u = broken_line(30)
    x, _ = walked(build_model(pushed(*CHAIN)), u[:, None], h, linear=True)
    exact = lti(*chain(), u, h, linear=True)
    assert np.abs(x - exact).max() < 10 * ROUNDING * np.abs(exact).max()  # up to ten doublings


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
def test_what_follows_a_displacement_that_follows_at_once_is_exact(linear):
    """Creep of a stage whose force is the drive itself: nothing but the displacement tells it of the drive."""
    stage = ctrlgen.user_device(
        "direct",
        parameters={"spring": "2 N/m"},
        drive={"motor": "1 N"},
        axes={"way": "1 m"},
        force=lambda u: u.motor,
        restoring_force=lambda d, p: p.spring * d.way,
        effect=list(CHAIN[1:2]),
    )
    u = broken_line(30)
    x, z = walked(build_model(stage), u[:, None], H, linear)
    A, B = np.diag([-1 / 11e-3, -1 / 44e-3]), np.array([0.5 / 11e-3, 0.5 / 44e-3])
    assert np.abs(x - lti(A, B, u, H, linear)).max() < ROUNDING
    assert z[1:, 0] == pytest.approx(u[1:] / 2, rel=ROUNDING)


def test_heat_that_goes_with_the_square_of_a_linear_drive_is_exact():
    """x' = (u^2 - x)/tau with u = s t: x = s^2 (t^2 - 2 tau t + 2 tau^2 (1 - e^(-t/tau)))."""
    device = pushed(rates=lambda u, x, p: (u.motor**2 - x.push) / p.tau)
    t, slope = H * np.arange(30), 15.0
    x, _ = walked(build_model(device), slope * t[:, None], H, linear=True)
    exact = slope**2 * (t**2 - 2 * TAU * t - 2 * TAU**2 * np.expm1(-t / TAU))
    assert np.abs(x[:, 0] - exact).max() < ROUNDING * exact.max()


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
def test_rates_that_are_not_linear_are_of_second_order(linear):
    """A heater whose resistance rises with its temperature: half the sample time leaves a quarter of the error."""
    device = pushed(rates=lambda u, x, p: (u.motor**2 / (1 + 0.8 * x.push) - x.push) / p.tau)
    model, span, pieces = build_model(device), 16e-3, 8
    corners = np.abs(broken_line(pieces + 1))
    x, off = np.zeros(1), []
    for k in range(pieces):
        begin, end = corners[k], corners[k + 1] if linear else corners[k]

        def rhs(t, y, begin=begin, end=end):
            u = begin + (end - begin) * t / (span / pieces)
            return (u**2 / (1 + 0.8 * y) - y) / TAU

        x = solve_ivp(rhs, (0, span / pieces), x, rtol=1e-11, atol=1e-13).y[:, -1]
    for fine in (2, 4, 8):
        place = np.arange(pieces * fine + 1) / fine
        u = np.interp(place, np.arange(pieces + 1), corners) if linear else corners[place.astype(int)]
        off.append(abs(walked(model, u[:, None], span / pieces / fine, linear)[0][-1, 0] - x[0]))
    assert off[0] / off[1] > 3.5 and off[1] / off[2] > 3.5


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
@pytest.mark.parametrize("h", [1e-4, 1e-3, 6e-3])
def test_a_linear_stage_with_inertia_moves_as_its_matrix_exponential(h, linear):
    u = broken_line(40)
    x, z = walked(build_model(load_device(AXIS_FILE)), u[:, None], h, linear)
    A = np.array([[-30 / 0.5, -2e5 / 0.5], [1, 0]])  # velocity, displacement; kg, N s/m, N/m, N/V
    exact = lti(A, np.array([10 / 0.5, 0]), u, h, linear)
    assert np.abs(z[:, 0] - exact[:, 1]).max() < ROUNDING * np.abs(exact[:, 1]).max()
    assert np.abs(x[:, 0] - exact[:, 0]).max() < ROUNDING * np.abs(exact[:, 0]).max()


# k3: a sixth stiffer at the end of the travel, so that no contact asks for steps
MASS, DAMPING, STIFFNESS, MOTOR, K3 = (
    0.5,
    30.0,
    2e5,
    10.0,
    2e12,
)
AXIS = AXIS_FILE.read_text()
PIECES, COARSE = 24, 4e-3


def corners() -> np.ndarray:
    return 1.5 * np.sin(1.9 * np.arange(PIECES + 1))


def on(samples: int, linear: bool) -> np.ndarray:
    """The one drive of the tests below, `samples` per 4 ms."""
    place = np.arange(PIECES * samples + 1) / samples
    u = np.interp(place, np.arange(PIECES + 1), corners()) if linear else corners()[place.astype(int)]
    return u[:, None]


def exactly(force, linear: bool, states: int = 2) -> np.ndarray:
    """Displacement at the corners by scipy's integration of eighth order; `force` (y) -> N and the further states' rates."""
    y, found = np.zeros(states), [0.0]
    for begin, end in pairwise(corners()):

        def rhs(t, y, begin=begin, end=end if linear else begin):
            extra, *rates = force(y)
            push = MOTOR * (begin + (end - begin) * t / COARSE)
            return [y[1], (push - STIFFNESS * y[0] - DAMPING * y[1] + extra) / MASS, *rates]

        y = solve_ivp(rhs, (0, COARSE), y, method="DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
        found.append(y[0])
    return np.array(found)


def axis_with(effect: str, folder):
    (folder / "device.toml").write_text(f"{AXIS}\n[[effect]]\nat = 'axis'\n{effect}")
    return build_model(load_device(folder / "device.toml"))


def hardening(y):
    return (-K3 * y[0] ** 3,)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def nothing(y):
    return (0.0,)


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
def test_explicit_steps_are_of_fourth_order(tmp_path, linear):
    """A flexure that hardens, stepped once a sample; half the sample time leaves a sixteenth of the error."""
    model = axis_with(f"kind = 'stiffening'\nk3 = '{K3} N/m^3'", tmp_path)
    exact, off = exactly(hardening, linear), []
    for samples in (8, 16, 32):
        found = walked(model, on(samples, linear), COARSE / samples, linear)[1][::samples, 0]
        off.append(rms(found - exact))
    assert off[0] / off[1] > 12 and off[1] / off[2] > 12  # sixteen in the limit


@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
@pytest.mark.parametrize("samples", [1, 2])
def test_a_sample_longer_than_the_motion_is_split_until_a_force_is_right_to_a_thousandth(tmp_path, samples, linear):
    """The stage turns by 2.5 or by 1.3 rad a sample."""
    model = axis_with(f"kind = 'stiffening'\nk3 = '{K3} N/m^3'", tmp_path)
    exact = exactly(hardening, linear)
    effect = exact - exactly(nothing, linear)
    found = walked(model, on(samples, linear), COARSE / samples, linear)[1][::samples, 0]
    assert rms(found - exact) < 1e-3 * rms(effect)


def rubbing(force: float, reach: float, smoothing: float):
    """Coulomb's law of the library written out: bristles z of full force `force`."""

    def law(y):
        slow = np.sqrt((y[1] / smoothing) ** 2 + 1e-12)
        return -force * y[2], (y[1] - smoothing * slow / np.tanh(slow) * y[2]) / reach

    return law


RUBBING = (2.0, 3e-6, 20e-3)  # N, m, m/s: bristles that bend over a good part of the travel and slide gently


@pytest.mark.long
@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
def test_steps_of_dry_friction_are_of_second_order(tmp_path, linear):
    force, reach, smoothing = RUBBING
    model = axis_with(
        f"kind = 'coulomb'\nforce = '{force} N'\nreach = '{reach} m'\nsmoothing = '{smoothing} m/s'", tmp_path
    )
    exact, off = exactly(rubbing(*RUBBING), linear, 3), []
    for samples in (16, 32, 64):  # four steps a sample at least
        found = walked(model, on(samples, linear), COARSE / samples, linear)[1][::samples, 0]
        off.append(rms(found - exact))
    assert off[0] / off[1] > 3.3 and off[1] / off[2] > 3.3  # four in the limit


@pytest.mark.long
@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
@pytest.mark.parametrize("samples", [1, 2])
def test_dry_friction_that_reverses_gently_is_right_to_a_thousandth_however_long_the_sample(tmp_path, samples, linear):
    force, reach, smoothing = RUBBING
    model = axis_with(
        f"kind = 'coulomb'\nforce = '{force} N'\nreach = '{reach} m'\nsmoothing = '{smoothing} m/s'", tmp_path
    )
    exact = exactly(rubbing(*RUBBING), linear, 3)
    effect = exact - exactly(nothing, linear)
    found = walked(model, on(samples, linear), COARSE / samples, linear)[1][::samples, 0]
    assert rms(found - exact) < 1e-3 * rms(effect)


def test_bristles_are_found_beside_other_memories(tmp_path):
    """Creep has two, before them."""
    text = "kind = 'creep'\ngain = '0.1'\ntau = '1 s'\nslow = '0.1'\n[[effect]]\nat = 'axis'\n"
    model = axis_with(f"{text}kind = 'coulomb'\nforce = '1 N'\nreach = '1 um'\nsmoothing = '1 mm/s'", tmp_path)
    assert [model.x_names[i] for i in model.bristles] == ["coulomb_1_z_axis"]


def series(a: float, k: int) -> float:
    """phi_k(a) by its series, fifty digits."""
    with localcontext() as context:
        context.prec = 60
        return float(sum(Decimal(a) ** j / factorial(j + k) if j else Decimal(1) / factorial(k) for j in range(160)))


NUMBERS = [-20.0, -3.0, -1e-3, -1.000001, -0.999999, -0.2, -1e-7, 0.0, 1e-5, 0.7, 2.0]


@pytest.mark.parametrize("a", NUMBERS)
def test_the_phi_functions_are_their_series(a):
    """Of a number, of a matrix with that eigenvalue, and as a model's steps apply them."""
    wanted = [series(a, k) for k in range(4)]
    assert [float(value[0, 0]) for value in phi_matrices(np.array([[a]]), 3)] == pytest.approx(wanted, rel=1e-12)
    T = np.array([[1.0, 2.0], [0.5, -1.0]])
    M = T @ np.diag([a, -0.4]) @ np.linalg.inv(T)
    exact = [T @ np.diag([value, series(-0.4, k)]) @ np.linalg.inv(T) for k, value in enumerate(wanted)]
    size = max(1.0, abs(a))  # a matrix as large as this loses so many digits
    for found, value in zip(phi_matrices(M, 3), exact, strict=True):
        assert np.abs(found - value).max() < 1e-13 * size * max(1.0, np.abs(value).max())
    apart = np.zeros((4, 4))  # states that neither move nor push stand between them
    apart[np.ix_([0, 2], [0, 2])] = M
    for k, (found, value) in enumerate(zip(phi_matrices(apart, 3), exact, strict=True)):
        assert np.array_equal(found[1::2, 1::2], np.eye(2) / factorial(k)) and not found[::2, 1::2].any()
        assert np.abs(found[::2, ::2] - value).max() < 1e-13 * size * max(1.0, np.abs(value).max())
    h, v = 0.1, np.eye(2)[0]
    halvings = max(0, int(np.ceil(np.log2(np.abs(M).sum(axis=1).max()))))
    for k in range(3):
        values = [ca.SX(v * (j == k)) for j in range(3)]
        lags = ca.DM(lag_increment(ca.SX([a / h, -0.4 / h]), values, h)).full().ravel()
        assert lags[0] == pytest.approx(h * wanted[k + 1] * v[0], rel=1e-13)
        coupled = ca.DM(increment(ca.SX(M / h), values, h, halvings)).full().ravel()
        assert np.abs(coupled - h * exact[k + 1] @ v).max() < 1e-13 * size * h * max(1.0, np.abs(exact[k + 1]).max())
