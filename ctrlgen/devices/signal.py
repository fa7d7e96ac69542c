"""Named vectors of a model and how reports show them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Signal:
    """A named vector of the model.

    `label` is its name in reports, `channels` the names of its components, `units` those of reports, `column` the prefix
    of its columns in a CSV file, `expr` (n,) the symbolic value in SI, `scale` a typical size of each channel in SI.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    column: str
    expr: ca.SX
    scale: tuple[float, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """CSV column names with units, such as 'd_1X [um]'."""
        return tuple(f"{self.column}{c} [{u}]" for c, u in zip(self.channels, self.units, strict=True))


@dataclass(frozen=True)
class AxisSignal:
    """How a signal with one channel an axis is shown: label, unit, prefix of its CSV columns, typical size in SI."""

    label: str
    unit: str
    column: str
    scale: float

    def signal(self, name: str, axes: tuple[str, ...], expr: ca.SX) -> Signal:
        """The signal `name` with the value `expr` (n_axes,)."""
        n = len(axes)
        return Signal(name, self.label, axes, (self.unit,) * n, self.column, expr, (self.scale,) * n)
