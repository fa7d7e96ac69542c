"""The hexapod with what no description of it says: friction, hysteresis of the actuators, an actuator that is reversed, two exchanged.

Both are rate-independent. Dry friction holds an axis until the force has changed by twice its size: the play operator. The
actuator's hysteresis is a weighted sum of such operators (Prandtl-Ishlinskii), with no net change of the slope over a large loop's mean.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from plants.frame import Array
from plants.mems_hexapod import MemsHexapod, bar_force, temperatures

SETTLING = 10.0  # time constants after which the start of a periodic drive is forgotten: 5e-5


@dataclass
class Imperfect:
    """A bench with a plant that has `friction` [N] on each axis and `hysteresis`, the share of the force that plays of `widths` [N] pass;
    the actuators in `reversed` pull, those in `exchanged` take each other's power."""

    plant: MemsHexapod = field(default_factory=MemsHexapod)
    friction: float = 0.0
    hysteresis: float = 0.0
    widths: tuple[float, ...] = (0.002, 0.005, 0.01)
    reversed: tuple[int, ...] = ()
    exchanged: tuple[int, ...] = ()

    def poses(self, powers: Array, rate: float, every: int) -> Array:
        """(n / every, 6) [rad, um]: every `every`th pose under periodic `powers` (n, 6) [W] at `rate` [Hz], once they repeat."""
        n, a = len(powers), self.plant.numbers.actuator
        powers = powers.copy()
        powers[:, list(self.exchanged)] = powers[:, list(self.exchanged)[::-1]]
        periods = 2 + int(np.ceil(SETTLING * a.time_constant * rate / n))
        start = a.ambient + a.thermal_resistance * powers.mean(axis=0)
        force = bar_force(temperatures(np.tile(powers, (periods, 1)), 1 / rate, a, start)[-2 * n :], a)
        lag = sum(played_back(force, width) for width in self.widths) / len(self.widths)
        force = (1 - self.hysteresis) * force + self.hysteresis * lag
        force = played_back(force, self.friction)
        force[:, list(self.reversed)] *= -1
        return np.array([self.plant.pose(state) for state in self.plant.path(force[-n::every])])


def played_back(force: Array, width: float) -> Array:
    """The play operator of half width `width`: what follows `force` (n, m) with that much slack, from no slack taken up."""
    if not width:
        return force.copy()
    out = np.empty_like(force)
    last = force[0]
    for k, row in enumerate(force):
        last = out[k] = np.clip(last, row - width, row + width)
    return out
