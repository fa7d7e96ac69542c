"""What the loop shows: a film and two figures of the path, one table, one page, and the same numbers as JSON."""

from __future__ import annotations

import base64
import html
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

from plants.cases import CHANNELS, CIRCLE, PARASITIC, Case
from plants.frame import Array

COLOURS = ("#c4442c", "#1f6f8b", "#b8860b", "#5b4b8a", "#3a7d44", "#8b1f5f", "#444444", "#0f8b8d")
DASHES = ("-", (0, (5, 2)), "-.", ":", (0, (9, 3)), (0, (9, 2, 2, 2, 2, 2)), (0, (2, 6)), (0, (14, 3, 5, 3)))
DRAWN = 2.0  # um, as which the largest error of a path is drawn
FRAMES, FRAMES_A_SECOND = 48, 12
COLUMNS = 3  # pictures in a row of the film


@dataclass(frozen=True)
class Measured:
    """One drive of the plant. `mean` [%] of each translation by S1 eq. (20); `largest` error of each [um];
    `parasitic` mean and `parasitic_largest` of each rotation [rad]; poses (n, 6) [rad, um]."""

    mean: dict[str, float]
    largest: dict[str, float]
    parasitic: dict[str, float]
    parasitic_largest: dict[str, float]
    command: Array
    reached: Array

    @property
    def overall(self) -> float:
        """Mean of the three translations [%], the paper's figure."""
        return float(np.mean(list(self.mean.values())))

    @property
    def distance(self) -> float:
        """The largest distance from the path [um]."""
        return float(np.linalg.norm((self.reached - self.command)[:, 3:], axis=1).max())


def measure(case: Case) -> Measured:
    """The errors of a drive."""
    worst = dict(zip(CHANNELS, np.abs(case.reached - case.command).max(axis=0).tolist(), strict=True))
    return Measured(
        case.mean_errors(),
        {name: worst[name] for name in CIRCLE},
        case.parasitic(),
        {name: worst[name] for name in PARASITIC},
        case.command,
        case.reached,
    )


@dataclass(frozen=True)
class Stage:
    """One way of driving a chip: its `name`, the `chip`, what was done for it in a sentence, and what came out."""

    name: str
    chip: str
    about: str
    measured: Measured


@dataclass(frozen=True)
class Expected:
    """What `ctrlgen budget` says beforehand: half widths of the 95 % band of a translation [um] and of a rotation [rad]."""

    translation: float
    rotation: float


def rows(stages: Sequence[Stage]) -> list[tuple[str, ...]]:
    """The table: what, one column a stage, printed in S1."""
    found: list[tuple[str, ...]] = [("", *(stage.name for stage in stages), "S1 on its FE")]
    measured = [stage.measured for stage in stages]
    for name, printed in CIRCLE.items():
        found.append((f"mean error {name}", *(f"{m.mean[name]:.3f} %" for m in measured), f"{printed:.2f} %"))
    printed = float(np.mean(list(CIRCLE.values())))
    found.append(("mean of the three", *(f"{m.overall:.3f} %" for m in measured), f"{printed:.2f} %"))
    for name in CIRCLE:
        found.append((f"largest error {name}", *(f"{1e3 * m.largest[name]:.3g} nm" for m in measured), ""))
    found.append(("largest distance from the path", *(f"{1e3 * m.distance:.3g} nm" for m in measured), ""))
    for name, value in PARASITIC.items():
        cells = (f"{1e6 * m.parasitic[name]:.2f} urad" for m in measured)
        found.append((f"mean parasitic {name}", *cells, f"{1e6 * value:.2f} urad"))
        cells = (f"{1e6 * m.parasitic_largest[name]:.2f} urad" for m in measured)
        found.append((f"largest parasitic {name}", *cells, ""))
    return found


