"""S3's stage against its print: which entries are reproduced, and what explains those that are not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from matrices import array

from ctrlgen.devices import rrr_stage as device_module
from papers import s3, s3_lengths, s3_shear, s3_tables
from papers.row import PrintedNumber, ReproductionStatus, half_unit

AGREES = (ReproductionStatus.REPRODUCED, ReproductionStatus.CORRECTED)


def printed_rows(where: str) -> list[PrintedNumber]:
    return [row for row in s3.rows() if row.where.startswith(where)]


def test_table_4_case_1_is_reproduced_in_all_36_entries() -> None:
    rows = printed_rows("Table 4, case 1")
    assert len(rows) == 36 and all(row.status in AGREES for row in rows)


def test_table_4_case_2_is_reproduced_in_all_entries_but_the_one_that_lost_its_sign() -> None:
    rows = printed_rows("Table 4, case 2")
    differing = [row for row in rows if row.status not in AGREES]
    assert len(rows) == 36 and [row.where for row in differing] == ["Table 4, case 2, C_oFin (3,1)"]
    assert differing[0].ours is not None and abs(differing[0].ours + differing[0].value) <= differing[0].allowed


def test_with_the_frame_angle_at_two_decimals_one_more_entry_misses_by_a_hundredth_of_its_digit() -> None:
    device = s3_lengths.printed_device(2)
    p = s3_lengths.corrected(2)
    p.frame_angle = device.frame_angle.si
    k = device_module.stage(device, p)
    outside = {
        (symbol, i, j)
        for symbol, i, j, text in s3_tables.entries(s3_tables.TABLE_4[2])
        if text != "0" and abs(s3.computed(2, symbol, i, j, k) - float(text)) > half_unit(text)
    }
    assert outside == {("C_oFin", 3, 1), ("J", 2, 2)}


def test_the_matrix_of_equation_1_is_singular_because_a_held_platform_holds_the_inputs_in_b83() -> None:
    rows = printed_rows("eq. (1), case")
    assert [row.status for row in rows] == [ReproductionStatus.REPRODUCED] * 2
    assert "the smallest is 0.008, in the finite elements of Table 5 0.055" in rows[1].reason
    assert "The digits of Table 4 leave -0.0035" in rows[1].reason


@pytest.mark.parametrize("case", [1, 2])
def test_the_device_as_printed_does_not_reproduce_table_4(case: int) -> None:
    k = device_module.stage(s3_lengths.printed_device(case))
    entries = [e for e in s3_tables.entries(s3_tables.TABLE_4[case]) if e[3] != "0"]
    inside = [e for e in entries if abs(s3.computed(case, *e[:3], k) - float(e[3])) <= half_unit(e[3])]
    assert len(entries) == 30 and len(inside) <= 6  # C_inFin off the diagonal, printed to two digits
    assert all(symbol == "C_inFin" and i != j for symbol, i, j, _ in inside)
    assert abs(s3.computed(case, "J", 3, 1, k) / s3.computed(case, "J", 3, 1) - 0.388) < 0.001


def test_one_pair_of_lengths_and_no_other_explains_table_4() -> None:
    best, second, *_ = s3_lengths.diagnosis()
    assert best.freed == ("l1", "l2") and best.outside == 0
    assert second.outside > 10 and second.cost > 20 * best.cost
    assert abs(best.lengths["l1"] - 47.900e-3) < 1e-6 and abs(best.lengths["l2"] - 22.170e-3) < 1e-6
    assert abs(np.rad2deg(best.frame_angle) - 132.14) < 0.005  # half a unit of the last digit in PHYSICS.md


def test_no_single_length_explains_table_4() -> None:
    assert all(s3_lengths.fit(name).outside > 20 for name in s3_lengths.LENGTHS)


def test_a_planted_wrong_length_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagnosis names what was changed, not l1 and l2 whatever the table: l4 is planted 3 mm off as well as l2."""
    truth = s3_lengths.printed_lengths()
    truth[[1, 3]] += [-0.4e-3, 3e-3]
    tables = {}
    for case in (1, 2):
        device = s3_lengths.printed_device(case)
        p = device.values()
        p.lengths = SimpleNamespace(**dict(zip(s3_lengths.LENGTHS, truth[:6], strict=True)))
        k = device_module.stage(device, p)
        tables[case] = {
            symbol: tuple(
                " ".join(
                    "0" if text == "0" else f"{s3.computed(case, symbol, i, j, k):.3f}"
                    for j, text in enumerate(line.split(), start=1)
                )
                for i, line in enumerate(lines, start=1)
            )
            for symbol, lines in s3_tables.TABLE_4[case].items()
        }
    monkeypatch.setattr(s3_lengths, "TABLE_4", tables)
    caches = (s3_lengths.table_4_misfit, s3_lengths.fit, s3_lengths.diagnosis)
    try:
        for cached in caches:
            cached.cache_clear()
        best, second, *_ = s3_lengths.diagnosis()
        # Least squares does not keep the largest misfit below 1; one entry lies within 1 % of its half digit.
        assert best.freed == ("l2", "l4") and best.outside <= 1 < 10 < second.outside
        # The digits of the table leave 3 um.
        assert abs(best.lengths["l4"] - 33e-3) < 5e-6 and abs(best.lengths["l2"] - 21.8e-3) < 5e-6
    finally:
        for cached in caches:
            cached.cache_clear()


