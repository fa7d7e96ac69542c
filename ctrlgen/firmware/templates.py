"""Renders the templates in `codegen/templates/`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

from ctrlgen.core.files import write_text
from ctrlgen.core.shipped_files import shipped


def codegen_folder() -> Path:
    """Templates and harness."""
    return shipped("codegen")


def render(template: str, context: dict[str, Any]) -> str:
    """`template` of `codegen/templates/` with `context`. A name that the template asks for and does not get is an error."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(codegen_folder() / "templates"),
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
    return environment.get_template(f"{template}.j2").render(context)


def write(template: str, context: dict[str, Any], path: Path) -> Path:
    """`render`, written to `path`, which is returned."""
    write_text(path, render(template, context))
    return path


def comment(text: str) -> str:
    """`text` as it may stand inside a C comment, on one line."""
    return " ".join(text.split()).replace("*/", "* /").replace("/*", "/ *")
