"""The nearest paths that can be followed where the commanded one cannot: shifted, smaller, slower.

Each is found with the inverse of the path alone, which costs microseconds a sample; while it is searched, a path is
looked at in a few hundred places and without the effects' memories, and what is found is confirmed with all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ctrlgen.core.units import from_si, show
from ctrlgen.devices.limit import ranges
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.problem import PathProblem

SHARES = 2.0 ** -np.arange(7, -1, -1)  # of the way to the end of an admissible range, where a shift is tried
HALVINGS = 9  # of an interval: a shift or a scale to a five-hundredth
SMALLEST_SCALE = 1e-3  # below, a path is no longer the same
SLOWEST = 64.0  # times the duration
LOOKED_AT = 200  # samples along a path, beside its extremes, while it is searched
MARGINS = (0.003, 0.01, 0.03, 0.1)  # shares of the limits that are left to memories, where these are not searched with
CONFIRMING_PERIODS = 3  # of a closed path with memories
INSIDE = 1e-4  # of an axis' range that a shifted path stays inside of it: rounding the shift to be shown costs less


@dataclass(frozen=True)
class Alternative:
    """A path that can be followed: `what` it is compared with the commanded one, and its `motion`."""

    what: str
    motion: Motion


class Alternatives:
    """The paths nearest to that of a `problem` that can be followed; `worst` are the samples at which it breaks limits most."""

    def __init__(self, problem: PathProblem, worst: Sequence[int]) -> None:
        self.problem, self.motion, self.signal = problem, problem.motion, problem.signal
        self.confirming, self.inverse = problem.inverse, problem.inverse.without_memories
        self.scale = np.array(self.signal.scale)
        z = self.inverse.displacements(self.motion)
        extreme = np.concatenate([z.argmin(axis=0), z.argmax(axis=0), np.array(worst)]) / len(self.motion)
        # along the path, where it is looked at first
        self.places = np.concatenate([np.linspace(0, 1, LOOKED_AT), extreme])
        self.everywhere, self.margin = False, 0.0

    def nearest(self) -> tuple[Alternative, ...]:
        """Those that exist of a slower, a shifted and a smaller one; where none does, one that is smaller and shifted."""
        alone = [a for a in map(self._searched, (self._slower, self._shifted, self._smaller)) if a]
        both = None if alone else self._searched(self._smaller_and_shifted)
        return (*alone, *([both] if both else []))

    def _searched(self, search: Callable[[], Alternative | None]) -> Alternative | None:
        """What a search finds in a few places and all samples confirm; looking at all of them, and with a margin for memories, where
        they do not."""
        for self.everywhere, self.margin in ((False, 0.0), (True, 0.0), *((False, share) for share in MARGINS)):
            answer = search()
            if answer is None or self.confirming.keeps_limits(answer.motion, periods=CONFIRMING_PERIODS):
                return answer
            if self.everywhere and self.confirming is self.inverse:
                return None
        return None

    def _follows(self, motion: Motion) -> bool:
        n = len(motion)
        chosen = np.unique(np.minimum((self.places * n).round().astype(int), n - 1))
        return self.inverse.keeps_limits(motion, None if self.everywhere else chosen, self.margin)

    def _slower(self) -> Alternative | None:
        slowed = self.problem.slowed
        if slowed is None:
            return None
        factors = 2.0 ** np.arange(1, np.log2(SLOWEST) + 1)
        enough = next((f for f in factors if self._follows(slowed(f))), None)
        if enough is None:
            return None
        factor = np.ceil(100 * _least(lambda f: self._follows(slowed(f)), enough / 2, enough)) / 100
        motion = slowed(float(factor))
        duration = show(len(motion) * in_time(self.problem.clock).sample_time, "s")
        return Alternative(f'{factor:g} times slower (duration = "{duration}")', motion)

    @property
    def _has_extent(self) -> bool:
        return bool(np.ptp(self.motion.position, axis=0).max() > 0)

    def _smaller(self) -> Alternative | None:
        if not self._has_extent or not self._follows(self.motion.scaled(SMALLEST_SCALE)):
            return None
        share = _largest_share(lambda s: self._follows(self.motion.scaled(s)))
        return Alternative(_scaled_to(share), self.motion.scaled(share))

    def _shifted(self) -> Alternative | None:
        shift, _ = self._shift(self.motion)
        return None if shift is None else Alternative(self._shifted_by(shift), self.motion + shift)

    def _smaller_and_shifted(self) -> Alternative | None:
        """The largest path about its own middle that follows once it is shifted the way in which the smallest one does."""
        if not self._has_extent:
            return None
        shift, way = self._shift(self.motion.scaled(SMALLEST_SCALE))
        if shift is None:
            return None
        share = _largest_share(lambda s: self._shift(self.motion.scaled(s), way)[0] is not None)
        shift, _ = self._shift(self.motion.scaled(share), way)
        if shift is None:
            return None
        return Alternative(f"{_scaled_to(share)} and {self._shifted_by(shift)}", self.motion.scaled(share) + shift)

    def _shift(self, motion: Motion, way: np.ndarray | None = None) -> tuple[np.ndarray | None, np.ndarray | None]:
        """The least shift of `motion` (channels,) and its direction: along `way` where that is given, else along one channel; where
        none of them does, along all of them as the least shift into range says."""
        ways = list(np.diag(self.scale)) if way is None else [way]
        shifts = [(s, each) for each in ways if (s := self._along(motion, each)) is not None]
        if not shifts and way is None:
            several = self._least_shift(motion)
            shift = None if several is None else self._along(motion, several)
            return shift, several
        return min(shifts, key=lambda f: float(np.linalg.norm(f[0] / self.scale)), default=(None, way))

    def _shifted_by(self, shift: np.ndarray) -> str:
        rows = zip(self.signal.channels, self.signal.units, shift, self.scale, strict=True)
        parts = [f"{c} = {'+' if v > 0 else ''}{show(v, u)}" for c, u, v, size in rows if abs(v) > 1e-6 * size]
        return f"shifted by {', '.join(parts)}"

    def _along(self, motion: Motion, direction: np.ndarray) -> np.ndarray | None:
        """The least shift along `direction` (channels,) with which `motion` can be followed, rounded to be shown."""
        low, high = self._room(motion)
        slope = self.slope @ direction
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.array([low, high]) / slope
        free = slope == 0
        if np.any(free & ((low > 0) | (high < 0))):
            return None
        first = np.max(np.where(free, -np.inf, ends.min(axis=0)))
        last = np.min(np.where(free, np.inf, ends.max(axis=0)))
        if first > last or not np.isfinite([first, last]).any():
            return None
        nearest = float(np.clip(0.0, first, last))
        tries = [
            nearest,
            *(nearest + share * (end - nearest) for end in (first, last) if np.isfinite(end) for share in SHARES),
        ]
        tries = sorted(dict.fromkeys(tries), key=abs)
        size = next((t for t in tries if t != 0 and self._follows(motion + t * direction)), None)
        if size is None:
            return None
        if size != nearest:
            size = _least(lambda t: self._follows(motion + t * direction), nearest, size)
        for digits in (3, 4, 6):
            shift = self._shown(size * direction, digits)
            if self._follows(motion + shift):
                return shift
        return None

    def _shown(self, shift: np.ndarray, digits: int) -> np.ndarray:
        """`shift` with so many digits in the reader's units, away from zero."""
        rounded = np.zeros(len(shift))
        for i, (value, unit) in enumerate(zip(shift, self.signal.units, strict=True)):
            one = 1 / from_si(1.0, unit)
            if value:
                step = 10.0 ** (np.floor(np.log10(abs(value / one))) - digits + 1)
                rounded[i] = np.sign(value) * np.ceil(abs(value / one) / step * (1 - 1e-9)) * step * one
        return rounded

    def _room(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """By how much each displacement must at least and may at most be moved to be in range at every sample."""
        z = self.inverse.displacements(motion)
        low, high = self.inverse.model.z_bounds
        inside = (INSIDE + self.margin) * ranges((low, high), 0.0)
        return low + inside - z.min(axis=0), high - inside - z.max(axis=0)

    @cached_property
    def slope(self) -> np.ndarray:
        """(n_axes, channels) d displacement / d command at the middle of the path."""
        return self.inverse.slope(self.motion.middle)

    def _least_shift(self, motion: Motion) -> np.ndarray | None:
        """The least shift in typical sizes that brings every displacement into range, to first order; None where there is none."""
        low, high = self._room(motion)
        if np.any(low > high):
            return None
        A, size = self.slope * self.scale, self.inverse.model.z_scale
        quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
        shapes = {"h": ca.Sparsity.dense(*[len(self.scale)] * 2), "a": ca.Sparsity.dense(*A.shape)}
        program = ca.conic("shift", "qrqp", shapes, quiet)
        answer = program(h=np.eye(len(self.scale)), a=A / size[:, None], lba=low / size, uba=high / size)
        return answer["x"].full().ravel() * self.scale if program.stats()["success"] else None


def _scaled_to(share: float) -> str:
    return f"scaled to {100 * share:.3g} % about its middle"


def _largest_share(holds: Callable[[float], bool]) -> float:
    """Near the largest share at which something holds, as it does at the smallest; rounded down to three digits."""
    share = np.exp(-_least(lambda t: holds(np.exp(-t)), 0.0, -np.log(SMALLEST_SCALE)))
    digit = 10.0 ** (np.floor(np.log10(share)) - 2)
    return float(np.floor(share / digit * (1 + 1e-9)) * digit)


def _least(holds: Callable[[float], bool], fails: float, held: float) -> float:
    """Near the number nearest to `fails` at which something holds, as it does at `held`."""
    for _ in range(HALVINGS):
        middle = (fails + held) / 2
        fails, held = (fails, middle) if holds(middle) else (middle, held)
    return held
