"""The report of a fastest motion: fastest.json, figures, one self-contained fastest.html."""

from __future__ import annotations

from pathlib import Path

from ctrlgen.core.files import write_text
from ctrlgen.core.units import show
from ctrlgen.path_timing.binding import Binding
from ctrlgen.path_timing.fastest import FastestPath
from ctrlgen.path_timing.fastest_plots import bound_text, draw_fastest
from ctrlgen.path_timing.fastest_record import fastest_record, small_unit
from ctrlgen.path_timing.retimed import write_inputs
from ctrlgen.reporting.html import render
from ctrlgen.reporting.result_file import json_text

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
    page = render(
        Path(__file__).with_name("fastest.html.j2"),
        f=record,
        figures=figures,
        device_title=motion.solution.model.device.title,
        rows=motions(motion),
        bindings=[(b, bound_text(b), runs_text(b)) for b in motion.bindings],
        between=between_text(motion),
        repeated=repetition_sentence(motion),
        scenario_file=motion.solution.scenario.path.name,
        repeated_file=None if repeated is None else repeated.scenario.path.name,
    )
    write_text(out / "fastest.html", page)


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
            shown.append((what, show(time, "s"), "" if not motion.given else f"{motion.given / time:.3g} x"))
    return shown


def runs_text(binding: Binding) -> str:
    """Such as '3 … 18 %, 40 … 52 %': where along the path."""
    runs = [f"{100 * a:.3g} … {100 * b:.3g} %" for a, b in binding.runs[:SHOWN_RUNS]]
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
        return f"{100 * scale:.4g} %" if diameter is None else f"{diameter:.4g} {r.unit} ({100 * scale:.4g} %)"

    what = "largest path" if r.diameter is None else "largest circle"
    even = "" if not motion.curve.closed and motion.solution.model.inertial else f", at even speed {size(r.even)}"
    points = "; no set-points of it were found that keep all limits"
    if r.solution is not None:
        points = f"; {len(r.solution.command)} set-points keep all limits at {size(r.sampled)}"
    return f"{what} at {show(r.frequency, 'Hz')}: {size(r.scale)} by the fastest law of time{even}{points}"
