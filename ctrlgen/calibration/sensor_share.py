"""What a wrong scale of the sensor does to constants that were fitted to its readings: the budget of the sensor in a calibration.

The fit cannot tell a scale of the sensor from constants that scale the motion. With the scales of the channels held as described while
they are off, the constants c deviate by G dg, G of `by_held`, and by that much the true motion of a path that is solved with them is
spoiled. Scales of which nothing is stated are off together, as by a wrong reference: that a single one is wrong shows against the
others, and the fit weighs it less.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.core.units import Quantity
from ctrlgen.devices.usual_deviation import ASSUMED_SCALE
from ctrlgen.effects import Place, means
from ctrlgen.effects.gain import SensorGain
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.structure import Structure


def sensor_covariance(fitter: Fitter, fit: Fit) -> np.ndarray:
    """(k, k) [SI] covariance of the fitted constants that the scales of the sensor's channels make by themselves."""
    before = len(fit.structure.device.effect)
    k, held = (
        len(fit.theta),
        _held(fit.structure, dict(zip(fitter.recording.channels, fitter.recording.units, strict=True))),
    )
    if not held.free or len(held.free) == k:
        return np.zeros((k, k))
    sds = np.array([p.sd for p in held.free[k:]])
    values = np.concatenate([fit.theta, [p.nominal for p in held.free[k:]]])
    joint = fitter.fit(held, values, steps=0).covariance
    G = by_held(joint, k)
    added = range(before, len(held.device.effect))
    together = np.array([p.path.startswith(tuple(f"effect[{j}]." for j in added)) for p in held.free[k:]])
    common = G @ np.where(together, sds, 0.0)
    return np.asarray(G @ np.diag(np.where(together, 0.0, sds**2)) @ G.T + np.outer(common, common))


def by_held(joint: np.ndarray, n: int) -> np.ndarray:
    """(n, n_h) by how much n fitted constants c move with what is held, G = dc/dh = C_ch C_hh^-1, from the covariance `joint` of a fit of
    both, c before h; whatever is stated of h there."""
    return np.asarray(np.linalg.solve(joint[n:, n:], joint[n:, :n]).T)


def _around(path: str, nominal: float, sd: float) -> FreeParameter:
    """A number that is known to `sd`, for a fit that takes no step: its bounds only have to be out of the way."""
    return FreeParameter(path, "1", nominal, nominal - 10 * sd, nominal + 10 * sd, sd, sd)


def _held(structure: Structure, channels: dict[str, str]) -> Structure:
    """The structure with what is not known exactly of its sensor free beside its constants: numbers of its laws with a stated sd, and in
    `channels` (with their units) without such a law a scale."""
    device, free = structure.device, list(structure.free or ())
    known = set[str]()
    for j, effect in enumerate(device.effect):
        if effect.place is not Place.SENSOR:
            continue
        for name, number in effect.values.items():
            if number.sd:
                known.add(effect.at)
                free.append(_around(f"effect[{j}].{name}", number.si, number.sd))
    added = list[SensorGain]()
    for channel, unit in channels.items():
        at = channel.partition(".")[2] or channel
        if channel.startswith("reading.") and not any(means(stated, at, unit) for stated in known):
            path = f"effect[{len(device.effect) + len(added)}].gain"
            added.append(SensorGain(at, {"gain": Quantity(0.0, "0")}))
            free.append(_around(path, 0.0, ASSUMED_SCALE))
    changed = device.model_copy(update={"effect": (*device.effect, *added)})
    return replace(structure, device=changed, free=tuple(free))
