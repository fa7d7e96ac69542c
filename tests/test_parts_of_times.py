"""A time in columns of hours, minutes, seconds and parts of them, or of stamps of whole seconds beside a fraction, is one exact time."""

from __future__ import annotations

import datetime
import itertools

import numpy as np
import pytest

from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts

ROWS = 900
PARTS = {"h": 3600_000_000, "m": 60_000_000, "s": 1_000_000, "ms": 1000, "us": 1}
NAMES = {
    "h": ("Hour", "hh"),
    "m": ("Min", "minute"),
    "s": ("Sec", "ss"),
    "ms": ("msec", "Millisecond"),
    "us": ("usec", "micros"),
}
RUNS = [
    keys
    for a, b in itertools.combinations(range(6), 2)
    if len(keys := tuple(PARTS)[a:b]) > 1 and keys[0] in "hm" and b > 2
]


def read(folder, head: str, lines) -> np.ndarray:
    body = "\n".join(f"{line}\t{k % 7}.25\t{k % 5}.125" for k, line in enumerate(lines))
    (folder / "log.txt").write_text(f"{head}\tu [V]\tx [um]\n{body}\n")
    table = read_table(folder / "log.txt")
    facts = table_facts(table)
    assert facts.time is not None
    return table.time(facts.time.column, facts.time.unit).values


@pytest.mark.parametrize("keys", RUNS, ids="-".join)
@pytest.mark.parametrize("which", [0, 1])
def test_parts_are_one_time_over_every_end(tmp_path, keys, which):
    step = max(PARTS[keys[-1]], 100_000)  # us; a second or a tenth
    begin = 23 * PARTS["h"] + 59 * PARTS["m"] + 50 * PARTS["s"]  # over the minute, the hour and midnight
    exact = begin + step * np.arange(ROWS)
    lines = []
    for instant in exact.tolist():
        cells, left = [], instant % (24 * PARTS["h"])
        for key in PARTS:
            if key in keys:
                cells.append(f"{left // PARTS[key]:d}")
            left %= PARTS[key]
        lines.append("\t".join(cells))
    head = "\t".join(NAMES[key][which] for key in keys)
    np.testing.assert_allclose(read(tmp_path, head, lines), (exact - exact[0]) * 1e-6, rtol=0, atol=1e-9)


def test_seconds_with_their_fraction_beside_minutes(tmp_path):
    lines = [f"{k // 600}\t{k % 600 / 10:.1f}" for k in range(ROWS)]
    np.testing.assert_allclose(read(tmp_path, "min\tsec", lines), np.arange(ROWS) / 10, rtol=0, atol=1e-9)


def test_parts_of_two_runs_are_not_joined(tmp_path):
    lines = [f"{k % 450 // 600}\t{k % 450 / 10:.1f}" for k in range(ROWS)]
    assert np.any(np.diff(read(tmp_path, "min\tsec", lines)) < 0)


@pytest.mark.parametrize("name, size", [("ms", 1000), ("msec", 1000), ("usec", 1_000_000), ("Millisec", 1000)])
@pytest.mark.parametrize("stamp", ["%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%H:%M:%S"])
@pytest.mark.parametrize("step", [3, 40, 100])  # ms; some products with 1e-9 are no whole seconds
def test_a_stamp_of_whole_seconds_goes_on_by_its_fraction(tmp_path, name, size, stamp, step):
    begin = datetime.datetime(2024, 3, 5, 23, 59, 55)
    at = [begin + datetime.timedelta(milliseconds=step * k) for k in range(ROWS)]
    lines = [f"{instant:{stamp}}\t{instant.microsecond * size // 1_000_000}" for instant in at]
    np.testing.assert_allclose(
        read(tmp_path, f"Date&Time\t{name}", lines), np.arange(ROWS) * step / 1000, rtol=0, atol=1e-9
    )


def test_names_beside_the_units_of_other_columns(tmp_path):
    head = "\t\t\tDrive\tStage\nDate\tTime\tMsec\tV\tum"
    at = [datetime.datetime(2024, 3, 5, 10, 0, 0) + datetime.timedelta(milliseconds=100 * k) for k in range(ROWS)]
    body = "\n".join(
        f"{t:%Y/%m/%d\t%H:%M:%S}\t{t.microsecond // 1000}\t{k % 7}.25\t{k % 5}.125" for k, t in enumerate(at)
    )
    (tmp_path / "log.txt").write_text(f"{head}\n{body}\n")
    table = read_table(tmp_path / "log.txt")
    facts = table_facts(table)
    assert facts.time is not None and list(table.columns)[:5] == ["Date", "Time", "Msec", "Drive", "Stage"]
    np.testing.assert_allclose(table.time(facts.time.column, facts.time.unit).values, np.arange(ROWS) / 10, atol=1e-9)
