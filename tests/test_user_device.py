"""A device that its user writes in Python: its ports are named, checked, simulated, diagnosed."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ctrlgen
from ctrlgen.core.errors import InputError
from ctrlgen.core.units import to_si
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.trajectory.solution_plots import draw_path

INERTIA, WEIGHT, DAMPING, MOTOR = 2e-4, 0.02, 4e-4, 0.015
STEP = 2e-3
LAWS = ("coulomb", "creep", "sensor_gain", "stiffening", "quadratic_damping")


def pendulum(**other):
    """A pendulum on a motor, nominal numbers."""
    words = dict(
        parameters={
            "inertia": ("2 kg*cm^2", "0.1 kg*cm^2"),
            "weight": ("20 mN*m", "1 mN*m"),
            "damping": ("4e-4 N*m*s", "0.4e-4 N*m*s"),
            "motor": {"value": "15 mN*m/V", "domain": "actuator", "source": "data sheet"},
        },
        drive={"motor": "2 V"},
        axes={"swing": "60 deg"},
        mass=lambda p: p.inertia,
        force=lambda u, p: p.motor * u.motor,
        restoring_force=lambda d, p: p.weight * ca.sin(d.swing),
        damping_force=lambda v, p: p.damping * v.swing,
    )
    return ctrlgen.user_device("pendulum", **(words | other))


def moved(force, time, drive, mass):
    """Angles [rad] or places [m] (n, axes) by scipy: mass q'' = force(u, q, v), the drive held; nothing of ctrlgen."""
    n, found, state = len(mass), [], np.zeros(2 * len(mass))
    for k, u in enumerate(drive):
        found.append(state[:n])
        end = STEP if k + 1 == len(time) else time[k + 1] - time[k]

        def rhs(_, y, u=u):
            return np.concatenate([y[n:], force(u, y[:n], y[n:]) / mass])

        state = solve_ivp(rhs, (0, end), state, rtol=1e-7, atol=1e-10).y[:, -1]
    return np.array(found)


def recorded(folder, device, force, mass, drives, size, noise):
    """recording.toml with a record to fit and one to hold out: drives in V, readings in the axes' unit."""
    rng, folder = np.random.default_rng(4), folder / device
    folder.mkdir()
    axes, unit = size
    n_u = drives["fit"].shape[1]
    for role, u in drives.items():
        t = STEP * np.arange(len(u))
        y = moved(force, t, u, np.asarray(mass)) + noise * rng.standard_normal((len(u), len(axes)))
        names = ["t", *(f"u{i}" for i in range(n_u)), *axes]
        table = np.column_stack([t, u, y / to_si(1.0, unit)])
        np.savetxt(folder / f"{role}.csv", table, delimiter=",", header=",".join(names), comments="")
    drive_names = {"pendulum": ["motor"], "stage": ["coil_x", "coil_y"]}[device]
    lines = [f'title = "{device}"', f'device = "{device}"', 'kind = "series"', "[columns]"]
    lines += [f'"drive.{name}" = {{ column = "u{i}", unit = "V" }}' for i, name in enumerate(drive_names)]
    sd = f"{noise / to_si(1.0, unit):.9g} {unit}"
    lines += [f'"reading.{axis}" = {{ column = "{axis}", unit = "{unit}", noise = "{sd}" }}' for axis in axes]
    for role in drives:
        lines += ["[[record]]", f'file = "{role}.csv"', f'role = "{role}"', 'time = { column = "t", unit = "s" }']
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    return folder


