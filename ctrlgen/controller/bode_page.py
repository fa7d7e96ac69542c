"""The frequency response as one self-contained page: `ctrlgen bode --out NAME.html`."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np

from ctrlgen.controller.bode import FrequencyResponse, bode_figure, frequency_response, phase, strongest
from ctrlgen.core.files import write_text
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference, from_si
from ctrlgen.model.model import Model
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.chart_drawing import chart_svg
from ctrlgen.reporting.html import render
from ctrlgen.reporting.mode_drawing import mode_svg
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.plots import svg
from ctrlgen.reporting.result_file import origin

# drives beside the figure, and channels in it; all are below
SHOWN, PANELS = 3, 2
HALF_POWER = 1 / np.sqrt(2)  # of the static gain: where the bandwidth ends
RAISED = 1.05  # of the static gain, from which on a peak is told


def write_bode_page(model: Model, pose: np.ndarray, path: Path, of: str = "pose") -> None:
    """Writes the page of the pose or the "reading". `pose` (channels,) [rad, m] is where the model is linearised. Raises
    InputError as `frequency_response` does."""
    found = frequency_response(model, pose, of)
    rows = drive_rows(found)
    signal, drive = found.signal, model.signals["drive"]
    caption = "Gain from every drive to the channels that answer most, and their phase against the static response."
    main = sorted({strongest(found, j) for j in range(len(drive.channels))})[:PANELS]
    rest = [i for i in range(len(signal.channels)) if i not in main]
    chart = bode_chart(found, main)
    figure = PageFigure(chart_svg(chart), "Frequency response", caption, chart)
    every = PageFigure(
        svg(bode_figure(found)), "Every channel", "Gain by channel, and the phase.", bode_chart(found, rest)
    )
    static = [
        (channel, unit, [number(difference(found.static[i, j], unit), 4) for j in range(len(drive.channels))])
        for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True))
    ]
    page = render(
        Path(__file__).with_name("bode.html.j2"),
        title=model.device.title,
        device=model.name,
        at=_at(found),
        first=_first_screen(found, rows, figure),
        every=every if rest else None,
        rows=rows,
        static=static,
        drives=drive.channels,
        unit=drive.units[0],
        modes=[
            PageFigure(mode_svg(shape), f"{number(shape.frequency, 4)} Hz", "At rest (grey) and displaced.")
            for shape in model.device.mode_shapes()
        ],
        poles=[number(f, 4) for f in np.sort(found.poles / (2 * np.pi))],
        origin=origin({}),
        source=model.device.source,
    )
    write_text(path, page)


def drive_rows(found: FrequencyResponse) -> list[dict[str, str]]:
    """Of each drive the channel that answers most, its static gain, where it has fallen by 3 dB, and its peak."""
    signal, drive = found.signal, found.model.signals["drive"]
    rows = []
    for j, name in enumerate(drive.channels):
        i = strongest(found, j)
        size = abs(found.static[i, j])
        if not size:
            continue
        gain = np.abs(found.response[i, j]) / size
        above = np.flatnonzero(gain >= HALF_POWER)
        falls = len(above) and above[-1] < len(gain) - 1
        peak = int(np.argmax(gain))
        rows.append(
            {
                "drive": name,
                "channel": signal.channels[i],
                "gain": f"{number(difference(found.static[i, j], signal.units[i]), 4)} {signal.units[i]}/{drive.units[j]}",
                "falls": f"{number(found.hertz[above[-1]], 3)} Hz" if falls else "beyond what is drawn",
                "peak": f"{to_digits(gain[peak], 3)} times at {number(found.hertz[peak], 4)} Hz"
                if gain[peak] > RAISED
                else "none",
            }
        )
    return rows


def bode_chart(found: FrequencyResponse, channels: Collection[int]) -> Chart:
    """A panel a channel of `channels` that answers to first order, and one of the phase."""
    signal, drive = found.signal, found.model.signals["drive"]
    panels = []
    for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True)):
        if i not in channels:
            continue
        gains = [(j, difference(np.abs(found.response[i, j]), unit)) for j in range(len(drive.channels))]
        curves = tuple(Curve(drive.channels[j], g, j, j) for j, g in gains if g.max() > 0)
        if curves:
            panels.append(Panel(f"{channel} [{unit}/{drive.units[0]}]", found.hertz, curves, log=True, height=190))
    turned = [(j, strongest(found, j)) for j in range(len(drive.channels))]
    phases = tuple(
        Curve(f"{drive.channels[j]} -> {signal.channels[i]}", phase(found, i, j), j, j)
        for j, i in turned
        if found.static[i, j]
    )
    if phases:
        panels.append(Panel("phase [deg]", found.hertz, phases, height=190))
    return Chart("frequency [Hz]", tuple(panels), log_x=True)


def _at(found: FrequencyResponse) -> str:
    signal = found.model.signals["pose"]
    named = zip(signal.channels, signal.units, found.pose, strict=True)
    return ", ".join(f"{channel} = {to_digits(from_si(value, unit))} {unit}" for channel, unit, value in named)


def _first_screen(found: FrequencyResponse, rows: list[dict[str, str]], figure: PageFigure) -> FirstScreen:
    slow, fast = found.poles.min() / (2 * np.pi), found.poles.max() / (2 * np.pi)
    answer = (
        f"The {found.of} follows the drives up to {rows[0]['falls']} ({rows[0]['drive']} to {rows[0]['channel']}, - 3 dB)"
        if rows
        else ""
    )
    answer = answer or "No channel answers to a drive to first order at this pose"
    numbers = [(f"{row['drive']} to {row['channel']}, static", row["gain"]) for row in rows[:SHOWN]]
    numbers += [("slowest pole", f"{number(slow, 4)} Hz"), ("fastest pole", f"{number(fast, 4)} Hz")]
    numbers += [(f"peak of {row['drive']}", row["peak"]) for row in rows[:SHOWN] if row["peak"] != "none"]
    told = [f"{answer}."]
    if found.structure is not None:
        told.append(found.structure.sentence())
    steps = (
        "Take another pose with `--at`: the response changes with it where the device is not linear.",
        "Record the same response on the stage (a chirp within its limits), and `ctrlgen diagnose` holds the model to it.",
        "In Python `ctrlgen.controller.linearisation.linearise` gives the state space for the design of a loop.",
    )
    return FirstScreen(tuple(told), "ok" if rows else "so", figure, tuple(numbers), steps)
