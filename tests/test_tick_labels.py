"""The numbers along the axes of a figure that zooms, as Chromium draws them: each is the place where it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from ctrlgen.reporting.chart import Chart, Curve, Panel

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium")
FILES = Path("ctrlgen/reporting")
SCRIPTS = ("vendor/uplot/uPlot.iife.min.js", "chart.js")
NOTED = """
window.told = [];
const draw = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  if (document.contains(this.canvas)) told.push([[...document.querySelectorAll("canvas")].indexOf(this.canvas), text, this.textAlign]);
  return draw.apply(this, arguments);
};
"""
# the lowest and the highest value of a panel
RANGES = [
    *((0.0, high) for high in (0.9, 1.0, 1.3, 2.0, 2.6, 4.1, 7.0)),
    *((-0.9 * 10.0**p, 0.1 * 10.0**p) for p in range(-9, 10, 2)),
    *((1.2003e-3 * (1 - share), 1.2003e-3) for share in (1e-1, 1e-3, 1e-4)),
    *((2.5e8 * (1 - share), 2.5e8) for share in (1e-1, 1e-3, 1e-5)),
    (0.15430, 0.15446),
]


def texts(tmp_path: Path, chart: Chart) -> list[list[tuple[str, str]]]:
    """Of every panel what is written beside it, as (text, alignment)."""
    scripts = "".join(f"<script>{(FILES / name).read_text(encoding='utf-8')}</script>" for name in SCRIPTS)
    page = tmp_path / "page.html"
    page.write_text(
        f'<meta charset="utf-8"><script>{NOTED}</script><figure><figcaption><b>figure</b></figcaption>'
        f'<script type="application/json" class="chart">{chart.json}</script></figure>{scripts}',
        encoding="utf-8",
    )
    browser = Browser()
    try:
        assert browser.open(page) == []
        told = browser.run("told")
    finally:
        browser.close()
    return [[(text, side) for at, text, side in told if at == k] for k in range(len(chart.panels))]


def test_the_numbers_of_a_scale_are_different_and_evenly_spaced(tmp_path):
    x = np.linspace(0.0, 1.0, 5)
    panels = tuple(Panel("value [um]", x, (Curve("a", np.linspace(*ends, 5)),)) for ends in RANGES)
    for ends, told in zip(RANGES, texts(tmp_path, Chart("time [s]", panels)), strict=True):
        scale = list(dict.fromkeys(text for text, side in told if side == "right"))
        steps = np.diff(sorted(float(text) for text in scale))
        assert len(scale) > 2 and steps == pytest.approx(steps[0], rel=1e-4), (ends, scale)
        assert max(map(len, scale)) < 14


@pytest.mark.parametrize(("label", "whole"), [("held-out pose", True), ("time [s]", False)])
def test_what_is_counted_has_whole_numbers(tmp_path, label, whole):
    chart = Chart(label, (Panel("value [um]", np.arange(3), (Curve("a", np.arange(3.0), points=True),)),))
    (told,) = texts(tmp_path, chart)
    along = [text for text, side in told if side == "center" and text != label and "[" not in text]
    assert along and ("1" in along if whole else "1.0" in along) and whole == all("." not in text for text in along)
