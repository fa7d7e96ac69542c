"""The numbers of a device file, in um, N, rad, s, W, degC. Reads TOML with its own small table of units."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

MEMS_HEXAPOD = Path(__file__).resolve().parent.parent / "scenarios" / "devices" / "mems_hexapod.toml"

UNITS = {
    "1": 1.0,
    "um": 1.0,
    "mm": 1e3,
    "GPa": 1e-3,  # N/um^2
    "MPa": 1e-6,  # N/um^2
    "N/um": 1.0,
    "rad": 1.0,
    "deg": math.pi / 180,
    "degC": 1.0,
    "1/K": 1.0,
    "1/K^2": 1.0,
    "K/W": 1.0,
    "ms": 1e-3,  # s
    "N": 1.0,
    "W": 1.0,
    "ohm": 1.0,
    "rad/(N*um)": 1.0,
    "rad/N": 1.0,
    "um/N": 1.0,
    "um/(N*um)": 1.0,
}


def number(text: str) -> float:
    """'22.3 um' -> 22.3; a number without a unit is itself."""
    value, _, unit = text.strip().partition(" ")
    if (unit or "1") not in UNITS:
        raise ValueError(f"{text!r}: unit {unit!r} is not in plants.numbers.UNITS; add it there")
    return float(value) * UNITS[unit or "1"]


def _read(entry: Any) -> Any:
    if isinstance(entry, dict) and "value" in entry:
        return number(entry["value"])
    if isinstance(entry, dict):
        return SimpleNamespace(**{key: _read(value) for key, value in entry.items()})
    if isinstance(entry, list):
        return [_read(item) for item in entry]
    if isinstance(entry, str) and entry[:1] in set("+-0123456789") and " " in entry:
        return number(entry)
    return entry


def read(path: str | Path = MEMS_HEXAPOD) -> SimpleNamespace:
    """Sections `actuator`, `stage`, `hexapod` of the device file at `path`, as attributes."""
    return _read(tomllib.loads(Path(path).read_text()))
