from __future__ import annotations

import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import InputError, Unreachable, build_model, load_scenario, simulate, solve

NM = 1e-9


@pytest.fixture
def scenario(tmp_path):
    """A scenario from text, beside the shipped device."""

    def write(text: str):
        (tmp_path / "scenario.toml").write_text(f'title = "t"\ndevice = "{DEVICE}"\n{text}')
        return load_scenario(tmp_path)

    return write


def test_the_circle_keeps_every_limit_and_returns_the_commanded_pose(circle):
    assert all(margin.distance > 0 for margin in circle.margins)
    reached = simulate(circle.model, circle.drive, 1e-3, circle.trace.x[0]).signals["pose"]
    command = np.vstack([circle.command, circle.command[:1]])
    assert np.abs(reached - command)[:, 3:].max() < 0.01 * NM  # the limits
    assert np.abs(reached - command)[:, :3].max() < 1e-12


def test_a_closed_path_is_periodic(circle):
    end = simulate(circle.model, circle.drive, 1e-3, circle.trace.x[0])
    assert end.x[-1] == pytest.approx(circle.trace.x[0], abs=1e-8)  # K


def test_margins_are_those_of_the_trajectory(circle):
    margin = {m.limit.name: m for m in circle.margins}
    d = circle.trace.signals["displacement"]
    assert margin["stroke"].value == d.min() and margin["stroke"].bound == 0
    assert margin["drive"].value == circle.drive.min()
    assert circle.tightest.share == min(m.share for m in circle.margins if m.share is not None)
    notch = margin["notch_rotation"]
    assert notch.value == pytest.approx(np.arcsin(d.max() / 1e-3), rel=1e-12)


def test_an_open_path_starts_settled_and_ends_held(scenario):
    s = scenario(
        'sample_rate = "1 kHz"\nduration = "0.1 s"\n[path]\nkind = "line"\nstart = { delta_z = "15 um" }\nend = { delta_z = "25 um" }\n'
    )
    solution = solve(s, build_model(s.device))
    m = solution.model
    start_power = (solution.trace.x[0] - 295.15) / 550
    settled = simulate(m, np.tile(start_power, (5, 1)), 1e-3, solution.trace.x[0])
    assert np.ptp(settled.x, axis=0).max() < 1e-9
    held = simulate(m, solution.drive, 1e-3, solution.trace.x[0])
    assert np.abs(held.signals["pose"][-1] - solution.command[-1])[5] < 0.01 * NM


def test_a_limit_that_the_relaxed_solution_breaks_is_added(scenario):
    """Tilts and height that the strokes allow but the wires do not."""
    s = scenario('[path]\nkind = "poses"\npoints = [{ theta_y = "-4.1 mrad", delta_z = "30 um" }]\n')
    with pytest.raises(Unreachable, match="wire flexure stress") as caught:
        solve(s, build_model(s.device))
    nearest = caught.value.infeasibility.nearest
    assert abs(nearest[1] + 4.1e-3) > 1e-6 and abs(nearest[5] - 3e-5) < 2e-6


def test_the_nearest_pose_of_an_unreachable_one_is_reachable(scenario):
    s = scenario('[path]\nkind = "poses"\npoints = [{ delta_x = "10 um" }]\n')
    with pytest.raises(Unreachable) as caught:
        solve(s, build_model(s.device))
    message, short = str(caught.value), caught.value.infeasibility
    # Rigid translation: d = R(psi)' (10, 0)
    assert "actuator 2X: needs -5 um" in message and "3Y: needs -8.66 um" in message
    assert "1X" not in message.split("nearest")[0]
    p = short.nearest * 0.999  # reachable poses form a cone, so shrinking stays inside
    theta = ", ".join(f'theta_{a} = "{v!r} rad"' for a, v in zip("xyz", p[:3].tolist(), strict=True))
    delta = ", ".join(f'delta_{a} = "{v!r} m"' for a, v in zip("xyz", p[3:].tolist(), strict=True))
    s = scenario(f'[path]\nkind = "poses"\npoints = [{{ {theta}, {delta} }}]\n')
    assert np.abs(solve(s, build_model(s.device)).trace.signals["pose"][0] - p).max() < 0.01 * NM


def test_a_path_too_fast_for_passive_cooling_names_the_heaters(scenario):
    s = scenario(
        'sample_rate = "1 kHz"\nduration = "12 ms"\n[path]\nkind = "circle"\ndiameter = "20 um"\ncentre = { delta_z = "20 um" }\n'
    )
    with pytest.raises(Unreachable, match="cannot cool faster"):
        solve(s, build_model(s.device))


