"""Circular-hinge equations of S2 against quadrature of beam theory; their ranges, their choice, the device section."""

from __future__ import annotations

import tomllib
import warnings
from itertools import pairwise
from math import cos, pi, sin

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices.hinge import Hinge
from ctrlgen.devices.quantities import si_namespace
from ctrlgen.devices.section import Section
from ctrlgen.physics import circular_hinge as c
from ctrlgen.physics import circular_hinge_table as table
from ctrlgen.physics.circular_hinge_table import ALPHA, DELTA_X, DELTA_Y, LOCKED, Geometry

R, B, E, NU = 3e-3, 12.7e-3, 71.7e9, 0.33  # S3 Table 1
G = E / (2 * (1 + NU))
THROUGHOUT = (0.05, 0.07, 0.1, 0.167, 0.2, 0.374, 0.5, 0.65, 0.764, 0.8)


def geometry(ratio: float, **other) -> Geometry:
    return Geometry(R, ratio * R, B, E, NU, **other)


def beam(ratio: float, what: str) -> float:
    """Beam theory over the circular profile, x = R sin(angle) from the middle, load at x = R."""
    t = ratio * R

    def per_angle(angle: float) -> float:
        h, arm, dx = t + 2 * R * (1 - cos(angle)), R * (1 - sin(angle)), R * cos(angle)
        return {
            "alpha": 12 * dx / (E * B * h**3),
            "couple": 12 * arm * dx / (E * B * h**3),
            "bend": 12 * arm**2 * dx / (E * B * h**3),
            "stretch": dx / (E * B * h),
            "shear": dx / (G * B * h),
        }[what]

    return quad(per_angle, -pi / 2, pi / 2, epsabs=0, epsrel=1e-13, limit=500, points=[0.0])[0]


EXACT = [
    (c.c1, "alpha", E),
    (c.c2, "bend", E),
    (c.c3, "stretch", E),
    (c.c4, "shear", G),
    (c.c11, "alpha", E),
    (c.c12, "bend", E),
    (c.c13, "stretch", E),
    (c.c14, "shear", G),
    (c.c18, "alpha", E),
    (c.c19, "bend", E),
    (c.c20, "stretch", E),
]


@pytest.mark.parametrize(("law", "what", "modulus"), EXACT, ids=[law.__name__ for law, *_ in EXACT])
@pytest.mark.parametrize("ratio", THROUGHOUT)
def test_closed_forms_equal_quadrature_of_beam_theory(law, what, modulus, ratio):
    assert law(R, ratio * R, B, modulus) == pytest.approx(beam(ratio, what), rel=1e-10)


@pytest.mark.parametrize("ratio", THROUGHOUT)
def test_lobontius_shear_part_with_factor_one_equals_quadrature(ratio):
    assert c.c21(R, ratio * R, B, E, G, 1.0) == pytest.approx(beam(ratio, "shear"), rel=1e-10)


@pytest.mark.parametrize("ratio", THROUGHOUT)
def test_force_turns_the_end_as_moment_shifts_it(ratio):
    C = planar(ratio, "wu_zhou")
    assert C[1, 2] == C[2, 1] == pytest.approx(beam(ratio, "couple"), rel=1e-10)
    assert np.linalg.eigvalsh(C / np.sqrt(np.outer(C.diagonal(), C.diagonal()))).min() > 0


def planar(ratio: float, equation, **other) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", table.HingeRangeWarning)
        return ca.DM(table.planar(geometry(ratio, **other), equation, "warn")).full()


@pytest.mark.parametrize(
    ("thin", "full", "modulus"),
    [(c.c5, c.c1, E), (c.c6, c.c2, E), (c.c7, c.c3, E), (c.c8, c.c4, G)],
    ids=["C.5", "C.6", "C.7", "C.8"],
)
def test_thin_hinge_limits_are_reached(thin, full, modulus):
    errors = [abs(thin(R, r * R, B, modulus) / full(R, r * R, B, modulus) - 1) for r in (1e-2, 1e-3, 1e-4, 1e-5)]
    assert all(later < earlier for earlier, later in pairwise(errors))
    assert errors[-1] < 1e-4  # C.5: t/8R; C.7: 1.5 (t/R)^(1/2) of the rounding 2.57 - (1 + pi/2) and of the next term


def test_zhang_and_fasse_with_the_missing_factor_is_a_compliance():
    assert c.c10(2 * R, 0.4 * R, B, E) == pytest.approx(c.c10(R, 0.2 * R, B, E) / 4, rel=1e-12)  # ~ 1/(E b R^2)
    assert c.c10(R, 0.2 * R, B, E) == pytest.approx(c.c22(R, 0.2 * R, B, E), rel=0.05)  # both fit finite elements


@pytest.mark.parametrize(("joint", "jump"), [(0.07, 0.85), (0.2, 0.81)])
def test_tseytlins_branches_do_not_meet(joint, jump):
    tseytlin = table.named(ALPHA, "tseytlin")
    below, above = (tseytlin.law(geometry(joint * side)) for side in (1.0, 1 + 1e-9))
    assert above / below == pytest.approx(jump, abs=0.005)


