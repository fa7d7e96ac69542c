"""A number that a paper prints, beside the program's own, and the rule that decides whether it is reproduced."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from enum import Enum


class ReproductionStatus(Enum):
    """Whether a printed number is reproduced."""

    REPRODUCED = "reproduced"
    CORRECTED = "corrected"
    """Follows from other printed numbers once these are corrected as the reason says, and not from them as printed."""
    DIFFERS = "differs"
    NOT_COMPUTABLE = "not computable"


@dataclass(frozen=True)
class PrintedNumber:
    """A printed number and ours. `source` such as 'S3', `where` such as 'Table 4, case 1, C_oFin (1,2)', `printed` its text.

    `ours` is None where it cannot be computed. `tolerance` is half a unit of the last printed digit
    unless another is stated with a `reason`. A number that is not plainly reproduced needs a `reason`.
    """

    source: str
    where: str
    printed: str
    unit: str
    ours: float | None
    reason: str = ""
    tolerance: float | None = None
    taken_literally: float | None = None
    """What the paper's own numbers give, where `ours` takes corrected ones."""
    implied: float | None = None
    """What other printed numbers say of this one, where its own print is lost; then a `tolerance` is needed."""

    @property
    def value(self) -> float:
        """The printed number, or what is implied of it."""
        return _number(self.printed) if self.implied is None else self.implied

    @property
    def allowed(self) -> float:
        """The largest difference with which ours still counts as reproduced."""
        return half_unit(self.printed) if self.tolerance is None else self.tolerance

    @property
    def difference(self) -> float | None:
        """Ours minus printed."""
        return None if self.ours is None else self.ours - self.value

    @property
    def status(self) -> ReproductionStatus:
        """Reproduced where the difference is within `allowed`; NaN never is."""
        if self.ours is None:
            return ReproductionStatus.NOT_COMPUTABLE
        if not self._meets(self.ours):
            return ReproductionStatus.DIFFERS
        literal = self.taken_literally is None or self._meets(self.taken_literally)
        return ReproductionStatus.REPRODUCED if literal else ReproductionStatus.CORRECTED

    def _meets(self, number: float) -> bool:
        return math.isfinite(number) and abs(number - self.value) <= self.allowed * (1 + 1e-9)

    def without_needless_reason(self) -> PrintedNumber:
        """This number without its reason where it is reproduced, which needs none."""
        return replace(self, reason="") if self.status is ReproductionStatus.REPRODUCED else self


def identity(source: str, where: str, ours: float, rounding: float, reason: str, unit: str = "1") -> PrintedNumber:
    """An equation as a row: `ours` is its left side minus its right, 0 but for `rounding`; `reason` says what was computed."""
    return PrintedNumber(source, where, "0", unit, ours, reason, rounding)


def no_number(source: str, where: str, reason: str) -> PrintedNumber:
    """A figure or statement without a number to compare; `reason` says what stands for it here."""
    return PrintedNumber(source, where, "", "1", None, reason)


def beside_literal(
    corrected: Sequence[PrintedNumber], literal: Sequence[PrintedNumber], reason: str
) -> list[PrintedNumber]:
    """Rows from corrected numbers, each with what the same rows from the paper's own numbers give.

    Raises ValueError where the two do not name the same places in the same order.
    """
    found = []
    for right, printed in zip(corrected, literal, strict=True):
        if right.where != printed.where:
            raise ValueError(f"{right.where} stands beside {printed.where}")
        row = replace(right, taken_literally=printed.ours)
        found.append(replace(row, reason=reason) if row.status is ReproductionStatus.CORRECTED else row)
    return found


def half_unit(printed: str) -> float:
    """Half a unit of the last printed digit: '9.12e-2' -> 5e-5, '301.0' -> 0.05, '12' -> 0.5."""
    return 0.5 * 10.0 ** int(_decimal(printed).as_tuple().exponent)


def _number(printed: str) -> float:
    return float(_decimal(printed))


def _decimal(printed: str) -> Decimal:
    return Decimal(printed.replace("\N{MINUS SIGN}", "-"))
