"""S0: the recordings' check figures, calibration, pose errors, rows and figures."""

from __future__ import annotations

import csv
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from conftest import MESO_FILE, ROOT, SCENARIOS
from scipy.stats import t as student

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.devices.meso_hexapod import matrices
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod
from ctrlgen.recordings.calibration import calibrate_jacobian
from ctrlgen.recordings.pose_errors import parasitic, pose_errors
from papers import s0, s0_figures, s0_fit
from papers.rounding import half_units, propagated_rounding
from papers.row import ReproductionStatus
from papers.s0_data import load_s0, read_jacobian

SHARED = ROOT.parent / "shared"
RECORDINGS = SHARED / "recordings" / "nist_hexapod"
SEED = SHARED / "seeds" / "000_afd61e3387a2a154.txt"
DEG, UM = np.pi / 180, 1e-6


@pytest.fixture(scope="module")
def device():
    return load_device(MESO_FILE)


@pytest.fixture(scope="module")
def data():
    return load_s0()[-1]


@pytest.fixture(scope="module")
def rows():
    return s0.rows()


# The recordings


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="no shared recordings beside the repository")
@pytest.mark.parametrize("name", ["commanded", "kinematic_model", "measured"])
def test_the_copied_poses_are_the_recordings(name) -> None:
    def read(path):
        return list(csv.reader(path.read_text().splitlines()))

    theirs, ours = read(RECORDINGS / f"{name}.csv"), read(SCENARIOS / "nist_hexapod" / f"{name}.csv")
    assert [int(row[0]) for row in theirs[1:]] == list(range(1, 55))  # the row is the pose in both
    assert [row[1:] for row in theirs[1:]] == ours[1:]
    assert [f"{c[: c.rindex('_')]} [{c[c.rindex('_') + 1 :]}]" for c in theirs[0][1:]] == ours[0]


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="no shared recordings beside the repository")
def test_the_copied_jacobian_is_the_recordings() -> None:
    theirs = [row for row in (RECORDINGS / "J_cube.csv").read_text().splitlines() if not row.startswith("#")]
    ours = (SCENARIOS / "nist_hexapod" / "J_cube.csv").read_text().splitlines()[1:]
    assert [row.partition(",")[2] for row in ours] == theirs


def test_poses_and_jacobian_are_read_in_si(data) -> None:
    assert data.measured[0] == pytest.approx(
        np.array([0.0998, -0.00081, 0.0004, 0, 0, 0]) * DEG + np.array([0, 0, 0, -1.15, 0.712, -0.58]) * UM, rel=1e-14
    )
    assert data.J_cube[0, 0] == pytest.approx(-1.51, rel=1e-14) and data.J_cube[5, 5] == 0.12492
    assert data.J_c[3, 1] == pytest.approx(0.27470 + 31.57 * -0.00089, rel=1e-14)  # eq. (15) by hand, in mm
    assert data.J_c[4, 1] == pytest.approx(-0.12952 - 31.57 * 0.00155, rel=1e-14)
    assert np.abs(data.inputs @ data.J_c.T - data.commanded).max() < 1e-15  # U_j = J_c^-1 T_j


def test_a_jacobian_file_with_faults_is_refused_line_by_line(tmp_path) -> None:
    text = (SCENARIOS / "nist_hexapod" / "J_cube.csv").read_text()
    axes = ("1x", "2x", "2y", "3x", "3y", "1y")
    bad = tmp_path / "J.csv"
    bad.write_text(text.replace("theta_y [rad/mm]", "theta_y [N]").replace("0.27679", "x"))
    with pytest.raises(InputError, match=r"(?s)line 3.*line 5"):
        read_jacobian(bad, axes)
    bad.write_text(text.replace("1x,2x", "2x,1x"))
    with pytest.raises(InputError, match="must name the actuators"):
        read_jacobian(bad, axes)
    bad.write_text("\n".join(text.splitlines()[:4]))
    with pytest.raises(InputError, match="six rows"):
        read_jacobian(bad, axes)


def test_the_errors_of_both_models_are_the_check_figures(data) -> None:
    model = pose_errors(data.measured, data.kinematic)
    calibrated = pose_errors(data.measured, data.inputs @ data.J_c.T)
    for errors, mean, largest, mean_turn, largest_turn, digits in (
        (calibrated, 1.585, 3.951, 0.00092, 0.00274, (3, 3, 5, 5)),
        (model, 9.32, 19.93, 0.0037, 0.0122, (2, 2, 4, 4)),
    ):
        ours = (
            errors.translation.mean() / UM,
            errors.translation.max() / UM,
            errors.rotation.mean() / DEG,
            errors.rotation.max() / DEG,
        )
        for value, known, places in zip(ours, (mean, largest, mean_turn, largest_turn), digits, strict=True):
            assert abs(value - known) <= 0.5 * 10.0**-places  # half a unit of PHYSICS.md


