"""Habits of loggers beyond those of `logger_files`: each is read to its numbers, told, or refused with the mend."""

from __future__ import annotations

import json

import numpy as np
import pytest
from logger_files import N, T, U, X, rows

from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.measurement_table import MeasurementTable
from ctrlgen.recordings.formats.unit_texts import scaled_unit, unit_of
from ctrlgen.recordings.formats.wrapped_counters import unwrapped_clock, wrapped
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.reader import load_recordings

K = range(N)
DAYS = {"datenum": 739316.4166666667, "matplotlib": 19787.4166666667}


def lines(head: str, write) -> str:
    return head + "".join(write(k) + "\n" for k in K)


def stamp(k: int, zone: str) -> str:
    return f"2024-03-05 10:00:00.{k:03d}{zone},{U[k]},{X[k]}"


FILES = {
    "Yokogawa": '"Trace Name","CH1","CH2"\n"VUnit","V","um"\n"HResolution",1.0e-03,1.0e-03\n"Time","10:00:00","10:00:00"\n\n'
    + "".join(f",{u},{x},\n" for u, x in zip(U, X, strict=True)),
    "Graphtec": lines(
        "Number,Date&Time,ms,CH1,CH2\nNO.,Time,ms,V,um\n",
        lambda k: (
            f"{k + 1},2024/03/05 10:00:0{(950 + k) // 1000},{(950 + k) % 1000},{'-' if U[k] < 0 else '+'}  {abs(U[k])},{X[k]}"
        ),
    ),
    "Rockwell": lines(
        '"Header:","Date","Time","u","x"\n', lambda k: f'Data,"03/05/2024","10:00:00;{k:03d}","{U[k]}","{X[k]}"'
    ),
    "ROS 2": lines(
        "stamp.sec,stamp.nanosec,u,x\n",
        lambda k: f"{1709632800 + (950 + k) // 1000},{(950 + k) % 1000 * 10**6},{U[k]},{X[k]}",
    ),
    "LabVIEW with a time a channel": "X_Value\tu\tX_Value\tx\n" + rows("\t", T, U, T, X),
    "pandas with two rows of names": ",stage,stage\n,u,x\ntime,,\n" + rows(",", T, U, X),
    "pandas with durations": lines("time,u,x\n", lambda k: f"0 days 00:00:00.{k:03d}000,{U[k]},{X[k]}"),
    "a zone in letters": lines("time,u,x\n", lambda k: stamp(k, " CET")),
    "a zone of whole hours": lines("time,u,x\n", lambda k: stamp(k, "+01")),
    "dates of MATLAB": lines("t,u,x\n", lambda k: f"{DAYS['datenum'] + T[k] / 86400:.12f},{U[k]},{X[k]}"),
    "dates of Matplotlib": lines("t,u,x\n", lambda k: f"{DAYS['matplotlib'] + T[k] / 86400:.12f},{U[k]},{X[k]}"),
    "tenths of milliseconds": "Time (0.1 ms),u,x\n" + rows(",", 10 * np.arange(N), U, X),
    "a counter of 16 bits": lines("t (ms),u,x\n", lambda k: f"{(65500 + k) % 65536},{U[k]},{X[k]}"),
    "a counter of microseconds": lines("micros,u,x\n", lambda k: f"{(2**32 - 30000 + 1000 * k) % 2**32},{U[k]},{X[k]}"),
    "names over two lines": '"Time\n(s)","u\n(V)","x\n(um)"\n' + rows(",", T, U, X),
    "SPICE": "time\tV(in)\tx\n" + rows("\t", T, U, X),
    "capitals": "TIME (MS),CMD (V),POS (UM)\n" + rows(",", 1000 * T, U, X),
    "a row of factors": "name;time;u;x\nunit;s;V;um\nfactor;1;1;1\n"
    + "".join(f";{r}\n" for r in rows(";", T, U, X).split()),
    "rows of nested JSON": "".join(
        json.dumps({"ts": f"2024-03-05T10:00:00.{k:03d}Z", "cmd": {"u": U[k]}, "fb": {"x": X[k]}}) + "\n" for k in K
    ),
    "columns of pandas": json.dumps(
        {n: dict(zip(map(str, K), c, strict=True)) for n, c in (("t", T), ("u", U), ("x", X))}
    ),
    "rows of pandas": json.dumps({k: {"t": T[k], "u": U[k], "x": X[k]} for k in K}),
    "a matrix beside its names": json.dumps(
        {"series": [{"columns": ["t", "u", "x"], "values": [*zip(T, U, X, strict=True)]}]}
    ),
    "lists of Python": "".join(f"[{t}, {u}, {x}]\n" for t, u, x in zip(T, U, X, strict=True)),
}


