"""Random logs of the bench: what look takes without a question is what was written, and what is not applied is told."""

from __future__ import annotations

import numpy as np
import pytest
from random_bench_logs import Drawn, drawn

from ctrlgen.core.errors import InputError
from ctrlgen.core.units import to_si
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose

COUNT = 150
LEAST_CERTAIN = 0.3
"""Share that is taken without a question: many draws state no unit or no time."""


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device("tests/logs/stage.toml"))


def compared(log: Drawn, path, axis) -> str:
    """What became of a log: "certain", "asked" or "refused". Fails where it is certain and wrong, or a flag is not told."""
    path.write_text(log.text)
    try:
        facts = table_facts(read_table(path))
        proposal = propose([facts], axis)
    except InputError:
        return "refused"
    for words in log.told:
        assert any(words in note and "not applied" in note for note in facts.table.notes), (log.described, words)
    if not proposal.certain:
        return "asked"
    for signal, true, within in (("drive.axis", log.u, 1e-9), ("reading.axis", log.x, 1e-12)):
        match = next(m for m in proposal.matches if m.signal == signal)
        read = facts.table.numbers(match.column) * match.scale * to_si(1.0, match.unit)
        np.testing.assert_allclose(read, true, rtol=1e-9, atol=within, err_msg=log.described)
    assert facts.time is not None, log.described
    scale = facts.column(facts.time.column).scale
    time = facts.table.time(facts.time.column, facts.time.unit, scale).values * scale * to_si(1.0, facts.time.unit)
    np.testing.assert_allclose(time, log.t, rtol=1e-9, atol=3e-6, err_msg=log.described)
    return "certain"


def test_what_look_takes_without_a_question_is_true(tmp_path, axis):
    became = [compared(drawn(seed), tmp_path / "log.csv", axis) for seed in range(COUNT)]
    assert became.count("certain") >= LEAST_CERTAIN * COUNT, became
