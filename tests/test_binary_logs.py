"""Logs that are no text: structures, matrices, attributes, instants and marks of their formats; nothing in them is executed."""

from __future__ import annotations

import datetime
import io
import pickle
import zipfile

import numpy as np
import pytest
import scipy

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import checked_files, read_table

T, U, X = 0.001 * np.arange(40), np.sin(0.4 * np.arange(40)), np.cos(0.3 * np.arange(40))


def h5py_or_skip():
    return pytest.importorskip("h5py", reason="h5py is not installed: HDF5 was not read")


def write_7_3(path, fill) -> None:
    """A MATLAB 7.3 file whose variables `fill(file)` writes."""
    with h5py_or_skip().File(path, "w", userblock_size=512) as file:
        fill(file)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def text(file, name: str, words: str):
    node = file.create_dataset(name, data=np.array([[ord(c)] for c in words], dtype=np.uint16))
    node.attrs["MATLAB_class"] = np.bytes_("char")
    return node


# MATLAB


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_signals_of_simulink_are_found_by_their_label(version, tmp_path):
    path = tmp_path / "run.mat"
    if version == "5":
        signals = np.array(
            [({"values": U[:, None], "label": "u"}), ({"values": X.reshape(1, 1, -1), "label": "stage x"})],
            dtype=object,
        )
        scipy.io.savemat(path, {"out": {"time": T[:, None], "signals": signals}})
    else:

        def fill(file):
            file["out/time"] = T[None, :]
            cells = {"values": [], "label": []}
            for k, (values, label) in enumerate(((U, "u"), (X, "stage x"))):
                cells["values"].append(file.create_dataset(f"#refs#/v{k}", data=values[None, :]).ref)
                cells["label"].append(text(file, f"#refs#/l{k}", label).ref)
            for name, references in cells.items():
                file.create_dataset(
                    f"out/signals/{name}", data=np.array([references], dtype=object), dtype=h5py_or_skip().ref_dtype
                )

        write_7_3(path, fill)
    table = read_table(path)
    for name, numbers in (("out.time", T), ("u", U), ("stage x", X), ("out.stage x", X)):
        np.testing.assert_array_equal(table.numbers(table.find(name)), numbers)


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_captures_of_dspace_are_found_by_their_name_with_their_unit(version, tmp_path):
    path = tmp_path / "run.mat"
    if version == "5":
        y = np.array([{"Name": "u", "Data": U, "Unit": "V"}, {"Name": "x", "Data": X, "Unit": "um"}], dtype=object)
        scipy.io.savemat(path, {"run1": {"X": {"Name": "time", "Data": T}, "Y": y, "Description": {"General": {}}}})
    else:

        def fill(file):
            text(file, "run1/X/Name", "time")
            file["run1/X/Data"] = T[None, :]
            cells = {"Name": [], "Data": [], "Unit": []}
            for k, (label, values, unit) in enumerate((("u", U, "V"), ("x", X, "um"))):
                cells["Name"].append(text(file, f"#refs#/n{k}", label).ref)
                cells["Unit"].append(text(file, f"#refs#/u{k}", unit).ref)
                cells["Data"].append(file.create_dataset(f"#refs#/d{k}", data=values[None, :]).ref)
            for name, references in cells.items():
                file.create_dataset(
                    f"run1/Y/{name}", data=np.array([references], dtype=object), dtype=h5py_or_skip().ref_dtype
                )

        write_7_3(path, fill)
    table = read_table(path)
    for name, numbers in (("run1.X.Data", T), ("time", T), ("u", U), ("x", X)):
        np.testing.assert_array_equal(table.numbers(table.find(name)), numbers)
    assert table.units[table.find("x")] == "um"


def test_matrices_that_are_turned_or_complex_are_told(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"m": np.vstack([T, U, X]), "z": U + 1j * X, "r": U + 0j})
    table = read_table(tmp_path / "a.mat")
    np.testing.assert_array_equal(table.numbers("m[2]"), X)
    np.testing.assert_array_equal(table.numbers("z.imag"), X)
    np.testing.assert_array_equal(table.numbers("r"), U)
    assert "m is 3 x 40: its rows are taken as columns" in table.notes
    with pytest.raises(InputError, match="has no column 'z'"):
        table.find("z")


