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
