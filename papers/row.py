"""A number that a paper prints, beside the program's own, and the rule that decides whether it is reproduced."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from decimal import Decimal
from enum import Enum


class ReproductionStatus(Enum):
    """Whether a printed number is reproduced."""

    REPRODUCED = "reproduced"
    DIFFERS = "differs"
    NOT_COMPUTABLE = "not computable"


@dataclass(frozen=True)
class PrintedNumber:
    """A printed number and ours. `source` such as 'S3', `where` such as 'Table 4, case 1, C_oFin (1,2)', `printed` its text.

    `ours` is None where it cannot be computed. `tolerance` is half a unit of the last printed digit
    unless another is stated with a `reason`. A number that differs or cannot be computed needs a `reason`.
    """

    source: str
    where: str
    printed: str
    unit: str
    ours: float | None
    reason: str = ""
    tolerance: float | None = None

    @property
    def value(self) -> float:
        """The printed number."""
        return float(Decimal(self.printed.replace("\N{MINUS SIGN}", "-")))

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
        close = math.isfinite(self.ours) and abs(self.ours - self.value) <= self.allowed * (1 + 1e-9)
        return ReproductionStatus.REPRODUCED if close else ReproductionStatus.DIFFERS

    def without_needless_reason(self) -> PrintedNumber:
        """This number without its reason where it is reproduced, which needs none."""
        return replace(self, reason="") if self.status is ReproductionStatus.REPRODUCED else self


def half_unit(printed: str) -> float:
    """Half a unit of the last printed digit: '9.12e-2' -> 5e-5, '301.0' -> 0.05, '12' -> 0.5."""
    return 0.5 * 10.0 ** int(Decimal(printed.replace("\N{MINUS SIGN}", "-")).as_tuple().exponent)
