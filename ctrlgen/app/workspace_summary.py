"""What the map of a workspace holds, and its numbers for workspace.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.trajectory.workspace import Ball, Workspace


@dataclass(frozen=True)
class WorkspaceSummary:
    """The workspace of a device: `ranges` at each of the `bases` and the `extent` anywhere, (channels, 2) in SI.

    `translations` and `everything`: the largest balls in the translations and in all channels.
    """

    workspace: Workspace
    bases: list[np.ndarray]
    ranges: list[np.ndarray]
    extent: np.ndarray
    translations: Ball
    everything: Ball


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
            for ball in (summary.translations, summary.everything)
        ],
        "typical_sizes": row(np.array(signal.scale)),
    }
