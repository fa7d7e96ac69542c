"""The frequency response drive -> pose as a picture."""

from __future__ import annotations

import io
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

from ctrlgen.figures import COLOURS, STYLE
from ctrlgen.files import write_bytes
from ctrlgen.linearise import linearise
from ctrlgen.model import Model
from ctrlgen.units import from_si


def draw_bode(model: Model, pose: np.ndarray, path: Path) -> None:
    """Gain of every pose component to every drive, one panel a component, and the phase of the last row's lag.

    Raises InputError when `pose` (6,) is not an admissible equilibrium.
    """
    system = linearise(model, pose)
    signal, drive = model.signals["pose"], model.signals["drive"]
    slowest = -np.max(system.poles().real)
    omega = np.logspace(np.log10(slowest) - 2, np.log10(slowest) + 2, 200)
    response = control.frequency_response(system, omega)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(3, 3, figsize=(10, 7.5), sharex=True)
        for i, channel in enumerate(signal.channels):
            panel = axes[i // 3, i % 3]
            for j, axis in enumerate(drive.channels):
                gain = from_si(response.magnitude[i, j], signal.units[i])
                panel.loglog(omega / (2 * np.pi), gain, color=COLOURS[j % 6], lw=1.2, label=axis)
            panel.set_ylim(bottom=from_si(response.magnitude[i].max(), signal.units[i]) * 1e-4)
            panel.set_title(f"{channel} [{signal.units[i]}/{drive.units[0]}]", fontsize=9)
        for j, axis in enumerate(drive.channels):
            row, column = 2, j % 3
            strongest = int(np.argmax(response.magnitude[:, j, 0] / np.array(signal.scale)))
            phase = np.degrees(np.unwrap(np.angle(response.complex[strongest, j])))
            axes[row, column].semilogx(omega / (2 * np.pi), phase - 360 * np.round(phase[0] / 360), color=COLOURS[j % 6], lw=1.2)
            axes[row, column].set_title(f"phase {drive.channels[column]}, {drive.channels[column + 3]} -> strongest [deg]", fontsize=9)
            axes[row, column].set_xlabel("frequency [Hz]")
        axes[0, 0].legend(ncols=3, fontsize=7)
        buffer = io.BytesIO()
        figure.savefig(buffer, format=path.suffix[1:], dpi=150)
        plt.close(figure)
    write_bytes(path, buffer.getvalue())
