"""Units that are read without pint are what pint says of them."""

from __future__ import annotations

import importlib.util
import subprocess
import sys

import pytest

from ctrlgen.core import units
from ctrlgen.core.known_units import KNOWN


def test_known_units_are_what_pint_says_bit_by_bit(monkeypatch):
    spec = importlib.util.spec_from_file_location("units_by_pint", units.__file__)
    by_pint = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "units_by_pint", by_pint)
    spec.loader.exec_module(by_pint)
    by_pint.KNOWN = {}
    for unit, (scale, offset, base) in KNOWN.items():
        assert by_pint.to_si(0.0, unit) == offset and by_pint.difference(1.0, unit) == 1.0 / scale, unit
        assert by_pint.to_si(1.0, unit) == units.to_si(1.0, unit) and by_pint.base_unit(unit) == base, unit
        for other in KNOWN:
            assert by_pint.same_dimension(unit, other) == units.same_dimension(unit, other), (unit, other)


def test_an_unknown_unit_is_still_read_by_pint():
    assert units.to_si(1.0, "furlong") == pytest.approx(201.168, rel=1e-5)
    assert units.same_dimension("furlong", "um") and not units.same_dimension("furlong", "s")


def test_a_common_device_is_read_without_pint():
    read = "from ctrlgen.trajectory.scenario import load_scenario; load_scenario('scenarios/circle20')"
    subprocess.run([sys.executable, "-c", f"import sys; {read}; assert 'pint' not in sys.modules"], check=True)
