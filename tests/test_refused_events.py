"""An event that the held-out records of another file do not confirm is told with its moment, and with the rows that would."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, record

from ctrlgen.diagnosis.report.refused_events import ITS_OWN_FILE, how_confirmed, moment_of
from ctrlgen.diagnosis.selection.candidate_model import Refusal
from ctrlgen.diagnosis.selection.model_selection import Shortfall
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.recordings.recording import Recording

EVENTS = (
    Hypothesis("sensor_step", "disturbance:axis", "axis"),
    Hypothesis("force_step", "disturbance:axis", "axis"),
    Hypothesis("lost_beams", "stage:axis", "axis"),
)
OTHERS = (Hypothesis("cyclic", "sensor:axis", "axis"), Hypothesis("parameter", "stage:mass", "", path="mechanics.mass"))


def refusal(*causes: Hypothesis, reason: str = Shortfall.UNCONFIRMED) -> Refusal:
    fit = SimpleNamespace(structure=SimpleNamespace(causes=causes), values=lambda k: {"moment": 31.39 + k})
    return Refusal(SimpleNamespace(fit=fit), causes, (reason,) * len(causes))


def recorded(**files: str) -> Recording:
    """Records by the letter of their role: f(it), h(old out), and what stands behind it; each of a file."""
    roles = {"f": "fit", "h": "hold_out"}
    still = np.zeros(20)
    parts = tuple(replace(record(still, still, roles[name[0]]), file=file) for name, file in files.items())
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), parts, ())


@pytest.mark.parametrize("event", EVENTS)
def test_an_event_is_told_with_its_moment_and_with_what_confirms_it(event):
    given = refusal(*OTHERS, event)
    assert moment_of(given, event) == ", at 33.39 s" and [moment_of(given, c) for c in OTHERS] == ["", ""]
    assert how_confirmed(recorded(f="a", h="b"), given) == [ITS_OWN_FILE]


@pytest.mark.parametrize("files", [{"f": "a", "h": "a"}, {"f": "a", "f2": "b", "h": "b"}])
def test_rows_of_its_own_file_that_are_held_out_need_no_advice(files):
    assert how_confirmed(recorded(**files), refusal(EVENTS[0])) == []


def test_what_acts_always_and_what_is_refused_for_another_reason_need_none():
    apart = recorded(f="a", h="b")
    assert (
        how_confirmed(apart, refusal(*OTHERS))
        == how_confirmed(apart, refusal(EVENTS[0], reason="its rise is slow"))
        == []
    )
