"""More drives than axes: the drives of least effort within every limit. The references are numpy's pseudo-inverse, scipy's linear
programmes for what can be followed, and scipy's SLSQP for the drives."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linprog, minimize, nnls
from three_stacks import HIGH, LOW, RANGE, WEIGHTS, B, W, can_push, circle, forces, heavy, loaded, reference, stage

from ctrlgen import InputError, Unreachable, build_model, solve, user_device
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.trajectory.inverse.choice import choose_inverse
from ctrlgen.trajectory.inverse.clock import Sampled
from ctrlgen.trajectory.inverse.drive_programmes import diagonal, least_worst, limited_rows

NEAR = 1e-5  # ranges: where IPOPT leaves what is at a limit


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_within_the_limits_the_drives_are_those_of_the_weighted_pseudo_inverse(tmp_path, weights):
    solution = solve(*loaded(tmp_path, stage(drive_weight=weights), circle(2, 12, 2)))
    R = np.diag(RANGE / np.sqrt(W if weights else np.ones(3)))
    held = np.roll(solution.command, -1, axis=0)
    assert np.allclose(solution.drive, forces(held) @ (R @ np.linalg.pinv(B @ R)).T, rtol=0, atol=1e-9)  # V: rounding
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-15


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_at_limits_the_drives_are_the_best_admissible_ones(tmp_path, weights):
    """The circle takes b below zero, and a above its limit, if they were free."""
    scenario, model = loaded(tmp_path, stage(drive_weight=weights), circle(33))
    solution = solve(scenario, model)
    w = W if weights else np.ones(3)
    R = np.diag(RANGE / np.sqrt(w))
    wanted = forces(np.roll(solution.command, -1, axis=0))
    free = wanted @ (R @ np.linalg.pinv(B @ R)).T
    assert np.any(free < LOW - 1) or np.any(free > HIGH + 1)  # else nothing is tested
    assert np.all(solution.drive >= LOW) and np.all(solution.drive <= HIGH)
    assert np.allclose(solution.drive @ B.T, wanted, rtol=0, atol=1e-8)  # N: of 20 N
    for k in range(0, len(wanted), 7):
        best = reference(wanted[k], w)
        assert np.allclose(solution.drive[k], best, rtol=0, atol=1e-3), k  # V: where SLSQP ends
        assert np.sum(w * (solution.drive[k] / RANGE) ** 2) <= np.sum(w * (best / RANGE) ** 2) + 1e-9


@pytest.mark.long
def test_what_can_be_followed_is_what_a_linear_programme_says(tmp_path):
    sizes = [circle(d, x, y) for d in (20, 50, 60) for x in (0, 10) for y in (-12, 0, 12)]
    said, wanted = [], []
    for path in sizes:
        scenario, model = loaded(tmp_path, stage(), path)
        samples = scenario.bind(model).samples
        wanted.append(all(can_push(f) for f in forces(samples)) and np.abs(samples).max() <= 50e-6)
        try:
            solve(scenario, model)
            said.append(True)
        except Unreachable:
            said.append(False)
    assert said == wanted
    assert set(said) == {True, False}


FEW = 'sample_rate = "1 kHz"\nduration = "0.04 s"\n'


@pytest.mark.long
def test_with_a_margin_the_drives_stay_as_far_inside_of_their_ranges(tmp_path):
    """A linear programme with each range narrowed by a tenth of itself at either end, for circles that it takes or not."""
    said, wanted = [], []
    for size, x, y in [(d, x, y) for d in (10, 20, 30, 46) for x in (0, 10) for y in (-10, 0, 10)]:
        scenario, model = loaded(tmp_path, stage(), circle(size, x, y), FEW)
        problem = scenario.bind(model)
        samples = problem.samples
        said.append([problem.inverse.keeps_limits(problem.motion, margin=margin) for margin in (0.0, 0.1)])
        box = [list(zip(LOW + m * RANGE, HIGH - m * RANGE, strict=True)) for m in (0.0, 0.1)]
        wanted.append(
            [all(linprog(np.zeros(3), A_eq=B, b_eq=f, bounds=b).status == 0 for f in forces(samples)) for b in box]
        )
    assert said == wanted
    assert {tuple(both) for both in wanted} == {(True, True), (True, False), (False, False)}


def test_what_cannot_be_followed_is_explained_and_the_alternatives_can(tmp_path):
    scenario, model = loaded(tmp_path, stage(), circle(60))
    with pytest.raises(Unreachable, match=r"drive of \w .*would have to be .* V") as caught:
        solve(scenario, model)
    alternatives = caught.value.infeasibility.alternatives
    assert alternatives
    for path in alternatives.values():
        assert all(can_push(f) for f in forces(path))
    shrunk = next(p for what, p in alternatives.items() if "scaled" in what)
    assert not all(can_push(f) for f in forces(1.02 * shrunk))  # it is near the largest


def test_equilibria_too_have_the_least_effort(tmp_path):
    poses = 'kind = "poses"\npoints = [{ x = "5 um", y = "1 um" }, { x = "-15 um", y = "12 um" }]\n'
    solution = solve(*loaded(tmp_path, stage(), poses, ""))
    for u, f in zip(solution.drive, forces(solution.command), strict=True):
        assert np.allclose(u, reference(f, np.ones(3)), rtol=0, atol=1e-3)


def test_where_a_rate_is_limited_the_drives_are_still_the_least_by_their_weights(tmp_path):
    """Two stacks push one axis, a + b = f in N; b costs four times as much,
    a changes by 3.5 N a sample at most: scipy's SLSQP over all samples."""
    device = user_device(
        "two",
        parameters={"k": "1 N/um"},
        drive={"a": "100 N", "b": "100 N"},
        axes={"x": "50 um"},
        drive_rate={"a": "350 N/s"},
        drive_weight={"b": 4.0},
        force=lambda u: [u.a + u.b],
        restoring_force=lambda d, p: p.k * d.vector,
    )
    f = 10 * np.sin(2 * np.pi * np.arange(12) / 12)
    points = ", ".join(f'{{ x = "{float(v)!r} um" }}' for v in f)
    found = solve(
        *loaded(tmp_path, device, f'kind = "poses"\nperiodic = true\npoints = [{points}]\n', 'sample_rate = "100 Hz"\n')
    )
    held = np.roll(f, -1)
    best = minimize(
        lambda a: np.sum(a**2 + 4 * (held - a) ** 2),
        0.0 * f,
        method="SLSQP",
        options={"ftol": 1e-14},
        constraints=[{"type": "ineq", "fun": lambda a, s=s: 3.5 - s * (a - np.roll(a, 1))} for s in (1, -1)],
    ).x
    assert found.drive[:, 0] == pytest.approx(best, abs=1e-3)  # N, of 8: where SLSQP ends
    assert 0.1 < np.abs(0.8 * held - best).max() < 1  # else nothing is tested


