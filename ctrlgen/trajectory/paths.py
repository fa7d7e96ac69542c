"""Paths: commanded samples of the platform's pose or of the stages' displacements.

Each kind of path turns its parameters into an array of samples; in a `closed` one the first sample follows the last.
Motion between rest points follows the minimum-jerk law
s(t) = 10 t^3 - 15 t^4 + 6 t^5 (T. Flash, N. Hogan, J. Neurosci. 5 (1985) 1688).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field
from pydantic.json_schema import SkipJsonSchema

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text
from ctrlgen.core.units import In, Quantity, parse, read_quantity, same_dimension, written_unit
from ctrlgen.devices.base import Section


def _length_or_angle(given: Quantity) -> Quantity:
    if not any(same_dimension(written_unit(given.text), unit) for unit in ("m", "rad")):
        raise ValueError(f'{given.text!r} has the wrong unit; write a length or an angle, such as "20 um" or "1 mrad"')
    return given


Size = Annotated[
    Quantity, In(None, positive=True), AfterValidator(_length_or_angle)
]  # as the channels that it is along
Point = dict[str, str | int | float]


@dataclass(frozen=True)
class Frame:
    """The channels a path is commanded in: names and the unit of each."""

    channels: tuple[str, ...]
    units: tuple[str, ...]

    def point(self, given: Point, where: str) -> np.ndarray:
        """{'delta_z': '20 um'} as an SI vector; channels not named are zero. Raises InputError."""
        vector, faults = np.zeros(len(self.channels)), []
        for name, text in given.items():
            if name not in self.channels:
                faults.append(Fault(f"{where}.{name}", f"is not a channel; known: {', '.join(self.channels)}"))
                continue
            i = self.channels.index(name)
            try:
                vector[i] = parse(text, self.units[i])
            except ValueError as error:
                faults.append(Fault(f"{where}.{name}", str(error)))
        if faults:
            raise InputError("path", faults)
        return vector

    def pose(self, text: str, option: str) -> np.ndarray:
        """'delta_x=5um,delta_z=20um', as given to a command's `option`, as an SI vector. Raises InputError."""
        pairs = [part.partition("=") for part in text.split(",") if part.strip()]
        if any(not value for _, _, value in pairs):
            example = "write channel=value, separated by commas, such as delta_x=5um,delta_z=20um"
            raise InputError(option, [Fault(text, example)])
        try:
            return self.point({name.strip(): value.strip() for name, _, value in pairs}, "")
        except InputError as error:
            raise InputError(option, [Fault(f.where.removeprefix("."), f.what) for f in error.faults]) from None

    def directions(self, names: Sequence[str], where: str) -> np.ndarray:
        """Unit vectors of the named channels, (n, channels). Raises InputError for unknown channels and for those of different
        dimensions."""
        for name in names:
            if name not in self.channels:
                raise InputError(
                    "path", [Fault(where, f"{name!r} is not a channel; known: {', '.join(self.channels)}")]
                )
        if len(set(names)) != len(names):
            raise InputError("path", [Fault(where, "names the same channel twice; name two different ones")])
        units = [self.units[self.channels.index(name)] for name in names]
        if not all(same_dimension(unit, units[0]) for unit in units):
            what = " and ".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
            raise InputError("path", [Fault(where, f"{what} are not of one dimension; name two lengths or two angles")])
        return np.eye(len(self.channels))[[self.channels.index(name) for name in names]]

    def size(self, given: Quantity, channel: str, where: str) -> float:
        """A size along a channel in SI. Raises InputError where its dimension is not that of the channel."""
        unit = self.units[self.channels.index(channel)]
        if not same_dimension(written_unit(given.text), unit):
            what = (
                f'{given.text!r} is not of the dimension of {channel}; write a number with a unit, such as "1 {unit}"'
            )
            raise InputError("path", [Fault(where, what)])
        return given.si


def minimum_jerk(s: np.ndarray) -> np.ndarray:
    """10 s^3 - 15 s^4 + 6 s^5 on 0 <= s <= 1."""
    return s**3 * (10 - 15 * s + 6 * s**2)


class Path_(Section):
    """Base of the paths; `samples(frame, n)` gives n samples, (n, channels) in SI, and raises InputError."""

    closed: ClassVar[bool] = False

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        raise NotImplementedError


class Circle(Path_):
    """centre + (diameter/2) (cos w t, sin w t) in `plane`, `turns` whole turns; starts on the first channel's side."""

    closed: ClassVar[bool] = True
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

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        angle = 2 * np.pi * self.turns * np.arange(n) / n
        first, second = frame.directions(self.plane, "plane")
        radius = frame.size(self.diameter, self.plane[0], "diameter") / 2
        return frame.point(self.centre, "centre") + radius * (
            np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
        )


class Line(Path_):
    """From `start` to `end`: minimum jerk in time, or evenly spaced where the scenario is static."""

    kind: Literal["line"]
    """A straight line."""
    start: Point = {}
    """First pose, as channels with units; channels left out are zero."""
    end: Point
    """Last pose, as channels with units; channels left out are zero."""
    even: bool = False
    """Samples evenly spaced; otherwise they follow the minimum-jerk law, at rest at both ends."""

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        s = np.linspace(0, 1, n)
        s = s if self.even else minimum_jerk(s)
        start, end = frame.point(self.start, "start"), frame.point(self.end, "end")
        return start + np.outer(s, end - start)