# Calibration


def planted(rng, n: int, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    J, U = rng.normal(size=(6, 6)), rng.uniform(-2e-4, 2e-4, (n, 6))
    return J, U, U @ J.T + rng.multivariate_normal(np.zeros(6), noise, n)


@pytest.fixture(scope="module")
def noise() -> np.ndarray:
    """Correlated noise of the instruments' size: some urad and a micrometre."""
    A = np.random.default_rng(5).normal(size=(6, 6)) * np.repeat([3e-6, 5e-7], 3)[:, None]
    return A @ A.T


def test_a_planted_jacobian_is_found_within_its_covariance(noise) -> None:
    rng, n, runs = np.random.default_rng(11), 20, 400
    inside, distance = 0.0, 0.0
    for _ in range(runs):
        J, U, T = planted(rng, n, noise)
        estimated, known = calibrate_jacobian(U, T), calibrate_jacobian(U, T, noise=noise)
        width = student.ppf(0.975, n - 6) * estimated.sd
        inside += np.mean(np.abs(estimated.jacobian - J) < width) / runs
        error = (known.jacobian - J).ravel()
        distance += error @ np.linalg.solve(known.covariance, error) / runs
    assert abs(inside - 0.95) < 0.01  # 14400 intervals, of which 400 are independent at worst: 0.011 x 0.9
    assert abs(distance - 36) < 4 * np.sqrt(2 * 36 / runs)  # chi-squared of 36 entries, four standard errors


def test_noise_is_estimated_from_the_residuals(noise) -> None:
    rng = np.random.default_rng(3)
    _, U, T = planted(rng, 4000, noise)
    found = calibrate_jacobian(U, T)
    sd = np.sqrt(np.diag(noise))
    assert np.abs((found.noise - noise) / np.outer(sd, sd)).max() < 5 * np.sqrt(2 / 4000)  # five standard errors
    assert found.residuals == pytest.approx(T - U @ found.jacobian.T, abs=1e-18)


def test_exact_recordings_give_the_jacobian_exactly(rng) -> None:
    J, U, T = planted(rng, 9, np.zeros((6, 6)))
    found = calibrate_jacobian(U, T)
    assert np.abs(found.jacobian - J).max() < 1e-13 * found.condition  # rounding of one least-squares solution
    assert found.condition == pytest.approx(np.linalg.cond(U), rel=1e-12)


def test_six_poses_give_equation_13_and_no_covariance(rng) -> None:
    U, T = rng.normal(size=(6, 6)) * 1e-4, rng.normal(size=(6, 6)) * 1e-4
    found = calibrate_jacobian(U, T)
    assert np.abs(found.jacobian - T.T @ np.linalg.inv(U.T)).max() < 1e-12 * found.condition
    assert found.covariance is None and found.noise is None and found.sd is None
    given = calibrate_jacobian(U, T, noise=np.eye(6) * 1e-14)
    assert given.sd == pytest.approx(np.tile(1e-7 * np.sqrt(np.diag(np.linalg.inv(U.T @ U))), (6, 1)), rel=1e-9)


def test_an_offset_of_home_is_told_from_the_jacobian(rng, noise) -> None:
    J, U, T = planted(rng, 54, noise)
    home = np.array([1e-5, -2e-5, 0, 1e-6, -3e-6, 2e-6])
    found = calibrate_jacobian(U, T + home, offset=True)
    assert (np.abs(found.offset - home) < 4 * np.sqrt(np.diag(found.offset_covariance))).all()  # four sd of six
    assert (np.abs(found.jacobian - J) < 5 * found.sd).all()
    assert np.sqrt(np.diag(found.offset_covariance)) == pytest.approx(np.sqrt(np.diag(found.noise) / 54), rel=0.2)


def test_a_calibration_moves_to_another_point_like_its_poses(p, rng, noise) -> None:
    _, U, T = planted(rng, 30, noise)
    Ad = ca.DM(meso_hexapod.cube_to_platform(p.cube.depth)).full()
    moved, again = calibrate_jacobian(U, T, offset=True).moved(Ad), calibrate_jacobian(U, T @ Ad.T, offset=True)
    for name in ("jacobian", "covariance", "noise", "offset", "offset_covariance", "residuals"):
        theirs = getattr(again, name)
        assert np.abs(getattr(moved, name) - theirs).max() < 1e-9 * np.abs(theirs).max(), name


def test_poses_that_cannot_calibrate_are_refused(rng) -> None:
    J, U, T = planted(rng, 12, np.zeros((6, 6)))
    with pytest.raises(InputError, match="5 poses cannot tell 6 inputs; record at least 6"):
        calibrate_jacobian(U[:5], T[:5])
    with pytest.raises(InputError, match="6 poses cannot tell 6 inputs and an offset; record at least 7"):
        calibrate_jacobian(U[:6], T[:6], offset=True)
    still = U.copy()
    still[:, 4] = still[:, 1]
    with pytest.raises(InputError, match=r"-?\+?0\.71 input 2 .*0\.71 input 5 stays still"):
        calibrate_jacobian(still, still @ J.T)
    with pytest.raises(InputError, match="no input moves"):
        calibrate_jacobian(0 * U, T)
    with pytest.raises(InputError, match="pose 4 has a value that is not finite"):
        calibrate_jacobian(U, np.where(np.arange(12)[:, None] == 3, np.nan, T))
    with pytest.raises(InputError, match="do not fit"):
        calibrate_jacobian(U, T[:5])
    with pytest.raises(InputError, match=r"noise: has shape \(5, 5\)"):
        calibrate_jacobian(U, T, noise=np.eye(5))


def test_single_motions_calibrate_the_coupled_ones(data) -> None:
    single, coupled = slice(0, 24), slice(24, 54)
    model = pose_errors(data.measured[coupled], data.kinematic[coupled])
    plain = calibrate_jacobian(data.inputs[single], data.measured[single])
    home = calibrate_jacobian(data.inputs[single], data.measured[single], offset=True)
    held = pose_errors(data.measured[coupled], data.inputs[coupled] @ plain.jacobian.T)
    with_home = pose_errors(data.measured[coupled], data.inputs[coupled] @ home.jacobian.T + home.offset)
    for part, gain in (("translation", 4), ("rotation", 3)):  # the paper claims four to five times over all 54
        errors, least, worst = (getattr(e, part).mean() for e in (held, with_home, model))
        assert errors < worst / gain
        assert least < 0.9 * errors  # home itself was off: seen in the single motions, true for the coupled ones


# Errors between poses


def test_statistics_are_those_worked_by_hand() -> None:
    measured = np.array([[3, 0, 4, 0, 0, 1], [0, 0, 0, 2, -1, -2.0]])
    errors = pose_errors(measured, np.zeros((2, 6)))
    assert errors.rotation.tolist() == [5, 0] and errors.translation.tolist() == [1, 3]
    assert errors.signed.maximum[5] == 1 and errors.signed.minimum[5] == -2 and errors.signed.mean[5] == -0.5
    assert errors.signed.sd[5] == pytest.approx(3 / np.sqrt(2)) and errors.absolute.sd[5] == pytest.approx(
        1 / np.sqrt(2)
    )
    with pytest.raises(InputError, match=r"shapes \(2, 6\) and \(1, 6\)"):
        pose_errors(measured, np.zeros((1, 6)))


def test_parasitic_motion_is_read_where_one_channel_alone_is_commanded(data) -> None:
    found = parasitic(data.commanded, data.measured)
    assert [part.channel for part in found] == ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]
    z = found[5]
    assert (z.poses + 1).tolist() == [24, 12, 6, 18] and z.command / UM == pytest.approx([-200, -100, 100, 200])
    assert z.measured / UM == pytest.approx([-201, -100, 99.1, 199]) and z.error / UM == pytest.approx(
        [-1, 0, -0.9, -1]
    )
    assert z.others[0] == pytest.approx(data.measured[23, :5], rel=1e-14) and z.channels[-1] == "delta_y"


