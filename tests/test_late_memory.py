"""Creep learns of the displacement a sample late under held drives, and a solved path says how far off that is."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.core.units import show

GAIN, TAU = 0.1, 0.05
CREEP = '\n[[effect]]\nkind = "creep"\nat = "all"\ngain = "{}"\ntau = "50 ms"\nslow = "0"\n'


def circled(folder, more: str = "", rate: str = "100 Hz"):
    shutil.copytree(SCENARIOS / "devices", folder / "devices")
    shutil.copytree(SCENARIOS / "meso_circle", folder / "meso_circle")
    with (folder / "devices" / "meso_hexapod.toml").open("a") as file:
        file.write(more)
    scenario = folder / "meso_circle" / "scenario.toml"
    scenario.write_text(scenario.read_text().replace('sample_rate = "100 Hz"', f'sample_rate = "{rate}"'))
    described = load_scenario(scenario)
    return solve(described, build_model(described.device))


def late(solution) -> np.ndarray:
    """(n, 6) [m, rad] how far the pose is off where each creep relaxes to the displacement that its drive holds, sample by sample."""
    t, h = solution.trace, solution.scenario.sample_time
    places = [k for k, name in enumerate(solution.model.x_names) if "_z_" in name]
    creep = t.x[:, places]
    moved = t.z + GAIN * creep
    J = np.linalg.lstsq(moved, t.signals["pose"], rcond=None)[0]
    true, kept = [creep[0]], np.exp(-h / TAU)
    for u in solution.drive:
        true.append(u + (true[-1] - u) * kept)
    n = len(creep)
    return GAIN * np.abs((np.array(true)[:n] - creep) @ J)


def test_a_solved_path_says_how_far_off_creep_leaves_it(tmp_path):
    solution = circled(tmp_path, CREEP.format(GAIN))
    told, off = solution.late_memory, late(solution)
    channel = told.signal.channels.index(told.channel)
    assert told.off == pytest.approx(
        off[: len(solution.drive), channel].max(), rel=0.03
    )  # what eight steps leave, extrapolated
    assert told.off > 1e-7 and told.channel in ("delta_x", "delta_y")
    (sentence,) = solution.left_out
    assert show(told.off, "um") in sentence and "half the sample time" in sentence


@pytest.mark.parametrize("delay", ["2 ms", "30 ms"])
def test_a_late_reading_beside_it_changes_nothing(tmp_path, delay):
    """A delay keeps as many readings as it is samples long, which are more where these are shorter."""
    late = f'\n[[effect]]\nkind = "delay"\nat = "delta_x"\ndelay = "{delay}"\n'
    plain, delayed = (circled(tmp_path / str(k), CREEP.format(GAIN) + more) for k, more in enumerate(("", late)))
    assert delayed.late_memory.off == pytest.approx(plain.late_memory.off, rel=1e-9)


def test_half_the_sample_time_leaves_half_and_no_creep_nothing(tmp_path):
    whole, half = (
        circled(tmp_path / rate[:3], CREEP.format(GAIN), rate).late_memory.off for rate in ("100 Hz", "200 Hz")
    )
    assert half == pytest.approx(whole / 2, rel=0.1)
    assert circled(tmp_path / "none").late_memory is None
    assert circled(tmp_path / "little", CREEP.format(1e-4)).late_memory is None
