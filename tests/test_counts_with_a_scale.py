"""Counts of a converter or an interferometer: the factor that a file states beside them, and that which the user states."""

from __future__ import annotations

import re
import shlex
import tomllib

import numpy as np
import pytest
from conftest import AXIS_FILE

from ctrlgen import build_model, load_device
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import Answers, read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import Proposal, propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.reader import load_recordings

N = 900
T = 1e-3 * np.arange(N)
U = np.repeat(np.random.default_rng(5).uniform(-2, 2, N // 20), 20)
X = 50 * np.convolve(U, np.exp(-np.arange(40) / 8) / 8, "full")[:N]


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(AXIS_FILE))


def stated(*units: str, columns: tuple[str, ...] = (), rate: str | None = None) -> Answers:
    return read_answers(None, None, columns, units, None, rate, False)


def seen_of(path, axis, answers: Answers) -> Proposal:
    return propose([table_facts(read_table(path, None, answers.layout), answers)], axis, answers)


def hdf5(path, columns: dict[str, tuple[np.ndarray, dict]]) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: HDF5 was not read")
    with h5py.File(path, "w") as file:
        file.attrs["sample_rate"] = 1000.0
        for name, (values, attributes) in columns.items():
            file.create_dataset(name, data=values).attrs.update(attributes)


def tdms(path, columns: dict[str, tuple[np.ndarray, dict]]) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed: TDMS was not read")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("log", name, values, {"wf_increment": 1e-3, **given})
                for name, (values, given) in columns.items()
            ]
        )


@pytest.mark.parametrize(
    "write, ending, prefix, unit", [(hdf5, "h5", "", "units"), (tdms, "tdms", "log/", "unit_string")]
)
@pytest.mark.parametrize("kind", ["i2", "i4", "u4"])
@pytest.mark.parametrize(
    "key, scale", [("scale", 0.0098), ("Scaling", 2.5e-3), ("scale_um", 0.01234567891), ("LSB", 7.0)]
)
def test_the_factor_beside_counts_is_proposed_and_asked(tmp_path, axis, write, ending, prefix, unit, kind, key, scale):
    lowest = -200.0 if kind != "u4" else 0.0
    counts = np.round(X / scale - (X.min() / scale if kind == "u4" else 0.0)).astype(kind) if scale < 1 else None
    counts = np.round(np.linspace(lowest, 200, N)).astype(kind) if counts is None else counts
    path = tmp_path / f"a.{ending}"
    write(path, {"drive": (U, {unit: "V"}), "position": (counts, {key: scale, unit: "um"})})
    answers = stated(rate="1 kHz") if ending == "h5" else stated()
    seen = seen_of(path, axis, answers)
    match = next(m for m in seen.matches if m.signal == "reading.axis")
    assert match.scale == scale and not seen.certain and f"{scale:.12g}" in match.why[-1]
    option = re.search(r"\((--column reading.*)\)$", next(a for a in seen.asked if "reading" in a))[1]
    words = shlex.split(option)
    again = seen_of(path, axis, stated(*words[3::4], columns=tuple(words[1::4]), rate=answers.rate))
    assert again.certain, again.asked
    (tmp_path / "recording.toml").write_text(recording_toml(again, tmp_path, "r"))
    written = tomllib.loads((tmp_path / "recording.toml").read_text())
    column = {"column": f"{prefix}position", "unit": "um", "scale": scale}
    assert written["columns"]["reading.axis"] == column
    read = load_recordings([tmp_path / "recording.toml"], axis).records
    y = np.concatenate([r.observed[:, 0] for r in read])
    np.testing.assert_allclose(y[np.isfinite(y)].max(), 1e-6 * scale * counts.max(), rtol=1e-9)


