"""What the map of a workspace holds, and its numbers for workspace.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si, show
from ctrlgen.trajectory.workspace import Ball, Workspace


@dataclass(frozen=True)
class WorkspaceSummary:
    """The workspace of a device: `ranges` at each of the `bases` and the `extent` anywhere, (channels, 2) in SI.

    `leading` and `everything`: the largest balls in the translations, or in the rotations where there are none, and in all channels.
    `bound_by`: the limits that end each channel's range at the middle one of the bases. `area` [SI] of the slice there in the two
    channels that are drawn; None where there is one.
    """

    workspace: Workspace
    bases: list[np.ndarray]
    ranges: list[np.ndarray]
    extent: np.ndarray
    leading: Ball
    everything: Ball
    bound_by: list[tuple[str, str]]
    area: float | None

    @property
    def balls(self) -> list[tuple[str, Ball]]:
        """The largest balls with the words for their channels, each once."""
        told = "translations" if self.workspace.translations else "rotations"
        every = [("all channels", self.everything)] if self.everything.channels != self.leading.channels else []
        return [(told, self.leading), *every]

    def radius_of(self, ball: Ball) -> str:
        """The radius in the unit of the channels, such as '15.44 um'; in their typical sizes where these or the units differ."""
        signal = self.workspace.model.signals["pose"]
        sizes = {(float(signal.scale[i]), signal.units[i]) for i in ball.channels}
        if len(sizes) > 1:
            return f"{to_digits(ball.radius)} typical sizes"
        ((size, unit),) = sizes
        return show(ball.radius * size, unit)

    @property
    def shown_area(self) -> str:
        """The area with the channels and the unit, such as 'slice of theta_x and theta_y: 1.2 mrad^2'; empty where there is none."""
        if self.area is None:
            return ""
        signal, (x, y) = self.workspace.model.signals["pose"], self.workspace.drawn[:2]
        units = [signal.units[k] for k in (x, y)]
        unit = f"{units[0]}^2" if units[0] == units[1] else f"{units[0]}*{units[1]}"
        size = self.area * from_si(1.0, units[0]) * from_si(1.0, units[1])
        return f"slice of {signal.channels[x]} and {signal.channels[y]}: {to_digits(size)} {unit}"


def workspace_numbers(summary: WorkspaceSummary) -> dict[str, Any]:
    """The numbers of workspace.json, in the reader's units."""
    signal = summary.workspace.model.signals["pose"]
    named = list(zip(signal.channels, signal.units, strict=True))

    def row(values: np.ndarray) -> dict[str, Any]:
        return {f"{c} [{u}]": np.asarray(from_si(values[i], u)).tolist() for i, (c, u) in enumerate(named)}

    return {
        "device": summary.workspace.model.name,
        "alone": [{"base": row(base), "range": row(r)} for base, r in zip(summary.bases, summary.ranges, strict=True)],
        "anywhere": row(summary.extent),
        "largest_ball": [
            {
                "channels": [signal.channels[i] for i in ball.channels],
                "centre": row(ball.centre),
                "radius_in_typical_sizes": ball.radius,
            }
            for ball in (summary.leading, summary.everything)
        ],
        "bound_by": dict(zip(signal.channels, map(list, summary.bound_by), strict=True)),
        "area": summary.shown_area or None,
        "typical_sizes": row(np.array(signal.scale)),
    }
