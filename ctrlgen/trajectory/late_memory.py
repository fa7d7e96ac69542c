"""How far off the path what remembers the displacement leaves a stage in balance, because it learns of it half a sample late.

`held_step` gives creep the displacement at the beginning of a sample. A stage behind heaters, which change little by little, has by
half the way of the sample gone on from there. Inverse, simulation and C have that in common and call it nothing. Here the drives of a
solved path are put into the same model with `PARTS` steps a sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices import Signal
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace, simulate

PARTS = 8
MOST_SAMPLES = 2000  # of the path's beginning that are looked at: with eight steps each, half a second
NOTICED = 1e-4  # of the way of a channel, or of its typical size where that is more; ten times what the C may differ by


@dataclass(frozen=True)
class LateMemory:
    """The `channel` of the followed `signal` that is farthest off for its way, by `off` [SI] at the `time` [s]."""

    signal: Signal
    channel: str
    off: float
    time: float

    def sentence(self) -> str:
        """How far off, where and when, and what to do."""
        unit = self.signal.units[self.signal.channels.index(self.channel)]
        return (
            f"creep is given the displacement of the beginning of each sample: {self.channel} is {show(self.off, unit)} off the path "
            f"at {self.time:.4g} s, "
            "which no other number here counts; half the sample time leaves half of it"
        )


def late_memory(
    model: Model, follow: str, trace: Trace, drive: np.ndarray, sample_time: float | None
) -> LateMemory | None:
    """What comes of it along a solved path, its `trace` and the held `drive` (n, n_u) [SI]; None where nothing remembers the displacement,
    or where it is nothing."""
    if sample_time is None or model.inertial or not ca.depends_on(model.rates, model.z):
        return None
    u = drive[:MOST_SAMPLES]
    plain = build_model(model.device)  # what looks back by samples keeps others where these are shorter
    start = trace.x[0][[model.x_names.index(name) for name in plain.x_names]]
    wanted, found = (
        simulate(plain, np.repeat(u, k, axis=0), sample_time / k, start, trace.z[0]).signals[follow][: len(u) * k : k]
        for k in (1, PARTS)
    )
    # steps of a share 1/PARTS leave that share of it
    off = np.abs(found - wanted) * PARTS / (PARTS - 1)
    way = np.maximum(np.ptp(wanted, axis=0), model.signals[follow].scale)
    sample, channel = np.unravel_index(int(np.argmax(off / way)), off.shape)
    if off[sample, channel] <= NOTICED * way[channel]:
        return None
    signal = model.signals[follow]
    return LateMemory(signal, signal.channels[channel], float(off[sample, channel]), float(trace.time[sample]))
