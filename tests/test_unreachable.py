"""Paths that cannot be followed: every one is explained, at any size, and what is offered instead can be followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICE
from scipy.optimize import linprog
from unreachable_paths import ABOVE, BACKLASH, CASES, CIRCLE, CREEP, OTHERS

import ctrlgen
from ctrlgen import Unreachable, build_model, load_scenario, solve
from ctrlgen.core.errors import SolverError
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE, primary
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.violations import violations
from ctrlgen.trajectory.optimisation import TrajectoryProgramme

DEVICES = DEVICE.parent


def written(folder, device: str, effects: str, rate: float, duration: float, path: str):
    file = folder / "device.toml"
    file.write_text((DEVICES / f"{device}.toml").read_text() + effects)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "device.toml"\nsample_rate = "{rate} Hz"\nduration = "{duration} s"\n[path]\n{path}\n'
    )
    return load_scenario(folder)


def followed_by_ipopt(model, scenario, command) -> bool:
    """Whether IPOPT, begun far away, finds a trajectory without slack: it knows nothing of the inverse."""
    motion = Motion.of_samples(command, scenario.closed)
    programme = TrajectoryProgramme(model, "pose", motion, scenario.clock)
    try:
        result, _ = programme.optimum()
    except SolverError:  # as it ends without the inverse on many paths that cannot be followed
        return False
    return bool(np.linalg.norm(result.unreachable_by, axis=1).max() < FEASIBILITY_TOLERANCE)


# Those that another one of the same device, and cause, stands for
MORE = (
    "spiral without height",
    "raster without height",
    "lissajous without height",
    "upright circle",
    "circle just too fast",
    "3-RRR, 200 um",
    "3-RRR without bias",
    "meso hexapod, far line",
)


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) if n in MORE else n for n in CASES])
def test_a_path_that_cannot_be_followed_is_explained(tmp_path, name):
    *given, says = CASES[name]
    scenario = written(tmp_path, *given)
    model = build_model(scenario.device)
    with pytest.raises(Unreachable) as caught:
        solve(scenario, model)
    message, found = str(caught.value), caught.value.infeasibility
    assert says in message and f"sample {found.worst} at" in message
    assert found.alternatives
    for what, command in found.alternatives.items():
        assert what in message
        few = command if len(command) < 400 and not given[1] else command[:: max(len(command) // 40, 1)]
        if len(few) == len(command):
            assert followed_by_ipopt(model, scenario, command), what
        else:  # too long for IPOPT from afar, here: every pose alone
            static = TrajectoryProgramme(model, "pose", Motion.of_samples(few), Settled())
            assert np.linalg.norm(static.optimum()[0].unreachable_by, axis=1).max() < FEASIBILITY_TOLERANCE, what


SQUARE_B = 0.2 * np.array([[1.0, 0.5, 0.0], [0.0, -0.5, 1.0]])  # N/V
VOLTS = [(-100.0, 100.0), (0.0, 150.0), (-20.0, 130.0)]


def pushed(path, rate, h, closed):
    """By a linear programme over all samples and drives of `stacks`."""
    n = len(path)
    held = np.roll(path, -1, axis=0) if closed else np.vstack([path[1:], path[-1:]])
    step = np.eye(n) - np.roll(np.eye(n), 1, axis=0)
    change = np.kron(step if closed else step[1:], [[1.0, 0.0, 0.0]])
    allowed = np.full(len(change), np.inf if rate is None else rate * h * (1 + 1e-6))
    found = linprog(
        np.zeros(3 * n),
        A_eq=np.kron(np.eye(n), SQUARE_B),
        b_eq=1e6 * held.ravel(),
        bounds=VOLTS * n,
        A_ub=np.vstack([change, -change]) if rate else None,
        b_ub=np.tile(allowed, 2) if rate else None,
    )
    return found.status == 0


def moved(path, h, mass, damping, stiffness, force, limit):
    """Whether the inverse dynamics of one axis, by differences, stay below the drive's limit."""
    d = path[:, 0]
    v = np.gradient(d, h)
    drive = (mass * np.gradient(v, h) + damping * v + stiffness * d) / force
    return np.abs(drive).max() <= 1.01 * limit  # the differences' error


@pytest.mark.long
@pytest.mark.parametrize("name", OTHERS)
def test_one_of_another_device_is_explained_too(tmp_path, name):
    device, (*changed,), rate, duration, path, says, reference = OTHERS[name]
    file = "device.toml" if isinstance(device, str) else device.name
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{file}"\nsample_rate = "{rate} Hz"\nduration = "{duration} s"\n[path]\n{path}\n'
    )
    if isinstance(device, str):
        text = (DEVICES / f"{device}.toml").read_text()
        assert not changed or changed[0] in text
        (tmp_path / "device.toml").write_text(text.replace(*changed) if changed else text)
        scenario = load_scenario(tmp_path)
    else:
        scenario = load_scenario(tmp_path, device)
    model, h = build_model(scenario.device), 1 / rate
    with pytest.raises(Unreachable) as caught:
        solve(scenario, model)
    message, found = str(caught.value), caught.value.infeasibility
    assert says in message and f"sample {found.worst} at" in message
    assert found.alternatives
    for what, command in found.alternatives.items():
        assert what in message
        if model.redundant:
            assert pushed(command, reference, h, scenario.closed), what
        elif isinstance(reference, tuple):
            assert moved(command, h, *reference), what
        else:
            assert followed_by_ipopt(model, scenario, command), what
    if model.redundant:
        assert not pushed(scenario.bind(model).samples, reference, h, scenario.closed)
    if isinstance(reference, tuple):
        assert not moved(scenario.bind(model).samples, h, *reference)


