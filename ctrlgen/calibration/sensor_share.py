"""What a wrong scale of the sensor does to constants that were fitted to its readings: the budget of the sensor in a calibration.

The fit cannot tell a scale of the sensor from constants that scale the motion. With the scales of the channels held as described while
they are off, the constants c deviate by G dg, G = dc/dg = C_cg C_gg^-1 of a fit of both (`calibrate.with_held`), and by that much the true
motion of a path that is solved with them is spoiled. Scales of which nothing is stated are off together, as by a wrong reference: that a
single one is wrong shows against the others, and the fit weighs it less.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.core.units import Quantity
from ctrlgen.effects import Place
from ctrlgen.effects.gain import SensorGain
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.structure import Structure

ASSUMED_SCALE = 5e-3
"""Standard deviation of the scale of each channel where the device file states none, as `LearningOptions.sensor_scale`."""


def sensor_covariance(fitter: Fitter, fit: Fit) -> np.ndarray:
    """(k, k) [SI] covariance of the fitted constants that the scales of the sensor's channels make by themselves."""
    before = len(fit.structure.device.effect)
    k, held = len(fit.theta), _held(fit.structure, fitter.recording.channels)
    if not held.free or len(held.free) == k:
        return np.zeros((k, k))
    sds = np.array([p.sd for p in held.free[k:]])
    values = np.concatenate([fit.theta, [p.nominal for p in held.free[k:]]])
    joint = fitter.fit(held, values, steps=0).covariance
    G = np.linalg.solve(joint[k:, k:], joint[k:, :k]).T
    added = range(before, len(held.device.effect))
    together = np.array([p.path.startswith(tuple(f"effect[{j}]." for j in added)) for p in held.free[k:]])
    common = G @ np.where(together, sds, 0.0)
    return np.asarray(G @ np.diag(np.where(together, 0.0, sds**2)) @ G.T + np.outer(common, common))


def _held(structure: Structure, channels: tuple[str, ...]) -> Structure:
    """The structure with what is not known exactly of its sensor free beside its constants: numbers of its laws with a stated sd, and in
    channels without such a law a scale."""
    device, free = structure.device, list(structure.free or ())
    known = set[str]()
    for j, effect in enumerate(device.effect):
        if effect.place is not Place.SENSOR:
            continue
        for name, number in effect.values.items():
            if number.sd:
                known.add(effect.at)
                reach = 10 * number.sd
                path = f"effect[{j}].{name}"
                free.append(
                    FreeParameter(path, "1", number.si, number.si - reach, number.si + reach, number.sd, number.sd)
                )
    added = list[SensorGain]()
    for channel in channels:
        at = channel.partition(".")[2] or channel
        if channel.startswith("reading.") and not known & {at, "all"}:
            path = f"effect[{len(device.effect) + len(added)}].gain"
            added.append(SensorGain(at, {"gain": Quantity(0.0, "0")}))
            free.append(FreeParameter(path, "1", 0.0, -0.5, 0.5, 2 * ASSUMED_SCALE, ASSUMED_SCALE))
    changed = device.model_copy(update={"effect": (*device.effect, *added)})
    return replace(structure, device=changed, free=tuple(free))
