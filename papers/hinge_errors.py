"""Errors of the hinge equations against finite elements over t/R: S3 Table 3 and Figs. 3-5 from our own results."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from ctrlgen.physics import circular_hinge_table as table
from ctrlgen.reporting.line_patterns import dashes
from ctrlgen.reporting.plots import COLOURS, STYLE, svg

from . import hinge_fem

RATIOS = tuple(np.round(np.arange(0.05, 0.801, 0.025), 3))
POISSON = 0.33  # S3 Table 1
FIGURES = {table.ALPHA: "Fig. 3", table.DELTA_Y: "Fig. 4", table.DELTA_X: "Fig. 5"}
LABELS = {
    table.ALPHA: "alpha_z/M_z",
    table.DELTA_Y: "delta_y/F_y, with shear",
    table.DELTA_X: "delta_x/F_x",
}
_PLACE = {table.ALPHA: (2, 2), table.DELTA_Y: (1, 1), table.DELTA_X: (0, 0)}


@dataclass(frozen=True)
class HingeErrors:
    """`errors[compliance][group]`: (equation - finite elements)/finite elements over `ratios` = t/R.

    NaN where an equation does not exist.
    """

    ratios: np.ndarray
    poisson: float
    errors: dict[str, dict[str, np.ndarray]]

    def summary(self, compliance: str, group: str) -> tuple[float, float, float]:
        """Smallest, largest and mean absolute error [%] over the equation's t/R range, as S3 Table 3 prints.

        Raises ValueError for an equation without a range.
        """
        equation = table.named(compliance, group)
        if equation.within is None:
            raise ValueError(f"{equation.number} has no range: {equation.range_source}")
        low, high = equation.within
        inside = (self.ratios >= low - 1e-9) & (self.ratios <= high + 1e-9)  # the end of an open range as its limit
        size = 100 * np.abs(self.errors[compliance][group][inside])
        return float(size.min()), float(size.max()), float(size.mean())


def hinge_errors(
    ratios: tuple[float, ...] = RATIOS,
    poisson: float = POISSON,
    reading: hinge_fem.Reading = hinge_fem.Reading.CENTRE,
) -> HingeErrors:
    """Every hinge equation against the finite-element hinge; the differences depend only on t/R and Poisson's ratio.

    S3 does not say where it reads the displacement; `reading` on the centre line resembles its printed delta_x/F_x errors.
    """
    truth = hinge_fem.sweep(ratios, poisson, reading)
    errors: dict[str, dict[str, np.ndarray]] = {key: {} for key in table.PLANAR}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", table.HingeRangeWarning)  # the plots also show what happens outside
        for equation in table.EQUATIONS:
            if equation.compliance in _PLACE:
                i, j = _PLACE[equation.compliance]
                values = np.array([_value(equation, ratio, poisson) for ratio in ratios])
                errors[equation.compliance][equation.group] = values / truth[:, i, j] - 1
    return HingeErrors(np.array(ratios), poisson, errors)


def _value(equation: table.Equation, ratio: float, poisson: float) -> float:
    try:
        return float(equation.law(table.Geometry(1.0, float(ratio), 1.0, 1.0, poisson)))
    except table.HingeRangeError:
        return float("nan")


def draw_hinge_errors(data: HingeErrors, compliance: str) -> str:
    """One of S3 Figs. 3-5 as SVG: errors in percent over t/R; thick where S3 Table 3 recommends the equation."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.8, 3.8))
        for k, (groups, errors) in enumerate(_distinct(data.errors[compliance])):
            colour = COLOURS[k % len(COLOURS)]
            equations = [table.named(compliance, group) for group in groups]
            label = " = ".join(f"{e.number} {e.group.replace('_', ' ')}" for e in equations)
            axes.plot(data.ratios, 100 * errors, ls=dashes(k), color=colour, lw=1, label=label)
            if equations[0].errors is not None:
                inside = np.array([equations[0].holds(float(ratio)) for ratio in data.ratios])
                axes.plot(data.ratios, np.where(inside, 100 * errors, np.nan), color=colour, lw=3.5, alpha=0.6)
        axes.axhline(0, color="#666666", lw=0.8)
        axes.set_ylim(-40, 40)
        axes.set_xlabel("t/R")
        axes.set_ylabel(f"{LABELS[compliance]} against finite elements [%]")
        axes.set_title(f"S3 {FIGURES[compliance]}; thick: range of S3 Table 3", fontsize=8)
        axes.legend(fontsize=7, ncols=1 if compliance == table.DELTA_X else 2)
        return svg(figure)


def _distinct(errors: dict[str, np.ndarray]) -> list[tuple[list[str], np.ndarray]]:
    """One curve for all groups whose equations are the same formula in other letters."""
    curves: list[tuple[list[str], np.ndarray]] = []
    for group, values in errors.items():
        for groups, known in curves:
            if np.allclose(values, known, rtol=0, atol=1e-9, equal_nan=True):
                groups.append(group)
                break
        else:
            curves.append(([group], values))
    return curves