def test_the_device_s_travel_covers_the_recorded_commands(device, data) -> None:
    for J in (matrices(device)["J_k"], data.J_c):
        assert 0.8 < np.abs(np.linalg.solve(J, data.commanded.T)).max() / device.travel.si < 1


# Rows and figures


def test_rounded_data_move_a_mean_by_three_standard_deviations() -> None:
    half = half_units(np.array([201.0, -9.81e-3, 0.0, 100.0, 1.0]), 3)
    assert half == pytest.approx([0.5, 5e-6, 0.0, 0.5, 5e-3])
    data, each = np.zeros(300), np.full(300, 0.5)
    moved = propagated_rounding(lambda x: np.array([x.mean()]), data, each)[0]
    assert moved == pytest.approx(3 * 0.5 / np.sqrt(3 * 300), rel=0.15)  # of 1000 draws: 2.6 to 3.4 sd


@pytest.mark.long
def test_every_row_has_its_own_place_and_says_why_it_differs(rows) -> None:
    assert len({row.where for row in rows}) == len(rows)
    assert all(
        row.reason for row in rows if row.status is not ReproductionStatus.REPRODUCED or row.tolerance is not None
    )


@pytest.mark.long
def test_what_follows_from_the_recordings_is_reproduced(rows) -> None:
    missed = [
        row.where
        for row in rows
        if row.where.startswith(("Table 2", "Table 3", "Section", "Abstract", "Conclusion", "Eq. (16)"))
        and row.ours is not None
        and row.status is not ReproductionStatus.REPRODUCED
    ]
    assert missed == []


