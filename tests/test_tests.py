"""The tests stand by themselves: what they share is in helper modules, and they know the program by its public names."""

from __future__ import annotations

import ast
from functools import cache

import pytest
from conftest import ROOT

TESTS = sorted((ROOT / "tests").glob("*.py"))


NAMING = ast.Import | ast.ImportFrom | ast.Attribute | ast.Call


@cache
def naming(text: str) -> tuple[ast.AST, ...]:
    """What a module imports, takes by a dot and calls."""
    return tuple(node for node in ast.walk(ast.parse(text)) if isinstance(node, NAMING))


def test_no_test_module_is_imported():
    for path in TESTS:
        imported = set()
        for node in naming(path.read_text()):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
        assert not {name for name in imported if name.removeprefix("tests.").startswith("test_")}, path.stem


def private_names(text: str) -> set[str]:
    """Names with a leading underscore that a module takes from elsewhere: imported, by a dot, or as a text to replace."""
    found = set()
    for node in naming(text):
        if isinstance(node, ast.ImportFrom):
            found |= {*(node.module or "").split("."), *(alias.name for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {word for alias in node.names for word in alias.name.split(".")}
        elif isinstance(node, ast.Attribute) and not (isinstance(node.value, ast.Name) and node.value.id == "self"):
            found.add(node.attr)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in PATCHING:
            texts = [a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
            found |= {word for text in texts for word in text.split(".")}
    return {name for name in found if name.startswith("_") and not name.startswith("__")}


PATCHING = ("setattr", "delattr")


def test_no_test_uses_a_private_name():
    used = {path.stem: private_names(path.read_text()) for path in TESTS}
    assert {name: names for name, names in used.items() if names} == {}


@pytest.mark.parametrize(
    "text",
    [
        "from ctrlgen.a import _b",
        "import ctrlgen._a",
        "x._y",
        'monkeypatch.setattr("ctrlgen.a._b", 1)',
        'm.setattr(x, "_y", 1)',
    ],
)
def test_a_private_name_is_found_wherever_it_is_used(text):
    assert private_names(text)


def test_a_file_of_tests_is_of_one_subject():
    """Of 400 lines at most, as the modules of the program."""
    lengths = {path.stem: len(path.read_text().splitlines()) for path in TESTS}
    assert {name: length for name, length in lengths.items() if length > 400} == {}