@pytest.mark.parametrize(
    "values, attributes",
    [
        (X, {"scale": 0.01}),  # floats: they may hold it already
        (np.round(X / 0.01).astype(int), {"scale": 1.0}),
        (10 * np.round(X).astype(int), {"scale": 10.0}),  # tens alone: they hold it
        (np.round(X / 0.01).astype(int), {"gain": 0.01}),  # multiplies or divides
        (np.round(X / 0.01).astype(int), {"scale": 0.01, "slope": 0.02}),  # which of them
        (np.round(X / 0.01).astype(int), {"scale": 0.0}),
        (np.round(X / 0.01).astype(int), {"scale": float("nan")}),
        (np.round(X / 0.01).astype(int), {"scale": "metric"}),
    ],
)
def test_other_factors_are_told_alone(tmp_path, values, attributes):
    hdf5(tmp_path / "a.h5", {"x": (values, {"units": "um", **attributes})})
    assert table_facts(read_table(tmp_path / "a.h5")).column("x").scale == 1.0


@pytest.mark.parametrize("write, ending, x", [(hdf5, "h5", "x"), (tdms, "tdms", "log/x")])
@pytest.mark.parametrize(
    "key",
    [
        "scale",
        "Scaling",
        "scaleFactor",
        "ScaleFactor",
        "scale-um",
        "x.scale",
        "lsb",
        "LSB",
        "LSB_um",
        "resolution",
        "adcResolution",
        "slope",
    ],
)
def test_a_factor_that_is_proposed_is_told_to_who_writes_the_file_by_hand(tmp_path, write, ending, x, key):
    path = tmp_path / f"a.{ending}"
    write(path, {"x": (np.round(X / 0.01).astype("i4"), {key: 0.01})})
    table = read_table(path)
    assert table.scales == {x: 0.01}
    assert [f"{x}: {key} = 0.01 stands beside it and is not applied" in note for note in table.notes].count(True) == 1


@pytest.mark.parametrize("write, ending", [(hdf5, "h5"), (tdms, "tdms")])
@pytest.mark.parametrize(
    "key",
    [
        "resolution_bits",
        "ADCResolutionBits",
        "bitResolution",
        "full_scale",
        "FullScale",
        "scale_range",
        "scales",
        "autoscale",
    ],
)
def test_a_number_of_bits_or_a_range_is_no_factor(tmp_path, write, ending, key):
    path = tmp_path / f"a.{ending}"
    write(path, {"x": (np.round(X / 0.01).astype("i4"), {key: 16})})
    table = read_table(path)
    assert not table.scales and not any("stands beside it" in note for note in table.notes)


def test_a_factor_of_the_cf_conventions_is_applied_once(tmp_path):
    hdf5(tmp_path / "a.h5", {"x": (np.round(X / 0.01).astype(int), {"units": "um", "scale_factor": 0.01})})
    column = table_facts(read_table(tmp_path / "a.h5")).column("x")
    assert column.scale == 1.0 and np.abs(column.values - X).max() <= 0.005 + 1e-12


@pytest.mark.parametrize("unit", ["0.6 nm", "-0.6nm", "6e-4um", ".6nm", "0.6*nm"])
@pytest.mark.parametrize("by", ["reading.axis", "counts"])
def test_a_unit_may_be_so_many_of_another(tmp_path, axis, unit, by):
    counts = np.round(X / 6e-4)
    table = np.column_stack([T, U, counts])
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t [s],drive [V],counts", comments="", fmt="%.9g")
    seen = seen_of(tmp_path / "log.csv", axis, stated(f"{by}={unit}", columns=("reading.axis=counts",)))
    assert seen.certain, seen.asked
    match = next(m for m in seen.matches if m.signal == "reading.axis")
    per_count = match.scale * {"nm": 1e-3, "um": 1.0}[match.unit]
    assert per_count == pytest.approx(-6e-4 if unit.startswith("-") else 6e-4)
    (tmp_path / "recording.toml").write_text(recording_toml(seen, tmp_path, "r"))
    read = load_recordings([tmp_path / "recording.toml"], axis).records
    assert np.nanmax(np.abs(read[0].observed)) == pytest.approx(1e-6 * np.abs(6e-4 * counts).max(), rel=0.2)


