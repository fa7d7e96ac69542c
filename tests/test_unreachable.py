"""Paths that cannot be followed: every one is explained, at any size, and what is offered instead can be followed."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import Unreachable, build_model, load_scenario, solve
from ctrlgen.core.errors import SolverError
from ctrlgen.trajectory.infeasibility import FEASIBILITY_TOLERANCE
from ctrlgen.trajectory.optimisation import TrajectoryProgramme
from ctrlgen.trajectory.path_inverse import PathInverse
from ctrlgen.trajectory.violations import violations

DEVICES = DEVICE.parent
BACKLASH = '\n[[effect]]\nkind = "backlash"\nat = "2X"\ngap = "0.3 um"\n'
CREEP = '\n[[effect]]\nkind = "creep"\nat = "all"\ngain = "3 %"\ntau = "0.5 s"\nslow = "30 %"\n'
ABOVE, RRR = 'centre = { delta_z = "20 um" }', 'centre = { theta_z = "-2 mrad" }'
CIRCLE, SPIRAL = 'kind = "circle"\ndiameter = "{}"\n', 'kind = "spiral"\ndiameter = "{}"\nturns = 5\n'
RASTER = 'kind = "raster"\nlength = "{}"\nspacing = "1 um"\nlines = 11\n'

CASES = {  # device, effects, rate, duration, path, what is said
    "circle without height": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("20 um"), "only pushes"),
    "spiral without height": ("mems_hexapod", "", 1000, 1.5, SPIRAL.format("16 um"), "only pushes"),
    "raster without height": ("mems_hexapod", "", 500, 2.64, RASTER.format("10 um"), "only pushes"),
    "circle too large": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "circle a hundred times too large": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("5 mm") + ABOVE, "only pushes"),
    "circle too fast": ("mems_hexapod", "", 1000, 0.012, CIRCLE.format("20 um") + ABOVE, "cannot cool faster"),
    "circle just too fast": ("mems_hexapod", "", 1000, 0.035, CIRCLE.format("20 um") + ABOVE, "cannot cool faster"),
    "line beyond the stroke": (
        "mems_hexapod", "", 1000, 1.0, 'kind = "line"\nstart = { delta_z = "10 um" }\nend = { delta_z = "90 um" }', "stroke ends",
    ),
    "line too steep": (
        "mems_hexapod", "", 1000, 0.004, 'kind = "line"\nstart = { delta_z = "40 um" }\nend = { delta_z = "5 um" }', "cannot cool faster",
    ),
    "tilt that the wires do not stand": (
        "mems_hexapod", "", 200, 0.5, 'kind = "line"\nstart = { delta_z = "30 um" }\nend = { theta_y = "-4.1 mrad", delta_z = "30 um" }',
        "wire flexure stress",
    ),
    "lissajous without height": (
        "mems_hexapod", "", 500, 0.6, 'kind = "lissajous"\namplitudes = ["8 um", "6 um"]\nperiods = [3, 2]', "only pushes",
    ),
    "upright circle": (
        "mems_hexapod", "", 500, 0.6, 'kind = "circle"\ndiameter = "30 um"\nplane = ["delta_x", "delta_z"]\ncentre = { delta_z = "10 um" }',
        "only pushes",
    ),
    "circle with backlash": ("mems_hexapod", BACKLASH, 500, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "circle with creep": ("mems_hexapod", CREEP, 500, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "fast circle with creep": ("mems_hexapod", CREEP, 1000, 0.012, CIRCLE.format("20 um") + ABOVE, "cannot cool faster"),
    "3-RRR, 5 mm": ("rrr_case2", "", 5000, 0.2, CIRCLE.format("5 mm") + RRR, "stroke ends"),
    "3-RRR, 200 um": ("rrr_case2", "", 5000, 0.1, CIRCLE.format("200 um") + RRR, "stroke ends"),
    "3-RRR, other way round": ("rrr_case2", "", 5000, 0.1, CIRCLE.format("20 um") + 'centre = { theta_z = "2 mrad" }', "stroke ends"),
    "3-RRR without bias": ("rrr_case1", "", 5000, 0.1, CIRCLE.format("20 um"), "stroke ends"),
    "meso hexapod, 40 mm": ("meso_hexapod", "", 100, 2.0, CIRCLE.format("40 mm"), "stroke ends"),
    "meso hexapod, far line": ("meso_hexapod", "", 100, 2.0, 'kind = "line"\nend = { delta_z = "9 mm" }', "stroke ends"),
}  # fmt: skip


def written(folder, device: str, effects: str, rate: float, duration: float, path: str):
    file = folder / "device.toml"
    file.write_text((DEVICES / f"{device}.toml").read_text() + effects)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "device.toml"\nsample_rate = "{rate} Hz"\nduration = "{duration} s"\n[path]\n{path}\n'
    )
    return load_scenario(folder)


def followed_by_ipopt(model, scenario, command) -> bool:
    """Whether IPOPT, begun far away, finds a trajectory without slack: it knows nothing of the inverse."""
    programme = TrajectoryProgramme(model, "pose", command, scenario.sample_time, scenario.closed)
    try:
        result, _ = programme.optimum()
    except SolverError:  # as it ends without the inverse on many paths that cannot be followed
        return False
    return bool(np.linalg.norm(result.unreachable_by, axis=1).max() < FEASIBILITY_TOLERANCE)


@pytest.mark.parametrize("name", CASES)
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
            static = TrajectoryProgramme(model, "pose", few)
            assert np.linalg.norm(static.optimum()[0].unreachable_by, axis=1).max() < FEASIBILITY_TOLERANCE, what


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


@pytest.mark.parametrize("seed", range(24))
def test_the_inverse_and_ipopt_agree_on_what_can_be_followed(tmp_path, seed):
    scenario = drawn(np.random.default_rng(seed), tmp_path)
    model = build_model(scenario.device)
    command = scenario.command(model)
    inverse = PathInverse(model, "pose", scenario.sample_time)
    assert inverse.keeps_limits(command, scenario.closed) == followed_by_ipopt(model, scenario, command)


def test_the_drawn_paths_are_of_both_kinds(tmp_path):
    kept = []
    for seed in range(24):
        scenario = drawn(np.random.default_rng(seed), tmp_path)
        model = build_model(scenario.device)
        kept.append(
            PathInverse(model, "pose", scenario.sample_time).keeps_limits(scenario.command(model), scenario.closed)
        )
    assert 6 < sum(kept) < 18


def test_what_a_path_needs_is_what_ipopt_finds(circle):
    """The inverse and the optimum are two computations of the same drives."""
    inverse = PathInverse(circle.model, "pose", circle.scenario.sample_time)
    needed = inverse.trajectory(circle.command, True)
    assert needed.exact and not violations(circle.model, needed.x, needed.z, needed.u)
    assert (
        np.abs(needed.u - circle.drive).max() < 1e-7
    )  # W, of 0.3: IPOPT's tolerance is 1e-10 of a sample's typical step


@pytest.mark.parametrize(("effects", "settles"), [(BACKLASH, True), (CREEP, False)])
def test_memories_are_carried_until_a_closed_path_repeats_or_is_seen_not_to(tmp_path, effects, settles):
    scenario = written(tmp_path, "mems_hexapod", effects, 200, 0.5, CIRCLE.format("20 um") + ABOVE)
    model = build_model(scenario.device)
    needed = PathInverse(model, "pose", scenario.sample_time).trajectory(scenario.command(model), True)
    assert needed.solved and needed.exact is settles
    solution = solve(scenario, model)
    assert np.abs(needed.z - solution.trace.z).max() < (1e-12 if settles else 3 * needed.unsettled * 1e-5)
