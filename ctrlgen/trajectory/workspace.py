"""The workspace, the poses a device can hold under all its limits: ranges, slices, the largest ball inside.

Every limit is convex in the displacement and the pose is linear in it, so the set is convex:
a ray from an inner point leaves it once, and tangent planes at its boundary enclose it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.tabular import Drawn
from ctrlgen.core.units import same_dimension
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate

BISECTIONS = 60  # beyond double precision of the first step
ROUNDING = 1e-9  # of a channel's typical size: what is left of a zero
BALL_TOLERANCE = 1e-6  # of a ball's radius: how far its worst point may stick out
END_TOLERANCE = 1e-4  # of the distance to an end of the workspace: how far it may be off
HEIGHTS = (10e-6, 20e-6, 30e-6)  # m, of the slices of a platform with three translations
SETTLED = 1e6  # s; longer than any actuator's memory
MOST_ROUNDS = 400  # of tangent planes before the search is given up
RANDOM_DIRECTIONS = 400  # beside the axes, for the first tangent planes
WORST_DIRECTIONS = 40  # in which a ball sticks out most: these are turned along the gradient
TURNS = 8  # gradient steps of each


@dataclass(frozen=True)
class Ball:
    """A ball inside the workspace in some `channels` of the pose: `centre` [SI], `radius` in typical sizes of the channels."""

    centre: np.ndarray
    radius: float
    channels: tuple[int, ...]


def translations(model: Model) -> tuple[int, ...]:
    """The channels of the pose that are lengths."""
    return tuple(i for i, unit in enumerate(model.signals["pose"].units) if same_dimension(unit, "m"))


def middle_pose(model: Model) -> np.ndarray:
    """(channels,) [SI] the middle one of the heights of a platform with three translations; else the pose at the middle of all drives.

    Raises InputError where the drives have no bounds.
    """
    if len(translations(model)) >= 3:
        return _raised(model, HEIGHTS[len(HEIGHTS) // 2])
    low, high = model.u_bounds
    if not (np.isfinite(low) & np.isfinite(high)).all():
        what = "is needed, for some drive has no bounds and so no middle; give a pose"
        raise InputError(model.name, [Fault("--at", what)])
    return np.asarray(simulate(model, (low + high)[None] / 2, SETTLED).signals["pose"][-1])


def _raised(model: Model, height: float) -> np.ndarray:
    """The pose at a height [m] of the third translation."""
    pose = np.zeros(len(model.signals["pose"].channels))
    pose[translations(model)[2]] = height
    return pose


@dataclass(frozen=True, repr=False)
class Workspace(Drawn):
    """The poses in which one model can be held in equilibrium; poses are rows (n, channels) in SI. Raises InputError for more drives
    than axes: the limits of the drives then bound what they push together, and not one drive each."""

    model: Model

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {"of": self.model.device.title, "channels": ", ".join(self.model.signals["pose"].channels)}

    def __post_init__(self) -> None:
        if self.model.redundant:
            what = "has more drives than axes, for which no workspace is mapped yet; check a path instead"
            raise InputError(self.model.name, [Fault("device", what)])

    @cached_property
    def drawn(self) -> tuple[int, ...]:
        """The channels that are drawn: two horizontal ones, and a vertical one where there is a third; translations first."""
        units = self.model.signals["pose"].units
        order = sorted(range(len(units)), key=lambda i: not same_dimension(units[i], "m"))
        return tuple(order[:3])

    @property
    def translations(self) -> tuple[int, ...]:
        """The channels that are lengths."""
        return translations(self.model)

    @property
    def leading(self) -> tuple[int, ...]:
        """The translations, or where there are none the rotations: the channels in which the first ball is searched."""
        return self.translations or tuple(range(len(self.model.signals["pose"].channels)))

    def bases(self) -> list[np.ndarray]:
        """Poses through which slices are drawn by default: some heights, or the pose at the middle of all drives.

        Heights are 10, 20 and 30 um of the third translation. Without a third one: the pose at the middle of the drives, and
        those halfway from it to both ends of the third channel. Raises InputError where the drives have no bounds.
        """
        if len(self.translations) >= 3:
            return [_raised(self.model, height) for height in HEIGHTS]
        middle = middle_pose(self.model)
        if len(self.drawn) < 3:
            return [middle]
        up = self.drawn[2]
        below, above = np.tile(middle, (2, 1))
        below[up], above[up] = (self.ranges(middle)[up] + middle[up]) / 2
        return [below, middle, above]

    @cached_property
    def _excess(self) -> ca.Function:
        """pose -> the largest violation of a limit over its range, and its gradient; negative inside, zero on the boundary."""
        pose, violations, _ = self._violations
        worst = ca.mmax(violations)
        return ca.Function("excess", [pose], [worst, ca.gradient(worst, pose)])

    @cached_property
    def _violations(self) -> tuple[ca.SX, ca.SX, tuple[str, ...]]:
        """(pose, the violation of each limit over its range, the labels of these limits)."""
        m = self.model
        inverse = ControllerKernels(m, "pose", None).static
        pose = ca.SX.sym("pose", len(m.signals["pose"].channels))
        x, z = ca.DM(m.rest), ca.DM.zeros(m.z.numel())
        d = inverse.displacement(x, z, pose)
        state = inverse.state(x, z, d)
        u = inverse.drive(x, z, d, state)
        values = m.evaluate_limits(ca.vertcat(state, ca.DM(m.rest[m.n_states :])), d, u, m.p_nominal)
        violations, labels = [], list[str]()
        for limit, value in zip(m.limits, values, strict=True):
            named = [limit.label if len(limit.channels) == 1 else f"{limit.label}, {c}" for c in limit.channels]
            if limit.upper is not None:
                violations.append((value - limit.upper) / (limit.span or 1.0))
                labels += named
            if limit.lower is not None and limit.span:
                violations.append((limit.lower - value) / limit.span)
                labels += named
        return pose, ca.vertcat(*violations), tuple(labels)

    def binding(self, poses: np.ndarray) -> list[str]:
        """The label of the limit that is the nearest, or passed the farthest, in each of `poses` (n, channels)."""
        pose, violations, labels = self._violations
        values = ca.Function("violations", [pose], [violations]).map(len(poses))(poses.T).full()
        return [labels[int(k)] for k in np.argmax(values, axis=0)]

    def excess(self, poses: np.ndarray) -> np.ndarray:
        """The largest violation of a limit in each pose, over the limit's range, (n,): negative where the pose can be held."""
        value = self._excess.map(len(poses))(poses.T)[0].full().ravel()
        # Far outside, the square root of an actuator's law has no value
        return np.where(np.isnan(value), np.inf, value)

    def holds(self, pose: np.ndarray) -> bool:
        """Whether one pose can be held."""
        return bool(self.excess(pose[None])[0] <= 0)

    def reach(self, base: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Multiples (n,) of each of `directions` (n, channels) at which a ray from the inner pose `base` leaves the workspace.

        By doubling, then bisection. Raises InputError where `base` itself cannot be held.
        """
        if not self.holds(base):
            raise InputError(
                self.model.name,
                [Fault("base pose", "cannot be held within the device's limits; choose one inside the workspace")],
            )
        size = np.linalg.norm(directions / np.array(self.model.signals["pose"].scale), axis=1)
        low, high = np.zeros(len(directions)), 1.0 / size
        for _ in range(BISECTIONS):  # doubled until the pose is outside
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
        """Lowest and highest value [SI] of each pose component when it alone leaves `base`, (channels, 2)."""
        axes = np.vstack([-np.eye(len(base)), np.eye(len(base))])
        far = self.reach(base, axes)
        return np.column_stack([base - far[: len(base)], base + far[len(base) :]])

    def bound_by(self, base: np.ndarray) -> list[tuple[str, str]]:
        """For each pose component the limits that end its `ranges` from `base`, at the lowest and at the highest value."""
        ends, bound = self.ranges(base), list[tuple[str, str]]()
        for i in range(len(base)):
            low, high = self.binding(np.array([np.where(np.arange(len(base)) == i, end, base) for end in ends[i]]))
            bound.append((low, high))
        return bound

    def area(self, base: np.ndarray, first: int, second: int) -> float:
        """Area of the slice through `base` in two channels [product of their SI units]. From 720 corners of its outline, which leave out
        less than 2e-5 of a round one."""
        x, y = self.outline(base, first, second).T
        return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)

    def outline(self, base: np.ndarray, first: int, second: int, points: int = 720) -> np.ndarray:
        """Boundary [SI] of the slice through `base` in the channels `first` and `second`, (points, 2); others as in `base`."""
        scale = np.array(self.model.signals["pose"].scale)
        angle = 2 * np.pi * np.arange(points) / points
        directions = np.zeros((points, len(base)))
        directions[:, first], directions[:, second] = np.cos(angle) * scale[first], np.sin(angle) * scale[second]
        return (base + self.reach(base, directions)[:, None] * directions)[:, [first, second]]

    def extent(self, inside: np.ndarray) -> np.ndarray:
        """Lowest and highest value [SI] of each pose component anywhere in the workspace, (channels, 2).

        By linear programmes over tangent planes, to END_TOLERANCE of the distance from the pose `inside`, which must be held.
        Raises InputError where `inside` cannot be held, or after too many rounds.
        """
        from scipy.optimize import linprog  # a quarter of a second to import, which no other command should wait for

        n = len(inside)
        planes = _Planes(self, inside, tuple(range(n)))
        planes.cut(planes.origin + planes.directions)
        ends = np.zeros((n, 2))
        for i in range(n):
            for side, sign in enumerate((-1.0, 1.0)):
                for _ in range(MOST_ROUNDS):
                    optimum = linprog(-sign * np.eye(n)[i], *planes.rows(), bounds=(None, None))
                    if planes.cut(optimum.x[None])[0] >= 1 - END_TOLERANCE:
                        break
                else:
                    raise self._not_found("its ends were")
                ends[i, side] = optimum.x[i] * planes.scale[i]
        return ends

    def ball(self, inside: np.ndarray, channels: tuple[int, ...]) -> Ball:
        """The largest ball in the given `channels`, in their typical sizes; the others stay as in the pose `inside`.

        Tangent planes enclose the convex set; the largest ball inside the planes (a linear programme) is tried, and wherever
        it sticks out of the set a plane is added. Reference: J. E. Kelley, J. SIAM 8 (1960) 703.
        Raises InputError where `inside` cannot be held, or after too many rounds.
        """
        from scipy.optimize import linprog

        planes = _Planes(self, inside, channels)

        def checked_directions(centre: np.ndarray, radius: float) -> np.ndarray:
            """All directions, and those in which the ball sticks out most, turned along the gradient."""
            turned = planes.directions[
                np.argsort(-self.excess(planes.poses(centre + radius * planes.directions)))[:WORST_DIRECTIONS]
            ]
            for _ in range(TURNS):
                slope, size, good = planes.slope(centre + radius * turned)
                turned = np.where(good[:, None], slope / np.where(good, size, 1.0)[:, None], turned)
            return np.vstack([planes.directions, turned])

        planes.cut(planes.origin + planes.directions)
        for _ in range(MOST_ROUNDS):
            normals, offsets = planes.rows()
            bounds = [(None, None)] * len(channels) + [(0, None)]
            with_radius = np.column_stack([normals, np.ones(len(normals))])
            best = linprog([0.0] * len(channels) + [-1.0], with_radius, offsets, bounds=bounds)
            centre, radius = best.x[:-1], best.x[-1]
            surface = centre + radius * checked_directions(centre, radius)
            out = self.excess(planes.poses(centre + (surface - centre) * (1 - BALL_TOLERANCE))) > 0
            if not out.any():
                return Ball(planes.poses(centre[None])[0], float(radius), tuple(channels))
            planes.cut(surface[out])
        raise self._not_found("its largest ball was")

    def _not_found(self, what: str) -> InputError:
        fault = Fault(
            "workspace", f"{what} not found in {MOST_ROUNDS} rounds of tangent planes; start from another pose"
        )
        return InputError(self.model.name, [fault])


class _Planes:
    """Tangent planes that enclose the workspace in some `channels` around a pose `inside`; points in typical sizes."""

    def __init__(self, workspace: Workspace, inside: np.ndarray, channels: tuple[int, ...]) -> None:
        self._workspace, self._inside, self._chosen = workspace, inside, list(channels)
        self.scale = np.array(workspace.model.signals["pose"].scale)[self._chosen]
        self.origin = inside[self._chosen] / self.scale
        n = len(self._chosen)
        directions = np.vstack([np.eye(n), -np.eye(n), np.random.default_rng(0).normal(size=(RANDOM_DIRECTIONS, n))])
        self.directions = directions / np.linalg.norm(directions, axis=1)[:, None]
        self._normals: list[np.ndarray] = []
        self._offsets: list[float] = []

    def poses(self, points: np.ndarray) -> np.ndarray:
        """Whole poses [SI] of points, which have the chosen channels only; both as rows."""
        poses = np.tile(self._inside, (len(points), 1))
        poses[:, self._chosen] = points * self.scale
        return poses

    def slope(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gradient of the violation at points, its length, and where both are usable."""
        gradient = self._workspace._excess.map(len(points))(self.poses(points).T)[1].full().T
        slope = gradient[:, self._chosen] * self.scale
        size = np.linalg.norm(slope, axis=1)
        return slope, size, np.isfinite(size) & (size > 0)

    def cut(self, toward: np.ndarray) -> np.ndarray:
        """Adds a tangent plane where the ray from the inner pose to each of `toward` leaves the set; gives the multiples (n,)."""
        far = self._workspace.reach(self._inside, self.poses(toward) - self._inside)
        edge = self.origin + far[:, None] * (toward - self.origin)
        slope, size, good = self.slope(edge)
        self._normals.extend(slope[good] / size[good, None])
        self._offsets.extend(np.sum(slope * edge, axis=1)[good] / size[good])
        return far

    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """A and b of the planes A x <= b."""
        return np.array(self._normals), np.array(self._offsets)