def test_rates_are_kept_by_the_best_drives_of_the_whole_path(tmp_path):
    """What can be followed against a linear programme over all samples, the drives against the conditions of an optimum."""
    timing = 'sample_rate = "200 Hz"\nduration = "0.1 s"\n'
    free = solve(*loaded(tmp_path, stage(), circle(20, 4, 0), timing))
    h, n = 1 / 200, len(free.drive)
    change = np.abs(free.drive - np.roll(free.drive, 1, axis=0)).max(axis=0) / h
    wanted = forces(np.roll(free.command, -1, axis=0))
    S, step = np.kron(np.eye(n), B * RANGE), np.eye(n) - np.roll(np.eye(n), -1, axis=1)
    D = np.kron(step, np.eye(3))[::3] * RANGE[0]
    box = list(zip(np.tile(LOW / RANGE, n), np.tile(HIGH / RANGE, n), strict=True))
    # The lowest rate with which the path can be followed at all
    slowest = (
        linprog(
            np.append(np.zeros(3 * n), 1.0),
            A_eq=np.hstack([S, np.zeros((2 * n, 1))]),
            b_eq=wanted.ravel(),
            A_ub=np.block([[D, -np.ones((n, 1))], [-D, -np.ones((n, 1))]]),
            b_ub=np.zeros(2 * n),
            bounds=[*box, (0, None)],
        ).fun
        / h
    )
    assert slowest < 0.95 * change[0]
    with pytest.raises(Unreachable, match="the path is too fast"):
        solve(*loaded(tmp_path, stage(drive_rate={"a": f"{0.99 * slowest} V/s"}), circle(20, 4, 0), timing))
    rate = 1.01 * slowest
    kept = solve(*loaded(tmp_path, stage(drive_rate={"a": f"{rate} V/s"}), circle(20, 4, 0), timing))
    assert np.abs(kept.drive[:, 0] - np.roll(kept.drive[:, 0], 1)).max() <= rate * h * (1 + 1e-7)
    assert np.allclose(kept.drive @ B.T, wanted, rtol=0, atol=1e-8)
    s = (kept.drive / RANGE).ravel()
    low, high = np.tile(LOW / RANGE, n), np.tile(HIGH / RANGE, n)
    rising, falling = rate * h - D @ s, rate * h + D @ s
    assert np.any(rising < NEAR * RANGE[0]) and np.any(falling < NEAR * RANGE[0])  # else nothing is tested
    # Karush-Kuhn-Tucker: the slope of the effort is balanced by limits that act, each with its own sign. The programme is convex.
    eye, acting = np.eye(3 * n), [S, -S]
    acting += [
        eye[s - low < NEAR],
        -eye[high - s < NEAR],
        -D[rising < NEAR * RANGE[0]] / RANGE[0],
        D[falling < NEAR * RANGE[0]] / RANGE[0],
    ]
    _, left = nnls(np.vstack(acting).T, 2 * s)
    assert left < 1e-5 * np.linalg.norm(2 * s)
    assert np.linalg.norm(2 * s) > 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    "path", [circle(20, 4, 0), 'kind = "line"\nstart = { x = "-9 um" }\nend = { x = "12 um", y = "4 um" }\n']
)
def test_what_few_samples_show_of_a_rate_is_what_a_linear_programme_over_all_says(tmp_path, path):
    """Near the lowest rate that is possible; a search may take what is nearest to it as beyond it, never the other way round."""
    timing = 'sample_rate = "1 kHz"\nduration = "0.3 s"\n'
    n, h = 300, 1e-3
    scenario, model = loaded(tmp_path, stage(), path, timing)
    motion, closed = scenario.bind(model).motion, scenario.closed
    command = motion.position
    begin = [] if closed else [command[:1]]  # the drive that holds the start comes before the first
    wanted = forces(np.vstack([*begin, command[1:], command[:1] if closed else command[-1:]]))
    n = len(wanted)
    step = sp.eye(n) - (sp.eye(n, k=-1) + (sp.eye(n, k=n - 1) if closed else 0))
    D = sp.kron(step.tocsr()[0 if closed else 1 :], [[1.0, 0.0, 0.0]])
    one = np.ones((D.shape[0], 1))
    slowest = (
        linprog(
            np.append(np.zeros(3 * n), 1.0),
            A_eq=sp.hstack([sp.kron(sp.eye(n), B), np.zeros((2 * n, 1))]),
            b_eq=wanted.ravel(),
            A_ub=sp.vstack([sp.hstack([D, -one]), sp.hstack([-D, -one])]),
            b_ub=np.zeros(2 * len(one)),
            bounds=[*list(zip(LOW, HIGH, strict=True)) * n, (0, None)],
        ).fun
        / h
    )
    inverse = [
        choose_inverse(build_model(stage(drive_rate={"a": f"{share * slowest} V/s"})), "pose", Sampled(h))
        for share in (0.5, 0.99, 0.9999, 1.0001, 1.002, 1.5)
    ]
    every = np.arange(len(command))
    assert [i.keeps_limits(motion) for i in inverse] == [False] * 3 + [True] * 3
    searched = [i.keeps_limits(motion, every) for i in inverse]
    assert searched[:3] + searched[4:] == [False] * 3 + [True] * 2


