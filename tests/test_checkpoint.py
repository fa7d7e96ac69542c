"""A diagnosis that is stopped goes on from the fits it had, and answers as if it had never been stopped."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from recording_folders import SERVO, servo_poses

from ctrlgen.diagnosis.diagnosis_folder import Replicates, diagnose_into, digests, unfinished
from ctrlgen.estimation import fit
from ctrlgen.estimation.checkpoint import Checkpoint, key_of
from ctrlgen.version import code_hash

MADE_FROM = {"code": "1", "seed": 0, "files": {"a": "b"}}


@pytest.fixture
def asked(tmp_path) -> tuple[Path, list[Path]]:
    """A device file and a recording of a table whose reading is off by a gain."""
    (tmp_path / "table.toml").write_text(SERVO)
    return tmp_path / "table.toml", [servo_poses(tmp_path / "run", 1e-3, 0)]


@pytest.fixture
def sought(monkeypatch) -> list[int]:
    """One entry for every optimum that is looked for."""
    calls, real = [], fit.levenberg_marquardt

    def counted(problem, x, steps, enough):
        calls.append(steps)
        return real(problem, x, steps, enough)

    monkeypatch.setattr(fit, "levenberg_marquardt", counted)
    return calls


@pytest.mark.long
def test_what_is_stopped_goes_on_and_ends_alike(asked, sought, tmp_path):
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    diagnose_into(*asked, whole)
    needed = len(sought)
    assert not unfinished(whole).exists()

    def stop(said: str) -> None:
        if len(sought) > needed // 3:
            raise KeyboardInterrupt

    sought.clear()
    with pytest.raises(KeyboardInterrupt):
        diagnose_into(*asked, stopped, progress=stop)
    done, said = len(sought), []
    assert 0 < done < needed and not stopped.exists() and unfinished(stopped).exists()
    made_from = json.loads(unfinished(stopped).read_text().splitlines()[0])
    assert made_from == {"code": code_hash(), "seed": 0, "files": digests(*asked), "laws": None}
    sought.clear()
    diagnose_into(*asked, stopped, progress=said.append)
    assert len(sought) == needed - done
    assert any(s.startswith("continuing after") for s in said)
    assert (stopped / "diagnosis.json").read_bytes() == (whole / "diagnosis.json").read_bytes()
    assert not unfinished(stopped).exists()


def test_the_folder_one_stands_in_has_a_name_too(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert unfinished(Path(".")) == tmp_path.with_name(f"{tmp_path.name}.unfinished")


def test_another_seed_code_or_file_begins_anew(tmp_path):
    path = tmp_path / "kept"
    Checkpoint(path, MADE_FROM).keep("k", np.array([0.1, -1e-300]))
    assert np.array_equal(Checkpoint(path, MADE_FROM).recall("k"), [0.1, -1e-300])
    assert Checkpoint(path, MADE_FROM | {"code": "another"}).reused == 0
    other = Checkpoint(path, MADE_FROM | {"seed": 1})
    assert other.reused == 0
    other.keep("l", np.zeros(1))
    assert Checkpoint(path, MADE_FROM).reused == 0  # the other one took its place


def test_a_line_that_was_not_written_to_its_end_does_not_count(tmp_path):
    path = tmp_path / "kept"
    lines = [json.dumps(MADE_FROM), json.dumps(["a", [1.0]]), '["b", [2.']
    path.write_text("\n".join(lines))
    checkpoint = Checkpoint(path, MADE_FROM)
    assert checkpoint.reused == 1 and checkpoint.recall("b") is None
    checkpoint.keep("c", np.array([3.0]))
    assert set(Checkpoint(path, MADE_FROM).optima) == {"a", "c"}


def test_a_key_tells_values_and_order():
    a, b = np.array([1.0, 2.0]), np.array([2.0, 1.0])
    assert len({key_of(a, b), key_of(b, a), key_of(a), key_of(a, 1), key_of(a + 1e-16 * a, b + 1e-15)}) == 5


@pytest.mark.long
def test_what_is_stopped_among_its_replicates_keeps_its_fits(asked, tmp_path):
    out = tmp_path / "out"

    def stop(said: str) -> None:
        if said.startswith("bootstrap"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose_into(*asked, out, progress=stop, replicates=Replicates(20, jobs=0))
    assert not out.exists() and unfinished(out).exists()


def test_recordings_of_one_name_are_told_apart(asked, tmp_path):
    device, _ = asked
    days = [servo_poses(tmp_path / day / "run", 1e-3, k) for k, day in enumerate(("day1", "day2"))]
    before = digests(device, days)
    assert list(before) == [
        "table.toml",
        *(f"{day}/run/{f}" for day in ("day1", "day2") for f in ("recording.toml", "poses.csv")),
    ]
    (days[0] / "poses.csv").write_text("r,y\n1,1\n")
    after = digests(device, days)
    assert {name for name in before if before[name] != after[name]} == {"day1/run/poses.csv"}
