"""Drives, tables and comparisons of a machine of nanometres or metres are those of its size in micrometres."""

from __future__ import annotations

import numpy as np
import pytest
from scaled_machines import USUAL, factor, scenario_of

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.player.compression import compress
from ctrlgen.trajectory.playback import length_tolerance, playback_tolerance, typical_length
from ctrlgen.verification.tolerances import length_limit

NANOMETRES, METRES = (1e-3, 1e-6, 1e-2), (1e3, 1e6, 1e2)


def solved(name, scale, folder):
    folder.mkdir()
    scenario = load_scenario(scenario_of(name, scale, folder))
    return solve(scenario, build_model(scenario.device))


@pytest.mark.parametrize("name", ["flexure_axis_line", "meso_circle"])
def test_a_path_takes_the_same_drives_and_as_many_steps_at_any_scale(name, tmp_path):
    usual = solved(name, USUAL, tmp_path / "usual")
    for scale in (NANOMETRES, METRES):
        other = solved(name, scale, tmp_path / str(scale))
        times = factor(usual.model.signals["drive"].units[0], scale)
        # of the full drive: what IPOPT and Newton's method leave
        assert np.abs(other.drive / times - usual.drive).max() < 1e-8 * usual.model.u_scale.max()
        assert abs(other.iterations - usual.iterations) <= 1


def test_tables_of_a_small_stage_are_as_right_as_those_of_a_large_one(tmp_path):
    """A stage of 100 nm may be 0.01 nm off, one of 100 um 0.1 nm, whatever is larger still too."""
    for scale, allowed in ((NANOMETRES, 1e-11), (USUAL, 1e-10), (METRES, 1e-10)):
        solution = solved("flexure_axis_line", scale, tmp_path / str(scale))
        followed = solution.model.signals["pose"]
        assert typical_length(followed) == pytest.approx(1e-4 * scale[0])
        assert length_tolerance(followed) == pytest.approx(allowed)
        assert playback_tolerance(followed) == pytest.approx([allowed])
        assert compress(solution)[Real.DOUBLE].chosen.length < allowed


SIZES = [(Real.DOUBLE, 1e-3, 1e-11), (Real.DOUBLE, 1e-7, 1e-12), (Real.FLOAT, 1e-3, 1e-10), (Real.FLOAT, 1e-8, 1e-12)]


@pytest.mark.parametrize("real, size, limit", SIZES)
def test_c_of_a_small_stage_is_held_to_shares_of_its_size(real, size, limit):
    assert length_limit(real, size) == pytest.approx(limit)