def test_two_signals_of_one_label_are_not_taken_for_each_other(tmp_path):
    signals = np.array([{"values": U, "label": "u"}, {"values": X, "label": "u"}], dtype=object)
    scipy.io.savemat(tmp_path / "a.mat", {"out": {"signals": signals}})
    table = read_table(tmp_path / "a.mat")
    with pytest.raises(InputError, match="has no column 'u'"):
        table.find("u")
    np.testing.assert_array_equal(table.numbers("out.signals[1].values"), X)


def test_a_file_of_nothing_but_objects_of_matlab_says_what_to_save(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"ts": "an object"})
    with pytest.raises(InputError, match=r"save numbers: t = ts\.Time"):
        read_table(tmp_path / "a.mat")


@pytest.mark.parametrize("version", ["5", "7.3"])
def test_texts_that_are_times_are_a_column_and_objects_are_none(version, tmp_path):
    path, stamps = tmp_path / "a.mat", [f"2024-03-05 10:00:00.{k:03d}" for k in range(40)]
    if version == "5":
        scipy.io.savemat(
            path, {"t": np.array(stamps, dtype=object), "names": np.array(["a", "b"], dtype=object), "x": X}
        )
    else:

        def fill(file):
            cells = [text(file, f"#refs#/t{k}", stamp).ref for k, stamp in enumerate(stamps)]
            file.create_dataset("t", data=np.array([cells], dtype=object), dtype=h5py_or_skip().ref_dtype)
            file["x"] = X[None, :]
            file["ts"] = np.array([[3707764736, 2, 1, 1, 1, 1]], dtype=np.uint32)
            file["ts"].attrs["MATLAB_object_decode"] = 3

        write_7_3(path, fill)
    table = read_table(path)
    assert set(table.columns) == {"t", "x"}
    np.testing.assert_allclose(table.time("t", "s").values, T, atol=1e-9)


# HDF5


def test_attributes_of_hdf5_are_applied_or_compared(tmp_path):
    with h5py_or_skip().File(tmp_path / "a.h5", "w") as file:
        raw = np.arange(40, dtype=np.int16)
        raw[7] = -32768
        file["g/x"] = raw
        file["g/x"].attrs.update(
            {"scale_factor": 0.5, "add_offset": 10.0, "_FillValue": np.int16(-32768), "units": "um"}
        )
        file["t"] = T
        file["t"].attrs["units"] = "seconds since 2024-03-05 10:00:00"
        file["table"] = np.array(list(zip(U, X, strict=True)), dtype=[("u", float), ("x y", float)])
        file["stamp"] = [f"2024-03-05T10:00:00.{k:03d}" for k in range(40)]
    table = read_table(tmp_path / "a.h5")
    x = table.numbers(table.find("g/x"))
    assert np.isnan(x[7]) and x[8] == 14 and table.units["g/x"] == "um"
    assert any("fill value -32768" in note for note in table.notes) and any(
        "times 0.5 plus 10" in note for note in table.notes
    )
    np.testing.assert_array_equal(table.numbers(table.find("x y")), X)
    np.testing.assert_allclose(table.time("stamp", "s").values, T, atol=1e-9)


def test_a_dataset_of_another_file_is_refused(tmp_path):
    (tmp_path / "secret.bin").write_bytes(np.arange(40.0).tobytes())
    with h5py_or_skip().File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", (40,), float, external=[(str(tmp_path / "secret.bin"), 0, 320)])
    with pytest.raises(InputError, match="takes its numbers from another file"):
        read_table(tmp_path / "a.h5")


def test_a_dataset_that_says_it_is_huge_is_refused_before_it_is_read(tmp_path):
    with h5py_or_skip().File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", (10**12,), float, chunks=(1024,))
    with pytest.raises(InputError, match="at most 4 GB"):
        read_table(tmp_path / "a.h5")


# TDMS, MDF


