"""batch.html: which recordings of a batch stand out, which machines deviate, what drifts; one self-contained page beside results.csv."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ctrlgen.app.batch_row import BatchRow
from ctrlgen.app.batch_series import Series, batch_series
from ctrlgen.app.control_chart import LEAST
from ctrlgen.core.counts import number_of
from ctrlgen.reporting.chart import Chart, Curve, Panel
from ctrlgen.reporting.chart_drawing import chart_svg
from ctrlgen.reporting.html import render
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.reporting.result_file import origin

# robust standard deviations from the median of all machines, from which on one deviates; and machines without which there is no median
FAR, MACHINES = 3.0, 4
TO_SD = 1.4826  # median absolute deviation to standard deviation, of a normal distribution
LINKED = 500  # recordings that the table lists; all are in results.csv
NAMED = 5  # in a sentence
CAPTION = (
    "In the order of the list, which is that of the names. Dashed: median and three standard deviations by the median moving range; "
    f"drawn from {LEAST} recordings on."
)


@dataclass(frozen=True)
class Machine:
    """All recordings of one [[job]]: how many, how many failed, the verdicts, the cause that most have, the median of error over noise,
    and whether that lies far from the other machines' (None: too few to say)."""

    name: str
    recordings: int
    failed: int
    verdicts: str
    cause: str
    ratio: float | None
    deviates: bool | None


def batch_page(rows: Sequence[BatchRow], out: Path, title: str) -> str:
    """The page as HTML text of the `rows` of a batch whose result folders are in `out`."""
    names = [row.name for row in rows]
    errors, numbers = batch_series(names, out)
    machines = machines_of(rows)
    figures = [
        _figure("Errors of the devices as described", errors, names),
        _figure("Numbers of the causes that were found", numbers, names),
    ]
    unusual = standing_out(names, [*errors, *numbers])
    drifts = [(s.label, number(s.chart.drift, 3), s.unit) for s in (*errors, *numbers) if s.chart.drift is not None]
    return render(
        Path(__file__).with_name("batch.html.j2"),
        title=title,
        first=_first_screen(rows, machines, unusual, drifts, figures[0]),
        figures=[figure for figure in figures[1:] if figure is not None],
        machines=machines,
        unusual=unusual,
        drifts=drifts,
        rows=rows[:LINKED],
        hidden=max(0, len(rows) - LINKED),
        number=number,
        origin=origin({}),
    )


def machines_of(rows: Sequence[BatchRow]) -> list[Machine]:
    """The recordings by machine, in the order of the list."""
    by_name: dict[str, list[BatchRow]] = {}
    for row in rows:
        by_name.setdefault(row.name.partition("--")[0], []).append(row)
    ratios = {name: _ratio(group) for name, group in by_name.items()}
    known = np.log([r for r in ratios.values() if r])
    spread = TO_SD * float(np.median(np.abs(known - np.median(known)))) if len(known) else 0.0

    def far(ratio: float | None) -> bool | None:
        if ratio is None or len(known) < MACHINES:
            return None
        return bool(abs(np.log(ratio) - np.median(known)) > FAR * spread)

    found = []
    for name, group in by_name.items():
        verdicts = Counter(row.verdict for row in group if row.verdict)
        causes = Counter(cause for row in group for cause in row.findings.split("; ") if cause)
        told = ", ".join(f"{k} {verdict}" for verdict, k in verdicts.most_common())
        cause = f"{causes.most_common(1)[0][0]} ({causes.most_common(1)[0][1]})" if causes else ""
        failed = sum(row.state == "failed" for row in group)
        found.append(Machine(name, len(group), failed, told, cause, ratios[name], far(ratios[name])))
    return found


def _ratio(group: Sequence[BatchRow]) -> float | None:
    """Median over the recordings of the error of the device as described over the noise; None where no noise is known."""
    known = [row.before / row.noise for row in group if row.before and row.noise]
    return float(np.median(known)) if known else None


