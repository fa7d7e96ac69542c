"""Paths of too many samples for one nonlinear programme: the inverse sample by sample, held to that programme where both can be run."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.trajectory import nominal
from ctrlgen.trajectory.infeasibility import check_feasible
from ctrlgen.trajectory.optimisation import SATISFIED, TrajectoryProgramme

CREEP = '\n[[effect]]\nkind = "creep"\nat = "all"\ngain = "0.01"\ntau = "20 ms"\nslow = "0.3"\n'
CIRCLE = 'kind = "circle"\ndiameter = "20 um"\ncentre = { delta_z = "20 um" }\n'
LINE = 'kind = "line"\nstart = { delta_z = "18 um" }\nend = { delta_z = "22 um", delta_x = "3 um" }\n'
# A femtometre of a typical size of a micrometre. IPOPT and the inverse end within 1e-12 of each other.
SAME = 1e-9


def written(folder, effects, path, timing):
    (folder / "device.toml").write_text(DEVICE.read_text() + effects)
    (folder / "scenario.toml").write_text(f'title = "t"\ndevice = "device.toml"\n{timing}\n[path]\n{path}')
    return load_scenario(folder)


@pytest.mark.long
def test_the_inverse_of_a_long_path_is_what_one_programme_over_all_samples_gives(tmp_path, monkeypatch):
    """Closed and open, with memories and without, and settled poses."""
    in_time = 'sample_rate = "100 Hz"\nduration = "0.4 s"'
    for effects, path, timing in (
        ("", CIRCLE, in_time),
        ("", LINE, in_time),
        (CREEP, CIRCLE, in_time),
        (CREEP, LINE, in_time),
        ("", CIRCLE, "points = 12"),
    ):
        scenario = written(tmp_path, effects, path, timing)
        model = build_model(scenario.device)
        steps: list[str] = []
        by_ipopt = solve(scenario, model, steps.append)
        monkeypatch.setattr(nominal, "MOST_CONFIRMED", 10)
        long = solve(scenario, model, steps.append)
        monkeypatch.undo()
        assert len(steps) == 1 and by_ipopt.residual is None and by_ipopt.solved_by.startswith("IPOPT")
        assert long.residual is not None and long.residual < SATISFIED and long.solved_by.startswith("the inverse")
        for one, other, scale in (
            (by_ipopt.drive, long.drive, model.u_scale),
            (by_ipopt.trace.x, long.trace.x, model.x_scale),
            (by_ipopt.trace.z, long.trace.z, model.z_scale),
        ):
            assert np.abs((one - other) / scale).max() < SAME
        assert [m.sample for m in by_ipopt.margins] == [m.sample for m in long.margins]


def test_what_does_not_satisfy_an_equation_is_no_solution_of_a_long_path(tmp_path):
    """A displacement, a state or a drive that is off by 0.1 pm, by its size, at one sample, and a start that is not settled."""
    in_time = 'sample_rate = "100 Hz"\nduration = "0.2 s"'
    for path in (CIRCLE, LINE):
        scenario = written(tmp_path, CREEP, path, in_time)
        model = build_model(scenario.device)
        problem = scenario.bind(model)
        needed = check_feasible(problem)
        programme = TrajectoryProgramme(model, problem.follow, problem.motion, problem.clock)
        assert programme.residual(needed) < SATISFIED
        for name, scale in (("x", model.x_scale), ("z", model.z_scale), ("u", model.u_scale)):
            for column in range(len(scale)):
                values = getattr(needed, name).copy()
                values[7, column] += 1e-7 * scale[column]
                assert programme.residual(replace(needed, **{name: values})) > SATISFIED, (name, column)
    assert programme.residual(replace(needed, u_start=needed.u_start * (1 + 1e-6))) > SATISFIED


# VmHWM is the largest memory of this process alone; ru_maxrss begins with what the process that started it held
MEASURED = """
import sys
import ctrlgen
scenario = ctrlgen.load_scenario(sys.argv[1])
solution = ctrlgen.solve(scenario, ctrlgen.build_model(scenario.device))
kilobytes = next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM:"))
print(len(solution.command), int(kilobytes) / 1e6)
"""


@pytest.mark.long
def test_a_hundred_thousand_samples_are_solved_in_a_gigabyte(tmp_path):
    """They take 0.4 GB; one programme over all of them takes 6 GB."""
    written(tmp_path, "", CIRCLE, 'sample_rate = "100 kHz"\nduration = "1 s"')
    run = subprocess.run([sys.executable, "-c", MEASURED, str(tmp_path)], capture_output=True, text=True, check=True)
    samples, gigabytes = map(float, run.stdout.split())
    assert samples == 100_000 and gigabytes < 1.0
