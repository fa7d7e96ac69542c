"""The range of t/R in which each circular-hinge equation holds, S3 Table 3, and compliances with their source.

In these ranges S3 found an equation within about 5 % of finite elements.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca

from ctrlgen.physics import circular_hinge as c
from ctrlgen.physics.flexure import shear_ratio
from ctrlgen.physics.screw import Matrix, Scalar

ALPHA, DELTA_Y, DELTA_X, LOCKED = "alpha_z_per_M_z", "delta_y_per_F_y", "delta_x_per_F_x", "delta_y_per_F_y_locked"
PLANAR = (ALPHA, DELTA_Y, DELTA_X)
UNITS = {ALPHA: "rad/(N*m)", DELTA_Y: "m/N", DELTA_X: "m/N", LOCKED: "m/N"}
RECTANGULAR_SHEAR = 6 / 5  # shear factor of a rectangular section
LARGEST, SMALLEST = 0.8, 0.05  # t/R that S3 compares with finite elements
ROUNDING = 1e-12  # relative: a quotient or a difference this close to a bound counts as equal to it

Range = tuple[float, float]
Outside = Literal["refuse", "warn", "accept"]


class HingeRangeError(ValueError):
    """An equation is requested at a t/R outside the range in which it holds."""


class HingeRangeWarning(UserWarning):
    """An equation is used at a t/R outside the range in which it is known to hold."""


@dataclass(frozen=True)
class Geometry:
    """Radius, neck, width [m], Young's modulus [Pa], Poisson's ratio; numbers or CasADi symbols.

    `at` is the numeric t/R that selects an equation where R or t is a symbol.
    """

    R: Scalar
    t: Scalar
    b: Scalar
    E: Scalar
    nu: Scalar
    shear_factor: Scalar | None = None
    at: float | None = None

    @property
    def G(self) -> Scalar:
        """Shear modulus E/[2 (1 + nu)]."""
        return self.E * shear_ratio(self.nu)

    @property
    def ratio(self) -> float:
        """The number t/R at which the equation is chosen. Raises ValueError where it is a symbol."""
        if self.at is not None:
            return self.at
        if isinstance(self.R, ca.SX) or isinstance(self.t, ca.SX):
            raise ValueError("R or t is a symbol; give `at`, the number t/R at which the equation is chosen")
        return float(self.t) / float(self.R)

    def shear(self, by_equation: float) -> Scalar:
        """The shear factor of the geometry if it gives one, else the equation's `own`."""
        return by_equation if self.shear_factor is None else self.shear_factor


@dataclass(frozen=True)
class Equation:
    """One compliance by one group of authors: its law, its number in S2, its range of t/R and the source of the range.

    `errors` are the smallest, largest and mean difference from finite elements within the range in S3 Table 3, percent.
    `within` is None where no range is recommended.
    """

    compliance: str
    group: str
    number: str
    authors: str
    law: Callable[[Geometry], Scalar]
    within: Range | None
    range_source: str = "S3 Table 3"
    errors: tuple[float, float, float] | None = None
    open_end: bool = False  # the range's upper end is excluded

    def holds(self, ratio: float) -> bool:
        """Whether `ratio` = t/R is in the range, up to the rounding of the quotient."""
        if self.within is None:
            return False
        low, high = self.within
        below = ratio < high * (1 - ROUNDING) if self.open_end else ratio <= high * (1 + ROUNDING)
        return low * (1 - ROUNDING) <= ratio and below

    @property
    def range_text(self) -> str:
        """The range as text, such as '0.05 <= t/R < 0.1 (S3 Table 3)'."""
        if self.within is None:
            return f"no t/R ({self.range_source})"
        return f"{self.within[0]:g} <= t/R {'<' if self.open_end else '<='} {self.within[1]:g} ({self.range_source})"


@dataclass(frozen=True)
class Compliance:
    """A compliance with its source: `value` in SI; `note` tells the reader why `holds` is False."""

    value: Scalar
    equation: Equation
    holds: bool
    note: str = ""

    @property
    def source(self) -> str:
        """Where the equation stands, such as 'S2 C.22, Schotborgh et al. (2005)'."""
        return f"S2 {self.equation.number}, {self.equation.authors}"

    @property
    def within(self) -> Range | None:
        """The range of t/R in which the equation holds."""
        return self.equation.within


