"""Where the residual is large, before and after the correction: by reading, actuator, frequency, travel, direction and time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import Annotated, Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from pydantic import Field, WithJsonSchema

from ctrlgen.diagnosis.evidence.gathered_residual import GatheredEntry
from ctrlgen.diagnosis.evidence.spectral_lines import SpectralLinesEntry
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.plots import COLOURS
from ctrlgen.reporting.result_file import FiniteOrNull, Keys, Number

FIGURE_WIDTH = 8.6
# bars in one group
PARTS = 14
Interval = tuple[FiniteOrNull, FiniteOrNull]


class ResidualPartEntry(Keys):
    """The residual in one part of the recording."""

    label: str = Field(description="The part.")
    excess: FiniteOrNull = Field(description="Mean square of the whitened residual, less 1: 0 is noise alone.")
    ci95: Interval = Field(description="95 % interval of excess.")
    share: FiniteOrNull = Field(description="Share of the whole excess.")
    mean: FiniteOrNull = Field(description="Mean of the residual [unit].")
    mean_ci95: Interval = Field(description="95 % interval of mean.")
    unit: str = Field(description="Unit of mean.")
    n: int = Field(description="Samples.")


class FrequencyBandEntry(Keys):
    """The residual in one frequency band."""

    low: float = Field(description="Lower edge [Hz].")
    high: float = Field(description="Upper edge [Hz].")
    excess: FiniteOrNull = Field(description="Whitened power spectral density, less 1.")
    ci95: Interval = Field(description="95 % interval of excess.")
    coherence: Number = Field(description="Largest coherence of any reading's residual with any drive.")
    coherence_floor: Number = Field(description="Coherence that noise alone exceeds with 5 %.")

    @property
    def label(self) -> str:
        """The band in words, such as '1 ... 5 Hz'."""
        return f"{number(self.low, 3)} ... {number(self.high, 3)} Hz"


class LocatedIn(StrEnum):
    """The kind of coordinate of which one alone explains more of the excess, or why neither can be named."""

    READING = "reading"
    ACTUATOR = "actuator"
    NEITHER = "neither readings nor actuators"
    ONE_READING = "cannot be told from one reading"
    NO_EXCESS = "there is no significant excess"
    UNKNOWN = "the motion could not be linearised"


class CoordinatesEntry(Keys):
    """Whether the excess is sparser in the readings or in the actuators."""

    participation_ratio: dict[str, FiniteOrNull] = Field(
        description="Effective number of coordinates with excess, by 'reading' and 'actuator'."
    )
    explained_by_one: dict[str, dict[str, FiniteOrNull]] = Field(
        description="Share of the excess that each coordinate alone could explain."
    )
    located_in: Annotated[LocatedIn, WithJsonSchema({"type": "string"})] = Field(
        title="Located In", description="'reading', 'actuator', or why neither can be told."
    )


class UnmodelledForceEntry(Keys):
    """The unknown input (force or displacement) that would explain the residual after the correction."""

    statements: list[str] = Field(description="What it depends on.")


class ResidualLocationEntry(Keys):
    """Where the residual of one model is large."""

    excess: FiniteOrNull = Field(description="Mean square of the whitened residual over all readings, less 1.")
    by_reading: list[ResidualPartEntry] = Field(description="The residual of each reading.")
    by_actuator: list[ResidualPartEntry] = Field(description="The residual as an equivalent input at each axis.")
    coordinates: CoordinatesEntry = Field(description="Whether it is sparser in the readings or in the actuators.")
    by_frequency: list[FrequencyBandEntry] = Field(description="The residual by frequency band.")
    by_travel: dict[str, list[ResidualPartEntry]] = Field(description="Fifths of the travel, by axis.")
    by_direction: dict[str, list[ResidualPartEntry]] = Field(description="Forward and backward motion, by axis.")
    by_time: list[ResidualPartEntry] = Field(description="The residual by stretch of time.")
    by_temperature: list[ResidualPartEntry] = Field(
        description="The residual by temperature; empty where none is known."
    )
    spectral_lines: list[SpectralLinesEntry] = Field(description="Responses to periodic drives; empty without any.")
    gathered: GatheredEntry | None = Field(
        default=None, description="The stretch of one record that holds nearly all of it; null where none does."
    )
    statements: list[str] = Field(description="What follows, in sentences.")
    unmodelled_force: UnmodelledForceEntry | None = Field(
        default=None, description="In `after`, where the findings do not explain all."
    )

    @classmethod
    def unknown(cls) -> ResidualLocationEntry:
        """Of a model whose motion could not be linearised: no part of the residual is located."""
        coordinates = CoordinatesEntry(participation_ratio={}, explained_by_one={}, located_in=LocatedIn.UNKNOWN)
        parts: dict[str, Any] = {
            f"by_{name}": [] for name in ("reading", "actuator", "frequency", "time", "temperature")
        }
        parts |= {"by_travel": {}, "by_direction": {}, "spectral_lines": [], "statements": []}
        return cls(excess=float("nan"), coordinates=coordinates, **parts)

    def groups(self) -> Iterator[tuple[str, list[tuple[str, ResidualPartEntry | FrequencyBandEntry]]]]:
        """The groups of parts by their name in a figure, each part with its label."""
        lists: dict[str, Sequence[ResidualPartEntry | FrequencyBandEntry] | dict[str, list[ResidualPartEntry]]] = {
            "by reading": self.by_reading,
            "by actuator": self.by_actuator,
            "by frequency": self.by_frequency,
            "by travel": self.by_travel,
            "by direction": self.by_direction,
            "by time": self.by_time,
            "by temperature": self.by_temperature,
        }
        for name, parts in lists.items():
            if isinstance(parts, dict):
                yield name, [(f"{axis} {part.label}", part) for axis, several in parts.items() for part in several]
            else:
                yield name, [(part.label, part) for part in parts]


class ResidualLocations(Keys):
    """The residual on all records."""

    before: ResidualLocationEntry = Field(
        description="Of the device as described, refitted within its stated uncertainty."
    )
    after: ResidualLocationEntry = Field(description="With the findings.")

    def figures(self) -> dict[str, Figure]:
        """'where': the excess of the residual of the device as described over the noise, by part of the recording."""
        groups = {name: rows for name, parts in self.before.groups() if (rows := _finite(parts))}
        if not groups:
            return {}
        heights = [0.35 + 0.2 * min(len(rows), PARTS) for rows in groups.values()]
        figure, axes = plt.subplots(
            len(groups),
            1,
            figsize=(FIGURE_WIDTH, 0.6 + sum(heights)),
            height_ratios=heights,
            sharex=True,
            squeeze=False,
        )
        for panel, (name, parts) in zip(axes[:, 0], groups.items(), strict=True):
            rows = _largest(parts)
            y = np.arange(len(rows))
            values = np.array([part.excess for _, part in rows])
            panel.barh(y, values, color=[COLOURS[2] if v > 0 else "#d9d9d9" for v in values], height=0.65)
            for k, (_, part) in enumerate(rows):
                if np.all(np.isfinite(part.ci95)):
                    panel.plot(part.ci95, [k, k], color="#333333", lw=1)
            panel.set_yticks(y, [label for label, _ in rows], fontsize=7.5)
            panel.set_ylim(len(rows) - 0.4, -0.6)
            panel.set_xscale("symlog", linthresh=1.0)
            panel.axvline(0.0, color="#666666", lw=0.8)
            more = f", the {len(rows)} largest of {len(parts)}" if len(rows) < len(parts) else ""
            panel.set_title(name + more, fontsize=9, loc="left")
        axes[-1, 0].set_xlabel("excess over the noise: 0 is noise alone, 1 as much power again as the noise")
        return {"where": figure}


Row = tuple[str, ResidualPartEntry | FrequencyBandEntry]


def _finite(rows: list[Row]) -> list[Row]:
    return [row for row in rows if np.isfinite(row[1].excess)]


def _largest(rows: list[Row]) -> list[Row]:
    """The `PARTS` largest, in their order."""
    least = sorted((part.excess for _, part in rows), reverse=True)[:PARTS][-1]
    return [row for row in rows if row[1].excess >= least]