def drives_of(n_u, size, n=700):
    rng = np.random.default_rng(1)
    t = STEP * np.arange(n)
    fit = [sum(np.sin(2 * np.pi * f * (1 + 0.13 * i) * t + f) for f in (0.7, 1.9, 4.1, 9.0)) for i in range(n_u)]
    held = [np.repeat(rng.uniform(-1, 1, n // 100), 100) for _ in range(n_u)]
    return {"fit": size / 2.5 * np.array(fit).T, "hold_out": size * np.array(held).T}


def test_it_moves_as_scipy_integrates_it():
    drive = drives_of(1, 1.5)["fit"][:300]
    trace = ctrlgen.simulate(ctrlgen.build_model(pendulum()), drive, STEP)

    def force(u, q, v):
        return MOTOR * u - WEIGHT * np.sin(q) - DAMPING * v

    wanted = moved(force, STEP * np.arange(300), drive, np.array([INERTIA]))
    assert np.abs(trace.signals["reading"][:-1] - wanted).max() < 1e-5 * np.abs(wanted).max()


def rhs() -> ca.Function:
    """The same pendulum as somebody's CasADi function of MX, with the parameters it names."""
    angle, rate, volt, inertia, damping = (ca.MX.sym(n) for n in ("angle", "rate", "volt", "J", "c"))
    inside = [angle, rate, volt, inertia, damping]
    a = (MOTOR * volt - WEIGHT * ca.sin(angle) - damping * rate) / inertia
    return ca.Function("rhs", inside, [a], ["d", "v", "u", "inertia", "damping"], ["acceleration"])


def test_a_casadi_function_serves_as_the_right_hand_side():
    own, drive = pendulum(), drives_of(1, 1.5)["fit"][:300]
    given = pendulum(force=None, restoring_force=None, damping_force=None, acceleration=rhs())
    wanted, found = (ctrlgen.simulate(ctrlgen.build_model(d), drive, STEP).signals["reading"] for d in (own, given))
    assert np.allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_an_effect_acts_on_a_right_hand_side_as_on_forces():
    effect = [{"kind": "stiffening", "at": "swing", "k3": "0.02 N*m/rad^3"}]
    own, drive = pendulum(effect=effect), drives_of(1, 1.5)["fit"][:300]
    given = pendulum(force=None, restoring_force=None, damping_force=None, acceleration=rhs(), effect=effect)
    wanted, found = (ctrlgen.simulate(ctrlgen.build_model(d), drive, STEP).signals["reading"] for d in (own, given))
    assert np.allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())


def test_states_of_its_own_may_depend_on_everything():
    """A coil: L i' = V - R i - k v; against scipy."""
    device = pendulum(
        parameters={"inertia": "2 kg*cm^2", "k": "15 mN*m/A", "R": "3 ohm", "L": "20 mH", "weight": "20 mN*m"},
        state={"current": "1 A"},
        rates=lambda x, u, v, p: (u.motor - p.R * x.current - p.k * v.swing) / p.L,
        force=lambda x, p: p.k * x.current,
        damping_force=None,
    )
    model = ctrlgen.build_model(device)
    assert model.signals["state"].channels == ("current",)
    t = STEP * np.arange(200)
    found = ctrlgen.simulate(model, np.ones((200, 1)), STEP).signals["reading"][:200, 0]

    def force(_, y):
        i, q, v = y
        return [(1 - 3 * i - 0.015 * v) / 0.02, v, (0.015 * i - 0.02 * np.sin(q)) / 2e-4]

    wanted = solve_ivp(force, (0, t[-1]), [0, 0, 0], t_eval=t, rtol=1e-9, atol=1e-12).y[1]
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()


@pytest.mark.long
def test_friction_of_a_pendulum_is_found(tmp_path):
    def force(u, q, v):
        return MOTOR * u - WEIGHT * np.sin(q) - DAMPING * v - 2e-3 * np.tanh(v / 0.3)

    drives = drives_of(1, 1.0)
    folder = recorded(tmp_path, "pendulum", force, [INERTIA], drives, (["swing"], "deg"), 2e-4)
    device = pendulum()
    found = ctrlgen.diagnose(device, folder, laws=LAWS)
    assert found.verdict == Verdict.EXPLAINED
    assert [(f.effect, f.location) for f in found.findings] == [("coulomb", "stage:swing")]
    assert found.findings[0].parameters["force"].value == pytest.approx(2e-3, rel=0.05)
    assert {"mechanism.inertia", "effect[0].force"} <= set(found.values)
    numbers = dict(found.corrected.quantities())
    assert numbers["effect[0].force"].si == pytest.approx(2e-3, rel=0.05)
    again = ctrlgen.diagnose(found.corrected, folder, laws=LAWS)
    assert again.findings == ()


def stage():
    """Two coupled axes on flexures, two coils; readings in a frame turned by a fixed angle."""
    return ctrlgen.user_device(
        "stage",
        parameters={
            "mass": ("0.4 kg", "10 g"),
            "kx": ("20 N/mm", "0.5 N/mm"),
            "ky": ("30 N/mm", "0.5 N/mm"),
            "c": ("8 N*s/m", "0.8 N*s/m"),
            "coil": {"value": "5 N/V", "domain": "actuator"},
            "coupling": {"value": "2 N/mm", "domain": "stage"},
        },
        drive={"coil_x": "4 V", "coil_y": "4 V"},
        axes={"x": "1 mm", "y": "1 mm"},
        mass=lambda p: [p.mass, p.mass],
        force=lambda u, p: {"x": p.coil * u.coil_x, "y": p.coil * u.coil_y},
        restoring_force=lambda d, p: [p.kx * d.x + p.coupling * d.y, p.ky * d.y + p.coupling * d.x],
        damping_force=lambda v, p: p.c * v.vector,
    )


@pytest.mark.long
def test_stiffening_of_one_axis_of_two_is_found_there(tmp_path):
    K = np.array([[20e3, 2e3], [2e3, 30e3]])

    def force(u, q, v):
        return 5 * u - K @ q - 8 * v - np.array([0, 1.5e10]) * q**3

    drives = drives_of(2, 3.0)
    folder = recorded(tmp_path, "stage", force, [0.4, 0.4], drives, (["x", "y"], "um"), 2e-7)
    found = ctrlgen.diagnose(stage(), folder, laws=LAWS)
    assert found.verdict == Verdict.EXPLAINED
    assert [(f.effect, f.location) for f in found.findings] == [("stiffening", "stage:y")]
    k3 = found.findings[0].parameters["k3"]
    assert to_si(k3.value, k3.unit) == pytest.approx(1.5e10, rel=0.05)


def test_without_mass_it_stands_in_balance_and_can_be_solved_backward(tmp_path):
    device = ctrlgen.user_device(
        "lever",
        parameters={"k": "2 N/um", "gain": "0.5 N/V", "ratio": "3"},
        drive={"piezo": "100 V"},
        axes={"flexure": "25 um"},
        force=lambda u, p: p.gain * u.piezo,
        restoring_force=lambda d, p: p.k * d.flexure,
        reading={"tip": "75 um"},
        pose=lambda d, p: p.ratio * d.flexure,
    )
    model = ctrlgen.build_model(device, free=["mechanism.ratio"])
    trace = ctrlgen.simulate(model, np.full((3, 1), 40.0), 1e-3)
    assert trace.signals["reading"][-1, 0] == pytest.approx(3 * 0.5 * 40 / 2e6)
    words = 'title = "a line"\ndevice = "lever"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n[path]\nkind = "line"\n'
    (tmp_path / "line.toml").write_text(words + 'start = { tip = "0 um" }\nend = { tip = "30 um" }\n')
    solution = ctrlgen.solve(ctrlgen.load_scenario(tmp_path / "line.toml", device), ctrlgen.build_model(device))
    assert solution.trace.signals["pose"][-1, 0] == pytest.approx(30e-6, rel=1e-6)


def test_every_fault_is_said_at_once():
    with pytest.raises(InputError) as caught:
        pendulum(
            parameters={
                "inertia": "2 kg",
                "a b": "1",
                "odd": "1 flub",
                "weight": ("1 N*m",),
                "motor": {"value": "1 V", "domain": "moon"},
            },
            axes={"swing": "60 deg", "slide": "1 um"},
            drive={"motor": "0 V"},
            force=lambda u, q: 1,
            restoring_force=lambda d, p: [p.wieght, 0],
            damping_force=lambda v: {"swing": 1, "z": 2},
            mass=lambda p: [p.inertia, ca.SX.sym("strange")],
            rates=lambda x: x,
            effect=[{"kind": "nope", "at": "swing"}],
            reading={"tip": "1 um"},
            state={"hot": "20 degC"},
        )
    text = str(caught.value)
    for part in (
        "parameters.a b: is not a name",
        "parameters.odd: 'flub' is not a unit",
        "parameters.weight",
        "domain = 'moon'",
        "axes.slide: '1 um' is not of the dimension of '60 deg'",
        "drive.motor: '0 V' is not a size",
        "state.hot",
        "force: has an argument 'q'",
        "p has no 'wieght'; did you mean 'weight'?",
        "damping_force: returns 'z'",
        "damping_force: returns no 'slide'",
        "mass: contains the symbol 'strange'",
        "pose: is missing",
        "'nope' is not a known effect",
    ):
        assert part in text, part


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"mass": None}, "mass: is missing: damping_force needs"),
        ({"force": None}, "force: is missing"),
        ({"acceleration": rhs()}, "force: and acceleration are both given"),
        ({"force": lambda u: [u.motor, 1]}, "force: returns 2 numbers; 1 needed: swing"),
        ({"force": lambda u: "much"}, "force: returns str"),
        ({"force": lambda u: ca.MX.sym("m")}, "force: returns MX"),
        ({"force": lambda u: u.motr}, "the drive has no 'motr'; did you mean 'motor'?"),
        ({"force": lambda d: 1 / d.swing}, "force: is [inf] at home"),
        ({"mass": lambda p: -p.inertia}, "mass: is [-0.0002]; it must be above zero"),
        (
            {"force": ca.Function("f", [ca.SX.sym("a", 2)], [1], ["u"], ["o"])},
            "input 'u' of f is 2 x 1, and u has 1 (motor)",
        ),
        ({"force": ca.Function("f", [ca.SX.sym("a")], [1], ["w"], ["o"])}, "f has an input 'w'; name its inputs"),
        ({"axes": {}}, "axes: is empty"),
    ],
)
def test_a_wrong_law_is_refused_with_what_to_do(other, said):
    with pytest.raises(InputError) as caught:
        pendulum(**other)
    assert said in str(caught.value)


