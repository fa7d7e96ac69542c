"""Learning on the independent plant, through files and the command line only: the circle's error run by run."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("exudyn", reason="no Exudyn: learning needs the independent plant; pip install ctrlgen[plant]")

from plants.bench import DEVICE, ctrlgen
from plants.excitation import record
from plants.imperfect import Imperfect, played_back
from plants.learning import Learnt, learn, solved
from plants.mems_hexapod import MemsHexapod

WANTED = 0.05  # % of S1's measure


@pytest.fixture(scope="module")
def scenario(tmp_path_factory) -> Path:
    """Solved and generated for the device file as printed."""
    return solved(tmp_path_factory.mktemp("circle"))


def test_the_play_operator_follows_behind_by_its_width_and_turns_with_slack():
    force = np.concatenate([np.linspace(0, 1, 11), np.linspace(0.9, 0, 10)])[:, None]
    out = played_back(force, 0.15)[:, 0]
    assert out[10] == pytest.approx(0.85) and out[12] == pytest.approx(0.85)  # 0.8 is within the slack
    assert out[-1] == pytest.approx(0.15)


@pytest.mark.long
def test_without_a_diagnosis_three_runs_bring_the_circle_below_a_twentieth_of_a_percent(scenario, tmp_path):
    learnt = learn(Imperfect(), scenario, tmp_path)
    errors = [m.overall for m in learnt.runs]
    assert errors[0] == pytest.approx(3.97, abs=0.05) and not learnt.refused
    assert errors[1] < errors[0] / 10 and errors[3] < WANTED
    never_worse(learnt)


@pytest.mark.exhaustive
def test_with_friction_and_hysteresis_three_runs_bring_it_as_far(scenario, tmp_path):
    learnt = learn(Imperfect(friction=2e-4, hysteresis=0.05), scenario, tmp_path)
    errors = [m.overall for m in learnt.runs]
    assert errors[0] > 3 and errors[3] < WANTED and not learnt.refused
    never_worse(learnt)


def never_worse(learnt: Learnt) -> None:
    """No run is worse than the one before by more than 2 nm, what five periods of 20 nm leave of noise."""
    largest = [max(m.largest.values()) for m in learnt.runs]
    assert all(then < now + 2e-3 + 0.1 * now for now, then in pairwise(largest))


# test_learning has the same on a simulated bench
@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("bench", "names"),
    [
        (Imperfect(reversed=(0,)), "drive.1X"),
        (Imperfect(exchanged=(2, 3)), "drive.2X, drive.2Y"),
    ],
    ids=["reversed", "exchanged"],
)
def test_an_actuator_that_is_wired_wrongly_is_refused_by_name_after_the_first_step(scenario, tmp_path, bench, names):
    learnt = learn(bench, scenario, tmp_path)
    assert len(learnt.runs) == 2 and names in learnt.refused and "Traceback" not in learnt.refused


@pytest.mark.exhaustive
def test_from_the_diagnosed_device_one_run_is_enough(tmp_path):
    record(MemsHexapod(), tmp_path / "recording")
    ctrlgen("diagnose", str(DEVICE), str(tmp_path / "recording"), "--out", str(tmp_path / "diagnosis"), "--seed", "0")
    scenario = solved(tmp_path / "scenario", tmp_path / "diagnosis" / "device.next.toml")
    learnt = learn(Imperfect(), scenario, tmp_path, runs=1)
    before, after = (m.overall for m in learnt.runs)
    assert before < 0.2 and after < WANTED
