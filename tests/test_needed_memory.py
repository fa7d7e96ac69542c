"""A recording that memory cannot hold is refused before any work, with the rows that can be held."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, record

from ctrlgen.core.errors import InputError
from ctrlgen.diagnosis import needed_memory
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.recordings.recording import Recording


def test_rows_that_memory_cannot_hold_are_refused_with_the_number_that_it_can(monkeypatch):
    parts = [record(np.zeros((n, 1)), np.zeros(n), role) for n, role in ((700, "fit"), (301, "hold_out"))]
    recording = Recording("long", AXIS.name, "series", ("reading.axis",), ("um",), (1e-8,), tuple(parts), ())
    monkeypatch.setattr(needed_memory, "physical_memory", lambda: 1001 * needed_memory.OF_A_READING)
    needed_memory.refuse_what_memory_cannot_hold(recording)
    monkeypatch.setattr(needed_memory, "physical_memory", lambda: 1000 * needed_memory.OF_A_READING)
    with pytest.raises(
        InputError, match=r"1001 rows of 1 reading .*: at most 1000 rows\. `low_pass`, `keep_every` or `rows`"
    ):
        diagnose_recording(AXIS, recording, jobs=0)


def test_where_the_system_does_not_tell_its_memory_nothing_is_refused(monkeypatch):
    assert needed_memory.physical_memory() > 1e8
    monkeypatch.delattr(needed_memory.os, "sysconf")
    assert needed_memory.physical_memory() == float("inf")