def test_it_travels_between_processes_where_its_functions_do():
    device = pendulum(
        force=None,
        restoring_force=None,
        damping_force=None,
        acceleration=rhs(),
        mass=ca.Function("mass", [J := ca.SX.sym("J")], [J], ["inertia"], ["m"]),
    )
    other = pickle.loads(pickle.dumps(device))
    assert dict(other.quantities()) == dict(device.quantities())
    drive = np.ones((50, 1))
    a, b = (ctrlgen.simulate(ctrlgen.build_model(d), drive, STEP).z for d in (device, other))
    assert np.array_equal(a, b)


@pytest.mark.parametrize(
    "axes, labels",
    [(("rx",), ["time [s]", "rx [mrad]"]), (("rx", "ry"), ["rx [mrad]", "ry [mrad]"])],
)
def test_a_mirror_that_tilts_is_led_along_a_path_and_drawn_in_its_own_unit(tmp_path, axes, labels):
    """k theta = k_m u: 1 V for each 7.5 mrad."""
    device = ctrlgen.user_device(
        "mirror",
        parameters={"stiffness": ("2 N*m/rad", "0.1 N*m/rad"), "motor": ("15 mN*m/V", "1 mN*m/V")},
        drive=dict.fromkeys(axes, "20 V"),
        axes=dict.fromkeys(axes, "100 mrad"),
        force=lambda u, p: [p.motor * getattr(u, axis) for axis in axes],
        restoring_force=lambda d, p: [p.stiffness * getattr(d, axis) for axis in axes],
    )
    ends = (", ".join(f'{axis} = "{angle * (k + 1)} mrad"' for k, axis in enumerate(axes)) for angle in (0, 15))
    path = '[path]\nkind = "line"\nstart = {{ {} }}\nend = {{ {} }}\n'.format(*ends)
    file = tmp_path / "tilt.toml"
    file.write_text(f'title = "tilt"\ndevice = "mirror"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n{path}')
    solution = ctrlgen.solve(ctrlgen.load_scenario(file, device), ctrlgen.build_model(device))
    assert solution.drive[-1] == pytest.approx([2.0 * (k + 1) for k in range(len(axes))], rel=1e-6)
    left, right = draw_path(solution).axes
    assert [left.get_xlabel(), left.get_ylabel()] == labels and right.get_ylabel() == "modelled - commanded [urad]"
    assert left.lines[0].get_ydata()[-1] == pytest.approx(15.0 * len(axes), rel=1e-6)


