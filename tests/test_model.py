from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE, effect_device
from scipy.linalg import expm

from ctrlgen import InputError, build_model, load_device, simulate, user_device
from ctrlgen.controller.linearisation import equilibrium, linearise
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.devices.mems_hexapod import matrices
from ctrlgen.effects import Effect
from ctrlgen.model.assembly import symbolic_model
from ctrlgen.model.discretisation import held_step, one_step_map
from ctrlgen.model.effect_terms import REQUIREMENTS
from ctrlgen.physics import thermal_actuator, xy_stage

POSE = np.array([0, 0, 0, 5e-6, -3e-6, 20e-6])
NM = 1e-9


def test_the_steady_state_is_the_static_model_written_out_by_hand(device, model):
    """The flat twin: S1 eq. (4), (9)-(12), (18) as textbook lines with the printed numbers."""
    P = np.array([0.15, 0.15, 0.05, 0.22, 0.05, 0.09])
    T = 22 + 550 * P  # degC
    F = 2 * 15 * (3e-6 + 3e-9 * T) * (T - 22) * 130e9 * 22.3e-6 * 30e-6 * np.sin(0.068)
    K_t = 0.0133373835e6  # N/m, S1 eq. (6)
    d = np.full(6, 1e-5)
    for _ in range(60):  # fixed slope iteration on the force law, referred to the bar
        root = np.sqrt(1e-6 - d**2)
        law = (K_t / 10 + 10 * 10 / (0.178e6 * 1e-6)) * d + 20 * 51577.0 * (d / 1e-3) * (root / 1e-3) * (1e-3 - root)
        d = d + (F - law) / 3500
    pose = matrices(device)["J"] @ d
    settled = simulate(model, np.tile(P, (200, 1)), 1e-3)  # 40 time constants
    assert np.abs(settled.signals["state"][-1] - 273.15 - T).max() < 1e-9  # K
    assert np.abs(settled.signals["force"][-1] - F).max() < 1e-12  # N, of 0.1 N
    assert np.abs(settled.signals["displacement"][-1] - d).max() < 0.01 * NM  # 9 digits of K_t above
    assert np.abs(settled.signals["pose"][-1] - pose)[3:].max() < 0.01 * NM


def test_a_settled_pose_is_where_a_long_simulation_ends():
    """With memories in pairs (a second-order filter), in chains (creep behind the heaters) and all at once (crosstalk)."""
    effects = (
        {"kind": "low_pass", "at": "delta_z", "share": "1", "tau": "20 ms", "damping": "0.7"},
        {"kind": "creep", "at": "1X", "gain": "0.05", "tau": "30 ms", "slow": "0"},
        {"kind": "heat_crosstalk", "at": "all", "share": "0.02"},
    )
    model = build_model(effect_device(*effects))
    P = np.linspace(0.05, 0.3, 6)
    long = simulate(model, np.tile(P, (800, 1)), 1e-3)  # 26 of the longest time constants
    one = one_step_map(model, np.inf)
    f = ca.Function("settled", [model.x, model.z, one.u_next, model.p], [one.x, one.z])
    x, z = model.rest, long.signals["displacement"][-1]
    x, z = f(x, z, P, model.p_nominal)
    read = ca.Function("read", [model.x, model.z, model.u, model.p], [model.signals["reading"].expr])
    assert np.abs(read(x, z, P, model.p_nominal).full().ravel() - long.signals["reading"][-1])[3:].max() < 1e-3 * NM


def test_the_map_of_a_sample_goes_where_a_simulation_goes(model):
    """Powers that jump move nothing at once: the temperature is still what the power before has made it."""
    h, u = 1e-3, np.repeat([[0.1] * 6, [0.4, 0.1, 0.3, 0.2, 0.1, 0.5], [0.05] * 6], 7, axis=0)
    after = one_step_map(model, h, newton_steps=8)
    one = ca.Function("one", [model.x, model.z, model.u, after.u_next, model.p], [after.x, after.z])
    wanted = simulate(model, u, h)
    x, z = model.rest, wanted.signals["displacement"][0]
    for k in range(len(u) - 1):
        x, z = one(x, z, u[k], u[k + 1], model.p_nominal)
        assert np.allclose(z.full().ravel(), wanted.signals["displacement"][k + 1], rtol=1e-9, atol=0)


