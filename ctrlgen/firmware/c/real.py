"""The two arithmetics of the generated C, and their numbers as text."""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from ctrlgen.core.errors import CtrlgenError


class Real(Enum):
    """The arithmetic of the generated C."""

    DOUBLE = "double"
    FLOAT = "float"

    @property
    def suffix(self) -> str:
        """Name suffix of files and functions."""
        return "f64" if self is Real.DOUBLE else "f32"

    @property
    def bytes(self) -> int:
        """Size of a number."""
        return 8 if self is Real.DOUBLE else 4

    @property
    def epsilon(self) -> float:
        """Distance from one to the next number."""
        return float(np.finfo(np.float64 if self is Real.DOUBLE else np.float32).eps)

    def literal(self, value: float) -> str:
        """The shortest decimal that reads back as the same number of this type."""
        if not math.isfinite(value):
            raise CtrlgenError(f"the constant {value} cannot be written as C")
        if self is Real.DOUBLE:
            text = repr(float(value))
        else:
            with np.errstate(over="ignore", under="ignore"):
                single = np.float32(value)
            if not np.isfinite(single) or (value != 0 and abs(single) < np.finfo(np.float32).tiny):
                raise CtrlgenError(
                    f"the constant {value:g} does not fit a float; rescale the model or export double only"
                )
            text = str(single)
        if "." not in text and "e" not in text:
            text += ".0"
        return text + ("f" if self is Real.FLOAT else "")
