"""Spellings of units that mean several things are asked in device files, and read right or left open in logs."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.core.units import base_unit, parse
from ctrlgen.recordings.formats.unit_texts import unit_of
from ctrlgen.recordings.look.column_facts import ColumnFacts


def test_an_unclear_spelling_is_asked_in_a_device_file():
    for text, unit, said in (
        ("3 Nm", "N*m", "write N\\*m, newton metres"),
        ("3 mNm/A", "N*m/A", "write mN\\*m"),
        ("3 mil", "um", "thou for a thousandth"),
        ("3 cts", "1", "write count"),
        ("3 pct", "1", "write %"),
        ("3 px", "um", "size of a pixel"),
        ("3 kn", "N", "kN, or knot"),
        ("3 rev", "rad", "write turn"),
        ("3 RPM", "rad/s", "write rpm"),
        ("3 dB", "1", "is a logarithm"),
    ):
        with pytest.raises(ValueError, match=said):
            parse(text, unit)


def test_units_of_logs_are_read_as_logs_mean_them():
    for text, unit in {
        "deg/s": "deg/s", "rpm": "rpm", "RPM": "rpm", "rev/s": "turn/s", "mN": "mN", "MN": "MN", "gon": "gon", "\u00b5in": "uin",
        "kgf": "kgf", "ppm": "ppm", "%FS": "percent", "counts": "1", "inc": "1", "cts": "1", "LSB": "1", "ticks": "1", "Gs": "gauss",
        "px": "pixel", "\u00b5": "um", "\u00c5": "angstrom", "as": "arcsecond", "Nm": "N*m", "mil": "thou", "pct": "percent",
        "''": None, "dB": None, "kn": None, "mu": None, "NM": None,
    }.items():  # fmt: skip
        assert unit_of(text) == unit, text
    assert base_unit(unit_of("rev/s")) == base_unit("rad/s")


def test_a_square_wave_is_not_called_clipped_and_a_cut_sine_is():
    t = np.arange(4000)
    noise = 1e-4 * np.sin(t**2)
    square = np.sign(np.sin(0.05 * t))
    square = np.where(np.abs(np.sin(0.05 * t)) < 0.2, noise, square)
    assert ColumnFacts("x", None, square).clipped() == []
    assert ColumnFacts("x", None, np.clip(np.sin(0.05 * t) + noise, -0.8, 0.8)).clipped() == [-0.8, 0.8]
