"""Copies of a pattern whose numbers deviate each by itself: closed forms, and mechanisms with every copy written out."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from budget_cases import stated
from mechanism_files import HEAD, dm, loaded

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.limits import slopes_of_limits
from ctrlgen.budget.linear import propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.calibration.budgets_compared import about_their_mean
from ctrlgen.core.errors import InputError
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.mechanism.condensed import nominal

K, R, Z = 0.4e6, 20e-3, 30e-6  # of each leg [N/m], radius [m], height of the path [m]
DRAWS = 4000
SAMPLED = 4 / np.sqrt(2 * DRAWS)  # four times what a standard deviation of as many draws is uncertain by
SPRING = '[[element]]\nkind = "spring"\nname = "{name}"\n{copied}from = "ground"\nto = "stage"\nat = {at}\nalong = [0, 0, 1]\n'
LEG = 'F_x_per_delta_x = "{k} N/m"\nF_y_per_delta_y = "3 N/um"\nF_z_per_delta_z = "3 N/um"\n'
COIL = (
    '[[actuator]]\nname = "{name}"\n{copied}kind = "force"\non = "stage"\nat = {at}\nalong = [0, 0, 1]\n'
    'gain = "{gain} N/A"\nlow = "-9 A"\nhigh = "9 A"\ntravel = "100 um"\n'
)
FOLLOWED = '[output]\nbody = "stage"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["theta_x", "theta_y", "delta_z"]\n'
BODY = '[[body]]\nname = "stage"\n'
AT = '["20 mm", "0 mm", "0 mm"]'


def tripod(k: float = K) -> str:
    """A stage on three springs, each with a coil beside it."""
    copied = 'pattern = "leg"\n'
    text = HEAD + '[[pattern]]\nname = "leg"\ntimes = 3\n' + BODY
    text += SPRING.format(name="spring", copied=copied, at=AT) + LEG.format(k=k)
    return text + COIL.format(name="coil", copied=copied, at=AT, gain=6) + FOLLOWED


def written_out(k: np.ndarray, gain: np.ndarray) -> str:
    """The same with three springs and three coils of their own numbers."""
    text = HEAD + BODY
    turns = [2 * np.pi * i / 3 for i in range(3)]
    places = [f'["{float(R * np.cos(a))!r} m", "{float(R * np.sin(a))!r} m", "0 mm"]' for a in turns]
    for i, at in enumerate(places):
        text += SPRING.format(name=f"s{i}", copied="", at=at) + LEG.format(k=float(k[i]))
    for i, at in enumerate(places):
        text += COIL.format(name=f"c{i}", copied="", at=at, gain=float(gain[i]))
    return text + FOLLOWED


def raised(folder, text: str):
    """The stage at Z, solved."""
    device = loaded(folder, text)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "m"\n[path]\nkind = "poses"\npoints = [{{ delta_z = "{1e6 * Z} um" }}]\n'
    )
    return solve(load_scenario(folder, device), build_model(device))


def of_springs(independent: str = "") -> str:
    return f'[numbers]\n"element[0].F_x_per_delta_x" = {{ sd = "3 %", source = "s"{independent} }}\n'


def test_unequal_springs_in_parallel_spread_by_the_root_of_their_number_and_tilt(tmp_path):
    """z = F/3 sum 1/k_i: sd s Z/sqrt(3). Of a leg at angle a with z_i = Z (1 - e_i) the tilt is 2/(3 R) sum z_i sin a_i: sd s Z sqrt(2/3)/R
    about each axis. What they have in common raises by s Z and does not tilt."""
    solution = raised(tmp_path, tripod())
    alone = budget_of(solution, stated(solution, of_springs(), tmp_path), draws=DRAWS)
    tilt = 0.03 * Z * np.sqrt(2 / 3) / R
    assert alone.combined[0] == pytest.approx([tilt, tilt, 0.03 * Z / np.sqrt(3)], rel=1e-9)
    assert alone.drawn.pose.std(axis=0)[0] == pytest.approx(
        alone.combined[0], rel=SAMPLED + 0.03**2
    )  # its second order
    assert all(a.passed for a in alone.agreements) and len(alone.lines) == 1
    together = budget_of(solution, stated(solution, of_springs(", independent = false"), tmp_path), draws=0)
    assert together.combined[0] == pytest.approx([0, 0, 0.03 * Z], rel=1e-9, abs=1e-15)


def test_a_draw_is_the_mechanism_with_every_copy_written_out(tmp_path):
    solution = raised(tmp_path, tripod())
    text = of_springs() + '"actuator[0].gain" = { sd = "2 %", source = "s" }\n'
    found = budget_of(solution, stated(solution, text, tmp_path), draws=DRAWS)
    names = [path for line in found.uncertainties.lines for path in line.paths]
    assert names == [f"{path}@{k}" for path in ("element[0].F_x_per_delta_x", "actuator[0].gain") for k in (1, 2, 3)]
    for columns, drawn in list(zip(found.drawn.columns, found.drawn.pose, strict=True))[:5]:
        gain = 6 + columns[3:]
        c = nominal(loaded(tmp_path, written_out(K + columns[:3], gain)))
        pose = dm(c.jacobian) @ np.linalg.solve(dm(c.stiffness), gain * solution.drive[0])
        # the stage's own equations once more: rounding
        np.testing.assert_allclose(drawn[0] + found.linear.nominal["pose"][0], pose, rtol=1e-9, atol=1e-15)
    own = changed(solution.model.device, dict(zip(names, found.drawn.columns[0], strict=True)))
    c = nominal(loaded(tmp_path, written_out(K + found.drawn.columns[0][:3], gain)))
    np.testing.assert_allclose(dm(nominal(own).stiffness), dm(c.stiffness), rtol=1e-9, atol=1e-3)
    back = changed(own, dict(zip(names, -found.drawn.columns[0], strict=True)))
    np.testing.assert_allclose(dm(nominal(back).stiffness), np.eye(3) * K, rtol=1e-9, atol=1e-3)


def test_an_actuators_reach_of_one_copy_moves_the_limit_of_that_copy_alone(tmp_path):
    solution = raised(tmp_path, tripod())
    uncertain = stated(solution, '[numbers]\n"actuator[0].travel" = { sd = "5 um", source = "s" }\n', tmp_path)
    path = UncertainPath(solution, uncertain)
    slopes = slopes_of_limits(path, propagate(path))
    places = [limit.name for limit, _ in path.channels]
    rows = [places.index(f"travel_coil_{k}") for k in (1, 2, 3)]
    np.testing.assert_allclose(slopes.upper[rows], np.eye(3), rtol=1e-9)
    np.testing.assert_allclose(slopes.lower[rows], -np.eye(3), rtol=1e-9)


def test_copies_about_a_mean_that_is_known_tilt_and_do_not_raise(tmp_path):
    """A fitted constant is the mean of the copies: what is left of them has no mean, and tilts as before."""
    solution = raised(tmp_path, tripod())
    left = about_their_mean(stated(solution, of_springs(), tmp_path), {"element[0].F_x_per_delta_x"})
    tilt = 0.03 * Z * np.sqrt(2 / 3) / R
    found = budget_of(solution, left, draws=0).combined[0]
    assert found == pytest.approx([tilt, tilt, 0], rel=1e-9, abs=1e-9 * Z)


def test_the_copies_of_a_number_have_no_single_correlation(tmp_path):
    solution = raised(tmp_path, tripod())
    pair = '[[correlation]]\nbetween = ["element[0].F_x_per_delta_x", "actuator[0].gain"]\ncoefficient = 0.5\nsource = "s"\n'
    text = of_springs() + '"actuator[0].gain" = { sd = "2 %", source = "s", independent = false }\n' + pair
    with pytest.raises(InputError, match=r"one of each copy: state it with independent = false") as refused:
        stated(solution, text, tmp_path)
    assert "actuator" not in str(refused.value)
    with pytest.raises(InputError, match="is not a parameter"):
        build_model(solution.model.device, ("element[0].F_x_per_delta_x@4",))
    assert ca.symvar(build_model(solution.model.device, ("element[0].F_x_per_delta_x@3",)).balance)
