"""The equations of S1 up to one stage: screws, flexures, actuator, X-Y stage, against printed digits and textbooks."""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import asin, cos, isclose, pi, radians, sin, sqrt
from types import SimpleNamespace
from typing import Any

import casadi as ca
import direct_stiffness as direct
import numpy as np
import pytest
from matrices import array, numbers, replaced

from ctrlgen.physics import flexure, hexapod, screw, thermal_actuator, xy_stage

MICRO = 1e-6

# S1 eq. (5) in N, um, rad; its entry (6, 5) is printed -0.22
PRINTED_K_TB = """
    0     0        0         8.70e-2  0         0
    0     0       -2.16e-2   0        4.32e-5   0
    0     3.91e-2  0         0        0         7.83e-5
    3.06  0        0         0        0         0
    0     26.1     0         0        0         3.91e-2
    0     0        14.4      0       -0.0216    0
"""

# PHYSICS.md: d [um], F_l [N], F [N]
FORCE_TABLE = """
    5  .009478 .009542
    10 .018955 .019471
    15 .028433 .030174
    20 .037911 .042036
    25 .047388 .055446
    30 .056866 .070789
    35 .066344 .088450
    40 .075821 .108817
    45 .085299 .132274
    50 .094777 .159207
    55 .104254 .190000
"""


def half_units(text: str) -> np.ndarray:
    """Half a unit of the last digit of every number; 0 for a bare 0, which is a structural zero."""

    def half(word: str) -> float:
        return 0.0 if word == "0" else 0.5 * 10.0 ** int(Decimal(word).as_tuple().exponent)

    return np.array([[half(word) for word in line.split()] for line in text.strip().splitlines()])


def in_newton_micrometre(K: np.ndarray) -> np.ndarray:
    """Stiffness [N, N m per rad, m] in N, N um per rad, um."""
    return K * np.repeat([1, 1e6], 3)[:, None] * np.repeat([1, 1e-6], 3)


def by_work(matrix: Any) -> np.ndarray:
    """Block columns swapped, which pairs each motion with its own load, and scaled to a unit diagonal."""
    M = array(matrix)
    work = np.hstack([M[:, 3:], M[:, :3]])
    scale = np.sqrt(np.abs(np.diag(work)))
    return work / np.outer(scale, scale)


@pytest.fixture(scope="module")
def C_XY(p: SimpleNamespace) -> np.ndarray:
    return array(xy_stage.stage_compliance(p.stage, p.actuator))


# Screw algebra


def test_an_adjoint_carries_the_motion_and_the_load_of_one_body_between_points() -> None:
    p1 = (1.0, 2.0, 3.0)
    spin_about_p1 = array(screw.adjoint(None, p1)) @ [0, 0, 1, 0, 0, 0]
    force_at_p1 = array(screw.adjoint(None, p1)) @ [0, 0, 1, 0, 0, 0]
    # omega x (0 - p1) and p1 x F agree: (2, -1, 0), exact in integers.
    assert spin_about_p1.tolist() == force_at_p1.tolist() == [0, 0, 1, 2, -1, 0]


