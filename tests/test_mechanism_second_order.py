"""Mechanisms to second order: closed forms, geometrically exact beams, the special hexapod's loop closure, and one energy for pose and
force."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE
from exact_joints import ExactJoints, jointed, relative
from mechanism_files import (
    HEAD,
    PARALLELOGRAM,
    REST,
    SPRING,
    TWO_BODIES,
    blade,
    dm,
    hinged,
    loaded,
    mems_hexapod_text,
    spring,
    with_values,
)
from scipy.integrate import trapezoid
from scipy.spatial.transform import Rotation

from ctrlgen import InputError, build_model, load_device, load_scenario, run, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.model.assembly import movable
from ctrlgen.numerics.constraint_second_order import second_order
from ctrlgen.physics import hexapod
from ctrlgen.physics.second_order_flexure import Segment, beam

LENGTH, THICKNESS = 20e-3, 0.2e-3  # of the blades of PARALLELOGRAM
SIX = 'channels = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]'
ALWAYS = 'kinematics = "second_order"\n'
SHARE = '[[effect]]\nkind = "finite_rotation"\nat = "all"\nshare = "1"\n'
TRIPOD = DEVICE.parent / "tripod.toml"


def skewed() -> str:
    """The parallelogram with blades of two lengths in planes of their own: nothing vanishes by symmetry."""
    right = blade("right", 10)
    other = right.replace('["10 mm", "0 mm", "0 mm"]', '["10 mm", "2 mm", "1 mm"]').replace("20 mm", "14 mm")
    other = other.replace("[0, 1, 0]", "[0.2, 1, 0.1]").replace("[-1, 0, 0]", "[-1, 0, 0.3]")
    return PARALLELOGRAM.replace(right, other).replace(
        blade("left", -10), blade("left", -10).replace("[0, 1, 0]", "[-0.1, 1, 0.2]")
    )


class Expanded:
    """A mechanism's motion of all six components of its output, and the force on its axes, by order."""

    def __init__(self, device) -> None:
        self.c = Condensed(*with_values(device))
        self.s = SecondOrder(self.c)
        x = ca.SX.sym("d", len(self.c.directions))
        point = self.c.output_point
        seen = self.s.seen(-1, device.bodies.index(device.output.body), point)
        self.K, self.J = dm(self.c.stiffness), dm(self.c.output_motion)
        self.second = ca.Function("second", [x], [ca.mtimes(seen, self.s.products(x))])
        self.force = ca.Function("force", [x], [self.s.restoring_force(x)])

    def pose(self, d) -> np.ndarray:
        return self.second(d).full().ravel()


def test_the_stage_of_a_parallelogram_comes_nearer_by_six_tenths_of_its_travel_squared_over_its_length(tmp_path):
    """-0.6 y^2/l (Awtar, Slocum, Sevincer 2007), for blades so thin that their own stretch, (t/l)^2 of it, is small; nothing else moves."""
    y, moved = 300e-6, Expanded(loaded(tmp_path, PARALLELOGRAM)).pose([300e-6])
    assert moved[4] == pytest.approx(-0.6 * y**2 / LENGTH, rel=3 * (THICKNESS / LENGTH) ** 2)
    assert np.abs(np.delete(moved, 4)).max() < 1e-12 * y


def exact(device, parts: int = 8):
    """The same mechanism of geometrically exact beams, where Exudyn is."""
    pytest.importorskip("exudyn", reason="no Exudyn to compare with: pip install ctrlgen[plant]")
    from exact_mechanism import ExactMechanism

    return ExactMechanism(device, parts)


