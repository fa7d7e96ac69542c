"""The drawings without matplotlib: what is drawn is where it is said to be, and nothing covers it."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from told_apart import SPACE, alike_in_drawing

from ctrlgen.reporting.plain_drawing import Axes, Bar, Series, bars_svg, numerals, panels_svg, ticks

X = np.linspace(0.0, 1.0, 40)


def paths(text: str, style: str) -> list[np.ndarray]:
    """The places (n, 2) of the lines of a drawing whose style holds `style`."""
    root = ET.fromstring(text)
    legends = {path for g in root.iter(f"{SPACE}g") for path in g.iter()}
    drawn = [e for e in root.iter(f"{SPACE}path") if e not in legends and style in (e.get("style") or "")]
    return [np.array(re.findall(r"[ML](\S+) ([^ML]+)", e.get("d") or ""), float) for e in drawn]


@pytest.mark.parametrize(
    ("ends", "told", "power"),
    [
        ((-0.0105, 0.0105), ["\u22120.010", "\u22120.005", "0.000", "0.005", "0.010"], 0),
        ((0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"], 0),
        ((-11.0, 11.0), ["\u221210", "\u22125", "0", "5", "10"], 0),
        ((0.0, 2.1e6), ["0.0", "0.5", "1.0", "1.5", "2.0"], 6),
        ((1e-9, 5.2e-9), ["1", "2", "3", "4", "5"], -9),
    ],
)
def test_ticks_are_round_numbers_that_differ(ends, told, power):
    places, of_ten = ticks(*ends, 5)
    assert numerals(places, of_ten) == told and of_ten == power


def test_ticks_of_samples_are_whole_numbers():
    assert numerals(*ticks(-0.1, 2.1, 8, whole=True)) == ["0", "1", "2"]


def test_a_line_is_drawn_to_scale_where_its_axes_say_and_interrupted_where_there_is_no_number():
    y = 3.0 + 2.0 * X
    y[20] = np.nan
    text = panels_svg((Axes("x", "y", (Series("a", X, y, "#0072b2"),)),), (1,), 6.0, 3.0)
    (line,) = paths(text, "#0072b2")
    assert len(line) == 39 and text.count("M", text.index("</g>")) > 1
    slope = np.diff(line[:, 1]) / np.diff(line[:, 0])
    assert np.allclose(slope, slope[0], rtol=0.1) and slope[0] < 0
    assert line.min() > 0 and line[:, 0].max() < 6 * 72 and line[:, 1].max() < 3 * 72


def test_a_long_line_keeps_its_peaks_and_its_ends():
    x, y = np.linspace(0, 1, 50_000), np.zeros(50_000)
    y[[23_457, 40_001]] = 1.0, -0.5
    text = panels_svg((Axes("x", "y", (Series("a", x, y, "#0072b2"),)),), (1,), 6.0, 3.0)
    (line,) = paths(text, "#0072b2")
    assert len(line) < 3100 and np.all(np.diff(line[:, 0]) >= 0)
    low, zero, high = line[:, 1].max(), line[0, 1], line[:, 1].min()
    assert (zero - high) == pytest.approx(2 * (low - zero), abs=0.3) and line[-1, 1] == zero


def test_both_axes_of_a_path_have_one_scale():
    turn = 2 * np.pi * X
    circle = Axes("x", "y", (Series("a", np.cos(turn), np.sin(turn), "#0072b2"),), equal=True)
    (line,) = paths(panels_svg((circle,), (1,), 8.0, 3.0), "#0072b2")
    assert np.ptp(line[:, 0]) == pytest.approx(np.ptp(line[:, 1]), rel=0.01)


def test_the_legend_stands_above_its_panel_in_rows_that_fit():
    names = [f"a channel with a long name {k}" for k in range(6)]
    series = tuple(Series(name, X, X + k, "#0072b2", k) for k, name in enumerate(names))
    text = panels_svg((Axes("x", "y", series), Axes("x", "y", series[:1])), (1, 1), 8.0, 3.0)
    assert not alike_in_drawing(text)
    root = ET.fromstring(text)
    legend = next(g for g in root.iter(f"{SPACE}g") if g.get("id") == "legend_1")
    told = [(e.text, float(e.get("x")), float(e.get("y"))) for e in legend.iter(f"{SPACE}text")]
    assert [name for name, *_ in told] == names
    below = [line[:, 1].min() for line in paths(text, "#0072b2") if line[0, 0] < 4 * 72]
    assert len(below) == 6 and max(y for *_, y in told) < min(below)
    assert all(0 < x < 4 * 72 - 0.5 * 8 * len(name) for name, x, _ in told)


def test_series_that_only_colour_tells_apart_are_found():
    alike = tuple(Series(name, X, X, colour) for name, colour in (("a", "#0072b2"), ("b", "#d55e00")))
    with pytest.raises(AssertionError, match="told apart"):
        panels_svg((Axes("x", "y", alike),), (1,), 6.0, 3.0)


def test_bars_are_as_long_as_they_say_and_texts_are_escaped():
    text = bars_svg((Bar("<a>", 10.0, "#0072b2", "b & c"), Bar("d", 50.0, "#0072b2", "")), "left [%]", 8.0, 2.0)
    assert [e.text for e in ET.fromstring(text).iter(f"{SPACE}text")][-5:] == ["<a>", "b & c", "d", None, "left [%]"]
    lengths = [float(x) for x in re.findall(r"h([0-9.]+)v", text)]
    assert lengths[1] == pytest.approx(5 * lengths[0], rel=1e-3)


def test_the_pipeline_of_a_scenario_does_without_matplotlib():
    words = "import sys; import ctrlgen.app.scenario_pipeline; print('matplotlib' in sys.modules, 'scipy.spatial' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True)
    assert done.stdout.split() == ["False", "False"]