@pytest.mark.parametrize("h", [1e-4, 1e-3, 2e-2])
def test_a_step_is_exact_for_the_first_order_lag(model, h):
    step = ca.Function("step", [model.x, model.z, model.u], [held_step(model, h)])
    T_0, P = np.linspace(300, 500, 6), np.linspace(0, 1, 6)
    T_end = 295.15 + 550 * P
    exact = T_end + (T_0 - T_end) * np.exp(-h / 5e-3)
    assert step(T_0, 0, P).full().ravel() == pytest.approx(exact, rel=1e-14)  # rounding


def test_a_step_of_coupled_states_equals_the_matrix_exponential(model):
    """States that act on one another: a second lag fed by the first, put together by hand."""
    from dataclasses import replace

    A = np.diag(np.full(6, -200.0)) + np.diag(np.full(5, 80.0), 1)
    coupled = replace(model, rates_of_heat=ca.mtimes(ca.DM(A), model.x) + 1000 * model.u)
    x, u = np.linspace(1, 2, 6), np.linspace(0, 1, 6)
    for h in (2e-3, 0.02, 0.1, 17.0):  # |hA| 0.6, 6, 30, 5000: the dwell of a pose
        exact = expm(h * A) @ x + np.linalg.solve(A, (expm(h * A) - np.eye(6)) @ (1000 * u))
        value = ca.Function("step", [coupled.x, coupled.u], [held_step(coupled, h)])(x, u).full().ravel()
        assert value == pytest.approx(exact, rel=1e-9)  # truncation of the series at order 12
    with pytest.raises(InputError, match="too long"):
        held_step(coupled, 1e6)


def test_states_that_are_not_linear_settle_within_a_dwell(model):
    """dx/dt = 1000 (u - x - x^3/5) + 80 x_k+1, from rest at zero, after more than a thousand time constants."""
    from dataclasses import replace

    y = model.x - model.rest
    rates = 1000 * (model.u - y - y**3 / 5) + 80 * ca.vertcat(y[1:], 0)
    bent = replace(model, rates_of_heat=rates)
    u = np.linspace(0.2, 1, 6)
    value = ca.Function("step", [bent.x, bent.u], [held_step(bent, 17.0)])(bent.rest, u)
    left = ca.Function("rates", [bent.x, bent.u], [rates])(value, u).full().ravel() / 1000
    assert np.abs(left).max() < 1e-4  # one exponential step alone leaves more than a hundredth


def test_the_state_space_has_the_closed_form_gain_and_pole(device, model):
    """pose/P = J (dF/dT / dF/dd) R_th / (1 + tau s) at the equilibrium."""
    x, z, _ = equilibrium(model, POSE)
    system = linearise(model, POSE)
    p = device.values()
    T, d = ca.SX.sym("T"), ca.SX.sym("d")
    F_T = ca.Function("F_T", [T], [ca.jacobian(thermal_actuator.force(T, p.actuator), T)])
    F_d = ca.Function("F_d", [d], [ca.jacobian(xy_stage.force(d, p.stage, p.actuator), d)])
    gain = np.array([float(F_T(t)) / float(F_d(q)) * 550 for t, q in zip(x, z, strict=True)])
    assert system.dcgain() == pytest.approx(matrices(device)["J"] * gain, rel=1e-10, abs=1e-15)
    assert system.poles() == pytest.approx(np.full(6, -200.0), rel=1e-12)
    assert list(system.input_labels) == [f"P_{a}" for a in model.axes] and "delta_z" in system.output_labels


def test_the_state_space_predicts_a_small_step_of_power(model):
    x, _, u = equilibrium(model, POSE)
    du = np.array([0, 0, 1e-6, 0, 0, 0])
    moved = simulate(model, np.tile(u + du, (5, 1)), 1e-3, x).signals["pose"][-1] - POSE
    linear = linearise(model, POSE).dcgain() @ du * (1 - np.exp(-1.0))
    assert moved == pytest.approx(linear, rel=1e-4, abs=1e-18)  # second order: 1e-6 W of 0.1 W


