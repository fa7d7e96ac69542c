from __future__ import annotations

import json
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICES
from matplotlib.patches import Ellipse

from ctrlgen import InputError, build_model, load_device, simulate
from ctrlgen.app.new_files.write import write_device
from ctrlgen.app.scenario_pipeline import map_workspace
from ctrlgen.app.workspace_summary import WorkspaceSummary
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.trajectory.workspace import Ball, Workspace, middle_pose
from ctrlgen.trajectory.workspace_plots import draw_workspace

UM = 1e-6


@pytest.fixture(scope="module")
def workspace(model):
    return Workspace(model)


def at(dz: float) -> np.ndarray:
    return np.array([0, 0, 0, 0, 0, dz * UM])


def test_without_stress_the_workspace_is_the_strokes_seen_through_the_jacobian(workspace, model):
    """Low down only the pushing directions bind: pure translation needs d = R(psi)' delta + the lift's share >= 0."""
    lift = ControllerKernels(model, "pose", None).static.displacement(model.rest, 0, at(10)).full().ravel()
    ranges = workspace.ranges(at(10))
    turns = np.deg2rad([0, -120, 120])
    x_needs = np.array([[np.cos(t), -np.sin(t)] for t in turns]).ravel()  # d per unit of delta_x on (1X, 1Y, 2X, ...)
    expected = max(
        lift[i] / -x_needs[i]
        for i in range(6)
        if x_needs[i] < -1e-9
        and lift[i] / -x_needs[i] == min(lift[k] / -x_needs[k] for k in range(6) if x_needs[k] < -1e-9)
    )
    assert ranges[3, 1] == pytest.approx(expected, rel=1e-9)


def test_its_boundary_is_where_the_controller_begins_to_report(workspace, model, rng):
    controller = controller_of(model, "pose", None)
    directions = rng.normal(size=(40, 6)) * np.array(model.signals["pose"].scale)
    far = workspace.reach(at(20), directions)
    for way, direction in zip(far, directions, strict=True):
        assert controller.step(controller.rest(), at(20) + 0.9999 * way * direction).status == 0
        assert controller.step(controller.rest(), at(20) + 1.0001 * way * direction).status != 0


def test_the_outline_is_convex(workspace):
    edge = workspace.outline(at(25), 3, 4)
    side = np.roll(edge, -1, axis=0) - edge
    turn = side[:, 0] * np.roll(side, -1, axis=0)[:, 1] - side[:, 1] * np.roll(side, -1, axis=0)[:, 0]
    assert turn.min() > -1e-16  # m^2: rounding of sides of micrometres


@pytest.mark.long
@pytest.mark.parametrize("channels", [(3, 4, 5), (0, 1, 2, 3, 4, 5)])
def test_the_largest_ball_is_inside_and_touches_on_all_sides(workspace, model, channels, rng):
    ball = workspace.ball(at(20), channels)
    scale = np.zeros(6)
    scale[list(channels)] = np.array(model.signals["pose"].scale)[list(channels)]
    directions = rng.normal(size=(20000, 6)) * (scale > 0)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    assert workspace.excess(ball.centre + 0.999 * ball.radius * directions * scale).max() <= 0
    reached = workspace.reach(ball.centre, directions[:2000] * scale)
    # Random directions seldom hit
    assert reached.min() == pytest.approx(ball.radius, rel=0.02 if len(channels) == 3 else 0.3)
    for shift in np.vstack([np.eye(6), -np.eye(6)])[:, list(channels)]:  # no centre nearby is better
        moved = ball.centre.copy()
        moved[list(channels)] += 0.05 * ball.radius * shift * scale[list(channels)]
        assert workspace.excess(moved + 1.002 * ball.radius * directions * scale).max() > 0


