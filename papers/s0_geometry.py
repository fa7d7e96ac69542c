"""S0 section 2: lengths and angles of Table 1 from one another and from Table 4, the signs of eq. (9), the equations."""

from __future__ import annotations

from math import asin, degrees, radians, sin, sqrt

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.physics import meso_hexapod_kinematics as meso_hexapod

from .row import PrintedNumber, identity
from .s0_data import PaperRecordings
from .s0_fit import EQUATION_4, EQUATION_9, KinematicFit, SignFit, identifiable
from .s0_tables import s0_row

RADIUS = "r_a = 81.44 mm contradicts c_3, c_4 and L, which need 64.29 mm"


def table_1(device: MesoHexapod) -> list[PrintedNumber]:
    """Lengths and angles of Table 1 from one another: struts, spacings, and radii and angles back from spacings."""
    h = device.values().hexapod
    found = []
    length = float(ca.DM(meso_hexapod.home_lengths(h))[0])
    found.append(s0_row("Table 1, L from eq. (1)", "240", "mm", from_si(length, "mm"), reason=RADIUS))
    for end, radius, near, far, first, second, angles, base in (
        ("a", "r_a", "c_3", "c_4", "20", "100", ("189", "171", "69", "51", "-51", "-69"), 180.0),
        ("b", "r_b", "c_1", "c_2", "20", "230", ("236", "124", "116", "4", "-4", "-116"), -120.0),
    ):
        r = h.platform_radius if end == "a" else h.base_radius
        at = h.platform_angles if end == "a" else h.base_angles
        gaps = (at[2] - at[3], at[1] - at[2]) if end == "a" else (at[1] - at[2], at[2] - at[3])
        for name, text, gap in ((near, first, min(gaps)), (far, second, max(gaps))):
            chord, slack = 2 * r * sin(gap / 2), r * sin(radians(1.0))  # two angles known to half a degree
            reason = RADIUS if end == "a" else "angles are printed to the degree"
            found.append(
                s0_row(
                    f"Table 1, {name} from {radius} and its angles",
                    text,
                    "mm",
                    from_si(chord, "mm"),
                    extra=from_si(slack, "mm"),
                    reason=reason,
                )
            )
        a, b = float(first), float(second)
        R = sqrt((a * a + a * b + b * b) / 3)  # circle through a hexagon of alternate sides a and b
        slack = ((2 * a + b) + (a + 2 * b)) * 0.5 / (6 * R)
        text = "81.44" if end == "a" else "138.92"
        reason = RADIUS if end == "a" else "spacings are printed to the millimetre"
        found.append(s0_row(f"Table 1, {radius} from {near} and {far}", text, "mm", R, extra=slack, reason=reason))
        half = degrees(asin(a / (2 * R)))
        symbol = "phi" if end == "a" else "psi"
        around = (base + half, base - half, 60 + half, 60 - half, -60 + half, -60 - half)
        if end == "b":
            around = (240 - half, 120 + half, 120 - half, half, -half, -120 + half)
        for i, (text, angle) in enumerate(zip(angles, around, strict=True)):
            found.append(s0_row(f"Table 1, {symbol}_{i + 1} from {near} and {far}", text, "deg", angle))
    return found


def from_table_4(device: MesoHexapod, data: PaperRecordings) -> list[PrintedNumber]:
    """What Tables 2 and 4 and eq. (14) say of Table 1, of eq. (4) and of eq. (9)."""
    eq_4, eq_9 = (KinematicFit(device, data, printed) for printed in (EQUATION_4, EQUATION_9))
    signs = eq_9.signs()
    return [*_lengths(device, eq_9, signs), *_directions(device, eq_4.signs(), signs)]


