"""The page of a batch: what stands out, what drifts, which machines deviate; and the control charts that say so."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from ctrlgen.app.batch_page import batch_page, machines_of
from ctrlgen.app.batch_row import BatchRow
from ctrlgen.app.control_chart import LEAST, control_chart

ROW = BatchRow("a--0", "done", "explained", "creep at stage:axis", "reading.axis", 12.0, 5.0, 5.0, "nm")


def steady(n: int) -> np.ndarray:
    return 10 + np.random.default_rng(3).standard_normal(n)


def test_limits_are_three_standard_deviations_whatever_one_outlier_does():
    """The median moving range of 2000 normal numbers tells the deviation to 4 %, an outlier of a million deviations included."""
    values = steady(2000)
    values[77] = 1e6
    chart = control_chart(values)
    assert chart.high - chart.centre == pytest.approx(3, rel=0.1) and chart.centre - chart.low == pytest.approx(
        3, rel=0.1
    )
    assert 77 in chart.outside and len(chart.outside) < 20 and chart.drift is None


def test_a_drift_is_told_with_its_size_and_what_leaves_its_trend():
    values = steady(30) + 0.5 * np.arange(30)
    values[12] -= 30
    chart = control_chart(values)
    assert chart.drift == pytest.approx(0.5 * 29, rel=0.1) and chart.outside == (12,) and chart.low is None


def test_few_numbers_have_no_limits_and_gaps_are_none():
    assert control_chart(steady(LEAST - 1)).high is None and control_chart(steady(LEAST)).high is not None
    gaps = np.append(steady(20), [np.nan, 100.0])
    assert (
        21 in control_chart(gaps).outside
        and 20 not in control_chart(gaps).outside
        and control_chart(np.full(9, np.nan)).outside == ()
    )
    assert control_chart(np.append(np.exp(steady(20) / 10), -1.0), positive=True).high < 5


def test_a_machine_far_from_the_others_deviates_where_there_are_enough():
    rows = [replace(ROW, name=f"{m}--{k}", before=(60.0 if m == "d" else 12.0) + k) for m in "abcde" for k in range(3)]
    assert [m.name for m in machines_of(rows) if m.deviates] == ["d"]
    assert {m.deviates for m in machines_of(rows[:9])} == {None}


def test_the_page_says_what_stands_out_and_what_failed(tmp_path):
    rows = [replace(ROW, name=f"a--{k}", before=12.0 + 0.1 * (k % 3) + 90 * (k == 5)) for k in range(12)]
    for row in rows:
        error = {"reading.axis": {"rms_before": row.before, "rms_after": 5.0, "noise_floor": 5.0, "unit": "nm"}}
        finding = {"effect": "creep", "location": "stage:axis", "parameters": {"gain": {"value": 0.03, "unit": "1"}}}
        (tmp_path / row.name).mkdir()
        (tmp_path / row.name / "diagnosis.json").write_text(json.dumps({"held_out": error, "findings": [finding]}))
    rows.append(BatchRow("a--bad", "failed", error="row 3 <b>"))
    rows[3] = replace(rows[3], warning="write unit = um")
    text = batch_page(rows, tmp_path, "jobs")
    assert (
        "Of 13 recordings 1 stands out" in text
        and "(a--5)" in text
        and "1 failed" in text
        and "row 3 &lt;b&gt;" in text
    )
    assert "Correct the recording of a--3: write unit = um." in text
    assert 'href="a--5/report.html"' in text and "error of axis 102.2 nm" in text
    (tmp_path / "a--1" / "diagnosis.json").write_text("[" * 99_999)
    assert "Of 13 recordings" in batch_page(rows, tmp_path, "jobs")