@pytest.mark.long
def test_no_pose_lies_beyond_the_ends(workspace, model, rng):
    """Boundary points in many directions stay inside the extent; the ends of each channel alone do not go as far."""
    extent = workspace.extent(at(20))
    directions = rng.normal(size=(3000, 6)) * np.array(model.signals["pose"].scale)
    edge = at(20) + workspace.reach(at(20), directions)[:, None] * directions
    size = np.diff(extent)[:, 0]
    assert (edge.min(axis=0) >= extent[:, 0] - 1e-4 * size).all() and (
        edge.max(axis=0) <= extent[:, 1] + 1e-4 * size
    ).all()
    alone = workspace.ranges(at(20))
    assert (alone[:, 0] >= extent[:, 0] - 1e-4 * size).all() and (alone[:, 1] <= extent[:, 1] + 1e-4 * size).all()
    assert np.diff(alone)[0, 0] < 0.9 * size[0]


@pytest.mark.long
@pytest.mark.parametrize(("channel", "side"), [(1, 1), (3, 0), (5, 1)])
def test_the_ends_are_those_of_a_nonlinear_programme(workspace, model, channel, side):
    """IPOPT over (state, displacement, drive) with the model's own equations: no inverse, no tangent planes."""
    x_free, z_free, u_free = (ca.SX.sym(name, 6) for name in "xzu")  # in typical sizes
    x, z, u = x_free * ca.DM(model.x_scale), z_free * ca.DM(model.z_scale), u_free * ca.DM(model.u_scale)
    free = ca.vertcat(x_free, z_free, u_free)
    rates, balance = model.dynamics(x, z, u, model.p_nominal)
    values = model.evaluate_limits(x, z, u, model.p_nominal)
    scale = [(limit.upper or 0.0) - (limit.lower or 0.0) or 1.0 for limit in model.limits]
    low = [
        -np.inf if m.lower is None else m.lower / s
        for m, s in zip(model.limits, scale, strict=True)
        for _ in m.channels
    ]
    high = [
        np.inf if m.upper is None else m.upper / s for m, s in zip(model.limits, scale, strict=True) for _ in m.channels
    ]
    pose = model.evaluate(x, z, u, model.p_nominal)[list(model.signals).index("pose")]
    goal = pose[channel] / model.signals["pose"].scale[channel]
    g = ca.vertcat(rates, balance / model.force_scale, *(v / s for v, s in zip(values, scale, strict=True)))
    quiet = {"ipopt.print_level": 0, "print_time": False}
    solver = ca.nlpsol("end", "ipopt", {"x": free, "f": goal * (1, -1)[side], "g": g}, quiet)
    start = np.concatenate([np.full(6, 150 + 273.15) / model.x_scale, [1.2, 2.2] * 3, np.full(6, 0.2) / model.u_scale])
    found = solver(x0=start, lbg=[0.0] * 12 + low, ubg=[0.0] * 12 + high)
    assert solver.stats()["success"]
    end = float(found["f"]) * (1, -1)[side] * model.signals["pose"].scale[channel]
    assert workspace.extent(at(20))[channel, side] == pytest.approx(end, rel=2e-4)


def test_a_base_that_cannot_be_held_is_refused(workspace):
    with pytest.raises(InputError, match="cannot be held"):
        workspace.ranges(np.array([0, 0, 0, 10 * UM, 0, 0]))


def test_table_3_lies_inside_and_the_unreachable_pose_outside(workspace):
    for k in range(6):
        pose = at(30)
        if k:
            pose[(None, 3, 4, 0, 1, 2)[k]] = (None, -10 * UM, -10 * UM, -4e-3, -4e-3, -4e-3)[k]
        assert workspace.holds(pose)
    assert not workspace.holds(np.array([0, 0, 0, 10 * UM, 0, 0]))


def test_without_a_third_translation_slices_are_at_the_middle_of_the_drives_and_halfway_up_and_down():
    """A planar stage: from where all drives are at half their range, half of what it can turn either way."""
    model = build_model(load_device(DEVICES / "rrr_case2.toml"))
    workspace = Workspace(model)
    below, middle, above = workspace.bases()
    turned = model.signals["pose"].channels.index("theta_z")
    z = np.array(simulate(model, np.array([np.mean(model.u_bounds, axis=0)]), 1e6).signals["pose"][-1])
    assert middle == pytest.approx(z, abs=1e-12)
    way = np.eye(3)[turned]
    down, up = workspace.reach(middle, np.vstack([-way, way]))
    assert below - middle == pytest.approx(-0.5 * down * way, abs=1e-15)
    assert above - middle == pytest.approx(0.5 * up * way, abs=1e-15)


