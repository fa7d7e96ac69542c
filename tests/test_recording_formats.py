"""Formats read alike; what is missing or damaged is named."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from recorded import csv_text, described, samples

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import READERS, read_table
from ctrlgen.recordings.reader import load_recordings


def write_as(ending: str, path, columns: dict[str, np.ndarray]) -> None:
    if READERS[ending] == "long_text_file":
        path.write_text(csv_text(columns))
    elif ending in (".xlsx", ".xlsm"):
        openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed: Excel was not read")
        book = openpyxl.Workbook()
        for row in (list(columns), *zip(*(v.tolist() for v in columns.values()), strict=True)):
            book.active.append(row)
        book.save(path)
    elif ending == ".parquet":
        parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: Parquet was not read")
        parquet.write_table(__import__("pyarrow").table(columns), path)
    elif ending == ".npz":
        np.savez_compressed(path, **columns)
    elif ending == ".npy":
        table = np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, float) for name in columns])
        np.save(path, table)
    elif ending in (".jsonl", ".ndjson"):
        rows = zip(*columns.values(), strict=True)
        rows = [dict(zip(columns, (None if math.isnan(x) else float(x) for x in row), strict=True)) for row in rows]
        path.write_text("\n".join(map(json.dumps, rows)) + "\n")
    elif ending == ".json":
        path.write_text(json.dumps({k: [None if math.isnan(x) else x for x in v] for k, v in columns.items()}))
    elif ending == ".mat":
        from scipy.io import savemat

        savemat(path, {**{k: v[:, None] for k, v in columns.items()}, "gain": 3.0})
    elif ending in (".h5", ".hdf5"):
        h5py = pytest.importorskip("h5py", reason="h5py is not installed: HDF5 was not read")
        with h5py.File(path, "w") as file:
            for name, column in columns.items():
                file["log/" + name] = column
            file["log/x"].attrs["unit"] = "um"
    elif ending == ".tdms":
        nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed: TDMS was not read")
        with nptdms.TdmsWriter(path) as writer:
            writer.write_segment([nptdms.ChannelObject("log", name, column) for name, column in columns.items()])
    else:
        asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: MDF4 was not read")
        with asammdf.MDF(version="4.10" if ending == ".mf4" else "3.30") as file:
            rest = {name: column for name, column in columns.items() if name != "t"}
            file.append([asammdf.Signal(c, columns["t"], name=n, unit="um" * (n == "x")) for n, c in rest.items()])
            file.save(path, overwrite=True)


@pytest.mark.parametrize("ending", list(READERS))
def test_every_format_gives_the_same_record(ending, tmp_path, model):
    columns = samples()
    write_as(ending, tmp_path / f"run{ending}", columns)
    clock = {"column": "time" if ending in (".mf4", ".mdf") else "t", "unit": "s"}
    described(tmp_path, {"file": f"run{ending}", "role": "fit", "time": clock})
    fit, held = load_recordings([tmp_path], model).records
    assert np.allclose(np.vstack([fit.drive, held.drive])[:, 2], columns["u2X"], rtol=1e-15)
    assert np.allclose(np.vstack([fit.observed, held.observed])[:, 0], 1e-6 * columns["x"], rtol=1e-15)
    assert fit.sample_time == pytest.approx(1e-3, rel=1e-9)


def test_a_matlab_file_of_version_7_3_is_hdf5_turned(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: MATLAB 7.3 was not read")
    with h5py.File(tmp_path / "run.mat", "w", userblock_size=512) as file:
        file["log/u"] = np.arange(5.0)[None, :]
        file["both"] = np.arange(10.0).reshape(2, 5)
    with open(tmp_path / "run.mat", "r+b") as file:  # the header by which MATLAB tells the version
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    table = read_table(tmp_path / "run.mat")
    assert np.array_equal(table.numbers("log.u"), np.arange(5))
    assert np.array_equal(table.numbers("both[1]"), np.arange(5, 10))


def test_structures_and_matrices_have_named_columns(tmp_path):
    (tmp_path / "a.json").write_text('{"dt": 0.1, "log": {"m": [[1, 2], [3, null], [5, 6]], "text": ["a", "b"]}}')
    table = read_table(tmp_path / "a.json")
    assert list(table.columns) == ["log.m[0]", "log.m[1]"]
    assert table.find("m[1]") == table.find(1) == "log.m[1]"
    assert np.array_equal(table.numbers("log.m[1]"), [2, np.nan, 6], equal_nan=True)
    (tmp_path / "b.json").write_text('[{"t": 0, "u": 1}, {"t": 1}]')
    assert np.array_equal(read_table(tmp_path / "b.json").numbers("u"), [1, np.nan], equal_nan=True)


def test_a_csv_may_lack_a_header_or_use_the_decimal_comma(tmp_path):
    (tmp_path / "a.csv").write_text("# made by hand\n0;1,5\n1;2,5\n2;\n")
    table = read_table(tmp_path / "a.csv")
    assert np.array_equal(table.numbers(table.find(1)), [1.5, 2.5, np.nan], equal_nan=True)


def test_bad_cells_are_listed_by_line(tmp_path):
    (tmp_path / "a.csv").write_text("t,u\n0,1\n1,FAULT\n2,x\n")
    with pytest.raises(InputError, match=r"line 3 'FAULT', line 4 'x'"):
        read_table(tmp_path / "a.csv").numbers("u")


@pytest.mark.parametrize(
    ("ending", "package"),
    [(".h5", "h5py"), (".tdms", "npTDMS"), (".mf4", "asammdf"), (".xlsx", "openpyxl"), (".parquet", "pyarrow")],
)
def test_a_missing_package_is_named_with_its_command(ending, package, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, package.lower(), None)
    (tmp_path / f"a{ending}").write_bytes(b"")
    with pytest.raises(InputError, match=f"pip install {package} "):
        read_table(tmp_path / f"a{ending}")


@pytest.mark.parametrize("ending", list(READERS))
def test_a_damaged_file_is_an_input_error(ending, tmp_path):
    (tmp_path / f"a{ending}").write_bytes(b"\x00\x01 no such thing {")
    with pytest.raises(InputError):
        table = read_table(tmp_path / f"a{ending}")
        table.numbers(table.find("u"))


def test_channels_of_mdf_on_different_clocks_are_not_mixed(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: MDF4 was not read")
    with asammdf.MDF(version="4.10") as file:
        for name, start in (("u", 0.0), ("y", 0.5)):
            file.append([asammdf.Signal(np.arange(9.0), start + np.arange(9.0), name=name)])
        file.save(tmp_path / "a.mf4")
    choice = r"holds 3 tables \(1: u every 1 s, 2: y every 1 s, 3: all rasters, each channel on its own clock\); write table = 1"
    with pytest.raises(InputError, match=choice):
        read_table(tmp_path / "a.mf4")
    together = read_table(tmp_path / "a.mf4", 3)
    assert together.numbers("time of y every 1 s")[0] - together.numbers("time of u every 1 s")[0] == 0.5
