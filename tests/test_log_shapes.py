"""Logs of other shapes than a row a sample: one reading a row, a row a signal, scans of which each repeats its names, lines of JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.oddities import table_oddities

N = 120
TIME = 1e-3 * np.arange(N)
DRIVE = np.round(5 * np.sin(40 * TIME) ** 2, 4)
PLACE = np.round(3.1 * DRIVE - 2, 4)


def written(tmp_path, text, name="log.csv"):
    path = tmp_path / name
    path.write_text(text)
    return path


def is_the_log(table, time, drive, place):
    assert table.time(table.find(time), "s").values == pytest.approx(TIME, abs=1e-9)
    assert table.numbers(table.find(drive)) == pytest.approx(DRIVE)
    assert table.numbers(table.find(place)) == pytest.approx(PLACE)


@pytest.mark.parametrize("shuffled", [False, True])
def test_one_reading_a_row_is_a_column_a_signal(tmp_path, rng, shuffled):
    pairs = [(t, name, v) for t, u, y in zip(TIME, DRIVE, PLACE, strict=True) for name, v in (("u", u), ("y", y))]
    if shuffled:  # within an instant, as a message bus writes it
        pairs = [pairs[2 * k + j] for k in range(N) for j in rng.permutation(2)]
    rows = [f"{t:.4f},{name},{v:.4f}" for t, name, v in pairs]
    table = read_table(written(tmp_path, "time,signal,value\n" + "\n".join(rows) + "\n"))
    is_the_log(table, "time", "u", "y")
    assert any("one reading a row" in note for note in table.notes)
    assert table.lines[5] == 12


def test_a_reading_that_is_not_in_an_instant_is_missing_and_units_are_those_of_the_rows(tmp_path):
    rows = [f"{t:.4f},u,{u},V" for t, u in zip(TIME, DRIVE, strict=True)]
    rows += [f"{t:.4f},y,{y},um" for t, y in zip(TIME[::2], PLACE[::2], strict=True)]
    table = read_table(written(tmp_path, "_time,_field,_value,unit\n" + "\n".join(rows) + "\n"))
    assert table.unit("u") == "V" and table.unit("y") == "um"
    assert table.numbers("u") == pytest.approx(DRIVE)
    y = table.numbers("y")
    assert y[::2] == pytest.approx(PLACE[::2]) and np.isnan(y[1::2]).all()


def test_readings_at_times_of_their_own_are_refused_and_a_state_beside_a_reading_is_none_of_them(tmp_path):
    rows = [
        f"{t + 3e-4 * k:.4f},{name},{v}"
        for t, u, y in zip(TIME, DRIVE, PLACE, strict=True)
        for k, (name, v) in enumerate((("u", u), ("y", y)))
    ]
    with pytest.raises(InputError, match="at times of their own; export each signal"):
        read_table(written(tmp_path, "time,signal,value\n" + "\n".join(rows) + "\n"))
    rows = [f"{t:.4f},{'moves' if k > 60 else 'rests'},{y}" for k, (t, y) in enumerate(zip(TIME, PLACE, strict=True))]
    table = read_table(written(tmp_path, "time,state,value\n" + "\n".join(rows) + "\n"))
    assert list(table.columns) == ["time", "state", "value"] and len(table.lines) == N


def test_a_row_a_signal_is_read_as_columns(tmp_path):
    rows = [("time [s]", TIME), ("drive V", DRIVE), ("place (um)", PLACE)]
    text = "\n".join(",".join([name, *map(repr, map(float, values))]) for name, values in rows)
    table = read_table(written(tmp_path, text + "\n"))
    is_the_log(table, "time [s]", "drive V", "place")
    assert table.unit("drive V") == "V" and table.unit("place (um)") == "um"
    assert any("read as columns of 120 samples" in note for note in table.notes)


def test_scans_that_repeat_their_names_are_tables_and_other_remarks_among_rows_are_none(tmp_path):
    rows = [f"{t:.4f} {u} {y}" for t, u, y in zip(TIME, DRIVE, PLACE, strict=True)]
    scan = "\n#S {} ascan piezo 0 5 120 0.001\n#D Tue Nov 14 22:13:20 2023\n#N 3\n#L Epoch  piezo volt  cap um\n"
    body = "\n".join([*rows[:50], "# saved", *rows[50:]]) + "\n"
    path = written(tmp_path, "#F log\n# saved\n" + scan.format(1) + body + scan.format(2) + body, "scans.dat")
    with pytest.raises(InputError, match="holds 2 tables"):
        read_table(path)
    for which in (1, 2):
        is_the_log(read_table(path, which), "Epoch", "piezo volt", "cap um")


@pytest.mark.parametrize("name", ["log.jsonl", "log.ndjson", "log.log", "log.txt"])
def test_lines_of_json_are_read_under_any_ending(tmp_path, name):
    rows = [
        json.dumps({"t": float(t), "u": float(u), "y": float(y)}) for t, u, y in zip(TIME, DRIVE, PLACE, strict=True)
    ]
    is_the_log(read_table(written(tmp_path, "\n".join(rows) + "\n", name)), "t", "u", "y")


def test_a_time_since_1970_is_recognised_in_its_unit(tmp_path):
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        rows = [
            f"{round(factor * (1.7e9 + t)) if unit != 's' else f'{1.7e9 + t:.4f}'},{u}"
            for t, u in zip(TIME, DRIVE, strict=True)
        ]
        time = table_facts(read_table(written(tmp_path, "%time,u\n" + "\n".join(rows) + "\n"))).time
        assert time is not None and time.unit == unit and time.step == pytest.approx(1e-3, rel=1e-3)


def test_what_may_be_the_time_is_told_where_none_is_known(tmp_path):
    rows = [f"{t:.2f},{u},{y}" for t, u, y in zip(TIME, DRIVE, PLACE, strict=True)]
    said = table_oddities(table_facts(read_table(written(tmp_path, "time_s,u,y\n" + "\n".join(rows) + "\n"))))
    assert any("time_s: stands still in 107 of 119 rows" in line for line in said)  # 0.00 to 0.12
    rows = [f",,{t:.4f},{u}" for t, u in zip(TIME, DRIVE, strict=True)]
    for k, text in enumerate(
        ("Record Length,120 Points", "Source,CH1", "Vertical Units,V")
    ):  # beside the rows, as scopes write
        rows[k] = text + rows[k][1:]
    said = table_oddities(table_facts(read_table(written(tmp_path, "\n".join(rows) + "\n"))))
    assert any("2: rises by 0.001 from row to row: name it as the time" in line for line in said)


def test_of_two_lines_that_are_labelled_as_units_the_nearer_one_counts(tmp_path):
    """A set of labels has no order: which line was taken depended on the run."""
    rows = "".join(f",{t},{u},{x}\n" for t, u, x in zip(TIME, DRIVE, PLACE, strict=True))
    labels = ("Einheit", "Einheiten", "Unit", "Units", "Vertical Units", "VUnit", "y_unit_label")
    for first in labels:
        for second in labels:
            if first != second:
                path = written(tmp_path, f"Name,t,drive,place\n{first},ms,mV,mm\n{second},s,V,um\n{rows}")
                table = read_table(path)
                assert [table.units[name] for name in ("t", "drive", "place")] == ["s", "V", "um"], (first, second)
