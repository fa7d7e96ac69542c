"""The workspace, the poses a device can hold under all its limits: ranges, slices, the largest ball inside.

Every limit is convex in the displacement and the pose is linear in it, so the set is convex:
a ray from an inner point leaves it once, and tangent planes at its boundary enclose it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import same_dimension
from ctrlgen.model.feedforward import Controller
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate

BISECTIONS = 60  # beyond double precision of the first step
BALL_TOLERANCE = 1e-6  # of a ball's radius: how far its worst point may stick out
END_TOLERANCE = 1e-4  # of the distance to an end of the workspace: how far it may be off
HEIGHTS = (10e-6, 20e-6, 30e-6)  # m
SETTLED = 1e6  # s; longer than any actuator remembers
MOST_ROUNDS = 400  # of tangent planes before giving up
RANDOM_DIRECTIONS = 400  # beside the axes, for the first tangent planes
WORST_DIRECTIONS = 40  # in which a ball sticks out most, turned along the gradient
TURNS = 8  # times


@dataclass(frozen=True)
class Ball:
    """A ball inside the workspace, in typical sizes of the pose: `centre` SI, `radius` in those sizes."""

    centre: np.ndarray
    radius: float
    channels: tuple[int, ...]


@dataclass(frozen=True)
class Workspace:
    """Equilibria of one model; poses are rows (n, channels) in SI."""

    model: Model

    @cached_property
    def drawn(self) -> tuple[int, ...]:
        """The channels of a picture: two across, and one upward where there is a third; translations come first."""
        units = self.model.signals["pose"].units
        order = sorted(range(len(units)), key=lambda i: not same_dimension(units[i], "m"))
        return tuple(order[:3])

    @property
    def translations(self) -> tuple[int, ...]:
        """The channels that are lengths."""
        return tuple(i for i, unit in enumerate(self.model.signals["pose"].units) if same_dimension(unit, "m"))

    def bases(self) -> list[np.ndarray]:
        """Poses at which a platform is usually looked at: some heights, or where it settles at the middle of its drives.

        Heights 10, 20 and 30 um of the third translation. Without one: the middle pose, and halfway from it to both
        ends of the third channel. Raises InputError when the drives have no bounds.
        """
        if len(self.translations) >= 3:
            poses = np.zeros((len(HEIGHTS), len(self.model.signals["pose"].channels)))
            poses[:, self.translations[2]] = HEIGHTS
            return list(poses)
        low, high = self.model.u_bounds
        if not np.isfinite(low + high).all():
            raise InputError(self.model.name, [Fault("--at", "is needed: the drives have no middle")])
        middle = simulate(self.model, (low + high)[None] / 2, SETTLED).signals["pose"][-1]
        if len(self.drawn) < 3:
            return [middle]
        up = self.drawn[2]
        below, above = np.tile(middle, (2, 1))
        below[up], above[up] = (self.ranges(middle)[up] + middle[up]) / 2
        return [below, middle, above]

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
        """Largest normalised violation of each pose (n, channels): below zero where it can be held."""
        value = self._excess.map(len(poses))(poses.T)[0].full().ravel()
        return np.where(np.isnan(value), np.inf, value)  # far outside, the actuator's square root has no value

    def holds(self, pose: np.ndarray) -> bool:
        """Whether one pose can be held."""
        return bool(self.excess(pose[None])[0] <= 0)

    def reach(self, base: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far (n,) the workspace goes from an inner pose `base` along each of `directions` (n, channels).

        Raises InputError when `base` itself cannot be held.
        """
        if not self.holds(base):
            raise InputError(self.model.name, [Fault("base pose", "cannot be held; choose one inside the workspace")])
        size = np.linalg.norm(directions / np.array(self.model.signals["pose"].scale), axis=1)
        low, high = np.zeros(len(directions)), 1.0 / size
        for _ in range(BISECTIONS):  # first out, doubling, then in
            inside = self.excess(base + high[:, None] * directions) <= 0
            if not inside.any():
                break
            low, high = np.where(inside, high, low), np.where(inside, 2 * high, high)
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            inside = self.excess(base + middle[:, None] * directions) <= 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return low

    def ranges(self, base: np.ndarray) -> np.ndarray:
        """(channels, 2): how far each pose component alone goes below and above `base`, SI, as values of the component."""
        axes = np.vstack([-np.eye(len(base)), np.eye(len(base))])
        far = self.reach(base, axes)
        return np.column_stack([base - far[: len(base)], base + far[len(base) :]])

    def outline(self, base: np.ndarray, first: int, second: int, points: int = 720) -> np.ndarray:
        """(points, 2): boundary of the slice through `base` in two channels, in SI, other channels as in `base`."""
        scale = np.array(self.model.signals["pose"].scale)
        angle = 2 * np.pi * np.arange(points) / points
        directions = np.zeros((points, len(base)))
        directions[:, first], directions[:, second] = np.cos(angle) * scale[first], np.sin(angle) * scale[second]
        return (base + self.reach(base, directions)[:, None] * directions)[:, [first, second]]

    def extent(self, inside: np.ndarray) -> np.ndarray:
        """(channels, 2): how far each pose component goes below and above anywhere in the workspace, SI.

        Linear programmes over tangent planes, to END_TOLERANCE of the way from the pose `inside`, which must be held.
        """
        from scipy.optimize import linprog  # a quarter of a second to import, which no other command should wait for

        n = len(inside)
        planes = _Planes(self, inside, tuple(range(n)))
        planes.cut(planes.heart + planes.directions)
        ends = np.zeros((n, 2))
        for i in range(n):
            for side, sign in enumerate((-1.0, 1.0)):
                for _ in range(MOST_ROUNDS):
                    found = linprog(-sign * np.eye(n)[i], *planes.rows(), bounds=(None, None))
                    if planes.cut(found.x[None])[0] >= 1 - END_TOLERANCE:
                        break
                else:
                    raise self._gave_up("the ends were not found")
                ends[i, side] = found.x[i] * planes.scale[i]
        return ends

    def ball(self, inside: np.ndarray, channels: tuple[int, ...]) -> Ball:
        """The largest ball, in typical sizes, in the given `channels`; the others stay as in the pose `inside`.

        Tangent planes enclose the convex set; the largest ball inside the planes (a linear programme)
        is tried, and wherever it sticks out a plane is added. Reference: J. E. Kelley, J. SIAM 8 (1960) 703.
        Raises InputError when `inside` cannot be held.
        """
        from scipy.optimize import linprog

        planes = _Planes(self, inside, channels)

        def protruding(centre: np.ndarray, radius: float) -> np.ndarray:
            """All directions, and the forty in which the ball sticks out most, turned along the gradient."""
            turned = planes.directions[
                np.argsort(-self.excess(planes.poses(centre + radius * planes.directions)))[:WORST_DIRECTIONS]
            ]
            for _ in range(TURNS):
                slope, size, good = planes.slope(centre + radius * turned)
                turned = np.where(good[:, None], slope / np.where(good, size, 1.0)[:, None], turned)
            return np.vstack([planes.directions, turned])

        planes.cut(planes.heart + planes.directions)
        for _ in range(MOST_ROUNDS):
            normals, offsets = planes.rows()
            bounds = [(None, None)] * len(channels) + [(0, None)]
            with_radius = np.column_stack([normals, np.ones(len(normals))])
            best = linprog([0.0] * len(channels) + [-1.0], with_radius, offsets, bounds=bounds)
            centre, radius = best.x[:-1], best.x[-1]
            surface = centre + radius * protruding(centre, radius)
            out = self.excess(planes.poses(centre + (surface - centre) * (1 - BALL_TOLERANCE))) > 0
            if not out.any():
                return Ball(planes.poses(centre[None])[0], float(radius), tuple(channels))
            planes.cut(surface[out])
        raise self._gave_up("the ball was not found")

    def _gave_up(self, what: str) -> InputError:
        return InputError(
            self.model.name, [Fault("workspace", f"{what} in {MOST_ROUNDS} rounds; choose another pose to start")]
        )


