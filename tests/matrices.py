"""Matrices: as the papers print them, and of CasADi; a device's numbers with some of them changed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np


def numbers(text: str) -> np.ndarray:
    """A matrix as printed, one row a line."""
    return np.array([[float(word) for word in line.split()] for line in text.strip().splitlines()])


def array(matrix: Any) -> np.ndarray:
    return ca.DM(matrix).full()


def replaced(values: SimpleNamespace, **changes: Any) -> SimpleNamespace:
    """`values` with other ones of some names."""
    return SimpleNamespace(**{**vars(values), **changes})
