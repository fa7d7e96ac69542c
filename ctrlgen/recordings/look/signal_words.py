"""Words of columns' names that say what a column is, in the languages of loggers; letters are whole words."""

from __future__ import annotations

import re

COMMAND_WORDS = frozenset((
    "command", "commanded", "cmd", "ref", "reference", "set", "setpoint", "sp", "target", "demand", "desired", "soll",
    "sollwert", "rpos", "apos", "tpos", "pcmd", "des", "nominal", "consigne", "f\u00fchrungsgr\u00f6\u00dfe",
))  # fmt: skip
"""Of columns that nobody measured: they stand at their limits because they are told to."""
DRIVE_WORDS = COMMAND_WORDS | frozenset((
    "drive", "com", "stell", "input", "in", "u", "v", "volt", "voltage", "voltages", "current", "i", "ampere", "power", "out", "output",
    "dac", "ao", "da", "ctrl", "control", "heater", "coil", "spannung", "strom", "force", "torque", "stellgr\u00f6\u00dfe", "dcom", "dout",
))  # fmt: skip
READING_WORDS = frozenset((
    "reading", "read", "position", "pos", "actual", "act", "ist", "istwert", "fpos", "fb", "feedback", "sensor", "measured", "meas", "mess",
    "measurement", "enc", "encoder", "cap", "capacitive", "adc", "ai", "ad", "displacement", "disp", "distance", "dist", "weg",
    "y", "response", "interferometer", "lvdt", "laser", "probe", "gauge", "epos", "pfbk", "fbk", "mesure", "observed",
    "regelgr\u00f6\u00dfe",
))  # fmt: skip
ERROR_WORDS = frozenset(
    ("error", "err", "pe", "deviation", "residual", "abweichung", "regelabweichung", "regeldifferenz")
)
"""Of differences between a command and a reading, which are neither."""
PLACES = frozenset(("position", "pos", "displacement", "distance", "angle"))
"""Words beside which `current` is the present one: Current Position."""


def words_of(name: str) -> set[str]:
    """The words of a column's name in small letters, those of camelCase too."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = set(re.findall(r"[a-z\u00e4\u00f6\u00fc\u00df]+|\d+[a-z]*", apart.lower()))
    return words - {"current"} if words & PLACES else words
