"""The curve of a path without its law of time, in smooth pieces, and the length along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import same_dimension
from ctrlgen.model.model import Model
from ctrlgen.trajectory.paths import Poses
from ctrlgen.trajectory.problem import PathProblem
from ctrlgen.trajectory.scenario import Scenario

DENSE = 4001  # places at which its length is summed up


@dataclass(frozen=True)
class Curve:
    """The curve of a `scenario`, scaled by `scale` about its middle."""

    scenario: Scenario
    model: Model
    scale: float = 1.0

    def __post_init__(self) -> None:
        if isinstance(self.scenario.file.path, Poses):
            what = "lists samples, whose times are given with them; state the path as a formula, such as a circle, line or raster"
            raise InputError(self.scenario.path, [Fault("path", what)])

    @cached_property
    def _problem(self) -> PathProblem:
        return self.scenario.bind(self.model)

    @property
    def closed(self) -> bool:
        """Whether it is followed again and again."""
        return self.scenario.file.path.closed

    @cached_property
    def pieces(self) -> list[tuple[float, float]]:
        """The shares between which it is smooth."""
        corners = self._problem.corners
        return list(zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True))

    def derivatives(self, share: np.ndarray, order: int, piece: tuple[float, float] | None = None) -> np.ndarray:
        """(order + 1, n, channels) [SI, per share^k]: the curve and its derivatives by the share; at the ends of a `piece` its own."""
        inside = share
        if piece is not None and not self.closed:
            inside = np.clip(share, *np.nextafter(piece, piece[::-1]))
        tables = self._problem.geometry(order, inside)
        middle = self._middle
        return np.stack([middle + self.scale * (tables[0] - middle), *(self.scale * t for t in tables[1:])])

    def samples(self, share: np.ndarray) -> np.ndarray:
        """The curve (n, channels) [SI] at the shares (n,) of the path."""
        return self.derivatives(share, 0)[0]

    def scaled(self, scale: float) -> Curve:
        """The same curve, larger or smaller about its middle."""
        return replace(self, scale=scale)

    @cached_property
    def _middle(self) -> np.ndarray:
        points = self._problem.geometry(0, np.linspace(0, 1, DENSE))[0]
        return (points.min(axis=0) + points.max(axis=0)) / 2

    @cached_property
    def _length(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares, corners among them, and the length up to each, in typical sizes of the channels."""
        share = np.unique(np.concatenate([np.linspace(0, 1, DENSE), *self.pieces]))
        signal = self.model.signals[self.scenario.file.follow]
        # Alike for channels of one dimension, so that a circle is evenly round
        sizes = [
            max(size for size, other in zip(signal.scale, signal.units, strict=True) if same_dimension(other, unit))
            for unit in signal.units
        ]
        step = np.diff(self.samples(share), axis=0) / sizes
        return share, np.concatenate([[0.0], np.cumsum(np.linalg.norm(step, axis=1))])

    @property
    def length(self) -> float:
        """Its length in typical sizes of the channels."""
        return float(self._length[1][-1])

    def evenly(self, intervals: int) -> np.ndarray:
        """Shares (at least intervals + 1,) at equal distances along the curve, every corner among them."""
        share, length = self._length
        step = length[-1] / intervals
        shares = [np.zeros(1)]
        for a, b in self.pieces:
            first, last = (float(np.interp(end, share, length)) for end in (a, b))
            n = max(1, int(np.ceil((last - first) / step * (1 - 1e-9))))
            shares.append(np.append(np.interp(np.linspace(first, last, n + 1)[1:-1], length, share), b))
        return np.concatenate(shares)
