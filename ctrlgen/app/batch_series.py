"""What a batch's results say one after another: held-out errors and the numbers of causes, a series each, with their control charts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.app.control_chart import ControlChart, control_chart

MOST = 6  # series of errors and of numbers of causes that are drawn: those that most recordings have


@dataclass(frozen=True)
class Series:
    """One number over all recordings: `name`, its `unit`, whether it is a size, and its `chart`."""

    name: str
    unit: str
    size: bool
    chart: ControlChart

    @property
    def label(self) -> str:
        """'error of axis [nm]'."""
        return f"{self.name} [{self.unit}]" if self.unit != "1" else self.name


@dataclass
class _Collected:
    unit: str
    values: list[float] = field(default_factory=list)


def batch_series(names: Sequence[str], out: Path) -> tuple[list[Series], list[Series]]:
    """Of the results in `out`, by name: the series of held-out errors of the device as described, and of the numbers of causes.

    Each diagnosis.json is read by itself; what is kept of it are these numbers.
    """
    errors: dict[str, _Collected] = {}
    numbers: dict[str, _Collected] = {}
    for k, name in enumerate(names):
        for channel, e in _read(out / name).get("held_out", {}).items():
            _put(errors, f"error of {channel.removeprefix('reading.')}", e.get("unit", "1"), k, e.get("rms_before"))
        for finding in _read(out / name).get("findings", []):
            for parameter, e in finding.get("parameters", {}).items():
                key = f"{finding['effect']} at {finding['location']}: {parameter}"
                _put(numbers, key, e.get("unit", "1"), k, e.get("value"))
    return _chosen(errors, len(names), True), _chosen(numbers, len(names), False)


def _read(folder: Path) -> dict[str, Any]:
    """diagnosis.json of a result; nothing where there is none."""
    try:
        found = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _put(into: dict[str, _Collected], name: str, unit: str, k: int, value: Any) -> None:
    """Only numbers of the unit that came first: devices of one batch may differ."""
    row = into.setdefault(name, _Collected(unit))
    if unit == row.unit and isinstance(value, int | float):
        row.values += [np.nan] * (k - len(row.values)) + [float(value)] * (k >= len(row.values))


def _chosen(collected: dict[str, _Collected], n: int, size: bool) -> list[Series]:
    rows = {
        name: np.array(row.values + [np.nan] * (n - len(row.values)))
        for name, row in collected.items()
        if np.isfinite(row.values).sum() > 1
    }
    most = sorted(rows, key=lambda name: -np.isfinite(rows[name]).sum())[:MOST]
    return [Series(name, collected[name].unit, size, control_chart(rows[name], size)) for name in rows if name in most]