def test_the_kinematic_numbers_follow_from_the_device_as_calculated_and_not_from_the_printed_one(rows) -> None:
    found = [row for row in rows if row.where.startswith(("Eq. (14)", "Table 4"))]
    assert len(found) == 36 + 324
    assert {row.status for row in found} == {ReproductionStatus.CORRECTED}


def test_what_the_scan_has_lost_is_restored_and_checked(rows) -> None:
    lost = [row for row in rows if row.printed == "lost"]
    assert len(lost) == 36 + 36  # eq. (10) and (15)
    assert not [row.where for row in lost if row.status is ReproductionStatus.DIFFERS]
    wrong = replace(lost[0], ours=lost[0].ours + 2 * lost[0].allowed)
    assert wrong.status is ReproductionStatus.DIFFERS


def test_six_numbers_of_s0_are_no_rounding_of_what_its_other_numbers_say(rows) -> None:
    differing = [row.where for row in rows if row.status is ReproductionStatus.DIFFERS]
    assert differing == [
        "Table 1, r_a from c_3 and c_4",
        "Table 1, r_a from Table 4",
        "Eq. (4), direction of 3x",
        "Eq. (4), direction of 3y",
        "Eq. (9), sense of 2y",
        "Eq. (9), sense of 3x",
        "Eq. (9), sense of 3y",
    ]


def test_each_number_of_table_1_alone_is_told_by_the_poses_but_not_all_together(data) -> None:
    printed, calculated, _ = load_s0()
    signs = (1.0, 1.0, -1.0, -1.0, -1.0, 1.0)
    fits = s0_fit.KinematicFit(calculated, data, s0_fit.EQUATION_9)
    radius = fits.length("r_a", signs)
    assert abs(radius.value - 64.291e-3) < 3 * radius.sd < 1e-5 and radius.misfit < 1.1  # 3.6 um of 10
    assert s0_fit.identifiable(calculated) == 3
    fits.numbers[0] = printed.hexapod.platform_radius.si
    others = [fits.length(name, signs).misfit for name in s0_fit.NUMBERS if name != "r_a"]
    assert min(others) > 10  # no other number makes up for 81.44 mm


@pytest.mark.skipif(not SEED.is_file(), reason="no shared source texts beside the repository")
def test_every_printed_text_stands_in_the_source(rows) -> None:
    text = SEED.read_text().replace("\u2212", "-").replace("$", " ")
    missing = [row.where for row in rows if row.printed not in text and row.printed != "lost"]
    assert missing == []


@pytest.mark.long
def test_figures_6_to_10_show_the_errors(data) -> None:
    drawings = s0_figures.figures(data)
    assert [name.partition(",")[0] for name in drawings] == [f"Fig. {k}" for k in range(6, 11)]
    assert all(text.startswith("<svg") for text in drawings.values())
    assert drawings == s0_figures.figures(data)  # no date, no random name
    calibrated = pose_errors(data.measured, data.commanded)
    figure = s0_figures.draw_norms(pose_errors(data.measured, data.kinematic), calibrated)
    shown = figure.axes[1].get_lines()[1].get_ydata()
    assert shown == pytest.approx(calibrated.translation / UM, rel=1e-12)
    single = s0_figures.draw_single(parasitic(data.commanded, data.measured)[:1])
    assert len(single.axes) == 4 and single.axes[0].get_lines()[0].get_ydata() == pytest.approx(
        [-0.199, -0.0996, 0.0998, 0.2], rel=1e-12
    )