def standing_out(names: Sequence[str], series: Sequence[Series]) -> list[tuple[str, list[str]]]:
    """Recordings outside the limits of a chart, with what lies outside, those with most first."""
    found: dict[str, list[str]] = {}
    for s in series:
        for k in s.chart.outside:
            found.setdefault(names[k], []).append(
                f"{s.name} {number(float(s.chart.values[k]), 4)} {s.unit if s.unit != '1' else ''}".strip()
            )
    return sorted(found.items(), key=lambda item: -len(item[1]))


def _figure(title: str, series: Sequence[Series], names: Sequence[str]) -> PageFigure | None:
    """One panel a series with its limits; None where there is none."""
    if not series:
        return None
    x = np.arange(1.0, len(names) + 1)
    panels = []
    for s in series:
        c = s.chart
        rules = [(c.centre, "median")]
        if c.low is not None and c.high is not None:
            rules += [(c.low, "lower limit"), (c.high, "upper limit")]
        outside = np.where(np.isin(np.arange(len(names)), c.outside), c.values, np.nan)
        curves = [
            Curve(s.name, c.values, 0, 0, points=True),
            *([Curve("outside", outside, 1, 1, points=True)] if c.outside else []),
        ]
        panels.append(Panel(s.label, x, tuple(curves), log=s.size, rules=tuple(rules), height=150))
    chart = Chart("recording", tuple(panels), places=tuple(names))
    return PageFigure(chart_svg(chart), title, CAPTION, chart)


def _first_screen(
    rows: Sequence[BatchRow],
    machines: Sequence[Machine],
    unusual: Sequence[tuple[str, list[str]]],
    drifts: Sequence[tuple[str, str, str]],
    figure: PageFigure | None,
) -> FirstScreen:
    failed = [row.name for row in rows if row.state == "failed"]
    far = [m.name for m in machines if m.deviates]
    parts = [
        f"{len(unusual)} {'stands' if len(unusual) == 1 else 'stand'} out ({_named([name for name, _ in unusual])})"
        if unusual
        else "none stands out",
        f"{len(far)} of {number_of(len(machines), 'machine')} {'deviates' if len(far) == 1 else 'deviate'} ({_named(far)})"
        if far
        else "",
        number_of(len(drifts), "number drifts", "numbers drift") if drifts else "nothing drifts",
        f"{len(failed)} failed" if failed else "",
    ]
    judged = len(rows) - len(failed) >= LEAST
    told = (
        "; ".join(p for p in parts if p)
        if judged
        else "; ".join(
            p for p in (parts[1], parts[3], f"too few to say which stand out or drift: that takes {LEAST}") if p
        )
    )
    verdicts = Counter(row.verdict for row in rows if row.verdict)
    numbers = [("recordings", str(len(rows))), ("machines", str(len(machines)))]
    numbers += [(verdict, str(k)) for verdict, k in verdicts.most_common()]
    numbers += [("failed", str(len(failed)))] if failed else []
    causes = Counter(cause for row in rows for cause in row.findings.split("; ") if cause)
    numbers += [(cause, f"in {k}") for cause, k in causes.most_common(3)]
    steps = [f"Read why {_named(failed)} failed, in the table of recordings."] if failed else []
    steps += [f"Correct the recording of {row.name}: {row.warning}." for row in rows if row.warning][:NAMED]
    steps += [f"Look at {name}: {', '.join(what)} (`{name}/report.html`)." for name, what in unusual[:2]]
    steps += [f"Diagnose {_named(far)} first: error over noise is far from that of the other machines."] if far else []
    steps += [
        f"Watch {label}: it changed by {change} {unit if unit != '1' else ''} over the batch.".replace(" .", ".")
        for label, change, unit in drifts[:2]
    ]
    if not steps and causes:
        steps.append(
            f"Most have {causes.most_common(1)[0][0]}: put it into the device file (`device.next.toml` in each folder)."
        )
    steps.append("Add new recordings to the list and call the same command again: what is done is kept.")
    state = "bad" if failed else "so" if unusual or far or drifts else "ok"
    return FirstScreen(
        (f"Of {number_of(len(rows), 'recording')} {told}.",), state, figure, tuple(numbers), tuple(steps)
    )


def _named(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more
