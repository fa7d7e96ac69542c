"""States that repeat after a period, found from few periods."""

from __future__ import annotations

import numpy as np
from conftest import DEVICES
from mechanism_files import loaded

from ctrlgen import build_model, load_scenario
from ctrlgen.numerics.accelerated_periods import repeating_state


def begun(period, start, count=3):
    states = [start]
    for _ in range(count):
        states.append(period(states[-1]))
    return states


def test_memories_of_six_speeds_repeat_after_as_many_periods_and_two():
    """dz_j/dt = (d - z_j)/tau_j of three piezos, 0.1 to 32 s, coupled by a hundredth: a period of 0.05 s forgets 0.0016 or more,
    and 13 000 periods alone would do. The state is that of the linear equations, to
    the tolerance over what a period forgets."""
    rng, forget = np.random.default_rng(0), np.repeat(-np.expm1(-0.05 / (0.1 * 10.0 ** (np.arange(6) / 2))), 3)
    away = np.kron(np.eye(6) - 0.01 * rng.random((6, 6)), np.eye(3))
    d, calls = rng.random(18), []

    def period(y):
        calls.append(y)
        return y + forget * (d - away @ y)

    found = repeating_state(period, begun(period, np.zeros(18)), np.ones(18), 12, 1e-9)
    assert found is not None and len(calls) - 3 <= 12
    assert np.abs(found - np.linalg.solve(away, d)).max() < 1e-9 / forget.min() / 0.9


def test_a_play_that_a_slow_memory_moves_repeats_too():
    """A memory that follows the middle of a play, and a play that is driven from it by 1 to both sides: y = 0.98 y + 0.02 (1 - w), w within
    0.3 of the end of the period."""

    def period(y):
        memory, play = y
        for end in (memory + 1.0, memory - 1.0):
            play = min(max(play, end - 0.3), end + 0.3)
        return np.array([0.98 * memory + 0.02 * (1.0 - play), play])

    found = repeating_state(period, begun(period, np.array([0.2, 0.0])), np.ones(2), 17, 1e-9)
    # the play ends 0.7 below the memory: m = 1 - (m - 0.7)
    assert found is not None and np.abs(found - [0.85, 0.15]).max() < 1e-7


def test_what_drifts_has_no_state_that_repeats():
    assert repeating_state(lambda y: y + 1.0, [np.zeros(1), np.ones(1)], np.ones(1), 17, 1e-9) is None
    assert repeating_state(lambda y: y * np.nan, [np.zeros(1), np.ones(1)], np.ones(1), 17, 1e-9) is None


EFFECTS = """
[[effect]]
kind = "drive_hysteresis"
at = "{axis}"
share = "0.15"
reach = "60 V"
taper = "0.5"
[[effect]]
kind = "log_creep"
at = "{axis}"
gain = "0.01"
tau = "0.1 s"
decades = "3"
"""


def test_a_circle_of_stacks_with_hysteresis_and_creep_repeats(tmp_path):
    """Relaxation times up to 1000 s along a circle of 0.1 s: single periods would take days."""
    text = (DEVICES / "xy_lever_stage.toml").read_text()
    loaded(tmp_path, text + "".join(EFFECTS.format(axis=axis) for axis in "xy"))
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n'
        '[path]\nkind = "circle"\ndiameter = "40 um"\ncentre = { delta_x = "-40 um", delta_y = "-40 um" }\n'
    )
    scenario = load_scenario(tmp_path)
    problem = scenario.bind(build_model(scenario.device))
    assert problem.inverse.trajectory(problem.motion).exact
