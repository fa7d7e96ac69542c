"""Figures and the first screen of a page, as the templates take them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from markupsafe import Markup, escape

from ctrlgen.reporting.chart import Chart

# What matplotlib numbers in every figure alike, and nothing refers to; ids of clip paths and markers are hashes
NUMBERED = re.compile(r' id="[A-Za-z0-9.]+_\d+"')


@dataclass(frozen=True)
class PageFigure:
    """A drawing with its `title` and `caption`, and, where it is alive, the `chart` that replaces it on a screen with JavaScript, or that
    stands below it where the drawing shows what the chart does not, `kept`."""

    svg: str
    title: str
    caption: str = ""
    chart: Chart | None = None
    kept: bool = False

    @property
    def image(self) -> Markup:
        """The drawing, named for who does not see it; without the ids that other drawings of the page have too."""
        named = f'<svg role="img" aria-label="{escape(f"{self.title}. {self.caption}".strip())}"'
        return Markup(NUMBERED.sub("", self.svg).replace("<svg", named, 1))


def page_figures(
    svgs: Mapping[str, str],
    words: Mapping[str, tuple[str, str]],
    charts: Mapping[str, Chart] | None = None,
    kept: tuple[str, ...] = (),
) -> dict[str, PageFigure]:
    """The figures of a page by name; `words`: title and caption of each, a name without any is its own title; `kept`: drawings that stay
    above their charts."""
    charts = charts or {}
    # underscores stand for spaces in the names of files alone, not in those of symbols
    titles = {name: name if " " in name else name.replace("_", " ") for name in svgs}
    told = {name: words.get(name, (title[:1].upper() + title[1:], "")) for name, title in titles.items()}
    return {name: PageFigure(text, *told[name], charts.get(name), name in kept) for name, text in svgs.items()}


@dataclass(frozen=True)
class FirstScreen:
    """What a page says before anything else: the `answer`, of which the first sentence is in bold; whether it is good ("ok"), bad
    ("bad") or neither ("so"); the one `figure` that shows it; the `numbers` that matter (name, value); what to do next, `steps`.

    In sentences and steps `backticks` mark code.
    """

    answer: tuple[str, ...]
    state: str
    figure: PageFigure | None
    numbers: tuple[tuple[str, str], ...] = ()
    steps: tuple[str, ...] = ()