@pytest.mark.parametrize(
    "unit", ["0 nm", "3 knorks", "nm 3", "1e999 nm", "0.5", "3", "1e-3", "-.5", "2 1/min", "2/min"]
)
def test_a_multiple_that_is_none_is_told_as_it_was_typed(unit):
    with pytest.raises(InputError) as raised:
        stated(f"reading.axis={unit}")
    (fault,) = raised.value.faults
    assert fault.where == unit


@pytest.mark.parametrize("unit", ["1/min", "1/s", "1/rad", "1 /min", "1/s^2", "rad/s", "1", "%", "\u00b0", "\u00b5m"])
def test_a_unit_that_begins_with_a_one_is_no_multiple(unit):
    answers = stated(f"x={unit}")
    assert answers.units == {"x": unit} and not answers.scales
    if not unit.startswith("1"):
        answers = stated(f"x=2.5e-1{unit}")
        assert answers.units == {"x": unit} and answers.scales == {"x": 0.25}


@pytest.mark.parametrize("key", ["scale", "lsb"])
def test_a_unit_that_is_stated_is_that_of_one_count_whether_for_the_signal_or_its_column(tmp_path, axis, key):
    counts = np.round(X / 6e-4).astype("i4")
    hdf5(tmp_path / "a.h5", {"drive": (U, {"unit": "V"}), "position": (counts, {"unit": "nm", key: 0.6})})
    for unit, scale in (("nm", 1.0), ("0.5 nm", 0.5), ("um", 1.0), ("-2e-4 um", -2e-4)):
        for name in ("position", "reading.axis"):
            seen = seen_of(tmp_path / "a.h5", axis, stated(f"{name}={unit}", rate="1 kHz"))
            match = next(m for m in seen.matches if m.signal == "reading.axis")
            assert seen.certain and (match.scale, match.unit) == (scale, unit.split()[-1])


@pytest.mark.parametrize("key", ["scale", "lsb", "scaleFactor"])
@pytest.mark.parametrize("unit", [{}, {"unit": "um"}])
def test_a_factor_is_never_assumed_unsaid(tmp_path, axis, key, unit):
    """Of a column with a unit or none, and of the time."""
    counts = np.round(X / 6e-4).astype("i4")
    columns = {
        "time": (np.arange(N), {"unit": "s", key: 1e-3}),
        "drive": (U, {"unit": "V"}),
        "position": (counts, {key: 6e-4, **unit}),
    }
    hdf5(tmp_path / "a.h5", columns)
    seen = seen_of(tmp_path / "a.h5", axis, stated())
    text = recording_toml(seen, tmp_path, "r")
    lines = [line for line in text.splitlines() if "scale = " in line]
    assert not seen.certain
    for line, factor in zip(lines, ("0.001", "0.0006"), strict=True):
        assert f"# its whole numbers lack {factor}" in line or f"; its whole numbers lack {factor}" in line
    assert ("the file states no unit, um is assumed" in lines[-1]) == (not unit)
    told = seen_of(tmp_path / "a.h5", axis, stated("time=0.001 s", "position=0.0006 um"))
    assert told.certain and "whole numbers lack" not in recording_toml(told, tmp_path, "r")
    columns["time"] = (np.arange(N)[::-1].copy(), {"unit": "s", key: 1e-3})
    hdf5(tmp_path / "b.h5", columns)
    text = recording_toml(seen_of(tmp_path / "b.h5", axis, stated()), tmp_path, "r")
    assert "# its whole numbers lack 0.001, which stands beside them and is assumed; falls" in text


def test_the_rate_that_a_file_states_is_the_one_that_is_written(tmp_path, axis):
    hdf5(tmp_path / "a.h5", {"drive": (U, {"units": "V"}), "position": (X, {"units": "um"})})
    text = recording_toml(seen_of(tmp_path / "a.h5", axis, stated()), tmp_path, "r")
    assert "sample_rate = \"1000 Hz\" # assumed: the file says 'sample_rate = 1000'" in text