def test_thirty_are_named():
    assert len(CASES) + len(OTHERS) == 30


def drawn(rng: np.random.Generator, folder):
    """A circle or a line of random size, place and pace, near the edge of what can be followed."""
    n, height = int(rng.integers(8, 24)), rng.uniform(2, 45)
    size = rng.uniform(5, 40)
    if rng.random() < 0.5:
        path = f'kind = "circle"\ndiameter = "{size} um"\ncentre = {{ delta_z = "{height} um" }}'
    else:
        tilt = rng.uniform(-2, 2)
        end = f'{{ delta_x = "{size / 2} um", theta_y = "{tilt} mrad", delta_z = "{height} um" }}'
        path = f'kind = "line"\nstart = {{ delta_z = "{height} um" }}\nend = {end}'
    return written(folder, "mems_hexapod", "", 1000, n * 1e-3, path)


SEEDS = range(24)
QUICK = range(11, 19)  # of both kinds


@pytest.mark.long
@pytest.mark.parametrize("seed", [s if s in QUICK else pytest.param(s, marks=pytest.mark.long) for s in SEEDS])
def test_the_inverse_and_ipopt_agree_on_what_can_be_followed(tmp_path, seed):
    scenario = drawn(np.random.default_rng(seed), tmp_path)
    model = build_model(scenario.device)
    problem = scenario.bind(model)
    kept = problem.inverse.keeps_limits(problem.motion)
    assert kept == followed_by_ipopt(model, scenario, problem.samples)


@pytest.mark.parametrize("seeds", [QUICK, pytest.param(SEEDS, marks=pytest.mark.long)])
def test_the_drawn_paths_are_of_both_kinds(tmp_path, seeds):
    kept = []
    for seed in seeds:
        scenario = drawn(np.random.default_rng(seed), tmp_path)
        problem = scenario.bind(build_model(scenario.device))
        kept.append(problem.inverse.keeps_limits(problem.motion))
    assert len(kept) / 4 < sum(kept) < len(kept) * 3 / 4


def test_what_a_path_needs_is_what_ipopt_finds(circle):
    """The inverse and the optimum are two computations of the same drives."""
    needed = circle.scenario.bind(circle.model).inverse.trajectory(Motion.of_samples(circle.command, closed=True))
    assert needed.exact and not violations(circle.model, needed.x, needed.z, needed.u)
    # W, of 0.3: IPOPT's tolerance is 1e-10 of a sample's typical step
    assert np.abs(needed.u - circle.drive).max() < 1e-7


@pytest.mark.parametrize(("effects", "settles"), [(BACKLASH, True), (CREEP, True)])
def test_memories_are_carried_until_a_closed_path_repeats_or_is_seen_not_to(tmp_path, effects, settles):
    scenario = written(tmp_path, "mems_hexapod", effects, 200, 0.5, CIRCLE.format("20 um") + ABOVE)
    model = build_model(scenario.device)
    problem = scenario.bind(model)
    needed = problem.inverse.trajectory(problem.motion)
    assert needed.solved and needed.exact is settles
    solution = solve(scenario, model)
    assert np.abs(needed.z - solution.trace.z).max() < (1e-12 if settles else 3 * needed.unsettled * 1e-5)


def pair(folder, points, timing="", more="", **words):
    """Two axes in balance with a stiffness of 1 N/um, along listed points."""
    given = dict(
        parameters={"k": "1 N/um"},
        drive={"a": "200 N", "b": "200 N"},
        axes={"x": ("-10 um", "50 um"), "y": ("-50 um", "50 um")},
        force=lambda u: u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
    )
    device = ctrlgen.user_device("pair", **(given | words))
    listed = ", ".join(f'{{ x = "{float(x)!r} um", y = "{float(y)!r} um" }}' for x, y in points)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "pair"\n{timing}[path]\nkind = "poses"\n{more}points = [{listed}]\n'
    )
    return load_scenario(folder, device), build_model(device)


