"""Interferometers and an autocollimator on the faces of a cube, against rays that are traced to faces turned by matrices."""

from __future__ import annotations

import json
import tomllib

import casadi as ca
import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.spatial.transform import Rotation

from ctrlgen.budget.linear import propagate
from ctrlgen.budget.robust import solve
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.calibration import jacobian_page
from ctrlgen.calibration.home_returns import home_returns
from ctrlgen.calibration.instrument_share import instrument_shares
from ctrlgen.calibration.measured_jacobian import calibrate_poses
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import build_model
from ctrlgen.model.read_poses import ReadPoses
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.trajectory.scenario import load_scenario

FILE = SCENARIOS / "devices" / "meso_hexapod_as_calculated.toml"
TABLE = tomllib.loads(FILE.read_text())
R = 0.02  # m, from the point that is read to each face
UM, DEG = 1e-6, np.pi / 180
COMPONENTS = ("theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z")
DRIVES = ("1x", "2x", "2y", "3x", "3y", "1y")


def leaning(axis: int, toward: int, by: float) -> np.ndarray:
    n = np.eye(3)[axis] + by * np.eye(3)[toward]
    return n / np.linalg.norm(n)


def traced(poses: np.ndarray, x_face: np.ndarray, y_face: np.ndarray) -> np.ndarray:
    """What the instruments of S0 read of a cube with these normals: beams along x and y to the planes of its faces, a beam along z to the
    upper one, and where rays reflected by the y face (turns about x and z) and the x face (about y) go."""
    found = []
    for pose in poses:
        turn, shift = Rotation.from_rotvec(pose[:3]), pose[3:]
        read = []
        for axis, normal in ((0, x_face), (1, y_face), (2, np.eye(3)[2])):
            n, stands = turn.apply(normal), shift + turn.apply(R * np.eye(3)[axis])
            read.append(n @ stands / n[axis] - R)  # X = t e_axis in the plane n . (X - stands) = 0
        angles = {}
        for axis, normal, seen in ((1, y_face, (0, 2)), (0, x_face, (1,))):
            home, ray = np.eye(3)[axis], -np.eye(3)[axis]
            for about in seen:
                c = 3 - axis - about
                both = [r - 2 * (r @ n) * n for r, n in ((ray, normal), (ray, turn.apply(normal)))]
                went = [np.arctan2(r[c], r @ home) / 2 for r in both]  # half of what the ray turns
                angles[about] = (went[1] - went[0]) * np.cross(np.eye(3)[about], home)[c]
        found.append([angles[0], angles[1], angles[2], *read])
    return np.array(found)


def law(kind: str, at: str, of: str = "", **numbers: object) -> dict[str, object]:
    return {"kind": kind, "at": at, **({"of": of} if of else {}), **numbers}


def exact(xz: float, yz: float, yx: float) -> list[dict[str, object]]:
    """The laws of such a set-up, the leans of the faces by name [rad]; they shift the point that a beam meets by R times the lean."""
    mirrors = [law("plane_mirror", f"delta_{a}", share="1", position="20 mm") for a in "xyz"]
    seen = [("theta_x", "theta_y"), ("theta_y", "theta_x"), ("theta_z", "theta_y")]
    collimators = [law("autocollimator", at, of, share="1") for at, of in seen]
    faces = [("delta_x", "delta_z", xz), ("delta_y", "delta_z", yz), ("delta_y", "delta_x", yx)]
    leans = [law("mirror_tilt", at, of, tilt=f"{lean} rad") for at, of, lean in faces]
    leans += [law("face_tilt", f"theta_{a}", "theta_y", tilt=f"{lean} rad") for a, lean in (("x", yx), ("z", yz))]
    arms = [("delta_x", "theta_y", -xz), ("delta_y", "theta_x", yz), ("delta_y", "theta_z", -yx)]
    shifted = [law("abbe_arm", at, of, arm=f"{lean * R} m/rad") for at, of, lean in arms if lean]
    return [*mirrors, *collimators, *leans, *shifted]