def orders(device, direction, size: float, parts: int = 8) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Second order of the pose (6,) and of the force (n,) per size squared, by expansion and as geometrically exact beams have it: the
    even part of their answer to forces of both signs."""
    expanded, plant = Expanded(device), exact(device, parts)
    forces = expanded.K @ (np.asarray(direction) * size)
    d, pose, force = [], [], []
    for sign in (1, -1):
        state = plant.pushed(sign * forces, steps=4)
        d.append(plant.travel(state))
        pose.append(plant.output(state) - expanded.J @ d[-1])
        force.append(sign * forces - expanded.K @ d[-1])
    mine = [np.mean([law(x).full().ravel() for x in d], axis=0) for law in (expanded.second, expanded.force)]
    return mine[0], mine[1], np.mean(pose, axis=0), np.mean(force, axis=0)


def within(mine: np.ndarray, theirs: np.ndarray, rel: float) -> bool:
    """Rotations and displacements each within a share of the largest of them."""
    parts = (slice(0, 3), slice(3, 6)) if len(mine) == 6 else (slice(None),)
    return all(np.abs(mine[p] - theirs[p]).max() < rel * np.abs(theirs[p]).max() for p in parts)


def test_a_parallelogram_comes_nearer_as_geometrically_exact_beams_do(tmp_path):
    """Sixteen parts a blade follow its arc to 1e-4: their error falls with the square of their number."""
    device = loaded(tmp_path, PARALLELOGRAM)
    mine, _, theirs, _ = orders(device, [1.0], 200e-6, parts=16)
    assert mine[4] == pytest.approx(theirs[4], rel=2e-4)
    assert theirs[4] == pytest.approx(-0.6 * 200e-6**2 / LENGTH, rel=1e-3)


def test_skewed_blades_turn_shift_and_pull_as_geometrically_exact_beams_do(tmp_path):
    """All six components and the force, in which bending of blades, their twist and the turning of the body have part. Sixteen parts
    a blade leave 0.5 % where a blade both bends and twists, eight 2 %."""
    mine, force, theirs, exact_force = orders(loaded(tmp_path, skewed()), [1.0], 40e-6, parts=16)
    assert within(mine, theirs, 0.005)
    assert force == pytest.approx(exact_force, rel=1e-3)


def test_the_shipped_tripod_turns_and_pulls_as_geometrically_exact_beams_do():
    mine, force, theirs, exact_force = orders(load_device(TRIPOD), [1.0, -0.7, 0.4], 100e-6)
    assert within(mine, theirs, 0.002) and within(force, exact_force, 0.002)
    assert abs(theirs[2]) > 1e-6  # rad, of wires that stand along the tangents and shorten: no first order is in it


@pytest.fixture(scope="module")
def struts(tmp_path_factory):
    """The MEMS hexapod as a mechanism file."""
    return loaded(tmp_path_factory.mktemp("hexapod"), mems_hexapod_text(load_device(DEVICE)))


def test_the_hexapod_as_a_mechanism_turns_its_struts_as_its_special_loop_closure_nearly_says(struts):
    """Ideal pivots in the middle of the wires are near to the wires themselves: within 7 %, as the plant of exact beams shows in
    docs/loop.md (a share of 0.95)."""
    h, d = load_device(DEVICE).values().hexapod, np.array([12, 3, 18, 7, 1, 15]) * 1e-6
    loop = ca.DM(second_order(lambda pose, x: hexapod.loop_closure(pose, x, h), ca.DM(d))).full().ravel()
    mine = Expanded(struts).pose(d)
    for part in (slice(0, 3), slice(3, 6)):
        assert np.abs(mine[part] - loop[part]).max() < 0.07 * np.abs(loop[part]).max()
        assert mine[part] @ loop[part] < 0.999 * loop[part] @ loop[part]


def test_the_hexapod_as_a_mechanism_turns_as_geometrically_exact_struts_do(struts):
    """Within the third order's trace in the mean of two strokes of opposite sign, 1e-3."""
    plant, expanded, d = exact(struts), Expanded(struts), np.array([6, -3, 9, 4, -1, 7]) * 1e-6
    theirs = np.mean([plant.output(plant.stroked(sign * d)) - expanded.J @ (sign * d) for sign in (1, -1)], axis=0)
    assert within(expanded.pose(d), theirs, 0.01)


def test_what_a_mirror_turns_round_has_no_second_order(tmp_path):
    """A skewed blade and its image in x: what changes sign with x is odd in the travel, and the rest even."""
    skew = blade("left", -10).replace("[0, 1, 0]", "[-0.1, 1, 0.2]").replace("[-1, 0, 0]", "[-1, 0, 0.3]")
    text = PARALLELOGRAM.replace(blade("right", 10), "").replace(blade("left", -10), skew + 'pattern = "twin"\n')
    device = loaded(tmp_path, text.replace("[[body]]", '[[pattern]]\nname = "twin"\nmirror = "x"\n[[body]]'))
    expanded = Expanded(device)
    moved, odd = expanded.pose([100e-6]), [1, 2, 3]  # theta_y, theta_z, delta_x
    assert np.abs(moved[odd] / expanded.J.ravel()[odd]).max() < 1e-10 * 100e-6
    assert abs(moved[0]) > 1e-7 and moved[4] < -0.5 * 100e-6**2 / LENGTH
    assert np.abs(expanded.force([100e-6]).full()).max() < 1e-9 * expanded.K.max() * 100e-6


def test_a_point_flexure_is_the_same_from_both_of_its_ends(tmp_path):
    """Its stiffness holds in the axes halfway between its bodies: written from the plate to the ground it moves the plate alike."""
    first = SPRING.format(name="joint", first="ground", to="plate", x=0, c=5)
    second = SPRING.format(name="joint", first="plate", to="ground", x=0, c=5) + "along = [-1, 0, 0]\n"
    text = (
        HEAD
        + '[[body]]\nname = "plate"\n{}'
        + REST.replace("[1, 0, 0]", "[0.3, 1, 0.2]").replace('"0 mm", "0 mm", "0 mm"', '"9 mm", "4 mm", "2 mm"')
    )
    one, two = (Expanded(loaded(tmp_path, text.format(e))) for e in (first, second))
    d = [200e-6]
    assert pytest.approx(one.J, rel=1e-9, abs=1e-12) == two.J
    assert two.pose(d) == pytest.approx(one.pose(d), rel=1e-7) and np.abs(one.pose(d)[:3]).min() > 1e-8
    assert float(two.force(d)) == pytest.approx(float(one.force(d)), rel=1e-7)


