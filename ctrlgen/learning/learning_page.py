"""The report of learning from runs: learning.json, drives.csv, figures, one self-contained learning.html."""

from __future__ import annotations

from pathlib import Path

from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.learning.learn import Learning
from ctrlgen.learning.learning_plots import draw_learning, learning_charts
from ctrlgen.learning.learning_record import learning_record
from ctrlgen.learning.run_errors import RunResult
from ctrlgen.learning.sensor_words import left_to_sensor, sensor_words
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure, page_figures
from ctrlgen.reporting.result_file import json_text
from ctrlgen.trajectory.solution_table import table_of_signals

FIGURES = {
    "runs": ("Error per run", "The error that repeats, with its 95 % interval, what was predicted, and the noise."),
    "along": ("Error along the path", "Length of the mean error of each run, and that predicted for the next one."),
    "drives": ("Drives", "Of the best run and of the next one, and their difference."),
}


def write_learning(out: Path, learning: Learning) -> None:
    """Writes learning.json, drives.csv, figures/*.svg and learning.html into the folder `out`."""
    record = learning_record(learning)
    figures = draw_learning(learning)
    write_text(out / "learning.json", json_text(record))
    # row k acts from sample k to sample k + 1
    write_text(out / "drives.csv", table_of_signals(learning.next, ["drive"]))
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    drawn = page_figures(figures, FIGURES, learning_charts(learning))
    page = render(
        Path(__file__).with_name("learning.html.j2"),
        r=record,
        first=first_screen(learning, drawn["runs"]),
        figures=drawn,
        sensor_words=sensor_words(learning),
        device_title=learning.solution.model.device.title,
        player=learning.solution.scenario.sample_time is not None,
    )
    write_text(out / "learning.html", page)


def first_screen(learning: Learning, figure: PageFigure) -> FirstScreen:
    """The error of the best run, what the next one will have, and how to do it."""
    best = learning.runs[learning.base]
    numbers = [(f"best run, {g.name}", f"{shown_error(learning, best, g.name)} {g.unit}") for g in learning.groups]
    numbers += [
        (f"noise of its mean, {g.name}", f"{to_digits(g.shown(best.noise[g.name]), 3)} {g.unit}")
        for g in learning.groups
    ]
    if not learning.stop:
        numbers += [
            (f"predicted for the next, {g.name}", f"{to_digits(g.shown(learning.predicted[g.name]), 3)} {g.unit}")
            for g in learning.groups
        ]
    if learning.response is not None:
        numbers.append(
            ("unexplained of the change between runs", f"{to_digits(100 * learning.response.unexplained, 2)} %")
        )
    if learning.stop:
        steps = [
            "Keep the drives of the best run (`drives.csv`).",
            "If that is not enough, diagnose a run: `ctrlgen diagnose`.",
        ]
        if any(left_to_sensor(learning, g) for g in learning.groups):
            steps.insert(
                1,
                "Where the sensor is known better, state it: `[sensor]` in uncertainty.toml. The same runs then go on.",
            )
    else:
        steps = [
            "Run `drives.csv` on the stage, repeated a few times.",
            "Record that, and call `ctrlgen learn` with it too.",
        ]
    return FirstScreen((verdict(learning),), "ok", figure, tuple(numbers), tuple(steps))


def verdict(learning: Learning) -> str:
    """One sentence: the error of the best run and what the next one will have, or why there is none; one more where the sensor may hide
    more than that error."""
    best = learning.runs[learning.base]
    now = ", ".join(f"{shown_error(learning, best, g.name)} {g.unit} {g.name}" for g in learning.groups)
    hidden = hidden_by_sensor(learning)
    if learning.stop:
        return f"Nothing more to learn: {learning.stop}. Best run: {best.name}, {now}.{hidden}"
    then = ", ".join(f"{to_digits(g.shown(learning.predicted[g.name]), 3)} {g.unit}" for g in learning.groups)
    return f"Best run: {best.name}, {now}. Predicted for the next run: {then}.{hidden}"


def hidden_by_sensor(learning: Learning) -> str:
    """What the sensor may hide of the true error, in the groups where that is more than the error of the best run; empty where in none."""
    best, more = learning.runs[learning.base], list[str]()
    for g in learning.groups:
        may = learning.of_group(learning.sensor.may_feign(), g)
        if may > best.repeating[g.name]:
            more.append(f"{to_digits(g.shown(may), 3)} {g.unit} {g.name}")
    return f" The true error may be up to {', '.join(more)}, which the sensor may hide." if more else ""


def shown_error(learning: Learning, run: RunResult, group: str) -> str:
    """The repeating error of a run in a group's unit; '< 3' where it is not told from zero."""
    g = next(g for g in learning.groups if g.name == group)
    if run.least[group] == 0.0:
        return f"< {to_digits(g.shown(run.most[group]), 2)}"
    return f"{to_digits(g.shown(run.repeating[group]), 3)}"
