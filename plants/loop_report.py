"""What the loop shows: one figure, one table, one page, and the same numbers as JSON."""

from __future__ import annotations

import base64
import html
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from plants.cases import CHANNELS, CIRCLE, PARASITIC, Case
from plants.frame import Array

COLOURS = {"before": "#c4442c", "after": "#1f6f8b"}
MAGNIFIED = 10  # error of the path as drawn


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


def rows(before: Measured, after: Measured) -> list[tuple[str, str, str, str]]:
    """The table: what, before, after, printed in S1."""
    found = [("", "before", "after", "S1 on its FE")]
    for name, printed in CIRCLE.items():
        found.append((f"mean error {name}", *(f"{m.mean[name]:.3f} %" for m in (before, after)), f"{printed:.2f} %"))
    printed = float(np.mean(list(CIRCLE.values())))
    found.append(("mean of the three", *(f"{m.overall:.3f} %" for m in (before, after)), f"{printed:.2f} %"))
    for name in CIRCLE:
        found.append((f"largest error {name}", *(f"{1e3 * m.largest[name]:.0f} nm" for m in (before, after)), ""))
    for name, value in PARASITIC.items():
        cells = (f"{1e6 * m.parasitic[name]:.2f} urad" for m in (before, after))
        found.append((f"mean parasitic {name}", *cells, f"{1e6 * value:.2f} urad"))
        cells = (f"{1e6 * m.parasitic_largest[name]:.2f} urad" for m in (before, after))
        found.append((f"largest parasitic {name}", *cells, ""))
    return found


def draw(before: Measured, after: Measured) -> plt.Figure:
    """Left the circle from above, error magnified; right the size of the error along it, and the rotations."""
    figure = plt.figure(figsize=(10, 4.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.25))
    plane, along, turns = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    c = before.command
    plane.plot(*_closed(c[:, 3:5]).T, color="0.6", lw=4, label="commanded")
    share = np.arange(len(c)) / len(c)
    for name, m in (("before", before), ("after", after)):
        error = m.reached - m.command
        label = f"{name}: mean error {m.overall:.2f} %"
        plane.plot(*_closed(c[:, 3:5] + MAGNIFIED * error[:, 3:5]).T, color=COLOURS[name], lw=1.4, label=label)
        along.semilogy(share, 1e3 * np.linalg.norm(error[:, 3:], axis=1), color=COLOURS[name])
        turns.plot(share, 1e6 * np.linalg.norm(error[:, :3], axis=1), color=COLOURS[name])
    plane.set(xlabel="delta_x [um]", ylabel="delta_y [um]", aspect="equal", title=f"circle, error drawn {MAGNIFIED}x")
    plane.legend(loc="center", fontsize=8, frameon=False)
    along.set(ylabel="|error of delta| [nm]", title="generated C on the plant, along the circle", xlim=(0, 1))
    along.tick_params(labelbottom=False)
    turns.set(xlabel="share of a turn", ylabel="|rotation| [urad]", xlim=(0, 1), ylim=(0, None))
    for axes in (plane, along, turns):
        axes.grid(alpha=0.3)
    return figure


def _closed(points: Array) -> Array:
    return np.vstack([points, points[:1]])


def report(before: Measured, after: Measured, diagnosis: dict[str, Any], out: Path) -> None:
    """circle.png, loop.json and report.html into `out`."""
    picture = io.BytesIO()
    figure = draw(before, after)
    figure.savefig(picture, format="png", dpi=130)
    plt.close(figure)
    (out / "circle.png").write_bytes(picture.getvalue())
    numbers = {name: _plain(m) for name, m in (("before", before), ("after", after))}
    found = {"verdict": diagnosis["verdict"], "findings": diagnosis["findings"]}
    (out / "loop.json").write_text(json.dumps({**numbers, **found}, indent=1) + "\n", encoding="utf-8")
    (out / "report.html").write_text(_page(before, after, diagnosis, picture.getvalue()), encoding="utf-8")


def _plain(m: Measured) -> dict[str, Any]:
    """The numbers without the poses, and the paper's figure."""
    values = asdict(m)
    return {"overall": m.overall, **{k: v for k, v in values.items() if k not in ("command", "reached")}}


def _page(before: Measured, after: Measured, diagnosis: dict[str, Any], picture: bytes) -> str:
    """One self-contained page."""
    cells = [[html.escape(cell) for cell in row] for row in rows(before, after)]
    table = "".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>\n" for row in cells)
    findings = "".join(f"<li>{html.escape(sentence(found))}</li>\n" for found in diagnosis["findings"])
    image = base64.b64encode(picture).decode()
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>The loop closed</title><style>
body {{ font: 16px/1.5 sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222 }}
img {{ max-width: 100% }} td {{ padding: .1rem .9rem .1rem 0; font-variant-numeric: tabular-nums }}
tr:first-child {{ font-weight: bold }} td:not(:first-child) {{ text-align: right }}
</style></head><body>
<h1>20 &micro;m circle: mean error {before.overall:.2f} % before, {after.overall:.2f} % after the diagnosis</h1>
<img alt="Left: the circle from above, commanded, before and after, errors drawn {MAGNIFIED} times. Right: error of
translation and rotation along the circle, before and after." src="data:image/png;base64,{image}">
<p>The C that ctrlgen generated drives the independent, geometrically nonlinear plant. Before: from the device file as
printed. After: from device.next.toml, which <a href="diagnosis/report.html">the diagnosis</a> of settled poses wrote.</p>
<h2>Found: {html.escape(diagnosis["verdict"])}</h2>
<ul>
{findings}</ul>
<h2>Before and after</h2>
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