def _tseytlin(g: Geometry) -> Scalar:
    if g.ratio > c.TSEYTLIN_END * (1 + ROUNDING):
        raise HingeRangeError(
            f"C.15-C.17 (Tseytlin) end at t/R = {c.TSEYTLIN_END}, but this hinge has {g.ratio:.4g}; "
            f'use equation = "schotborgh" or "auto"'
        )
    branch = c.c15 if g.ratio <= c.TSEYTLIN_THIN else c.c16 if g.ratio <= c.TSEYTLIN_THICK else c.c17
    return branch(g.R, g.t, g.b, g.E, g.nu)


def _plain(law: Callable[..., Scalar]) -> Callable[[Geometry], Scalar]:
    return lambda g: law(g.R, g.t, g.b, g.E)


def _with_shear(bending: Callable[..., Scalar], shear: Callable[..., Scalar]) -> Callable[[Geometry], Scalar]:
    # C.4, C.8 and C.14 are printed with the factor 1.
    return lambda g: bending(g.R, g.t, g.b, g.E) + g.shear(1.0) * shear(g.R, g.t, g.b, g.G)


def _lobontiu_y(g: Geometry) -> Scalar:
    return c.c19(g.R, g.t, g.b, g.E) + c.c21(g.R, g.t, g.b, g.E, g.G, g.shear(RECTANGULAR_SHEAR))


def _composed_y(g: Geometry) -> Scalar:
    bending = c.c2(g.R, g.t, g.b, g.E, alpha=c.c22(g.R, g.t, g.b, g.E))
    return bending + c.c21(g.R, g.t, g.b, g.E, g.G, g.shear(RECTANGULAR_SHEAR))


OWN = "our finite elements; S3 gives no range"
_PW, _WU, _LO, _SC = (
    "Paros and Weisbord (1965)",
    "Wu and Zhou (2002)",
    "Lobontiu (2003)",
    "Schotborgh et al. (2005)",
)
EQUATIONS = (
    Equation(ALPHA, "paros_weisbord", "C.1", _PW, _plain(c.c1), (0.05, 0.1), errors=(1.8, 5.0, 3.5), open_end=True),
    Equation(ALPHA, "paros_weisbord_simplified", "C.5", _PW, _plain(c.c5), (0.05, 0.2), errors=(1.2, 4.9, 3.1)),
    Equation(ALPHA, "lobontiu", "C.18", _LO, _plain(c.c18), (0.05, 0.1), errors=(1.8, 5.0, 3.5), open_end=True),
    Equation(ALPHA, "wu_zhou", "C.11", _WU, _plain(c.c11), (0.05, 0.1), errors=(1.8, 5.0, 3.5), open_end=True),
    Equation(ALPHA, "tseytlin", "C.15-C.17", "Tseytlin (2002)", _tseytlin, (0.4, 0.6), errors=(0.7, 4.5, 2.5)),
    Equation(ALPHA, "smith", "C.9", "Smith et al. (1987)", _plain(c.c9), (0.2, 0.65), errors=(0.8, 3.7, 2.4)),
    Equation(ALPHA, "schotborgh", "C.22", _SC, _plain(c.c22), (0.05, 0.65), errors=(0.03, 2.5, 1.2)),
    Equation(ALPHA, "zhang_fasse", "C.10", "Zhang and Fasse (2001)", _plain(c.c10), (0.05, 0.8), OWN),
    Equation(DELTA_Y, "paros_weisbord", "C.2 + C.4", _PW, _with_shear(c.c2, c.c4), (0.05, 0.1), errors=(2, 4, 3.1)),
    Equation(
        DELTA_Y,
        "paros_weisbord_simplified",
        "C.6 + C.8",
        _PW,
        _with_shear(c.c6, c.c8),
        (0.05, 0.1),
        errors=(3, 5.6, 4.3),
    ),
    Equation(DELTA_Y, "lobontiu", "C.19 + C.21", _LO, _lobontiu_y, (0.05, 0.1), errors=(2, 3.9, 2.9)),
    Equation(DELTA_Y, "wu_zhou", "C.12 + C.14", _WU, _with_shear(c.c12, c.c14), (0.05, 0.1), errors=(2, 4, 3.1)),
    Equation(DELTA_Y, "composed", "C.2 with C.22, + C.21", f"{_PW}, {_SC}, {_LO}", _composed_y, (0.05, 0.8), OWN),
    Equation(DELTA_X, "paros_weisbord", "C.3", _PW, _plain(c.c3), (0.25, 0.65), errors=(0.3, 4.9, 2.4)),
    Equation(DELTA_X, "paros_weisbord_simplified", "C.7", _PW, _plain(c.c7), None, "S3 Table 3: not recommended"),
    Equation(DELTA_X, "lobontiu", "C.20", _LO, _plain(c.c20), (0.25, 0.65), errors=(0.3, 4.9, 2.4)),
    Equation(DELTA_X, "wu_zhou", "C.13", _WU, _plain(c.c13), (0.25, 0.65), errors=(0.3, 4.9, 2.4)),
    Equation(
        DELTA_X,
        "schotborgh",
        "C.24",
        _SC,
        _plain(c.c24),
        None,
        "not in S3 Table 3; includes the extension of the links",
    ),
    Equation(LOCKED, "schotborgh", "C.23", _SC, _plain(c.c23), (0.2, 0.8), OWN),
)
BY_NAME = {(e.compliance, e.group): e for e in EQUATIONS}


