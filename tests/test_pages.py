"""What every page has in common: frame, contents, scripts and their policy, shares as printed, data of figures that are alive."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.budget.budget_shares import printed_shares
from ctrlgen.core.escaping import json_in_html
from ctrlgen.diagnosis.report.narrative import rest_text
from ctrlgen.reporting.chart import MOST_NUMBERS, Chart, Curve, Panel, kept_places
from ctrlgen.reporting.html import coded, render
from ctrlgen.reporting.numbers import shares_text, with_deviation, with_interval
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.plots import STYLE, plt, svg

VENDOR = ROOT / "ctrlgen" / "reporting" / "vendor"
HOSTILE = "</script><script>alert(1)</script>"
TEMPLATE = """{% extends "page.html.j2" %}{% from "page_parts.html.j2" import section, figure %}
{% block title %}{{ name }}{% endblock %}{% block heading %}{{ name }}{% endblock %}{% block sections %}
{% call section(name) %}one{% endcall %}{% call section(name) %}{{ figure(second) }}{% endcall %}{% endblock %}"""


def curve(n: int = 50, name: str = "a") -> Chart:
    x = np.linspace(0, 1, n)
    return Chart("time [s]", (Panel("y [nm]", x, (Curve(name, np.sin(9 * x)),)),))


def drawing() -> str:
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots()
        axes.semilogy([1, 2], [1e-3, 1e2])
        return svg(figure)


def page_of(folder, chart: Chart | None = None, name: str = "Whole") -> str:
    (folder / "one.html.j2").write_text(TEMPLATE)
    figure = PageFigure(drawing(), name, "what it shows", chart)
    first = FirstScreen((f"{name} is so. `code`",), "ok", figure, ((name, name),), (name,))
    return render(folder / "one.html.j2", name=name, first=first, second=PageFigure(drawing(), name))


def test_the_frame_lists_its_sections_once_each_and_ids_are_unique(tmp_path):
    text = page_of(tmp_path)
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert re.findall(r'<a href="#([^"]+)">Whole', text) == ["whole", "whole-2"]
    # clip paths and markers are named by what they are: the same in two drawings
    named = [one for one in ids if not re.fullmatch(r"[a-z][0-9a-f]{10}", one)]
    assert len(named) == len(set(named)) == 3
    assert text.count("<details") == text.count("</details>") == 2 and "<code>code</code>" in text
    assert 'aria-label="Whole. what it shows"' in text and "10⁻²" in text and "mathdefault" not in text


def test_a_page_lets_no_script_in_but_its_own_and_nothing_from_elsewhere(tmp_path):
    text = page_of(tmp_path, curve())
    scripts = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    hashes = {base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts}
    assert len(scripts) == 3 and hashes == set(re.findall(r"sha256-([^&]+)&#39;", policy))
    assert policy.startswith("default-src &#39;none&#39;") and "unsafe-eval" not in policy
    assert not re.search(r"""(src|href)\s*=\s*["'](?!#)""", text)
    assert "uPlot" not in page_of(tmp_path)


@pytest.mark.parametrize("name", [HOSTILE, "<u>&\"'", "\u2028`<i>`"])
def test_texts_are_escaped_wherever_a_page_has_them(tmp_path, name):
    chart = curve(name=name)
    text = page_of(tmp_path, chart, name)
    assert "alert(1)</script>" not in text and "<u>" not in text and "<i>" not in text
    (data,) = re.findall(r'<script type="application/json" class="chart">(.*?)</script>', text, re.DOTALL)
    assert "<" not in data and json.loads(data)["panels"][0]["curves"][0]["name"] == name
    assert json.loads(json_in_html(json.dumps(name, ensure_ascii=False))) == name


def test_code_is_marked_after_escaping():
    assert coded("use `a<b>` & `c`") == "use <code>a&lt;b&gt;</code> &amp; <code>c</code>"


def test_a_long_curve_keeps_its_range_and_its_gaps_and_is_bounded():
    rng = np.random.default_rng(2)
    values = [rng.standard_normal(200_000) for _ in range(4)]
    values[1][77_777], values[2][5], values[3][1000:90_000] = 50.0, -60.0, np.nan
    panel = Panel("y", np.arange(200_000.0), tuple(Curve(str(k), v) for k, v in enumerate(values)))
    kept = kept_places(panel)
    assert len(kept) * (1 + len(values)) <= MOST_NUMBERS and np.all(np.diff(kept) > 0)
    assert {0, 5, 77_777, 199_999} <= set(kept.tolist())
    for v in values:
        assert np.nanmin(v[kept]) == np.nanmin(v) and np.nanmax(v[kept]) == np.nanmax(v)
    assert np.isnan(values[3][kept]).any()
    chart = Chart("t", (panel,))
    assert "Of 200,000 samples" in chart.thinned and len(chart.json) < 150_000 and curve().thinned == ""
    assert json.loads(chart.json)["panels"][0]["curves"][3]["y"].count(None) > 1


