"""Headers that programs declare: GCS arrays of Physik Instrumente, TwinCAT Scope, the TOA5 and TOACI1 files of Campbell Scientific."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ctrlgen.recordings.formats.header_rows import Header, units_behind
from ctrlgen.recordings.formats.text_blocks import Block
from ctrlgen.recordings.formats.text_cells import cells_of, without_mark
from ctrlgen.recordings.formats.unit_texts import unit_of

DECLARED_NAME = re.compile(r"^\s*#\s*NAME(\d+)\s*=\s*(.+?)\s*$")
LISTED = re.compile(
    r"^\W*(?:column|col|channel|field|spalte|kanal)?[\s.]*(?P<k>\d+)\s*[:=.)]\s*(?P<name>[^\W\d].*?)\s*$", re.IGNORECASE
)
"""A line for each column: `# 1: t [s]`, `Column 2: Drive (V)`."""
DECLARED_TIME = re.compile(r"^\s*#\s*SAMPLE_TIME\s*=\s*([\d.eE+-]+)\s*$")
PAIRED = 2  # header rows in which every second cell repeats a key, as TwinCAT Scope writes them
TOA = ("TOA5", "TOACI1")
"""First cells of Campbell Scientific's files: names stand in the second line; of the first kind units in the third, how each value was
formed (average, sample) in the fourth."""


def declared_time(lines: Sequence[str], block: Block) -> dict[int, float]:
    """The sample time [s] of each column that the header of a GCS array declares; empty where there is none."""
    step = next((float(m[1]) for k in block.above if (m := DECLARED_TIME.match(lines[k]))), None)
    return {} if step is None else dict.fromkeys(range(block.width), step)


def declared_names(lines: Sequence[str], block: Block, separator: str) -> Header | None:
    """The header of a GCS array or of a Campbell table; None for another."""
    declared = {int(m[1]): m[2] for k in block.above if (m := DECLARED_NAME.match(lines[k]))}
    if len(declared) == block.width:
        names = tuple(declared[k] for k in sorted(declared))
        notes = ("names are those that the header declares",)
        return Header(names, units_behind(names), notes=notes, sample_times=declared_time(lines, block))
    filled = [k for k in block.above if lines[k].strip()]
    listed = [LISTED.match(without_mark(lines[k])) for k in filled[-block.width :]]
    found = {int(m["k"]): m["name"] for m in listed if m}
    if len(found) == block.width > 1 and list(found) in ([*range(block.width)], [*range(1, block.width + 1)]):
        names = tuple(found.values())
        return Header(names, units_behind(names), notes=("names are those that the header lists, a line each",))
    kind = cells_of(lines[filled[0]], separator)[0] if filled else ""
    if kind not in TOA or len(filled) < 2 or len(names := tuple(cells_of(lines[filled[1]], separator))) != block.width:
        return None
    stated = cells_of(lines[filled[2]], separator) if kind == TOA[0] and len(filled) > 2 else []
    units = {k: text for k, text in enumerate(stated) if text and text not in ("TS", "RN") and unit_of(text)}
    told = [f"{kind}: names in line {filled[1] + 1}", *([f"line {filled[2] + 1} holds units"] if units else [])]
    return Header(names, units_behind(names) | units, notes=tuple(told))


def paired(candidates: Sequence[tuple[int, list[str]]]) -> Header | None:
    """The header of a file in which each channel has a time and a value, with a key before every entry, as TwinCAT Scope exports."""
    rows: dict[str, list[str]] = {}
    for _, cells in candidates:
        if len(cells) % 2 == 0 and cells[0] and len(set(cells[::2])) == 1:
            rows[cells[0]] = cells[1::2]
    if len(rows) < PAIRED or "Name" not in rows:
        return None
    names = tuple(text for name in rows["Name"] for text in (f"time of {name}", name))
    units = {2 * k + 1: unit for k, unit in enumerate(rows.get("Unit", ())) if unit_of(unit)}
    notes = ["each channel has its own time, named 'time of ...'"]
    scaled = [
        name for name, factor in zip(rows["Name"], rows.get("ScaleFactor", ()), strict=False) if factor not in ("", "1")
    ]
    if scaled:
        notes.append(f"the header states a scale for {', '.join(scaled)}; the numbers are taken as they stand")
    steps = rows.get("SampleTime[ms]", ())
    sample_times = {2 * k + 1: 1e-3 * float(step) for k, step in enumerate(steps) if re.fullmatch(r"\d+(\.\d+)?", step)}
    return Header(
        names,
        units,
        notes=tuple(notes),
        sample_times=sample_times,
        times={2 * k + 1: 2 * k for k in range(len(names) // 2)},
    )