@pytest.mark.parametrize("unit, size", [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("min", 60.0), ("h", 3600.0)])
@pytest.mark.parametrize("step", [1e-3, 3e-3, 1 / 3, 7.0])
@pytest.mark.parametrize("parts", [50.4, 70.3, 333.4])  # of a step, to which it is rounded
def test_the_rate_of_a_rounded_clock(tmp_path, unit, size, step, parts):
    t = step * np.arange(1000) / size
    grain = step / size / parts
    rows = "".join(f"{v:.12g},{k % 7}\n" for k, v in enumerate(np.round(t / grain) * grain))
    (tmp_path / "log.csv").write_text(f"time [{unit}],x [um]\n{rows}")
    assert table_facts(read_table(tmp_path / "log.csv")).time.step == pytest.approx(step, rel=2e-5)


@pytest.mark.parametrize(
    "cells",
    [
        ("INF", "WDR"),  # the state of a pump
        ("INF", "INF"),
        ("", "acknowledged"),
        ("", "", "", "0x41"),
        ("0x41", "0x41"),
        ("lost", "home", "bad"),
    ],
)
def test_a_column_without_any_number_is_text(tmp_path, axis, cells):
    rows = "".join(
        f"{t:.3f},{u:.6f},{x:.6f},{cells[k % len(cells)]}\n" for k, (t, u, x) in enumerate(zip(T, U, X, strict=True))
    )
    (tmp_path / "log.csv").write_text("t [s],drive [V],position [um],state\n" + rows)
    seen = seen_of(tmp_path / "log.csv", axis, stated())
    assert seen.certain and not any(c.question for c in seen.tables[0].columns)


@pytest.mark.parametrize(
    "cell, why",
    [("0x41", "hexadecimal"), ("=A1+B1", "never calculated"), ("(12.5)", "in brackets"), ("24+5", "run into")],
)
@pytest.mark.parametrize("gaps", [False, True])
def test_one_text_in_every_row_is_refused_with_its_reason_where_it_is_named(tmp_path, axis, cell, why, gaps):
    rows = "".join(f"{t:.3f},{u:.6f},{'' if gaps and t < 0.01 else cell}\n" for t, u in zip(T, U, strict=True))
    (tmp_path / "log.csv").write_text("t [s],drive [V],position [um]\n" + rows)
    for answers in (stated(columns=("reading.axis=position",)), stated(columns=("reading.axis=2",))):
        with pytest.raises(InputError, match=f"line {12 if gaps else 2} '{re.escape(cell)}'.*{why}"):
            seen_of(tmp_path / "log.csv", axis, answers)


@pytest.mark.parametrize("every", [2, 5, 20])
def test_a_drive_that_is_logged_at_a_lower_rate_is_held_and_told(tmp_path, axis, every):
    u = np.repeat(np.random.default_rng(5).uniform(-2, 2, N // every), every)
    rows = "".join(
        f"{t:.3f},{v if k % every == 0 else ''},{x:.6f}\n" for k, (t, v, x) in enumerate(zip(T, u, X, strict=True))
    )
    (tmp_path / "log.csv").write_text("t [s],drive [V],position [um]\n" + rows)
    text = recording_toml(seen_of(tmp_path / "log.csv", axis, stated()), tmp_path, "r")
    assert f'gap = "held" # assumed: one row in {every} states' in text
    (tmp_path / "recording.toml").write_text(text)
    (read,) = (r for r in load_recordings([tmp_path / "recording.toml"], axis).records if r.role == "fit")
    n = len(read.time)
    np.testing.assert_allclose(read.drive[:, 0], u[:n], rtol=1e-9)
    assert n > N // 2 and read.valid.mean() > 0.9
    plain = text.replace('gap = "held"', "")
    (tmp_path / "recording.toml").write_text(plain)
    if every > 2:  # every other row may be as smooth as it looks
        with pytest.raises(InputError, match='write gap = "held" or "linear"'):
            load_recordings([tmp_path / "recording.toml"], axis)
