"""Paths: commanded samples of the platform's pose or of the stages' displacements, with their derivatives where a device needs them.

Each kind of path states its curve once; samples are its values, derivatives are those of the same expression. In a `closed` one
the first sample follows the last. Motion between rest points follows the polynomial of least degree, 2 p + 1, whose first p
derivatives are zero at both; p = 2 is minimum jerk (T. Flash, N. Hogan, J. Neurosci. 5 (1985) 1688).
"""

from __future__ import annotations

from collections.abc import Callable
from math import comb
from pathlib import Path
from typing import Annotated, Any, Literal

import casadi as ca
import numpy as np
import scipy
from pydantic import AfterValidator, Field, StrictBool
from pydantic.json_schema import SkipJsonSchema

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import In, Quantity, read_quantity, same_dimension, written_unit
from ctrlgen.devices.section import Section
from ctrlgen.trajectory.frame import Frame, Point, read_poses

MINIMUM_JERK = 2  # derivatives that are zero at a rest point, where nothing else is stated
PERIODIC = 99  # continuous derivatives of a curve without rest points: more than any device needs


def _length_or_angle(given: Quantity) -> Quantity:
    if not any(same_dimension(written_unit(given.text), unit) for unit in ("m", "rad")):
        raise ValueError(f'{given.text!r} has the wrong unit; write a length or an angle, such as "20 um" or "1 mrad"')
    return given


# A length or an angle, as the channels are that it is along
Size = Annotated[Quantity, In(None, positive=True), AfterValidator(_length_or_angle)]


def smooth_step(s: Any, p: int) -> Any:
    """From 0 at s = 0 to 1 at s = 1 with p derivatives zero at both ends: sum_i C(2p+1, i) s^i (1 - s)^(2p+1-i), i = p+1 ... 2p+1.

    `s` is an array or a symbol. In this form no terms cancel.
    """
    degree = 2 * p + 1
    return sum(comb(degree, i) * s**i * (1 - s) ** (degree - i) for i in range(p + 1, degree + 1))


