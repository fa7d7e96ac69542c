"""The channels that a path is commanded in, and a CSV of samples in them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text
from ctrlgen.core.units import Quantity, parse, same_dimension, written_unit
from ctrlgen.physics.euler_angles import rotation_vector_of

Point = dict[str, str | int | float]
ROTATIONS = ("theta_x", "theta_y", "theta_z")


@dataclass(frozen=True)
class Frame:
    """The channels a path is commanded in: names and the unit of each.

    With the `angles` of an order (`physics.euler_angles.ORDERS`) theta_x, theta_y and theta_z of stated poses are angles about these axes
    in this order; what is read is their rotation vector.
    """

    channels: tuple[str, ...]
    units: tuple[str, ...]
    angles: str | None = None

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
        return self.with_rotation_vectors(vector)

    def with_rotation_vectors(self, poses: np.ndarray) -> np.ndarray:
        """Stated poses (..., channels) with rotation vectors in place of their angles."""
        if self.angles is None:
            return poses
        lacking = [name for name in ROTATIONS if name not in self.channels]
        if lacking:
            raise InputError(
                "path", [Fault("angles", f"need {', '.join(ROTATIONS)}, and {', '.join(lacking)} is no channel")]
            )
        places, converted = [self.channels.index(name) for name in ROTATIONS], poses.copy()
        # in the order in which they turn: the angle of axis a is the channel theta_a
        about = ["xyz".index(axis) for axis in self.angles[:3]]
        converted[..., places] = rotation_vector_of(poses[..., [places[k] for k in about]], self.angles)
        return converted

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
                    f"line {line}",
                    f"has {number_of(len(row), 'cell')}, the header has {len(columns)}; give one number per column",
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
    return frame.with_rotation_vectors(values)
