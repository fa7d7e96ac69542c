"""Masses that a model leaves out are told wherever the path is: by the console, the page and the README of the C."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario, solve

PATH = '[path]\nkind = "line"\nstart = { delta_x = "-200 um" }\nend = { delta_x = "200 um" }\n'
HEAD = 'title = "a line"\ndevice = "device.toml"\nsample_rate = "2 kHz"\n'
LIGHT = (SCENARIOS / "devices" / "parallelogram.toml").read_text().replace('[dynamics]\ndamping_ratio = "1 %"\n', "")


def line(folder, seconds: float, more: str = ""):
    (folder / "device.toml").write_text(LIGHT + more)
    (folder / "scenario.toml").write_text(f'{HEAD}duration = "{seconds} s"\n{PATH}')
    return load_scenario(folder / "scenario.toml")


def solved(scenario):
    return solve(scenario, build_model(scenario.device))


def test_the_ringing_of_a_mass_is_that_of_an_oscillator_on_the_path(tmp_path):
    """y'' + 2 zeta w y' + w^2 y = w^2 y_d of the one mode, by Runge and Kutta on the drive as it is held."""
    solution = solved(line(tmp_path, 0.1))
    told = solution.unstated_inertia
    w, zeta, h, parts = 2 * np.pi * told.frequency, told.damping_ratio, 5e-4, 20
    wanted = np.vstack([solution.command, np.tile(solution.command[-1:], (100, 1))])[:, 0]
    y, v, off = wanted[0], 0.0, []
    for k, target in enumerate(wanted):
        off.append(abs(y - solution.command[min(k, len(solution.command) - 1), 0]))
        for _ in range(parts):
            v += h / parts * (w**2 * (target - y) - 2 * zeta * w * v)
            y += h / parts * v
    n = len(solution.command)
    assert max(off[:n]) == pytest.approx(told.along, rel=0.1) and max(off[n:]) == pytest.approx(told.after, rel=0.1)
    assert told.frequency == pytest.approx(43.84, rel=1e-3) and told.channel == "delta_x"


def test_slow_paths_leave_less_and_a_stated_inertia_nothing(tmp_path):
    fast, slow = (solved(line(tmp_path, seconds)).unstated_inertia for seconds in (0.1, 1.0))
    assert slow.along < 0.05 * fast.along
    assert solved(line(tmp_path, 0.1, '[dynamics]\ndamping_ratio = "1 %"\n')).unstated_inertia is None


@pytest.mark.long
def test_console_page_and_readme_tell_it(tmp_path):
    line(tmp_path, 0.1)
    ran = run_command("run", tmp_path, "--out", tmp_path / "out")
    page, readme = ((tmp_path / "out" / name).read_text() for name in ("report.html", "c/README.md"))
    for text in (ran.stdout, page, readme):
        assert "inertia is left out" in text.lower() and "43.84 Hz" in text
    assert "left_out" not in readme
