"""Modes of a device as lines, which pages draw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True, eq=False)
class Line:
    """A line through points at `rest` (k, 3) [m], how far the mode moves them, `moved` (k, 3), and what it is of."""

    rest: np.ndarray
    moved: np.ndarray
    of: Literal["body", "flexure", "part"]


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode of natural `frequency` [Hz] as `lines`, its amplitude of any size; `grounds` (g, 3) [m] are where something stands on
    the ground."""

    frequency: float
    lines: tuple[Line, ...]
    grounds: np.ndarray