def table_of(folder, text: str, name: str = "log.csv") -> MeasurementTable:
    (folder / name).write_text(text)
    return read_table(folder / name)


def test_what_further_loggers_write_is_read_to_its_numbers(tmp_path):
    for logger, text in FILES.items():
        facts = table_facts(table_of(tmp_path, text))
        numbers = [c.values for c in facts.columns if c.values is not None]
        assert any(np.array_equal(values, U) for values in numbers), logger
        assert any(np.array_equal(values, X) for values in numbers), logger
        if logger not in ("Yokogawa", "lists of Python"):
            time = facts.time  # a date in days is exact to 10 us
            assert time is not None and time.backward == 0 and time.step == pytest.approx(1e-3, rel=1e-2), logger


def test_units_of_further_loggers(tmp_path):
    for logger, units in {
        "Yokogawa": {"CH1": "V", "CH2": "um"},
        "Graphtec": {"CH1": "V", "CH2": "um"},
        "names over two lines": {"u (V)": "V", "x (um)": "um"},
        "capitals": {"TIME (MS)": "ms", "POS (UM)": "um"},
        "SPICE": {"V(in)": None},
        "a row of factors": {"u": "V", "x": "um"},
    }.items():
        table = table_of(tmp_path, FILES[logger])
        assert {name: unit_of(table.unit(name) or "") for name in units} == units, logger
    assert [unit_of(text) for text in ("mil", "Nm", "S", "Ncm")] == ["thou", "N*m", "s", "N*cm"]


def test_what_is_neither_applied_nor_a_name_is_told(tmp_path):
    first, second = "u,x\n" + rows(",", U[:30], X[:30]), rows(",", U[30:], X[30:])
    for text, told in {
        FILES["a row of factors"].replace("factor;1;1;1", "factor;1;0.1;10"): "line 3 (factor, 1, 0.1, 10) is not applied",
        first + "# again\n" + second: "'# again' stands between rows, after line 31",
        first + "\n\n" + second: "2 empty lines stand between rows",
        FILES["ROS 2"]: "stamp.sec holds whole seconds and stamp.nanosec what is over",
    }.items():  # fmt: skip
        notes = table_of(tmp_path, text).notes
        assert any(note.startswith(told) or told in note for note in notes), (told, notes)


def test_what_a_file_leaves_open_is_refused_with_the_mend(tmp_path):
    for text, said in {
        lines("Timestamp,u,x\n", lambda k: f"{638452008000000000 + 10000 * k},{U[k]},{X[k]}"): "scale = 100",
        lines("t,u,x\n", lambda k: f"{DAYS['datenum'] + T[k] / 86400:.12f},{U[k]},{X[k]}"): 'unit = "day"',
    }.items():  # fmt: skip
        table = table_of(tmp_path, text)
        with pytest.raises(InputError, match=said):
            table.time(next(iter(table.columns)), "s")
    for text in ("t=0 u=1 x=2\nt=1 u=2 x=3\n", "u:1,x:2\nu:2,x:3\n"):  # two lines may be a header's
        with pytest.raises(InputError, match="write the names once, above the columns"):
            table_of(tmp_path, text)
    with pytest.raises(InputError, match="is netCDF 3"):
        table_of(tmp_path, "CDF\x01", "log.nc")
    with pytest.raises(InputError, match="no rows of numbers"):  # accountants' negative numbers
        table_of(tmp_path, "x\n" + "".join(f"({k}.5)\n" for k in K))


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device("tests/logs/stage.toml"))