def test_linearising_at_an_unreachable_pose_is_refused(model):
    with pytest.raises(InputError, match="displacement"):
        linearise(model, np.array([0, 0, 0, 1e-5, 0, 0]))


def test_free_parameters_give_the_derivative_that_differences_give(device):
    """Fitting and simulation read the same expression: d pose / d parameter through J's inverses."""
    paths = ["hexapod.wire_length", "hexapod.height", "stage.half_stage_stiffness", "actuator.young"]
    model = build_model(device, free=paths)
    pose, balance = model.signals["pose"].expr, model.balance
    slope = ca.Function("s", [model.x, model.z, model.p], [ca.jacobian(ca.vertcat(pose, balance), model.p)])
    value = ca.Function("v", [model.x, model.z, model.p], [ca.vertcat(pose, balance)])
    x, z = np.full(6, 400.0), np.linspace(1e-5, 4e-5, 6)
    exact = slope(x, z, model.p_nominal).full()
    for k, nominal in enumerate(model.p_nominal):
        h = np.zeros(len(paths))
        h[k] = 1e-4 * nominal
        difference = (value(x, z, model.p_nominal + h) - value(x, z, model.p_nominal - h)).full().ravel() / (2 * h[k])
        # h^2, and 1e-11/h
        assert exact[:, k] == pytest.approx(difference, rel=1e-5, abs=1e-6 * np.abs(difference).max())


def test_a_free_parameter_at_its_nominal_value_changes_nothing(device, model):
    freed = build_model(device, free=["hexapod.height"])
    x, z, u = np.full(6, 350.0), np.full(6, 2e-5), np.full(6, 0.1)
    here, there = freed.evaluate(x, z, u, freed.p_nominal), model.evaluate(x, z, u, [])
    for a, b in zip(here, there, strict=True):
        assert a.full() == pytest.approx(b.full(), rel=1e-12)  # the Jacobian's inverses in another order of rounding


def test_a_voltage_drive_heats_with_its_square(device):
    import tomllib

    from conftest import DEVICE

    from ctrlgen.core.files import validate
    from ctrlgen.devices import Device

    table = tomllib.loads(DEVICE.read_text())
    table["actuator"]["drive"] = "voltage"
    model = build_model(validate(Device.library["mems_hexapod"], table, "in volts"))
    settled = simulate(model, np.full((200, 6), 6.0), 1e-3)
    assert settled.signals["power"][-1] == pytest.approx(36 / 150)
    assert settled.signals["state"][-1] == pytest.approx(295.15 + 550 * 36 / 150, rel=1e-12)
    assert model.u_bounds[1] == pytest.approx(np.sqrt(150.0))
    assert model.signals["drive"].units == ("V",) * 6


def test_heat_crosstalk_is_in_watts_whatever_the_drive():
    """Six heaters at 6 V: each receives its own 36/150 W and a share of the five others'."""
    import tomllib

    from conftest import DEVICE

    from ctrlgen.core.files import validate
    from ctrlgen.devices import Device

    file = tomllib.loads(DEVICE.read_text())
    file["actuator"]["drive"] = "voltage"
    file["effect"] = [{"kind": "heat_crosstalk", "at": "all", "share": "0.02"}]
    model = build_model(validate(Device.library["mems_hexapod"], file, "in volts"))
    settled = simulate(model, np.full((200, 6), 6.0), 1e-3)
    assert settled.signals["power"][-1] == pytest.approx(36 / 150 * 1.1, rel=1e-12)


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("actuator.beams", "count"),
        ("stage.stroke", "no equation"),
        ("actuator.power_limit", "no equation"),
        ("hexapod.stress_limit", "no equation"),
    ],
)
def test_what_is_no_parameter_of_the_motion_cannot_be_free(device, path, says):
    with pytest.raises(InputError, match=says):
        build_model(device, free=[path])


def test_the_ambient_temperature_can_be_free_and_the_rest_follows_it(device):
    model = build_model(device, free=["actuator.ambient"])
    assert model.rest == pytest.approx(295.15)


