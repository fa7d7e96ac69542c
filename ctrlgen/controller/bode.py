"""Bode plot: the frequency response from every drive to the pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import control
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ctrlgen.controller.linearisation import linearise
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_bytes
from ctrlgen.core.units import difference
from ctrlgen.model.model import Model
from ctrlgen.reporting.plots import COLOURS, STYLE, image

LINES = ("-", "--")  # the curves of the X and Y drives of a stage often coincide
POINTS = 400  # frequencies, beside those of the poles
DECADES = 2  # below the slowest pole and above it, and at least one above the fastest
ACROSS = 3  # panels in a row
DOWN = 1e-4  # of its largest gain, to where a panel shows


def draw_bode(model: Model, pose: np.ndarray, path: Path) -> None:
    """Draws the gain from every drive to every pose component, one panel per component, and the phase of the strongest.

    `pose` (channels,) [rad, m] is where the model is linearised. Raises InputError where it is not an admissible
    equilibrium, or where the device has no dynamics.
    """
    system = linearise(model, pose)
    poles = np.abs(system.poles())
    poles = poles[poles > 0]
    if not len(poles):
        what = "the device has none: the pose follows the drive without delay at every frequency, so there is nothing to draw"
        raise InputError(model.name, [Fault("dynamics", what)])
    low, high = np.log10(poles.min()) - DECADES, max(np.log10(poles.min()) + DECADES, np.log10(poles.max()) + 1)
    # A resonance is narrower than the points are apart.
    omega = np.unique(np.concatenate([np.logspace(low, high, POINTS), poles]))
    response = control.frequency_response(system, omega, squeeze=False)
    figure = _figure(model, response, np.atleast_2d(system.dcgain()), omega / (2 * np.pi))
    write_bytes(path, image(figure, path.suffix))


def _figure(model: Model, response: control.FrequencyResponseData, static: np.ndarray, hertz: np.ndarray) -> Figure:
    signal, drive = model.signals["pose"], model.signals["drive"]
    channels = [str(i) for i in range(len(signal.channels))]
    across = min(ACROSS, len(channels))
    rows = [channels[k : k + across] for k in range(0, len(channels), across)]
    layout: Any = [*[row + ["."] * (across - len(row)) for row in rows], ["phase"] * across]
    magnitude, values = np.abs(response.complex), response.complex
    with plt.rc_context(STYLE):
        figure, grid = plt.subplot_mosaic(layout, figsize=(10, 2.7 * len(layout)))
        for i, channel in enumerate(signal.channels):
            panel, unit = grid[str(i)], signal.units[i]
            panel.set_title(f"{channel} [{unit}/{drive.units[0]}]", fontsize=9)
            most = difference(magnitude[i].max(), unit)
            if most == 0:
                panel.text(
                    0.5, 0.5, "does not respond to first order", ha="center", transform=panel.transAxes, fontsize=8
                )
                continue
            for j, axis in enumerate(drive.channels):
                gain = difference(magnitude[i, j], unit)
                panel.loglog(
                    hertz, np.where(gain > 0, gain, np.nan), LINES[j % 2], color=COLOURS[j % 6], lw=1.3, label=axis
                )
            panel.set_ylim(bottom=most * DOWN)
        for j, axis in enumerate(drive.channels):
            i = int(np.argmax(np.abs(static[:, j]) / np.array(signal.scale)))
            if static[i, j]:
                phase = np.degrees(np.unwrap(np.angle(values[i, j] / static[i, j])))
                what = f"{axis} -> {signal.channels[i]}"
                grid["phase"].semilogx(hertz, phase, LINES[j % 2], color=COLOURS[j % 6], lw=1.3, label=what)
        grid["phase"].set_title(
            "phase against the static response, strongest component of each drive [deg]", fontsize=9
        )
        grid["phase"].set_xlabel("frequency [Hz]")
        grid["phase"].legend(ncols=3, fontsize=8)
        first = next((grid[name] for name in channels if grid[name].get_legend_handles_labels()[0]), None)
        if first is not None:
            first.legend(ncols=3, fontsize=7)
    return figure
