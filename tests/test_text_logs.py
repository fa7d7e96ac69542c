"""Text logs: what the file tells is taken, what it does not tell is asked, nothing vanishes."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import checked_files, read_table
from ctrlgen.recordings.formats.written_layout import Layout


@pytest.fixture
def written(tmp_path):
    """Reads a text that is written to a file first."""

    def read(text: str | bytes, which=None, name: str = "run.csv", **layout):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_table(path, which, Layout(**layout))

    return read


def column(name: str, *cells: str) -> str:
    return f"t;{name}\n" + "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))


# numbers


@pytest.mark.parametrize(
    ("cells", "numbers"),
    [
        (("0,5", "1,234"), (0.5, 1.234)),
        (("1.234,5", "12"), (1234.5, 12)),
        (("1,234.5", "1,000"), (1234.5, 1000)),
        (("1.234.567", "1"), (1234567, 1)),
        (("1234,567", "1,234"), (1234.567, 1.234)),
        (("1'234.5", "-1'000"), (1234.5, -1000)),
        (("1 234,5", "12,25"), (1234.5, 12.25)),
        (("1\u00a0234,5", "\u22120,25"), (1234.5, -0.25)),
        (("1.5e-3", "2.5D+02"), (0.0015, 250)),
        (("TRUE", "0.5"), (1, 0.5)),
    ],
)
def test_numbers_are_read_as_their_marks_say(written, cells, numbers):
    assert written(column("x", *cells)).numbers("x").tolist() == list(numbers)


@pytest.mark.parametrize("cells", [("1,234", "2,500"), ("1.234", "2.500"), ("1,5", "1.5")])
def test_a_mark_that_may_be_either_is_asked(written, cells):
    with pytest.raises(InputError, match=r"layout = \{ decimal = "):
        written(column("x", *cells))
    if cells[0] != "1,5":
        mark = cells[0][1]
        other = {",": ".", ".": ","}[mark]
        assert written(column("x", *cells), decimal=mark).numbers("x").tolist() == [1.234, 2.5]
        assert written(column("x", *cells), decimal=other).numbers("x").tolist() == [1234, 2500]


def test_a_comma_between_two_numbers_or_in_one_is_asked(written):
    with pytest.raises(InputError, match=r'separator = ","'):
        written("0,15\n1,25\n2,35\n")
    assert written("0,15\n1,25\n", decimal=",").numbers("0").tolist() == [0.15, 1.25]
    assert written("0,15\n1,25\n", separator=",").numbers("1").tolist() == [15, 25]
    assert written("t,x\n0,15\n1,25\n").numbers("x").tolist() == [15, 25]


def test_groups_of_other_than_three_digits_are_no_thousands(written):
    with pytest.raises(InputError, match=r"line 3 '12,34.5'"):
        written(column("x", "1,234.5", "12,34.5")).numbers("x")


# marks for none


@pytest.mark.parametrize("mark", ["9.9E37", "-9.9e+37", "1e30", "3.4028235e38", "Infinity", "-9999", "65535"])
def test_numbers_that_mean_over_range_are_left_out_and_told(written, mark):
    reading = written(column("x", "0.1", mark, "0.3", mark, "0.2")).reading("x")
    assert np.array_equal(np.isnan(reading.values), [False, True, False, True, False])
    assert "x: 2 readings are" in reading.notes[0] and "first in line 3" in reading.notes[0]


@pytest.mark.parametrize("word", ["OVERLOAD", "---", "OL", "\u221e", "#NV"])
def test_words_that_mean_over_range_are_left_out_and_told(written, word):
    reading = written(column("x", "0.1", word, "0.3")).reading("x")
    assert np.isnan(reading.values[1]) and reading.notes == (
        f"x: 1 reading is {word!r} (first in line 3), taken as missing",
    )


def test_a_number_that_may_be_a_mark_is_asked(written):
    text = column("x", "5000", "-9999", "-4000", "-9999", "100")
    with pytest.raises(InputError, match=r"missing = \[-9999\]"):
        written(text).numbers("x")
    assert np.isnan(written(text, missing=(-9999,)).numbers("x")[[1, 3]]).all()
    assert written(text, missing=()).numbers("x")[1] == -9999


def test_unknown_words_are_one_fault_with_the_key_that_leaves_them_out(written):
    cells = ["0.1", "FAULT 7", "0.3", "FAULT 7", "E12"]
    with pytest.raises(
        InputError,
        match=r'3 of 5 rows \(line 3 .FAULT 7., line 5 .FAULT 7., line 6 .E12.\).*missing = \["FAULT 7", "E12"\]',
    ):
        written(column("x", *cells)).numbers("x")
    assert np.isnan(written(column("x", *cells), missing=("FAULT 7", "E12")).numbers("x")[1:]).sum() == 3


@pytest.mark.parametrize("head", ["t,u,x\ns,V,um", "s,V,um\nt,u,x", "t,u,x\n[s],[V],[um]", "name,t,u,x\nunit,s,V,um"])
def test_units_in_a_row_of_their_own(written, head):
    first = "," if head.startswith("name") else ""
    table = written(f"{head}\n{first}0,1,2\n{first}1,2,3\n")
    assert [table.unit(table.find(name)) for name in "tux"] == ["s", "V", "um"] and table.numbers("u").tolist() == [
        1,
        2,
    ]


def test_the_unit_of_every_cell_is_the_columns_and_several_are_refused(written):
    table = written("t,x\n0,1 mV\n1,2 mV\n")
    assert table.unit("x") == "mV" and list(table.numbers("x")) == [1, 2]
    assert "x: its cells end in mV, its unit" in table.notes
    with pytest.raises(InputError, match="write the unit into the name"):
        written("t,x\n0,1 mV\n1,2 V\n").numbers("x")


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Zeit (ms)", "ms"),
        ("x [um]", "um"),
        ("U / mV", "mV"),
        ("time_ms", "ms"),
        ("Weg in µm", "µm"),
        ("pos nm", "nm"),
        ("a (m/s^2)", "m/s^2"),
    ]
    + [
        (name, None)
        for name in (
            "x_m",
            "phase A",
            "Channel (left)",
            "u",
            "Axis 1",
            "a/b",
            "x_V",
            "rate (1^9^9^9)",
            "(" + "m" * 10**5 + ")",
        )
    ],
)
def test_the_unit_behind_a_name(written, name, unit):
    table = written(f"n;{name}\n0;1\n1;2\n")
    assert table.unit(name) == unit and table.find(name) == name


# rows


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "cp437", "cp1252"])
def test_encodings(written, encoding):
    text = "Zeit;Weg in µm\n" + "".join(f"{k};{k}\n" for k in range(9))
    assert list(written(text.encode(encoding)).columns) == ["Zeit", "Weg in µm"] or encoding == "cp437"


def test_a_short_row_is_refused_and_a_last_one_that_was_cut_is_left_out(written):
    with pytest.raises(InputError, match=r"line 1 has 2 cells, but line 3 has 1|line 2 has 3 cells, but line 3 has 2"):
        written("t,u,x\n0,1,2\n1,2\n2,3,4\n3,4,5\n")
    table = written("t,u,x\n0,1,2\n1,2,3\n2,3,4\n3,4")
    assert (
        table.numbers("x").tolist() == [2, 3, 4]
        and "line 5, the last, ends before its last cell does; left out" in table.notes
    )


def test_a_row_whose_cells_are_bad_stays_a_row(written):
    for rows in ("0,1,2\n1,FAULT,3\n2,3,4\n3,4,5\n", "0,FAULT,2\n1,2,3\n2,3,4\n", "0,1,2\n1,2,3\n,,\n3,4,5\n"):
        assert len(written("t,u,x\n" + rows).numbers("x")) == rows.count("\n")


def test_a_spreadsheets_error_in_the_first_cell_is_a_row(written):
    for remark in ("#N/A;2", "#NV;2"):
        assert written(f"x;y\n0;1\n{remark}\n# a remark\n2;3\n").numbers("y").tolist() == [1, 2, 3]


def test_null_characters_that_a_lost_power_left_are_left_out(written):
    table = written("t;x\n0;1\n1;2\n2;3\n3;" + "\0" * 50)
    assert table.numbers("x")[:3].tolist() == [1, 2, 3] and "50 null characters at the end are left out" in table.notes


def test_several_tables_are_asked(written):
    text = "run 1\nt,u\n0,1\n1,2\nrun 2\nt,u\n0,3\n1,4\n2,5\n"
    with pytest.raises(InputError, match=r"holds 2 tables \(1: from line 3, 2 rows, 2: from line 7, 3 rows\)"):
        written(text)
    assert written(text, 2).numbers("u").tolist() == [3, 4, 5]


def test_a_header_of_numbers_is_asked_or_known_by_its_index(written):
    with pytest.raises(
        InputError, match=r"layout = \{ header = 1 \} for names or layout = \{ header = 0 \} for numbers"
    ):
        written("0,1,2\n0,5,6\n1,7,8\n")
    assert written("0,1,2\n0,5,6\n1,7,8\n", header=1).numbers("2").tolist() == [6, 8]
    assert written("0,1,2\n0,5,6\n1,7,8\n", header=0).numbers("2").tolist() == [2, 6, 8]


def test_lines_below_a_table_are_no_rows_of_it(written):
    table = written("t,x\n0,1\n1,2\n2,3\nMean,2\n\nMax,3\n")
    assert (
        table.numbers("x").tolist() == [1, 2, 3]
        and table.notes[-1] == "line 7, below the table, is no row of it; left out"
    )


def test_channels_with_times_of_their_own_are_on_their_own_clocks_or_refused(written):
    head = "Name\tu\tName\tx\nSampleTime[ms]\t1\tSampleTime[ms]\t2\nData-Type\tREAL64\tData-Type\tREAL64\n\n"
    rows = "".join(f"{k}\t{k}\t" + (f"{2 * k + 4}\t{k}\n" if k < 3 else "\t\n") for k in range(6))
    clocks = written(head + rows).clocks
    assert clocks == {"u": (0.0, 1e-3), "x": (pytest.approx(4e-3), 2e-3)}
    multi = "X_Value\tu\tX_Value\tx\n0\t1\t{}\t2\n1\t2\t{}\t3\n2\t3\t{}\t4\n"
    with pytest.raises(InputError, match="each have a time of their own, and these differ"):
        written(multi.format(0, 2, 4))
    same = written(multi.format(0, 1, 2))
    assert same.numbers(same.find("X_Value")).tolist() == [0, 1, 2] and same.numbers("x").tolist() == [2, 3, 4]


def test_names_that_repeat_are_found_by_their_number(written):
    table = written("t,x,x\n0,1,2\n1,3,4\n")
    with pytest.raises(InputError, match=r"x \(column 1\), x \(column 2\)"):
        table.find("x")
    assert table.numbers(table.find(2)).tolist() == [2, 4]
    assert list(written("a,,b,\nt,x,t,x\n0,1,2,3\n1,2,3,4\n").columns) == ["a.t", "a.x", "b.t", "b.x"]


def test_names_of_fewer_or_more_columns_than_the_rows_have_are_refused(written):
    with pytest.raises(InputError, match=r"line 1 has 2 names, and the rows below it have 4 cells.*semicolons"):
        written("t,x\n0,15,1,25\n1,15,2,25\n")
    with pytest.raises(InputError, match=r"line 1 has 4 names, and the rows below it have 3 cells"):
        written("t,dt,u,x\n0,1,5\n1,2,6\n")


# time


@pytest.mark.parametrize(
    "stamps",
    [
        ("2024-03-31T01:59:59.999", "2024-03-31T02:00:00", "2024-03-31T02:00:00.001"),
        ("2024-03-31 01:59:59,999", "2024-03-31 02:00:00,000", "2024-03-31 02:00:00,001"),
        ("2024-03-31T01:59:59.999+01:00", "2024-03-31T03:00:00.000+02:00", "2024-03-31T03:00:00.001+02:00"),
        ("2024-03-31T01:59:59.999", "2024-03-31T03:00:00.000", "2024-03-31T03:00:00.001"),
        ("2024-10-27T02:59:59.999", "2024-10-27T02:00:00.000", "2024-10-27T02:00:00.001"),
        ("2024-03-31T01:59:59.999000000Z", "2024-03-31T02:00:00.000000000Z", "2024-03-31T02:00:00.001000000Z"),
        ("31.03.2024 23:59:59.999", "01.04.2024 00:00:00.000", "01.04.2024 00:00:00.001"),
        ("03/31/2024 11:59:59.999 PM", "04/01/2024 12:00:00.000 AM", "04/01/2024 12:00:00.001 AM"),
        ("20240331T015959.999", "20240331T020000.000", "20240331T020000.001"),
        ("2024-03-31 01:59:59.999 +0100", "2024-03-31 03:00:00.000 +0200", "2024-03-31 03:00:00.001 +0200"),
        ("31-Mar-2024 23:59:59.999", "01-Apr-2024 00:00:00.000", "01-Apr-2024 00:00:00.001"),
        ("23:59:59.999", "00:00:00.000", "00:00:00.001"),
        ("59:59.999", "60:00.000", "60:00.001"),
        ("1711850399999", "1711850400000", "1711850400001"),
    ],
)
def test_times_are_seconds_since_the_first(written, stamps):
    scale = 1e-3 if stamps[0].isdigit() else 1.0
    time = written(column("x", *stamps).replace("t;x", "n;t")).time("t", "ms" if scale < 1 else "s")
    np.testing.assert_allclose(scale * time.values, [0, 0.001, 0.002], rtol=0, atol=1e-9)
    assert time.notes and "time is" in time.notes[0]


def test_a_time_of_day_in_doubt_is_refused(written):
    for cells, said in (
        (("10:00:00:5", "10:00:00:10"), "no thousandths"),
        (("10:00", "10:01"), "hours and minutes or minutes"),
    ):
        with pytest.raises(InputError, match=said):
            written(column("x", *cells).replace("t;x", "n;t")).time("t", "s")


def test_dates_that_can_be_read_two_ways_are_asked_where_it_matters(written):
    days = column("x", "03/04/2024 10:00:00", "04/04/2024 10:00:00").replace("t;x", "n;t")
    with pytest.raises(InputError, match=r'dates = "day first"'):
        written(days).time("t", "s")
    assert written(days, dates="day first").time("t", "s").values[1] == 86400
    assert written(days, dates="month first").time("t", "s").values[1] == 31 * 86400
    one = column("x", "03/04/2024 10:00:00.5", "03/04/2024 10:00:01").replace("t;x", "n;t")
    assert written(one).time("t", "s").values[1] == 0.5


@pytest.mark.parametrize(
    ("first", "unit", "said"),
    [(1711850398000, "s", 'unit = "ms"'), (1711850398000000, "ms", 'unit = "us"'), (133563240000000000, "s", "1601")],
)
def test_an_epoch_in_another_unit_is_asked(written, first, unit, said):
    with pytest.raises(InputError, match=said):
        written(column("x", *(str(first + k) for k in range(3))).replace("t;x", "n;t")).time("t", unit)


def test_a_long_epoch_keeps_its_nanoseconds(written):
    stamps = [str(1711850398123456789 + 250 * k) for k in range(4)]
    assert written(column("x", *stamps).replace("t;x", "n;t")).time("t", "ns").values.tolist() == [0, 250, 500, 750]


def test_time_stamps_are_seconds_and_no_other_unit(written):
    with pytest.raises(InputError, match='unit = "s"'):
        written(column("x", "10:00:00.0", "10:00:00.1").replace("t;x", "n;t")).time("t", "ms")


# safety


def test_a_file_that_is_too_large_is_refused_before_it_is_read(written, monkeypatch):
    monkeypatch.setattr(checked_files, "LARGEST", 5)
    with pytest.raises(InputError, match="at most"):
        written("t,x\n0,1\n1,2\n")


def test_what_is_no_text_is_no_table(written):
    for name, content in (
        ("run.csv", b"\x00\x01\x02"),
        ("run.xyz", b"\x00\x01"),
        ("run.csv", b"\x1f\x8b\x08"),
        ("run.xls", b"\xd0\xcf\x11\xe0"),
    ):
        with pytest.raises(InputError):
            written(content, name=name)
    with pytest.raises(InputError, match="no rows of numbers"):
        written("a report\nof words\n")


def test_an_ending_that_nobody_knows_is_read_where_it_is_text(written):
    assert written("t\tx\n0\t1\n1\t2\n", name="run.scope").numbers("x").tolist() == [1, 2]
