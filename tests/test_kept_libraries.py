"""The folder of compiled libraries stays below a size, and loses what was used longest ago."""

from __future__ import annotations

import os

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics import compiled, kept_libraries
from ctrlgen.numerics.compiled import Compilable
from ctrlgen.numerics.kept_libraries import EVERY, KeptLibraries

LONG_AGO = 1_000_000.0  # s since 1970


def library(folder, name: str, size: int, used: float):
    path = folder / name
    path.write_bytes(bytes(size))
    os.utime(path, (used, used))
    return path


def test_those_used_longest_ago_go_and_nothing_else_does(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_libraries, "MOST", 1000)
    old, used, new = (library(tmp_path, f"{k}.so", 400, LONG_AGO + k) for k in range(3))
    other = library(tmp_path, "notes.txt", 5000, LONG_AGO)
    kept = KeptLibraries()
    kept.used(old)
    kept.added(tmp_path)
    assert [path.exists() for path in (old, used, new, other)] == [True, False, True, True]


def test_the_folder_is_looked_at_once_in_a_while_and_may_be_gone(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_libraries, "MOST", 1000)
    kept = KeptLibraries()
    kept.added(tmp_path / "gone")
    first = library(tmp_path, "a.so", 900, LONG_AGO)
    library(tmp_path, "b.so", 900, LONG_AGO + 1)
    for _ in range(EVERY - 1):
        kept.added(tmp_path)
        assert first.exists()
    kept.added(tmp_path)
    assert not first.exists()


def test_a_library_that_is_loaded_counts_as_used(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    x = ca.SX.sym("x")
    one = ca.Function("one", [x, ca.SX.sym("u")], [ca.cos(x) / 3, x])
    assert Compilable(one).spent(1e6, 10_000)
    (path,) = (tmp_path / "ctrlgen").glob("*.so")
    os.utime(path, (LONG_AGO, LONG_AGO))
    again = Compilable(one)
    assert again.spent(1e6, 10_000) and again.run(np.ones(1), [np.zeros((2, 1))], 2)[0][0, 0] == np.cos(1.0) / 3
    assert path.stat().st_mtime > LONG_AGO