def coarse_programme(rng: np.random.Generator, gaps: np.ndarray):
    """Forces of random samples of `stage`, in shares, and limits of its drives and of the changes of one of them."""
    n, rates = len(gaps), (np.array([-2.0, -np.inf, -np.inf]), np.array([3.0, np.inf, np.inf]))
    shares = np.tile(B * RANGE, (n, 1, 1))
    size = np.linalg.norm(shares, axis=2)
    wanted = rng.uniform(-50, 50, (n, 2)) / size
    return diagonal(shares / size[:, :, None]), wanted.ravel(), limited_rows((LOW, HIGH), rates, RANGE, gaps, n)


def test_what_refutes_one_path_bounds_what_every_other_breaks():
    """Weak duality, for other forces and another pace; at the path itself it is what the programme says."""
    rng, positive = np.random.default_rng(3), 0
    pushed, wanted, limited = coarse_programme(rng, np.full(12, 5.0))
    _, excess, refutation = least_worst(pushed, wanted, limited)
    assert refutation.excess(wanted, limited) == pytest.approx(excess, rel=1e-9) and excess > 0.01
    for _ in range(20):
        _, other, slower = coarse_programme(rng, rng.integers(3, 9, 12).astype(float))
        other = wanted + rng.choice([0.1, 1.0]) * other
        least = refutation.excess(other, slower)
        positive += least > 0.01
        assert least <= least_worst(pushed, other, slower)[1] + 1e-9
    assert positive > 3