def device(effects: list[dict[str, object]]) -> Device:
    return validate(Device.library["meso_hexapod"], {**TABLE, "effect": effects}, "cube")


def drawn(rng: np.random.Generator, n: int = 40) -> np.ndarray:
    """As far as S0 goes, all six components at once."""
    return rng.uniform(-1, 1, (n, 6)) * np.repeat([0.2 * DEG, 200 * UM], 3)


def test_the_laws_read_what_rays_do(rng):
    poses = drawn(rng)
    square = ReadPoses(device(exact(0, 0, 0)))
    rays = traced(poses, np.eye(3)[0], np.eye(3)[1])
    off = np.abs(square.readings(poses) - rays).max(axis=0)
    # The turns of a ray and of a normal part by the cube of the angle, 4e-8 rad at 0.2 deg
    assert off[3:].max() < 1e-15 and off[:3].max() < 5e-8
    # of second order: 200 um times 3.5 mrad, and half the product of two angles
    assert np.abs(rays - poses)[:, 3:].max() > 0.4 * UM and np.abs(rays - poses)[:, :3].max() > 1e-6
    lean = 2e-3  # rad, far more than any cube's: what is neglected is then seen
    tilted = ReadPoses(device(exact(lean, 2 * lean, -lean)))
    y_face = np.eye(3)[1] + lean * np.array([-1, 0, 2])
    rays = traced(poses, leaning(0, 2, lean), y_face / np.linalg.norm(y_face))
    off = np.abs(tilted.readings(poses) - rays).max(axis=0)
    moved = np.abs(rays - traced(poses, np.eye(3)[0], np.eye(3)[1])).max(axis=0)
    # what is neglected is a lean times two small motions, or its square times one
    assert np.all(off[3:5] < 0.01 * moved[3:5]) and np.all(off[[0, 2]] < 0.02 * moved[[0, 2]] + 5e-8)
    back = tilted.poses(tilted.readings(poses))
    assert np.abs(back - poses).max() < 1e-15


def test_a_law_of_a_reading_beside_the_pose_is_taken_out_and_is_none_of_the_pose(rng):
    """A gauge of the tripod, whose pose is (theta_x, theta_y, delta_z), that sees 3 mrad of another gauge's motion."""
    table = tomllib.loads((SCENARIOS / "devices" / "tripod.toml").read_text())
    lean = law("mirror_tilt", "gauge_2", "gauge_1", tilt={"value": "3 mrad", "sd": "1 mrad", "source": "test"})
    tripod = validate(Device.library["mechanism"], {**table, "effect": [lean]}, "tripod")
    moved = rng.uniform(-1, 1, (4, 6)) * 100 * UM
    whole, alone = ReadPoses(tripod), ReadPoses(tripod, pose_alone=True)
    read = moved + 3e-3 * moved[:, [3]] * np.eye(6)[4]
    assert np.allclose(whole.readings(moved), read, rtol=0, atol=1e-18) and np.allclose(
        whole.poses(read), moved, rtol=0, atol=1e-18
    )
    assert np.allclose(whole.slopes(moved)[:, 4, 0], -moved[:, 3], rtol=1e-12)
    assert np.array_equal(alone.readings(moved[:, :3]), moved[:, :3]) and not alone.slopes(moved[:, :3]).any()


def test_poses_are_found_to_rounding_by_a_law_that_is_curved():
    """A cubic law that moves readings by 5e-4 of the channel's size: one Newton step leaves 4e-10 of it, which is no rounding."""
    poses = np.zeros((5, 6))
    poses[:, 3] = 100 * UM * np.linspace(-1, 1, 5)
    curved = ReadPoses(device([law("cubic_sensor", "delta_x", curvature="5e4 1/m^2")]))
    read = curved.readings(poses)
    assert read[:, 3] == pytest.approx(poses[:, 3] * (1 + 5e4 * poses[:, 3] ** 2), rel=1e-12)
    assert np.abs(curved.poses(read) - poses).max() < 4 * np.finfo(float).eps * 100 * UM
    with pytest.raises(InputError, match="no pose has these readings"):
        curved.poses(np.full((1, 6), np.nan))


