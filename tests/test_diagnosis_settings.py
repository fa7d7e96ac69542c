"""Every setting of the diagnosis says what it is and why, and something reads it."""

from __future__ import annotations

import ast
import dataclasses

import pytest
from conftest import ROOT

from ctrlgen.diagnosis import settings
from ctrlgen.estimation import settings as estimation

ROOMS = (ROOT / "ctrlgen" / "diagnosis", ROOT / "ctrlgen" / "estimation")
HELD = {**vars(settings), **vars(estimation)}
GROUPS = {name: value for name, value in HELD.items() if name.isupper() and dataclasses.is_dataclass(value)}
FILES = [*(ROOMS[0] / "settings").glob("*.py"), *ROOMS[1].glob("settings*.py")]
MODULES = [path for room in ROOMS for path in sorted(room.rglob("*.py")) if path not in FILES]


def documented(path) -> dict[str, dict[str, str]]:
    """By class, the text that follows each field."""
    found = {}
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            rows = list(zip(node.body, [*node.body[1:], None], strict=True))
            found[node.name] = {
                field.target.id: after.value.value
                for field, after in rows
                if isinstance(field, ast.AnnAssign) and isinstance(after, ast.Expr)
            }
    return found


@pytest.mark.parametrize("name", GROUPS)
def test_every_setting_says_what_it_is(name):
    group = GROUPS[name]
    texts = next(
        classes[type(group).__name__] for path in FILES if type(group).__name__ in (classes := documented(path))
    )
    for field in dataclasses.fields(group):
        assert len(texts.get(field.name, "").split()) >= 4, f"{name}.{field.name}"


def test_every_setting_is_read_by_the_diagnosis():
    read = {
        (node.value.id, node.attr)
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    }
    for name, group in GROUPS.items():
        for field in dataclasses.fields(group):
            assert (name, field.name) in read, f"nothing reads {name}.{field.name}"


@pytest.mark.parametrize("name", GROUPS)
def test_a_setting_cannot_be_changed_while_the_program_runs(name):
    group = GROUPS[name]
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(group, dataclasses.fields(group)[0].name, 0)