def draw_errors(stages: Sequence[Stage], expected: Expected) -> plt.Figure:
    """Along the path: the distance from it, and the size of the rotation, for each stage; the expected band."""
    figure, (along, turns) = plt.subplots(2, 1, figsize=(10, 6.4), sharex=True, layout="constrained")
    for k, (stage, colour) in enumerate(zip(stages, COLOURS, strict=False)):
        m = stage.measured
        error, share = m.reached - m.command, np.arange(len(m.command)) / len(m.command)
        along.semilogy(share, 1e3 * np.linalg.norm(error[:, 3:], axis=1), ls=DASHES[k], color=colour, label=stage.name)
        turns.semilogy(share, 1e6 * np.linalg.norm(error[:, :3], axis=1), ls=DASHES[k], color=colour)
    band = {"color": "0.5", "lw": 4, "alpha": 0.5}
    along.axhline(1e3 * expected.translation, label="95 % band of one translation, by the error budget", **band)
    turns.axhline(1e6 * expected.rotation, **band)
    along.set(ylabel="distance from the path [nm]", title="generated C on the independent plant, along the circle")
    turns.set(ylabel="|rotation| [urad]", xlabel="share of a turn", xlim=(0, 1))
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    for axes in (along, turns):
        axes.grid(alpha=0.3)
    return figure