def test_instants_and_waveforms_of_tdms(tmp_path):
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed: TDMS was not read")
    start = np.datetime64("2024-01-01T00:00:00.000000")
    stamps = start + np.arange(40) * np.timedelta64(1000, "us")
    waves = {"u": (U, start, 0.0), "x": (X, start + np.timedelta64(5000, "us"), 0.002)}
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        channels = [nptdms.ChannelObject("g", "t", stamps)]
        for name, (numbers, begin, offset) in waves.items():
            given = {"wf_start_time": begin, "wf_start_offset": offset, "wf_increment": 0.001, "unit_string": "V"}
            channels.append(nptdms.ChannelObject("g", name, numbers, properties=given))
        channels.append(nptdms.ChannelObject("g", "unset", X, properties={"wf_increment": 1.0}))
        writer.write_segment(channels)
    table = read_table(tmp_path / "a.tdms")
    np.testing.assert_allclose(table.time(table.find("t"), "s").values, T, atol=1e-9)
    assert table.clocks["g/u"] == (0.0, 0.001) and table.clocks["g/x"] == (pytest.approx(0.007), 0.001)
    assert "g/unset" not in table.clocks and "wf_increment of unset is 1 s" in table.notes[0]
    with pytest.raises(InputError, match="holds instants"):
        table.numbers("g/t")


def test_the_rasters_of_mdf_are_tables_to_choose_from(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: MDF was not read")
    slow = T[::10]
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(U, T, name="u", unit="V"), asammdf.Signal(X, T, name="x", unit="um")])
        file.append([asammdf.Signal(X[::10], slow, name="x", unit="um")])
        file.save(tmp_path / "rasters.mf4")
    with pytest.raises(InputError, match=r"holds 2 tables \(1: u, x every .* s, 2: x every .* s\); write table = 1"):
        read_table(tmp_path / "rasters.mf4")
    assert len(read_table(tmp_path / "rasters.mf4", 1).reading("u").values) == len(T)
    assert len(read_table(tmp_path / "rasters.mf4", 2).reading("x").values) == len(slow)


def test_readings_of_mdf_that_are_marked_invalid_are_left_out(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed: MDF was not read")
    invalid = np.zeros(40, dtype=bool)
    invalid[[3, 9]] = True
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(U, T, name="u", unit="V"),
            asammdf.Signal(X, T, name="x", unit="um", invalidation_bits=invalid),
        ]
        file.append(signals)
        file.save(tmp_path / "a.mf4")
    table = read_table(tmp_path / "a.mf4")
    x = table.numbers("x")
    assert len(x) == 40 and np.array_equal(np.flatnonzero(np.isnan(x)), [3, 9]) and x[10] == X[10]
    assert "2 readings of x are marked invalid: left out" in table.notes
    np.testing.assert_array_equal(table.numbers("u"), U)


# workbooks, Parquet, NumPy


def workbook(path):
    openpyxl = pytest.importorskip("openpyxl", reason="openpyxl is not installed: Excel was not read")
    book = openpyxl.Workbook()
    book.active.append(["Run of a stage"])
    book.active.append([])
    book.active.append(["Time", "Drive", "Weg (µm)", "Remark"])
    book.active.append(["", "V", "", ""])
    begin = datetime.datetime(2024, 3, 5, 10)
    for k in range(40):
        moment = begin + datetime.timedelta(milliseconds=k)
        book.active.append([moment, float(U[k]), "---" if k == 5 else float(X[k]), "run"])
    book.create_sheet("empty")
    book.save(path)


def test_a_workbook_is_read_sheet_by_sheet(tmp_path):
    workbook(tmp_path / "a.xlsx")
    table = read_table(tmp_path / "a.xlsx")
    np.testing.assert_allclose(table.time("Time", "s").values, T, atol=1e-6)  # a workbook keeps microseconds of a day
    np.testing.assert_allclose(
        table.numbers(table.find("Drive")), U, rtol=1e-15, atol=1e-16
    )  # a workbook has 16 digits
    x = table.reading(table.find("Weg"))
    assert np.isnan(x.values[5]) and x.values[6] == pytest.approx(X[6]) and "(first in line 10)" in x.notes[0]
    assert table.units == {"Weg (µm)": "µm", "Drive": "V"}
    assert read_table(tmp_path / "a.xlsx", "Sheet").columns.keys() == table.columns.keys()
    with pytest.raises(InputError, match="1: Sheet"):
        read_table(tmp_path / "a.xlsx", "other")