def gantry(**other):
    """Two axes that share a mass, moved as told; the forces are read."""
    words = dict(
        parameters={"m": ("8 kg", "0.2 kg"), "shared": "1.5 kg", "c": ("20 N*s/m", "2 N*s/m"), "k": "300 N/m"},
        axes={"x": "200 mm", "y": "150 mm"},
        speed={"x": "1 m/s", "y": "1 m/s"},
        needed_force=lambda d, v, a, p: [
            p.m * a.x + p.shared * a.y + p.c * v.x + p.k * d.x,
            p.m * a.y + p.shared * a.x + p.c * v.y,
        ],
    )
    return ctrlgen.user_device("gantry", **(words | other))


def test_an_imposed_motion_gives_the_force_that_its_user_wrote():
    model = ctrlgen.build_model(gantry())
    assert model.signals["reading"].channels == ("x", "y") and model.signals["drive"].channels[0] == "x_position"
    d, v, a = np.array([0.1, -0.05]), np.array([0.3, 0.2]), np.array([2.0, -1.0])
    reading = ca.Function("reading", [model.x, model.z, model.u], [model.signals["reading"].expr])
    force = reading(np.zeros(0), d, np.concatenate([d, v, a])).full().ravel()
    assert force == pytest.approx([8 * 2.0 - 1.5 + 20 * 0.3 + 300 * 0.1, -8.0 + 1.5 * 2.0 + 20 * 0.2], rel=1e-12)


