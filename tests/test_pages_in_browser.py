"""Every kind of page in headless Chromium: silent console, fits a telephone, nothing lost in print, accessible, figures that zoom."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from conftest import AXIS_FILE, DEVICES, ROOT
from creeping_axis import LAWS, creeping_recording

import ctrlgen
from ctrlgen.app.batch_page import batch_page
from ctrlgen.app.batch_row import BatchRow
from ctrlgen.app.scenario_pipeline import map_workspace
from ctrlgen.budget.budget_page import write_budget
from ctrlgen.budget.budget_section import budget_section
from ctrlgen.budget.error_budget import budget_of
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.controller.bode_page import write_bode_page
from ctrlgen.diagnosis.report.diagnosis_record import Provenance
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.trajectory.solution_plots import draw_solution
from ctrlgen.trajectory.workspace import middle_pose
from ctrlgen.verification.scenario_report import write_report

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here: apt-get install chromium"),
]
AXE = ROOT / "tests" / "vendor" / "axe-core" / "axe.min.js"
OPEN = "document.querySelectorAll('details').forEach(one => { one.open = true; }); new Promise(done => setTimeout(done, 300))"
# drawings are pictures with a name; what is in them is text that a reader of screens does not reach
RULES = "axe.run({exclude: [['svg']]}, {resultTypes: ['violations']})"
SERIOUS = "v => ['serious', 'critical'].includes(v.impact)"
NAMES = ("run", "budget", "diagnosis", "bode", "workspace", "batch")


@pytest.fixture(scope="module")
def browser():
    running = Browser()
    yield running
    running.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory, circle) -> dict[str, Path]:
    """One page of each kind, by its name."""
    out = tmp_path_factory.mktemp("pages")
    write_report(out, circle, None, (), None, draw_solution(circle), budget_section(circle))
    write_budget(out, budget_of(circle, load_uncertainties(circle.scenario, circle.model), draws=0))
    found = ctrlgen.diagnose(AXIS_FILE, creeping_recording(out / "recording"), laws=LAWS)
    (out / "diagnosis.html").write_text(page(found, Provenance({}, 0)))
    axis = ctrlgen.build_model(ctrlgen.load_device(AXIS_FILE))
    write_bode_page(axis, middle_pose(axis), out / "bode.html")
    map_workspace(ctrlgen.load_device(DEVICES / "rrr_case1.toml"), [], out / "workspace")
    row = BatchRow("a--0", "done", "explained", "creep at stage:axis", "reading.axis", 12.0, 5.0, 5.0, "nm")
    rows = [replace(row, name=f"{'abcde'[k % 5]}--{k}", before=12.0 + 40 * (k == 9)) for k in range(12)]
    for one in rows:
        (out / one.name).mkdir()
        error = f'{{"rms_before": {one.before}, "rms_after": 5, "noise_floor": 5, "unit": "nm"}}'
        (out / one.name / "diagnosis.json").write_text(f'{{"held_out": {{"reading.axis": {error}}}, "findings": []}}')
    (out / "batch.html").write_text(batch_page([*rows, BatchRow("f--1", "failed", error="<b>")], out, "all"))
    files = {"run": "report.html", "workspace": "workspace/workspace.html"}
    return {name: out / files.get(name, f"{name}.html") for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_page_is_silent_fits_a_telephone_and_is_accessible(browser, pages, name):
    for dark in (False, True):
        assert browser.open(pages[name], dark=dark) == []
        browser.run(OPEN)
        browser.run(AXE.read_text() + "; 0")
        script = f"{RULES}.then(found => found.violations.filter({SERIOUS}).map(v => [v.id, v.nodes[0].html, v.nodes[0].failureSummary]))"
        assert browser.run(script) == []
    assert browser.open(pages[name], width=400) == []
    browser.run(OPEN)
    assert browser.run("document.documentElement.scrollWidth") <= 400


@pytest.mark.parametrize("name", NAMES)
def test_the_first_screen_has_answer_figure_numbers_and_steps(browser, pages, name):
    browser.open(pages[name], width=1280, height=900)
    for what in (".answer p", ".first figure", ".numbers dd", ".next li"):
        assert browser.run(f"document.querySelector('{what}').getBoundingClientRect().top") < 800, what


@pytest.mark.parametrize("name", NAMES)
def test_print_shows_what_is_folded_and_drawings_for_figures(browser, pages, name):
    browser.open(pages[name], media="print")
    inside = "[...d.children].slice(1).map(c => c.getBoundingClientRect().height)"
    heights = browser.run(f"[...document.querySelectorAll('details:not([open])')].map(d => {inside})")
    assert heights and all(min(each) > 0 for each in heights if each)
    assert browser.run("[...document.querySelectorAll('.live')].every(one => !one.getBoundingClientRect().height)")
    assert browser.run("[...document.querySelectorAll('.static')].every(one => one.getBoundingClientRect().height > 0)")


VALUES = "[...document.querySelectorAll('.first .u-legend .u-series:nth-child(2) .u-value')].map(v => v.textContent)"
TICKS = "[...document.querySelectorAll('.first .u-over')].map(o => o.getBoundingClientRect()).map(r => [r.left, r.top, r.width, r.height])"


def mouse(browser, kind: str, x: float, y: float, **more) -> None:
    browser.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


def test_a_figure_shows_its_values_in_all_panels_and_zooms(browser, pages):
    browser.open(pages["diagnosis"])
    (left, top, width, height), *others = browser.run(TICKS)
    assert others
    mouse(browser, "mouseMoved", left + width / 2, top + height / 2)
    shown = browser.run(VALUES)
    assert len(shown) == 1 + len(others) and all(np.isfinite(float(v)) for v in shown)
    whole = [float(v) for v in browser.run(VALUES.replace("nth-child(2)", "nth-child(1)"))]
    assert whole == pytest.approx([whole[0]] * len(whole)) and whole[0] == pytest.approx(0.3, rel=0.02)
    held = {"button": "left", "buttons": 1, "clickCount": 1}
    mouse(browser, "mousePressed", left + width / 4, top + 20, **held)
    mouse(browser, "mouseMoved", left + width / 2, top + 20, **held)
    mouse(browser, "mouseReleased", left + width / 2, top + 20, **held)
    mouse(browser, "mouseMoved", left + 1, top + 20)
    place = VALUES.replace("nth-child(2)", "nth-child(1)")
    assert [float(v) for v in browser.run(place)] == pytest.approx([0.15] * len(shown), abs=0.005)
    browser.run("document.querySelector('.first .bar button:last-child').click()")
    mouse(browser, "mouseMoved", left + 2, top + 21)
    assert float(browser.run(place)[0]) == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize("name", NAMES)
def test_the_legend_of_a_figure_tells_its_series_apart_without_colour(browser, pages, name):
    browser.open(pages[name])
    browser.run(OPEN)
    marks = "[...one.querySelectorAll('.u-marker path')].map(p => p.getAttribute('d') + p.style.strokeDasharray)"
    for shown in browser.run(f"[...document.querySelectorAll('.uplot')].map(one => {marks})"):
        assert shown and len(set(shown)) == len(shown)


@pytest.mark.parametrize("name", NAMES)
def test_no_label_of_an_axis_is_longer_than_its_panel_is_high(browser, pages, name):
    browser.open(pages[name])
    browser.run(OPEN)
    labels = "JSON.parse(one.querySelector('script.chart').textContent).panels.map(p => p.label)"
    heights = "[...one.querySelectorAll('.u-over')].map(o => o.clientHeight)"
    pen = "document.createElement('canvas').getContext('2d')"
    length = f"(pen => {{ pen.font = '12px system-ui, sans-serif'; return pen.measureText(LABEL).width; }})({pen})"
    for shown, high in browser.run(f"[...document.querySelectorAll('figure.alive')].map(one => [{labels}, {heights}])"):
        assert len(shown) == len(high)
        for label, height in zip(shown, high, strict=True):
            assert browser.run(length.replace("LABEL", repr(label))) <= height, label