def best(compliance: str, ratio: float) -> Equation:
    """The equation with the smallest mean error in S3 Table 3 at this t/R.

    Where the table recommends no printed equation: below t/R = 0.05 the closed forms, which finite elements approach;
    above, the best of the neighbouring range, and for delta_y/F_y C.2 with a better alpha_z/M_z in it (within 2.7 % of our
    finite elements). None of these `holds` according to S3. Raises HingeRangeError above t/R = 0.8, where there is no
    comparison.
    """
    if compliance not in PLANAR:
        raise ValueError(f'there is no choice for {compliance}; name the equation, "schotborgh"')
    fitting = [(e.errors[2], e) for e in EQUATIONS if e.compliance == compliance and e.errors and e.holds(ratio)]
    if fitting:
        return min(fitting, key=lambda pair: pair[0])[1]
    if ratio > LARGEST * (1 + ROUNDING):
        raise HingeRangeError(
            f"no equation for {compliance} is known to hold at t/R = {ratio:.4g}; S3's comparison ends at {LARGEST}: "
            f"make the neck thinner or the radius larger"
        )
    if ratio < SMALLEST or compliance == DELTA_X:
        return BY_NAME[compliance, "paros_weisbord"]
    return BY_NAME[compliance, "schotborgh" if compliance == ALPHA else "composed"]


def named(compliance: str, group: str) -> Equation:
    """The equation of one group of authors. Raises ValueError that names the groups which give this compliance."""
    if (compliance, group) in BY_NAME:
        return BY_NAME[compliance, group]
    known = ", ".join(e.group for e in EQUATIONS if e.compliance == compliance)
    only_locked = compliance == DELTA_Y and (LOCKED, group) in BY_NAME
    locked = f" (C.23 has the rotation locked: {LOCKED})" if only_locked else ""
    raise ValueError(f"{group!r} gives no {compliance}{locked}; known here: auto, {known}")


def choose(compliance: str, ratio: float, equation: str = "auto", outside: Outside = "refuse") -> Equation:
    """`equation` by name, or the best for this t/R. Raises HingeRangeError where a named one does not hold."""
    if not ratio > 0:
        raise ValueError(f"t/R = {ratio:.4g} must be positive")
    if equation == "auto":
        return best(compliance, ratio)
    chosen = named(compliance, equation)
    if outside == "refuse" and not chosen.holds(ratio):
        raise HingeRangeError(
            f"{chosen.number} ({chosen.authors}) for {compliance} holds at {chosen.range_text}, but this hinge has "
            f't/R = {ratio:.4g}; use equation = "auto", or outside = "warn" to use it nevertheless'
        )
    return chosen


