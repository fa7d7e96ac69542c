"""Lines and points are told apart without their colour; every drawing of every test is held to it by conftest."""

from __future__ import annotations

import ast
import re
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT
from told_apart import alike_in_chart, alike_in_drawing

from ctrlgen.app.simulated import draw_signals, simulate_device
from ctrlgen.diagnosis.report.plot_uncertainty import WIDE_LABEL, draw_rivals
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.chart_drawing import chart_svg, draw_chart
from ctrlgen.reporting.line_patterns import DASHES, MARKS
from ctrlgen.reporting.plots import STYLE, plt
from ctrlgen.trajectory.solution_charts import chart_solution
from ctrlgen.trajectory.solution_plots import draw_path, draw_solution


def _chart(lines: int, points: bool, alike: bool = False) -> Chart:
    x = np.linspace(0, 1, 50)
    curves = (Curve(f"c{k}", x + k, 0, 0 if alike else k, points=points) for k in range(lines))
    return Chart("x", (Panel("y", x, tuple(curves), height=400),))


@pytest.mark.parametrize("points", [False, True])
def test_every_series_of_a_figure_has_dashes_or_a_mark_of_its_own(points):
    chart = _chart(len(DASHES), points)
    assert not alike_in_drawing(chart_svg(chart)) and not alike_in_chart(chart.json)
    same = _chart(2, points, alike=True)
    assert alike_in_chart(same.json)
    with pytest.raises(AssertionError, match="told apart"):
        chart_svg(same)


def test_the_legend_of_twelve_lines_covers_no_data():
    with plt.rc_context(STYLE):
        figure = draw_chart(_chart(len(DASHES), points=False))
        figure.draw_without_rendering()
    legend, panel = figure.axes[0].get_legend().get_window_extent(), figure.axes[0].get_window_extent()
    assert legend.y0 >= panel.y1 and 0 <= legend.x0 < legend.x1 <= figure.bbox.x1
    plt.close(figure)


def test_legends_of_a_path_and_of_what_was_simulated_stand_above_their_panels(circle):
    moved = simulate_device(
        ROOT / "scenarios" / "devices" / "mems_hexapod.toml", None, "1X=0.1W", duration=0.02, rate=1000.0
    )
    with plt.rc_context(STYLE):
        for figure in (draw_path(circle), draw_signals(moved)):
            figure.draw_without_rendering()
            of_panels = [(panel.get_legend(), panel.get_window_extent()) for panel in figure.axes]
            legends = [(legend.get_window_extent(), panel) for legend, panel in of_panels if legend is not None]
            assert len(legends) > 1 and all(legend.y0 >= panel.y1 for legend, panel in legends)
            assert all(-1 <= legend.x0 < legend.x1 <= figure.bbox.x1 + 1 for legend, _ in legends)
            plt.close(figure)


def test_the_axis_of_rival_models_is_named_whole_beside_names_as_wide_as_they_come():
    none = SimpleNamespace(causes=())
    rounds = [SimpleNamespace(candidates=[none], criteria=[0.0], criterion_before=1.0, before=none)]
    chosen = SimpleNamespace(fit=SimpleNamespace(structure=none))
    with plt.rc_context(STYLE):
        figure = draw_rivals(SimpleNamespace(search=SimpleNamespace(rounds=rounds, chosen=chosen)))
        figure.axes[0].set_yticks([0], ["x" * WIDE_LABEL])
        figure.draw_without_rendering()
        name = figure.axes[0].xaxis.label.get_window_extent()
        plt.close(figure)
    assert figure.bbox.x0 <= name.x0 and name.x1 <= figure.bbox.x1


@pytest.mark.long
def test_no_legend_of_the_program_is_placed_inside_a_panel():
    """Outside the figure's panels, or anchored at an edge of its own: what is placed `best` covers a curve where none is free."""
    placed = []
    for file in sorted((ROOT / "ctrlgen").rglob("*.py")):
        for call in ast.walk(ast.parse(file.read_text())):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr == "legend":
                words = {word.arg: ast.unparse(word.value) for word in call.keywords}
                placed.append((file.name, "bbox_to_anchor" in words or "outside" in words.get("loc", "")))
    assert len(placed) > 5 and all(outside for _, outside in placed), placed


def test_dashes_of_a_drawing_are_as_long_as_those_of_the_page():
    """An inch has 96 pixels of a page and 72 points of a drawing."""
    drawn = re.findall(r"stroke-dasharray: ([0-9. ,]+)", chart_svg(_chart(2, points=False)))
    assert [float(n) for n in drawn[0].split(",")] == pytest.approx([n * 72 / 96 for n in DASHES[1]])


def test_patterns_differ_and_every_mark_is_drawn_by_the_page():
    assert len(set(DASHES)) == len(DASHES) == len(MARKS) == len(set(MARKS))
    script = (ROOT / "ctrlgen" / "reporting" / "chart.js").read_text()
    drawn = re.findall(r'["{ ]"?([^\s"])"?: (?:ring|\[\[)', script)
    assert set(MARKS) <= set(drawn)


def test_the_figures_of_a_solution_have_no_two_series_alike(circle):
    for drawing in draw_solution(circle).values():
        assert not alike_in_drawing(drawing)
    for chart in chart_solution(circle).values():
        assert not alike_in_chart(chart.json)
