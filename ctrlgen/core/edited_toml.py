"""TOML files with other quantities in them, everything else as their author wrote it."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import Item, Table

from ctrlgen.core.escaping import toml
from ctrlgen.core.units import difference_unit, from_si

DIGITS = 12  # nine would round by 5e-9, more than predictions may differ by
SD_DIGITS = 3


def replace_quantity(document: Any, path: str, fields: dict[str, str]) -> None:
    """Gives the quantity at a dotted path such as `hexapod.platform_angles[3]` of a tomlkit document other fields (value, sd, source)."""
    parts = [int(p) if p.isdigit() else p for p in re.findall(r"[^.\[\]]+", path)]
    node = document
    for part in parts[:-1]:
        node = node[part]
    if isinstance(node[parts[-1]], Table):
        node[parts[-1]].update(fields)
    else:
        node[parts[-1]] = inline_table(fields)


def with_moved_files(text: str, keys: Sequence[tuple[str, str]], origin: Path, target: Path) -> str:
    """The text of the file `origin` as it is written to `target`: files that entries of its lists name relative to it, by (list, key),
    are found from there."""
    document, moved = tomlkit.parse(text), False
    for table, key in keys:
        for entry in document.get(table, ()):
            if isinstance(entry.get(key), str):
                entry[key] = os.path.relpath(origin.parent / entry[key], target.parent)
                moved = True
    return document.as_string() if moved else text


def inline_table(fields: dict[str, Any]) -> Item:
    """{ key = "value", ... } as an item of a document."""
    return tomlkit.parse(f"q = {toml_text(fields)}")["q"]


def toml_text(value: str | dict[str, Any]) -> str:
    """A text in quotes, or an inline table with the spaces that device files have."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {toml_text(member)}' for key, member in value.items())} }}"
    return toml(value)


def value_text(si: float, unit: str, digits: int = DIGITS) -> str:
    """An SI number as a device file states it in `unit`."""
    return f"{from_si(si, unit):.{digits}g} {'' if unit == '1' else unit}".strip()


def sd_text(sd: float, unit: str) -> str:
    """A standard deviation [SI] as text in `unit`; empty where it is zero or infinite."""
    if not np.isfinite(sd) or sd == 0:
        return ""
    scale = from_si(sd, unit) - from_si(0.0, unit)
    return f"{scale:.{SD_DIGITS}g} {'' if unit == '1' else difference_unit(unit)}".strip()
