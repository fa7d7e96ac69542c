"""Texts of users as they may stand in what is written: one function for each notation, used by every writer and template.

HTML and XML are escaped by jinja (`autoescape`, `| e`), SVG by matplotlib, JSON and CSV by Python's own modules.
"""

from __future__ import annotations

import re

from tomlkit import string

from ctrlgen.core.file_limits import LONGEST_TEXT

MARKDOWN = re.compile(r"([\\`*_\[\]<>|&~$#])")
FORMULA = ("=", "+", "-", "@")


def one_line(text: str) -> str:
    """`text` with every run of white space, line ends included, as one space: for properties files and help texts."""
    return " ".join(text.split())


def c_comment(text: str) -> str:
    """`text` inside a block comment of C, on one line: it neither ends the comment nor begins another one, and holds no trigraph."""
    text = one_line(text).replace("*/", "* /").replace("/*", "/ *")
    return re.sub(r"\?(?=\?)", "? ", text).rstrip("\\")


def c_format(text: str) -> str:
    """`text` inside a format of printf of C."""
    return re.sub(r'(["\\?])', r"\\\1", one_line(text)).replace("%", "%%")


def kconfig(text: str) -> str:
    """`text` in a line of Kconfig, without macros: `$(shell,...)` would be run."""
    return one_line(text).replace("$(", "$ (")


def markdown(text: str) -> str:
    """`text` in a paragraph or a cell of Markdown, every character as itself; no HTML, no link, no formula."""
    return MARKDOWN.sub(r"\\\1", one_line(text))


def markdown_code(text: str) -> str:
    """`text` as code in a paragraph or a cell of Markdown."""
    return f"`{one_line(text).replace('`', chr(39)).replace('|', chr(92) + '|')}`"


def toml(text: str) -> str:
    """`text` as a string of TOML, quotes included; cut to the longest that is read again."""
    return string(text if len(text) <= LONGEST_TEXT else f"{text[: LONGEST_TEXT - 1]}…").as_string()


def csv_cell(text: str) -> str:
    """`text` as a cell that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(FORMULA) else text


def json_in_html(text: str) -> str:
    """JSON `text` inside a script element of HTML: no `</script>`, no comment, no character that ends a line of a script."""
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text
