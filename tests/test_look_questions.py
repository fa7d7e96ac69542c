"""What look finds out of itself and what it asks, word for word: the time of a table, signals and columns, questions with their options."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT
from logger_files import T, U, X, rows

from ctrlgen.app.look_console import described, look
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile
from ctrlgen.recordings.formats.written_layout import Layout
from ctrlgen.recordings.look.answers import NOTHING, Answers
from ctrlgen.recordings.look.column_facts import TableFacts, TimeFacts, table_facts
from ctrlgen.recordings.look.proposal import propose

STAGE = ROOT / "tests" / "logs" / "stage.toml"
NO_TIME = 'no column is a time: state sample_rate, or kind = "poses" (--time COLUMN, --rate 1kHz or --poses)'
CLOCK = [0, 1, 2, 3.5, 4.5, 5.75, 8.75, 8.25, 9.25]  # steps 1, 1, 1.5, 1, 1.25, 3, -0.5, 1


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(STAGE))


def facts_of(folder, text: str, answers: Answers = NOTHING) -> TableFacts:
    (folder / "log.csv").write_text(text)
    return table_facts(read_table(folder / "log.csv", None, answers.layout), answers)


def time_of(folder, head: str, *columns, answers: Answers = NOTHING) -> TimeFacts | None:
    return facts_of(folder, f"{head}\n{rows(',', *columns)}", answers).time


def test_the_time_of_a_table_with_its_step_its_gaps_and_its_falls(tmp_path):
    x = np.arange(9)
    step, jitter = (
        pytest.approx(1.05, rel=1e-12),
        pytest.approx(0.1, rel=1e-12),
    )  # of five near 1 s; 1.5 s is neither near nor a gap
    assert time_of(tmp_path, "time,x", CLOCK, x) == TimeFacts("time", "s", False, step, jitter, ((5, 2),), 1)
    assert time_of(tmp_path, "time (ms),x", CLOCK, x).step == pytest.approx(1.05e-3, rel=1e-12)
    three = time_of(tmp_path, "time,x", [0, 1, 2], [0, 1, 2])
    assert three is not None and (three.step, three.jitter, three.gaps, three.backward) == (1.0, 0.0, (), 0)
    assert time_of(tmp_path, "time,x", [0, 1], [0, 1]) is None
    assert time_of(tmp_path, "time,x", [0, 1, 11], [0, 1, 2]).jitter == 0.0  # neither step is near their median
    assert time_of(tmp_path, "time,x", [0, 0, 0, 1], [0, 1, 2, 3]) is None  # stands still in most rows
    stamps = facts_of(tmp_path, "k (s),stamp\n" + "".join(f"{k},2024-03-05T10:00:{2 * k:02d}\n" for k in range(9))).time
    assert stamps == TimeFacts("stamp", "s", True, 2.0, 0.0, (), 0)


def test_which_column_is_the_time(tmp_path):
    up, down = np.arange(9.0), [0, 1, 2, 3, 4, 3, 5, 6, 7]
    for head, columns, chosen in (
        ("a (s),time", (up, up), "time"),  # by its name before its unit
        ("a (s),b (ms)", (up, up), "a (s)"),
        ("time,b (ms)", (down, up), "b (ms)"),  # one that rises before one that falls
        ("time,elapsed", (down, down), "time"),
        ("time (V),x", (up, up), None),
        ("time (V),elapsed", (up, down), "elapsed"),
        ("time,log.time", (up, up), "time"),
        ("log.time,x", (up, up), "log.time"),
        ("a,b", (up, up), None),
    ):
        time = time_of(tmp_path, head, *columns)
        assert (time and time.column) == chosen, head
    assert time_of(tmp_path, "a,b", up, up, answers=Answers(time="b")).column == "b"
    assert time_of(tmp_path, "time,b", up, up, answers=Answers(rate="1 kHz")) is None
    unclear = [*(100.0 * np.arange(30)), -9999, -9999]  # a mark or a reading: not taken before it is answered
    assert time_of(tmp_path, "time,x", unclear, unclear) is None
    with pytest.raises(AmbiguousFile, match="day from the month"):
        facts_of(tmp_path, "date,x\n03/04/2024 10:00:00,1\n03/05/2024 10:00:00,2\n03/06/2024 10:00:00,3\n")
    with pytest.raises(InputError, match="does not rise"):
        time_of(tmp_path, "a,b", up, up[::-1], answers=Answers(time="b"))


def test_what_is_asked_word_for_word(tmp_path, axis):
    drive, reading = "drive.axis", "reading.axis"
    spoilt = ["FAULT" if k == 7 else x for k, x in enumerate(X)]
    which = "(--column drive.axis=COLUMN)"
    none = "no column was recognised as a reading: which is it? Free are none (--column reading.axis=COLUMN)"
    asks = (
        ("t [s],u [V],x [um]", (T, U, X), NOTHING, (), (drive, reading), ()),
        ("x [um],t [s],u [V]", (X, T, U), NOTHING, (), (drive, reading), ()),
        ("t [s],u [V],c [um],x [um]", (T, U, 0 * X, X), NOTHING, (), (drive, reading), ()),
        ("u [V],x [um]", (U, X), NOTHING, (NO_TIME,), (drive, reading), ()),
        ("u [V],x [um]", (U, X), Answers(rate="1 kHz"), (), (drive, reading), ()),
        ("u [V],x [um]", (U, X), Answers(poses=True), (), (drive, reading), ()),
        ("t [s],u [V]", (T, U), NOTHING, (none,), (drive,), ()),
        ("t [s],x [um]", (T, X), NOTHING, (f"drive.axis: which column? Free are none {which}",), (reading,), ()),
        ("t [s],x [um],i [A]", (T, X, U), NOTHING, (f"drive.axis: which column? Free are i [A] {which}",), (reading,), ("i [A]",)),
        ("t [s],u [V],x [um],i [A]", (T, U, X, X + 1), NOTHING, (), (drive, reading), ("i [A]",)),
    )  # fmt: skip
    for head, columns, answers, asked, matched, left in asks:
        proposal = propose([facts_of(tmp_path, f"{head}\n{rows(',', *columns)}", answers)], axis, answers)
        assert proposal.asked == asked, head
        assert tuple(m.signal for m in proposal.matches) == matched and proposal.left == left, head
        assert proposal.certain == (not asked)
    stated = propose([facts_of(tmp_path, "Sample interval: 2 ms\n\nu [V],x [um]\n" + rows(",", U, X))], axis).asked
    assert stated == (
        "no column is a time: the file says 'Sample interval: 2 ms' (--rate 500Hz, else --time COLUMN or --poses)",
    )
    lines = "".join(f"{t},{u},{x},{s}\n" for t, u, x, s in zip(T, U, X, spoilt, strict=True))
    unread = facts_of(tmp_path, f"t [s],u [V],i [A],x [um]\n{lines}")
    asked = propose([unread], axis).asked  # the column that cannot be read may be the missing reading
    assert (
        len(asked) == 2
        and asked[1].startswith("column 'x [um]' holds text")
        and "--layout 'missing = [\"FAULT\"]'" in asked[1]
    )
    assert propose([facts_of(tmp_path, f"t [s],u [V],x [um],z [um]\n{lines}")], axis).asked == ()


def test_a_question_and_its_answers_are_one_sentence():
    both = {"a = 1": "for one", "b = 2": ""}
    assert Ambiguous("this is open", both).asked("<{}>".format) == "this is open: write <a = 1> for one or <b = 2>"
    assert Ambiguous("one or two?", both).asked(str) == "one or two? Write a = 1 for one or b = 2"
    assert Ambiguous("export it", {}).asked(str) == Ambiguous("export it").asked(str) == "export it"
    assert str(Ambiguous("what", {"a = 1": ""}).of_column("x")) == "column 'x' what: write layout = { a = 1 }"


def test_a_file_that_asks_names_the_option_and_the_command_that_takes_it(tmp_path, capsys):
    file, apart = tmp_path / "log.csv", tmp_path / "apart.csv"
    file.write_text("0,15\n0,25\n0,35\n")
    apart.write_text("X_Value\tu\tX_Value\tx\n0\t1\t0\t2\n1\t2\t2\t3\n2\t3\t4\t4\n")
    for path, diagnosed, said in (
        (file, False, ["log.csv"]),
        (file, True, ["log.csv", "then"]),
        (apart, True, ["apart.csv"]),  # no option answers
    ):
        with pytest.raises(InputError) as error:
            described([path], STAGE) if diagnosed else look([path], None, None, None)
        assert [fault.where for fault in error.value.faults] == said
        if path is file:
            assert (
                "write --layout 'separator = \",\"' for two or --layout 'decimal = \",\"' for one"
                in error.value.faults[0].what
            )
    assert error.value.faults[0].what.startswith("holds channels that each have a time of their own")
    file.write_text("t,u\n0,1\n1,2\n2,3\nt,v\n0,4\n1,5\n2,6\n")
    look([file], None, None, None, Answers(table=2))
    file.write_text("t;u\n1;1,234\n2;2,345\n3;3,456\n")
    look([file], None, None, None, Answers(layout=Layout(decimal=",")))
    printed = capsys.readouterr().out
    assert "v       not stated" in printed and "1.234" in printed and "3.456" in printed