def pedigree(name: str, ratio: float, equation: str = "auto", outside: Outside = "refuse") -> tuple[Equation, str]:
    """(equation, note) for compliance `name` at this t/R; the note is '' where S3 Table 3 recommends the equation.

    Raises as `choose` does.
    """
    chosen = choose(name, ratio, equation, outside)
    if chosen.holds(ratio) and (equation != "auto" or chosen.errors is not None):
        return chosen, ""
    why = "the nearest; S3 Table 3 recommends no printed equation here" if equation == "auto" else "outside its range"
    return chosen, f"{name} at t/R = {ratio:.4g} by {chosen.number} ({chosen.authors}), {why}: {chosen.range_text}"


def compliance(name: str, geometry: Geometry, equation: str = "auto", outside: Outside = "refuse") -> Compliance:
    """One compliance of the hinge, `name` of PLANAR or LOCKED, with its range and source.

    A named equation outside its range raises HingeRangeError, warns if `outside` is "warn", and is used without a warning
    if it is "accept". "auto" warns where the table recommends no equation, unless `outside` is "accept".
    """
    chosen, note = pedigree(name, geometry.ratio, equation, outside)
    if note and outside != "accept":
        warnings.warn(note, HingeRangeWarning, stacklevel=2)
    return Compliance(chosen.law(geometry), chosen, not note, note)


def end_compliance(x: Scalar, y: Scalar, alpha: Scalar, R: Scalar) -> Matrix:
    """Compliance of a hinge about its free end (R, 0), (delta_x, delta_y, alpha_z) per (F_x, F_y, M_z), shape (3, 3).

    A notch of length 2R rotates about its middle: a force across the end rotates it by R alpha, a moment displaces
    the end by R alpha. Positive definite only where y > R^2 alpha. Source: S3 eq. (B.9), (B.13), (B.21).
    """
    return ca.vertcat(ca.horzcat(x, 0, 0), ca.horzcat(0, y, R * alpha), ca.horzcat(0, R * alpha, alpha))


def planar(geometry: Geometry, equation: str | Mapping[str, str] = "auto", outside: Outside = "refuse") -> Matrix:
    """Compliance (delta_x, delta_y, alpha_z) per (F_x, F_y, M_z) at the hinge's end (R, 0), shape (3, 3).

    `equation` is one name for all three or a name for each of PLANAR. Raises ValueError where the matrix is not positive
    definite, delta_y/F_y <= R^2 alpha_z/M_z: the two then come from theories that contradict each other.
    """
    chosen = {key: equation if isinstance(equation, str) else equation.get(key, "auto") for key in PLANAR}
    compliances = {key: compliance(key, geometry, chosen[key], outside) for key in PLANAR}
    faults = [
        f"{key} by {one.source} is {float(one.value):.4g} {UNITS[key]} at t/R = {geometry.ratio:.4g}; "
        "a compliance must be positive and finite"
        for key, one in compliances.items()
        if not isinstance(one.value, ca.SX) and not 0 < float(one.value) < float("inf")
    ]
    alpha, y, x = (compliances[key].value for key in PLANAR)
    by_rotation: Any = geometry.R**2 * alpha
    # Without shear C.6 is exactly R^2 C.5: rounding must not decide whether the matrix is positive definite.
    if not faults and not isinstance(y - by_rotation, ca.SX) and float(y - by_rotation) <= ROUNDING * float(y):
        faults.append(
            f"the compliance is not positive definite: delta_y/F_y by {compliances[DELTA_Y].source} is {float(y):.4g} m/N, at "
            f"least {float(by_rotation):.4g} m/N follows from alpha_z/M_z by {compliances[ALPHA].source} at "
            f't/R = {geometry.ratio:.4g}; include shear (shear_factor), use equation = "auto", or take both from one source'
        )
    if faults:
        raise ValueError("; ".join(faults))
    return end_compliance(x, y, alpha, geometry.R)
