"""What deformations of third order take of the force of an axis, against corotational beams and closed forms, and where that is told."""

from __future__ import annotations

import numpy as np
import pytest
from held_blades import L, frame_of
from mechanism_files import PARALLELOGRAM, dm, hinged, loaded
from scipy.spatial.transform import Rotation

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.linear_range import left_out_shares, linear_ranges, range_lines
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.third_order_flexure import third_order_motion

PUSHED = 'at = ["0 mm", "-10 mm", "0 mm"]'


def leaning(first: float, second: float, push: float) -> str:
    """The stage on two blades that lean by these slopes, pushed at a height [mm]."""
    text = PARALLELOGRAM.replace("[0, 1, 0]", f"[{first}, 1, 0]", 1).replace("[0, 1, 0]", f"[{second}, 1, 0]", 1)
    return text.replace(PUSHED, f'at = ["0 mm", "{push} mm", "0 mm"]')


def drawn(count: int) -> list[tuple[float, float, float]]:
    """Random ones whose blades meet, where the stage can only turn, far enough from the push and from the blades to move by it."""
    rng, found = np.random.default_rng(5), []
    while len(found) < count:
        first, second, push = (round(float(x), 2) for x in rng.uniform([-0.5, -0.5, -25], [0.5, 0.5, 40]))
        pole = 20 / (first - second + 1e-9)
        if abs(pole - push) > 20 and not -35 < pole < 15:
            found.append((first, second, push))
    return found


@pytest.mark.parametrize("first, second, push", [(0, 0, -10), (0, 0, 40), (0.2, -0.2, 10), (0.6, -0.6, -10), *drawn(3)])
def test_force_of_leaning_blades_is_that_of_corotational_beams_to_fourth_order_of_the_energy(
    tmp_path, first, second, push
):
    """Of the force at x and -x the mean, over K x, is 1 + a x^2 + b x^4, but for what the rigid stage yields in the frame. The energy of
    fourth order with the deformations of second order alone has no such a: of a stage pushed above it -0.86 (x/L)^2 and not 0.16."""
    c = nominal(loaded(tmp_path, leaning(first, second, push)))
    K, (frame, (node,)) = dm(c.stiffness)[0, 0], frame_of(c, (0.0, push * 1e-3), parts=10)
    least = dm(nominal(loaded(tmp_path, PARALLELOGRAM)).stiffness)[0, 0]
    x = np.array([0.4, 0.7, 1.0]) * 0.03 * L * np.sqrt(least / K)
    forces = [(frame.moved(node, y, steps=8)[0] - frame.moved(node, -y, steps=8)[0]) / (2 * K * y) for y in x]
    wanted = np.linalg.solve(x[:, None] ** [0, 2, 4], forces)[1]
    kept = 4 * dm(SecondOrder(c).quartic)[0, 0] / K
    assert kept + left_out_shares(c)[0] == pytest.approx(wanted, rel=0.03, abs=0.02 / L**2)


def test_motion_of_third_order_is_that_of_rotation_matrices():
    rng = np.random.default_rng(3)
    for _ in range(5):
        point, first, second = rng.normal(size=3), rng.normal(size=6), rng.normal(size=6)

        def seen(s, point=point, first=first, second=second):
            one, two = Rotation.from_rotvec(s * first[:3]), Rotation.from_rotvec(s * second[:3])
            there = two.apply(point) + s * second[3:] - one.apply(point) - s * first[3:]
            return np.concatenate([(one.inv() * two).as_rotvec(), one.inv().apply(there)])

        at = np.array([0.02, 0.04, 0.06])
        odd = [(seen(s) - seen(-s)) / 2 for s in at]
        found = np.linalg.solve(at[:, None] ** [1, 3, 5], odd)[1]
        assert np.concatenate(third_order_motion(point, first, second)) == pytest.approx(found, rel=1e-3, abs=1e-4)


def test_a_guided_blade_is_linear_to_a_tenth_of_its_length_and_an_arm_to_an_angle(tmp_path):
    """(36/35) (y/l)^2 of the elastica: 1, 5 and 20 % at 0.0986, 0.22 and 0.44 l. An arm r on a hinge that is pushed along one direction
    takes k asin(d/r)/(r cos): (2/3) (d/r)^2."""
    c = nominal(loaded(tmp_path, PARALLELOGRAM.replace('travel = "300 um"', 'travel = "2 mm"')))
    (found,) = linear_ranges(c)
    assert found == pytest.approx(np.sqrt(np.array([0.01, 0.05, 0.2]) * 35 / 36) * L, rel=2e-3)
    (line,) = range_lines(c.device)
    assert "from a travel of 1972 um, 4410 um, 8821 um; most of that is of third order" in line
    (share,) = left_out_shares(nominal(loaded(tmp_path, hinged(1.0))))
    assert share == pytest.approx(2 / 3 / 32e-3**2, rel=2e-3)


def test_a_travel_beyond_it_is_told_by_check_and_with_a_solution(tmp_path):
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\npoints = 3\n[path]\nkind = "line"\nstart = { delta_x = "0 um" }\n'
        'end = { delta_x = "50 um" }\n'
    )
    far = PARALLELOGRAM.replace('travel = "300 um"', 'travel = "4 mm"').replace('gain = "2 N/A"', 'gain = "40 N/A"')
    for text, told in ((far, True), (PARALLELOGRAM, False)):
        device = loaded(tmp_path, text)
        said = [x for x in device.remarks() if "third order" in x]
        assert bool(said) == told and all("right to 1 % up to 1972 um" in x and "at 4000 um" in x for x in said)
        left_out = solve(load_scenario(tmp_path), build_model(device)).left_out
        assert any("third order" in sentence for sentence in left_out) == told
