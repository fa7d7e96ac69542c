"""How fast a wrong belief of a device's states dies out, whatever the drives are: what the controller tells UNSURE by.

A state x_k that is believed, and the true one, are led by the same drives through the same sample x_{k+1} = F(x_k, z_k, u_k), where z_k
balances the forces at x_k. By the mean value theorem their difference obeys |e_{k+1}| <= M |e_k|, with M the largest magnitude of each
entry of dF/dx + dF/dz dz/dx over the ranges, which interval arithmetic bounds (for lags it is a constant). So |e_{k+n}| <= M^n |e_k|: a
state that was wrong by the whole range is known after as many samples as bring that below `KNOWN`. A memory that does not forget, such as
a play, has an entry of one: it stays unknown until the device is told to be at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import casadi as ca
import numpy as np

from ctrlgen.model.discretisation import settling_time
from ctrlgen.model.inverse import Inverse
from ctrlgen.model.model import Model
from ctrlgen.numerics.interval_arithmetic import bounds

KNOWN = 1e-6  # of its range, by which a state may be wrong and is told as known: as SETTLING_TIME_CONSTANTS of the model has it
FOREVER = 2**32 - 1  # samples: the count of a state that does not become known by waiting
MOST = 2**31  # samples that are counted; a state that needs more is taken for one that does not forget
SLOWEST = 1 - 2.0**-30  # rate of a sample above which an error is taken not to die out; a rounding is far below
ROOM = 1.0  # of its range, by which a displacement is taken to be beyond while a state is unknown: a heater that was held on
PIECES = 32  # of the range of displacements, over which interval arithmetic is narrower
# Of the way from the spectral radius to one: rates of which the soonest is taken
TRIED = (1e-6, 1e-3, 1e-2, 0.03, 0.1, 0.3)


@dataclass(frozen=True)
class Contraction:
    """Bounds of a belief in the states x (n_x,), in SI and samples.

    `low`, `high`: between which states are that any drives in range led to. `known`: an error of each that is none; infinite for a state
    that does not forget. `start`: what is believed of a device of which nothing is known: the end of the range that is farthest from
    rest, so that errors have one sign, or rest between two ends. `side`: 1 where
    that end is the high one, -1 the low one, 0 neither. `settling`: after how many samples under a held drive the states that
    forget are those of its equilibrium. `unknown`: after how many samples a state of which nothing was known is known, or FOREVER.
    `halving`, `growth`: after n of these many samples an error is at most growth 2^-n of what it was, in terms of `known`.
    """

    low: np.ndarray
    high: np.ndarray
    known: np.ndarray
    start: np.ndarray
    side: np.ndarray
    settling: int
    unknown: int
    halving: int
    growth: float

    def in_known(self, n: int) -> float:
        """Of a belief of the first n states at one end of a measurement: by how many times `known` it is wrong at most, over the error
        of the measurement in SI, which is half of what lies between the ends."""
        return 2.0 * self.growth / float(np.min(self.known[:n]))

    @property
    def elsewhere(self) -> np.ndarray:
        """(n_x,) of each state a value that drives can lead to, and that it has not at rest."""
        return np.where(self.side != 0, self.start, self.high)


class Stepped(NamedTuple):
    """A model of the device, free of parameters, with its kernels for equilibria and for the next sample."""

    nominal: Model
    static: Inverse
    moving: Inverse


def contraction(every: Sequence[Stepped], sample_time: float) -> Contraction:
    """Of the device with any of its run-time constants, over one `sample_time` [s]: the first has those of the device file."""
    nominal = every[0].nominal
    ranges = [_reach(k) for k in every]
    low, high = np.min([r[0] for r in ranges], axis=0), np.max([r[1] for r in ranges], axis=0)
    gain = np.max([_gain(k, low, high) for k in every], axis=0)
    wide, rest = high - low, nominal.rest
    known = KNOWN * np.where(np.isfinite(wide) & (wide > 0), wide, nominal.x_scale)
    forgets = forgetting(gain) & np.isfinite(wide)
    lags = gain[np.ix_(forgets, forgets)] * known[forgets] / known[forgets][:, None]
    error = wide[forgets] / known[forgets]
    shrinks = shrinking(lags, error)
    settling = shrinks.samples(error)
    if not forgets.all():  # of lags that were not shown to forget
        settling = max(settling, *(ceil(settling_time(k.nominal) / sample_time) for k in every))
    own_low, own_high = ranges[0]
    start = np.where(rest <= own_low, high, np.where(rest >= own_high, low, rest))
    start = np.where(forgets, start, rest)
    return Contraction(
        low,
        high,
        np.where(forgets, known, np.inf),
        start,
        np.sign(start - rest),
        min(settling, MOST),
        settling if forgets.all() and settling < MOST else FOREVER,
        shrinks.halving,
        shrinks.growth,
    )


def _reach(kernels: Stepped) -> tuple[np.ndarray, np.ndarray]:
    """Low and high (n_x,) of the states that drives in range can lead to from rest: those of equilibria, and their limits."""
    m = kernels.nominal
    room = ROOM * (m.z_bounds[1] - m.z_bounds[0])
    z_range = m.z_bounds[0] - room, m.z_bounds[1] + room
    low, high = bounds(kernels.static.advance, {"x": m.x_bounds, "z": z_range, "drive": m.u_bounds})
    least, most = (np.where(np.isfinite(bound), bound, m.rest) for bound in m.x_bounds)
    return np.minimum.reduce([low, least, m.rest]), np.maximum.reduce([high, most, m.rest])


def _gain(kernels: Stepped, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n_x, n_x) M of the module; infinite where it could not be bounded."""
    m, step = kernels.nominal, kernels.moving.advance
    x, z, u = (ca.SX.sym(name, count) for name, count in (("x", m.x.numel()), ("z", m.z.numel()), ("u", m.u.numel())))
    after = step(x, z, u)
    slope = ca.jacobian(after, x)
    if ca.depends_on(after, z):
        by_z = ca.substitute(_displacement_by_state(m), ca.vertcat(m.x, m.z, m.u), ca.vertcat(x, z, u))
        slope += ca.mtimes(ca.jacobian(after, z), ca.substitute(by_z, m.p, ca.DM(m.p_nominal)))
    entries = ca.Function("slope", [x, z, u], [ca.densify(ca.vec(slope))], ["x", "z", "u"], ["entries"])
    # Where each entry reads one z at most, pieces of its range are pieces of all
    alone = np.diff(ca.jacobian(entries(x, z, u), z).sparsity().T.colind()).max(initial=0) <= 1
    room, pieces = m.z_bounds[1] - m.z_bounds[0], PIECES if alone else 1
    edges = np.linspace(m.z_bounds[0] - ROOM * room, m.z_bounds[1] + ROOM * room, pieces + 1)
    ranges = [{"x": (low, high), "z": piece, "u": m.u_bounds} for piece in pairwise(edges)]
    largest = np.max([np.abs(bounds(entries, each)) for each in ranges], axis=(0, 1))
    return largest.reshape(m.x.numel(), -1, order="F")


