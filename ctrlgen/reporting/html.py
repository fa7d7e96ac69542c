"""HTML pages from templates, each of which stands beside the module that fills it; `page.html.j2` is the frame of all.

A page needs nothing from elsewhere, and its Content-Security-Policy lets nothing in: no address, and no script but those of this
folder, by their SHA-256. What it lists of itself while it is written (sections, figures that are alive) is in `PageParts`.
"""

from __future__ import annotations

import base64
import hashlib
import re
from functools import cache
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from ctrlgen.core.compiled_templates import environment as templates
from ctrlgen.core.counts import number_of
from ctrlgen.core.to_digits import to_digits
from ctrlgen.reporting.numbers import with_interval

SHARED = Path(__file__).resolve().parent  # what several pages include
FOLDING = "page.js"
CHARTS = ("vendor/uplot/uPlot.iife.min.js", "chart.js")
CHART_STYLES = ("vendor/uplot/uPlot.min.css", "chart.css")


class PageParts:
    """What a page lists of itself while it is written: `sections` (id, title) in their order, and whether it `has_live` figures."""

    def __init__(self) -> None:
        self.sections: list[tuple[str, str]] = []
        self.has_live = False

    def section(self, title: str, id_: str | None = None) -> str:
        """Lists a section; its id, which is unique on the page."""
        wanted = id_ or re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
        taken, name, k = {"contents", *(known for known, _ in self.sections)}, wanted, 2
        while name in taken:
            name, k = f"{wanted}-{k}", k + 1
        self.sections.append((name, title))
        return name

    def live(self) -> str:
        """Called where a figure has data: the page then carries the scripts that draw it."""
        self.has_live = True
        return ""

    @property
    def policy(self) -> str:
        """Content-Security-Policy: nothing from elsewhere, no script but ours."""
        hashes = " ".join(f"'sha256-{_digest(name)}'" for name in (FOLDING, *CHARTS))
        return f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src {hashes}; base-uri 'none'; form-action 'none'"

    @property
    def chart_style(self) -> Markup:
        """Style sheets of figures that are alive."""
        return Markup("\n").join(Markup(_file(name)) for name in CHART_STYLES)

    @property
    def scripts(self) -> Markup:
        """The script elements that the page needs."""
        names = (FOLDING, *CHARTS) if self.has_live else (FOLDING,)
        return Markup("\n").join(Markup("<script>{}</script>").format(Markup(_file(name))) for name in names)


@cache
def _file(name: str) -> str:
    return (SHARED / name).read_text(encoding="utf-8").strip()


@cache
def _digest(name: str) -> str:
    """SHA-256 in base 64, as a policy names a script."""
    return base64.b64encode(hashlib.sha256(_file(name).encode()).digest()).decode()


def coded(text: str) -> Markup:
    """`text` escaped, with what stands between `backticks` as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def render(template: Path, **values: Any) -> str:
    """The page of the file `template`. Raises jinja2.UndefinedError for a value that is missing."""
    environment = templates([template.resolve().parent, SHARED], autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.globals["page"] = PageParts()
    environment.filters["coded"] = coded
    environment.filters["number_of"] = number_of
    environment.filters["to_digits"] = to_digits
    environment.filters["with_interval"] = with_interval
    return environment.get_template(template.name).render(**values)
