"""A picture of measurement files: every column of numbers over time, or over rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ctrlgen.core.files import write_bytes
from ctrlgen.recordings.look.column_facts import TableFacts
from ctrlgen.reporting.plots import COLOURS, STYLE, image

MOST = 12  # columns drawn
POINTS = 4000  # of a curve: of more rows every so-manieth is drawn


def draw_columns(tables: Sequence[TableFacts], file: Path) -> None:
    """Writes the picture, .svg or .png: a panel a column, the files beside each other."""
    moving = [
        [c for c in facts.columns if c.moves and (facts.time is None or c.name != facts.time.column)][:MOST]
        for facts in tables
    ]
    rows = max(map(len, moving), default=1) or 1
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            rows, len(tables), figsize=(2.5 + 5.5 * len(tables), 0.8 + 1.4 * rows), squeeze=False, sharex="col"
        )
        for k, (facts, columns) in enumerate(zip(tables, moving, strict=True)):
            step = 1.0 if facts.time is None else facts.time.step
            axes[0, k].set_title(facts.table.path.name, fontsize=9)
            for i, column in enumerate(columns):
                assert column.values is not None  # it moves
                every = max(1, len(column.values) // POINTS)
                axes[i, k].plot(
                    step * np.arange(len(column.values))[::every], column.values[::every], color=COLOURS[0], lw=0.8
                )
                axes[i, k].set_ylabel(f"{column.bare}\n[{column.unit or '?'}]", fontsize=8)
            for i in range(len(columns), rows):
                axes[i, k].set_visible(False)
            axes[max(len(columns), 1) - 1, k].set_xlabel(
                "row" if facts.time is None else "time [s], rows at their mean rate"
            )
        write_bytes(file, image(figure, file.suffix))
