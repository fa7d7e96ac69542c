"""A stage between two blades in line whose ends cannot come nearer, and what it takes by the theory of beam-columns."""

from __future__ import annotations

import numpy as np
from corotational_frame import Frame, line
from mechanism_files import PARALLELOGRAM, blade, dm
from scipy.optimize import brentq

E, L, T, W = 130e9, 20e-3, 0.2e-3, 8e-3  # of the blades of PARALLELOGRAM
EA, EI = E * T * W, E * W * T**3 / 12
STIFFENS = "geometric_stiffening = true\n"
PARTS = 24  # beams a blade: its force at two thicknesses is off by two thousandths


def held() -> str:
    """A stage between two blades in line, pushed across them where it does not turn: their ends cannot come nearer."""
    other = blade("right", -10).replace("[0, 1, 0]", "[0, -1, 0]") + STIFFENS
    text = PARALLELOGRAM.replace(blade("right", 10), other)
    return text.replace('at = ["0 mm", "-10 mm", "0 mm"]', 'at = ["0 mm", "0 mm", "0 mm"]')


def guided(p: float) -> float:
    """F l^3/(E I y) of a beam whose ends do not turn, with the axial load P = p E I/l^2: tension above zero, p < 0 softens it until
    it buckles at -pi^2. Source: S. Timoshenko, J. M. Gere, Theory of Elastic Stability (1961), chapter 1."""
    z = np.sqrt(complex(p))
    return float((p * z / (z - 2 * np.tanh(z / 2))).real)


def stretched(y: float) -> float:
    """Force on a clamped beam whose other end is guided and held lengthways: P l/EA = y^2 k'(p)/2l, k the `guided` stiffness."""
    slope = lambda p: (guided(p + 1e-3) - guided(p - 1e-3)) / 2e-3  # noqa: E731
    p = brentq(lambda p: p * EI / (L * EA) - slope(p) * y**2 / (2 * L), 1e-2, 1e4, xtol=1e-12)
    return EI / L**3 * guided(p) * y


def frame_of(c, *places, parts=PARTS):
    """The stage and its blades as beams, `parts` each, and of the `places` (x, y) [m] on it the numbers of their displacement along x."""
    nodes, beams, fixed, ends = [], [], [], []
    for k in range(len(c.ends)):
        end, axis = dm(c.ends[k]).ravel()[:2], dm(c.frames[k])[:2, 0]
        start = len(nodes)
        nodes += line(end - L * axis, end, parts)
        beams += [(start + j, start + j + 1, EA, EI) for j in range(parts)]
        fixed += [3 * start + x for x in range(3)]
        ends.append(len(nodes) - 1)
    of_places = [len(nodes) + j for j in range(len(places))]
    nodes += [np.array(place) for place in places]
    rigid = [(i, of_places[0], 1e4 * EA, 1e6 * EI) for i in (*ends, *of_places[1:])]
    return Frame(nodes, beams + rigid, fixed), [3 * j for j in of_places]