def test_tseytlins_factor_is_one_where_the_printed_equation_holds():
    thick = 4 * (1 + (1 + 0.5573 * 2 / 0.5) ** 0.5) / (2 * E * B * (0.25 * R) ** 2)
    assert c.c17(R, 0.5 * R, B, E, 0.333) == pytest.approx(thick, rel=2e-4)  # 0.889 is rounded
    assert c.c17(R, 0.5 * R, B, E, 0.2) / thick == pytest.approx((1 - 0.2**2) / 0.889, rel=1e-12)


def test_schotborghs_deflection_is_the_one_with_the_rotation_locked():
    free = c.c2(R, 0.374 * R, B, E)
    locked = free - R**2 * c.c1(R, 0.374 * R, B, E) + c.c21(R, 0.374 * R, B, E, G, 1.2)
    assert c.c23(R, 0.374 * R, B, E) == pytest.approx(locked, rel=0.2)
    assert free > 3 * c.c23(R, 0.374 * R, B, E)
    with pytest.raises(ValueError, match="rotation locked"):
        table.named(DELTA_Y, "schotborgh")
    assert table.compliance(LOCKED, geometry(0.374), "schotborgh").equation.number == "C.23"


S3_TABLE_3 = """
    alpha_z_per_M_z  paros_weisbord            0.05 0.1 open
    alpha_z_per_M_z  paros_weisbord_simplified 0.05 0.2
    alpha_z_per_M_z  lobontiu                  0.05 0.1 open
    alpha_z_per_M_z  wu_zhou                   0.05 0.1 open
    alpha_z_per_M_z  tseytlin                  0.4  0.6
    alpha_z_per_M_z  smith                     0.2  0.65
    alpha_z_per_M_z  schotborgh                0.05 0.65
    delta_y_per_F_y  paros_weisbord            0.05 0.1
    delta_y_per_F_y  paros_weisbord_simplified 0.05 0.1
    delta_y_per_F_y  lobontiu                  0.05 0.1
    delta_y_per_F_y  wu_zhou                   0.05 0.1
    delta_x_per_F_x  paros_weisbord            0.25 0.65
    delta_x_per_F_x  lobontiu                  0.25 0.65
    delta_x_per_F_x  wu_zhou                   0.25 0.65
"""


@pytest.mark.parametrize("row", [line.split() for line in S3_TABLE_3.strip().splitlines()], ids=" ".join)
def test_a_named_equation_is_refused_or_warns_outside_its_range(row):
    name, group, low, high, *open_end = row
    for ratio in (float(low), (float(low) + float(high)) / 2, float(high) * (1 - 1e-6 if open_end else 1)):
        found = table.compliance(name, geometry(ratio), group)
        assert found.holds and found.within == (float(low), float(high)) and found.note == ""
    for ratio in (float(low) - 1e-3, float(high) + (0 if open_end else 1e-3)):
        with pytest.raises(table.HingeRangeError, match=rf"holds at {low} <= t/R .*S3 Table 3.*use equation"):
            table.compliance(name, geometry(ratio), group)
    if group != "tseytlin":  # its branches end at 0.6
        with pytest.warns(table.HingeRangeWarning, match="outside its range"):
            assert not table.compliance(name, geometry(float(high) + 1e-3), group, "warn").holds


@pytest.mark.parametrize("group", ["paros_weisbord_simplified", "schotborgh"])
def test_what_nobody_recommends_is_refused_everywhere(group):
    for ratio in THROUGHOUT:
        with pytest.raises(table.HingeRangeError, match=r"no t/R|holds at no"):
            table.compliance(DELTA_X, geometry(ratio), group)


@pytest.mark.parametrize(
    ("name", "ratio", "group"),
    [
        (ALPHA, 0.05, "schotborgh"),
        (ALPHA, 0.15, "schotborgh"),
        (ALPHA, 0.5, "schotborgh"),
        (ALPHA, 0.65, "schotborgh"),
        (DELTA_Y, 0.05, "lobontiu"),
        (DELTA_Y, 0.1, "lobontiu"),
        (DELTA_X, 0.25, "paros_weisbord"),
        (DELTA_X, 0.65, "paros_weisbord"),
    ],
)
def test_auto_takes_the_smallest_mean_error_of_s3_table_3(name, ratio, group):
    found = table.compliance(name, geometry(ratio))
    assert found.holds and found.equation.group == group
    rivals = [e.errors[2] for e in table.EQUATIONS if e.compliance == name and e.errors and e.holds(ratio)]
    assert found.equation.errors[2] == min(rivals)


@pytest.mark.parametrize(
    ("name", "ratio", "group"),
    [
        (ALPHA, 0.764, "schotborgh"),
        (ALPHA, 0.02, "paros_weisbord"),
        (DELTA_Y, 0.167, "composed"),
        (DELTA_Y, 0.764, "composed"),
        (DELTA_X, 0.167, "paros_weisbord"),
    ],
)
def test_auto_says_where_s3_table_3_recommends_nothing(name, ratio, group):
    with pytest.warns(table.HingeRangeWarning, match="recommends no printed equation"):
        found = table.compliance(name, geometry(ratio))
    assert not found.holds and found.equation.group == group and found.note