@pytest.mark.long
def test_a_diagnosis_names_the_friction_of_an_imposed_motion_written_in_python(tmp_path):
    rng = np.random.default_rng(5)
    names = [f"{axis}_{kind}" for kind in ("position", "velocity", "acceleration") for axis in "xy"]
    units = ["m", "m", "m/s", "m/s", "m/s^2", "m/s^2"]
    lines = ['title = "gantry"', 'device = "gantry"', 'kind = "series"', "[columns]"]
    lines += [f'"drive.{n}" = {{ column = "{n}", unit = "{u}" }}' for n, u in zip(names, units, strict=True)]
    lines += [f'"reading.{axis}" = {{ column = "f{axis}", unit = "N" }}' for axis in "xy"]
    for role, n in (("fit", 1200), ("hold_out", 800)):
        t = 2e-3 * np.arange(n)
        w, phase = 2 * np.pi * np.array([1.3, 0.9]), rng.uniform(0, 6, 2)
        d = 0.08 * np.sin(np.outer(t, w) + phase)
        v, a = 0.08 * w * np.cos(np.outer(t, w) + phase), -(w**2) * d
        f = np.column_stack(
            [8 * a[:, 0] + 1.5 * a[:, 1] + 20 * v[:, 0] + 300 * d[:, 0], 8 * a[:, 1] + 1.5 * a[:, 0] + 20 * v[:, 1]]
        )
        f[:, 1] += 6.0 * np.sign(v[:, 1])
        f += 0.1 * rng.standard_normal(f.shape)
        header = ",".join([*names, "fx", "fy"])
        np.savetxt(tmp_path / f"{role}.csv", np.column_stack([d, v, a, f]), delimiter=",", header=header, comments="")
        lines += ["[[record]]", f'file = "{role}.csv"', f'role = "{role}"', 'sample_rate = "500 Hz"']
    (tmp_path / "recording.toml").write_text("\n".join(lines) + "\n")
    found = ctrlgen.diagnose(gantry(), tmp_path, laws=("coulomb", "stiffening", "sensor_gain"))
    first = found.findings[0]
    assert (first.effect, first.location) == ("coulomb", "stage:y") and first.share.value > 0.95
    assert first.parameters["force"].value == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"drive": {"motor": "1 V"}}, "drive: and needed_force are both given"),
        ({"force": lambda u: u.motor}, "force: and needed_force are both given"),
        ({"speed": {"x": "1 m/s"}}, "speed: must be given of each axis: x, y"),
        ({"speed": {"x": "1 m/s", "y": "1 m"}}, "speed.y: '1 m' is no speed"),
        ({"needed_force": lambda d: [1 / d.x, 0]}, "needed_force: is [inf"),
        ({"needed_force": lambda d, q: [0, 0]}, "needed_force"),
    ],
)
def test_an_imposed_motion_that_does_not_fit_is_refused(other, says):
    with pytest.raises(InputError) as caught:
        gantry(**other)
    assert says in str(caught.value)


def test_an_argument_that_does_not_exist_or_is_missing_is_named():
    with pytest.raises(TypeError, match="no argument 'drives'; did you mean 'drive'"):
        pendulum(drives={"motor": "2 V"})
    with pytest.raises(TypeError, match="needs the arguments axes, parameters"):
        ctrlgen.user_device("pendulum")
