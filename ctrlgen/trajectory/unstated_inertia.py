"""What the mass of a device does along a path that was solved without it.

A mechanism whose file states masses but no table `[dynamics]` is led as if it stood in balance at every sample. Here the same drives
move the same device with its inertia, damped little, from rest at the beginning of the path until one period of its slowest mode after
the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from ctrlgen.core.units import show
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes
from ctrlgen.model.simulation import Trace, simulate
from ctrlgen.trajectory.scenario import Scenario

NEGLIGIBLE = 1e-6  # of the path's reach: below it nothing is said
MOST_SAMPLES = 20000  # of the path: beyond it, and for static paths, nothing is simulated


@dataclass(frozen=True)
class UnstatedInertia:
    """The slowest mode [Hz], the channel that moves farthest from the path for its reach, its unit, and how far [SI] along the path and
    after it, with `damping_ratio`."""

    frequency: float
    channel: str
    unit: str
    along: float
    after: float
    damping_ratio: float

    def sentence(self) -> str:
        """What is left out, by how much, and what to do."""
        return (
            f"inertia is left out: the file has masses (first mode {show(self.frequency, 'Hz')}) and no [dynamics]; with a damping ratio "
            f"of {100 * self.damping_ratio:g} % these drives, begun at rest, leave {show(self.along, self.unit)} of {self.channel} "
            f"along the path and {show(self.after, self.unit)} after it. Add [dynamics] to the device, or move slower"
        )


def unstated_inertia(
    scenario: Scenario, model: Model, command: np.ndarray, trace: Trace, drive: np.ndarray
) -> UnstatedInertia | None:
    """What the masses of the file do to a solved path; None where it has none, has [dynamics], is static, too long, or where it is
    nothing. `command` (n, channels), `trace` of the n samples, `drive` (n, drives), SI."""
    heavy, h = model.device.with_unstated_inertia(), scenario.sample_time
    if heavy is None or h is None or len(drive) > MOST_SAMPLES:
        return None
    device, damping_ratio = heavy
    moving = build_model(device)
    start = np.concatenate([trace.x[0], np.zeros(moving.v.numel())])
    modes = natural_modes(moving, start, trace.z[0], drive[0])
    if not modes:
        return None
    slowest = min(f for f, _ in modes)
    rest = min(ceil(1 / (slowest * h)), MOST_SAMPLES)
    held, wanted = (np.vstack([v, np.tile(v[-1:], (rest, 1))]) for v in (drive, command))
    reached = simulate(moving, held, h, start, trace.z[0]).signals[scenario.file.follow][: len(wanted)]
    n, signal, off = len(command), model.signals[scenario.file.follow], np.abs(reached - wanted)
    reach = np.maximum(np.ptp(command, axis=0), NEGLIGIBLE * np.array(signal.scale))
    worst = int(np.argmax(off.max(axis=0) / reach))
    if off[:, worst].max() < NEGLIGIBLE * reach[worst]:
        return None
    along, after = float(off[:n, worst].max()), float(off[n:, worst].max())
    return UnstatedInertia(slowest, signal.channels[worst], signal.units[worst], along, after, damping_ratio)
