"""The figure of the conventions page, drawn from the shipped device file of the MEMS hexapod."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import ctrlgen
from ctrlgen.physics import hexapod

DEVICE = Path(__file__).resolve().parents[2] / "scenarios" / "devices" / "mems_hexapod.toml"
CHAIN = (
    "drive u\n[W or V]",
    "state x\n[°C]",
    "force F\n[N]",
    "displacement d\n[µm]",
    "pose\n[µrad, µm]",
    "reading\n[µrad, µm]",
)
PUSH = 1.0  # mm, length of the arrows


def draw_conventions(folder: Path) -> None:
    """conventions.svg: the hexapod from above, its side, and the chain of signals."""
    device = ctrlgen.load_device(DEVICE)
    h = device.values().hexapod
    g = hexapod.geometry(h)
    platform, base = (1e3 * np.hstack([ca.DM(P).full() for P in points]) for points in (g.platform, g.base))
    plt.rcParams["svg.hashsalt"] = "ctrlgen"  # the same file from the same numbers
    figure, (top, side) = plt.subplots(1, 2, figsize=(9, 4.6), width_ratios=(1.15, 1))
    figure.subplots_adjust(bottom=0.27, top=0.93, left=0.07, right=0.98, wspace=0.25)
    _from_above(top, device, g, platform, base)
    _from_the_side(side, platform, base, 1e3 * float(h.platform_thickness), 1e3 * float(h.height))
    _chain(figure)
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / "conventions.svg", metadata={"Date": None})
    plt.close(figure)


def _from_above(axes, device, g, platform, base) -> None:
    ring = [*range(6), 0]
    axes.plot(platform[0, ring], platform[1, ring], color="0.2", lw=1.5)
    for i in range(6):
        axes.plot(*np.column_stack([base[:2, i], platform[:2, i]]), color="0.6", lw=1)
    for j in range(3):
        centre, rotation = 1e3 * ca.DM(g.centre[j]).full()[:2, 0], ca.DM(g.rotation[j]).full()
        for k in range(2):
            way = rotation[:2, k]  # positive displacement is along the push: `push` gives the paper's sign, not ours
            axes.annotate("", centre + PUSH * way, centre, arrowprops={"arrowstyle": "-|>", "color": "C3", "lw": 1.6})
            axes.text(
                *(centre + 1.35 * PUSH * way), device.axes[2 * j + k], color="C3", ha="center", va="center", fontsize=9
            )
    for way, name in (((1, 0), "x"), ((0, 1), "y")):
        axes.annotate("", np.array(way), (0, 0), arrowprops={"arrowstyle": "-|>", "color": "C0", "lw": 1.6})
        axes.text(*(1.2 * np.array(way)), name, color="C0", ha="center", va="center")
    axes.text(-0.12, -0.12, "z up", color="C0", ha="right", va="top", fontsize=9)
    axes.set(aspect="equal", xlabel="mm", title="from above: the direction in which each actuator pushes")
    axes.title.set_fontsize(10)
    axes.margins(0.16)


def _from_the_side(axes, platform, base, thickness, height) -> None:
    for i in range(6):
        axes.plot([base[0, i], platform[0, i]], [base[2, i], platform[2, i]], color="0.6", lw=1)
    r = np.abs(platform[0]).max()
    axes.add_patch(plt.Rectangle((-r, -thickness), 2 * r, thickness, facecolor="0.85", edgecolor="0.2"))
    axes.plot(*base[[0, 2]], "s", color="0.3", ms=5)
    axes.plot(0, 0, "o", color="C0", ms=5)
    for way, name in (((2.0, 0), "δx"), ((0, 1.2), "δz")):
        axes.annotate("", way, (0, 0), arrowprops={"arrowstyle": "-|>", "color": "C0", "lw": 1.6})
        axes.text(*(1.2 * np.array(way)), name, color="C0", ha="center", va="center")
    turn = np.linspace(np.radians(110), np.radians(200), 30)
    axes.plot(0.8 * np.cos(turn), 0.8 * np.sin(turn), color="C0", lw=1.2)
    axes.annotate(
        "",
        0.8 * np.array([np.cos(turn[0]), np.sin(turn[0])]),
        0.8 * np.array([np.cos(turn[3]), np.sin(turn[3])]),
        arrowprops={"arrowstyle": "-|>", "color": "C0"},
    )
    axes.text(-1.15, 0.75, "θy", color="C0", ha="center", va="center")
    axes.set(aspect="equal", xlabel="mm", title="from the side: the pose of the top face's centre")
    axes.title.set_fontsize(10)
    axes.margins(0.1)
    axes.set_ylim(top=1.8)


def _chain(figure) -> None:
    for k, text in enumerate(CHAIN):
        x = 0.09 + 0.164 * k
        figure.text(
            x,
            0.08,
            text,
            ha="center",
            va="center",
            fontsize=9,
            bbox={"boxstyle": "round,pad=0.4", "fc": "w", "ec": "0.4"},
        )
        if k:
            figure.text(x - 0.082, 0.08, "→", ha="center", va="center", fontsize=12)
