"""S0 Figs. 6 to 10 from our own errors, as SVG."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ctrlgen.core.units import from_si
from ctrlgen.recordings.pose_errors import BOX, CHANNELS, Parasitic, PoseErrors, parasitic, pose_errors
from ctrlgen.reporting.line_patterns import mark
from ctrlgen.reporting.plots import COLOURS, STYLE, svg

from .s0_data import PaperRecordings, load_s0

BLUE, RED = COLOURS[0], COLOURS[2]
PARTS = {"rotation": (slice(0, 3), "deg"), "translation": (slice(3, 6), "um")}


def figures(recordings: PaperRecordings | None = None) -> dict[str, str]:
    """Name -> SVG text. The calibrated model expects the command, the kinematic one its line of Table 4."""
    data = recordings or load_s0()[-1]
    model = pose_errors(data.measured, data.kinematic)
    calibrated = pose_errors(data.measured, data.commanded)
    alone = parasitic(data.commanded, data.measured)
    with plt.rc_context(STYLE):
        return {
            "Fig. 6, norm of the errors of every pose": svg(draw_norms(model, calibrated)),
            "Fig. 7, distribution of the rotation errors": svg(draw_distribution(model, calibrated, "rotation")),
            "Fig. 8, distribution of the translation errors": svg(draw_distribution(model, calibrated, "translation")),
            "Fig. 9, poses commanded in one rotation": svg(
                draw_single([part for part in alone if part.channel in CHANNELS[:3]])
            ),
            "Fig. 10, poses commanded in one translation": svg(
                draw_single([part for part in alone if part.channel in CHANNELS[3:]])
            ),
        }


def draw_norms(model: PoseErrors, calibrated: PoseErrors) -> Figure:
    """Norm of the error of every pose, both models (S0 Fig. 6)."""
    figure, panels = plt.subplots(1, 2, figsize=(8.2, 3.4))
    for axes, (part, (_, unit)) in zip(panels, PARTS.items(), strict=True):
        for errors, marker, colour, label in (
            (model, "o-", RED, "kinematic model"),
            (calibrated, "s-", BLUE, "calibrated model"),
        ):
            values = from_si(getattr(errors, part), unit)
            axes.plot(1 + np.arange(len(values)), values, marker, ms=3, lw=0.8, color=colour, label=label)
        axes.set_xlabel("pose j")
        axes.set_ylabel(f"norm of the {part} error [{unit}]")
        axes.set_ylim(bottom=0)
    panels[0].legend(fontsize=8)
    return figure


def draw_distribution(model: PoseErrors, calibrated: PoseErrors, part: str) -> Figure:
    """Absolute errors axis by axis: the box holds 90 % of the poses, the whiskers all of them (S0 Figs. 7 and 8)."""
    columns, unit = PARTS[part]
    figure, panels = plt.subplots(1, 2, figsize=(8.2, 3.2), sharey=True)
    for axes, errors, colour, title in zip(
        panels, (model, calibrated), (RED, BLUE), ("kinematic model", "calibrated model"), strict=True
    ):
        boxes = []
        for channel, values in zip(CHANNELS[columns], np.abs(errors.errors[:, columns]).T, strict=True):
            shown = from_si(values, unit)
            low, high = np.percentile(shown, BOX)
            boxes.append(
                {
                    "label": channel,
                    "med": np.median(shown),
                    "mean": shown.mean(),
                    "q1": low,
                    "q3": high,
                    "whislo": shown.min(),
                    "whishi": shown.max(),
                }
            )
        axes.bxp(
            boxes,
            showfliers=False,
            showmeans=True,
            boxprops={"color": colour},
            medianprops={"color": colour},
            meanprops={"marker": "x", "markeredgecolor": colour},
        )
        axes.set_title(f"{title}; bar: median, cross: mean", fontsize=8)
    panels[0].set_ylabel(f"absolute error [{unit}]")
    return figure


def draw_single(parts: list[Parasitic]) -> Figure:
    """Poses commanded in one channel: measured and its error left, the other five channels right (S0 Figs. 9 and 10)."""
    figure, panels = plt.subplots(len(parts), 2, figsize=(8.2, 2.6 * len(parts)), squeeze=False)
    for (left, right), part in zip(panels, parts, strict=True):
        unit = _unit(part.channel)
        command = from_si(part.command, unit)
        left.plot(command, from_si(part.measured, unit), "o-", ms=3, lw=1, color=BLUE, label="measured")
        beside = _second_axis(left)
        beside.plot(command, from_si(part.error, unit), "s--", ms=3, lw=1, color=RED, label="error")
        beside.set_ylabel(f"error [{unit}]", color=RED)
        left.set_xlabel(f"commanded {part.channel} [{unit}]")
        left.set_ylabel(f"measured [{unit}]", color=BLUE)
        length = _second_axis(right)
        for channel, values in zip(part.channels, part.others.T, strict=True):
            turning = channel.startswith("theta")
            (right if turning else length).plot(
                command,
                from_si(values, _unit(channel)),
                marker=mark(CHANNELS.index(channel)),
                ls="-" if turning else "--",
                ms=3,
                lw=0.9,
                color=COLOURS[CHANNELS.index(channel)],
                label=channel,
            )
        right.set_xlabel(f"commanded {part.channel} [{unit}]")
        right.set_ylabel("rotation [deg], solid", color=RED)
        length.set_ylabel("translation [um], dashed", color=BLUE)
        lines = [*right.get_lines(), *length.get_lines()]
        names = [line.get_label() for line in lines]
        right.legend(
            lines,
            names,
            fontsize=7,
            ncols=5,
            loc="lower center",
            bbox_to_anchor=(0.5, 1.0),
            columnspacing=0.8,
            handlelength=1.5,
        )
    return figure


def _unit(channel: str) -> str:
    return "deg" if channel.startswith("theta") else "um"


def _second_axis(axes: Axes) -> Axes:
    other = axes.twinx()
    other.spines["right"].set_visible(True)
    other.grid(False)
    return other