@pytest.mark.long
@pytest.mark.parametrize(
    "path",
    [
        'kind = "lissajous"\namplitudes = ["4 um", "3 um"]\nperiods = [3, 2]\ncentre = { delta_z = "22 um" }',
        'kind = "circle"\ndiameter = "6 um"\nplane = ["delta_x", "delta_z"]\ncentre = { delta_z = "22 um" }\nturns = 2',
        'kind = "spiral"\ndiameter = "8 um"\nturns = 3\ncentre = { delta_z = "22 um" }',
        'kind = "raster"\nlength = "4 um"\nspacing = "1 um"\nlines = 3\ncentre = { delta_z = "22 um" }',
    ],
)
def test_every_kind_of_path_is_followed(scenario, path):
    s = scenario(f'sample_rate = "500 Hz"\nduration = "0.6 s"\n[path]\n{path}\n')
    solution = solve(s, build_model(s.device))
    assert len(solution.command) == 300
    assert np.abs(solution.trace.signals["pose"] - solution.command)[:, 3:].max() < 0.01 * NM


def test_poses_from_a_csv_in_the_readers_units(scenario, tmp_path):
    (tmp_path / "poses.csv").write_text("delta_z [mm],theta_x [mrad]\n0.02,0\n0.021,0.1\n\n0.022,0.2\n")
    s = scenario('[path]\nkind = "poses"\nfile = "poses.csv"\n')
    command = s.bind(build_model(s.device)).samples
    assert command[:, 5] == pytest.approx([2e-5, 2.1e-5, 2.2e-5]) and command[:, 0] == pytest.approx([0, 1e-4, 2e-4])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("delta_z [um],delta_x [um]\n20,nan\n", "line 2, delta_x: 'nan' is not a finite number"),
        ("delta_z [um]\n20\n21,5\n", "line 3: has 2 cells"),
        ("delta_q [um]\n20\n", "'delta_q"),
        ("delta_z\n20\n", "needs a unit"),
        ("delta_z [rad]\n20\n", "needs a unit"),
        ("delta_z [um]\n", "no samples"),
        ("", "no samples"),
    ],
)
def test_a_bad_csv_is_refused_by_line_and_column(scenario, tmp_path, text, says):
    (tmp_path / "poses.csv").write_text(text)
    s = scenario('[path]\nkind = "poses"\nfile = "poses.csv"\n')
    with pytest.raises(InputError) as caught:
        _ = s.bind(build_model(s.device)).samples
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[path]\nkind = "circle"\ndiameter = "20 um"\n', "points = N"),
        ('sample_rate = "1 kHz"\n[path]\nkind = "circle"\ndiameter = "20 um"\n', "duration"),
        ('duration = "1 s"\npoints = 3\n[path]\nkind = "circle"\ndiameter = "20 um"\n', "without sample_rate"),
        ('points = 3\n[path]\nkind = "zigzag"\n', "zigzag"),
        ('points = 3\n[path]\nkind = "circle"\ndiameter = "20 um"\nradius = "1 um"\n', "radius"),
        ('points = 3\n[path]\nkind = "circle"\ndiameter = "20 V"\n', "wrong unit"),
        ('points = 3\nsample_rat = "1 kHz"\n[path]\nkind = "circle"\ndiameter = "20 um"\n', "sample_rate"),
    ],
)
def test_a_bad_scenario_is_refused_with_the_remedy(scenario, text, says):
    with pytest.raises(InputError) as caught:
        scenario(text)
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ('kind = "circle"\ndiameter = "20 um"\nplane = ["delta_x", "delta_q"]', "'delta_q' is not a channel"),
        ('kind = "circle"\ndiameter = "20 um"\nplane = ["delta_x", "delta_x"]', "twice"),
        ('kind = "circle"\ndiameter = "20 um"\nplane = ["delta_x", "theta_x"]', "name two lengths or two angles"),
        ('kind = "circle"\ndiameter = "20 um"\ncentre = { delta_z = "20 V", up = "1 um" }', "path.centre.up"),
    ],
)
def test_a_bad_path_is_refused_when_it_meets_the_device(scenario, path, says):
    s = scenario(f"points = 4\n[path]\n{path}\n")
    with pytest.raises(InputError) as caught:
        _ = s.bind(build_model(s.device)).samples
    assert says in str(caught.value)
