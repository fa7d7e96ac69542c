"""Bode plot: the frequency response from every drive to the pose."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import control
import matplotlib.pyplot as plt
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_bytes
from ctrlgen.core.units import from_si
from ctrlgen.model.linearisation import linearise
from ctrlgen.model.model import Model
from ctrlgen.reporting.plots import COLOURS, STYLE

LINES = ("-", "--")  # the curves of the X and Y drives of a stage often coincide
POINTS = 200  # frequencies
DECADES = 2  # to either side of the slowest pole


def draw_bode(model: Model, pose: np.ndarray, path: Path) -> None:
    """Draws the gain from every drive to every pose component, one panel per component, and the phase of the strongest.

    `pose` (channels,) [rad, m] is where the model is linearised. Raises InputError where it is not an admissible
    equilibrium, or where the device has no dynamics.
    """
    system = linearise(model, pose)
    if not len(system.poles()):
        raise InputError(
            model.name,
            [
                Fault(
                    "dynamics",
                    "has none: the pose follows the drive at once at all frequencies, so there is nothing to draw",
                )
            ],
        )
    signal, drive = model.signals["pose"], model.signals["drive"]
    slowest = -np.max(system.poles().real)
    omega = slowest * np.logspace(-DECADES, DECADES, POINTS)
    response = control.frequency_response(system, omega)
    with plt.rc_context(STYLE):
        layout: Any = [*[list("abc"), list("def")][: -(-len(signal.channels) // 3)], ["phase"] * 3]
        figure, grid = plt.subplot_mosaic(layout, figsize=(10, 2.7 * len(layout)))
        hertz = omega / (2 * np.pi)
        for i, channel in enumerate(signal.channels):
            panel = grid["abcdef"[i]]
            for j, axis in enumerate(drive.channels):
                gain = from_si(response.magnitude[i, j], signal.units[i])
                panel.loglog(hertz, gain, LINES[j % 2], color=COLOURS[j % 6], lw=1.3, label=axis)
            panel.set_ylim(bottom=from_si(response.magnitude[i].max(), signal.units[i]) * 1e-4)
            panel.set_title(f"{channel} [{signal.units[i]}/{drive.units[0]}]", fontsize=9)
        for j, axis in enumerate(drive.channels):
            i = int(np.argmax(response.magnitude[:, j, 0] / np.array(signal.scale)))
            phase = np.degrees(np.unwrap(np.angle(response.complex[i, j] / system.dcgain()[i, j])))
            grid["phase"].semilogx(
                hertz, phase, LINES[j % 2], color=COLOURS[j % 6], lw=1.3, label=f"{axis} -> {signal.channels[i]}"
            )
        grid["phase"].set_title(
            "phase against the static response, strongest component of each drive [deg]", fontsize=9
        )
        grid["phase"].set_xlabel("frequency [Hz]")
        grid["phase"].legend(ncols=3, fontsize=8)
        grid["a"].legend(ncols=3, fontsize=7)
        buffer = io.BytesIO()
        figure.savefig(buffer, format=path.suffix[1:], dpi=150)
        plt.close(figure)
    write_bytes(path, buffer.getvalue())
