"""S3 Table 2 against Table 4: whether case 2 has shear in delta_y/F_y."""

from __future__ import annotations

from functools import cache

import casadi as ca
import numpy as np

from ctrlgen.core.units import to_si
from ctrlgen.devices.rrr_stage import stage

from .row import PrintedNumber, half_unit
from .s3_lengths import corrected, printed_device
from .s3_tables import SIGN_LOST_4, TABLE_4, entries, unit

CASE = 2
STEPS = 4  # of Gauss-Newton; two suffice


def rows() -> list[PrintedNumber]:
    """The shear factor that Table 4 says, where Table 2 says none, and how far the table is from none."""
    factor, step = 1.0, 1e-4
    for _ in range(STEPS):
        r = misfit(factor)
        slope = (misfit(factor + step) - r) / step
        factor -= float(slope @ r / (slope @ slope))
    with_it, without = misfit(factor), misfit(0.0)
    reason = (
        "Table 2 says without shear compliance, Table 4 has it: with the fitted factor "
        f"{int((np.abs(with_it) > 1).sum())} of {len(with_it)} entries of case 2 are off by more than their last digit, without shear "
        f"{int((np.abs(without) > 1).sum())}, by up to {100 * _largest_change(without):.2f} %"
    )
    return [PrintedNumber("S3", "Table 2, case 2, shear factor of delta_y/F_y", "0", "1", factor, reason, 0.05)]


def misfit(factor: float) -> np.ndarray:
    """Entries of Table 4, case 2, with the shear `factor`: ours minus printed in units of half the last digit."""
    return _misfit()(factor).full().ravel()


@cache
def _misfit() -> ca.Function:
    """Of a symbol, because hinges without shear are refused: at hinges 1 and 2 their compliance is indefinite."""
    device, p, factor = printed_device(CASE), corrected(CASE), ca.SX.sym("factor")
    for name in device.hinges:
        getattr(p, name).shear_factor = factor
    k = stage(device, p)
    off = [
        (getattr(k, symbol)[i - 1, j - 1] / to_si(1.0, unit(symbol, i, j)) - float(text)) / half_unit(text)
        for symbol, i, j, text in _told()
    ]
    return ca.Function("misfit", [factor], [ca.vertcat(*off)])


def _told() -> list[tuple[str, int, int, str]]:
    return [e for e in entries(TABLE_4[CASE]) if e[3] != "0" and (CASE, *e[:3]) not in SIGN_LOST_4]


def _largest_change(off: np.ndarray) -> float:
    """The largest misfit as a share of its entry, of entries that have three digits at least."""
    shares = [
        abs(r) * half_unit(text) / abs(float(text))
        for r, (*_, text) in zip(off, _told(), strict=True)
        if abs(float(text)) >= 0.1
    ]
    return float(max(shares))
