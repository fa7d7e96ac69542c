"""Mutation testing: what is drawn, which tests see a line, and what becomes of a mutant; on a small tree of its own."""

from __future__ import annotations

import json

import pytest
from conftest import ROOT

pytest.importorskip("cosmic_ray", reason="mutation testing was not tried: pip install '.[mutants]'")

from mutants import __main__ as command
from mutants.areas import AREAS, files
from mutants.draw import Mutant, drawn, mutants
from mutants.seen import Seen, seen
from mutants.trial import Copy, fitting

CODE = '''"""Seven of nine: 7 * 9."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

__all__ = ["a"][:1]
LIMIT = 3.0


@dataclass(frozen=True)
class Box:
    """A box."""

    side: float | None = None

    @cached_property
    def area(self) -> float:
        """Of one side."""
        return self.side * self.side


def checked(value: float) -> float:
    """At most LIMIT."""
    if value > LIMIT:
        what = f"{value + 1} is too much"
        raise ValueError(what, f"{value - 2}")
    total = 0.0
    for a, b in zip([value], [1.0], strict=True):
        total += a * b
    return total
'''
TESTS = """import pytest
from ctrlgen.small import Box, checked


def test_area():
    assert Box(3.0).area == 9.0


def test_limit():
    with pytest.raises(ValueError):
        checked(3.5)
    assert checked(2.5) == 2.5
"""


@pytest.fixture
def tree(tmp_path):
    root = tmp_path / "root"
    (root / "ctrlgen").mkdir(parents=True)
    (root / "tests").mkdir()
    (root / "ctrlgen" / "__init__.py").write_text("")
    (root / "ctrlgen" / "small.py").write_text(CODE)
    (root / "tests" / "test_small.py").write_text(TESTS)
    (root / "mutants").symlink_to(ROOT / "mutants")  # the plugin that times tests
    (root / "pyproject.toml").write_text('[tool.pytest.ini_options]\nmarkers = ["long: takes minutes"]\n')
    return root


def small(tree) -> list[Mutant]:
    return list(mutants(tree, "model", tree / "ctrlgen" / "small.py"))


def line(text: str) -> int:
    return next(k for k, row in enumerate(CODE.splitlines(), 1) if text in row)


def test_every_area_has_its_files_and_none_is_in_two():
    found = [path for area in AREAS for path in files(ROOT, area)]
    assert len(found) == len(set(found)) and all(files(ROOT, area) for area in AREAS)


def test_a_pattern_that_matches_no_file_is_an_error(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"areas\.py"):
        files(tmp_path, "model")


def test_what_no_test_can_see_is_not_drawn(tree):
    """Texts, annotations, contracts, __all__, caches, and what stands in the words of an error."""
    lines = {m.line for m in small(tree)}
    spared = ("Seven of nine", "__all__", "float | None", "@cached_property", "what = f", "raise ValueError")
    assert not lines & {line(text) for text in spared}
    assert not [m for m in small(tree) if m.line == line("strict=True") and "True" in m.operator]
    assert {line("LIMIT = 3.0"), line("return self.side"), line("value > LIMIT"), line("total += a * b")} <= lines


def test_a_mutant_changes_one_place_and_says_which(tree):
    (times,) = [m for m in small(tree) if m.line == line("return self.side") and m.operator.endswith("Mul_Add")]
    assert "-        return self.side * self.side\n+        return self.side + self.side\n" in times.diff(CODE)
    assert times.definition == "area" and compile(times.code(CODE), "small", "exec")


def test_a_draw_is_the_same_for_a_seed_and_as_large_for_every_area(tree):
    areas = {"model": [tree / "ctrlgen" / "small.py"], "effects": [tree / "ctrlgen" / "small.py"]}
    first = drawn(tree, areas, 7, 1)
    assert first == drawn(tree, areas, 7, 1) != drawn(tree, areas, 7, 2)
    assert [sum(m.area == area for m in first) for area in areas] == [4, 3]


@pytest.mark.long
def test_lines_are_seen_by_the_tests_that_run_them_and_constants_by_those_that_use_them(tree, tmp_path):
    found = seen(tree, [tree / "tests" / "test_small.py"], tmp_path / "cache", 1, lambda: None)
    area, limit = "tests/test_small.py::test_area", "tests/test_small.py::test_limit"
    file = "ctrlgen/small.py"
    assert found.tests(file, line("return self.side")) == [area]
    assert found.tests(file, line("LIMIT = 3.0")) == [limit]
    assert found.tests(file, line("float | None")) == [area]  # names the side
    assert set(found.tests(file, line("__all__"))) == {area, limit}  # of which nothing is used
    (kept,) = (tmp_path / "cache").glob("*.json")
    kept.write_text(json.dumps({"seconds": {}, "tests": [], "lines": {}}))  # read again, not measured again
    assert seen(tree, [tree / "tests" / "test_small.py"], tmp_path / "cache", 1, lambda: None).seconds == {}


