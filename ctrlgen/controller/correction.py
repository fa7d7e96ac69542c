"""A bounded correction of commanded poses that repeats along the way, and how it is learnt from measured runs.

The C adds c(s) = sum_k v_k phi_k(s) to a commanded channel, s a commanded channel, before the controller sees the target: whatever v is,
limits are kept of what is then commanded. phi are hat functions at even distances ("table", partition of unity, straight lines between
entries) or sines and cosines of a period ("harmonic"). The C's functions are printed from the expressions here, and the arithmetic of
`CorrectionLearning.after_run` is that of the C.

After a run with errors e_i = measured - commanded at s_i, less their mean (which is a zero, of sensor or device),

    v <- P(v - g D^-1 Phi'(e - mean e)),   D_k = 1 + sum_l |(Phi' Phi)_kl|

with P the projection onto the bound. D - Phi' Phi is diagonally dominant, so D >= Phi' Phi: a step with 0 < g <= 1 of projected gradient
descent on sum (e - mean e)^2, which falls or stays for every device that answers a correction by a share below 2/g of it, however little of
the way the samples cover (A. Beck, First-Order Methods in Optimization, SIAM 2017, th. 10.15). A run that is measured to be worse all the
same (a reversed device) is gone back from, and the step halved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntFlag
from functools import cached_property

import casadi as ca
import numpy as np

# Below the bound by more than what sums of harmonics round, so that what was learnt is within it when it is read again
HARMONIC_SHARE = 1 - 1e-5
HALVINGS = 8  # of a step of harmonics that would leave the bound
SAMPLES_PER_NUMBER = 2  # of a run, at least: fewer say nothing of what lies between them
MOST_SAMPLES = 65536  # of a run: what sums in float hold to a thousandth
REFUSED = 10  # one sample in so many may be refused of a run: single spikes; more, and the rest is not the way that other runs took
EARLY = 7  # first samples of a run, the median of whose errors the others are taken from: three spikes among them do no harm
FAR = 4.0  # bounds by which an error may differ from that median: twice what any correction could explain


class CorrectionStatus(IntFlag):
    """What became of a correction, or of a run; beside the bits of the controller."""

    INPUT = 16  # a number is none, an error absurd, or the run has its `MOST_SAMPLES`: the sample is not taken
    LOST = 32  # the run was not begun
    UNUSED = 2048  # the table is damaged or was not initialised, and nothing is added
    WORSE = 4096  # the run was worse than the best one, whose numbers are in use again
    SHORT = 8192  # the run had too few samples, or too many were refused, and nothing was learnt


@dataclass(frozen=True)
class Basis:
    """Functions phi of a commanded channel: `count` hat functions, or sines and then cosines. `length` [SI] of the period, or of a range
    that begins at `origin` and is not `closed`."""

    kind: str
    count: int
    length: float
    origin: float = 0.0
    closed: bool = True

    @property
    def harmonics(self) -> int:
        """The highest harmonic."""
        return self.count // 2

    def place(self, s: ca.SX) -> ca.SX:
        """Where a channel is between the entries of a table: 0 ... count, of an open one 0 ... count - 1."""
        t = (s - self.origin) / self.length
        return self.count * (t - ca.floor(t)) if self.closed else (self.count - 1) * ca.fmin(ca.fmax(t, 0), 1)

    def waves(self, s: ca.SX, most: int) -> ca.SX:
        """(2 most,) sin x ... sin(most x), cos x ... cos(most x) of the phase x, by the sums of angles."""
        t = s / self.length
        x = 2 * np.pi * (t - ca.floor(t))
        sine, cosine = [ca.sin(x)], [ca.cos(x)]
        for _ in range(most - 1):
            sine.append(sine[-1] * cosine[0] + cosine[-1] * sine[0])
            cosine.append(cosine[-1] * cosine[0] - sine[-2] * sine[0])
        return ca.vertcat(*sine, *cosine)

    def functions(self, s: ca.SX) -> ca.SX:
        """(count,) phi at a channel [SI]."""
        if self.kind == "harmonic":
            return self.waves(s, self.harmonics)
        off = [self.place(s) - k for k in range(self.count)]
        hats = [ca.fmax(0, 1 - ca.fabs(d)) for d in off]
        if self.closed:
            hats[0] += ca.fmax(0, 1 - ca.fabs(off[0] - self.count))
        return ca.vertcat(*hats)

    def moved(self, s: ca.SX) -> ca.SX:
        """(count * (order + 1),) phi and their derivatives by time, of a channel s (order + 1,) with its own; of harmonics alone where
        there are any."""
        order = s.numel() - 1
        if not order:
            return self.functions(s)
        wave = ca.SX.sym("wave", self.count)
        sine, cosine = wave[: self.harmonics], wave[self.harmonics :]
        rate = 2 * np.pi / self.length * s[1] * ca.DM(range(1, self.harmonics + 1))
        parts = [wave]
        for _ in range(order):  # of what a sine and a cosine are by their phase
            along = ca.vertcat(rate * cosine, -rate * sine, s[1:], 0)
            parts.append(ca.jtimes(parts[-1], ca.vertcat(wave, s), along))
        return ca.substitute(ca.vertcat(*parts), wave, self.functions(s[0]))


@dataclass(frozen=True)
class Correction:
    """Of one channel `of`, along a channel `over`; at most `bound` [SI] is added. `gain`, the share of what a run shows that is taken."""

    of: int
    over: int
    basis: Basis
    bound: float
    gain: float

    @cached_property
    def phi(self) -> ca.Function:
        """Channel [SI] -> (count,) phi."""
        s = ca.SX.sym("over")
        return ca.Function("phi", [s], [self.basis.functions(s)], ["over"], ["result"])

    def moved(self, order: int) -> ca.Function:
        """A channel with its derivatives (order + 1,) -> phi with theirs, (count * (order + 1),)."""
        s = ca.SX.sym("over", order + 1)
        return ca.Function("moved", [s], [self.basis.moved(s)], ["over"], ["result"], {"cse": True})

    def within(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The numbers (count,) after a step, or as much of it as the bound lets: of a table each entry, of harmonics the sum of their
        amplitudes."""
        if self.basis.kind == "table":
            return np.clip(values + step, -self.bound, self.bound)
        for k in range(HALVINGS):
            then = values + 0.5**k * step
            if np.sum(np.hypot(*np.split(then, 2))) <= HARMONIC_SHARE * self.bound:
                return then
        return values

    def steepness(self, phi: np.ndarray) -> np.ndarray:
        """(count,) D of `phi` (n, count) at the samples of a run."""
        if self.basis.kind == "table":  # rows of Phi' Phi sum up to those of phi, whose own sum is one
            return 1 + phi.sum(axis=0)
        return np.asarray(1 + np.abs(phi.T @ phi).sum(axis=1))


