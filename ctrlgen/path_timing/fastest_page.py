"""The report of a fastest motion: fastest.json, figures, one self-contained fastest.html."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import from_si, show
from ctrlgen.path_timing.binding import Binding
from ctrlgen.path_timing.fastest import FastestPath
from ctrlgen.path_timing.fastest_plots import bound_text, draw_fastest
from ctrlgen.path_timing.fastest_record import fastest_record, small_unit
from ctrlgen.path_timing.retimed import write_inputs
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.html import render
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure, page_figures
from ctrlgen.reporting.result_file import json_text

FIGURES = {
    "path": ("Path and speed", "Coloured where a limit binds; dots are the set-points."),
    "binding": ("Which limit binds where", "Along the path; a row a limit, in the colours of the path."),
    "drives": ("Drives", "Held from sample to sample; dashed: their bounds."),
}
SHOWN_RUNS = 4  # runs of a limit in a table


def write_fastest(out: Path, motion: FastestPath) -> None:
    """Writes fastest.json, figures/path.svg, figures/binding.svg, figures/drives.svg, fastest.html and, in scenario/, the set-points as
    a scenario into the folder `out`; those at a frequency in at_frequency/scenario/."""
    record = fastest_record(motion)
    figures = draw_fastest(motion)
    write_text(out / "fastest.json", json_text(record))
    for name, text in figures.items():
        write_text(out / "figures" / f"{name}.svg", text)
    write_inputs(out / "scenario", motion.solution.scenario)
    repeated = motion.repetition.solution if motion.repetition else None
    if repeated is not None:
        write_inputs(out / "at_frequency" / "scenario", repeated.scenario)
    drawn = page_figures(figures, FIGURES, {"drives": drives_chart(motion)})
    page = render(
        Path(__file__).with_name("fastest.html.j2"),
        f=record,
        first=first_screen(motion, drawn["path"]),
        figures=drawn,
        device_title=motion.solution.model.device.title,
        rows=motions(motion),
        bindings=[(b, bound_text(b), runs_text(b)) for b in motion.bindings],
        between=between_text(motion),
        repeated=repetition_sentence(motion),
        scenario_file=motion.solution.scenario.path.name,
        repeated_file=None if repeated is None else repeated.scenario.path.name,
    )
    write_text(out / "fastest.html", page)


def drives_chart(motion: FastestPath) -> Chart:
    """The drives, held from sample to sample, beside their bounds."""
    signal, (low, high) = motion.solution.model.signals["drive"], motion.solution.model.u_bounds
    values, unit = motion.solution.drive, signal.units[0]
    curves = tuple(
        Curve(channel, from_si(values[:, i], its), i, i, held=True)
        for i, (channel, its) in enumerate(zip(signal.channels, signal.units, strict=True))
    )
    bounds = sorted({float(from_si(b, unit)) for b in (*low, *high) if np.isfinite(b)})
    rules = tuple((b, "bound") for b in bounds)
    at = 1e3 * np.asarray(motion.solution.trace.time[: len(values)])
    return Chart("time [ms]", (Panel(f"drive [{unit}]", at, curves, rules=rules),))


def first_screen(motion: FastestPath, figure: PageFigure) -> FirstScreen:
    """How fast the path can be followed, what bounds it, and where its set-points and their C are."""
    rows = motions(motion)
    _, time, times = rows[3]
    often = f" ({times})" if times and motion.curve.closed else ""
    bound = [f"{b.side.limit.label} {b.side.name} {bound_text(b)}" for b in motion.bindings[:1]]
    first = f", bounded longest by {bound[0]}" if bound else ""
    answer = [f"The fastest set-points take {time}{often}{first}; in continuous time {rows[4][1]}."]
    if repeated := repetition_sentence(motion):
        answer.append(f"{repeated[0].upper()}{repeated[1:]}.")
    numbers = [(what, time) for what, time, _ in rows]
    numbers += [
        (f"{b.side.limit.label} {b.side.name} binds", f"{100 * b.share_of_time:.1f} % of the time")
        for b in motion.bindings[:2]
    ]
    scenario = motion.solution.scenario.path.name
    steps = [
        f"Play the C in `player/`, or solve `scenario/{scenario}` with `ctrlgen run` for the online controller too.",
        "Hold it to what is uncertain: `ctrlgen budget` reads the same scenario.",
    ]
    if motion.bindings:
        steps.append(f"Only more room in {bound[0]} makes it faster: no other limit binds for as long.")
    return FirstScreen(tuple(answer), "ok", figure, tuple(numbers), tuple(steps))


def motions(motion: FastestPath) -> list[tuple[str, str, str]]:
    """Rows of the table of motions: what, how long or why not, and how often a second or times as fast as stated."""
    rows: list[tuple[str, float | None]] = [
        ("as the scenario states it", motion.given),
        ("by its own law of time, no faster", motion.stated),
        ("at even speed along the path, no faster", motion.even),
        ("by the fastest law of time, set-points", motion.duration),
        ("by the fastest law, in continuous time", motion.optimum.duration),
    ]
    closed, shown = motion.curve.closed, []
    for what, time in rows:
        if time is None:
            shown.append((what, "none", ""))
        elif closed:
            shown.append((what, show(time, "s"), show(1 / time, "Hz")))
        else:
            shown.append((what, show(time, "s"), "" if not motion.given else f"{to_digits(motion.given / time, 3)} x"))
    return shown


def runs_text(binding: Binding) -> str:
    """Such as '3 … 18 %, 40 … 52 %': where along the path."""
    runs = [f"{to_digits(100 * a, 3)} … {to_digits(100 * b, 3)} %" for a, b in binding.runs[:SHOWN_RUNS]]
    return ", ".join(runs) + (f", {len(binding.runs) - SHOWN_RUNS} more" if len(binding.runs) > SHOWN_RUNS else "")


def between_text(motion: FastestPath) -> str:
    """The largest distances from the path between set-points, of channels that have one."""
    signal = motion.solution.model.signals[motion.scenario.file.follow]
    rows = zip(signal.channels, signal.units, motion.between, signal.scale, strict=True)
    return ", ".join(f"{c} {show(v, small_unit(u), 3)}" for c, u, v, size in rows if v > 1e-9 * size) or "none"


def repetition_sentence(motion: FastestPath) -> str:
    """What can be repeated at the frequency that was asked for; empty where none was."""
    r = motion.repetition
    if r is None:
        return ""

    def size(scale: float | None) -> str:
        if scale is None:
            return "none"
        diameter = r.size(scale)
        return (
            f"{to_digits(100 * scale)} %"
            if diameter is None
            else f"{to_digits(diameter)} {r.unit} ({to_digits(100 * scale)} %)"
        )

    what = "largest path" if r.diameter is None else "largest circle"
    even = "" if not motion.curve.closed and motion.solution.model.inertial else f", at even speed {size(r.even)}"
    points = "; no set-points of it were found that keep all limits"
    if r.solution is not None:
        points = f"; {len(r.solution.command)} set-points keep all limits at {size(r.sampled)}"
    return f"{what} at {show(r.frequency, 'Hz')}: {size(r.scale)} by the fastest law of time{even}{points}"
