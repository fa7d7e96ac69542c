"""Words of columns' names that say what a column is, in the languages of loggers; letters are whole words."""

from __future__ import annotations

COMMAND_WORDS = frozenset((
    "command", "commanded", "cmd", "ref", "reference", "set", "setpoint", "sp", "target", "demand", "desired", "soll",
))  # fmt: skip
"""Of columns that nobody measured: they stand at their limits because they are told to."""
DRIVE_WORDS = COMMAND_WORDS | frozenset((
    "drive", "com", "stell", "input", "in", "u", "v", "volt", "voltage", "voltages", "current", "i", "ampere", "power", "out", "output",
    "dac", "ao", "da", "ctrl", "control", "heater", "coil", "spannung", "strom", "force", "torque",
))  # fmt: skip
READING_WORDS = frozenset((
    "reading", "read", "position", "pos", "actual", "act", "ist", "fb", "feedback", "sensor", "measured", "meas", "mess",
    "measurement", "enc", "encoder", "cap", "capacitive", "adc", "ai", "ad", "displacement", "disp", "distance", "dist", "weg",
    "y", "response", "interferometer", "lvdt", "laser", "probe", "gauge",
))  # fmt: skip