@dataclass(frozen=True)
class Corrections:
    """All corrections of a controller whose target has so many `channels`, each with its derivatives up to `order`. Their numbers stand one
    after the other."""

    each: tuple[Correction, ...]
    channels: int
    order: int = 0

    @property
    def count(self) -> int:
        """Of their numbers."""
        return sum(c.basis.count for c in self.each)

    @property
    def fewest(self) -> int:
        """Samples of a run from which is learnt."""
        return max(EARLY, SAMPLES_PER_NUMBER * max(c.basis.count for c in self.each))

    def parts(self, values: np.ndarray) -> list[np.ndarray]:
        """The numbers (count,) of each correction."""
        return np.split(values, np.cumsum([c.basis.count for c in self.each])[:-1])

    def corrected(self, values: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """The `targets` (n, channels * (order + 1)) [SI] with what is added to them."""
        out = targets.copy()
        for c, v in zip(self.each, self.parts(values), strict=True):
            over = targets[:, c.over :: self.channels]
            moved = c.moved(self.order).map(len(targets))(over.T).full()
            out[:, c.of :: self.channels] += v @ moved.T.reshape(len(targets), self.order + 1, -1).transpose(0, 2, 1)
        return out


@dataclass(frozen=True)
class CorrectionLearning:
    """What is known after runs: the numbers in use, `values` (count,), and the best ones that a run has measured, `kept`; by correction
    the mean square error `cost` [SI] of these, the `gain` now, and whether the numbers in use are still to be tried (`trial`)."""

    corrections: Corrections
    values: np.ndarray
    kept: np.ndarray
    cost: np.ndarray
    gain: np.ndarray
    trial: np.ndarray

    @classmethod
    def begin(cls, corrections: Corrections) -> CorrectionLearning:
        """Before the first run: nothing is added."""
        v, n = np.zeros(corrections.count), len(corrections.each)
        gains = np.array([c.gain for c in corrections.each])
        return cls(corrections, v, v, np.zeros(n), gains, np.zeros(n, bool))

    def after_run(self, targets: np.ndarray, measured: np.ndarray) -> tuple[CorrectionLearning, CorrectionStatus]:
        """After a run with these numbers: `targets` (n, ...) as commanded, before the correction, and `measured` (n, channels) [SI]. The
        status has what of the run was not taken."""
        status, every = CorrectionStatus(0), self.corrections.each
        targets = targets[:, : self.corrections.channels]
        errors = measured - targets
        usable = np.isfinite(errors).all(axis=1)
        if usable.sum() < EARLY:
            return self, (status if usable.all() else CorrectionStatus.INPUT) | CorrectionStatus.SHORT
        off = errors - np.median(errors[usable][:EARLY], axis=0)
        usable &= np.all([np.abs(off[:, c.of]) <= FAR * c.bound for c in every], axis=0)
        refused = np.sum(~usable & (np.cumsum(usable) < MOST_SAMPLES))
        usable &= np.cumsum(usable) <= MOST_SAMPLES
        if not usable.all():
            status |= CorrectionStatus.INPUT
        if usable.sum() < self.corrections.fewest or REFUSED * refused > usable.sum():
            return self, status | CorrectionStatus.SHORT
        out = [self._term(k, targets[usable, c.over], off[usable, c.of]) for k, c in enumerate(every)]
        values, kept = (np.concatenate(parts) for parts in list(zip(*out, strict=True))[:2])
        cost, gain, trial = (np.array(part) for part in list(zip(*out, strict=True))[2:])
        if np.any(self.trial & ~trial):
            status |= CorrectionStatus.WORSE
        return replace(self, values=values, kept=kept, cost=cost, gain=gain, trial=trial), status

    def _term(self, k: int, over: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray, float, float, bool]:
        """Values, kept, cost, gain and trial of correction `k` after a run with errors e (n,)."""
        c = self.corrections.each[k]
        v, kept = self.corrections.parts(self.values)[k], self.corrections.parts(self.kept)[k]
        gain, cost = self.gain[k], float(np.mean(e**2) - np.mean(e) ** 2)
        if self.trial[k] and cost > self.cost[k]:
            return kept, kept, self.cost[k], gain / 2, False
        gain = min(2 * gain, c.gain) if self.trial[k] else gain
        phi = c.phi.map(len(over))(over[None]).full().T
        step = -gain * (phi.T @ (e - np.mean(e))) / c.steepness(phi)
        return c.within(v, step), v, cost, gain, True