def test_a_beam_in_pieces_is_the_same_beam():
    """Of every two loads: each piece goes on from the rotation in which the one before it ends."""
    whole = Segment(20e-3, 1e-6, 1e-12, 1e-12, 2e5, 0.8, 0.3, 0.5, 4e-6, 7e-6)
    pieces = [replace(whole, length=share * whole.length) for share in (0.2, 0.5, 0.3)]
    a, b = [i for i in range(6) for _ in range(6)], list(range(6)) * 6
    one, three = (ca.DM(beam(s, ca.DM.eye(6), a, b)).full() for s in ([whole], pieces))
    assert three == pytest.approx(one, rel=1e-10, abs=1e-12 * np.abs(one).max()) and np.count_nonzero(one) > 20


def test_the_end_of_an_arm_on_a_notch_turns_about_the_middle_of_the_notch(tmp_path):
    """Nearer by r theta^2/2, r = 32 mm from there and not 30 mm from the end of the notch; what the notch shears is below 1 % of r."""
    y, nearer = 1e-3, Expanded(loaded(tmp_path, hinged(2.0))).pose([1e-3])[3]
    assert nearer == pytest.approx(-(y**2) / (2 * 32e-3), rel=0.01)


def test_a_reading_of_second_order_is_seen_from_the_body_on_which_its_sensor_stands(tmp_path):
    """A displacement and a rotation, of a body that moves against one that does, from equilibria at finite rotations."""
    sensors = (
        '[[reading]]\nname = "gauge"\nbody = "b"\nagainst = "a"\nat = ["17 mm", "-5 mm", "4 mm"]\nalong = [2, -1, 2]\n'
    )
    sensors += '[[reading]]\nname = "level"\nbody = "b"\nagainst = "a"\nabout = [1, 2, -2]\n'
    c = Condensed(*with_values(loaded(tmp_path, jointed() + sensors)))
    expanded, exact, d = SecondOrder(c), ExactJoints(c), np.array([0.8, -0.5]) * 2e-4
    at = ca.SX.sym("d", 2)  # a gradient in the drawing's symbols takes seconds: it is made once
    assert expanded.restoring_force(at) is expanded.restoring_force(at)
    more = expanded.restoring_force(at, lambda x: x[0] ** 4) - expanded.restoring_force(at)
    assert dm(ca.substitute(more, at, ca.DM([0.5, 0.0]))).ravel() == pytest.approx([0.5, 0.0], rel=1e-9)  # 4 x^3

    def read(sign: float) -> np.ndarray:
        q = ca.SX(exact.held(sign * d)[0])
        seen = dm(relative(q[:6], q[6:], ca.DM([17e-3, -5e-3, 4e-3]), halfway=False)).ravel()
        return np.array([seen[3:] @ [2, -1, 2], seen[:3] @ [1, 2, -2]]) / 3

    even = (read(1) + read(-1)) / 2
    assert dm(expanded.sensed(ca.DM(d))).ravel() == pytest.approx(even, rel=2e-3)  # (d/l)^2 of it is of fourth order
    assert dm(c.reading_motion) @ d == pytest.approx((read(1) - read(-1)) / 2, rel=2e-3)


def test_the_effect_of_finite_rotation_adds_what_the_file_states_always(tmp_path):
    """share = 1 in the linear mechanism is the pose of `kinematics = "second_order"`; its force stays that of the linear one."""
    text = TRIPOD.read_text()
    always = build_model(loaded(tmp_path, ALWAYS + text))
    added = build_model(loaded(tmp_path, text + SHARE))
    d = [90e-6, -50e-6, 20e-6]
    poses = [
        ca.Function("p", [m.z], [m.signals["pose"].expr])(d).full()
        for m in (always, added, build_model(load_device(TRIPOD)))
    ]
    assert poses[0] == pytest.approx(poses[1], rel=1e-12)
    assert np.abs(poses[0] - poses[2]).max() > 1e-10
    assert set(always.force_parts) == {"linear", "geometric"}