def test_a_smaller_path_keeps_the_middle_between_its_ends_wherever_most_of_its_samples_are(tmp_path):
    """0 um for five samples and 60 um for one, of 50 um at most: about 30 um two thirds fit, from 10 to 50 um. The search ends within a
    five-hundredth of the way to a thousandth on a logarithmic scale, 1.4 %."""
    scenario, model = pair(tmp_path, [(0, 0)] * 5 + [(60, 0)])
    with pytest.raises(Unreachable) as caught:
        solve(scenario, model)
    ((what, smaller),) = ((w, c) for w, c in caught.value.infeasibility.alternatives.items() if "scaled" in w)
    assert "about its middle" in what and (smaller[0, 0] + smaller[-1, 0]) / 2 == pytest.approx(30e-6)
    assert 0.986 * 2 / 3 < np.ptp(smaller[:, 0]) / 60e-6 <= 2 / 3


def test_of_the_ways_into_range_the_shortest_is_offered(tmp_path):
    """The first actuator stands at x + y/2: from 60 um it is brought to 50 um by 10 um of x or 20 um of y. A ten-thousandth of its range
    inside are 10.006 um, of which three digits, rounded so that they suffice, are 10.1."""
    scenario, model = pair(
        tmp_path, [(55, 0), (60, 0)], reading={"x": "50 um", "y": "50 um"}, pose=lambda d: [d.x - 0.5 * d.y, d.y]
    )
    with pytest.raises(Unreachable) as caught:
        solve(scenario, model)
    (shifted,) = (c for w, c in caught.value.infeasibility.alternatives.items() if "shifted" in w)
    assert shifted - scenario.bind(model).samples == pytest.approx(np.tile([-10.1e-6, 0], (2, 1)))


def test_what_memories_may_still_change_is_the_sum_of_what_all_further_periods_bring(tmp_path):
    """A state that forgets with 0.4 s along a path of 0.8 s: what the third period begins with is off where it ends by some length,
    of which e^-2 is left when that period is over. 3 %: a faster state, of which e^-10 is left after a period, shrinks otherwise."""
    creep = {"kind": "creep", "at": "x", "gain": "20 %", "tau": "0.1 s", "slow": "0 %"}
    points = [(10 + 10 * np.cos(t), 0) for t in 2 * np.pi * np.arange(20) / 20]
    scenario, model = pair(tmp_path, points, 'sample_rate = "25 Hz"\n', "periodic = true\n", effect=[creep])
    problem = scenario.bind(model)
    begun, last = (problem.inverse.trajectory(problem.motion, periods) for periods in (3, 400))
    off = np.abs(begun.x[0] - last.x[0]) / model.x_scale
    assert last.exact and not begun.exact
    assert begun.unsettled == pytest.approx(off.max() * np.exp(-2), rel=0.03)


def test_a_margin_is_a_share_of_the_range_of_a_limit(tmp_path):
    """-10 to 50 um: 3 um, a twentieth, are to be left at either end."""
    _, model = pair(tmp_path, [(0, 0)])
    for x, missing in ((46.9e-6, 0.0), (48e-6, 1e-6), (-6.9e-6, 0.0), (-8e-6, 1e-6)):
        z = np.array([[x, 0.0]])
        broken = violations(model, np.zeros((1, 0)), z, 1e6 * z, 0.05)
        assert [v.limit.channels[v.channel] for v in broken] == ["x"] * (missing > 0)
        if broken:
            assert broken[0].beyond == pytest.approx([missing]) and broken[0].share == pytest.approx(missing / 60e-6)
            assert broken[0].bound == pytest.approx(47e-6 if x > 0 else -7e-6)


def test_a_model_may_have_one_limit_or_none(tmp_path):
    """The values of several are a tuple, and of one a matrix, where a function of CasADi is called by its arguments alone."""
    _, model = pair(tmp_path, [(0, 0)])
    z = np.array([[60e-6, 0.0], [0.0, 0.0]])
    stroke = next(
        limit for limit in model.limits if limit.channels == ("x",) and limit.bounds[1] == pytest.approx(50e-6)
    )
    for limits in ((stroke,), ()):
        broken = violations(replace(model, limits=limits), np.zeros((2, 0)), z, 1e6 * z)
        assert [list(v.samples) for v in broken] == [[0]] * len(limits)


def test_of_a_jump_beyond_the_stroke_the_stroke_alone_is_the_cause(tmp_path):
    """10, 10, 60, 60, 10 um of 50, with 55 N at most for 1 N/um: the drive that leads out of range is broken one sample earlier, and is no
    cause of its own; that of y, which is in range where its own drive does not reach, is one."""
    timing = 'sample_rate = "100 Hz"\n'
    for y, causes in ((0, {"x"}), (48, {"x", "b"})):
        scenario, model = pair(
            tmp_path,
            [(10, 0), (10, 0), (60, 0), (60, 0), (10, 0), (10, 0), (10, 0), (10, y), (10, y)],
            timing,
            drive={"a": "55 N", "b": "45 N"},
        )
        problem = scenario.bind(model)
        broken = problem.inverse.trajectory(problem.motion).violations(model)
        assert "a" in {v.limit.channels[v.channel] for v in broken}
        assert {v.limit.channels[v.channel] for v in primary(model, broken)} == causes