def _lengths(device: MesoHexapod, fits: KinematicFit, signs: SignFit) -> list[PrintedNumber]:
    """Each number of Table 1 fitted alone, within three standard deviations."""
    told = identifiable(device)
    found = []
    for name, text, unit in (
        ("r_a", "81.44", "mm"),
        ("r_b", "138.92", "mm"),
        ("phi_1", "189", "deg"),
        ("psi_4", "4", "deg"),
        ("t", "13.2", "mm"),
        ("H", "221.93", "mm"),
    ):
        fit = fits.length(name, signs.signs)
        value, sd = float(from_si(fit.value, unit)), float(from_si(fit.sd, unit))
        reason = (
            f"fitted alone to 360 numbers of Tables 2 and 4: {value:.3f} within {sd:.2g} {unit}, misfit {fit.misfit:.2f} standard "
            f"deviations of rounding; of the six numbers the poses tell {told} combinations"
        )
        found.append(s0_row(f"Table 1, {name} from Table 4", text, unit, value, extra=3 * sd, reason=reason))
    return found


def _directions(device: MesoHexapod, eq_4: SignFit, eq_9: SignFit) -> list[PrintedNumber]:
    """Direction of each actuator in eq. (4), and its sense in eq. (9), 1 as printed, beside what meets the tables best."""
    taken = np.degrees(EQUATION_9)
    exchanged = (
        f"eq. (9) exchanges 3x and 3y: along eq. (4) the best of 64 combinations of senses is {eq_4.misfit:.0f} standard deviations "
        f"of rounding off, along eq. (9) {eq_9.misfit:.2f}"
    )
    reversed_ = (
        f"of 64 combinations of senses this one meets Tables 2 and 4 to {eq_9.misfit:.2f} standard deviations of rounding, the "
        f"next to {eq_9.next_misfit:.0f}"
    )
    if eq_4.misfit < eq_9.misfit:
        taken, exchanged = np.degrees(EQUATION_4), ""
    named = list(zip(device.axes, np.degrees(EQUATION_4), taken, eq_9.signs, strict=True))
    return [
        *(
            s0_row(f"Eq. (4), direction of {axis}", f"{p:.0f}", "deg", ours, reason=exchanged)
            for axis, p, ours, _ in named
        ),
        *(s0_row(f"Eq. (9), sense of {axis}", "1", "1", sign, reason=reversed_) for axis, _, _, sign in named),
    ]


def equations(device: MesoHexapod) -> list[PrintedNumber]:
    """Eq. (2), (3), (6) to (9): what they demand of each other, from finite differences of eq. (2)."""
    p = device.values()
    h, directions = p.hexapod, p.directions.jacobian
    pose, u = ca.SX.sym("pose", 6), ca.SX.sym("u", 6)
    lengths = meso_hexapod.home_lengths(h)
    closure = ca.Function("f", [pose, u], [meso_hexapod.constraint(pose, u, h, directions, lengths)])
    step, zero = 1e-6, np.zeros(6)  # metres and radians: rounding and third order stay below 1e-9 of the derivative

    def slope(column: int, of_pose: bool) -> np.ndarray:
        e = step * np.eye(6)[column]
        ends = [closure(x, zero) if of_pose else closure(zero, x) for x in (e, -e)]
        return (ends[0] - ends[1]).full().ravel() / (2 * step)

    left, right = (np.array([slope(k, of_pose) for k in range(6)]).T / 2 for of_pose in (True, False))
    J_l, J_r = (ca.DM(m).full() for m in (meso_hexapod.jacobian_left(h), meso_hexapod.jacobian_right(h, directions)))
    J_k = ca.DM(meso_hexapod.kinematic_jacobian(h, directions)).full()
    home = float(np.abs(closure(zero, zero).full()).max())
    checks = (
        ("Eq. (1), (2), home", home, 1e-15, "largest of the six constraints at home, beside L^2 = 0.06 m^2", "m^2"),
        ("Eq. (3), (7)", _apart(left, J_l), 1e-8, "[J_l] against half the differences of eq. (2)", "1"),
        ("Eq. (4), (9)", _apart(-right, J_r), 1e-8, "[J_r] against half the differences of eq. (2)", "1"),
        ("Eq. (5), (6)", _apart(J_l @ J_k, J_r), 1e-12, "[J_l] T - [J_r] U for the motion of each actuator", "1"),
    )
    reason = "; eq. (8) as printed has the wrong sign and A_y for A_x in its entry (3,2), which would fail here"
    return [
        identity("S0", where, ours, rounding, what + (reason if "(7)" in where else ""), unit)
        for where, ours, rounding, what, unit in checks
    ]


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())
