"""A recording of an axis that creeps, and the laws that are tried on it."""

from __future__ import annotations

from pathlib import Path

from conftest import AXIS_FILE
from recording_folders import axis_recording

CREEP = '[[effect]]\nkind = "creep"\nat = "axis"\ngain = "0.03"\ntau = "0.2 s"\nslow = "0.1"\n'
# Four effects instead of all: the report is the same, and quick
LAWS = ("creep", "drive_gain", "home_offset", "stiffening")


def creeping_recording(folder: Path) -> Path:
    return axis_recording(folder, AXIS_FILE.read_text() + CREEP)