@pytest.mark.long
def test_a_ball_is_drawn_where_a_view_has_two_of_its_channels():
    """The ball of a platform that tips, tilts and lifts is an interval of its one translation: an ellipse would leave the slices."""
    for name, views in (("tip_tilt_mirror", [0, 0]), ("mems_hexapod", [0, 1])):
        workspace = Workspace(build_model(load_device(DEVICES / f"{name}.toml")))
        figure = draw_workspace(
            workspace, workspace.bases(), workspace.ball(workspace.bases()[1], workspace.translations)
        )
        assert [sum(isinstance(p, Ellipse) for p in panel.patches) for panel in figure.axes] == views
        assert not any("e-" in text.get_text() for panel in figure.axes for text in panel.get_legend().get_texts())


def test_an_axis_alone_has_a_range_whose_ends_name_their_limits(tmp_path):
    """The coil's 1.5 A against 2662 N/m would be 2.1 mm: the stroke of 500 um ends both sides first."""
    summary = map_workspace(load_device(DEVICES / "parallelogram.toml"), [], tmp_path / "out")
    assert summary.extent[0] == pytest.approx([-500e-6, 500e-6], rel=1e-4)
    assert summary.bound_by == [("travel of coil", "travel of coil")] and summary.area is None
    numbers = json.loads((tmp_path / "out" / "workspace.json").read_text())
    assert numbers["bound_by"] == {"delta_x": ["travel of coil", "travel of coil"]}


def test_a_platform_that_only_tilts_has_an_area_of_angles(tmp_path):
    """Two of three feet are pushed: the strokes of both bound a parallelogram, 4 s^2 |det J|, in the angles."""
    text = (DEVICES / "tripod.toml").read_text()
    begin, end = text.index("[[actuator]]"), text.index("[[reading]]")
    foot = text[begin:end].replace('pattern = "leg"\n', "")
    feet = foot.replace('"coil"', '"a"') + foot.replace('"coil"', '"b"').replace(
        '["30 mm", "0 mm"', '["-15 mm", "26 mm"'
    )
    text = (text[:begin] + feet + text[end:]).replace(', "delta_z"]', "]")
    text = (
        text.replace('low = "-0.8 A"', 'low = "-80 A"')
        .replace('high = "0.8 A"', 'high = "80 A"')
        .replace('"400 MPa"', '"400 GPa"')
    )
    (tmp_path / "device.toml").write_text(text)
    device = load_device(tmp_path / "device.toml")
    summary = map_workspace(device, [], tmp_path / "out")
    model = build_model(device)
    J = ca.Function("J", [model.z], [ca.jacobian(model.signals["pose"].expr, model.z)])(0).full()
    assert summary.area == pytest.approx(4 * 400e-6**2 * abs(np.linalg.det(J)), rel=1e-4)
    assert "slice of theta_x and theta_y" in summary.shown_area and [what for what, _ in summary.balls] == ["rotations"]


@pytest.mark.parametrize(
    ("scale", "told"), [((1e-6, 1e-6), "15 um"), ((1e-6, 2e-6), "15 typical sizes"), ((1e-5, 1e-5), "150 um")]
)
def test_a_ball_has_its_radius_in_the_unit_of_its_channels_where_they_have_one(scale, told):
    signal = SimpleNamespace(scale=np.array(scale), units=("um", "um"))
    model = SimpleNamespace(signals={"pose": signal})
    summary = WorkspaceSummary(SimpleNamespace(model=model), [], [], None, None, None, [], None)
    assert summary.radius_of(Ball(np.zeros(2), 15.0, (0, 1))) == told


@pytest.mark.filterwarnings("error")
def test_drives_without_bounds_have_no_middle_and_no_warning_beside_the_reason(tmp_path):
    write_device(tmp_path / "axis.toml", "tested-axis")
    with pytest.raises(InputError, match="some drive has no bounds"):
        middle_pose(build_model(load_device(tmp_path / "axis.toml")))