@pytest.mark.long
def test_a_setting_is_seen_by_the_tests_that_execute_what_reads_it_of_its_group(tree, tmp_path):
    (tree / "ctrlgen" / "settings.py").write_text(
        "from dataclasses import dataclass\n\n\n@dataclass\nclass GateSettings:\n    most: int = 3\n\n\nGATE = GateSettings()\n"
    )
    (tree / "ctrlgen" / "gate.py").write_text(
        "from ctrlgen.settings import GATE\n\n\ndef shut(n):\n    return n > GATE.most\n\n\ndef most(x):\n    return x.most\n"
    )
    test = tree / "tests" / "test_gate.py"
    test.write_text(
        "from ctrlgen.gate import GATE, most, shut\n\n\ndef test_shut():\n    assert shut(4) and not shut(3)\n\n\n"
        "def test_most():\n    assert most(GATE)\n"
    )
    found = seen(tree, [test], tmp_path / "cache", 1, lambda: None)
    assert found.tests("ctrlgen/settings.py", 6) == ["tests/test_gate.py::test_shut"]


def test_a_number_of_a_law_is_seen_by_the_tests_that_the_law_names():
    """They may read the class alone, and execute no line of its file."""
    file, named = "ctrlgen/effects/creep.py", "tests/test_laws.py::test_bounds[creep-gain]"
    seconds = {"t.py::test_all": 0.1, named: 0.1, "tests/test_laws.py::test_bounds[log_creep-gain]": 0.1}
    line = 1 + next(k for k, row in enumerate((ROOT / file).read_text().splitlines()) if "params = (" in row)
    known = Seen(ROOT, {file: {1000: {"t.py::test_all"}}}, seconds, {"t.py::test_all": 30})
    assert known.tests(file, line) == [named, "t.py::test_all"]


def test_the_most_specific_and_fastest_tests_come_first_and_as_many_as_fit():
    known = Seen(
        ROOT,
        {"ctrlgen/numerics/phi_functions.py": {1: {"slow", "wide", "quick"}}},
        {"slow": 9.0, "wide": 0.1, "quick": 0.1},
    )
    known.breadth = {"slow": 3, "wide": 5000, "quick": 30}
    assert known.tests("ctrlgen/numerics/phi_functions.py", 1) == ["quick", "slow", "wide"]
    assert fitting(["quick", "slow", "wide"], known.seconds, 1.0) == ["quick"]
    assert fitting(["slow", "quick"], known.seconds, 1.0) == ["slow"]


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    "text, operator, what",
    [
        ("return self.side", "Mul_Add", "caught"),
        ("LIMIT = 3.0", "NumberReplacer", "caught"),
        ("total += a * b", "Mul_Div", "survived"),  # by one
        ("side: float", "no test", "unseen"),
    ],
)
def test_a_wrong_line_is_caught_where_a_test_fails(tree, text, operator, what):
    tests = [f"tests/test_small.py::test_{name}" for name in ("area", "limit")]
    mutant = next((m for m in small(tree) if m.line == line(text) and operator in m.operator), None)
    if mutant is None:
        mutant, tests = small(tree)[0], []
    copy = Copy(tree)
    try:
        found = copy.tried(mutant, tests, dict.fromkeys(tests, 0.1), 60.0)
        assert found.what == what and (copy.root / mutant.file).read_text() == CODE
        assert (tree / mutant.file).read_text() == CODE
        assert found.by.startswith("tests/test_small.py") == (what == "caught")
    finally:
        copy.remove()
    assert not copy.root.exists()


@pytest.mark.long
def test_a_mutant_that_hangs_is_ended_at_the_limit(tree):
    (tree / "tests" / "test_small.py").write_text(
        "import time\nfrom ctrlgen.small import LIMIT\n\n\ndef test_waits():\n    time.sleep(600 if LIMIT != 3.0 else 0)\n"
    )
    mutant = next(m for m in small(tree) if m.line == line("LIMIT = 3.0"))
    copy = Copy(tree)
    try:
        assert (
            copy.tried(mutant, ["tests/test_small.py::test_waits"], {"tests/test_small.py::test_waits": 0.1}, 8.0).what
            == "timeout"
        )
    finally:
        copy.remove()


@pytest.mark.long
@pytest.mark.parametrize("least, code", [(0.9, 1), (0.4, 0)])
def test_the_command_counts_lists_survivors_and_says_by_its_exit_whether_enough_was_caught(
    tree, tmp_path, monkeypatch, capsys, least, code
):
    """Of the two places with an arithmetic operator one is caught."""
    both = [
        next(m for m in small(tree) if m.line == line(text) and operator in m.operator)
        for text, operator in (("return self.side", "Mul_Add"), ("total += a * b", "Mul_Div"))
    ]
    monkeypatch.setattr(command, "ROOT", tree)
    monkeypatch.setattr(command, "AREAS", {"model": ()})
    monkeypatch.setattr(command, "files", lambda root, area: [])
    monkeypatch.setattr(command, "drawn", lambda *_: both)
    out = tmp_path / "out"
    assert command.main(["--out", str(out), "--jobs", "1", "--least", str(least), "--areas", "model"]) == code
    report = json.loads((out / "mutants.json").read_text())
    assert report["caught"] == 0.5 and [row["what"] for row in report["mutants"]] == ["survived", "caught"]
    assert (
        report["mutants"][0]["line"] == line("total += a * b")
        and "+        total += a / b" in report["mutants"][0]["diff"]
    )
    assert "total += a / b" in capsys.readouterr().out
