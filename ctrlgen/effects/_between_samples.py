"""The polynomial between two samples of a reading, and its mean."""

from __future__ import annotations

from typing import Any, TypeAlias

Value: TypeAlias = Any
"""A number, an array of them or a symbol."""


class Between:
    """The polynomial through two neighbouring samples, `near` and the `old` one before it, with their slopes (`slope`, `older`: times the
    sample time h), and with the second derivative at the old one (`second`: times h^2) where it is known; w goes from 0 at the near sample
    to 1 at the old one."""

    def __init__(self, near: Value, old: Value, slope: Value, older: Value, second: Value | None = None) -> None:
        self.slope = slope
        gap, turn = old - near + slope, slope - older
        self.fourth = 0.0 if second is None else (second + 6 * gap - 4 * turn) / 2
        self.third = turn - 2 * gap - 2 * self.fourth
        self.square = gap - self.third - self.fourth

    def change(self, w: Value | float) -> Value:
        """From the near sample to w."""
        return w * (w * (self.square + w * (self.third + w * self.fourth)) - self.slope)

    def change_by(self, w: Value | float) -> Value:
        """The derivative of `change` by w."""
        return w * (2 * self.square + w * (3 * self.third + w * 4 * self.fourth)) - self.slope

    def mean_change(self, w: Value | float) -> Value:
        """The mean of `change` from 0 to w."""
        return w * (w * (self.square / 3 + w * (self.third / 4 + w * self.fourth / 5)) - self.slope / 2)

    def mean_change_by(self, w: Value | float) -> Value:
        """The derivative of `mean_change` by w."""
        return w * (2 * self.square / 3 + w * (3 * self.third / 4 + w * 4 * self.fourth / 5)) - self.slope / 2