def test_a_workbook_that_declares_entities_or_unpacks_without_end_is_refused(tmp_path, monkeypatch):
    workbook(tmp_path / "a.xlsx")
    with zipfile.ZipFile(tmp_path / "a.xlsx") as old, zipfile.ZipFile(tmp_path / "b.xlsx", "w") as new:
        for name in old.namelist():
            bomb = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]>' if name.endswith("sheet1.xml") else b""
            new.writestr(name, bomb + old.read(name))
    with pytest.raises(InputError, match="declares a document type"):
        read_table(tmp_path / "b.xlsx")
    monkeypatch.setattr(checked_files, "LARGEST", 9000)
    with pytest.raises(InputError, match="unpacks to"):
        read_table(tmp_path / "a.xlsx")


def test_parquet_with_instants_units_and_empty_cells(tmp_path):
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed: Parquet was not read")
    parquet = __import__("pyarrow.parquet").parquet
    stamps = np.datetime64("2024-01-01T00:00:00.000000", "us") + np.arange(40) * np.timedelta64(1000, "us")
    fields = [
        pyarrow.field("t", pyarrow.timestamp("us")),
        pyarrow.field("x", pyarrow.float64(), metadata={b"unit": b"um"}),
    ]
    arrays = [pyarrow.array(stamps), pyarrow.array([None, *X[1:].tolist()])]
    parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), tmp_path / "a.parquet")
    table = read_table(tmp_path / "a.parquet")
    np.testing.assert_allclose(table.time("t", "s").values, T, atol=1e-9)
    assert np.isnan(table.numbers("x")[0]) and table.numbers("x")[1] == X[1] and table.units == {"x": "um"}


class Trap:
    """Whoever unpickles it sets `sprung`."""

    sprung = False

    def __reduce__(self):
        return (exec, ("import test_binary_logs; test_binary_logs.Trap.sprung = True",))


@pytest.mark.parametrize("ending", [".npy", ".npz"])
def test_nothing_is_executed_to_read_arrays(ending, tmp_path):
    held = io.BytesIO()
    np.lib.format.write_array(held, np.array([Trap()], dtype=object), allow_pickle=True)
    assert b"exec" in held.getvalue() and pickle.dumps(Trap())
    path = tmp_path / f"a{ending}"
    if ending == ".npy":
        path.write_bytes(held.getvalue())
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("x.npy", held.getvalue())
    with pytest.raises(InputError):
        read_table(path)
    assert not Trap.sprung


def test_arrays_of_instants_and_fields(tmp_path):
    stamps = np.datetime64("2024-01-01T00:00:00", "us") + np.arange(40) * np.timedelta64(1000, "us")
    np.savez(
        tmp_path / "a.npz", t=stamps, log=np.array(list(zip(U, X, strict=True)), dtype=[("u", float), ("x", float)])
    )
    table = read_table(tmp_path / "a.npz")
    np.testing.assert_allclose(table.time("t", "s").values, T, atol=1e-9)
    np.testing.assert_array_equal(table.numbers(table.find("x")), X)


# JSON


def test_json_with_stamps_and_a_key_that_stands_twice(tmp_path):
    (tmp_path / "a.json").write_text(
        '[{"t": "2024-03-05T10:00:00.000Z", "x": 1}, {"t": "2024-03-05T10:00:00.500Z", "x": 2}]'
    )
    assert read_table(tmp_path / "a.json").time("t", "s").values.tolist() == [0, 0.5]
    (tmp_path / "b.json").write_text('{"log": {"x": [1, 2], "x": [3, 4]}}')
    with pytest.raises(InputError, match="holds the key 'x' twice"):
        read_table(tmp_path / "b.json")
    (tmp_path / "d.json").write_text('{"x": 1, "y": 2}\n{"x": 3}\n')
    assert read_table(tmp_path / "d.json").numbers("x").tolist() == [1, 3]
    (tmp_path / "c.json").write_text("[" * 100_000)
    with pytest.raises(InputError):
        read_table(tmp_path / "c.json")