def film(stages: Sequence[Stage], path: Path) -> None:
    """A GIF: each stage's circle from above being drawn over the commanded one, its error magnified as its title says."""
    lines = -(-len(stages) // COLUMNS)
    figure, grid = plt.subplots(
        lines,
        COLUMNS,
        figsize=(3.4 * COLUMNS, 3.5 * lines),
        squeeze=False,
        layout="constrained",
        sharex=True,
        sharey=True,
    )
    traces = []
    for axes in grid.ravel()[len(stages) :]:
        axes.set_axis_off()
    for stage, axes, colour in zip(stages, grid.ravel(), COLOURS, strict=False):
        m = stage.measured
        error = (m.reached - m.command)[:, 3:5]
        times = _magnified(float(np.linalg.norm(error, axis=1).max()))
        drawn = _closed(m.command[:, 3:5] + times * error)
        axes.plot(*_closed(m.command[:, 3:5]).T, color="0.8", lw=3)
        (line,) = axes.plot([], [], color=colour, lw=1.5)
        (head,) = axes.plot([], [], "o", color=colour, ms=5)
        axes.set_title(f"{stage.name}\n{1e3 * m.distance:.3g} nm, error drawn {times:g}x", fontsize=9)
        reach = float(np.abs(m.command[:, 3:5]).max()) + 1.2 * DRAWN
        axes.set(
            aspect="equal", xlabel="delta_x [um]", ylabel="delta_y [um]", xlim=(-reach, reach), ylim=(-reach, reach)
        )
        traces.append((drawn, line, head))

    def frame(k: int) -> list[Any]:
        for drawn, line, head in traces:
            done = 1 + round((len(drawn) - 1) * (k + 1) / FRAMES)
            line.set_data(*drawn[:done].T)
            head.set_data(*drawn[done - 1 : done].T)
        return [artist for _, *artists in traces for artist in artists]

    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once, not for every frame
    FuncAnimation(figure, frame, frames=FRAMES).save(path, writer=PillowWriter(fps=FRAMES_A_SECOND), dpi=80)
    plt.close(figure)


def _magnified(largest: float) -> float:
    """The power of ten, or its double or fivefold, by which an error [um] is at most `DRAWN`."""
    wanted = DRAWN / max(largest, 1e-6)
    decade = 10.0 ** np.floor(np.log10(wanted))
    return float(decade * max(step for step in (1, 2, 5) if step * decade <= wanted))


def _closed(points: Array) -> Array:
    return np.vstack([points, points[:1]])


def plain(stage: Stage) -> dict[str, Any]:
    """The numbers of a stage without the poses, and the paper's figure."""
    m = stage.measured
    values = {k: v for k, v in asdict(m).items() if k not in ("command", "reached")}
    return {"chip": stage.chip, "about": stage.about, "overall": m.overall, "distance": m.distance, **values}


@dataclass(frozen=True)
class Story:
    """The whole loop: what the budget expects, the stages, diagnosis.json, and `facts`, a sentence for each further step."""

    expected: Expected
    stages: tuple[Stage, ...]
    diagnosis: dict[str, Any]
    facts: dict[str, str]


def report(story: Story, out: Path) -> None:
    """film.gif, errors.png, loop.json and report.html into `out`."""
    picture = io.BytesIO()
    figure = draw_errors(story.stages, story.expected)
    figure.savefig(picture, format="png", dpi=130)
    plt.close(figure)
    (out / "errors.png").write_bytes(picture.getvalue())
    film(story.stages, out / "film.gif")
    numbers = {
        "expected_95": asdict(story.expected),
        "stages": {stage.name: plain(stage) for stage in story.stages},
        "verdict": story.diagnosis["verdict"],
        "findings": story.diagnosis["findings"],
        "facts": story.facts,
    }
    (out / "loop.json").write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
    page = _page(story, picture.getvalue(), (out / "film.gif").read_bytes())
    (out / "report.html").write_text(page, encoding="utf-8")


def _page(story: Story, picture: bytes, moving: bytes) -> str:
    """The loop as one self-contained page."""
    first, last = story.stages[0].measured, story.stages[-1].measured
    cells = [[html.escape(cell) for cell in row] for row in rows(story.stages)]
    table = "".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>\n" for row in cells)
    findings = "".join(f"<li>{html.escape(sentence(found))}</li>\n" for found in story.diagnosis["findings"])
    steps = "".join(
        f"<li><b>{html.escape(s.name)}</b> ({html.escape(s.chip)}): {html.escape(s.about)} "
        f"Largest distance from the path {1e3 * s.measured.distance:.3g} nm.</li>\n"
        for s in story.stages
    )
    facts = "".join(f"<li><b>{html.escape(k)}</b>: {html.escape(v)}</li>\n" for k, v in story.facts.items())
    image, gif = (base64.b64encode(data).decode() for data in (picture, moving))
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>The loop closed</title><style>
body {{ font: 16px/1.5 sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #222 }}
img {{ max-width: 100% }} td {{ padding: .1rem .7rem .1rem 0; font-variant-numeric: tabular-nums; font-size: .85rem }}
tr:first-child {{ font-weight: bold }} td:not(:first-child) {{ text-align: right }}
</style></head><body>
<h1>20 &micro;m circle without a position sensor: {1e3 * first.distance:.3g} nm off the path as described, {1e3 * last.distance:.2g} nm
at the end</h1>
<img alt="Each stage's circle from above, its error magnified." src="data:image/gif;base64,{gif}">
<p>The C that ctrlgen generated drives the independent, geometrically nonlinear plant. ctrlgen sees recordings, never the plant.</p>
<ol>
{steps}</ol>
<img alt="Distance from the path and rotation along the circle, one line a stage." src="data:image/png;base64,{image}">
<h2>What each step said</h2>
<ul>
{facts}</ul>
<h2>Found by <a href="diagnosis/report.html">the diagnosis</a>: {html.escape(story.diagnosis["verdict"])}</h2>
<ul>
{findings}</ul>
<h2>Numbers</h2>
<table>
{table}</table>
</body></html>
"""


def sentence(found: dict[str, Any]) -> str:
    """One finding with its numbers, intervals and rivals."""
    numbers = []
    for name, p in found["parameters"].items():
        low, high = (f"{end:.4g}" for end in p["ci95"])
        numbers.append(f"{name} = {p['value']:.4g} {p['unit']} ({low} ... {high})")
    text = f"{found['effect']} at {found['location']}: {', '.join(numbers)}; {found['source']}"
    others = ", ".join(f"{a['effect']} at {a['location']}" for a in found["alternatives"])
    return f"{text}; not told apart from {others}" if others else text