def checked(folder, axis, time: str, reading: str, more: str = "") -> list[str]:
    """The faults of a recording.toml of log.csv, none where it is accepted."""
    (folder / "recording.toml").write_text(
        f'title = "a"\ndevice = "my_stage"\nkind = "series"\n[[record]]\nfile = "log.csv"\nrole = "fit"\n{time}\n[columns]\n'
        f'"drive.axis" = {{ column = "u", unit = "V" }}\n"reading.axis" = {{ column = {reading}, unit = "um"{more} }}\n'
    )
    try:
        load_recordings([folder], axis, hold_out=False)
    except InputError as error:
        return [fault.what for fault in error.faults]
    return []


def test_channels_whose_times_differ_are_used_apart_only(tmp_path, axis):
    clock = 'time = { column = "t_u", unit = "s" }'
    table_of(tmp_path, "t_u,u,t_x,x\n" + rows(",", T, U, T + 0.0123, X))
    assert any(
        "each have a time of their own, and these differ (u has t_u, x has t_x)" in f
        for f in checked(tmp_path, axis, clock, '"x"')
    )
    with pytest.raises(InputError, match="these differ"):
        propose([table_facts(read_table(tmp_path / "log.csv"))], axis)
    table_of(tmp_path, "t_u,u,t_x,x\n" + rows(",", T, U, T, X))
    assert checked(tmp_path, axis, clock, '"x"') == []


def test_a_header_of_a_multiple_of_a_unit_is_compared_and_proposed(tmp_path, axis):
    clock = 'time = { column = "Time", unit = "ms", scale = 0.1 }'
    table = table_of(tmp_path, "Time [0.1 ms],u,x [0.1 um]\n" + rows(",", 10 * np.arange(N), U, 10 * X))
    assert checked(tmp_path, axis, clock, '"x"') == [
        'log.csv says 0.1 um, recording.toml says um; write scale = 0.1, unit = "um"'
    ]
    assert checked(tmp_path, axis, clock, '"x"', ", scale = 0.1") == []
    text = recording_toml(propose([table_facts(table)], axis), tmp_path, "log")
    assert '"x [0.1 um]", unit = "um", scale = 0.1 }' in text and '"Time [0.1 ms]", unit = "ms", scale = 0.1 }' in text
    table_of(tmp_path, "Time [0.1 ms],u,x [nm x 10]\n" + rows(",", 10 * np.arange(N), U, 100 * X))
    assert any("write scale = 10 or scale = 0.1" in fault for fault in checked(tmp_path, axis, clock, '"x"'))


def test_columns_of_groups_of_different_length_are_refused_by_look(tmp_path, axis):
    np.savez(tmp_path / "log.npz", t=T, u=U, x=X[::2])
    with pytest.raises(InputError, match="different numbers of rows"):
        propose([table_facts(read_table(tmp_path / "log.npz"))], axis)


def test_numbers_that_begin_again_are_told_and_full_steps_are_not():
    position = np.cumsum(np.tile([700, 900, 800], 60))
    for size, values in ((65536, position), (65536, position - 30000), (360, position / 50.3)):
        again = wrapped((values + size / 2) % size - (size / 2 if values.min() < 0 else 0))
        assert again is not None and again.size == size
    assert wrapped(np.tile([-32768.0] * 9 + [32767.0] * 9, 4)) is None
    assert wrapped(position.astype(float)) is None
    assert wrapped(np.random.default_rng(0).integers(0, 65535, 300).astype(float)) is None


def test_a_clock_that_may_have_been_started_again_is_none_that_wrapped(tmp_path):
    table = table_of(tmp_path, lines("t (ms),u,x\n", lambda k: f"{(65500 + k) % 65536},{U[k]},{X[k]}"))
    assert "16 bits begins again before row 36" in " ".join(table.time("t (ms)", "ms").notes)
    table = table_of(tmp_path, "t (ms),u\n" + "".join(f"{k % 65536},{k}\n" for k in range(65560)))
    assert np.diff(table.time("t (ms)", "ms").values).min() < 0


