"""Public functions that take several paths, names or tables take one as well, and make no letters of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import SCENARIOS

import ctrlgen
from ctrlgen.core.one_or_several import several

RUN = SCENARIOS / "lever_runs" / "run_a.toml"
NAME = "element[0].thickness"


@pytest.fixture(scope="module")
def lever():
    return ctrlgen.build_model(ctrlgen.load_device(SCENARIOS / "devices" / "xy_lever_stage.toml"))


def test_a_text_a_path_and_a_table_are_one():
    for one in ("a.toml", Path("a.toml"), {"kind": "offset"}):
        assert several(one) == [one] == several([one]) == several((one,))


@pytest.mark.parametrize("given", [str(RUN), RUN, (RUN,)])
def test_recordings_are_loaded_from_one_path(lever, given):
    assert len(ctrlgen.load_recordings(given, lever).records) == len(ctrlgen.load_recordings([RUN], lever).records) > 0


def test_one_recording_that_is_absent_has_one_fault(lever, tmp_path):
    with pytest.raises(ctrlgen.InputError) as caught:
        ctrlgen.load_recordings(str(tmp_path / "absent.toml"), lever)
    assert len(caught.value.faults) == 1


def test_one_parameter_is_free(lever):
    assert ctrlgen.build_model(lever.device, free=NAME).p_nominal.size == 1


def test_one_law_is_named(lever):
    with pytest.raises(ctrlgen.InputError) as caught:
        ctrlgen.diagnose(lever.device, RUN, laws="no_such_law")
    assert [fault.where for fault in caught.value.faults] == ["no_such_law"]


def test_the_file_of_a_batch_is_its_tasks(tmp_path):
    with pytest.raises(ctrlgen.InputError, match=r"absent\.toml"):
        ctrlgen.run_batch(str(tmp_path / "absent.toml"), tmp_path / "out")


def test_one_effect_is_that_of_a_device():
    laws = {"parameters": {"k": "2 N/um"}, "drive": {"u": "10 V"}, "axes": {"x": "9 um"}}
    laws |= {"force": lambda u, p: 1e-6 * p.k * u.u, "restoring_force": lambda d, p: p.k * d.x}
    effect = {"kind": "drive_gain", "at": "drive", "gain": "0.01"}
    one, row = (ctrlgen.user_device("stage", **laws, effect=given) for given in (effect, [effect]))
    assert one.effect == row.effect and len(one.effect) == 1
