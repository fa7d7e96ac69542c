"""Where the elements of a mechanism begin and end, as they are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.drawing import Drawing

SHORT = 0.04
"""Of the extent: how long an element without a length is drawn."""
LEAST = 1e-6  # m, the extent of a drawing whose elements end in one place


@dataclass(frozen=True, eq=False)
class ElementEnds:
    """`starts` and `ends` (3,) [m] of each element, fixed and free; `extent` [m]: the longest side of the box around free ends and
    ports."""

    starts: tuple[np.ndarray, ...]
    ends: tuple[np.ndarray, ...]
    extent: float


def element_ends(device: Drawing) -> ElementEnds:
    """Those of a mechanism as it is described."""
    c = nominal(device)
    ends = tuple(ca.DM(ca.evalf(ca.SX(end))).full().ravel() for end in c.ends)
    ports = [place for s in device.placed_super_elements for place in s.places]
    extent = max(float(np.ptp(np.array([*ends, *ports]), axis=0).max()), LEAST)
    starts = []
    for e, end, frame in zip(device.placed_elements, ends, c.frames, strict=True):
        reach = e.section.reach(e.numbers(c.p))
        length = SHORT * extent if reach is None else float(reach)
        starts.append(end - length * ca.DM(ca.evalf(ca.SX(frame))).full()[:, 0])
    return ElementEnds(tuple(starts), ends, extent)
