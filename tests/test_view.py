"""What `ctrlgen view` reads of result folders: results, answers, two side by side, work that goes on. No server is needed for it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from viewed_results import a_diagnosis, a_draft, a_run, written

from ctrlgen.app.viewer.compared_results import compared
from ctrlgen.app.viewer.followed_jobs import followed_jobs
from ctrlgen.app.viewer.found_results import found_results, result_at
from ctrlgen.app.viewer.local_server import listen, serve
from ctrlgen.app.viewer.result_answers import KINDS, answer_of
from ctrlgen.app.viewer.viewed_folders import Absent, Place, ViewedFolders
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import whole_folder
from ctrlgen.core.steps import noted, read_steps


def names(folders: ViewedFolders) -> set[str]:
    return {found.name for found in found_results(folders)}


def test_results_are_found_however_deep_with_their_answers(tmp_path):
    a_run(tmp_path / "a" / "circle")
    a_diagnosis(tmp_path / "b" / "c" / "axis")
    a_run(tmp_path / ".hidden")
    (tmp_path / "link").symlink_to(tmp_path / "a")
    found = {f.name: f for f in found_results(ViewedFolders([tmp_path]))}
    assert set(found) == {"a/circle", "b/c/axis"}  # the C of the run is part of it
    assert (found["a/circle"].kind.name, found["a/circle"].verdict, found["a/circle"].of) == (
        "run",
        "within tolerance",
        "a circle",
    )
    assert "travel of coil, 30 % are left" in found["a/circle"].sentence
    assert (found["b/c/axis"].verdict, found["b/c/axis"].sentence) == ("explained", "Creep explains it.")
    assert found["b/c/axis"].matches(["CREEP", "diagnosis"]) and not found["b/c/axis"].matches(["creep", "run"])


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("", "cannot be read"),
        ('{"verdict": "explained", "sent', "cannot be read"),
        ("[1, 2]", "no table"),
        ("[" * 99_999, "too deeply"),
        ('{"verdict": {"a": 1}}', ""),
        ('{"findings": 3, "inputs": [1], "title": {"a": 2}}', ""),
    ],
)
def test_a_result_that_is_broken_is_listed_as_that(tmp_path, content, told):
    written(tmp_path / "broken" / "diagnosis.json", content)
    a_diagnosis(tmp_path / "whole")
    folders = ViewedFolders([tmp_path])
    (broken,) = [f for f in found_results(folders) if f.name == "broken"]
    assert told in broken.fault and bool(told) == bool(broken.fault)
    assert names(folders) == {"broken", "whole"} and result_at(folders, broken.place)[0] == broken


def test_a_result_that_was_made_anew_is_read_anew(tmp_path):
    folders = ViewedFolders([a_diagnosis(tmp_path / "axis")])
    assert found_results(folders)[0].verdict == "explained"
    a_diagnosis(tmp_path / "axis", verdict="consistent")
    assert found_results(folders)[0].verdict == "consistent"


HIDDEN = (
    "0/../secret",
    "0/.git/config",
    "0/a/.steps",
    "0//etc/passwd",
    "1/a",
    "x",
    "",
    "0/a\\b",
    "0/c:",
    "0/a\0",
    "-1/a",
    "\u0660/a",
)


@pytest.mark.parametrize("address", HIDDEN)
def test_an_address_that_leads_elsewhere_leads_nowhere(tmp_path, address):
    with pytest.raises(Absent):
        ViewedFolders([tmp_path]).place(address)


def test_links_out_of_the_folders_are_refused(tmp_path):
    secret = written(tmp_path / "secret" / "key", "key")
    shown = a_run(tmp_path / "shown" / "circle").parent
    written(shown / ".env", "password")
    for name, target in {
        "out": secret,
        "above": secret.parent,
        "inside": shown / "circle" / "report.html",
        "hid": shown / ".env",
    }.items():
        (shown / name).symlink_to(target)
    folders = ViewedFolders([shown])
    for address in ("0/out", "0/above/key", "0/above", "0/nothing", "0/hid"):
        with pytest.raises(Absent):
            folders.path(folders.place(address))
    assert folders.file(Place(0, ("inside",))).name == "report.html"
    with pytest.raises(Absent):
        folders.file(Place(0, ("circle",)))


def test_what_differs_comes_first_and_the_rows_are_the_same_in_both(tmp_path):
    a, b = (
        json.loads((a_diagnosis(tmp_path / n, after) / "diagnosis.json").read_text())
        for n, after in (("a", 0.3), ("b", 0.6))
    )
    b["findings"].append({"effect": "backlash", "location": "axis", "parameters": {}})
    parts, left = compared(a, b)
    rows = {row.path: row for part in parts for row in (*part.differ, *part.agree)}
    after = rows["held_out", "y [um]", "rms_after"]
    assert (after.a, after.b, after.difference) == (0.3, 0.6, 0.5) and left == 0
    assert rows["findings", "creep", "parameters", "gain", "ci95", "high"].b == pytest.approx(0.12)
    assert rows["findings", "backlash", "effect"].a is None and rows["findings", "backlash", "effect"].b == "backlash"
    assert not rows["held_out", "y [um]", "rms_before"].difference
    assert [part.name for part in parts if part.differ] == ["findings", "held_out"]
    changed = [row.difference for row in parts[0].differ if row.is_number]
    assert changed and changed == sorted(changed, reverse=True)
    backwards, _ = compared(b, a)
    assert {row.path for part in backwards for row in (*part.differ, *part.agree)} == set(rows)


def test_numbers_of_other_units_and_long_lists_are_not_compared_as_they_stand():
    parts, _ = compared(
        {"y": {"size": 1.0, "unit": "um"}, "l": [0.0] * 9}, {"y": {"size": 1.0, "unit": "nm"}, "l": [0.0] * 8 + [3.0]}
    )
    rows = {row.path: row for part in parts for row in (*part.differ, *part.agree)}
    assert rows["y [um | nm]", "size"].difference and not rows["y [um | nm]", "size"].is_number
    assert (rows["l", "rms"].a, rows["l", "rms"].b) == (0.0, 1.0) and len([p for p in rows if p[0] == "l"]) == 4
    assert all(not part.differ for part in compared({"a": 0.1 + 0.2}, {"a": 0.3})[0])


@pytest.mark.parametrize("odd", [None, True, "text", [[]], {"a": {}}, [1, "a", None], float("inf"), 10**400])
def test_anything_can_be_compared_with_anything(odd):
    for other in (odd, 1.0, [1.0], {"b": 2}):
        assert compared({"k": odd}, {"k": other})[1] == 0


def test_work_that_goes_on_is_followed_by_what_it_has_written(tmp_path):
    written(
        a_draft(tmp_path / "axis", {"at": 2e9, "step": "reading"}, {"at": 2e9, "step": "fit of creep"}) / "c" / "a.c",
        "int a;",
    )
    written(tmp_path / "axis.unfinished", '{"code": 1}\n["a", [1.0]]\n["b", [2.0]]\n["cut')
    written(tmp_path / "stopped.unfinished", '{"code": 1}\n')
    for k in range(3):
        written(tmp_path / "cases" / f"{k}" / "device.toml", "")
    written(tmp_path / "results" / "1" / "run.json", {})
    (tmp_path / ".git.abcd1234").mkdir()  # none of ours
    jobs = {job.name: job for job in followed_jobs(ViewedFolders([tmp_path]))}
    assert set(jobs) == {"axis", "stopped", tmp_path.name}
    axis = jobs["axis"]
    assert (
        axis.state == "runs"
        and axis.steps[-1] == (2e9, "fit of creep")
        and axis.fits == 2
        and axis.files == (("c/a.c", 6),)
    )
    assert (jobs[tmp_path.name].done, jobs[tmp_path.name].total) == (1, 3)


def test_work_whose_process_is_gone_was_stopped(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    a_draft(tmp_path / "axis", {"at": 2e9, "step": "fit"}, process=process.pid)
    written(tmp_path / "axis.unfinished", '{"code": 1}\n')  # a moment ago
    (job,) = followed_jobs(ViewedFolders([tmp_path]))
    assert job.state == "stopped" and job.fits == 0


def test_a_damaged_note_of_steps_is_read_as_far_as_it_goes(tmp_path):
    draft = a_draft(tmp_path / "axis", {"at": 2e9, "step": "fit"}, [1], "x")
    with (draft / ".steps").open("a") as file:
        file.write('{"at": 3e9, "st')
    assert read_steps(draft).steps == ((2e9, "fit"),)
    for broken in ('{"process": "1", "at": 1}\n', '{"at": "x", "step": 2}\n', "[" * 99_999, "\0"):
        written(draft / ".steps", broken)
        followed_jobs(ViewedFolders([tmp_path]))


def test_steps_are_noted_while_a_result_is_written_and_gone_when_it_is_done(tmp_path):
    told = []
    with whole_folder(tmp_path / "axis") as draft:
        step = noted(draft, told.append)
        step("fit")
        found = read_steps(draft)
        assert found.runs and [text for _, text in found.steps] == ["fit"] == told
        written(draft / "diagnosis.json", {})
    assert {path.name for path in (tmp_path / "axis").iterdir()} == {"diagnosis.json", ".ctrlgen"}


def test_a_port_that_is_taken_is_refused_and_the_usual_one_gives_way():
    with listen(0) as taken:
        with pytest.raises(InputError, match="is taken; name another one, or 0"):
            listen(taken.getsockname()[1])
        with listen(None) as usual, listen(None) as other:
            assert usual.getsockname()[1] != other.getsockname()[1]
            assert usual.getsockname()[0] == "127.0.0.1"


def test_without_its_packages_the_command_says_how_to_get_them(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(InputError, match=r"pip install 'ctrlgen\[view\]'"):
        serve([tmp_path], 0, print)
    with pytest.raises(InputError, match="is no folder"):
        serve([tmp_path / "nothing"], 0, print)


def test_the_answer_of_learning_states_the_unit_of_each_group():
    groups = [{"name": "translation", "unit": "nm"}, {"name": "rotation", "unit": "urad"}]
    errors = [{"group": "translation", "repeating": 21.58}, {"group": "rotation", "repeating": 0.5}]
    record = {"groups": groups, "runs": [{"best": True, "errors": errors}], "stop": ""}
    kind = next(kind for kind in KINDS if kind.name == "learning")
    assert answer_of(kind, record)[2].endswith("21.58 nm (translation), 0.5 urad (rotation).")
