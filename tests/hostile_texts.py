"""Texts that mean something in a notation of what is written, and what is left of a file when the texts in it are taken out."""

from __future__ import annotations

import io
import json
import re
import tomllib
import zipfile
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from ctrlgen.core.escaping import kconfig, markdown, one_line

FOREIGN = "injected"
SHOWN = (
    "*/ int injected; /*",
    "??/",
    "**??/ / int injected;",
    'x"); injected(); ("%s%n',
    "<script>injected()</script>",
    "]]><injected/><![CDATA[",
    "--><injected/><!--",
    "' onload='injected()",
    "&injected; &#106;",
    "$(shell,injected) $(injected) ${injected} `injected`",
    "$injected$ \\injected{x} $\\frac{",
    "{{ injected }} {% injected %}",
    "[bold]injected[/nope] [link=injected]",
    "| injected | # injected",
    "![injected](javascript:injected)",
    '"""\ninjected = 1\n[injected]',
    "'''\ninjected = 2",
    "=injected()",
    "../../injected",
    "line\nbreak: injected\n\tinjected: yes",
    "ends in a backslash \\",
)
"""Characters that are all shown: a text for readers may have them, and nothing is to come of it."""
UNSEEN = ("a\0b", "a\x1b[31mb", "a\u202eb", "a\u200fb", "a\u2028b", "a\x7fb", "a\ufeffb", "a" * 3000)
"""What no text may have."""
READ = {"title", "source"}
"""Keys of texts for readers; all other texts are names, quantities, files or words of ours."""


def leaves(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], str]]:
    """Place and value of each text of a table."""
    for key, member in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        if isinstance(member, str):
            yield (*path, key), member
        yield from leaves(member, (*path, key))


def replaced(node: Any, path: tuple[Any, ...], value: Any) -> Any:
    """The table with another value at a place; without what is there where the value is None."""
    if not path:
        return value
    copy = dict(node) if isinstance(node, dict) else list(node)
    copy[path[0]] = replaced(copy[path[0]], path[1:], value)
    return copy


_C = re.compile(r'/\*.*?\*/|//[^\n]*|("(?:[^"\\\n]|\\.)*")|\s+', re.DOTALL)
_HASH = re.compile(r"0x[0-9A-Fa-f]{8}|(?<![^\W_])[0-9a-f]{8,}(?:-[0-9a-f]{4,})*")


def skeleton(name: str, content: bytes, title: str) -> Any:
    """What a file says beside the texts of a user, all of which are `title`; the same for files that differ in those alone."""
    kind = Path(name).suffix or Path(name).name
    if kind in (".fmu", ".zip"):
        archive = zipfile.ZipFile(io.BytesIO(content))
        return {entry: skeleton(entry, archive.read(entry), title) for entry in archive.namelist()}
    if kind in (".so", ".bin", ".png"):
        return None
    if kind == ".parquet":
        table = pytest.importorskip("pandas").read_parquet(io.BytesIO(content))
        return list(table.columns), len(table)
    text = content.decode()
    if kind in (".c", ".h", ".ino"):
        spliced = text.replace("??/", "\\").replace("\\\n", "")
        return _HASH.sub("HASH", _C.sub(lambda match: match[1] or " ", spliced))
    if kind in (".html", ".svg"):
        return _Tags.of(text)
    if kind == ".xml":
        return [(node.tag, sorted(node.attrib)) for node in ElementTree.fromstring(text).iter()]
    if kind == ".json":
        return _keys(json.loads(text))
    if kind == ".toml":
        return _keys(tomllib.loads(text))
    if kind == ".csv":
        return [line.count(",") for line in text.splitlines()], text.splitlines()[0]
    written = (markdown if kind == ".md" else kconfig if name.endswith("Kconfig") else one_line)(title)
    return [_HASH.sub("HASH", line.replace(written, "TITLE")) for line in text.split("\n")]


def _keys(node: Any) -> Any:
    """The keys of tables within tables; digests and titles are among the values."""
    if isinstance(node, dict):
        return {key: _keys(member) for key, member in node.items()}
    return [_keys(member) for member in node if isinstance(member, dict | list)] if isinstance(node, list) else None


class _Tags(HTMLParser):
    """The kinds of tags of a page, with the names of their attributes."""

    @classmethod
    def of(cls, text: str) -> set[tuple[str, tuple[str, ...]]]:
        parser = cls()
        parser.found = set()
        parser.feed(text)
        parser.close()
        return parser.found

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.add((tag, tuple(sorted(name for name, _ in attrs))))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
