"""Text that holds no table of readings: traces of a bus, prints of data, pages. Refused with the reason and what to export instead."""

from __future__ import annotations

import re
from collections.abc import Sequence

LOOKED_AT = 400
"""Filled lines by which such a text is known."""
CAN = (
    "is a trace of a CAN bus: its bytes are signals only by the data base of the bus (DBC), which is not read here; "
    "decode it with that, to CSV or MDF: asammdf, python-can with cantools, or the program that recorded it"
)
ROS = "is what ROS prints of each message; print a table instead: rostopic echo -p /topic > log.csv, or ros2 topic echo --csv /topic"
SHORTENED = "is a print with rows left out (...); save the whole table, as to_csv does"
WRAPPED = "is a print of a matrix whose columns are broken into blocks; save it with writematrix, or as CSV"
BYTE = r"[0-9A-Fa-f]{2}"
CELL = r"(?:^|[,;\t|])\s*\"?(?:{})\"?\s*(?:[,;\t|]|$)".format
"""A whole cell: such words occur in comments and in names of readings too."""
LINES = (
    (re.compile(r"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}##?[0-9A-FR]*"), CAN),  # candump -l
    (re.compile(rf"\s*(?:\([^)]*\)\s+)?\S+\s+[0-9A-Fa-f]{{3,8}}\s+\[\d+\](\s+{BYTE})*\s*"), CAN),  # candump
    (
        re.compile(r"\s*\d+\.\d+\s+(?:CANFD\s+)?\d+\s+(?:[RT]x\s+)?[0-9A-Fa-f]+x?\s+(?:[RT]x\s+)?[dr01].*"),
        CAN,
    ),  # of Vector
    (re.compile(rf"\s*\d+\)\s+\d+\.\d+\s+.*(\s{BYTE})+\s*"), CAN),  # of PEAK
    (
        re.compile(rf"\s*\d+\s+\d+\.\d+\s+(DT|FD|FB)\s+[0-9A-Fa-f]{{4,8}}\s+[RT]x.*(\s{BYTE})+\s*"),
        CAN,
    ),  # of PEAK, version 2
)
"""What most lines of a text are."""
HEADS = (
    (re.compile(r"(?=.*\b(arbitration_?id|can.?id)\b)(?=.*\b(dlc|len|length|data(bytes)?)\b).*", re.I), CAN),
    (re.compile(r"(?=.*\bid\b)(?=.*\b(dlc|len)\b).*", re.I), CAN),
    (re.compile(rf"(?=.*{CELL('identifier')})(?=.*{CELL('dlc|len|length|data ?(bytes)?')}).*", re.I), CAN),
    (
        re.compile(r"\s*\$(timescale|enddefinitions|var)\b.*"),
        "is VCD, changes of digital signals; export its signals as CSV",
    ),
    (re.compile(r"\s*<(!doctype html|html|table)\b.*", re.I), "is a page of HTML; save its table as CSV"),
    (re.compile(r"\s*columns? \d+ (through|thru|and|to) \d+:?\s*", re.I), WRAPPED),
    (re.compile(r"\s*(\d*\s+)?(\.\.\.?\s+){2,}\.\.\.?\s*"), SHORTENED),
    (re.compile(r"[\s|\u2502]*(\u2026[\s|\u2502\u2506]*){2,}"), SHORTENED),
)
"""What one line of a text is."""
KEY = re.compile(r"\s*(- )?[A-Za-z_]\w*:(\s.*)?")
MOST_KEYS = 0.9  # of the lines between the rules of messages


def foreign(lines: Sequence[str]) -> str:
    """What a text is that holds no table, and what to do; empty for every other."""
    filled = [line for line in lines if line.strip()][:LOOKED_AT]
    for pattern, told in LINES:
        if sum(bool(pattern.fullmatch(line)) for line in filled) > len(filled) / 2:
            return told
    for pattern, told in HEADS:
        if any(pattern.fullmatch(line) for line in filled):
            return told
    rules = sum(line.strip() == "---" for line in filled)
    keys = sum(bool(KEY.fullmatch(line)) for line in filled)
    return ROS if rules > 1 and keys > MOST_KEYS * (len(filled) - rules) else ""
