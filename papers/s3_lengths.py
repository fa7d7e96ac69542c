"""Which printed link lengths of S3 contradict its Table 4, and the values that agree with it.

Two lengths at a time, and the frame angle that the paper does not state, are fitted to the printed entries of both cases,
weighted by half their last digit. A pair explains the table where every entry is reproduced to its last digit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations
from types import SimpleNamespace
from typing import cast

import casadi as ca
import numpy as np

from ctrlgen.core.shipped_files import shipped
from ctrlgen.core.units import to_si
from ctrlgen.devices import load_device
from ctrlgen.devices.rrr_stage import RrrStage, stage

from .row import half_unit
from .s3_tables import CASES, SIGN_LOST_4, TABLE_4, entries, unit

DEVICES = shipped("scenarios") / "devices"
LENGTHS = ("l1", "l2", "l3", "l4", "l5", "l6")
STARTS = (1.0, 0.4, 2.5)  # factors on each freed length: a digit may be wrong
STEPS = 60


@dataclass(frozen=True)
class LengthFit:
    """`lengths` [m] and `frame_angle` [rad] that fit Table 4 best with the lengths in `freed` unknown.

    `misfit`: per printed entry, in units of half its last digit; above 1 the entry is not reproduced.
    """

    freed: tuple[str, ...]
    lengths: dict[str, float]
    frame_angle: float
    misfit: np.ndarray

    @property
    def outside(self) -> int:
        """The number of entries that are not reproduced."""
        return int((np.abs(self.misfit) > 1).sum())

    @property
    def cost(self) -> float:
        """Sum of squares of `misfit`."""
        return float(self.misfit @ self.misfit)


def printed_device(case: int) -> RrrStage:
    """The stage of case 1 or 2 with the lengths of Table 1 as printed."""
    return cast(RrrStage, load_device(DEVICES / f"rrr_case{case}.toml"))


@cache
def table_4_misfit() -> ca.Function:
    """(l1 ... l6, frame angle) -> misfit of every entry of Table 4 in both cases, and its Jacobian.

    Left out: a bare 0, which is structural and tells nothing, and the entry that lost its sign.
    """
    x = ca.SX.sym("x", 7)
    free = {f"lengths.{name}": x[i] for i, name in enumerate(LENGTHS)} | {"frame_angle": x[6]}
    terms = []
    for case in CASES:
        device = printed_device(case)
        k = stage(device, device.values(free))
        for symbol, i, j, text in entries(TABLE_4[case]):
            if text == "0" or (case, symbol, i, j) in SIGN_LOST_4:
                continue
            scale = to_si(1.0, unit(symbol, i, j))
            terms.append((getattr(k, symbol)[i - 1, j - 1] / scale - float(text)) / half_unit(text))
    residual = ca.vertcat(*terms)
    return ca.Function("misfit", [x], [residual, ca.jacobian(residual, x)])


def printed_lengths() -> np.ndarray:
    """The lengths l1 ... l6 [m] and the frame angle [rad] of Table 1 as printed, (7,)."""
    p = printed_device(CASES[0]).values()
    return np.array([*(getattr(p.lengths, name) for name in LENGTHS), p.frame_angle])


def _evaluated(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    misfit, jacobian = table_4_misfit()(x)
    return misfit.full().ravel(), jacobian.full()


def _fitted(x: np.ndarray, columns: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Levenberg-Marquardt over `columns` of x; the best x and its misfit."""
    damping, scale = 1e-3, np.abs(x[columns]) + 1e-3
    r, J = _evaluated(x)
    for _ in range(STEPS):
        A = J[:, columns] * scale
        H = A.T @ A
        step = np.linalg.solve(H + damping * np.diag(np.diag(H) + 1e-12), -A.T @ r) * scale
        trial = x.copy()
        trial[columns] += step
        r_1, J_1 = _evaluated(trial)
        if np.isfinite(r_1).all() and r_1 @ r_1 < r @ r:
            x, r, J, damping = trial, r_1, J_1, damping / 10
        else:
            damping *= 10
        if np.abs(step / scale).max() < 1e-12:
            break
    return x, r


@cache
def fit(*freed: str) -> LengthFit:
    """The best fit with the lengths `freed` and the frame angle unknown, from several starts."""
    columns = [LENGTHS.index(name) for name in freed]
    best: LengthFit | None = None
    for start in [()] + [(c, factor) for c in columns for factor in STARTS[1:]]:
        x = printed_lengths()
        if start:
            x[start[0]] *= start[1]
        x, misfit = _fitted(x, [*columns, 6])
        found = LengthFit(freed, dict(zip(LENGTHS, x[:6].tolist(), strict=True)), float(x[6]), misfit)
        best = found if best is None or found.cost < best.cost else best
    assert best is not None
    return best


@cache
def diagnosis() -> tuple[LengthFit, ...]:
    """Every pair of lengths fitted to Table 4, the best first; pairs with a negative length are left out."""
    pairs = (fit(*pair) for pair in combinations(LENGTHS, 2))
    return tuple(sorted((f for f in pairs if min(f.lengths.values()) >= 0), key=lambda f: f.cost))


def corrected(case: int, found: LengthFit | None = None) -> SimpleNamespace:
    """Values of the stage of case 1 or 2 with the lengths and frame angle of `found`, by default those of the best pair."""
    found = diagnosis()[0] if found is None else found
    p = printed_device(case).values()
    p.lengths, p.frame_angle = SimpleNamespace(**found.lengths), found.frame_angle
    return p