def rotation_x(angle: float) -> ca.DM:
    c, s = np.cos(angle), np.sin(angle)
    return ca.DM([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_an_adjoint_times_its_inverse_is_the_identity() -> None:
    R = ca.mtimes(screw.rotation_z(0.7), rotation_x(-1.1))
    product = array(ca.mtimes(screw.adjoint(R, (0.3, -2.0, 5.0)), screw.inverse_adjoint(R, (0.3, -2.0, 5.0))))
    assert np.abs(product - np.eye(6)).max() < 1e-14  # rounding of three products of entries up to 5


def test_moving_twice_is_moving_once_by_the_composed_displacement() -> None:
    C = flexure.blade_compliance(1.0, 0.1, 0.2, 1.0, 0.3)
    R1, R2 = rotation_x(0.4), screw.rotation_z(-1.3)
    d1, d2 = ca.DM([0.1, 0.2, -0.3]), ca.DM([-1.0, 0.5, 2.0])
    twice = array(screw.move(screw.move(C, R1, d1), R2, d2))
    once = array(screw.move(C, ca.mtimes(R2, R1), ca.mtimes(R2, d1) + d2))
    assert np.abs(twice - once).max() < 1e-13 * np.abs(once).max()  # rounding of six matrix products


def test_a_rotation_to_an_axis_is_a_proper_rotation_with_that_first_column() -> None:
    axis = np.array([0.36, -0.48, 0.8])
    R = array(screw.rotation_to(ca.DM(axis)))
    assert np.abs(R.T @ R - np.eye(3)).max() < 1e-15  # rounding of one normalisation
    assert isclose(np.linalg.det(R), 1, rel_tol=1e-15)  # same
    assert R[:, 0].tolist() == axis.tolist()


def test_inverting_a_compliance_twice_gives_it_back(p: SimpleNamespace) -> None:
    C = ca.DM(hexapod.inverse(hexapod.strut_stiffness(hexapod.strut_length(p.hexapod), p.hexapod)))
    again = by_work(screw.inverse(screw.inverse(C)))
    # A strut is 1e4 times stiffer along than across; two inversions in float64 lose at most 1e-16 x 1e6.
    assert np.abs(again - by_work(C)).max() < 1e-10


# Elementary flexures


def test_a_blade_bends_like_the_textbook_cantilever() -> None:
    L, t, w, E = 900e-6, 20e-6, 70e-6, 130e9
    C = array(flexure.blade_compliance(L, t, w, E, 0.28))
    expected = {
        (4, 1): 4 * L**3 / (E * w * t**3),  # F L^3/3EI across the thin side
        (5, 2): 4 * L**3 / (E * t * w**3),
        (2, 1): 6 * L**2 / (E * w * t**3),  # F L^2/2EI
        (1, 2): -6 * L**2 / (E * t * w**3),  # a force up turns the tip about -y
        (2, 5): 12 * L / (E * w * t**3),  # M L/EI
        (1, 4): 12 * L / (E * t * w**3),
        (3, 0): L / (E * w * t),
    }
    for place, value in expected.items():
        assert isclose(C[place], value, rel_tol=1e-14), place  # same formula, other order of rounding
    assert C[4, 5] == C[2, 1] and C[5, 4] == C[1, 2]


def test_a_thin_blade_twists_like_a_thin_strip() -> None:
    L, t, w, E, nu = 1e-3, 1e-9, 1e-3, 130e9, 0.28
    G = E / (2 * (1 + nu))
    C = array(flexure.blade_compliance(L, t, w, E, nu))
    assert isclose(C[0, 3], 3 * L / (G * w * t**3), rel_tol=1e-6)  # eq. (23) leaves 0.63 t/w = 6e-7


def test_a_square_bar_twists_with_the_torsion_constant_of_the_tables() -> None:
    assert isclose(flexure.torsion_ratio(1.0, 1.0) / 12, 0.1406, rel_tol=2e-3)  # eq. (23) is a fit, 0.1408


def test_a_wire_bends_like_the_textbook_cantilever() -> None:
    L, d, E, nu = 80e-6, 15e-6, 411e9, 0.28
    G = E / (2 * (1 + nu))
    C = array(flexure.wire_compliance(L, d, E, nu))
    expected = {
        (0, 3): 32 * L / (pi * G * d**4),
        (1, 2): -32 * L**2 / (pi * E * d**4),
        (1, 4): 64 * L / (pi * E * d**4),
        (2, 1): 32 * L**2 / (pi * E * d**4),
        (2, 5): 64 * L / (pi * E * d**4),
        (3, 0): 4 * L / (pi * E * d**2),
        (4, 1): 64 * L**3 / (3 * pi * E * d**4),
        (4, 5): 32 * L**2 / (pi * E * d**4),
        (5, 2): 64 * L**3 / (3 * pi * E * d**4),
        (5, 4): -32 * L**2 / (pi * E * d**4),
    }
    for place, value in expected.items():
        assert isclose(C[place], value, rel_tol=1e-14), place  # same formula, other order of rounding
    assert np.count_nonzero(C) == len(expected)


def test_two_half_wires_in_series_are_one_wire() -> None:
    L, d, E, nu = 80e-6, 15e-6, 411e9, 0.28
    half = flexure.wire_compliance(L / 2, d, E, nu)
    chain = array(screw.series((screw.move(half, None, (-L / 2, 0, 0)), half)))
    whole = array(flexure.wire_compliance(L, d, E, nu))
    assert np.allclose(chain, whole, rtol=1e-13, atol=0)  # sums of terms of one sign: rounding only


# Thermal actuator


def test_one_beam_reproduces_every_printed_digit_of_equation_5(p: SimpleNamespace) -> None:
    K = in_newton_micrometre(array(thermal_actuator.beam_stiffness(p.actuator)))
    # Printed to three digits: half a unit of the last one, plus rounding where zero is structural.
    assert (np.abs(K - numbers(PRINTED_K_TB)) <= half_units(PRINTED_K_TB) + 1e-15).all()


def test_equation_5_as_printed_breaks_reciprocity_only_at_its_misprint(p: SimpleNamespace) -> None:
    printed = numbers(PRINTED_K_TB)
    assert printed[5, 4] == printed[1, 2] and printed[4, 5] == printed[2, 1]
    K = in_newton_micrometre(array(thermal_actuator.beam_stiffness(p.actuator)))
    assert abs(K[5, 4] - (-0.22)) > 0.005  # half a unit of -0.22: the print cannot be meant


def test_the_actuator_reproduces_the_printed_entries_of_equation_6(p: SimpleNamespace) -> None:
    K = in_newton_micrometre(array(thermal_actuator.stiffness(p.actuator)))
    for place, value, half in (((0, 3), 1.33e-2, 5e-5), ((1, 4), 2.60, 5e-3), ((2, 5), 2.35e-3, 5e-6)):
        assert abs(K[place] - value) <= half, place  # half a unit of the last printed digit
    assert abs(K[0, 3] - 0.0133374) <= 5e-8  # half a unit of the last digit in PHYSICS.md


def test_the_actuator_is_as_stiff_as_thirty_cantilevers_on_a_rigid_bar(p: SimpleNamespace) -> None:
    K, reference = (
        by_work(M)
        for M in (thermal_actuator.stiffness(p.actuator), direct.to_si(direct.actuator_stiffness(p.actuator)))
    )
    assert np.abs(K - reference).max() < 1e-9  # one linear model solved twice in float64


def test_thermal_force_equals_equation_4_worked_by_hand(p: SimpleNamespace) -> None:
    # T = 250 degC: alpha = 3e-6 + 3e-9 * 250 = 3.75e-6 /K; rise 250 - 22 = 228 K; strain 3.75e-6 * 228 = 8.55e-4.
    # E w1 h = 130e9 * 22.3e-6 * 30e-6 = 86.97 N; 8.55e-4 * 86.97 N = 0.07435935 N a beam.
    # sin 0.068 = 0.068 - 0.068^3/6 + 0.068^5/120 = 0.068 - 5.240533e-5 + 1.212e-8 = 0.06794760679.
    # F = 2 * 15 * 0.07435935 N * 0.06794760679 = 2.2307805 N * 0.06794760679 = 0.15157620 N.
    by_hand = 0.15157620
    # Half a unit of the eighth digit
    assert isclose(thermal_actuator.force(250 + 273.15, p.actuator), by_hand, rel_tol=5e-8)


def test_temperature_for_a_force_solves_equation_4_backwards(p: SimpleNamespace) -> None:
    # strain s: 3e-9 T^2 + (3e-6 - 3e-9 * 22) T - 3e-6 * 22 - s = 0 in degC; the positive root.
    for wanted in (0.0, 0.045965, 0.19):
        s = wanted / (2 * 15 * 130e9 * 22.3e-6 * 30e-6 * sin(0.068))
        b = 3e-6 - 66e-9
        T = (-b + sqrt(b**2 + 4 * 3e-9 * (66e-6 + s))) / 6e-9
        # 1e-13 K of rounding in the root is 1e-16 N; the root itself cancels two digits near ambient.
        assert abs(thermal_actuator.force(T + 273.15, p.actuator) - wanted) < 1e-14


def test_thermal_force_vanishes_at_ambient(p: SimpleNamespace) -> None:
    assert thermal_actuator.force(p.actuator.ambient, p.actuator) == 0


def test_temperature_settles_at_ambient_plus_resistance_times_power(p: SimpleNamespace) -> None:
    a = p.actuator
    steady = a.ambient + 550 * 0.4  # 550 K/W at 0.4 W
    assert abs(thermal_actuator.temperature_rate(steady, 0.4, a)) < 1e-9  # 1e-13 K of rounding over 5 ms
    assert thermal_actuator.temperature_rate(a.ambient, 0.0, a) == 0


def test_a_heater_warms_when_driven_and_cools_in_five_milliseconds_when_not(p: SimpleNamespace) -> None:
    a = p.actuator
    assert isclose(thermal_actuator.temperature_rate(a.ambient, 0.4, a), 220 / 5e-3, rel_tol=1e-14)  # rounding
    assert isclose(thermal_actuator.temperature_rate(a.ambient + 100, 0.0, a), -100 / 5e-3, rel_tol=1e-14)  # rounding


# X-Y stage


@pytest.mark.parametrize("row", FORCE_TABLE.strip().splitlines(), ids=lambda row: f"{row.split()[0]} um")
def test_stage_force_reproduces_the_table(p: SimpleNamespace, row: str) -> None:
    d, linear, total = (float(word) for word in row.split())
    # 1e-5, or half a unit of the sixth decimal where the table itself carries fewer digits than that.
    assert isclose(xy_stage.linear_force(d * MICRO, p.stage, p.actuator), linear, rel_tol=1e-5, abs_tol=0.5e-6)
    assert isclose(xy_stage.force(d * MICRO, p.stage, p.actuator), total, rel_tol=1e-5, abs_tol=0.5e-6)


def test_stage_force_at_55_um_reproduces_the_printed_values(p: SimpleNamespace) -> None:
    # S1 section 6.2: half a unit of the last printed digit of 0.104 N and 0.19 N.
    assert abs(xy_stage.linear_force(55 * MICRO, p.stage, p.actuator) - 0.104) <= 5e-4
    assert abs(xy_stage.force(55 * MICRO, p.stage, p.actuator) - 0.19) <= 5e-3


@pytest.mark.parametrize("d_um", ["0.001", "1", "5", "20", "55", "900"])
def test_parasitic_shortening_keeps_full_precision(p: SimpleNamespace, d_um: str) -> None:
    d = float(d_um) * MICRO
    with localcontext() as context:
        context.prec = 60
        arm = Decimal(p.stage.lever_long)
        exact = float(arm - (arm**2 - Decimal(d) ** 2).sqrt())  # eq. (10) as printed
    # Rounding of five operations; the root of e4^2 - d^2 amplifies by at most e4^2/(e4^2 - d^2) = 5.
    assert isclose(xy_stage.parasitic(d, p.stage), exact, rel_tol=2e-15)


def test_nonlinear_force_is_the_axial_stiffness_turned_with_the_lever(p: SimpleNamespace) -> None:
    phi = asin(0.055)
    axial = p.stage.half_stage_stiffness * np.outer((cos(phi), sin(phi)), (cos(phi), sin(phi)))  # axis along y at home
    expected = 2 * 10 * axial[1, 0] * 1e-3 * (1 - cos(phi))
    # 1 - cos(phi) = 1.5e-3 cancels three digits of float64.
    assert isclose(xy_stage.nonlinear_force(55 * MICRO, p.stage), expected, rel_tol=1e-12)


def test_the_lever_turns_by_the_angle_whose_sine_is_travel_over_arm(p: SimpleNamespace) -> None:
    assert isclose(xy_stage.rotation(1e-3 * sin(radians(5)), p.stage), radians(5), rel_tol=1e-14)  # rounding


def reciprocal_matrices(p: SimpleNamespace) -> dict[str, Any]:
    return {
        "K_tb": thermal_actuator.beam_stiffness(p.actuator),
        "K_t": thermal_actuator.stiffness(p.actuator),
        "C_c": xy_stage.notch_compliance(p.stage),
        "K_X": xy_stage.axis_stiffness(p.stage, p.actuator),
        "C_XY": xy_stage.stage_compliance(p.stage, p.actuator),
        "K_s": hexapod.strut_stiffness(hexapod.strut_length(p.hexapod), p.hexapod),
    }


@pytest.mark.parametrize("name", ["K_tb", "K_t", "C_c", "K_X", "C_XY", "K_s"])
def test_a_spring_is_reciprocal_and_stores_positive_energy(p: SimpleNamespace, name: str) -> None:
    work = by_work(reciprocal_matrices(p)[name])
    assert np.abs(work - work.T).max() < 1e-10  # Betti is exact; inversions in float64 lose at most 1e-16 x 1e6
    assert np.linalg.eigvalsh((work + work.T) / 2).min() > 0.01  # unit diagonal: a cantilever has 1 - sqrt(3)/2 = 0.13


def test_the_notch_carries_the_printed_compliances(p: SimpleNamespace) -> None:
    C = array(xy_stage.notch_compliance(p.stage))
    to_micro = np.repeat([1, 1e6], 3)[:, None] * np.repeat([1, 1e-6], 3)  # um, N um
    printed = """
        0     0      0       9.12e-2  0        0
        0     0     -0.802   0        2.01e-2  0
        0     7.10   0       0        0        0.178
        1.51  0      0       0        0        0
        0     301.0  0       0        0        7.11
        0     0      42.6    0       -0.801    0
    """
    # Half a unit of the last printed digit; 1e-12 because the mean of two roundings lies exactly on that edge.
    assert (np.abs(C * to_micro - numbers(printed)) <= half_units(printed) * (1 + 1e-12) + 1e-15).all()


def test_the_x_stage_is_its_own_mirror_image(p: SimpleNamespace) -> None:
    """S1 section 3.4: blocks 1 and 2, 3 and 4 are symmetric about the actuated axis."""
    work = by_work(xy_stage.axis_stiffness(p.stage, p.actuator))  # (F; M) per (delta; theta)
    mirror = np.diag([1, -1, 1, -1, 1, -1])  # y -> -y turns vectors by (+, -, +), axial vectors by (-, +, -)
    assert np.abs(mirror @ work @ mirror - work).max() < 1e-10  # same rounding as reciprocity


def test_the_stage_is_as_stiff_as_its_frame_of_notches_and_levers(p: SimpleNamespace) -> None:
    s, a = p.stage, p.actuator
    errors = []
    for push in (1, -1):  # on which side of the levers the actuators' beams lie, only the lost figures show
        K_X = by_work(xy_stage.axis_stiffness(s, a)) - by_work(direct.to_si(direct.axis_stiffness(s, a, push)))
        C_XY = by_work(xy_stage.stage_compliance(s, a)) - by_work(direct.stage_compliance(s, a, push))
        errors.append(max(np.abs(K_X).max(), np.abs(C_XY).max()))
    assert min(errors) < 1e-9  # one linear model solved twice in float64


def test_with_ideal_hinges_and_rigid_levers_the_stage_is_as_stiff_as_its_force_law_says(p: SimpleNamespace) -> None:
    s, n, r, tiny = p.stage, p.stage.notch, p.stage.notch_radius, 1e-4
    c = n.theta_z_per_M_z
    hinge = replaced(
        n,
        theta_z_per_F_y=c * r,
        delta_y_per_M_z=c * r,
        delta_y_per_F_y=c * r**2 * (1 + 0.05 * tiny),
        delta_x_per_F_x=n.delta_x_per_F_x * tiny,
    )
    ideal = replaced(
        s, notch=hinge, lever_width=s.lever_width / tiny, half_stage_stiffness=s.half_stage_stiffness / tiny
    )
    on_stage = array(xy_stage.axis_stiffness(ideal, p.actuator))[0, 3]  # eq. (8)
    on_bar = xy_stage.linear_force(1.0, s, p.actuator)  # eq. (9), which counts notch rotations alone
    assert isclose(on_stage, on_bar / 10, rel_tol=1e-4)  # virtual work over the lever; `tiny` leaves about 1e-5


def test_every_number_of_the_stage_may_stay_a_symbol(p: SimpleNamespace) -> None:
    nominal = by_work(xy_stage.stage_compliance(p.stage, p.actuator))
    for name, value in vars(p.stage).items():
        if isinstance(value, float):
            symbol = ca.SX.sym(name)
            C = ca.Function("C", [symbol], [xy_stage.stage_compliance(replaced(p.stage, **{name: symbol}), p.actuator)])
            # The same equations eliminated in another order: rounding as in reciprocity.
            assert np.abs(by_work(C(value)) - nominal).max() < 1e-9, name
