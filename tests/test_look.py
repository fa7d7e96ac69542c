"""ctrlgen look: what files hold and what is odd; logs in the style of many loggers become a recording.toml that is accepted."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import AXIS_FILE, DEVICES

from ctrlgen import build_model, load_device
from ctrlgen.app.look_console import described, look, print_table
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.derived_drives import derived_drives
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.unit_texts import split_name, unit_of
from ctrlgen.recordings.look.column_facts import course_of, rests, table_facts
from ctrlgen.recordings.look.oddities import table_oddities
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.look.proposed_file import recording_toml
from ctrlgen.recordings.plausibility import early
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.settled_readings import settled

REST = 200  # rows that a rest must have to tell the noise
RATE = 1000.0
N = 1500
GAIN = 50.0  # um/V of the flexure axis


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(AXIS_FILE))


def motion(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], drive [V], reading [um] of something like the flexure axis."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / RATE
    u = np.repeat(rng.uniform(-1.0, 1.0, N // 50), 50)
    y = GAIN * np.convolve(u, np.exp(-np.arange(40) / 8) / 8, "full")[:N] + rng.normal(0, 0.01, N)
    return t, u, y


def rows(*columns: np.ndarray, separator: str = ",", form: str = "%.9f") -> str:
    return "\n".join(separator.join(form % v for v in row) for row in zip(*columns, strict=True)) + "\n"


def comma(text: str) -> str:
    return text.replace(".", ",")


T, U, Y = motion()
LOGS = {
    "spreadsheet": "time (s),drive (V),position (um)\n" + rows(T, U, Y),
    "german": "Zeit [s];Spannung [V];Weg [µm]\n" + comma(rows(T, U, Y, separator=";")),
    "milliseconds": "t_ms\tcmd_V\tfeedback_um\n" + rows(1e3 * T, U, Y, separator="\t"),
    "units below": "Time,Command,Actual\ns,V,mm\n" + rows(T, U, 1e-3 * Y),
    "hash header": "# t[s] u[V] y[nm]\n" + rows(T, U, 1e3 * Y, separator=" "),
    "block before": "Instrument: XY-7\nSerial: 42\nOperator: nobody\n\nTime [s],AO0 [V],LVDT [um],AI1 [degC]\n"
    + rows(T, U, Y, 22 + 0 * T),
    "readings first": "elapsed (s),sensor (um),set (V)\n" + rows(T, Y, U),
    "channel names": "time [s],drive.axis [V],reading.axis [um]\n" + rows(T, U, Y),
    "millivolts": "Time (ms),Ref (mV),Capacitive sensor (um)\n" + rows(1e3 * T, 1e3 * U, Y),
    "dates": "timestamp,drive (V),position (um)\n"
    + "\n".join(f"2026-03-01T10:00:{t:09.6f}Z,{u:.9f},{y:.9f}" for t, u, y in zip(T, U, Y, strict=True)),
    "picoscope": "Time,Channel A,Position\n(ms),(V),(um)\n\n" + rows(1e3 * T, U, Y),
    "many columns": "time [s],index,drive [V],force [N],position [um],velocity [um/s],temperature [degC]\n"
    + rows(T, np.arange(N), U, 10 * U, Y, np.gradient(Y, T), 22 + 0 * T),
}


@pytest.mark.long
@pytest.mark.parametrize("logger", LOGS)
def test_a_log_becomes_a_recording_without_an_edit(logger, axis, tmp_path):
    (tmp_path / "log.csv").write_text(LOGS[logger], encoding="utf-8")
    (written,) = described([tmp_path / "log.csv"], AXIS_FILE)
    recording = load_recordings([written], axis)
    u, y = (np.concatenate([getattr(r, name)[:, 0] for r in recording.records]) for name in ("drive", "observed"))
    assert np.allclose(u[: N // 2], U[: N // 2], atol=1e-6)
    seen = np.isfinite(y[: N // 2])
    assert seen.mean() > 0.9 and np.allclose(y[: N // 2][seen], 1e-6 * Y[: N // 2][seen], atol=2e-12)
    assert abs(recording.records[0].sample_time - 1 / RATE) < 1e-9


@pytest.mark.parametrize(
    ("text", "asks"),
    [
        ("t,u,y\n" + rows(T, U, Y), "drive.axis = column 'u': the file states no unit, V is assumed: -"),
        ("u [V],y [um]\n" + rows(U, Y), "no column is a time"),
        ("t [s],a [V],b [V],y [um]\n" + rows(T, U, U[::-1], Y), "could be column 'b [V]' as well"),
        ("t [s],u [V]\n" + rows(T, U), "no column was recognised as a reading"),
    ],
)
def test_what_a_log_does_not_say_is_asked_and_nothing_is_written(text, asks, tmp_path):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(InputError, match=re.escape(asks)):
        described([tmp_path / "log.csv"], AXIS_FILE)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_the_last_of_several_files_is_held_out_and_rests_give_the_noise(axis, tmp_path):
    for k in (1, 2):
        t, u, y = motion(k)
        u[:200], y[:200] = 0.0, np.random.default_rng(k).normal(0, 0.01, 200)
        (tmp_path / f"{k}.csv").write_text("time (s),drive (V),position (um)\n" + rows(t, u, y))
    (written,) = described([tmp_path / "1.csv", tmp_path / "2.csv"], AXIS_FILE)
    assert [r.role for r in load_recordings([written], axis).records] == ["fit", "rest", "hold_out", "rest"]
    with pytest.raises(InputError, match="describes this file already"):
        described([tmp_path / "1.csv"], AXIS_FILE)


def test_a_unit_that_cannot_be_is_told_with_the_one_that_can(axis, tmp_path):
    (tmp_path / "log.csv").write_text("time (s),drive (V),position (m)\n" + rows(T, U, Y))
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], axis)
    assert len(proposal.remarks) == 1 and 'if its numbers are in um, write unit = "um"' in proposal.remarks[0]
    (tmp_path / "good.csv").write_text("time (s),drive (V),position (um)\n" + rows(T, U, Y))
    assert not propose([table_facts(read_table(tmp_path / "good.csv"))], axis).remarks


def test_a_reading_before_its_drive_is_told():
    _, u, y = motion(3)
    assert early(u, y) is None
    assert early(np.roll(u, 7), y) == 7


def test_files_of_one_bench_are_alike_between_samples(axis, tmp_path):
    """A smooth drive does not tell; one that steps does, for the other too."""
    t = 1e-3 * np.arange(1000)
    drives = {"fit": np.repeat(np.random.default_rng(0).normal(size=100), 10), "held_out": np.sin(6 * t)}
    for name, drive in drives.items():
        rows = "".join(f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in zip(t, drive, 40 * drive, strict=True))
        (tmp_path / f"{name}.csv").write_text("time [s],drive [V],position [um]\n" + rows)
    tables = {name: table_facts(read_table(tmp_path / f"{name}.csv")) for name in drives}
    both = recording_toml(propose([tables["fit"], tables["held_out"]], axis), tmp_path, "t")
    assert both.count('between_samples = "held"') == 2 and "linear" not in both
    alone = recording_toml(propose([tables["held_out"]], axis), tmp_path, "t")
    assert 'between_samples = "unstated" # every drive is a smooth curve' in alone


@pytest.mark.parametrize(
    "others, taken",
    [
        (("motor_temp [degC]",), "motor_temp [degC]"),
        (("motor_temp [degC]", "T_room [degC]"), "T_room [degC]"),
        (("motor_temp [degC]", "magnet_temp [degC]"), None),
        (("pressure [Pa]",), None),
    ],
)
def test_a_temperature_beside_the_signals_is_that_of_the_surroundings(axis, tmp_path, others, taken):
    """Where one column alone can be it; laws of temperature are offered only where the recording names it."""
    t = 1e-3 * np.arange(500)
    rows = "".join(f"{a:.3f},{np.sin(6 * a):.6f},{40 * np.sin(6 * a):.6f}{f',{21 + a}' * len(others)}\n" for a in t)
    (tmp_path / "log.csv").write_text(",".join(["time [s]", "drive [V]", "position [um]", *others]) + "\n" + rows)
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], axis)
    assert proposal.ambient == taken and set(proposal.left) == set(others) - {taken}
    text = recording_toml(proposal, tmp_path, "t")
    assert ("ambient" in text) == (taken is not None)
    if taken is not None:
        (tmp_path / "recording.toml").write_text(text)
        assert load_recordings(tmp_path / "recording.toml", axis, hold_out=False).records[0].ambient[
            0
        ] == pytest.approx(294.15)


def test_speeds_that_nobody_recorded_are_taken_from_the_position(tmp_path):
    """Of an imposed motion; check says how, where a recording.toml lacks them."""
    made = ctrlgen("new", "device", tmp_path / "pull.toml", "--kind", "tested-axis", "--no-ask")
    assert made.returncode == 0, made.stderr
    model, t = build_model(load_device(tmp_path / "pull.toml")), 1e-3 * np.arange(1000)
    rows = "".join(f"{a:.3f},{np.sin(6 * a):.6f},{3 * np.sin(6 * a):.6f}\n" for a in t)
    (tmp_path / "log.csv").write_text("time [s],position [mm],force [N]\n" + rows)
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], model)
    assert proposal.certain and set(proposal.derived) == {"drive.velocity", "drive.acceleration"}
    text = recording_toml(proposal, tmp_path, "t")
    (tmp_path / "recording.toml").write_text(text)
    speed = load_recordings(tmp_path / "recording.toml", model, hold_out=False).records[0].drive[500, 1]
    assert speed == pytest.approx(6e-3 * np.cos(3), rel=1e-3)
    (tmp_path / "recording.toml").write_text(text.partition("[derivatives]")[0])
    with pytest.raises(InputError, match=r'\[derivatives\] "drive.velocity" = \{ of = "drive.position", order = 1 \}'):
        load_recordings(tmp_path / "recording.toml", model)


@pytest.mark.parametrize(
    "missing, recorded, of",
    [
        ("drive.acceleration", ["drive.position", "drive.velocity"], ("drive.velocity", 1)),
        ("drive.position", ["drive.velocity"], ("drive.velocity", -1)),
        ("drive.q1_velocity", ["drive.q1_position", "drive.q2_position"], ("drive.q1_position", 1)),
        ("drive.position", ["drive.acceleration"], None),
        ("reading.velocity", ["reading.position"], None),
        ("drive.axis", ["drive.position"], None),
    ],
)
def test_what_is_a_derivative_of_what(missing, recorded, of):
    assert derived_drives([missing], recorded).get(missing) == of


@pytest.mark.long
def test_new_recording_writes_what_look_proposes(tmp_path):
    t = 1e-3 * np.arange(1000)
    rows = "".join(f"{a:.3f},{np.sin(6 * a):.6f},{40 * np.sin(6 * a):.6f}\n" for a in t)
    (tmp_path / "log.csv").write_text("time [s],drive [V],position [um]\n" + rows)
    made = ctrlgen("new", "recording", tmp_path / "log.csv", "--device", AXIS_FILE)
    assert made.returncode == 0, made.stderr
    assert ctrlgen("check", tmp_path / "recording.toml", "--device", AXIS_FILE).returncode == 0
    again = ctrlgen("new", "recording", tmp_path / "log.csv", "--device", AXIS_FILE)
    assert again.returncode == 1 and "exists" in again.stderr


def test_a_log_of_one_row_says_so(tmp_path):
    (tmp_path / "log.csv").write_text("time [s],drive [V]\n0,1\n")
    with pytest.raises(InputError, match="single row of numbers, line 2; is the file complete"):
        read_table(tmp_path / "log.csv")


def test_steps_are_told_from_curves_and_from_what_is_neither():
    t = np.arange(3000) / RATE
    assert course_of(np.sin(2 * np.pi * 3 * t)) == "curve"
    assert course_of(np.abs((5 * t) % 2 - 1)) == "curve"  # a triangle has corners
    assert course_of(np.repeat(np.sin(2 * np.pi * 3 * t[:300]), 10)) == "steps"
    assert course_of(np.random.default_rng(0).normal(size=3000)) == "rough"


def test_oddities_of_columns(tmp_path):
    t, u, y = motion(4)
    clipped = np.clip(20 * np.sin(2 * np.pi * 5 * t) + 0.01 * y, -15.0, 15.0)
    t[700] = t[699]
    (tmp_path / "log.csv").write_text("t [s],u [V],y [um],same [um],still [V]\n" + rows(t, u, clipped, clipped, 0 * t))
    said = " ".join(table_oddities(table_facts(read_table(tmp_path / "log.csv"))))
    for what in (
        "1 row is not later",
        "y [um]: stands at its end 15",
        "same [um]: is the same as y [um]",
        "still [V]",
    ):
        assert what in said


def test_rests_are_where_no_drive_moves():
    drive = np.zeros((600, 2))
    drive[150:300, 0] = np.linspace(0, 1, 150)
    drive[300:, 0] = 1.0
    drive[450:, 1] = np.linspace(0, 1, 150)
    assert rests(drive) == [(0, 151), (299, 451)]


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.3, 0.5, 0.65, 0.8, 1.0, 1.5, 3.0, 10.0])  # counts
@pytest.mark.parametrize("size", [1.0, 0.618, 1e-9])
@pytest.mark.parametrize("zero", [0.0, 0.3, 0.5])
def test_a_rest_that_is_read_in_counts_is_one(noise, size, zero):
    rng = np.random.default_rng(8)
    counts = np.round(zero + noise * rng.standard_normal(1000))
    assert settled(size * counts[:, None], 0, 1000, REST) == 0
    swing = np.round(zero + noise * rng.standard_normal(1000) + 60 * max(noise, 1) * np.exp(-np.arange(1000) / 60))
    begin = settled(size * swing[:, None], 0, 1000, REST)
    assert begin is not None and 100 <= begin <= 400


def test_a_drive_that_stands_still_is_no_rest_while_a_reading_moves():
    """What settles is left out of the rest; what still moves at its end, or has too few rows left, is no rest: a tank that fills."""
    t, noise = np.arange(600.0), np.random.default_rng(0).normal(0, 1, 600)
    assert settled(noise[:, None], 0, 600, REST) == 0
    swing = 300 * np.exp(-t / 30) * np.cos(t / 9) + noise
    assert 100 <= settled(np.column_stack([noise, swing]), 0, 600, REST) <= 250
    assert settled((100 * np.exp(-t / 300) + noise)[:, None], 0, 600, REST) is None
    assert settled(noise[:, None], 450, 600, REST) is None


@pytest.mark.parametrize("glitch", [0, 2, 7, 40, 4000])  # counts
@pytest.mark.parametrize("size", [1.0, 0.618, 1e-9])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_a_glitch_at_its_end_makes_no_rest_of_what_settles(glitch, size, noise):
    t, rng = np.arange(600.0), np.random.default_rng(4)
    y = np.round(30 * np.exp(-t / 60) + noise * rng.standard_normal(600))
    y[300:] = 0
    y[550] = glitch
    begin = settled(size * y[:, None], 0, 600, REST)
    assert begin is not None and 120 <= begin <= 300


def test_a_rest_of_the_drive_in_which_the_reading_settles_is_fitted(axis, tmp_path):
    t, u, y = motion(1)
    u[-300:], y[-300:] = 1.0, 50 * np.exp(-np.arange(300) / 200)
    (tmp_path / "log.csv").write_text("time (s),drive (V),position (um)\n" + rows(t, u, y))
    (written,) = described([tmp_path / "log.csv"], AXIS_FILE)
    assert [(r.role, len(r.time)) for r in load_recordings([written], axis).records if r.role == "rest"] == []


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("speed rad/s", "rad/s"),
        ("omega / rad/s", "rad/s"),
        ("v mm/s", "mm/s"),
        ("a (m/s2)", "m/s^2"),
        ("M [Nm]", "N*m"),
        ("U / mV", "mV"),
    ],
)
def test_a_unit_behind_a_name_may_have_a_stroke_of_its_own(name, unit):
    stated = split_name(name)[1] or ""
    assert unit_of(stated) == unit


def test_speeds_and_accelerations_are_told_by_the_end_of_their_names(tmp_path):
    (tmp_path / "log.csv").write_text("time_s,q_rad,qd_rad_s,qdd_rad_s2,v_mm_s\n" + rows(T, U, U, U, Y))
    units = {c.name: c.unit for c in table_facts(read_table(tmp_path / "log.csv")).columns}
    assert list(units.values())[1:] == ["rad", "rad/s", "rad/s^2", "mm/s"]


def test_six_drives_are_told_apart_by_their_names(tmp_path):
    model = build_model(load_device(DEVICES / "mems_hexapod.toml"))
    names = ["1X", "1Y", "2X", "2Y", "3X", "3Y"]
    channels = ["delta_x", "delta_y", "delta_z", "theta_x", "theta_y", "theta_z"]
    readings = [f"{c} [{'um' if c.startswith('d') else 'urad'}]" for c in channels]
    head = ",".join(["t [s]", *readings, *(f"heater {n} [W]" for n in reversed(names))])
    rng = np.random.default_rng(1)
    values = rows(T, *(rng.normal(size=N) for _ in channels), *(rng.uniform(0, 0.5, N) for _ in names))
    (tmp_path / "log.csv").write_text(f"{head}\n{values}")
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], model)
    assert proposal.certain, proposal.asked
    assert {m.signal: m.column for m in proposal.matches} == {
        **{f"drive.{n}": f"heater {n} [W]" for n in names},
        **{f"reading.{c}": column for c, column in zip(channels, readings, strict=True)},
    }


@pytest.mark.long
def test_the_command_draws_prints_and_writes(tmp_path):
    log, to, figure = tmp_path / "log.csv", tmp_path / "recording.toml", tmp_path / "log.png"
    log.write_text(LOGS["spreadsheet"])
    done = ctrlgen("look", log, "--device", AXIS_FILE, "--to", to, "--figure", figure)
    assert done.returncode == 0, done.stderr
    assert f"{N} rows, 1000 Hz" in done.stdout and figure.stat().st_size > 1000
    assert ctrlgen("check", to, "--device", AXIS_FILE).returncode == 0
    with pytest.raises(InputError, match="exists"):
        look([Path(log)], AXIS_FILE, to, None)


def test_names_of_columns_are_no_lines_of_the_file(axis, tmp_path):
    """A name may hold what TOML reads as the end of a comment or of a string."""
    table = {"t": T.tolist(), "drive": U.tolist(), "position": Y.tolist(), 'x\n[evil]\r"\x00': (2 * Y).tolist()}
    (tmp_path / "log.json").write_text(json.dumps(table))
    proposal = propose([table_facts(read_table(tmp_path / "log.json"))], axis)
    read = tomllib.loads(recording_toml(proposal, tmp_path, 'a "title"\n[x]'))
    assert set(read) == {"format", "title", "device", "kind", "record", "columns"}
    assert read["columns"]["drive.axis"]["column"] == "drive"


@pytest.mark.parametrize("lost", [(), (700,), (10, 11, 12, 700, 1200)])
def test_rows_that_are_missing_last_too(tmp_path, capsys, lost):
    """A log of 1500 rows at 1 kHz lasts 1.5 s, however many of them the logger lost."""
    kept = np.setdiff1d(np.arange(N), lost)
    (tmp_path / "log.csv").write_text("time [s],u [V],x [um]\n" + rows(T[kept], U[kept], Y[kept]))
    print_table(table_facts(read_table(tmp_path / "log.csv")))
    first = capsys.readouterr().out.partition("\n")[0]
    assert f"{N - len(lost)} rows, 1000 Hz, 1.5 s" in first
