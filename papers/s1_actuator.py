"""S1 eq. (1) to (6): the thermal actuator's stiffness as printed, and the places of its beams that eq. (6) must have had."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.devices.mems_hexapod import MemsHexapod, matrices
from ctrlgen.physics.screw import move, rotation_z

from .row import PrintedNumber, half_unit

# Printed in N and um; (row, column) counted from 1.
K_TB = {
    (1, 4): "8.70e-2",
    (2, 3): "-2.16e-2",
    (2, 5): "4.32e-5",
    (3, 2): "3.91e-2",
    (3, 6): "7.83e-5",
    (4, 1): "3.06",
    (5, 2): "26.1",
    (5, 6): "3.91e-2",
    (6, 3): "14.4",
    (6, 5): "-0.22",
}
K_T = {
    (1, 4): "1.33e-2",
    (2, 3): "-498.0",
    (2, 5): "2.60",
    (3, 2): "0.368",
    (3, 6): "2.35e-3",
    (4, 1): "827.0",
    (5, 2): "174.0",
    (5, 6): "0",
    (6, 3): "1.23e5",
    (6, 5): "-498",
}
MISPRINTS = {(6, 5): "misprint: reciprocity with (2,3) demands -0.0216"}
PLACES = (
    ("half height of the bar, d_1", "50"),
    ("pitch of the beams, w_2 + w_3/2", "34.15"),
    ("first beam, w_2 + w_3/2", "34.15"),
)
STEPS = 5  # of Gauss-Newton; three suffice
START = (20e-6, 24e-6, 24e-6)  # m; as printed they lead to the same


def rows(device: MemsHexapod) -> list[PrintedNumber]:
    """Eq. (5) and (6), and what eq. (6) says of section 3.1 and Table 1."""
    places = _fitted(device)
    return [*_beam(device), *_actuator(device, places), *_places(device, places)]


def in_micrometres(matrix: np.ndarray, row: int, column: int) -> float:
    """An entry of a stiffness matrix in N and um: columns 4-6 are per um, rows 4-6 moments in N um."""
    return float(matrix[row - 1, column - 1]) * (1e6 if row > 3 else 1.0) * (1e-6 if column > 3 else 1.0)


def _beam(device: MemsHexapod) -> list[PrintedNumber]:
    K = matrices(device)["K_tb"]
    return [
        PrintedNumber("S1", f"eq. (5) ({i},{j})", printed, "N, um", in_micrometres(K, i, j), MISPRINTS.get((i, j), ""))
        for (i, j), printed in K_TB.items()
    ]


def _actuator(device: MemsHexapod, places: np.ndarray) -> list[PrintedNumber]:
    literal = matrices(device)["K_t"]
    corrected = _stiffness(device, ca.DM(matrices(device)["K_tb"]), *places)
    half, pitch, first = 1e6 * places
    said = (
        f"with the bar's half height {half:.1f} um (printed 50), the pitch {pitch:.1f} um and the first beam at {first:.1f} um (printed "
        "34.15): three lengths for five independent numbers; with one pitch from the first beam on, 20 and 23.8 um leave 0.35 %"
    )
    found = []
    for at, printed in K_T.items():
        reason = said
        if at == (5, 6):
            reason = "misprint: by reciprocity it equals (3,2), 0.368; the print has no number there"
        elif at == (3, 2):
            reason += (
                "; this entry then stays 0.2 % off, and no places of the beams meet it together with (2,3) and (5,2)"
            )
        ours, plain = in_micrometres(corrected, *at), in_micrometres(literal, *at)
        where = f"eq. (6) ({at[0]},{at[1]})"
        tolerance = half_unit(K_T[3, 2]) if printed == "0" else None
        row = PrintedNumber("S1", where, printed, "N, um", ours, reason, tolerance, taken_literally=plain)
        found.append(row.without_needless_reason())
    return found


def _places(device: MemsHexapod, places: np.ndarray) -> list[PrintedNumber]:
    literal = matrices(device)["K_t"]
    there = ", ".join(f"({i},{j}) would be {in_micrometres(literal, i, j):.4g}" for i, j in ((2, 3), (5, 2), (6, 3)))
    reason = f"fitted to eq. (6), whose six moment entries do not follow from the printed places: {there}"
    return [
        PrintedNumber("S1", f"section 3.1, {what}, from eq. (6)", text, "um", 1e6 * float(value), reason)
        for (what, text), value in zip(PLACES, places, strict=True)
    ]


def _stiffness(device: MemsHexapod, K: ca.DM, half: float, pitch: float, first: float) -> np.ndarray:
    """[K^t] of beams `K` at x = -(first + k pitch), k = 0 ... n - 1, on both sides of a bar of half height `half` [m], (6, 6) in SI."""
    angle, beams = device.actuator.beam_angle.si, round(device.actuator.beams.si)
    total = ca.DM.zeros(6, 6)
    for k in range(beams):
        for turn, side in ((ca.pi / 2 + angle, -1), (3 * ca.pi / 2 - angle, 1)):
            total += move(K, rotation_z(turn), (-(first + k * pitch), side * half, 0))
    return total.full()


def _fitted(device: MemsHexapod) -> np.ndarray:
    """Half height, pitch and first place [m] that meet eq. (6) best, each entry as well known as it is printed."""
    at, step, beam = np.array(START), 1e-9, ca.DM(matrices(device)["K_tb"])  # step in m

    def misfit(x: np.ndarray) -> np.ndarray:
        K = _stiffness(device, beam, *x)
        return np.array([(in_micrometres(K, *k) - float(t)) / half_unit(t) for k, t in K_T.items() if t != "0"])

    for _ in range(STEPS):
        r = misfit(at)
        slopes = np.array([(misfit(at + step * e) - r) / step for e in np.eye(3)]).T
        at = at - np.linalg.lstsq(slopes, r, rcond=None)[0]
    return at