class _Planes:
    """Tangent planes that enclose the workspace in some `channels`, seen from a pose `inside`; points in typical sizes."""

    def __init__(self, workspace: Workspace, inside: np.ndarray, channels: tuple[int, ...]) -> None:
        self._workspace, self._inside, self._chosen = workspace, inside, list(channels)
        self.scale = np.array(workspace.model.signals["pose"].scale)[self._chosen]
        self.heart = inside[self._chosen] / self.scale
        n = len(self._chosen)
        directions = np.vstack([np.eye(n), -np.eye(n), np.random.default_rng(0).normal(size=(RANDOM_DIRECTIONS, n))])
        self.directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        self._normals: list[np.ndarray] = []
        self._offsets: list[float] = []

    def poses(self, points: np.ndarray) -> np.ndarray:
        """Whole poses of points, which have the chosen channels only; both as rows."""
        poses = np.tile(self._inside, (len(points), 1))
        poses[:, self._chosen] = points * self.scale
        return poses

    def slope(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradient of the excess at points, its size, and where that can be used."""
        gradient = self._workspace._excess.map(len(points))(self.poses(points).T)[1].full().T
        slope = gradient[:, self._chosen] * self.scale
        size = np.linalg.norm(slope, axis=1)
        return slope, size, np.isfinite(size) & (size > 0)

    def cut(self, toward: np.ndarray) -> np.ndarray:
        """A tangent plane where the ray from the heart to each of `toward` leaves the set; which share of the way that is."""
        far = self._workspace.reach(self._inside, self.poses(toward) - self._inside)
        edge = self.heart + far[:, None] * (toward - self.heart)
        slope, size, good = self.slope(edge)
        self._normals.extend(slope[good] / size[good, None])
        self._offsets.extend(np.sum(slope * edge, axis=1)[good] / size[good])
        return far

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """A, b of the planes A x <= b."""
        return np.array(self._normals), np.array(self._offsets)