@pytest.mark.parametrize(
    "shares", [[1 / 3] * 3, [0.824, 0.1232, 0.0528], [1.2, -0.2], [1.0], [0.00049] * 7 + [0.99657]]
)
def test_shares_add_up_as_they_are_printed(shares):
    texts = shares_text(shares)
    assert sum(round(10 * float(t.removesuffix(" %"))) for t in texts) == 1000
    assert all(abs(float(t.removesuffix(" %")) - 100 * s) < 0.1 + 1e-9 for t, s in zip(texts, shares, strict=True))


@pytest.mark.parametrize(("shares", "common"), [([0.5, 0.3, 0.15, 0.05], ""), ([0.7, 0.1, 0.1, 0.0], "10.0 %")])
def test_the_shares_of_a_budget_add_up_with_what_is_not_shown(shares, common):
    lines = [SimpleNamespace(effects=[SimpleNamespace(share=s)]) for s in shares]
    record = SimpleNamespace(groups=[SimpleNamespace(name="g")], contributors=lines)
    printed = printed_shares(record, 2)["g"]
    assert printed.common == common and printed.total == "100.0 %" and len(printed.rows) == 2
    told = [*printed.rows, printed.more, printed.common or "0 %"]
    assert sum(float(t.removesuffix(" %")) for t in told) == pytest.approx(100)


def test_vendored_files_are_those_that_are_named():
    listed = dict(
        re.findall(r"^\| `([^`]+)` \| `([0-9a-f]{64})` \|$", (VENDOR / "README.md").read_text(), re.MULTILINE)
    )
    files = {str(p.relative_to(VENDOR)) for p in VENDOR.rglob("*") if p.is_file() and p.name != "README.md"}
    assert files == set(listed)
    for name, digest in listed.items():
        assert hashlib.sha256((VENDOR / name).read_bytes()).hexdigest() == digest


@pytest.mark.parametrize(
    ("shares", "rest"), [((0.614, 0.254), "14 %"), ((0.614, 0.0046), "38.5 %"), ((0.9996,), "< 0.1 %"), ((), "")]
)
def test_the_shares_of_findings_and_what_is_left_add_up_as_they_are_printed(shares, rest):
    """Each is rounded by itself, as the sentences have it; what is left makes the whole of them."""
    findings = [
        SimpleNamespace(effect=f"law{k}", location="a", share=SimpleNamespace(value=v)) for k, v in enumerate(shares)
    ]
    left = SimpleNamespace(rest=SimpleNamespace(value=1 - sum(shares)))
    assert rest_text(SimpleNamespace(findings=findings, attribution=left)) == rest


def test_a_number_ends_with_the_digits_of_its_deviation():
    assert with_deviation(-1.508241, 0.00612) == "-1.5082 ± 0.0061"
    assert with_deviation(64291.0, 123.0) == "64291 ± 123"
    assert with_deviation(0.25, 0.0) == "0.25"


def test_a_number_and_its_interval_end_with_the_digits_that_are_known():
    assert with_interval(25.8111, (25.1775, 26.4447)) == ("25.81", "25.18", "26.44")
    assert with_interval(4.40016, (4.39978, 4.40054)) == ("4.40016", "4.39978", "4.40054")
    assert with_interval(1234.5, (1000.0, 1469.0)) == ("1234", "1000", "1469")
    assert with_interval(3e-9, (2e-9, 4e-9)) == ("3.00000e-09", "2.00000e-09", "4.00000e-09")
    assert with_interval(5.0, (5.0, 5.0)) == ("5", "5", "5")


@pytest.mark.parametrize("made_by", sorted(Path("ctrlgen").glob("*/*_page.py")), ids=lambda path: path.stem)
def test_the_figure_of_the_first_screen_is_not_drawn_again_below(made_by):
    code = made_by.read_text(encoding="utf-8")
    shown_first = set(re.findall(r"first=\w+\([^\n]*\w+\[\"(\w+)\"\]\)", code))
    for template in re.findall(r'with_name\("(\w+\.html\.j2)"\)', code):
        below = re.findall(r"figure\(figures\.(\w+)\)", made_by.with_name(template).read_text(encoding="utf-8"))
        assert not shown_first & set(below)