def test_what_an_instrument_may_feign_is_what_another_one_would_have_implied(rng):
    """A lean that is one sd larger than stated."""
    drive = rng.uniform(-1e-4, 1e-4, (30, 6))
    poses = drive @ planted(rng).T

    def leaning_mirror(tilt: str) -> ReadPoses:
        return ReadPoses(device([law("mirror_tilt", "delta_y", "delta_x", tilt={"value": tilt, "sd": "0.1 mrad"})]))

    stated, larger = leaning_mirror("1 mrad"), leaning_mirror("1.1 mrad")
    off = larger.poses(stated.readings(poses)) - poses
    assert off[:, 4] == pytest.approx(-1e-4 * poses[:, 3], rel=1e-6)
    assert stated.deviations(poses)[0] == pytest.approx(off, abs=1e-9 * np.abs(off).max())
    # It grows with the pose, which is linear in the drives: the Jacobian takes it over whole
    share = instrument_shares(device([]), stated, drive, poses)[0]
    assert share.translation == pytest.approx(1e-4 * np.abs(poses[:, 3]).max()) and share.rotation < 1e-12


def test_an_autocollimator_reads_within_its_accuracy_and_range(rng):
    seen = device([]).sensor[0]
    off = seen.read(np.full(10_000, 1e-3), rng) - 1e-3
    assert np.abs(off).max() <= 7e-5 * DEG and np.std(off) == pytest.approx(7e-5 * DEG / np.sqrt(3), rel=0.03)
    assert seen.reading_rate == pytest.approx(40 / 30)
    assert seen.read(np.array([-0.2749, 0.2749]) * DEG, rng).shape == (2,)
    for beyond in (-0.2751, 0.2751):
        with pytest.raises(ValueError, match=r"the range is -0\.275 deg to 0\.275 deg"):
            seen.read(np.array([0.0, beyond]) * DEG, rng)


def test_readings_that_say_nothing_of_the_pose_are_refused(rng):
    dead = ReadPoses(device([law("stuck", "delta_x", share="1", level="0 um")]))
    with pytest.raises(InputError, match="says nothing of the pose"):
        dead.poses(dead.readings(drawn(rng)))


def recording(folder, read: np.ndarray, drive: np.ndarray, held: int, noise: bool = False) -> None:
    """A recording of settled poses, the last `held` held out."""
    text = ",".join([*DRIVES, *COMPONENTS]) + "\n"
    text += "\n".join(
        ",".join(f"{v:.12g}" for v in row) for row in np.hstack([drive / UM, read[:, :3] / DEG, read[:, 3:] / UM])
    )
    (folder / "poses.csv").write_text(text + "\n")
    n = len(read) - held
    stated = {"t": ', noise = "0.1 urad"', "d": ', noise = "5 nm"'} if noise else {"t": "", "d": ""}
    columns = [f'"drive.{d}" = {{ column = "{d}", unit = "um" }}' for d in DRIVES]
    columns += [
        f'"reading.{c}" = {{ column = "{c}", unit = "{"deg" if c[0] == "t" else "um"}"{stated[c[0]]} }}'
        for c in COMPONENTS
    ]
    records = [
        f'[[record]]\nfile = "poses.csv"\nrole = "{role}"\nrows = [{a}, {b}]'
        for role, a, b in (("fit", 0, n), ("hold_out", n, len(read)))
    ]
    head = 'title = "traced"\ndevice = "meso_hexapod_as_calculated"\nkind = "poses"\n'
    (folder / "recording.toml").write_text("\n".join([head, *records, "[columns]", *columns]))


def planted(rng: np.random.Generator) -> np.ndarray:
    """A Jacobian that is not the described one: every entry of its own [rad/m, 1]."""
    return rng.uniform(-1, 1, (6, 6)) * np.repeat([2.0, 0.4], 3)[:, None] + np.diag(np.repeat([2.0, 0.4], 3))


