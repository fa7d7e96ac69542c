"""Options and commands that ctrlgen proposes can be pasted into a shell, whatever files and columns are called."""

from __future__ import annotations

import re
import shlex
from itertools import pairwise

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import ROOT
from logger_files import U, X, rows

from ctrlgen.app.look_console import described, look
from ctrlgen.app.shipped_examples import examples
from ctrlgen.core.errors import InputError
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose

STAGE = ROOT / "tests" / "logs" / "stage.toml"
K = np.arange(len(U))


def answered(questions) -> list[list[str]]:
    """The words of each option in brackets, as a shell hands them on."""
    return [shlex.split(match[1]) for q in questions if (match := re.search(r"\((--\w+ .*)\)$", q))]


def test_names_with_blanks_commas_and_brackets_are_quoted_in_every_question(tmp_path):
    (tmp_path / "log.csv").write_text('"t, all";"u (drive) in, it\'s";"x, all"\n' + rows(";", K, U, X))
    proposal = propose([table_facts(read_table(tmp_path / "log.csv"))], build_model(load_device(STAGE)))
    words = [word for options in answered(proposal.asked) for word in options]
    name = proposal.tables[0].time.column
    assert " " in name and f"{name}=s" in words
    pairs = [word for word in words if word.startswith(("drive.", "reading."))]
    assert any(pair.startswith("drive.axis=u (drive) in, it's") for pair in pairs)
    units = [b for a, b in pairwise(words) if a == "--unit"]
    columns = [b for a, b in pairwise(words) if a == "--column"]
    answers = read_answers(None, None, columns, units, None, None, False)
    facts = table_facts(read_table(tmp_path / "log.csv"), answers)
    assert not propose([facts], proposal.model, answers).asked


def test_paths_with_blanks_are_quoted_in_every_command(tmp_path, capsys):
    folder = tmp_path / "my logs (old)"
    folder.mkdir()
    log, device = folder / "a log.csv", folder / "my stage.toml"
    device.write_text(STAGE.read_text())
    log.write_text("t,u,x\n" + rows(",", K, U, X))
    to = folder / "the recording.toml"
    look([log], device, to, None)
    next_line = next(line for line in capsys.readouterr().out.split("\n") if line.startswith("next:"))
    assert shlex.split(next_line)[1:] == ["ctrlgen", "check", str(to), "--device", str(device)]
    with pytest.raises(InputError) as asked:
        described([log], device)
    assert str(log) in shlex.split(asked.value.faults[-1].what.split("; ")[1])
    example = examples()[0]
    assert str(folder / example.name) in shlex.split(example.command(folder))
    done = ctrlgen("new", "device", folder / "my axis.toml", "--kind", "piezo", "--no-ask")
    assert [shlex.split(line)[3] for line in done.stdout.split("\n") if line.startswith("next:")] == [
        str(folder / "my axis.toml")
    ]
