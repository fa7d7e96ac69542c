"""The set of poses a device can hold under all its limits: ranges, slices, the largest ball inside.

Every limit is convex in the displacement and the pose is linear in it, so the set is convex:
a ray from an inner point leaves it once, and tangent planes at its boundary enclose it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.controller import Controller
from ctrlgen.errors import Fault, InputError
from ctrlgen.model import Model

REACH = 60  # bisections: beyond double precision of the first step
TIGHT = 1e-6  # of a ball's radius: how far its worst point may stick out
CUTS = 400  # rounds of tangent planes before giving up


@dataclass(frozen=True)
class Ball:
    """A ball inside the workspace, in typical sizes of the pose: `centre` SI, `radius` in those sizes."""

    centre: np.ndarray
    radius: float
    channels: tuple[int, ...]


@dataclass(frozen=True)
class Workspace:
    """Equilibria of one model; poses are rows (n, 6) in SI."""

    model: Model

    @cached_property
    def _excess(self) -> ca.Function:
        """pose -> (largest normalised violation, its gradient): negative inside, zero on the boundary."""
        m = self.model
        inverse = Controller(m, "pose", None).static
        pose = ca.SX.sym("pose", len(m.signals["pose"].channels))
        x, z = ca.DM(m.rest), ca.DM.zeros(m.z.numel())
        d = inverse.displacement(x, z, pose)
        state = inverse.state(x, z, d)
        u = inverse.drive(x, z, d, state)
        values = m.evaluate_limits(ca.vertcat(state, ca.DM(m.rest[m.n_states :])), d, u, m.p_nominal)
        violations = []
        for limit, value in zip(m.limits, values, strict=True):
            span = (limit.upper or 0.0) - (limit.lower or 0.0) or 1.0
            if limit.upper is not None:
                violations.append((value - limit.upper) / span)
            elif limit.lower is not None and limit.lower != 0.0:
                violations.append((limit.lower - value) / abs(limit.lower))
            if limit.upper is not None and limit.lower is not None:
                violations.append((limit.lower - value) / span)
        worst = ca.mmax(ca.vertcat(*violations))
        return ca.Function("excess", [pose], [worst, ca.gradient(worst, pose)])

    def excess(self, poses: np.ndarray) -> np.ndarray:
        """Largest normalised violation of each pose (n, 6): below zero where it can be held."""
        value = self._excess.map(len(poses))(poses.T)[0].full().ravel()
        return np.where(np.isnan(value), np.inf, value)  # far outside, the actuator's square root has no value

    def holds(self, pose: np.ndarray) -> bool:
        """Whether one pose can be held."""
        return bool(self.excess(pose[None])[0] <= 0)

    def reach(self, base: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far (n,) the workspace goes from an inner pose `base` along each of `directions` (n, 6).

        Raises InputError when `base` itself cannot be held.
        """
        if not self.holds(base):
            raise InputError(self.model.name, [Fault("base pose", "cannot be held; choose one inside the workspace")])
        size = np.linalg.norm(directions / np.array(self.model.signals["pose"].scale), axis=1)
        low, high = np.zeros(len(directions)), 1.0 / size
        for _ in range(REACH):  # first out, doubling, then in
            inside = self.excess(base + high[:, None] * directions) <= 0
            if not inside.any():
                break
            low, high = np.where(inside, high, low), np.where(inside, 2 * high, high)
        for _ in range(REACH):
            middle = (low + high) / 2
            inside = self.excess(base + middle[:, None] * directions) <= 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return low

    def ranges(self, base: np.ndarray) -> np.ndarray:
        """(channels, 2): how far each pose component alone goes below and above `base`, SI, as values of the component."""
        axes = np.vstack([-np.eye(len(base)), np.eye(len(base))])
        far = self.reach(base, axes)
        return np.column_stack([base - far[: len(base)], base + far[len(base) :]])

    def outline(self, base: np.ndarray, first: int, second: int, points: int = 180) -> np.ndarray:
        """(points, 2): boundary of the slice through `base` in two channels, in SI, other channels as in `base`."""
        scale = np.array(self.model.signals["pose"].scale)
        angle = 2 * np.pi * np.arange(points) / points
        directions = np.zeros((points, len(base)))
        directions[:, first], directions[:, second] = np.cos(angle) * scale[first], np.sin(angle) * scale[second]
        return (base + self.reach(base, directions)[:, None] * directions)[:, [first, second]]

    def ball(self, inside: np.ndarray, channels: tuple[int, ...]) -> Ball:
        """The largest ball, in typical sizes, in the given `channels`; the others stay as in the pose `inside`.

        Tangent planes enclose the convex set; the largest ball inside the planes (a linear programme)
        is tried, and wherever it sticks out a plane is added. Reference: J. E. Kelley, J. SIAM 8 (1960) 703.
        Raises InputError when `inside` cannot be held.
        """
        from scipy.optimize import linprog  # a quarter of a second to import, which no other command should wait for

        chosen = list(channels)
        scale = np.array(self.model.signals["pose"].scale)[chosen]
        rng = np.random.default_rng(0)
        directions = rng.normal(size=(400, len(chosen)))
        directions = np.vstack([np.eye(len(chosen)), -np.eye(len(chosen)), directions])
        directions /= np.linalg.norm(directions, axis=1)[:, None]

        def full(points: np.ndarray) -> np.ndarray:
            poses = np.tile(inside, (len(points), 1))
            poses[:, chosen] = points * scale
            return poses

        heart = inside[chosen] / scale
        normals, offsets = [], []

        def cut(toward: np.ndarray) -> None:
            """A tangent plane where the ray from the heart through each of `toward` leaves the set."""
            poses = full(toward) - inside
            far = self.reach(inside, poses)
            edge = heart + far[:, None] * (toward - heart)
            slope = self._excess.map(len(edge))(full(edge).T)[1].full().T[:, chosen] * scale
            size = np.linalg.norm(slope, axis=1)
            good = np.isfinite(size) & (size > 0)
            normals.extend(slope[good] / size[good, None])
            offsets.extend(np.sum(slope * edge, axis=1)[good] / size[good])

        def protruding(centre: np.ndarray, radius: float) -> np.ndarray:
            """All directions, and the forty in which the ball sticks out most, turned along the gradient."""
            turned = directions[np.argsort(-self.excess(full(centre + radius * directions)))[:40]]
            for _ in range(8):
                slope = self._excess.map(len(turned))(full(centre + radius * turned).T)[1].full().T[:, chosen] * scale
                size = np.linalg.norm(slope, axis=1, keepdims=True)
                turned = np.where(np.isfinite(size) & (size > 0), slope / np.where(size > 0, size, 1.0), turned)
            return np.vstack([directions, turned])

        cut(heart + directions)
        for _ in range(CUTS):
            A = np.column_stack([np.array(normals), np.ones(len(normals))])
            bounds = [(None, None)] * len(chosen) + [(0, None)]
            best = linprog([0.0] * len(chosen) + [-1.0], A, np.array(offsets), bounds=bounds)
            centre, radius = best.x[:-1], best.x[-1]
            surface = centre + radius * protruding(centre, radius)
            out = self.excess(full(centre + (surface - centre) * (1 - TIGHT))) > 0
            if not out.any():
                return Ball(full(centre[None])[0], float(radius), tuple(channels))
            cut(surface[out])
        raise InputError(
            self.model.name, [Fault("workspace", f"the ball was not found in {CUTS} rounds; choose fewer channels")]
        )
