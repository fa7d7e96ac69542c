"""A flexure that is bent: what it yields along itself and across, as a curved one does.

Straight, it is stiff along its axis. Bent, a pull on its end also straightens it: of a blade that is guided by y its compliance along
the axis grows by y^2 l/(700 E I), 12/700 (y/t)^2 of itself, and motions along and across go together, by 6/5 y/l. Both are those of a rod
without stress whose axis is the bent one (in a plane the same as of one that is bent by its load, to second order in y): pieces in
line, each turned by the rotation of its section and moved with it.

Source: S. Awtar, A. H. Slocum, E. Sevincer, J. Mech. Des. 129 (2007) 625, eq. (8).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from ctrlgen.physics.flexure import Segment, bent, segment_compliance

ALONG = np.array([1.0, 0.0, 0.0])
PARTS = 12  # pieces of a segment: the growth of a guided blade's compliance is right to 1 %


def bent_compliance(segments: Sequence[Segment], load: np.ndarray) -> np.ndarray:
    """(6, 6) about the free end, in the frame of the fixed one, of segments in line that the `load` (6,) on the free end bends. A blade
    between held ends that deflects less than its bending says (`held_flexure`) bends here as one that is as stiff where it is guided:
    what is less is no shear that turns with its sections."""
    return _curved([_guided(s) for s in segments], load)


def _guided(s: Segment) -> Segment:
    if float(s.shear_y) >= 0:
        return s
    between = float(s.whole) or float(s.length)
    return replace(s, EI_z=1 / (1 / s.EI_z + 12 * s.shear_y / between**2), shear_y=0.0)


def _curved(segments: Sequence[Segment], load: np.ndarray) -> np.ndarray:
    force, moment, left = load[:3], load[3:], sum(float(s.length) for s in segments)
    across, turned, reached = np.cross(ALONG, force), np.zeros(3), np.zeros(3)
    owns, turns, places = [], [], []  # of every piece: compliance, rotation of its middle, place of its far end
    for s in segments:
        length, yields = float(s.length), np.array([1 / float(s.GJ), 1 / float(s.EI_y), 1 / float(s.EI_z)])
        strain = np.array([1 / float(s.EA), float(s.shear_y), float(s.shear_z)]) * force
        own = ca.DM(segment_compliance(s, length / PARTS)).full()
        x = length * np.arange(1, PARTS + 1)[:, None] / PARTS
        half = x - length / (2 * PARTS)
        turn = turned * x + yields * (
            x**2 / 2 * moment + (left * x**2 / 2 - x**3 / 6) * across
        )  # integral of the rotation
        owns += [own] * PARTS
        turns.append(turned + np.array([np.array(bent(s, float(h), left, load), float) for h in half[:, 0]]))
        places.append(reached + x * (ALONG + strain) + np.cross(turn, ALONG))
        turned = turned + np.array(bent(s, length, left, load), float)
        reached, left = places[-1][-1], left - length
    R, arms = Rotation.from_rotvec(np.vstack(turns)).as_matrix(), reached - np.vstack(places)
    wrench = np.zeros((len(owns), 6, 6))  # on a piece, in its frame, per wrench on the tip
    wrench[:, :3, :3] = wrench[:, 3:, 3:] = np.swapaxes(R, 1, 2)
    wrench[:, 3:, :3] = np.swapaxes(R, 1, 2) @ np.cross(arms[:, None, :], np.eye(3)).swapaxes(1, 2)
    swap = [3, 4, 5, 0, 1, 2]
    C = np.einsum("kji,kjl,klm->im", wrench, np.array(owns)[:, swap], wrench)  # (displacement; rotation) per wrench
    return np.asarray(C[swap])
