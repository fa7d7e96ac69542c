"""Figures of a fastest motion: path and speed, the limits that bind, the drives."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.units import difference, from_si, same_dimension, show
from ctrlgen.path_timing.binding import Binding
from ctrlgen.path_timing.fastest import FastestPath
from ctrlgen.reporting.line_patterns import DASHED, DOTTED, dashes
from ctrlgen.reporting.plots import COLOURS, STYLE, legend_above, legend_over, plt, svg

SHOWN = 12  # limits
UNBOUND = "#bbbbbb"
EVEN = 800  # places along the path at which even speed is drawn
FLAT = 1e-9  # of the largest extent, below which a channel does not move
MARKED = 120  # set-points that are dots of their own; more of them cover the colours
ROOM = 1.15  # of the largest speed, up to which speeds are shown


def bound_text(binding: Binding) -> str:
    """Such as '≥ 0 W'."""
    side = binding.side
    return f"{'≤' if side.upper else '≥'} {show(side.bound, side.limit.unit)}"


def _name_of(binding: Binding) -> str:
    """The limited quantity and its channel, this once."""
    label, channel = binding.side.limit.label, binding.side.name
    return label if channel in label.split() else f"{label} {channel}"


def draw_fastest(motion: FastestPath) -> dict[str, str]:
    """Path and speed, the limits that bind, the drives: name -> SVG text."""
    with plt.rc_context(STYLE):
        return {
            "path": svg(_draw_path(motion)),
            **({"binding": svg(_draw_binding(motion))} if motion.bindings else {}),
            "drives": svg(_draw_drives(motion)),
        }


def _colours(motion: FastestPath) -> list[tuple[Binding, str]]:
    """A colour for each limit that binds."""
    return [(b, COLOURS[k % len(COLOURS)]) for k, b in enumerate(motion.bindings[:SHOWN])]


def _draw_path(motion: FastestPath) -> Figure:
    """Left the path with its set-points, right the speed along it; coloured by the limit that binds."""
    signal = motion.solution.model.signals[motion.scenario.file.follow]
    spread = np.ptp(motion.solution.command, axis=0) / np.array(signal.scale)
    main = int(spread.argmax())
    alike = [i for i, u in enumerate(signal.units) if same_dimension(u, signal.units[main])]
    columns = sorted(sorted(alike, key=lambda i: -spread[i])[:2])
    if len(columns) == 1 or spread[columns].min() < FLAT * spread[main]:
        columns = [main]
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.9), width_ratios=(1, 1.25))

    def at(share: np.ndarray) -> list[np.ndarray]:
        values = motion.curve.samples(share)
        shown = [np.asarray(from_si(values[:, i], signal.units[i])) for i in columns]
        return [100 * share, *shown] if len(shown) == 1 else shown

    left.plot(*at(np.linspace(0, 1, 2001)), color=UNBOUND, lw=1)
    for binding, colour in reversed(_colours(motion)):
        for a, b in binding.runs:
            left.plot(*at(np.linspace(a, b, 200)), color=colour, lw=2.2, solid_capstyle="butt")
    left.plot(*at(motion.share), ".", ms=3 if len(motion.share) <= MARKED else 0.8, color="#333333")
    names = [f"{signal.channels[i]} [{signal.units[i]}]" for i in columns]
    if len(names) == 1:
        names = ["share of the path [%]", *names]
    else:
        left.set_aspect("equal", adjustable="datalim")
    left.set_xlabel(names[0])
    left.set_ylabel(names[1])
    left.set_title("set-points, and which limit binds", fontsize=8)
    _draw_speed(right, motion, alike, signal.units[main])
    return figure


def _draw_speed(axes: Axes, motion: FastestPath, alike: list[int], unit: str) -> None:
    """Over the share of the path, in the channels `alike`: the fastest law, the bound of each place, even speed."""
    top, even = 0.0, None if motion.even is None else motion.curve.evenly(EVEN)

    def shown(at: np.ndarray, rate: np.ndarray) -> np.ndarray:
        slope = np.linalg.norm(motion.curve.derivatives(at, 1, ends)[1][:, alike], axis=1)
        return np.asarray(difference(np.where(np.isfinite(rate), rate, np.nan) * slope, unit))

    for k, (ends, piece) in enumerate(zip(motion.curve.pieces, motion.optimum.pieces, strict=True)):
        share, speed, bound = piece.share, piece.speed, piece.bound

        def labelled(text: str, first: bool = k == 0) -> str:
            return text if first else "_"  # each once

        if bound is not None and not np.allclose(bound, speed, rtol=1e-3, atol=0):  # apart by more than a line's width
            label = labelled("bound of each place alone")
            axes.plot(100 * share, shown(share, bound), color=UNBOUND, lw=1, ls=dashes(DASHED), label=label)
        axes.plot(100 * share, shown(share, speed), color="#333333", lw=1, label=labelled("fastest law of time"))
        top = max(top, float(np.nanmax(shown(share, speed))))
        for binding, colour in reversed(_colours(motion)):
            for a, b in binding.runs:
                inside = (share >= a) & (share <= b)
                if inside.any():  # a limit may bind along another piece alone
                    there, fast = share[inside], speed[inside]
                    axes.plot(100 * there, shown(there, fast), color=colour, lw=2.2, solid_capstyle="butt")
        if even is not None and motion.even is not None:
            inside = (even >= ends[0]) & (even <= ends[1])
            rate = np.gradient(even[inside], motion.even / (len(even) - 1))
            label = labelled("even speed, no faster")
            axes.plot(
                100 * even[inside], shown(even[inside], rate), color="#888888", lw=1, ls=dashes(DOTTED), label=label
            )
    axes.set_xlabel("share of the path [%]")
    axes.set_ylabel(f"speed along the path [{unit}/s]")
    axes.set_ylim(0, ROOM * top)
    legend_above(axes, columns=2)


def _draw_binding(motion: FastestPath) -> Figure:
    """Where along the path each limit binds."""
    coloured = _colours(motion)
    figure, axes = plt.subplots(figsize=(8.2, 0.7 + 0.24 * len(coloured)))
    for row, (binding, colour) in enumerate(coloured):
        axes.broken_barh([(100 * a, 100 * (b - a)) for a, b in binding.runs], (row - 0.35, 0.7), color=colour)
    axes.set_yticks(range(len(coloured)), [f"{_name_of(b)} {bound_text(b)}" for b, _ in coloured], fontsize=7)
    axes.set_xlim(0, 100)
    axes.set_xlabel("share of the path [%]")
    axes.invert_yaxis()
    return figure


def _draw_drives(motion: FastestPath) -> Figure:
    """The drives, held from sample to sample."""
    solution = motion.solution
    signal = solution.model.signals["drive"]
    figure, axes = plt.subplots(figsize=(8.2, 2.8))
    edges = np.append(solution.trace.time, solution.trace.time[-1] + motion.sample_time) * 1e3
    for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True)):
        axes.stairs(
            from_si(solution.drive[:, i], unit),
            edges,
            baseline=None,
            color=COLOURS[i % len(COLOURS)],
            ls=dashes(i),
            lw=1,
            label=channel,
        )
    low, high = solution.model.u_bounds
    for bound in {float(b) for b in (*low, *high) if np.isfinite(b)}:
        axes.axhline(from_si(bound, signal.units[0]), color="#666666", lw=0.8, ls="--")
    axes.set_xlabel("time [ms]")
    axes.set_ylabel(f"drive [{signal.units[0]}]")
    legend_over(figure, axes, size=7)
    return figure
