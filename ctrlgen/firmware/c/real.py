"""The arithmetics of the generated C, and their numbers as text."""

from __future__ import annotations

import math
import sys
from enum import Enum
from typing import TypeAlias

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

    @property
    def word(self) -> str:
        """The unsigned integer of C that holds the bits of a number."""
        return f"uint{8 * self.bytes}_t"

    def bits(self, value: float) -> int:
        """The bits of a number, as an unsigned integer. Those of numbers that are not negative are ordered as the numbers are; those of
        infinity and of what is no number are above them."""
        number = np.float64(value) if self is Real.DOUBLE else np.float32(value)
        return int.from_bytes(number.tobytes(), sys.byteorder)

    def bits_literal(self, bits: int) -> str:
        """These bits as a constant of C."""
        return f"0x{bits:0{2 * self.bytes}X}{'ULL' if self is Real.DOUBLE else 'U'}"

    def ordered(self, bits: int) -> int:
        """The bits of a number so that they are ordered as numbers are, the negative ones too; the C has the same as `ordered`."""
        sign = self.bits(-0.0)
        return 2 * sign - 1 - bits if bits & sign else bits | sign

    def held(self, values: np.ndarray) -> np.ndarray:
        """`values` as the arithmetic holds them: in float rounded, and what is too small for it zero, such as a rounding at home."""
        if self is Real.DOUBLE:
            return values
        with np.errstate(over="ignore", under="ignore"):
            single = np.array(values, dtype=np.float32).astype(float)
        return np.where(np.abs(single) < float(np.finfo(np.float32).tiny), 0.0, single)

    @property
    def sign(self) -> str:
        """The bit of the sign, as a constant of C."""
        return self.bits_literal(self.bits(-0.0))

    @property
    def magnitude(self) -> str:
        """All bits but the sign, as a constant of C."""
        return self.bits_literal(self.bits(-0.0) - 1)

    @property
    def infinity(self) -> str:
        """The bits of infinity, as a constant of C: those of every finite magnitude are below."""
        return self.bits_literal(self.bits(math.inf))

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


class Integers(Enum):
    """The arithmetic of the controller for cores without a floating-point unit: integers of 32 bits, which count powers of two."""

    Q31 = "integers"

    @property
    def suffix(self) -> str:
        """Name suffix of files and functions."""
        return "q31"

    @property
    def bytes(self) -> int:
        """Size of a number."""
        return 4


Arithmetic: TypeAlias = Real | Integers
