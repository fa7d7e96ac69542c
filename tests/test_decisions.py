"""Decisions are made on enumerations and types; sentences are their view, and nothing compares the words of one."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from conftest import ROOT

PACKAGE = ROOT / "ctrlgen"
SEARCHES = {"startswith", "endswith", "find", "rfind", "index", "count", "partition", "removeprefix", "removesuffix"}
ARGUED = {
    ("app/commands/result_folder.py", "# result of "): "a line of `.ctrlgen` that this file wrote",
    (
        "core/files.py",
        "Value error, ",
    ): "pydantic puts it before the message of a validator, and has no other mark of it",
    ("devices/run_time.py", "Value error, "): "the same",
    ("firmware/c/expression_graph.py", "1 / "): "C text that this file wrote: the formula of an operation",
    ("firmware/c/expression_graph.py", "(1 / "): "the same",
    ("effects/_channel_group.py", "all in "): "what `at` of an effect may say in a device file",
    ("recordings/formats/time_stamps.py", "month first"): "what recording.toml may say of dates",
}


def decisions(text: str) -> Iterator[str]:
    """Every text of several words on which a comparison or a search in a text depends."""
    tree = ast.parse(text)
    named: dict[str, ast.expr] = {}
    for node in tree.body:
        for target in node.targets if isinstance(node, ast.Assign) else []:
            several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
            pairs = zip(target.elts, node.value.elts, strict=False) if several else [(target, node.value)]
            named |= {name.id: value for name, value in pairs if isinstance(name, ast.Name)}

    def words(node: ast.expr) -> Iterator[str]:
        node = named.get(node.id, node) if isinstance(node, ast.Name) else node
        for part in node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]:
            part = named.get(part.id, part) if isinstance(part, ast.Name) else part
            if isinstance(part, ast.Constant) and isinstance(part.value, str) and " " in part.value.strip():
                yield part.value

    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            for side in (node.left, *node.comparators):
                yield from words(side)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in SEARCHES:
            for argument in node.args:
                yield from words(argument)
        elif isinstance(node, ast.MatchValue):
            yield from words(node.value)


@pytest.mark.parametrize(
    "text",
    [
        'held = "acts on nothing" not in why',
        'if note.startswith("as stated"): ...',
        'SAID = "as stated"\nheld = note == SAID',
        'held = note in ("as stated", "by hand")',
        'NONE, SAID = "acts on nothing", "as stated"\nheld = note in (NONE, SAID)',
        'match note:\n    case "as stated":\n        ...',
    ],
)
def test_a_comparison_with_the_words_of_a_message_is_seen(text):
    assert next(decisions(text)) in ("acts on nothing", "as stated")


@pytest.mark.parametrize(
    "text", ['held = kind == "series"', 'unit.removesuffix(" 1")', "held = state is State.NOT_RUN"]
)
def test_one_word_of_a_file_and_a_member_of_an_enumeration_are_no_message(text):
    assert list(decisions(text)) == []


def test_no_decision_depends_on_the_words_of_a_message():
    """What is argued is no message of ours."""
    met = {
        (path.relative_to(PACKAGE).as_posix(), text)
        for path in sorted(PACKAGE.rglob("*.py"))
        for text in decisions(path.read_text())
    }
    assert met - ARGUED.keys() == set()
    assert ARGUED.keys() - met == set(), "argued, but nothing compares it any more"
