"""What `ctrlgen reproduce` says of the papers' numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from papers import all as everything
from papers.row import PrintedNumber, ReproductionStatus, beside_literal, half_unit


@pytest.fixture(scope="module", params=list(everything.SOURCES))
def rows(request):
    return everything.reproduce([request.param])


@pytest.mark.long
def test_every_row_that_is_not_reproduced_says_why(rows):
    assert rows
    assert not [row.where for row in rows if row.status is not ReproductionStatus.REPRODUCED and not row.reason]


@pytest.mark.long
def test_every_row_belongs_to_the_source_that_was_asked_for(rows, request):
    assert {row.source for row in rows} == {request.node.callspec.params["rows"]}


@pytest.mark.long
def test_no_number_is_left_out_by_being_no_number(rows):
    assert not [row.where for row in rows if row.ours is not None and not math.isfinite(row.ours)]


@pytest.mark.long
def test_places_are_named_once(rows):
    places = [row.where for row in rows]
    assert len(set(places)) == len(places)


@pytest.mark.parametrize(("printed", "half"), [("9.12e-2", 5e-5), ("301.0", 0.05), ("12", 0.5), ("-0.22", 0.005)])
def test_half_a_unit_of_the_last_printed_digit(printed, half):
    assert half_unit(printed) == pytest.approx(half)


def test_a_row_that_is_off_differs_and_one_that_is_no_number_never_agrees():
    assert PrintedNumber("S", "w", "1.00", "1", 1.0049).status is ReproductionStatus.REPRODUCED
    assert PrintedNumber("S", "w", "1.00", "1", 1.0051).status is ReproductionStatus.DIFFERS
    assert PrintedNumber("S", "w", "1.00", "1", float("nan")).status is ReproductionStatus.DIFFERS
    assert PrintedNumber("S", "w", "1.00", "1", None, "lost").status is ReproductionStatus.NOT_COMPUTABLE


def test_a_number_that_follows_only_from_corrected_ones_says_so_and_can_fail():
    def number(ours, literal):
        return PrintedNumber("S", "w", "1.00", "1", ours, "r", taken_literally=literal)

    assert number(1.001, 1.002).status is ReproductionStatus.REPRODUCED
    assert number(1.001, 1.2).status is ReproductionStatus.CORRECTED
    assert number(1.2, 1.001).status is ReproductionStatus.DIFFERS
    lost = PrintedNumber("S", "w", "lost", "1", 2.01, "r", 0.02, implied=2.0)
    assert lost.status is ReproductionStatus.REPRODUCED and lost.difference == pytest.approx(0.01)
    rows = beside_literal([number(1.001, None)], [number(1.2, None)], "corrected so")
    assert rows[0].status is ReproductionStatus.CORRECTED and rows[0].reason == "corrected so"
    with pytest.raises(ValueError, match="stands beside"):
        beside_literal([number(1.0, None)], [replace(number(1.0, None), where="elsewhere")], "r")
