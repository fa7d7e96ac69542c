"""HTML pages from templates, each of which stands beside the module that fills it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2

SHARED = Path(__file__).resolve().parent  # what several pages include


def render(template: Path, **values: Any) -> str:
    """The page of the file `template`. Raises jinja2.UndefinedError for a value that is missing."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([template.resolve().parent, SHARED]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template.name).render(**values)
