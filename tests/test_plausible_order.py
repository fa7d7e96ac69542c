"""Readings that stand a row off their drives, and columns in another order, are told; a right order never is."""

from __future__ import annotations

import re

import numpy as np
import pytest
from model_logs import LOGS, said_of, write_log

SETTLED, MOVING = "poses", "heaters"


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    """By the name of a log: its folder, model, the lines of its recording.toml, the columns' names and their numbers (n, m)."""
    kept = {}

    def log(name):
        if name not in kept:
            folder, model, text = write_log(LOGS[name], tmp_path_factory.mktemp(name))
            head, *rows = (folder / "log.csv").read_text().splitlines()
            kept[name] = (
                folder,
                model,
                text,
                head.split(","),
                np.array([[float(v) for v in r.split(",")] for r in rows]),
            )
        return kept[name]

    return log


def said(log, rows: np.ndarray) -> list[str]:
    folder, model, text, names, _ = log
    lines = (",".join(f"{v:.9g}" for v in row) for row in rows)
    (folder / "log.csv").write_text("\n".join([",".join(names), *lines]) + "\n")
    return said_of(text, folder, model)


def moved(log, k: int, first: int = 0) -> np.ndarray:
    """The rows of a log whose readings stand k rows later, from a row on."""
    names, rows = log[3:]
    readings = [not name.startswith("u") for name in names]
    kept = rows.copy()
    n = len(rows)
    at = np.clip(np.arange(n) - k, 0, n - 1)
    at[:first] = np.arange(first)
    kept[:, readings] = rows[at][:, readings]
    return kept


@pytest.mark.parametrize("k", [1, 2, -1, -2])
@pytest.mark.parametrize("first", [0, 25])
def test_readings_of_other_rows_are_told_with_the_row_from_which_on(logged, k, first):
    log = logged(SETTLED)
    (told,) = said(log, moved(log, k, first))
    assert f"{abs(k)} row{'s' if abs(k) > 1 else ''} {'before' if k > 0 else 'after'}" in told
    since = re.search(r"from its row (\d+) on", told)
    assert (since is None) if first == 0 else since and int(since[1]) == pytest.approx(first, abs=abs(k))
    assert said(log, log[4]) == []


def exchanged(log, order: list[int], signs: list[int], drives: bool) -> np.ndarray:
    """The rows of a log in which column j of drives or readings is the one of place order[j], times its sign."""
    names, rows = log[3:]
    places = [i for i, name in enumerate(names) if name.startswith("u") == drives]
    kept = rows.copy()
    kept[:, places] = rows[:, [places[k] for k in order]] * signs
    return kept


@pytest.mark.parametrize("name", [SETTLED, pytest.param(MOVING, marks=pytest.mark.long)])
@pytest.mark.parametrize("seed", range(4))
def test_drives_in_another_order_are_told(logged, name, seed):
    log, rng = logged(name), np.random.default_rng(seed)
    order = next(p for p in (rng.permutation(6) for _ in range(99)) if np.count_nonzero(p != np.arange(6)) > 2)
    (told,) = said(log, exchanged(log, order.tolist(), [1] * 6, drives=True))
    drives = log[1].signals["drive"].channels
    # column j holds what the drive order[j] does
    wanted = {(drives[j], drives[k]) for j, k in enumerate(order) if j != k}
    assert set(re.findall(r"the column of drive\.(\S+) moves what drive\.(\S+) should move", told)) == wanted


@pytest.mark.parametrize(
    "name", [SETTLED, *(pytest.param(n, marks=pytest.mark.long) for n in (MOVING, "levers", "mirror"))]
)
def test_a_reading_that_is_turned_round_or_exchanged_is_told(logged, name):
    log, readings = logged(name), list(LOGS[name].readings)
    for i, turned in enumerate(readings):
        if (name, turned) == (MOVING, "delta_z"):  # its motion is far from linear in all drives
            continue
        signs = [-1 if k == i else 1 for k in range(len(readings))]
        (told,) = said(log, exchanged(log, list(range(len(readings))), signs, drives=False))
        assert told.startswith(f"the column of reading.{turned} is turned round")
    units = list(LOGS[name].readings.values())
    i, j = next((i, j) for i in range(len(units)) for j in range(i + 1, len(units)) if units[i] == units[j])
    order = [j if k == i else i if k == j else k for k in range(len(units))]
    (told,) = said(log, exchanged(log, order, [1] * len(units), drives=False))
    pairs = set(re.findall(r"the column of reading\.(\S+) reads what reading\.(\S+) should read", told))
    assert pairs == {(readings[i], readings[j]), (readings[j], readings[i])}


@pytest.mark.parametrize(
    "name", ["axis", pytest.param(MOVING, marks=pytest.mark.long), pytest.param("levers", marks=pytest.mark.long)]
)
def test_a_speed_in_the_place_of_a_position_is_told(logged, name):
    log = logged(name)
    names, rows = log[3:]
    for reading in list(LOGS[name].readings)[:2]:
        y = rows[:, names.index(reading)]
        for rate in (np.gradient(y), np.diff(y, prepend=y[0])):
            kept = rows.copy()
            kept[:, names.index(reading)] = 300.0 * rate  # of about the size of a position
            assert [s for s in said(log, kept) if s.startswith(f"reading.{reading} follows how fast")]
    assert said(log, rows) == []


def test_what_the_library_has_a_law_for_is_left_to_it(logged):
    """Two exchanged drives, and one that is turned round: a machine is wired so, and the C may be."""
    log = logged(SETTLED)
    assert said(log, exchanged(log, [1, 0, 2, 3, 4, 5], [1] * 6, drives=True)) == []
    assert said(log, exchanged(log, list(range(6)), [1, 1, -1, 1, 1, 1], drives=True)) == []