@pytest.mark.long
def test_a_path_of_a_mechanism_of_second_order_is_solved_and_its_c_is_the_model(tmp_path):
    """The rotation of skewed blades is quadratic, and so is their force; drive and C follow both."""
    (tmp_path / "device.toml").write_text(ALWAYS + skewed().replace('channels = ["delta_x"]', 'channels = ["theta_z"]'))
    (tmp_path / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "20 ms"\n'
        '[path]\nkind = "line"\nstart = { theta_z = "-20 urad" }\nend = { theta_z = "30 urad" }\n'
    )
    device = load_device(tmp_path / "device.toml")
    solution, expanded = solve(load_scenario(tmp_path), build_model(device)), Expanded(device)
    d = solution.trace.signals["displacement"][-1]
    turned = expanded.J[2] @ d + expanded.pose(d)[2]
    assert turned == pytest.approx(30e-6, rel=1e-9)
    assert abs(expanded.pose(d)[2]) > 1e-4 * 30e-6
    assert solution.drive[-1, 0] == pytest.approx((expanded.K @ d + expanded.force(d).full().ravel())[0] / 2, rel=1e-9)
    assert run(tmp_path, tmp_path / "out").passed


def test_readings_of_second_order_are_those_of_points(tmp_path):
    """A gauge that looks along the blades sees the arc that the stage follows."""
    reading = '[[reading]]\nname = "gauge"\nbody = "stage"\nat = ["3 mm", "0 mm", "0 mm"]\nalong = [1, 1, 0]\n'
    model = build_model(loaded(tmp_path, ALWAYS + PARALLELOGRAM + reading))
    seen = ca.Function("r", [model.z], [model.signals["reading"].expr])(200e-6).full().ravel()
    nearer = 200e-6 - np.sqrt(2) * seen[1]
    assert nearer == pytest.approx(0.6 * 200e-6**2 / LENGTH, rel=3 * (THICKNESS / LENGTH) ** 2)


def test_numbers_of_the_drawing_may_be_free(tmp_path):
    """A diagnosis that fits a thickness has the pose and force of the fixed model at its number."""
    device = loaded(tmp_path, ALWAYS + skewed())
    free = tuple(name for name in movable(device) if name.endswith("thickness"))
    one, two = build_model(device, free=free), build_model(device)
    assert len(free) == 2
    for expression in (lambda m: m.signals["pose"].expr, lambda m: m.force_parts["geometric"]):
        a, b = (float(ca.Function("p", [m.z, m.p], [expression(m)])(30e-6, m.p_nominal)) for m in (one, two))
        assert a == pytest.approx(b, rel=1e-9) and a != 0


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ('kinematics = "exact"\n', "kinematics"),
        (ALWAYS, "the second order is that of linear flexures"),
    ],
)
def test_what_has_no_second_order_is_refused(tmp_path, key, says):
    push = (
        '[[actuator]]\nname = "stack"\nkind = "force"\non = "b"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
        'gain = "1 N/V"\nlow = "-9 V"\nhigh = "9 V"\ntravel = "50 um"\n'
        '[output]\nbody = "b"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'
    )
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, key + TWO_BODIES + spring('F_x_per_delta_x3 = "1e-3 N/um^3"', to="a") + push)
    assert says in str(caught.value)


def test_the_second_order_of_a_beam_that_shears_is_that_of_the_strains_of_a_finite_rotation():
    """Gamma = R'(e_x + u') - e_x and K = axis of R'R' of the linear shape, R = exp(psi), their even part in the load: bending, twist,
    stretch and shear together."""
    s = Segment(0.7, 1.0, 1.0, 1.0, 90.0, 3.0, 5.0, 2.0, 0.04, 0.09)
    load, n, h, size = np.array([2.0, 1.0, -1.5, 0.4, 0.3, -0.2]), 4001, 1e-5, 1e-3
    x, e = np.linspace(0, s.length, n), np.array([1.0, 0.0, 0.0])
    F, M = load[:3], load[3:]

    def strains(scale: float) -> np.ndarray:
        def psi(at: np.ndarray) -> np.ndarray:
            lever = at * (s.length - at / 2)
            bent = np.outer(at, M) + np.outer(lever, np.cross(e, F))
            return scale * bent / np.array([s.GJ, s.EI_y, s.EI_z])

        strain = scale * F * np.array([1 / s.EA, s.shear_y, s.shear_z])
        turned, back = Rotation.from_rotvec(psi(x)), Rotation.from_rotvec(psi(x - h))
        Gamma = turned.inv().apply(e + np.cross(psi(x), e) + strain) - e
        K = (back.inv() * Rotation.from_rotvec(psi(x + h))).as_rotvec() / (2 * h)
        return np.hstack([K, Gamma + np.cross(K, np.outer(s.length - x, e))])

    even = (strains(size) + strains(-size)) / 2 / size**2
    wanted = trapezoid(even, x, axis=0)
    found = ca.DM(beam([s], ca.DM(load), [0], [0])).full().ravel()
    assert found == pytest.approx(wanted, rel=1e-4, abs=1e-5 * np.abs(wanted).max()) and np.all(found != 0)
