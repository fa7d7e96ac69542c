"""Every question that ctrlgen look asks has an option that answers it; what is written then is accepted."""

from __future__ import annotations

import re
import shlex
import tomllib

import numpy as np
import pytest
from conftest import AXIS_FILE, RECORDINGS

from ctrlgen import build_model, load_device
from ctrlgen.app.look_console import described, look
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import Answers, layout_option, read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.reader import load_recordings

INPUTS = RECORDINGS.parent / "inputs"
N = 600


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(AXIS_FILE))


def options(*words: str) -> Answers:
    """The answers of a command line, as its options would be read."""
    given = {"table": None, "layout": None, "column": [], "unit": [], "time": None, "rate": None, "poses": False}
    words = list(words)
    while words:
        key = words.pop(0).removeprefix("--")
        if key == "poses":
            given[key] = True
        elif isinstance(given[key], list):
            given[key].append(words.pop(0))
        else:
            given[key] = words.pop(0)
    return read_answers(*given.values())


def log(folder, head: str, *columns) -> None:
    rows = "\n".join(",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))
    (folder / "log.csv").write_text(f"{head}\n{rows}\n")


T = 1e-3 * np.arange(N)
U = np.repeat(np.random.default_rng(2).uniform(-1, 1, N // 20), 20)
LOGS = {  # head, columns, what answers every question
    "no unit": ("t,u,y", (T, U, 50 * U), "--unit u=V --column reading.axis=y --unit reading.axis=um"),
    "two drives": ("t [s],a [V],b [V],y [um]", (T, U, U[::-1], 50 * U), "--column drive.axis='a [V]'"),
    "no drive": ("t [s],temp,y [um]", (T, U, 50 * U), "--column drive.axis=temp --unit drive.axis=V"),
    "no reading": ("t [s],drive [V],torque", (T, U, 50 * U), "--column reading.axis=torque --unit reading.axis=um"),
    "no time": ("drive [V],position [um]", (U, 50 * U), "--rate 2kHz"),
    "poses": ("drive [V],position [um]", (U, 50 * U), "--poses"),
    "odd time": ("k,drive [V],position [um]", (1e3 * T, U, 50 * U), "--time k --unit k=ms"),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_question_is_answered_on_the_command_line(name, axis, tmp_path):
    head, columns, words = LOGS[name]
    log(tmp_path, head, *columns)
    facts = table_facts(read_table(tmp_path / "log.csv"))
    assert propose([facts], axis).asked
    answers = options(*shlex.split(words))
    look([tmp_path / "log.csv"], AXIS_FILE, tmp_path / "recording.toml", None, answers)
    text = (tmp_path / "recording.toml").read_text()
    assert "to be answered" not in text
    recording = load_recordings([tmp_path / "recording.toml"], axis)
    drive = np.concatenate([r.drive[:, 0] for r in recording.records])
    assert np.allclose(drive[: N // 2], U[: N // 2], atol=1e-6)
    step = {"no time": 5e-4, "poses": np.inf}.get(name, 1e-3)
    assert recording.records[0].sample_time == pytest.approx(step)


def test_a_question_names_the_option_that_takes_its_answer_as_assumed(axis, tmp_path):
    log(tmp_path, "t,u,y", T, U, 50 * U)
    facts = table_facts(read_table(tmp_path / "log.csv"))
    asked = propose([facts], axis).asked
    words = [word for question in asked for word in shlex.split(question[question.rindex("(") + 1 : -1])]
    assert words and propose([facts], axis, options(*words)).certain


def test_one_of_several_tables_is_chosen_and_a_decimal_comma_is_stated(axis, tmp_path):
    sheet = "\n".join(f"{t:.3f};{u:.3f}".replace(".", ",") for t, u in zip(T, U, strict=True))
    (tmp_path / "log.csv").write_text("t [s];drive [V]\n" + sheet + "\n")
    table = read_table(tmp_path / "log.csv", None, options("--layout", 'decimal = ","').layout)
    assert table_facts(table).column("drive [V]").finite == pytest.approx(U, abs=1e-3)
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for name, factor in (("first", 1.0), ("second", 2.0)):
        page = book.create_sheet(name)
        page.append(["t [s]", "drive [V]", "position [um]"])
        for t, u in zip(T, U, strict=True):
            page.append([float(t), float(u), float(50 * factor * u)])
    del book["Sheet"]
    book.save(tmp_path / "log.xlsx")
    with pytest.raises(InputError, match="ctrlgen look: --table 1"):
        look([tmp_path / "log.xlsx"], AXIS_FILE, None, None)
    look([tmp_path / "log.xlsx"], AXIS_FILE, tmp_path / "recording.toml", None, options("--table", "second"))
    read = load_recordings([tmp_path / "recording.toml"], axis).records[0]
    assert read.observed[5, 0] == pytest.approx(1e-4 * U[5])


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("--column", "drive.axes=u"), "is no signal of"),
        (("--column", "drive.axis=v"), "no column"),
        (("--column", "drive.axis=u", "--unit", "drive.axis=m"), "or a multiple of it"),
        (("--unit", "u"), "NAME=VALUE"),
        (("--unit", "u=furlongpermile"), "not a unit"),
        (("--rate", "0 Hz"), "above zero"),
        (("--rate", "1 kHz", "--poses"), "one of"),
        (("--layout", "decimal = "), "no list of keys"),
        (("--layout", "decimel = 1"), "decimel"),
        (("--time", "u"), "does not rise"),
    ],
)
def test_an_answer_that_is_none_is_refused(words, what, axis, tmp_path):
    log(tmp_path, "t,u,y", T, U, 50 * U)
    with pytest.raises(InputError, match=what):
        answers = options(*words)
        propose([table_facts(read_table(tmp_path / "log.csv"), answers)], axis, answers)


@pytest.mark.long
@pytest.mark.skipif(not INPUTS.is_dir(), reason="the inputs stand beside the repository, or nowhere")
def test_every_question_about_the_inputs_has_an_answer(tmp_path):
    """As their recording.toml says; what cannot be read at all asks nothing."""
    answered = 0
    for file in sorted(INPUTS.glob("*/recording.toml")):
        written = tomllib.loads(file.read_text())
        record = written["record"][0]
        path = file.parent / record["file"]
        try:
            table = read_table(path)
        except InputError:
            continue
        words = ["--time", str(record["time"]["column"])] if "time" in record else ["--rate", record["sample_rate"]]
        for signal, column in written["columns"].items():
            words += ["--column", f"{signal}={column['column']}"]
            words += (
                ["--unit", f"{signal}={column['unit']}"] if not table.units.get(table.find(column["column"])) else []
            )
        if (
            "time" in record
            and isinstance(record["time"]["column"], str)
            and not table.units.get(table.find(record["time"]["column"]))
        ):
            words += ["--unit", f"{table.find(record['time']['column'])}={record['time']['unit']}"]
        if not any(name.startswith("reading.") for name in written["columns"]):
            continue
        to = tmp_path / f"{file.parent.name}.toml"
        look([path], INPUTS / "stage.toml", to, None, options(*words))
        assert "to be answered" not in to.read_text(), (file.parent.name, to.read_text())
        answered += 1
    assert answered >= 12


WRITTEN_TWO_WAYS = {  # what a file may hold, and the option that its question names
    "one number or two": ("\n".join(f"{k},{k % 7}" for k in range(30)), "--layout 'decimal = \",\"'"),
    "names or numbers": ("0,1,2\n" + "\n".join(f"{k},{k % 3},{k % 5}" for k in range(30)), "--layout 'header = 0'"),
    "both marks": ("t;u [V]\n" + "\n".join(f"{k}.25;{k % 3},5" for k in range(30)), "--layout 'decimal = \".\"'"),
    "dates": (
        "time;u [V]\n" + "\n".join(f"{1 + k:02}/03/2024 10:00;{k % 3}" for k in range(9)),
        "--layout 'dates = \"day first\"'",
    ),
}


@pytest.mark.parametrize("kind", WRITTEN_TWO_WAYS)
def test_a_question_about_how_a_file_is_written_names_the_option(kind, tmp_path):
    text, option = WRITTEN_TWO_WAYS[kind]
    log = tmp_path / "log.csv"
    log.write_text(text)
    with pytest.raises(InputError) as asked:
        look([log], None, None, None)
    assert option in str(asked.value)
    assert "layout = {" not in str(asked.value)


def test_diagnose_of_a_log_says_where_that_option_is_given(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text(WRITTEN_TWO_WAYS["names or numbers"][0])
    with pytest.raises(InputError, match=f"ctrlgen look {log} --device") as asked:
        described([log], AXIS_FILE)
    assert "--layout 'header = 0'" in str(asked.value)


def test_a_question_about_a_column_is_told_and_its_answer_reads_it(tmp_path, capsys, axis):
    """A mark that may be a reading, and text among readings."""
    y = 3000 * (np.arange(40) % 7)
    for mark, key in (("-9999", "missing = [-9999]"), ("FAULT 7", 'missing = ["FAULT 7"]')):
        file = tmp_path / f"{mark}.csv"
        rows = [f"{k / 100},{k % 5},{mark if k in (5, 9) else y[k]}" for k in range(40)]
        file.write_text("\n".join(["t [s],u [V],y [nm]", *rows]))
        look([file], None, None, None)
        assert f"--layout {shlex.quote(key)}" in capsys.readouterr().out
        facts = table_facts(read_table(file))
        assert any(key in question for question in propose([facts], axis).asked)
        with pytest.raises(InputError, match=re.escape(shlex.quote(key))):
            propose([facts], axis, options("--column", "reading.axis=y"))
        read = table_facts(read_table(file, None, options("--layout", key).layout)).column("y [nm]")
        assert read.missing == 2 and read.question is None
    asked = table_facts(read_table(tmp_path / "-9999.csv")).column("y [nm]").question.asked(layout_option)
    assert asked.endswith("--layout 'missing = []' if it is a reading")
    kept = table_facts(read_table(tmp_path / "-9999.csv", None, options("--layout", "missing = []").layout))
    assert kept.column("y [nm]").missing == 0
