"""Signals along a solved path as a table of comma-separated values, each column with its unit."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.trajectory.inverse.clock import Settled
from ctrlgen.trajectory.solution import Solution


def table_of_signals(solution: Solution, roles: Sequence[str]) -> str:
    """A row a sample: its time, or its number where it is an equilibrium, then the channels of each signal."""
    static = isinstance(solution.scenario.clock, Settled)
    header = ["sample" if static else "time [s]"]
    columns = [np.arange(len(solution.command)) if static else solution.trace.time]
    for role in roles:
        signal, values = solution.model.signals[role], solution.trace.signals[role]
        header += signal.columns
        columns += [from_si(values[:, i], unit) for i, unit in enumerate(signal.units)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in np.column_stack(columns):
        writer.writerow([f"{value:.12g}" for value in row])
    return text.getvalue()
