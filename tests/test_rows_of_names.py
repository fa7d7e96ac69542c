"""Two rows of text beside one of units: whichever logger wrote them, units belong to their columns and no name is lost."""

from __future__ import annotations

import pytest

from ctrlgen.recordings.formats import read_table

ROWS = "\n".join(f"{k / 100:.2f},{k % 5},{3.5 * k:.1f}" for k in range(12))
UNITS = ["s", "V", "um"]


@pytest.mark.parametrize(
    ("above", "names"),
    [
        ("CH0,CH1,CH2\nTime,Drive,Position\ns,V,um", "Time Drive Position"),
        ("Time,CH1,CH2\n,Drive,Position\ns,V,um", "Time Drive Position"),
        ("Time,Drive,Position\n,AI0,AI1\n[s],[V],[um]", "Time AI0 AI1"),
        ("Time,Drive,Position\nFLOAT64,REAL,REAL\ns,V,um", "Time Drive Position"),
        ("Time,Drive,Position\ninput,output,output\ns,V,um", "Time Drive Position"),
        ("A,A,B\nt,x,x\ns,V,um", "A.t A.x B.x"),
        ("s,V,um\nTime,Drive,Position\nt,u,y", "t u y"),
        ("Time,Drive,Position\ns,V,um\nFLOAT64,REAL,REAL", "Time Drive Position"),
    ],
)
def test_two_rows_of_text_beside_units(tmp_path, above, names):
    file = tmp_path / "log.csv"
    file.write_text(f"{above}\n{ROWS}\n")
    table = read_table(file)
    assert list(table.columns) == names.split()
    assert [table.units[name] for name in table.columns] == UNITS
    assert table.numbers(names.split()[2])[-1] == 38.5


def test_a_second_row_of_names_is_told(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text(f"CH0,CH1,CH2\nTime,Drive,Position\ns,V,um\n{ROWS}\n")
    assert "above them stands CH0, CH1, CH2" in read_table(file).notes


@pytest.mark.parametrize("rows", [("FLOAT64,REAL,REAL", "s,V,um"), ("s,V,um", "FLOAT64,REAL,REAL")])
def test_a_row_of_types_is_told_whichever_side_of_the_units_it_stands(tmp_path, rows):
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["Time,Drive,Position", *rows, ROWS]))
    told = f"line {2 + rows.index('FLOAT64,REAL,REAL')} (FLOAT64, REAL, REAL) holds neither names nor units"
    assert told in read_table(file).notes


NAMED = ["Time", "Drive", "Position"]


def test_what_stands_above_a_table_is_told_line_by_line(tmp_path):
    """Names, units of the columns in their order ('' for none), notes."""
    for head, names, units, notes in (
        ("Time,Drive,Position", NAMED, ["", "", ""], []),
        ("log of today\nTime,Drive,Position", NAMED, ["", "", ""], ["names in line 2"]),
        ("x-axis,1,2", ["x-axis", "1", "2"], ["", "", ""], ["line 1 (x-axis, 1, 2) is taken as the columns' names"]),
        ("Time,Drive,Position\ns,V,um", NAMED, UNITS, ["line 2 holds units"]),
        ("s,V,um\nTime,Drive,Position", NAMED, UNITS, ["names in line 2", "line 1 holds units"]),
        ("Time,Drive,Position\n[s],(V),{um}", NAMED, UNITS, ["line 2 holds units"]),
        ("Time,Drive,Position\ns,1,um", NAMED, ["s", "", "um"], ["line 2 holds units"]),
        ("Time,Drive,Position\ns,,um", NAMED, ["s", "", "um"], ["line 2 holds units"]),
        ("a,b,c\nd,e,f\ng,h,i", ["g", "h", "i"], ["", "", ""], ["names in line 3"]),
        ("CH0,CH1,CH2\nTime,,Position", ["Time", "CH1", "Position"], ["", "", ""],
         ["names in line 2", "columns without a name there are named by line 1"]),
        ("unit,V,um\nname,u,x\nnote,a,b", ["name", "u", "x"], ["unit", "V", "um"],
         ["names in line 2", "line 1 holds units", "line 3 (note, a, b) holds neither names nor units"]),
        ("note,a,b\nname,u,x\nunit,V,um", ["name", "u", "x"], ["unit", "V", "um"],
         ["names in line 2", "line 3 holds units", "above them stands note, a, b"]),
        ("CH0,CH1,CH2\nTime,Drive,Position\ns,V,um", NAMED, UNITS,
         ["names in line 2", "line 3 holds units", "above them stands CH0, CH1, CH2"]),
        ("Time,Drive,Position\nFLOAT64,REAL,REAL\ns,V,um", NAMED, UNITS,
         ["line 3 holds units", "line 2 (FLOAT64, REAL, REAL) holds neither names nor units"]),
        ("Time,Drive,Position\nREAL,,REAL\ns,V,um", NAMED, UNITS,
         ["line 3 holds units", "line 2 (REAL, REAL) holds neither names nor units"]),
        ("A,,B\nFLOAT,REAL,REAL\ns,V,um", ["A.FLOAT", "A.REAL", "B.REAL"], UNITS, ["names in line 2", "line 3 holds units"]),
        ("A,B,A\nFLOAT,REAL,REAL\ns,V,um", ["A.FLOAT", "B.REAL", "A.REAL"], UNITS, ["names in line 2", "line 3 holds units"]),
        ("1,2,3\nFLOAT,REAL,REAL\ns,V,um", ["FLOAT", "REAL (column 1)", "REAL (column 2)"], UNITS,
         ["names in line 2", "line 3 holds units"]),
    ):  # fmt: skip
        (tmp_path / "log.csv").write_text(f"{head}\n{ROWS}\n")
        table = read_table(tmp_path / "log.csv")
        assert list(table.columns) == names, head
        assert [table.units.get(name, "") for name in names] == units, head
        assert list(table.notes) == notes, head
        assert len(table.lines) == 12 and table.lines[0] == head.count("\n") + 2, head
