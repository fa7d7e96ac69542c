"""A long text file is read piece by piece to the same numbers as a short one, in memory for its numbers and little more."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import long_text_file, text_file
from ctrlgen.recordings.formats.written_layout import Layout

N = 16_000
ROWS = [(k, f"{1e-3 * k:.3f}", f"{np.sin(0.01 * k):.5f}", str(k % 977 - 400)) for k in range(N)]
JOINED = {mark: "\n".join(mark.join(row[1:]) for row in ROWS) + "\n" for mark in (",", ";", "\t")}
BLANKS = "\n".join(f"{t:>12}{u:>12}{y:>9}" for _, t, u, y in ROWS) + "\n"
STAMPED = "\n".join(f"2024-03-05T10:00:{k // 1000:02d}.{k % 1000:03d};{u};{y}" for k, _, u, y in ROWS) + "\n"
COUNTED = "\n".join(f"{1_700_000_000_000_000_000 + 10**6 * k},{u},{y}" for k, _, u, y in ROWS) + "\n"
READ = {
    "plain": "time [s],u [V],y\n" + JOINED[","],
    "text above, units below the names": "Logger 3\nNo. 17\n\ntime,u,y\ns,V,um\n" + JOINED[","],
    "decimal comma": "Zeit;u;y\n" + JOINED[";"].replace(".", ","),
    "tabs and ends of lines of Windows": ("t\tu\ty\n" + JOINED["\t"]).replace("\n", "\r\n"),
    "blanks": "t u y\n" + BLANKS,
    "no end of the last line": "t,u,y\n" + JOINED[","].rstrip("\n"),
    "a last line that was cut": "t,u,y\n" + JOINED[","] + "16.000,0.1",
    "a footer": "t,u,y\n" + JOINED[","] + "mean,0.0,1.0\n",
    "over range": "t,u,y\n" + JOINED[","].replace(",300\n", ",OVLD\n").replace(",301\n", ",\n"),
    "time stamps": "t;u;y\n" + STAMPED,
    "nanoseconds since 1970": "t,u,y\n" + COUNTED,
    "no names": JOINED[","],
}
REFUSED = {
    "a row with a cell more": "t,u,y\n" + JOINED[","].replace("8.000,", "8.000,1.0,"),
    "a word in the middle": "t,u,y\n" + JOINED[","].replace("8.000,", "8.000,so "),
    "remarks in it": "t,u,y\n" + JOINED[","].replace("8.000,", "# saved\n8.000,"),
    "two tables": ("t,u,y\n" + JOINED[","][: len(JOINED[","]) // 2].rpartition("\n")[0] + "\n") * 2,
}


def told(read, path):
    """What a reader makes of a file: its tables, or what it refuses it for."""
    try:
        tables = read(path, Layout())
        found = []
        for name, t in tables.items():
            readings = [
                t.reading(c) if k else t.time(c, "ns" if "Zeit" in c or "1970" in str(path) else "s")
                for k, c in enumerate(t.columns)
            ]
            found.append(
                (
                    name,
                    list(t.columns),
                    dict(t.units),
                    [t.lines[k] for k in range(3)],
                    t.lines[-1],
                    [*t.notes, *(n for r in readings for n in r.notes)],
                )
            )
            found[-1] += tuple(r.values.tobytes() for r in readings)
        return found
    except InputError as error:
        return str(error)


@pytest.fixture(autouse=True)
def long_ones_are_short(monkeypatch):
    monkeypatch.setattr(long_text_file, "LONG", 240_000)
    monkeypatch.setattr(long_text_file, "PIECE", 60_000)


@pytest.mark.long
def test_a_long_file_is_read_as_a_short_one(tmp_path, monkeypatch):
    taken = []
    kept = long_text_file.whole_table
    monkeypatch.setattr(long_text_file, "whole_table", lambda *a: taken.append(1) or kept(*a))
    for name, text in (READ | REFUSED).items():
        path = tmp_path / f"{name}.csv"
        path.write_text(text, newline="")
        assert path.stat().st_size > long_text_file.LONG
        before = len(taken)
        assert told(long_text_file.read, path) == told(text_file.read, path), name
        assert len(taken) == before + (name in READ), name


@pytest.mark.long
def test_memory_holds_the_numbers_and_little_more(tmp_path, monkeypatch):
    """Twice the numbers while columns are joined, and a piece of text; a whole text and its lines would take ten times as much."""
    path = tmp_path / "log.csv"
    path.write_text("t,u,y\n" + JOINED[","] * 10)
    long_text_file.read(path, Layout())  # imports
    tracemalloc.start()
    try:
        table = next(iter(long_text_file.read(path, Layout()).values()))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert len(table.lines) == 10 * N and peak < 60 * len(table.lines) + 20e6