def _displacement_by_state(m: Model) -> ca.SX:
    """dz/dx of the balance."""
    return -ca.solve(ca.jacobian(m.balance, m.z), ca.jacobian(m.balance, m.x))


def forgetting(gain: np.ndarray) -> np.ndarray:
    """(n_x,) which states forget where they began: those that only states act on whose errors die out."""
    acts = np.linalg.matrix_power((gain > 0).astype(float) + np.eye(len(gain)), len(gain)) > 0  # over other states too
    dies = np.zeros(len(gain), dtype=bool)
    for i, among in enumerate(acts & acts.T):  # those that act on i and it on them
        block = gain[np.ix_(among, among)]
        bounded = np.isfinite(block).all() and np.isfinite(gain[i]).all()
        dies[i] = bounded and np.abs(np.linalg.eigvals(block)).max() < SLOWEST
    return np.asarray([dies[row].all() for row in acts])


@dataclass(frozen=True)
class _Shrinking:
    """Errors e >= 0 that are at most s v become at most s rate^n v in n samples: gain @ v <= rate v, v > 0."""

    rate: float
    v: np.ndarray

    def samples(self, error: np.ndarray) -> int:
        """After how many an `error` is at most 1 in each place, and stays so."""
        size = float(np.max(error / self.v, initial=0.0) * np.max(self.v, initial=0.0))
        return 1 if size <= 1 else 1 + ceil(np.log(size) / -np.log(self.rate))

    @property
    def halving(self) -> int:
        """Samples in which s v becomes at most half of it."""
        return ceil(np.log(2) / -np.log(self.rate))

    @property
    def growth(self) -> float:
        """The largest of v over the least: how much larger than the largest error at first any error can become."""
        return float(np.max(self.v) / np.min(self.v)) if len(self.v) else 1.0


def shrinking(gain: np.ndarray, error: np.ndarray) -> _Shrinking:
    """The `_Shrinking` of a `gain` (n, n) >= 0, of spectral radius below one, that makes an `error` (n,) small soonest, of those that were
    tried. For a rate above the spectral radius v = (rate - gain)^-1 1 is positive, and gain @ v = rate v - 1 (Perron, Frobenius)."""
    if not len(gain):
        return _Shrinking(0.5, np.ones(0))
    radius = float(np.abs(np.linalg.eigvals(gain)).max())
    tried = []
    for share in TRIED:
        rate = radius + share * (1 - radius)
        tried.append(_Shrinking(rate, np.linalg.solve(rate * np.eye(len(gain)) - gain, np.ones(len(gain)))))
    return min(tried, key=lambda each: each.samples(error))