def test_auto_refuses_a_hinge_nobody_has_compared():
    with pytest.raises(table.HingeRangeError, match=r"comparison ends at 0\.8"):
        table.compliance(ALPHA, geometry(0.81))


@pytest.mark.parametrize("ratio", THROUGHOUT)
def test_auto_is_positive_definite(ratio):
    C = planar(ratio, "auto")
    assert np.linalg.eigvalsh(C / np.sqrt(np.outer(C.diagonal(), C.diagonal()))).min() > 0


@pytest.mark.parametrize("ratio", [0.764, 0.374])
def test_s3_case_2_without_shear_is_refused_by_name(ratio):
    case_2 = {ALPHA: "schotborgh", DELTA_Y: "lobontiu", DELTA_X: "paros_weisbord"}
    with pytest.raises(ValueError, match=r"not positive definite.*Lobontiu.*Schotborgh"):
        planar(ratio, case_2, shear_factor=0.0)
    assert planar(ratio, case_2, shear_factor=1.5)[1, 1] > 0


def test_a_stretch_that_is_negative_is_refused():
    """C.7 falls below zero at t/R = 1.49, C.9 and C.6 stay positive."""
    mixed = {ALPHA: "smith", DELTA_Y: "paros_weisbord_simplified", DELTA_X: "paros_weisbord_simplified"}
    with pytest.raises(ValueError, match=r"delta_x_per_F_x by S2 C\.7.*is -.*must be positive"):
        table.planar(geometry(1.6), mixed, "accept")


def test_what_is_accepted_is_silent_and_still_noted():
    found = table.compliance(ALPHA, geometry(0.764), "paros_weisbord", "accept")  # a warning would be an error here
    assert not found.holds and "outside its range" in found.note


def test_symbols_go_through_and_the_number_selects():
    t = ca.SX.sym("t")
    with pytest.raises(ValueError, match="give `at`"):
        table.planar(Geometry(R, t, B, E, NU))
    with pytest.warns(table.HingeRangeWarning):
        C = table.planar(Geometry(R, t, B, E, NU, at=0.374))
    numeric = ca.Function("C", [t], [C])(0.374 * R).full()
    assert numeric == pytest.approx(planar(0.374, "auto"), rel=1e-14)  # the same operations
    slope = ca.Function("s", [t], [ca.jacobian(C[2, 2], t)])
    assert float(slope(0.374 * R)) < 0


# The section of a device file


class Part(Section):
    hinge: Hinge
    width: float = B


def part(text: str) -> Part:
    return validate(Part, tomllib.loads(text), "part.toml")


def test_a_hinge_in_a_device_file_takes_width_and_material_from_the_device():
    loaded = part('hinge = { kind = "circular", R = "1.1 mm", t = "0.84 mm", equation = "auto" }')
    with pytest.warns(table.HingeRangeWarning):
        C = loaded.hinge.planar(si_namespace(loaded.hinge, "", {}), b=B, E=E, nu=NU)
    assert float(C[2, 2]) == pytest.approx(c.c22(1.1e-3, 0.84e-3, B, E), rel=1e-12)
    with pytest.raises(ValueError, match="b is missing"):
        loaded.hinge.planar(si_namespace(loaded.hinge, "", {}), E=E, nu=NU)
    symbol = ca.SX.sym("t")
    with pytest.warns(table.HingeRangeWarning):
        free = loaded.hinge.planar(si_namespace(loaded.hinge, "hinge", {"hinge.t": symbol}), b=B, E=E, nu=NU)
    assert ca.DM(ca.substitute(free, symbol, 0.84e-3)).full() == pytest.approx(ca.DM(C).full(), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('R = "3 mm", t = "0.5 mm", equation = "paros_weisbord"', "holds at 0.05 <= t/R < 0.1"),
        ('R = "3 mm", t = "0.5 mm", equation = "smith"', "holds at 0.2 <= t/R"),
        ('R = "1 mm", t = "0.5 mm", equation = "smith"', "gives no delta_y_per_F_y"),
        ('R = "1 mm", t = "0.9 mm"', "comparison ends"),
        ('R = "1 mm", t = "0.5"', "no unit"),
        ('R = "1 mm", t = "0.5 mm", equation = "best"', "must be"),
    ],
)
def test_a_hinge_that_cannot_be_used_is_refused_on_loading(text, says):
    with pytest.raises(InputError, match=says):
        part(f'hinge = {{ kind = "circular", {text} }}')


def test_one_equation_per_compliance_as_in_s3_table_2():
    chosen = '{ alpha_z_per_M_z = "schotborgh", delta_y_per_F_y = "lobontiu", delta_x_per_F_x = "paros_weisbord" }'
    text = f'{{ kind = "circular", R = "1.87 mm", t = "0.7 mm", outside = "warn", equation = {chosen}, shear_factor = 1.5 }}'
    hinge = part(f"hinge = {text}").hinge
    assert hinge.equations == {ALPHA: "schotborgh", DELTA_Y: "lobontiu", DELTA_X: "paros_weisbord"}