def test_a_full_display_is_no_reading(tmp_path):
    x = [f"{99.9999 if k in (20, 21, 40) else X[k] / 1000:.4f}" for k in K]
    read = table_of(tmp_path, lines("t,x\n", lambda k: f"{T[k]},{x[k]}")).reading("x")
    assert np.flatnonzero(np.isnan(read.values)).tolist() == [20, 21, 40] and "far from all others" in read.notes[0]


def test_factors_beside_numbers_are_told(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name, values in (("t", T), ("u", U), ("x", X)):
            file[name] = values
        file["u"].attrs["gain"] = 0.001
        file["x"].attrs["ScaleFactor"] = 1.0
        file["x"].attrs["sampleScale"] = 0.5
    notes = read_table(tmp_path / "log.h5").notes
    assert [note[:30] for note in notes] == ["u: gain = 0.001 stands beside ", "x: sampleScale = 0.5 stands be"]


def test_numbers_of_a_sheet_are_not_read_with_the_comma_of_its_texts(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    for texts, asked in ((["0,5", "1,25", "3,125"], False), (["1,234", "2,345", "3,125"], True)):
        book = openpyxl.Workbook()
        for row in [["t", "u", "x"], *([12.345 + k, text, 1234.5] for k, text in enumerate(texts))]:
            book.active.append(row)
        book.save(tmp_path / "log.xlsx")
        if asked:
            with pytest.raises(InputError, match='decimal = ","'):
                read_table(tmp_path / "log.xlsx")
            continue
        table = read_table(tmp_path / "log.xlsx")
        assert table.numbers("t").tolist() == [12.345, 13.345, 14.345] and table.numbers("u").tolist() == [
            0.5,
            1.25,
            3.125,
        ]


def test_ordinary_names_are_not_taken_for_multiples_of_a_unit_or_for_times(tmp_path, axis):
    """A measuring range, a temperature and a voltage whose letters also mean a multiple, a time and microseconds."""
    table = table_of(tmp_path, "t (s),CH1 (10 V),CH2 [50 um]\n" + rows(",", T, U, X))
    assert [(c.scale, c.values.max()) for c in table_facts(table).columns[1:]] == [(1.0, max(U)), (1.0, max(X))]
    assert [scaled_unit(text) for text in ("100 ns", "0.25 um", "1e3 rpm")] == [
        (100.0, "ns"),
        (0.25, "um"),
        (1e3, "rpm"),
    ]
    assert [unit_of(text) for text in ("NM", "nm", "Us", "MV")] == [None, "nm", None, "mV"]
    table = table_of(tmp_path, "time (s),Us,T1 (um)\n" + rows(",", T, U, T))
    proposal = propose([table_facts(table)], axis)
    assert {m.signal: m.column for m in proposal.matches} == {"drive.axis": "Us", "reading.axis": "T1 (um)"}


def test_a_clock_goes_on_only_by_its_own_step_and_not_from_its_first_row():
    run = 500.0 * np.arange(1, 132)  # to 65500: begun again it would go on by 536
    again = np.tile(run, 2)
    assert unwrapped_clock(again - run[0], run[0])[1] == ""
    for late, told in ((100, True), (200, False)):  # a quarter of a step is 125
        clock = np.r_[40000.0 + 500 * np.arange(51), (65500 + late) % 65536 + 500 * np.arange(51)]
        values, note = unwrapped_clock(clock - clock[0], clock[0])
        assert bool(note) == told and (np.diff(values).min() > 0) == told


def test_whole_seconds_and_their_fraction_count_from_the_first_row(tmp_path):
    values = table_of(tmp_path, FILES["ROS 2"]).columns["time (stamp.sec + stamp.nanosec)"]
    assert values == pytest.approx(1e-3 * np.arange(N), abs=1e-9)
