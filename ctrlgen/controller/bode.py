"""Bode plot: the frequency response from every drive to the pose, or to the readings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import control
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ctrlgen.controller.linearisation import equilibrium, linearise
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_bytes
from ctrlgen.core.units import difference
from ctrlgen.devices import Signal
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.model import Model
from ctrlgen.reporting.line_patterns import dashes
from ctrlgen.reporting.plots import COLOURS, STYLE, image, legend_over

POINTS = 400  # frequencies, beside those of the poles
DECADES = 2  # below the slowest pole and above it, and at least one above the fastest
ACROSS = 3  # panels in a row
DOWN = 1e-4  # of its largest gain, to where a panel shows


@dataclass(frozen=True)
class FrequencyResponse:
    """From every drive to the pose or the readings (`of`), linearised at a `pose` [SI]: `hertz` (n,), `response` (channels, drives, n) and
    the `static` one (channels, drives), in SI; `poles` [rad/s], their absolute values; `structure`: the modes beside those of the model,
    where its device has them."""

    model: Model
    pose: np.ndarray
    hertz: np.ndarray
    response: np.ndarray
    static: np.ndarray
    poles: np.ndarray
    structure: StructuralModel | None = None
    of: str = "pose"

    @property
    def signal(self) -> Signal:
        """That which answers."""
        return self.model.signals[self.of]


def frequency_response(model: Model, pose: np.ndarray, of: str = "pose") -> FrequencyResponse:
    """The gain from every drive to every component of the pose, or of the "reading", over the frequencies that matter.

    `pose` (channels,) [rad, m] is where the model is linearised. Raises InputError where it is not an admissible
    equilibrium, or where the device has no dynamics.
    """
    system, structure = linearise(model, pose, of), structure_at(model, pose)
    poles = np.abs(system.poles())
    poles = poles[poles > 0]
    if structure is not None:
        forced = linearise(model, pose, "force")
        lags = np.abs(np.linalg.eigvals(forced.A[: model.n_states, : model.n_states]))
        poles = np.concatenate([lags[lags > 0], 2 * np.pi * structure.frequencies])
    if not len(poles):
        what = "the device has none: the pose follows the drive without delay at every frequency, so there is nothing to draw"
        raise InputError(model.name, [Fault("dynamics", what)])
    low, high = np.log10(poles.min()) - DECADES, max(np.log10(poles.min()) + DECADES, np.log10(poles.max()) + 1)
    # A resonance is narrower than the points are apart.
    omega = np.unique(np.concatenate([np.logspace(low, high, POINTS), poles]))
    response = control.frequency_response(system, omega, squeeze=False)
    static = np.atleast_2d(system.dcgain())
    if structure is None:
        return FrequencyResponse(model, pose, omega / (2 * np.pi), response.complex, static, poles, None, of)
    force = control.frequency_response(forced, omega, squeeze=False).complex
    whole = np.einsum("ijk,jlk->ilk", structure.receptance(omega, of == "reading"), force)
    return FrequencyResponse(model, pose, omega / (2 * np.pi), whole, static, poles, structure, of)


def structure_at(model: Model, pose: np.ndarray) -> StructuralModel | None:
    """The device with the modes that its model leaves out, as stiff as at `pose`; None where it has none, or effects act on it."""
    structure = None if model.device.effect or not model.inertial else model.device.structural_model()
    if structure is None:
        return None
    _, z, _ = equilibrium(model, pose)
    d, physics = ca.SX.sym("d", len(z)), model.device.physics(model.device.values())
    return structure.at(ca.Function("K", [d], [ca.jacobian(physics.restoring_force(d), d)])(z).full())


def draw_bode(model: Model, pose: np.ndarray, path: Path, of: str = "pose") -> None:
    """Draws the gain from every drive to every component of the pose or the "reading", one panel each, and the phase of the strongest.

    `path` ends in .svg or .png. Raises InputError as `frequency_response` does.
    """
    write_bytes(path, image(bode_figure(frequency_response(model, pose, of)), path.suffix))


def strongest(found: FrequencyResponse, drive: int) -> int:
    """The channel that answers most to a drive, in its typical sizes, at rest."""
    return int(np.argmax(np.abs(found.static[:, drive]) / np.array(found.signal.scale)))


def phase(found: FrequencyResponse, channel: int, drive: int) -> np.ndarray:
    """(n,) phase against the static response [deg], without jumps."""
    turned = np.unwrap(np.angle(found.response[channel, drive] / found.static[channel, drive]))
    return np.asarray(np.degrees(turned))


def bode_figure(found: FrequencyResponse) -> Figure:
    """Gain by pose component, and the phase of the strongest component of each drive."""
    model, hertz, static = found.model, found.hertz, found.static
    signal, drive = found.signal, model.signals["drive"]
    channels = [str(i) for i in range(len(signal.channels))]
    across = min(ACROSS, len(channels))
    rows = [channels[k : k + across] for k in range(0, len(channels), across)]
    layout: Any = [*[row + ["."] * (across - len(row)) for row in rows], ["phase"] * across]
    magnitude = np.abs(found.response)
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
                    hertz,
                    np.where(gain > 0, gain, np.nan),
                    ls=dashes(j),
                    color=COLOURS[j % 6],
                    lw=1.3,
                    label=axis,
                )
            panel.set_ylim(bottom=most * DOWN)
        for j, axis in enumerate(drive.channels):
            i = strongest(found, j)
            if static[i, j]:
                what = f"{axis} -> {signal.channels[i]}"
                grid["phase"].semilogx(
                    hertz, phase(found, i, j), ls=dashes(j), color=COLOURS[j % 6], lw=1.3, label=what
                )
        grid["phase"].set_title(
            "phase against the static response, strongest component of each drive [deg]", fontsize=9
        )
        grid["phase"].set_xlabel("frequency [Hz]")
        legend_over(figure, grid["phase"], below=True)
        first = next((grid[name] for name in channels if grid[name].get_legend_handles_labels()[0]), None)
        if first is not None:
            legend_over(figure, first)
    return figure