class Raster(Path_):
    """`lines` parallel lines `length` long, `spacing` apart, back and forth, at rest in every corner.

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
    step_share: Annotated[float, Field(gt=0, le=1)] = 0.2
    """Time of a step to the next line as a share of the time of a line."""

    def samples(self, frame: Frame, n: int) -> np.ndarray:
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
        return frame.point(self.centre, "centre") + _through(np.array(corners), np.array(times[:-1]), n)


class Spiral(Path_):
    """Archimedean, from the centre outwards: r = (diameter/2) s, angle = 2 pi turns s, s minimum jerk."""

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

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        s = minimum_jerk(np.linspace(0, 1, n))
        first, second = frame.directions(self.plane, "plane")
        radius, angle = frame.size(self.diameter, self.plane[0], "diameter") / 2 * s, 2 * np.pi * self.turns * s
        return (
            frame.point(self.centre, "centre")
            + np.outer(radius * np.cos(angle), first)
            + np.outer(radius * np.sin(angle), second)
        )


class Lissajous(Path_):
    """centre + (a_1 sin(2 pi f_1 t/T + phase), a_2 sin(2 pi f_2 t/T)): f_1 and f_2 whole periods in the duration."""

    closed: ClassVar[bool] = True
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

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        t = np.arange(n) / n
        rows = frame.directions(self.plane, "plane")
        a_1, a_2 = (frame.size(a, at, "amplitudes") for a, at in zip(self.amplitudes, self.plane, strict=True))
        first = a_1 * np.sin(2 * np.pi * self.periods[0] * t + self.phase.si)
        second = a_2 * np.sin(2 * np.pi * self.periods[1] * t)
        return frame.point(self.centre, "centre") + np.outer(first, rows[0]) + np.outer(second, rows[1])


class Poses(Path_):
    """Samples listed in the scenario (`points`) or in a CSV file (`file`), one row per sample."""

    kind: Literal["poses"]
    """Listed samples."""
    points: tuple[Point, ...] = ()
    """The samples, each as channels with units; channels left out are zero."""
    file: str = ""
    """A CSV file, relative to scenario.toml: a header row of channels such as `delta_z [um]`, then one row a sample."""
    folder: SkipJsonSchema[Path] = Field(default=Path(), exclude=True)
    """Where `file` is looked for; set by the program."""

    def samples(self, frame: Frame, n: int) -> np.ndarray:
        if bool(self.points) == bool(self.file):
            raise InputError(
                "path",
                [
                    Fault(
                        "points",
                        "give either points or file, not both" if self.points else "is missing; give points or file",
                    )
                ],
            )
        if self.points:
            return np.array([frame.point(point, f"points[{i}]") for i, point in enumerate(self.points)])
        return read_poses(self.folder / self.file, frame)


PathKind = Annotated[Circle | Line | Raster | Spiral | Lissajous | Poses, Field(discriminator="kind")]


def _through(corners: np.ndarray, times: np.ndarray, n: int) -> np.ndarray:
    """(n, channels): from corner to corner, at `times`, with minimum jerk and at rest in each of the `corners`."""
    t = np.linspace(times[0], times[-1], n)
    leg = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    s = minimum_jerk((t - times[leg]) / (times[leg + 1] - times[leg]))
    return corners[leg] + s[:, None] * (corners[leg + 1] - corners[leg])


def read_poses(path: Path, frame: Frame) -> np.ndarray:
    """A CSV of samples as (n, channels) in SI. Raises InputError listing every bad cell by line and column."""
    try:
        lines = list(csv.reader(io.StringIO(read_text(path))))
    except csv.Error as error:
        raise InputError(
            path, [Fault("file", f"is no CSV: {error}; write a header row and one row a sample")]
        ) from None
    rows = [(line, row) for line, row in enumerate(lines, start=1) if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        raise InputError(path, [Fault("file", "has no samples; write a header row and one row per sample")])
    columns: list[tuple[int, str, str]] = []
    faults = []
    for text in rows[0][1]:
        name, _, unit = text.strip().partition("[")
        name, unit = name.strip(), unit.rstrip("] ").strip()
        if name not in frame.channels:
            faults.append(
                Fault("line 1", f"column {text.strip()!r} is not a channel; known: {', '.join(frame.channels)}")
            )
            continue
        index = frame.channels.index(name)
        if index in [known for known, _, _ in columns]:
            faults.append(Fault("line 1", f"column {name!r} occurs twice; keep one"))
        try:
            parse(f"0 {unit}", frame.units[index])
        except ValueError:
            faults.append(
                Fault("line 1", f'column {text.strip()!r} needs a unit; write "{name} [{frame.units[index]}]"')
            )
        columns.append((index, unit, name))
    if faults:
        raise InputError(path, faults)
    values = np.zeros((len(rows) - 1, len(frame.channels)))
    for k, (line, row) in enumerate(rows[1:]):
        if len(row) != len(columns):
            faults.append(
                Fault(
                    f"line {line}", f"has {len(row)} cells, the header has {len(columns)}; give one number per column"
                )
            )
            continue
        for (index, unit, name), cell in zip(columns, row, strict=True):
            try:
                values[k, index] = parse(f"{cell.strip()} {unit}", frame.units[index])
            except ValueError:
                faults.append(
                    Fault(
                        f"line {line}, {name}", f"{cell.strip()!r} is not a finite number; write one or remove the row"
                    )
                )
    if faults:
        raise InputError(path, faults[:20] + ([Fault("…", f"and {len(faults) - 20} more")] if len(faults) > 20 else []))
    return values