@pytest.mark.parametrize(
    "device", [stage(drive_rate={"a": "1 V/ms"}), heavy(drive_rate={"a": "1 V/ms"})], ids=["stage", "heavy"]
)
@pytest.mark.parametrize("path", [circle(20, 4, 0), 'kind = "line"\nend = { x = "12 um", y = "4 um" }\n'])
def test_forces_at_few_samples_are_those_of_the_whole_path(tmp_path, device, path):
    scenario, model = loaded(tmp_path, device, path)
    problem = scenario.bind(model)
    inverse, motion = problem.inverse.inner, problem.motion
    every, few = inverse.trajectory(motion), np.array([0, 3, 41, 99])
    leads = np.roll(every.z, -1, axis=0) if scenario.closed else np.vstack([every.z[1:], every.z[-1:]])
    z, f = inverse.leads_to(motion, few)
    assert np.array_equal(z, leads[few]) and np.array_equal(f, every.u[few])


def test_a_rate_is_kept_where_the_closed_form_breaks_only_another_limit(tmp_path):
    """Free drives would change slowly enough, but b would go below zero, and without it a changes faster."""
    timing = 'sample_rate = "1 kHz"\nduration = "0.1 s"\n'
    path = circle(10)
    R = np.diag(RANGE)
    scenario, model = loaded(tmp_path, stage(), path, timing)
    wanted = forces(np.roll(scenario.bind(model).samples, -1, axis=0))
    steps = [
        np.abs(u - np.roll(u, 1, axis=0))[:, 0].max()
        for u in (wanted @ (R @ np.linalg.pinv(B @ R)).T, solve(scenario, model).drive)
    ]
    assert steps[0] < 0.95 * steps[1]
    rate = (steps[0] + steps[1]) / 2 / 1e-3
    kept = solve(*loaded(tmp_path, stage(drive_rate={"a": f"{rate} V/s"}), path, timing)).drive
    assert np.abs(kept - np.roll(kept, 1, axis=0))[:, 0].max() <= rate * 1e-3 * (1 + 1e-7)
    assert np.all(kept >= LOW) and np.all(kept <= HIGH)
    assert np.allclose(kept @ B.T, wanted, rtol=0, atol=1e-8)


