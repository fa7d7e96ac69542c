"""Force and stress of over-constrained mechanisms beyond the linear range, against corotational beams; and who is told of it."""

from __future__ import annotations

import casadi as ca
import pytest
from command_line import ctrlgen as run_command
from held_blades import EI, PARTS, STIFFENS, E, L, T, W, frame_of, held, stretched
from mechanism_files import dm, loaded, with_values

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.linear_range import linear_ranges


def pushed_at(y: float) -> str:
    """The stage between two blades in line, pushed `y` [mm] beside the middle, where it turns too."""
    return held().replace('at = ["0 mm", "0 mm", "0 mm"]\nalong', f'at = ["0 mm", "{y} mm", "0 mm"]\nalong')


def stress_of(loads) -> float:
    ends = [(loads[b][0], loads[b][1 + at]) for k in range(2) for b, at in ((PARTS * k, 0), (PARTS * k + PARTS - 1, 1))]
    return max(abs(N) / (T * W) + abs(M) / (W * T**2 / 6) for N, M in ends)


@pytest.mark.long
def test_force_and_stress_of_held_blades_are_those_of_corotational_beams(tmp_path):
    """Up to two thicknesses, where most of both is stretching: in line, and where the stage turns beside it."""
    for beside, most in ((0.5, 0.01), (5.0, 0.03)):
        device = loaded(tmp_path, pushed_at(beside))
        model, c = build_model(device), Condensed(*with_values(device))
        stress = next(limit.expr for limit in model.limits if limit.name.startswith("stress_"))
        d, (frame, (push,)) = ca.SX.sym("d", 1), frame_of(c, (0, beside * 1e-3))
        law = ca.Function("law", [d], [device.physics(device.values()).restoring_force(d)])
        stresses = ca.Function("stress", [model.z], [stress])
        for share in (0.25, 1.0, 2.0):
            force, _, loads = frame.moved(push, share * T, steps=8)
            assert float(law(share * T)) == pytest.approx(force, rel=most)
            assert stresses(share * T).full().max() == pytest.approx(stress_of(loads), rel=most)
        assert force > 2 * dm(c.stiffness)[0, 0] * share * T


def test_round_wires_take_the_same_in_both_planes(tmp_path):
    """Force and stress of a stage between two wires in line, pushed beside its middle across them: along x, and along z."""
    found = []
    for way in ([1, 0, 0], [0, 0, 1]):
        text = pushed_at(5.0)
        for old, new in (
            ('at = ["0 mm", ', 'at = ["-10 mm", '),
            ('kind = "blade"', 'kind = "wire"'),
            ('thickness = "0.2 mm"\nwidth = "8 mm"\n', 'diameter = "0.5 mm"\n'),
            ("across = [-1, 0, 0]\n", ""),
            ("along = [1, 0, 0]", f"along = {way}"),
            ("delta_x", "delta_x" if way[0] else "delta_z"),
        ):
            text = text.replace(old, new)
        device = loaded(tmp_path, text)
        model, d = build_model(device), ca.SX.sym("d", 1)
        law = ca.Function("law", [d], [device.physics(device.values()).restoring_force(d)])
        stress = next(limit.expr for limit in model.limits if limit.name.startswith("stress_"))
        whole = ca.Function("stress", [model.z], [stress])(300e-6).full()
        found.append((float(law(300e-6)), *sorted(whole.ravel())))
    assert found[0] == pytest.approx(found[1], rel=1e-6)  # a few roundings of numbers that cancel


def test_the_range_of_the_linear_force_is_that_of_the_known_cubic(tmp_path):
    """(18/25) EA y^3/l^3 over 12 EI y/l^3 is 0.72 (y/t)^2."""
    device = loaded(tmp_path, held().replace(STIFFENS, ""))
    (found,) = linear_ranges(Condensed(*with_values(device)))
    assert found == pytest.approx([T * (share / 0.72) ** 0.5 for share in (0.01, 0.05, 0.2)], rel=0.01)


def test_a_path_beyond_the_linear_range_is_told_with_force_and_stress(tmp_path):
    """3 E t y/l^2 of bending alone in the model; not where the path is short, or the file states the stretching."""
    head = 'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n[path]\nkind = "line"\n'
    told = []
    for stated, end in ((False, 150), (False, 10), (True, 150)):
        (tmp_path / "device.toml").write_text(held() if stated else held().replace(STIFFENS, ""))
        (tmp_path / "s.toml").write_text(f'{head}start = {{ delta_x = "0 um" }}\nend = {{ delta_x = "{end} um" }}\n')
        scenario = load_scenario(tmp_path / "s.toml")
        solution = solve(scenario, build_model(scenario.device))
        told.append(solution.unstated_stretching)
        assert len(solution.left_out) == (told[-1] is not None)
    y = 150e-6
    assert told[0].force == pytest.approx(2 * stretched(y), rel=1e-3)
    assert told[0].linear == pytest.approx(24 * EI / L**3 * y, rel=1e-6)
    label, linear, whole, bound = told[0].stress
    assert label == "stress of silicon" and linear == pytest.approx(3 * E * T * y / L**2, rel=1e-6)
    assert whole > linear + E * 0.5 * (y / L) ** 2 and bound == 300e6
    assert told[1:] == [None, None]


@pytest.mark.long
def test_a_path_beyond_the_linear_range_is_told_wherever_it_is(tmp_path):
    """By check, the console, the page and the README of the C; not where the file states the stretching."""
    path = '[path]\nkind = "line"\nstart = { delta_x = "0 um" }\nend = { delta_x = "150 um" }\n'
    for stated in (False, True):
        (tmp_path / "device.toml").write_text(held() if stated else held().replace(STIFFENS, ""))
        (tmp_path / "scenario.toml").write_text(
            f'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n{path}'
        )
        ran = run_command("run", tmp_path, "--out", tmp_path / f"out{stated}")
        page, readme = ((tmp_path / f"out{stated}" / name).read_text() for name in ("report.html", "c/README.md"))
        for text in (ran.stdout, page, readme):
            assert ("tretching of the flexures is left out" in text) is not stated
        checked = run_command("check", tmp_path / "device.toml").stdout
        assert "linear force of coil off by 1, 5, 20 % from a travel of 23.5" in checked
    assert "stress of silicon" in ran.stdout