def described(folder, effects: list[dict[str, object]]):
    """A device file with these sensor laws instead of its own."""
    text = FILE.read_text().split("# The instruments")[0]
    for effect in effects:
        text += "\n[[effect]]\n" + "".join(f'{key} = "{value}"\n' for key, value in effect.items())
    path = folder / "device.toml"
    path.write_text(text)
    return path


def test_a_calibrated_jacobian_is_that_of_the_poses_not_of_their_readings(tmp_path, rng):
    drive = rng.uniform(-0.2e-3, 0.2e-3, (30, 6))
    J = planted(rng)
    poses = drive @ J.T
    read = traced(poses, leaning(0, 2, 5e-4), np.eye(3)[1])
    recording(tmp_path, read, drive, held=8)
    off = []
    for effects in (exact(5e-4, 0, 0), []):
        found = calibrate_poses(described(tmp_path, effects), [tmp_path])
        off.append(np.abs(found.jacobian - J)[3:].max())
    assert off[0] < 2e-6 and off[1] > 1e-4  # nine digits in the file; a lean of 5e-4 unsaid


def test_leans_of_the_faces_are_fitted_with_their_standard_deviations(tmp_path, rng):
    """From traced readings, with noise, of the described device's own poses."""
    true = {"xz": 3e-4, "yz": -2e-4, "yx": 4e-4}
    drive = rng.uniform(-0.5e-3, 0.5e-3, (60, 6))
    hexapod = device([])
    model = build_model(hexapod)
    J = np.linalg.lstsq(drive, _poses(model, drive), rcond=None)[0].T
    poses = drive @ J.T
    y_face = np.array([true["yx"], 1, true["yz"]])
    noise = np.repeat([1e-7, 5e-9], 3) * rng.standard_normal(poses.shape)
    read = traced(poses, leaning(0, 2, true["xz"]), y_face / np.linalg.norm(y_face))
    recording(tmp_path, read + noise, drive, held=15, noise=True)
    laws = exact(0, 0, 0)
    cube = device(laws)
    taken = load_recordings([tmp_path], build_model(cube))
    fitter = Fitter(taken, estimate_noise(taken, 0.0))
    places = {"xz": 6, "yz": 7, "yx": 8}
    free = tuple(FreeParameter(f"effect[{k}].tilt", "rad", 0.0, -0.1, 0.1, 1e-3, 1e-3) for k in places.values())
    fit = fitter.fit(Structure(cube, free=free))
    sd = np.sqrt(np.diag(fit.covariance))
    assert np.all(np.abs(fit.theta - [true[k] for k in places]) < 4 * sd) and np.all(sd < 5e-5)


def test_an_autocollimator_may_feign_its_accuracy_at_the_largest_angle(rng):
    """Evenly distributed within 7e-5 deg (GUM 4.3.7), and taken over whole by a fit to angles that are linear in the drives."""
    cube, drive = device([]), rng.uniform(-0.2e-3, 0.2e-3, (30, 6))
    shares = instrument_shares(cube, ReadPoses(cube), drive, drive @ planted(rng).T)
    assert [s.rotation for s in shares] == pytest.approx([7e-5 * DEG / np.sqrt(3)] * 3, rel=1e-9)
    assert max(s.translation for s in shares) < 1e-18


def _poses(model, drive: np.ndarray) -> np.ndarray:
    read = ca.Function("pose", [model.z], [model.signals["pose"].expr])
    return np.array([read(u).full().ravel() for u in drive])


