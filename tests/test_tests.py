"""The tests stand by themselves: what they share is in helper modules, and they know the program by its public names."""

from __future__ import annotations

import ast

import pytest
from conftest import ROOT

TESTS = sorted((ROOT / "tests").glob("*.py"))


@pytest.mark.parametrize("path", TESTS, ids=lambda p: p.stem)
def test_no_test_module_is_imported(path):
    imported = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
    assert not {name for name in imported if name.removeprefix("tests.").startswith("test_")}