def test_a_controller_of_a_model_with_free_parameters_uses_their_nominal_values(device, model):

    freed = controller_of(build_model(device, free=["hexapod.height"]), "pose", 1e-3)
    plain = controller_of(model, "pose", 1e-3)
    assert np.array_equal(freed.step(freed.rest(), POSE).drive, plain.step(plain.rest(), POSE).drive)


def test_bounds_as_formulas_follow_free_numbers_and_the_nearer_of_two_limits(device):
    model = symbolic_model(device, ["actuator.power_limit"])
    drive, (low, high) = model.limits[0], model.bounds_formulas[0]
    nearer = replace(
        model,
        limits=(*model.limits, drive, drive),
        bounds_formulas=(*model.bounds_formulas, (low, 0.9 * high), (-1.0, None)),
    )
    for m, share in ((model, 1.0), (nearer, 0.9)):
        bounds = ca.Function("bounds", [m.p], list(m.bounds_formula(m.u)))
        for power in (0.1, 0.2):
            lowest, most = (v.full().ravel() for v in bounds(power))
            assert np.array_equal(lowest, np.zeros(6)) and most == pytest.approx(share * power, rel=1e-15)
    own = ca.Function("bounds", [model.p], list(model.bounds_formula(model.u)))(model.p_nominal)
    assert np.array_equal([v.full().ravel() for v in own], model.u_bounds)


def test_a_device_that_softens_to_nothing_is_refused():
    with pytest.raises(InputError, match="does not rise"):
        build_model(effect_device({"kind": "stiffening", "at": "1X", "k3": "-1e-6 N/um^3"}))


def test_where_a_force_does_not_rise_is_told_in_the_units_of_the_way():
    """A rotor in rad/s, whose stroke is no length."""
    rotor = user_device(
        "fan",
        parameters={"k": "1 (rad/s)/V"},
        drive={"motor": "400 V"},
        axes={"rotor": "400 rad/s"},
        force=lambda u, p: p.k * u.motor,
        restoring_force=lambda d: d.rotor - 1e-4 * d.rotor**3,
    )
    with pytest.raises(InputError, match=r"does not rise at -400 rad/s;"):
        build_model(rotor)


def test_two_effects_of_one_kind_keep_their_own_states():
    creep = {"kind": "creep", "gain": "0.1", "tau": "1 s", "slow": "0"}
    model = build_model(effect_device({**creep, "at": "1X"}, {**creep, "at": "all"}))
    assert len(model.x_names) == 6 + 2 + 12 and len(set(model.x_names)) == 20


@pytest.mark.parametrize("measures", ["reading", "displacement"])
def test_a_loop_is_closed_on_what_it_measures(tmp_path, measures):
    """A sensor that reads 10 % too much misleads the controller that reads it, and no other."""
    text = AXIS_FILE.read_text()
    loop = 'position_gain = "60 1/s"\nvelocity_gain = "20 V/(m/s)"\nintegral_gain = "5e4 V/(m*s)"\n'
    ends = []
    for effect in ("", '\n[[effect]]\nkind = "sensor_gain"\nat = "axis"\ngain = "10 %"\n'):
        (tmp_path / "device.toml").write_text(f'{text}\n[loop]\nmeasures = "{measures}"\n{loop}{effect}')
        model = build_model(load_device(tmp_path / "device.toml"))
        ends.append(simulate(model, np.full((4000, 1), 1e-5), 1e-3).signals["displacement"][-1, 0])
    assert ends[0] == pytest.approx(1e-5, rel=1e-3)
    assert ends[1] == pytest.approx(1e-5 / 1.1 if measures == "reading" else 1e-5, rel=1e-3)


def test_an_effect_that_reads_what_the_device_lacks_is_refused_in_words():
    """Damping on a stage without inertia; every word that a law may require has its phrase."""
    device = effect_device({"kind": "quadratic_damping", "at": "1X", "damping": "1 N*s^2/m^2"})
    with pytest.raises(InputError, match="quadratic_damping does not fit this device: it needs axes with inertia"):
        build_model(device)
    assert {word for law in Effect.library.values() for word in law.requires} <= REQUIREMENTS.keys()