def test_home_returns_tell_drift_and_repeatability_and_are_one_pose(tmp_path, rng):
    n, drift, sd = 60, 20e-9, 50e-9
    drive = rng.uniform(-0.2e-3, 0.2e-3, (n, 6))
    drive[::4] = 0.0
    J = planted(rng)
    bent = (
        1e3 * (drive @ np.ones(6))[:, None] ** 2 * np.array([0, 0, 0, 1, 1, 1])
    )  # a lack of fit far above the repeatability
    clean = drive @ J.T + bent + np.outer(np.arange(n), [0, 0, 0, drift, 0, 0])
    read = clean + np.repeat([1e-7, sd], 3) * rng.standard_normal(clean.shape)
    recording(tmp_path, read, drive, held=16)
    found = calibrate_poses(described(tmp_path, []), [tmp_path])
    home = found.home
    assert home is not None and len(home.order) == 15 and len(found.held_out) == 45 and found.held_out.sum() == 12
    assert home.drift_interval[3, 0] < drift < home.drift_interval[3, 1] and home.drifts[3]
    low, high = home.repeatability_interval[3:].T
    assert np.all(low < home.repeatability[3:]) and np.sum((low < sd) & (sd < high)) >= 2
    trend = np.polyfit(np.flatnonzero(drive.any(axis=1)), found.after.errors[:, 3] - found.after.errors[:, 4], 1)[0]
    assert abs(trend) < 0.2 * drift  # both bend alike, and only the one drifted: sd 50 nm over 60 poses, 0.7 nm a pose
    # as rows of their own the homes would make the bend, which they do not have, look smaller
    away = drive.any(axis=1)[: n - 16]
    alone = np.vstack([drive[: n - 16][away], np.zeros(6)])
    spread = np.linalg.inv(
        np.column_stack([alone, np.ones(len(alone))]).T @ np.column_stack([alone, np.ones(len(alone))])
    )
    left = found.after.errors[~found.held_out][:, 4]
    # residuals of the poses alone, 33 of them less seven numbers, make the sd of an entry
    assert found.sd[4, 0] == pytest.approx(np.sqrt(left @ left / (len(alone) - 7) * spread[0, 0]), rel=0.02)
    jacobian_page.write_jacobian(tmp_path / "out", found)
    record = json.loads((tmp_path / "out" / "jacobian.json").read_text())
    assert record["home_returns"] == 15 and record["home"][3]["taken_out"]
    assert record["home"][3]["drift"] == pytest.approx(drift / UM, rel=0.2)
    assert "Home was read 15 times" in (tmp_path / "out" / "calibration.html").read_text()


def test_the_intervals_of_home_hold_what_they_say(rng):
    """95 of 100 synthetic drifts and repeatabilities, by draws; two returns say nothing."""
    inside = np.zeros(2)
    order = np.array([0, 3, 7, 12, 20, 21, 30])
    for _ in range(1000):
        home = home_returns(order, np.outer(order, np.full(6, 0.3)) + 2.0 * rng.standard_normal((7, 6)))
        for k, (interval, true) in enumerate(((home.drift_interval, 0.3), (home.repeatability_interval, 2.0))):
            inside[k] += np.mean((interval[:, 0] < true) & (true < interval[:, 1]))
    assert np.all(np.abs(inside / 1000 - 0.95) < 0.012)  # four standard deviations of six thousand draws
    assert home_returns(order[:2], np.zeros((2, 6))) is None


def test_the_shipped_device_states_its_instruments_and_the_budget_counts_them(tmp_path):
    (tmp_path / "scenario.toml").write_text(
        f'title = "circle"\ndevice = "{FILE}"\nsample_rate = "50 Hz"\nduration = "1 s"\n[path]\nkind = "circle"\ndiameter = "200 um"\n'
    )
    scenario = load_scenario(tmp_path)
    solution = solve(scenario, build_model(scenario.device))
    stated = load_uncertainties(scenario, solution.model)
    assert {line.kind for line in stated.lines} == {"sensor_law"} and len(stated.lines) == 5
    found = propagate(UncertainPath(solution, stated))
    sd, x = 8.1e-4 * DEG, found.nominal["pose"][:, 3]
    combined = found.combined("pose", stated)
    # the circle lies in the plane: of three leans of the cube that of y toward x alone reads it
    assert np.abs(combined[:, 4] - sd * np.abs(x)).max() < 1e-3 * sd * 100 * UM
    assert np.all(combined[:, [0, 1, 2, 3, 5]] < 1e-12)
