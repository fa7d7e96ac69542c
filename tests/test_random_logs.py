"""Random logs are read to the exact numbers or refused with the key to write; never silently wrong."""

from __future__ import annotations

import numpy as np
import pytest
from random_logs import Log, damaged, random_log

from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.unit_texts import unit_of
from ctrlgen.recordings.formats.written_layout import Layout

COUNT = 200
LEAST_READ = (
    0.85  # of those whose numbers can be known without asking, all are; the share of all that shows that few are asked
)


def compared(log: Log, path, layout: Layout) -> None:
    table = read_table(path, layout=layout)
    for wanted, truth in log.columns.items():
        name = table.find(wanted)
        if wanted == log.time:
            read = table.time(name, log.time_unit).values * {"s": 1.0, "ms": 1e-3}[log.time_unit]
            np.testing.assert_allclose(
                read, truth, rtol=0, atol=3e-7, err_msg=log.described
            )  # an epoch in seconds as a float
        else:
            np.testing.assert_array_equal(table.numbers(name), truth, err_msg=log.described)
        stated = {"time": log.time_unit, "drive": "V", "Weg µ": "um", "Weg_µ": "um"}.get(str(wanted))
        if name in table.units:
            assert unit_of(table.units[name]) == stated, log.described


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory) -> dict[int, str]:
    """What became of each log: 'read' or the message that asks."""
    folder, found = tmp_path_factory.mktemp("logs"), {}
    for seed in range(COUNT):
        log, path = random_log(seed), folder / f"{seed}.csv"
        path.write_bytes(log.content)
        try:
            compared(log, path, Layout())
            found[seed] = "read"
        except InputError as error:
            found[seed] = str(error)
    return found


@pytest.mark.long
def test_what_is_refused_is_asked_with_the_key_that_answers(outcomes):
    for seed, said in outcomes.items():
        assert said == "read" or "layout = {" in said, (random_log(seed).described, said)


@pytest.mark.long
def test_nothing_is_asked_that_the_file_tells(outcomes):
    asked = {seed: said for seed, said in outcomes.items() if said != "read" and not random_log(seed).may_ask}
    assert not asked, [(random_log(seed).described, said) for seed, said in asked.items()]
    assert sum(said == "read" for said in outcomes.values()) >= LEAST_READ * COUNT


@pytest.mark.long
def test_with_the_answer_it_is_read(outcomes, tmp_path):
    for seed in (seed for seed, said in outcomes.items() if said != "read"):
        log, path = random_log(seed), tmp_path / f"{seed}.csv"
        path.write_bytes(log.content)
        compared(log, path, Layout.model_validate(log.answers))


def test_a_damaged_log_is_never_read_as_another(tmp_path):
    """Refused, or read to the same rows, without the number that was spoilt."""
    path, seen = tmp_path / "run.csv", set()
    for seed in range(COUNT // 2):
        log, how = damaged(random_log(seed), seed)
        path.write_bytes(log.content)
        try:
            compared(log, path, Layout.model_validate({"missing": None, **log.answers}))
            seen.add((how, "read"))
        except InputError:
            seen.add((how, "refused"))
    assert {
        ("blank lines", "read"),
        ("remark", "read"),
        ("no end", "read"),
        ("quote", "refused"),
        ("no cell", "refused"),
    } <= seen
    assert not seen & {("quote", "read"), ("no cell", "read"), ("two cells", "read")}
