"""The slopes carried from step to step against those of the whole sample, and what a fit asks of them."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE, DEVICE
from play_records import SERVO

from ctrlgen import load_device
from ctrlgen.devices.servo import Servo
from ctrlgen.estimation import sample_equations
from ctrlgen.estimation.forward_sensitivities import reached_entries, shortest_jacobian
from ctrlgen.estimation.hypothesis import hypotheses, nominal_physics
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.model import integrators
from ctrlgen.numerics.levenberg_marquardt import levenberg_marquardt
from ctrlgen.recordings.recording import Record

H, N = 1e-3, 300
AXIS = AXIS_FILE.read_text()
LOOP = '\n[loop]\nposition_gain = "60 1/s"\nvelocity_gain = "20 V/(m/s)"\nintegral_gain = "5e4 V/(m*s)"\n'
SHAPES = {
    "creep": {"gain": 0.05, "tau": 0.1, "slow": 0.2},
    "log_creep": {"gain": 0.05, "tau": 0.01, "decades": 2.0},
    "bouc_wen": {"stiffness": 1e4, "reach": 3e-5, "loop": 0.9},
    "resonance": {"stiffness": 2e4, "frequency": 160.0, "damping": 0.1},
    "coulomb": {"force": 0.5, "reach": 1e-6, "smoothing": 1e-3},
}


def simulator(text, effects, linear, folder) -> tuple[Simulator, np.ndarray]:
    """Of a device with some effects, all their parameters free, and where these start."""
    (folder / "device.toml").write_text(text)
    device, channel = load_device(folder / "device.toml"), "reading.axis"
    structure = Structure(device)
    for h in hypotheses(device, nominal_physics(device), (channel,), H, False):
        if h.effect in effects:
            structure = structure.with_cause(h, SHAPES[h.effect])
    assert len(structure.causes) == len(effects)
    free = [unknown.path for unknown in structure.free_parameters]
    return Simulator(structure.device_with_causes, free, (channel,), H, linear), structure.start


def record(amplitude) -> Record:
    t = H * np.arange(N)
    u = amplitude * (np.sin(2 * np.pi * 7 * t) + 0.3 * np.sin(2 * np.pi * 31 * t + 1))
    return Record("fit", "fit", t, H, u[:, None], np.zeros((N, 1)), False, None, np.ones((N, 1), bool))


def differentiated(r: Simulator, moved: Record, p: np.ndarray) -> np.ndarray:
    """dy/dp and dy/dstart (n, n_y, m): D+ = F_S D + F_p, with whole samples differentiated by CasADi, through the steps that find a
    root."""
    q = r.equations
    by, values = [q.given[0], q.given[4]], q.roots.inserted([q.following, q.y])
    slopes = ca.Function("slopes", q.given, [ca.jacobian(value, s) for value in values for s in by])
    after, _ = r.simulate_states(moved, p)
    before = np.vstack([r.initial_state(moved, p), after[:-1]])
    c, c_p = q.constants(p)
    starts = len(r.free_initial_states)
    D, Y = np.zeros((r.n_s, len(p) + starts)), []
    D[list(r.free_initial_states), len(p) + np.arange(starts)] = 1.0
    entering = np.hstack([c_p.full(), np.zeros((len(c.full()), starts))])
    for S, u, u_next, e in zip(before, *r.inputs(moved), strict=True):
        F_S, F_c, H_S, H_c = (value.full() for value in slopes(S, u, u_next, e, c))
        Y.append(H_S @ D + H_c @ entering)
        D = F_S @ D + F_c @ entering
    return np.array(Y)


def linearised(r: Simulator, moved: Record, p: np.ndarray) -> np.ndarray:
    """dy/dp (n, n_y, m) from the motion linearised sample by sample."""
    after, _ = r.simulate_states(moved, p)
    before = np.vstack([r.initial_state(moved, p), after[:-1]])
    F_S, F_p, H_S, H_p = r.linearise(p, range(len(p))).evaluate_along(before, *r.inputs(moved))
    D, Y = np.zeros((r.n_s, len(p))), []
    for k in range(N):
        Y.append(H_S[k] @ D + H_p[k])
        D = F_S[k] @ D + F_p[k]
    return np.array(Y)


def agree(found: np.ndarray, wanted: np.ndarray) -> None:
    size = np.abs(wanted).max(axis=(0, 1))
    assert np.all(size > 0)
    assert np.all(np.abs(found - wanted).max(axis=(0, 1)) < 1e-10 * size)


@pytest.mark.long
@pytest.mark.parametrize("worth", [SIMULATION.parametric_operations, -1], ids=["parameters", "constants"])
@pytest.mark.parametrize("linear", [False, True], ids=["held", "linear"])
@pytest.mark.parametrize("steps", [pytest.param(1, marks=pytest.mark.exhaustive), 3])
@pytest.mark.parametrize("text, size", [(AXIS, 1.0), (AXIS + LOOP, 4e-5)], ids=["open", "loop"])
@pytest.mark.parametrize(
    "effects",
    [("creep", "bouc_wen", "resonance", "coulomb"), ("log_creep", "coulomb"), ("creep", "bouc_wen", "resonance")],
)
def test_carried_slopes_are_those_of_the_whole_sample(monkeypatch, tmp_path, effects, text, size, steps, linear, worth):
    monkeypatch.setattr(integrators, "substeps", lambda *_: steps)
    # To the end: where N is solved for, slopes of steps on the way are others
    monkeypatch.setattr(integrators, "VELOCITY_NEWTON_STEPS", 14)
    monkeypatch.setattr(sample_equations, "SIMULATION", replace(SIMULATION, parametric_operations=worth))
    r, p = simulator(text, effects, linear, tmp_path)
    assert isinstance(r.equations.integrator, integrators.ImplicitRadau) == ("coulomb" in effects)
    assert r.equations.model.held.numel() == ("loop" in text)
    moved = record(size)
    y, Y = r.sensitivities(moved, p)
    agree(Y, differentiated(r, moved, p))
    agree(linearised(r, moved, p), Y[:, :, : len(p)])
    assert np.allclose(y, r.simulate(moved, p), rtol=0, atol=1e-12 * np.abs(y).max())
    alone = r.sensitivities(moved, p, by_free=False)[1]
    agree(alone, Y[:, :, len(p) :])


def test_slopes_of_plays_before_creep_are_few_and_those_of_the_whole_sample():
    device, shapes = (
        Servo(**SERVO, transducer={"gain": "1 um/V", "drive_limit": "100 V"}),
        {
            "butterfly": {"reach": 40.0, "taper": 0.5, "linear": 0.0, "share": 0.3},
            "log_creep": {"tau": 0.01, "decades": 2.0, "gain": 0.1},
            "home_offset": {"offset": 1e-6},
        },
    )
    structure = Structure(device)
    for h in hypotheses(device, nominal_physics(device), ("reading.axis",), H, False):
        if h.effect in shapes:
            structure = structure.with_cause(h, shapes[h.effect])
    free, p = [unknown.path for unknown in structure.free_parameters], structure.start
    r = Simulator(structure.device_with_causes, free, ("reading.axis",), H, linear=True)
    whole = record(60.0)
    rows = {name: getattr(whole, name)[:20] for name in ("time", "drive", "observed", "valid")}
    rows["drive"] = rows["drive"] - rows["drive"][0]  # at home, where its first displacement depends on no number
    moved = replace(whole, **rows)
    Y, wanted = r.sensitivities(moved, p)[1], differentiated(r, moved, p)
    assert np.allclose(Y, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max(axis=(0, 1)))
    # an offset of the reading moves no state, and creep no play
    reached = reached_entries(r.equations, len(free), r.free_initial_states)
    offset, gain = (free.index(next(f for f in free if f.endswith(name))) for name in (".offset", ".gain"))
    plays = [k for k, name in enumerate(r.model.x_names) if "_play" in name]
    assert not reached.has_nz(offset, r.n_s - 1) and offset not in reached.row()
    assert len(plays) == 8 and not any(reached.has_nz(gain, k) for k in plays)
    q = r.equations
    usual, short = (f(q.following, q.given[0]) for f in (ca.jacobian, shortest_jacobian))
    operations = [q.one("J", [J]).n_instructions() for J in (usual, short)]
    assert operations[1] < 0.6 * operations[0]
    assert short.sparsity() == usual.sparsity()


def test_slopes_by_a_single_initial_state_are_there():
    device = Servo(**SERVO)
    h = next(
        h for h in hypotheses(device, nominal_physics(device), ("reading.axis",), H, False) if h.effect == "backlash"
    )
    structure = Structure(device).with_cause(h, {"gap": 4e-5})
    free, p = [unknown.path for unknown in structure.free_parameters], structure.start
    r = Simulator(structure.device_with_causes, free, ("reading.axis",), H)
    assert len(r.free_initial_states) == 1
    moved = record(1e-6)  # within the gap
    alone, Y = (r.sensitivities(moved, p, by_free=by_free)[1] for by_free in (False, True))
    agree(alone, Y[:, :, len(p) :])


def test_settled_poses_are_differentiated_in_one_direction(monkeypatch):
    """Both of them took half as long again to write out, for as many operations."""
    monkeypatch.setattr("ctrlgen.estimation.forward_sensitivities.shortest_jacobian", None)
    r = Simulator(Servo(**SERVO), [], ("reading.axis",), np.inf)
    assert r.linearise(np.zeros(0), []) is not None
    assert r.sensitivities(record(1e-6), np.zeros(0))[1].shape[2] == 0


class Counted:
    """A cubic whose slope nearly vanishes where the fit starts, so that its first steps go too far; keeps what is asked."""

    bounds, step_limit, k = (np.array([-9.0]), np.array([9.0])), np.array([np.inf]), 1

    def __init__(self):
        self.residuals, self.slopes = [], []

    def residual(self, x):
        self.residuals.append(float(x[0]))
        return np.array([x[0] ** 3 - 20.0 * x[0] + 30.0])

    def evaluate(self, x):
        self.slopes.append(float(x[0]))
        return np.array([x[0] ** 3 - 20.0 * x[0] + 30.0]), np.array([[3 * x[0] ** 2 - 20.0]])

    def normal_matrix(self, J):
        return J.T @ J


def test_slopes_come_with_the_readings_after_a_good_step_and_wait_after_a_refused_one():
    smooth, bent = Counted(), Counted()
    levenberg_marquardt(smooth, np.array([-6.0]), 40)
    assert not smooth.residuals  # every step was good, and none was simulated without them before
    found = levenberg_marquardt(bent, np.array([2.5]), 40)
    slopes = list(dict.fromkeys(bent.slopes))
    sizes = [abs(x**3 - 20 * x + 30) for x in slopes]
    assert [k for k in range(1, len(sizes)) if sizes[k] > min(sizes[:k])] == [1]  # the first went too far
    assert set(slopes[2:4]) <= set(bent.residuals) and slopes[-1] == found[0]


@pytest.mark.parametrize("dwell", [np.inf, 0.5], ids=["settled", "after a dwell"])
def test_slopes_of_poses_are_those_through_newtons_steps_and_take_a_fifth_of_the_operations(dwell):
    device, channels = load_device(DEVICE), tuple(f"reading.{name}" for name in ("delta_x", "delta_y", "theta_z"))
    shapes = {
        "displacement_hysteresis": {"reach": 5e-6, "taper": 0.5, "linear": 0.0, "share": 0.1, "reversible": 0.1},
        "coupling": {"gain": 0.02},
    }
    structure = Structure(device)
    for h in hypotheses(device, nominal_physics(device), channels, None if np.isinf(dwell) else dwell, True):
        if h.effect in shapes and h.effect not in {c.effect for c in structure.causes}:
            structure = structure.with_cause(h, shapes[h.effect])
    free = [*(u.path for u in structure.free_parameters), "hexapod.height", "stage.half_stage_stiffness"]
    r = Simulator(structure.device_with_causes, free, channels, dwell, poses=True)
    p = np.asarray(r.model.p_nominal, float)
    u = np.random.default_rng(4).uniform(0.02, 0.1, (12, r.model.u.numel()))
    n = len(u)
    moved = Record("fit", "fit", np.arange(n) * 1.0, dwell, u, np.zeros((n, 3)), False, None, np.ones((n, 3), bool))
    Y, wanted = r.sensitivities(moved, p)[1], differentiated(r, moved, p)
    agree(Y[:, :, : len(p)], wanted[:, :, : len(p)])
    # of the plays' beginnings, a share of what is read; most of the plays are turned over by the first pose
    assert np.allclose(Y, wanted, rtol=1e-9, atol=1e-12)
    q = r.equations
    open_, through = [q.following, q.y], q.roots.inserted([q.following, q.y])
    of_root, of_steps = (
        q.one("J", [ca.jacobian(value, s) for value in values for s in (q.given[0], q.given[4])]).n_instructions()
        for values in (open_, through)
    )
    assert of_root < 0.2 * of_steps


def test_what_depends_on_the_devices_numbers_alone_is_differentiated_once_for_all_structures(monkeypatch):
    device, channels = load_device(DEVICE), ("reading.delta_x",)
    own = ["hexapod.height", "hexapod.base_radius"]
    law = next(
        h
        for h in hypotheses(device, nominal_physics(device), channels, None, False)
        if (h.effect, h.location) == ("drive_gain", "actuator:1X")
    )
    with_gain = Structure(device).with_cause(law, {"gain": 0.03})
    operations, plain = [], ca.jacobian

    def counted(value: ca.SX, *by: ca.SX) -> ca.SX:
        operations.append(ca.Function("f", ca.symvar(value), [value]).n_instructions())
        return plain(value, *by)

    monkeypatch.setattr(ca, "jacobian", counted)
    constants = [
        Simulator(d, free, channels, np.inf, poses=True).equations.constants
        for d, free in ((device, own), (with_gain.device_with_causes, [own[1], "effect[0].gain", own[0]]))
    ]
    assert sum(n > SIMULATION.parametric_operations for n in operations) <= 1
    # by central differences: of a step of 1e-5 of 0.02 they are right to 2.5e-7
    step = 1e-5
    for f, p in zip(constants, (np.array([0.02, 0.03]), np.array([0.03, 0.03, 0.02])), strict=True):
        slopes = f(p)[1].full()
        for k, change in enumerate(step * np.eye(len(p))):
            found = (f(p + change)[0].full() - f(p - change)[0].full()).ravel() / (2 * step)
            assert np.abs(found).max() > 0
            assert np.allclose(found, slopes[:, k], rtol=1e-5, atol=1e-6 * np.abs(found).max())
