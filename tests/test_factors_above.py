"""A factor or an offset that stands above a table is asked of its column, or told where it stands in a remark; 1 and 0 are nothing."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.answers import NOTHING, read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose

N = np.arange(60)
ROWS = list(zip(0.01 * N, 2 + np.sin(N), np.cos(N), strict=True))


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))


def of(folder, axis, head: str, separator: str, labelled: bool, answers=NOTHING):
    cells = [[f"{value:.4f}".replace(".", "," if separator == ";" else ".") for value in row] for row in ROWS]
    body = "\n".join(separator.join([*([str(k)] if labelled else []), *row]) for k, row in enumerate(cells))
    (folder / "log.csv").write_text(f"{head.replace('|', separator)}\n{body}\n")
    facts = table_facts(read_table(folder / "log.csv", None, answers.layout), answers)
    return propose([facts], axis, answers)


@pytest.mark.parametrize("label", ["factor", "Scale", "Gain", "Faktor", "[Multiplier]", "Offset", "Skalierung:"])
@pytest.mark.parametrize("labelled", [True, False])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("above", [True, False])
def test_a_row_of_factors_is_asked_of_the_columns_that_it_changes(tmp_path, axis, label, labelled, separator, above):
    names = ("name|" if labelled else "") + "t [s]|u [V]|x [um]"
    half, one = "0,5" if separator == ";" else "0.5", "0" if label == "Offset" else "1"
    if not above and not labelled:
        pytest.skip("a row of one cell more between the names and the rows is no row of either")
    for changed, plain in itertools.permutations((half, one)):
        row = f"{label}|{one}|{changed}|{plain}"
        asked = of(tmp_path, axis, f"{row}\n{names}" if above else f"{names}\n{row}", separator, labelled).asked
        told = [question.partition(" = ")[0] for question in asked if "not applied" in question]
        assert told == ["drive.axis" if changed == half else "reading.axis"], asked
    neutral = f"{label}|{one}|{one}|{one}"
    assert of(tmp_path, axis, f"{neutral}\n{names}" if above else f"{names}\n{neutral}", separator, labelled).certain


def test_its_unit_answers_it(tmp_path, axis):
    head = "factor|1|1|0.001\nname|t [s]|u [V]|x [um]"
    answers = read_answers(None, None, [], ["reading.axis=0.001um"], None, None, False)
    proposal = of(tmp_path, axis, head, ",", True, answers)
    assert proposal.certain and {m.signal: m.scale for m in proposal.matches} == {
        "drive.axis": 1,
        "reading.axis": 0.001,
    }


@pytest.mark.parametrize(
    "remark, told",
    [
        ("Gain: 10 V/V", True), ("# sensor: 10 um/V", True), ("Scale factor = 0.001", True), ("# Verst\u00e4rkung 20", True),
        ("Vertical Scale: 2.0", False), ("Full scale: 10 V", False), ("# probe factor 10", False), ("Operator: Smith", False),
        ("Channels: 2", False),
    ],
)  # fmt: skip
def test_a_remark_of_a_factor_is_told(tmp_path, axis, remark, told):
    notes = of(tmp_path, axis, f"{remark}\nt [s]|u [V]|x [um]", ",", False).tables[0].table.notes
    assert any("is not applied" in note for note in notes) == told
