"""The drives that one file holds, for a simulation of a device that was never measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import to_si
from ctrlgen.model.model import Model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import TableFacts, table_facts
from ctrlgen.recordings.look.proposal import Match, propose


@dataclass(frozen=True)
class DriveFile:
    """`u` (n, n_u) [SI] every `sample_time` [s]; `measured` (n,) [SI] by the name of a reading, such as "reading.axis"."""

    u: np.ndarray
    sample_time: float
    measured: dict[str, np.ndarray]


def read_drives(file: Path, model: Model) -> DriveFile:
    """The drives of a model in a measurement file, and the readings where it holds some.

    Raises InputError for a drive that no column is or of which the file states no unit, for missing numbers, and without an even time.
    """
    facts = table_facts(read_table(file))
    matches = {m.signal: m for m in propose([facts], model).matches}
    units = dict(
        zip((f"drive.{c}" for c in model.signals["drive"].channels), model.signals["drive"].units, strict=True)
    )
    faults = [
        Fault(name, f'no column is it; name one "{name} [{unit}]"')
        for name, unit in units.items()
        if name not in matches
    ]
    faults += [
        Fault(m.column, f"states no unit; write it behind the name, such as {m.column} [{m.unit}]")
        for m in matches.values()
        if m.signal in units and not m.stated
    ]
    if facts.time is None or facts.time.gaps or facts.time.backward:
        faults.append(Fault("time", "needs a column, such as time [s], that rises by even steps"))
    if faults or facts.time is None:
        raise InputError(file, faults)
    u = np.column_stack([_si(facts, matches[name]) for name in units])
    if missing := int(np.sum(~np.isfinite(u))):
        raise InputError(
            file, [Fault("drives", f"{number_of(missing, 'number is', 'numbers are')} missing; write every one")]
        )
    readings = {m.signal: _si(facts, m) for m in matches.values() if m.signal not in units and m.stated}
    return DriveFile(u, facts.time.step, readings)


def _si(facts: TableFacts, match: Match) -> np.ndarray:
    values = facts.column(match.column).values
    assert values is not None  # only columns of numbers are matched
    return values * (to_si(1.0, match.unit) - to_si(0.0, match.unit)) + to_si(0.0, match.unit)