@pytest.mark.long
def test_table_6_is_reproduced_to_a_tenth_of_a_point_but_for_three_lost_signs() -> None:
    rows = printed_rows("Table 6")
    differing = [row for row in rows if row.status not in AGREES]
    assert len(rows) == 60 and all(row.allowed == 0.1 for row in rows)
    assert [row.where for row in differing] == [f"Table 6, case 1, C_oFin ({i},2)" for i in (1, 2, 3)]
    assert all(row.ours is not None and abs(row.ours + row.value) <= 0.1 for row in differing)


def test_a_finite_element_number_taken_within_its_print_meets_both_cases() -> None:
    """Eight entries of Table 5 are too short for Table 6; each gets one value, which must round to the print."""
    short = [
        (symbol, i, j, text)
        for symbol, i, j, text in s3_tables.entries(s3_tables.TABLE_5)
        if text != "0" and s3.finite_element_value(symbol, i, j).reason
    ]
    assert len(short) == 8
    for symbol, i, j, text in short:
        assert abs(s3.finite_element_value(symbol, i, j).value - float(text)) <= half_unit(text)


def test_the_model_stands_eleven_per_cent_off_the_finite_elements_in_the_jacobian() -> None:
    J_fea = np.array([[float(word) for word in line.split()] for line in s3_tables.TABLE_5["J"]])
    k = s3.stage_of_case(2)
    gap, complete = (np.mean(array(M) / J_fea - 1) for M in (k.J, k.complete_J))
    assert 0.105 < gap < 0.115
    assert 0.085 < complete < 0.095  # (B.83) accounts for two of the eleven


def test_every_row_that_differs_says_why() -> None:
    rows = s3.rows()
    assert all(row.reason for row in rows if row.status not in AGREES)
    assert len({row.where for row in rows}) == len(rows)
    assert {row.where for row in rows if row.status is ReproductionStatus.DIFFERS and "Table 5" not in row.where} == {
        "Table 1, l1",
        "Table 2, case 2, shear factor of delta_y/F_y",
        "section 4.1, C_inFin diagonal over off-diagonal, case 2",
        "Table 4, case 2, C_oFin (3,1)",
        "Table 6, case 1, C_oFin (1,2)",
        "Table 6, case 1, C_oFin (2,2)",
        "Table 6, case 1, C_oFin (3,2)",
    }


def test_table_4_has_the_shear_that_table_2_leaves_out() -> None:
    (row,) = s3_shear.rows()
    assert row.status is ReproductionStatus.DIFFERS and row.ours == pytest.approx(1.5, abs=0.01)
    assert (np.abs(s3_shear.misfit(0.0)) > 1).sum() > (np.abs(s3_shear.misfit(1.5)) > 1).sum()


def test_the_equations_and_the_lengths_of_table_1_say_what_holds() -> None:
    by_place = {row.where: row for row in s3.rows()}
    assert all(
        row.status is ReproductionStatus.REPRODUCED for where, row in by_place.items() if where.startswith("eq. (")
    )
    literal = [row for row in by_place.values() if row.status is ReproductionStatus.CORRECTED]
    assert len(literal) > 50 and all("l1 = 47.900 mm" in row.reason for row in literal if "Table 5" not in row.where)