def test_with_inertia_the_held_drives_have_the_least_effort_within_the_limits(tmp_path):
    timing = 'sample_rate = "5 kHz"\nduration = "0.05 s"\n'
    path = 'kind = "line"\nstart = { x = "-12 um", y = "5 um" }\nend = { x = "14 um", y = "-3 um" }\n'
    solution = solve(*loaded(tmp_path, heavy(), path, timing))
    assert np.all(solution.drive >= LOW) and np.all(solution.drive <= HIGH)
    # The goal for devices with inertia
    assert np.abs(solution.trace.signals["pose"] - solution.command).max() < 1e-9 * 50e-6
    pushed = solution.drive @ B.T
    square = np.linalg.pinv(B @ np.diag(RANGE))
    assert np.any(pushed @ square.T * RANGE < LOW - 1)  # b would go below zero
    for k in range(0, len(pushed), 25):
        assert np.allclose(solution.drive[k], reference(pushed[k], np.ones(3)), rtol=0, atol=1e-3)
    weak = heavy(drive={"a": "60 V", "b": ("0 V", "150 V"), "c": ("-20 V", "130 V")})
    with pytest.raises(Unreachable, match=r"drive of \w"):
        solve(*loaded(tmp_path, weak, path.replace("-12", "-16"), timing))


def test_the_reference_controller_takes_the_least_effort_and_keeps_the_drives_limits():
    model = build_model(stage(drive_weight=WEIGHTS))
    controller = controller_of(model, "pose", 1e-3)
    R = np.diag(RANGE / np.sqrt(W))
    state = controller.rest()
    for target in (np.array([12e-6, -2e-6]), np.array([5e-6, 1e-6])):
        step = controller.step(state, target)
        assert step.status == 0
        assert np.allclose(step.drive, R @ np.linalg.pinv(B @ R) @ forces(target), rtol=0, atol=1e-9)
        state = step.state
    far = np.array([-10e-6, 10e-6])  # b would go below zero
    step = controller.step(state, far)
    assert step.status == 0 and np.allclose(step.drive, reference(forces(far), W), rtol=0, atol=1e-3)
    step = controller.step(step.state, np.array([-30e-6, 10e-6]))  # no drives push so
    assert step.status == ControllerStatus.DRIVE
    assert np.all(step.drive >= LOW) and np.all(step.drive <= HIGH)
    assert np.allclose(B @ step.drive, forces(step.displacement), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("other", "what"),
    [
        ({"force": lambda u, p: [p.g * u.a**2, p.g * (u.c - 0.5 * u.b)]}, "not linear in the drives"),
        ({"force": lambda u, p: [p.g * (u.a + u.b + u.c)] * 2}, "independently"),
        (
            {
                "state": {"s": "1 V"},
                "rates": lambda u, x: [u.a - x.s],
                "force": lambda u, x, p: [p.g * x.s, p.g * (u.c + u.b)],
            },
            "states of their own",
        ),
    ],
)
def test_what_has_no_least_effort_is_refused(tmp_path, other, what):
    with pytest.raises(InputError, match=what):
        solve(*loaded(tmp_path, stage(**other), circle(2)))


@pytest.mark.parametrize(
    ("weights", "what"), [({"d": 1.0}, "is no drive"), ({"a": 0.0}, "above zero"), ({"a": "2"}, "above zero")]
)
def test_wrong_weights_are_faults(weights, what):
    with pytest.raises(InputError, match=what):
        stage(drive_weight=weights)


def test_weights_of_as_many_drives_as_axes_are_a_fault():
    with pytest.raises(InputError, match="more drives than axes"):
        stage(drive={"a": "1 V", "b": "1 V"}, force=lambda u: [u.a, u.b], drive_weight={"a": 2.0})
