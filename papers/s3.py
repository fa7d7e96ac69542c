"""Every printed number of S3 that the kinetostatic model gives: Tables 1, 4, 5 and 6 and the numbers of its text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.devices.rrr_stage import stage
from ctrlgen.physics.rrr_kinetostatics import Kinetostatics

from . import s3_shear
from .row import PrintedNumber, half_unit, identity, no_number
from .s3_lengths import corrected, diagnosis, fit, printed_device
from .s3_tables import (
    CASES,
    RATIOS,
    SIGN_LOST_4,
    SIGN_LOST_6,
    TABLE_4,
    TABLE_5,
    TABLE_6,
    entries,
    unit,
)

POINT = 0.1  # percentage points that Table 6 may be off, because it and the entries of Table 5 are rounded
# The same with the input compliance that (B.83) leaves out
COMPLETE = {
    "C_inFin": "input_compliance",
    "J": "complete_J",
}
LENGTHS_FITTED = "follows with l1 = 47.900 mm and l2 = 22.170 mm (printed 17.9 and 22.2), as fitted to Table 4"
STRUCTURAL = "zero by the threefold symmetry; allowed: rounding of the model"


SCHEME = "scheme of the hinge or of appendix B; the model's equations are tested one by one against it"
FIGURES = (
    ("Fig. 1", SCHEME),
    ("Fig. 2", SCHEME),
    ("Fig. 3", "redrawn on the page from our own finite elements; its errors are those of Table 3, alpha_z/M_z"),
    ("Fig. 4", "redrawn on the page from our own finite elements; its errors are those of Table 3, delta_y/F_y"),
    ("Fig. 5", "redrawn on the page from our own finite elements; its errors are those of Table 3, delta_x/F_x"),
    *((f"Fig. {k}", SCHEME) for k in range(6, 12)),
    ("Fig. 12", "drawing of the stage; its lengths are those of Table 1"),
    ("Fig. 13", "the paper's finite-element mesh; its results are Table 5"),
)


def rows() -> list[PrintedNumber]:
    """The printed numbers of S3, in the order of the paper."""
    return [
        *_table_1(),
        *s3_shear.rows(),
        *_equations(),
        *_text_on_coupling(),
        *_table_4(),
        *_table_5(),
        *_table_6(),
        *_text_on_agreement(),
        *_figures(),
    ]


@cache
def stage_of_case(case: int) -> Kinetostatics:
    """Compliances and Jacobian of the stage of case 1 or 2, with the corrected lengths."""
    return stage(printed_device(case), corrected(case))


def computed(case: int, symbol: str, i: int, j: int, k: Kinetostatics | None = None) -> float:
    """Entry (i, j), counted from 1, in the unit of the print; by default of the corrected stage."""
    matrix = ca.DM(getattr(stage_of_case(case) if k is None else k, symbol)).full()
    return float(from_si(matrix[i - 1, j - 1], unit(symbol, i, j)))


@cache
def stage_as_printed(case: int) -> Kinetostatics:
    """Compliances and Jacobian of the stage of case 1 or 2, with the lengths of Table 1."""
    return stage(printed_device(case))


def _entry_row(where: str, case: int, symbol: str, i: int, j: int, text: str, reason: str) -> PrintedNumber:
    ours, literal = computed(case, symbol, i, j), computed(case, symbol, i, j, stage_as_printed(case))
    place, u = f"{where}, {symbol} ({i},{j})", unit(symbol, i, j)
    if text == "0":
        rounding = 1e-9 * float(from_si(np.abs(ca.DM(getattr(stage_of_case(case), symbol)).full()).max(), u))
        return PrintedNumber("S3", place, text, u, ours, STRUCTURAL, rounding)
    return PrintedNumber("S3", place, text, u, ours, reason, taken_literally=literal)


def _table_1() -> Iterator[PrintedNumber]:
    best = diagnosis()[0]
    printed = printed_device(1).lengths
    for name in best.lengths:
        text = getattr(printed, name).text.split()[0]
        if name in best.freed:
            length = best.lengths[name]
            reason = (
                f"fitted to Table 4 with {' and '.join(best.freed)} and the frame angle free; no other pair of lengths "
                "puts every entry within its last digit"
            )
        else:
            length = fit(*best.freed, name).lengths[name]
            reason = f"recovered from Table 4 together with {' and '.join(best.freed)}"
        yield PrintedNumber("S3", f"Table 1, {name}", text, "mm", float(from_si(length, "mm")), reason)
    device = printed_device(1)
    for k, text in RATIOS.items():
        yield PrintedNumber("S3", f"Table 1, t/R of hinge {k}", text, "1", device.hinges[f"hinge{k}"].ratio)


def _text_on_coupling() -> Iterator[PrintedNumber]:
    for case in CASES:
        ratio = -computed(case, "C_inFin", 1, 1) / computed(case, "C_inFin", 1, 2)
        reason = (
            "" if case == 1 else "said of both cases, holds for case 1; case 2's own Table 4 gives 0.175/0.024 = 7.3"
        )
        yield PrintedNumber(
            "S3", f"section 4.1, C_inFin diagonal over off-diagonal, case {case}", "8", "1", ratio, reason
        )


def _table_4() -> Iterator[PrintedNumber]:
    for case in CASES:
        for symbol, i, j, text in entries(TABLE_4[case]):
            reason = LENGTHS_FITTED
            if (case, symbol, i, j) in SIGN_LOST_4:
                reason = "printed without its minus sign: the entries of this row are equal by symmetry"
            yield _entry_row(f"Table 4, case {case}", case, symbol, i, j, text, reason)


def _table_5() -> Iterator[PrintedNumber]:
    for symbol, i, j, text in entries(TABLE_5):
        yield _entry_row("Table 5", 2, symbol, i, j, text, _gap(symbol, i, j, text))


def _gap(symbol: str, i: int, j: int, text: str) -> str:
    """Why the model, case 2, differs from the finite elements, and by how much."""
    if text == "0":
        return ""
    gap = "finite elements; ours is case 2, rigid links on hinge equations: {:+.1f} %"
    reason = gap.format(100 * (computed(2, symbol, i, j) / float(text) - 1))
    if symbol in COMPLETE:
        matrix = ca.DM(getattr(stage_of_case(2), COMPLETE[symbol])).full()
        complete = float(from_si(matrix[i - 1, j - 1], unit(symbol, i, j)))
        reason += f", {100 * (complete / float(text) - 1):+.1f} % with the input compliance that (B.83) leaves out"
    return reason


@dataclass(frozen=True)
class FiniteElementValue:
    """A finite-element number of Table 5: `value` in the printed unit, and a `reason` where it is not the printed number."""

    value: float
    reason: str


def finite_element_value(symbol: str, i: int, j: int) -> FiniteElementValue:
    """The finite-element value from which Table 6 was computed.

    The printed number, unless it has too few digits for Table 6: then the number within half its last digit that fits both
    cases best.
    """
    text = next(t for s, row, column, t in entries(TABLE_5) if (s, row, column) == (symbol, i, j))
    printed, ours, percent = float(text), [], []
    for case in CASES:
        ours.append(computed(case, symbol, i, j))
        percent.append(_percent(case, symbol, i, j))
    if all(abs(100 * (a / printed - 1) - p) <= POINT for a, p in zip(ours, percent, strict=True)):
        return FiniteElementValue(printed, "")
    implied = float(np.mean([a / (1 + p / 100) for a, p in zip(ours, percent, strict=True)]))
    value = float(np.clip(implied, printed - half_unit(text), printed + half_unit(text)))
    return FiniteElementValue(
        value, f"finite elements taken as {value:.5f}, which rounds to the printed {text}: one number for both cases"
    )


def _percent(case: int, symbol: str, i: int, j: int) -> float:
    """The number of Table 6, with its minus sign where the print has lost it."""
    text = next(t for s, row, column, t in entries(TABLE_6[case]) if (s, row, column) == (symbol, i, j))
    return -float(text) if (case, symbol, i, j) in SIGN_LOST_6 else float(text)


def _table_6() -> Iterator[PrintedNumber]:
    for case in CASES:
        for symbol, i, j, text in entries(TABLE_6[case]):
            fea = finite_element_value(symbol, i, j)
            ours = 100 * (computed(case, symbol, i, j) / fea.value - 1)
            lost = (case, symbol, i, j) in SIGN_LOST_6
            reason = (
                "; ".join(part for part in ("printed without its minus sign" if lost else "", fea.reason) if part)
                or "0.1 percentage point: Table 5 is rounded"
            )
            literal = 100 * (computed(case, symbol, i, j, stage_as_printed(case)) / fea.value - 1)
            where = f"Table 6, case {case}, {symbol} ({i},{j})"
            yield PrintedNumber("S3", where, text, "%", ours, f"{reason}; {LENGTHS_FITTED}", POINT, literal)


def _text_on_agreement() -> Iterator[PrintedNumber]:
    """The largest differences of case 2 that section 5.1.1 and the conclusions state."""
    for place, symbol, text in (("kinematics", "J", "13"), ("input", "C_inFin", "4"), ("output", "C_oFo", "6")):
        worst = max(
            abs(100 * (computed(2, symbol, i, j) / finite_element_value(symbol, i, j).value - 1))
            for s, i, j, _ in entries(TABLE_6[2])
            if s == symbol
        )
        yield PrintedNumber("S3", f"section 5.1.1, largest difference of {place}, case 2", text, "%", worst)


def _equations() -> Iterator[PrintedNumber]:
    """Eq. (1) to (7): loads on platform and inputs, and the Jacobian, by the matrices of case 2."""
    k = stage_of_case(2)
    C_oFin, C_inFo, C_in, J = (ca.DM(m).full() for m in (k.C_oFin, k.C_inFo, k.C_inFin, k.J))
    F_o, F_in = np.array([1.0, -2.0, 0.03]), np.array([5.0, 7.0, -3.0])  # N, N m
    work = F_o @ (C_oFin @ F_in) - F_in @ (C_inFo @ F_o)
    size = abs(F_in @ (C_inFo @ F_o))
    free = C_oFin @ F_in - J @ (C_in @ F_in)
    scale = np.abs(C_oFin @ F_in).max()
    yield identity(
        "S3",
        "eq. (1), reciprocity",
        work / size,
        1e-9,
        "work of the platform's load on the inputs' motion, less the other",
    )
    what = "U_o of three input forces by eq. (3), less J U_in by eq. (5): no load on the platform"
    yield identity("S3", "eq. (2) to (7)", float(np.abs(free).max() / scale), 1e-9, what)
    yield from (_definiteness(case) for case in CASES)


def _definiteness(case: int) -> PrintedNumber:
    """Whether eq. (1) lets no load take energy out: the smallest eigenvalue of its 6 x 6 matrix, which Table 4 makes negative."""
    k = stage_of_case(case)
    C_oFo, C_oFin, C_in, complete = (ca.DM(m).full() for m in (k.C_oFo, k.C_oFin, k.C_inFin, k.input_compliance))
    least = [float(_eigenvalues(C_oFo, C_oFin, C)[0]) for C in (C_in, complete)]
    printed, elements = (
        {
            symbol: np.array([[float(x) for x in row.split()] for row in table[symbol]])
            for symbol in ("C_oFo", "C_oFin", "C_inFin")
        }
        for table in (TABLE_4[case], TABLE_5)
    )
    for _, symbol, i, j in (lost for lost in SIGN_LOST_4 if lost[0] == case):
        printed[symbol][i - 1, j - 1] *= -1
    seen = [_eigenvalues(*(m[s] for s in ("C_oFo", "C_oFin", "C_inFin"))) for m in (printed, elements)]
    what = (
        "smallest eigenvalue of [C_oFo C_oFin; C_inFo C_inFin] scaled to a unit diagonal. (B.83) says C_inFin = C_inFo C_oFo^-1 C_oFin, "
        f"by which three are zero: inputs that do not move while the platform is held. The digits of Table 4 leave {seen[0][0]:.4f} to "
        f"{seen[0][2]:.4f} of them. With the input compliance at a held platform, which (B.83) leaves out, the smallest is {least[1]:.3f}, "
        f"in the finite elements of Table 5 {seen[1][0]:.3f}: a term left out, no misprint"
    )
    return identity("S3", f"eq. (1), case {case}, definiteness", least[0], 1e-9, what)


def _eigenvalues(C_oFo: np.ndarray, C_oFin: np.ndarray, C_in: np.ndarray) -> np.ndarray:
    """(6,) ascending, of the matrix of eq. (1) with rows and columns scaled to a unit diagonal."""
    C = np.block([[C_oFo, C_oFin], [C_oFin.T, C_in]])
    size = np.sqrt(np.diag(C))
    return np.asarray(np.linalg.eigvalsh((C + C.T) / 2 / np.outer(size, size)))


def _figures() -> list[PrintedNumber]:
    return [no_number("S3", figure, reason) for figure, reason in FIGURES]