class Path_(Section):
    """Base of the paths. Positions along a path are counted in samples, 0 ... n - 1, and need not be whole."""

    @property
    def closed(self) -> bool:
        """Whether the first sample follows the last one."""
        return False

    @property
    def continuous(self) -> int:
        """How many derivatives are continuous, where the path rests before it begins and after it ends; not known of listed samples."""
        return PERIODIC

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        """n samples, (n, channels) in SI. Raises InputError."""
        return self.derivatives(frame, n, 0, np.arange(n))[0]

    def derivatives(self, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
        """(order + 1, len(at), channels) [SI, per sample^k]: the path of n samples and its derivatives at the positions `at`; a path
        that ends stays at its last sample. Raises InputError."""
        raise NotImplementedError

    def geometry(self, frame: Frame, order: int, share: np.ndarray) -> np.ndarray:
        """(order + 1, len(share), channels) [SI, per share^k]: the curve alone, without a law of time, and its derivatives where the
        `share` of it, 0 ... 1, is behind. Raises InputError."""
        raise NotImplementedError

    def corners_at(self, frame: Frame) -> np.ndarray:
        """The shares at which the curve begins, has corners, and ends."""
        return np.array([0.0, 1.0])


class Smooth_(Path_):
    """Base of the paths with a law of time."""

    smooth: Annotated[int, Field(ge=1, le=6)] | None = None
    """Derivatives that are zero at each rest point: 1 velocity, 2 acceleration, 3 jerk, 4 snap. Left out: 2 (minimum jerk); for a
    device with inertia as many as its drive follows, so that the drive neither jumps nor bends there."""

    @property
    def continuous(self) -> int:
        """The number of derivatives that are zero at rest points."""
        return MINIMUM_JERK if self.smooth is None else self.smooth

    def geometry(self, frame: Frame, order: int, share: np.ndarray) -> np.ndarray:
        """The curve by the law of time of degree one, whose share is the time: of n samples, n or n - 1 lie between the ends."""
        return self.model_copy(update={"smooth": 0}).derivatives(frame, 1 if self.closed else 2, order, share)


class Curve_(Smooth_):
    """Base of the paths that are one formula of the position along them."""

    def curve(self, frame: Frame, k: Any, n: int) -> list[Any]:
        """Each channel [SI] at the position `k`, an array or a symbol, of a path of n samples."""
        raise NotImplementedError

    def _law(self, k: Any, n: int) -> Any:
        """The share of the path that is behind: from rest to rest."""
        return smooth_step(k / (n - 1), self.continuous)

    def derivatives(self, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
        """The curve, and its derivatives by CasADi."""
        at = at if self.closed else np.clip(at, 0, n - 1)
        values = np.column_stack([np.broadcast_to(v, at.shape) for v in self.curve(frame, at, n)])
        if not order:
            return values[None]
        return np.stack([values, *_derivatives(lambda k: ca.vertcat(*self.curve(frame, k, n)), order, at)])


class Periodic_(Curve_):
    """Base of the closed curves."""

    from_rest: StrictBool = False
    """Starts and ends at rest, once along the curve with the smooth law of time. Otherwise the motion is periodic: it starts and ends
    at speed, in the steady motion."""

    @property
    def closed(self) -> bool:
        """Whether the motion repeats: unless it starts from rest."""
        return not self.from_rest

    @property
    def continuous(self) -> int:
        """All derivatives where there is no rest point."""
        return super().continuous if self.from_rest else PERIODIC


class Circle(Periodic_):
    """centre + (diameter/2) (cos w t, sin w t) in `plane`, `turns` whole turns; starts on the first channel's side."""

    kind: Literal["circle"]
    """A circle."""
    diameter: Size
    """Diameter."""
    centre: Point = {}
    """Its centre, as channels with units; channels left out are zero."""
    plane: tuple[str, str] = ("delta_x", "delta_y")
    """Two channels of one dimension that span the plane of the path, first and second."""
    turns: Annotated[int, Field(ge=1, le=1000)] = 1
    """Whole turns in the duration."""

    def curve(self, frame: Frame, k: Any, n: int) -> list[Any]:
        """Each channel [SI] of the circle at the position `k`."""
        angle = 2 * np.pi * self.turns * k / n if self.closed else 2 * np.pi * self.turns * self._law(k, n)
        first, second = frame.directions(self.plane, "plane")
        radius = frame.size(self.diameter, self.plane[0], "diameter") / 2
        return _in_plane(frame.point(self.centre, "centre"), first, second, radius * _cos(angle), radius * _sin(angle))


class Legs_(Smooth_):
    """Base of the paths that are straight from rest point to rest point."""

    def corners(self, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """The rest points (m, channels) [SI] and when they are reached, in any unit of time. Raises InputError."""
        raise NotImplementedError

    def corners_at(self, frame: Frame) -> np.ndarray:
        """When the rest points are reached, as a share of the whole."""
        _, times = self.corners(frame)
        return (times - times[0]) / (times[-1] - times[0])

    def derivatives(self, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
        """The straight legs with the law of time on each, and their derivatives."""
        corners, times = self.corners(frame)
        per_sample = (times[-1] - times[0]) / (n - 1)
        t = times[0] + per_sample * np.clip(at, 0, n - 1)
        leg = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        lasts, p = times[leg + 1] - times[leg], self.continuous
        s = (t - times[leg]) / lasts
        laws = [smooth_step(s, p), *(d[:, 0] for d in _derivatives(lambda s: smooth_step(s, p), order, s))]
        way = corners[leg + 1] - corners[leg]
        tables = [(law * (per_sample / lasts) ** k)[:, None] * way for k, law in enumerate(laws)]
        return np.stack([corners[leg] + tables[0], *tables[1:]])


class Line(Legs_):
    """From `start` to `end`, at rest at both; or evenly spaced."""

    kind: Literal["line"]
    """A straight line."""
    start: Point = {}
    """First pose, as channels with units; channels left out are zero."""
    end: Point
    """Last pose, as channels with units; channels left out are zero."""
    even: StrictBool = False
    """Samples evenly spaced; otherwise they follow the smooth law of time, at rest at both ends."""

    @property
    def continuous(self) -> int:
        """None where the samples are evenly spaced: the velocity jumps."""
        return 0 if self.even else super().continuous

    def corners(self, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """The ends (2, channels) [SI] of the line, reached at the times 0 and 1."""
        return np.array([frame.point(self.start, "start"), frame.point(self.end, "end")]), np.array([0.0, 1.0])


class Raster(Legs_):
    """Parallel lines `length` long, `spacing` apart, back and forth, at rest in every corner.

    A step to the next line takes `step_share` of the time of a line.
    """

    kind: Literal["raster"]
    """Parallel lines, back and forth."""
    length: Size
    """Length of a line, along the first channel of `plane`."""
    spacing: Size
    """Distance between lines, along the second channel of `plane`."""
    lines: Annotated[int, Field(ge=1, le=10000)]
    """Number of lines."""
    centre: Point = {}
    """Middle of the raster, as channels with units; channels left out are zero."""
    plane: tuple[str, str] = ("delta_x", "delta_y")
    """Two channels of one dimension that span the plane of the path, first and second."""
    step_share: Annotated[float, Field(ge=1e-3, le=1)] = 0.2
    """Time of a step to the next line as a share of the time of a line."""

    def corners(self, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
        """The ends (2 lines, channels) [SI] of the lines, in units of the time of one line."""
        fast, slow = frame.directions(self.plane, "plane")
        length = frame.size(self.length, self.plane[0], "length")
        spacing = frame.size(self.spacing, self.plane[1], "spacing")
        corners, times = [], [0.0]
        for line in range(self.lines):
            ends = (-0.5, 0.5) if line % 2 == 0 else (0.5, -0.5)
            level = (line - (self.lines - 1) / 2) * spacing
            for side in ends:
                corners.append(side * length * fast + level * slow)
            times += [times[-1] + 1.0, times[-1] + 1.0 + self.step_share]
        return frame.point(self.centre, "centre") + np.array(corners), np.array(times[:-1])


class Spiral(Curve_):
    """Archimedean, from the centre outwards: r = (diameter/2) s, angle = 2 pi turns s, s by the smooth law of time."""

    kind: Literal["spiral"]
    """An Archimedean spiral."""
    diameter: Size
    """Diameter of the last turn."""
    turns: Annotated[float, Field(gt=0, le=1000)]
    """Number of turns, not necessarily whole."""
    centre: Point = {}
    """Its centre, as channels with units; channels left out are zero."""
    plane: tuple[str, str] = ("delta_x", "delta_y")
    """Two channels of one dimension that span the plane of the path, first and second."""

    def curve(self, frame: Frame, k: Any, n: int) -> list[Any]:
        """Each channel [SI] of the spiral at the position `k`, from rest to rest."""
        s = self._law(k, n)
        first, second = frame.directions(self.plane, "plane")
        radius, angle = frame.size(self.diameter, self.plane[0], "diameter") / 2 * s, 2 * np.pi * self.turns * s
        return _in_plane(frame.point(self.centre, "centre"), first, second, radius * _cos(angle), radius * _sin(angle))


class Lissajous(Periodic_):
    """centre + (a_1 sin(2 pi f_1 t/T + phase), a_2 sin(2 pi f_2 t/T)): f_1 and f_2 whole periods in the duration."""

    kind: Literal["lissajous"]
    """A Lissajous figure."""
    amplitudes: tuple[Size, Size]
    """a_1 and a_2: amplitudes along the two channels of `plane`."""
    periods: tuple[Annotated[int, Field(ge=1, le=1000)], Annotated[int, Field(ge=1, le=1000)]]
    """f_1 and f_2: whole periods in the duration."""
    phase: Annotated[Quantity, In("deg")] = read_quantity("deg", "90 deg")
    """Phase of the first channel at the start."""
    centre: Point = {}
    """Its centre, as channels with units; channels left out are zero."""
    plane: tuple[str, str] = ("delta_x", "delta_y")
    """Two channels of one dimension that span the plane of the path, first and second."""

    def curve(self, frame: Frame, k: Any, n: int) -> list[Any]:
        """Each channel [SI] of the figure at the position `k`."""
        t = self._law(k, n) if self.from_rest else k / n
        first, second = frame.directions(self.plane, "plane")
        a_1, a_2 = (frame.size(a, at, "amplitudes") for a, at in zip(self.amplitudes, self.plane, strict=True))
        along = a_1 * _sin(2 * np.pi * self.periods[0] * t + self.phase.si)
        across = a_2 * _sin(2 * np.pi * self.periods[1] * t)
        return _in_plane(frame.point(self.centre, "centre"), first, second, along, across)


class Poses(Path_):
    """Samples listed in the scenario (`points`) or in a CSV file (`file`), one row per sample.

    Between samples, and for derivatives, the path is the spline of degree 2 p + 1 through them whose first p derivatives are zero at
    both ends, p the derivatives that are needed; or the periodic one.
    """

    kind: Literal["poses"]
    """Listed samples."""
    points: tuple[Point, ...] = ()
    """The samples, each as channels with units; channels left out are zero."""
    file: str = ""
    """A CSV file, relative to scenario.toml: a header row of channels such as `delta_z [um]`, then one row a sample."""
    periodic: StrictBool = False
    """The first sample follows the last one. Otherwise the path ends at its last sample."""
    folder: SkipJsonSchema[Path] = Field(default=Path(), exclude=True)
    """Where `file` is looked for; set by the program."""
    listed: SkipJsonSchema[tuple[tuple[float, ...], ...]] = Field(default=(), exclude=True)
    """The samples of `file` [SI] where it is yet to be written; set by the program."""

    @property
    def closed(self) -> bool:
        """Whether the first sample follows the last one, as `periodic` states."""
        return self.periodic

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        """The samples as listed; `n` is not read."""
        if self.listed:
            return np.array(self.listed)
        if bool(self.points) == bool(self.file):
            what = "give points or file, not both" if self.points else "is missing; give points or file"
            raise InputError("path", [Fault("points", what)])
        if self.points:
            return np.array([frame.point(point, f"points[{i}]") for i, point in enumerate(self.points)])
        return read_poses(self.folder / self.file, frame)

    def derivatives(self, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
        """The spline through the samples, and its derivatives. Raises InputError where there are too few samples."""
        listed = self.samples(frame, n)
        still = [(k, np.zeros(listed.shape[1])) for k in range(1, order + 1)]
        if len(listed) < 2 * order + 2:
            what = f"has {number_of(len(listed), 'sample')}; their {order}. derivative takes {2 * order + 2} or more: add samples"
            raise InputError("path", [Fault("points", what)])
        if self.periodic:
            ring = np.vstack([listed, listed[:1]])
            spline = scipy.interpolate.make_interp_spline(np.arange(len(ring)), ring, 2 * order + 1, bc_type="periodic")
            return np.stack([spline(at, k, extrapolate="periodic") for k in range(order + 1)])
        spline = scipy.interpolate.make_interp_spline(
            np.arange(len(listed)), listed, 2 * order + 1, bc_type=(still, still)
        )
        return np.stack([spline(np.clip(at, 0, len(listed) - 1), k) for k in range(order + 1)])


PathKind = Annotated[Circle | Line | Raster | Spiral | Lissajous | Poses, Field(discriminator="kind")]


def _in_plane(centre: np.ndarray, first: np.ndarray, second: np.ndarray, along: Any, across: Any) -> list[Any]:
    """Each channel of centre + along first + across second."""
    return [
        c + (along * a + across * b) for c, a, b in zip(centre.tolist(), first.tolist(), second.tolist(), strict=True)
    ]


def _cos(angle: Any) -> Any:
    return ca.cos(angle) if isinstance(angle, ca.SX) else np.cos(angle)


def _sin(angle: Any) -> Any:
    return ca.sin(angle) if isinstance(angle, ca.SX) else np.sin(angle)


def _derivatives(curve: Callable[[Any], Any], order: int, at: np.ndarray) -> list[np.ndarray]:
    """The first `order` derivatives (len(at), channels) of a curve of one variable."""
    s = ca.SX.sym("s")
    orders = [ca.SX(curve(s))]
    for _ in range(order):
        orders.append(ca.jacobian(orders[-1], s))
    if not order:
        return []
    values = ca.Function("derivatives", [s], [ca.horzcat(*orders[1:])]).map(len(at))(at[None]).full()
    return [values[:, k::order].T for k in range(order)]
