"""Propagation of distributions by Monte Carlo (GUM supplement 1, JCGM 101) along a path, on the nonlinear model.

Each draw is a device with other numbers, surroundings and gains, and drives with an error of their own at every sample. The draws of a
block take each sample together; blocks have seeds of their own, so that the answer is the same in any number of processes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ctrlgen.budget.linear import Propagated, drive_deviations, player_deviation
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.core.forks import in_forks, usable_cores
from ctrlgen.numerics.columnwise import MOST, ColumnWise

BLOCK = MOST  # draws
STEP_ERROR = 1e-3  # of the combined uncertainty: what a step of a draw may leave


class BlockLimits(Protocol):
    """What is asked of the limits of a block of draws."""

    def broken(self, sample: int, values: np.ndarray) -> np.ndarray:
        """(draws,) which draws, with the limited quantities (draws, channels), break a bound that some may break there."""


class Limited(Protocol):
    """What is asked of the limits along the path."""

    def near(self, sample: int) -> np.ndarray:
        """(2, channels) which bounds some draws may break at a sample."""

    def of(self, columns: np.ndarray) -> BlockLimits:
        """Those of draws with the deviations (draws, m)."""


@dataclass(frozen=True)
class Drawn:
    """What the draws gave, SI: deviations of the followed signal `pose` (draws, kept, n_y) at the samples `kept`; limited quantities
    `limits` (draws, 2, channels), each at its own sample for the lower and the upper bound; `columns` (draws, m) the deviations that
    were drawn; `lost`, how many more have a pose or a limited quantity that is not finite; `broken` (draws,), which of them break a limit
    anywhere on the path.

    `alone` (2, m, kept, n_y): the pose's deviations with each column alone at plus and minus its standard deviation, nothing scattering.
    """

    kept: np.ndarray
    pose: np.ndarray
    limits: np.ndarray
    columns: np.ndarray
    alone: np.ndarray
    lost: int
    broken: np.ndarray


def draw(
    path: UncertainPath,
    linear: Propagated,
    limited: Limited,
    kept: np.ndarray,
    critical: np.ndarray,
    draws: int,
    seed: int,
) -> Drawn:
    """`draws` devices led along the path, compared with its nominal pose in `linear` at the samples `kept`.

    `critical` (2, channels): the sample at which each limited quantity is kept, for its lower and its upper bound; `limited` says
    where the draws may break a limit.
    """
    stated = path.uncertainties
    m = len(stated.sds)
    first, *seeds = np.random.SeedSequence(seed).spawn(2 + (draws - 1) // BLOCK)
    deviations = np.random.default_rng(first).standard_normal((draws, m)) @ _square_root(stated.covariance)
    one_by_one = np.diag(stated.sds)
    alone = np.vstack([one_by_one, -one_by_one, np.zeros((1, m))])  # the last one: the described device
    blocks = [
        (deviations[k : k + BLOCK], block_seed) for k, block_seed in zip(range(0, draws, BLOCK), seeds, strict=True)
    ]
    led, last = _Led(path, linear, limited, kept, critical), blocks[-1]
    blocks[-1] = np.vstack([last[0], alone]), last[1]

    def one(k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return led.all(*blocks[k], still=len(alone) if k == len(blocks) - 1 else 0)

    results = in_forks(one, range(len(blocks)), usable_cores())
    pose, limits, broken = (np.concatenate(part) for part in zip(*results, strict=True))
    still, pose, limits, broken = pose[draws:], pose[:draws], limits[:draws], broken[:draws]
    good = np.isfinite(pose).all(axis=(1, 2)) & np.isfinite(limits).all(axis=(1, 2))
    alone, lost = (still[:-1] - still[-1]).reshape(2, m, *still.shape[1:]), int((~good).sum())
    return Drawn(kept, pose[good], limits[good], deviations[good], alone, lost, broken[good])


class _Led:
    """Devices that are led along the path, as many at a time as are given."""

    def __init__(
        self, path: UncertainPath, linear: Propagated, limited: Limited, kept: np.ndarray, critical: np.ndarray
    ) -> None:
        self.path, self.linear, self.limited, self.critical = path, linear, limited, critical
        self.place = {int(k): i for i, k in enumerate(kept)}
        self.step = _Step(path, linear)
        self.pose, self.limits = _Part(path, "pose"), _Part(path, "limits")

    def all(
        self, columns: np.ndarray, seed: np.random.SeedSequence, still: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For deviations (n, m): those of the pose (n, kept, n_y), the limited quantities (n, 2, channels), which devices break a limit
        (n,). Nothing scatters in the last `still` ones."""
        path, pose, n = self.path, self.linear.nominal["pose"], len(columns)
        q, gain = _numbers(path, columns)
        scatter = _Scatter(path, seed, n - still, still)
        step, of_pose, of_limits = self.step.of(q), self.pose.of(q), self.limits.of(q)
        bounds = self.limited.of(columns)
        S = np.tile(path.start[:, None], n)
        deviations = np.empty((n, len(self.place), pose.shape[1]))
        limits, broken = np.empty((n, *self.critical.shape)), np.zeros(n, bool)
        for k, v in enumerate(path.drive):
            drive = (v * gain + scatter.at(k)).T
            sample = k - path.before
            here = self.critical == sample
            limiting = sample >= 0 and bool(np.any(here) or self.limited.near(sample).any())
            S = step(k, S, drive, limiting or sample in self.place)
            if sample in self.place:
                of_sensor = columns @ self.linear.of_sensor(path, sample)
                deviations[:, self.place[sample]] = of_pose(S, drive).T - pose[sample] + scatter.replayed() + of_sensor
            if limiting:
                values = of_limits(S, drive).T
                limits[:, here] = np.stack([values] * 2, axis=1)[:, here]
                broken |= bounds.broken(sample, values)
        return deviations, limits, broken


def _square_root(covariance: np.ndarray) -> np.ndarray:
    """(m, m) the symmetric one, which is the same with every library, as the signs of eigenvectors are not."""
    scale = np.sqrt(np.diag(covariance))  # stiffnesses and angles differ by many powers of ten
    sizes, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray((vectors * np.sqrt(np.maximum(sizes, 0.0))) @ vectors.T * scale)


def _numbers(path: UncertainPath, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """q (draws, n_q) and the gain of each drive (draws, n_u) for deviations (draws, m)."""
    q = np.tile(path.q_nominal, (len(columns), 1))
    gain, k = np.ones((len(columns), path.drive.shape[1])), 0
    for line in path.uncertainties.lines:
        deviations = columns[:, k : k + len(line.sds)]
        k += len(line.sds)
        if line.kind == "surroundings":
            q[:, -1] += deviations[:, 0]
        elif line.kind in ("gain", "channel_gain"):
            gain += deviations
        elif line.kind == "number":
            for i, name in enumerate(line.paths):
                if name in path.free:
                    q[:, path.free.index(name)] += deviations[:, i]
    return q, gain


class _Scatter:
    """Errors of the drives that are drawn anew at every sample; none for the last `still` rows."""

    def __init__(self, path: UncertainPath, seed: np.random.SeedSequence, draws: int, still: int) -> None:
        stated = path.uncertainties
        names = {"converter": stated.bits is not None, "arithmetic": stated.single, "jitter": stated.jitter > 0}
        given = [drive_deviations(path, name) for name, given in names.items() if given]
        zero = np.zeros(path.drive.shape)
        self.rounding = np.sqrt(3 * sum((sd**2 for sd, together in given if not together), zero))
        self.late = sum((sd for sd, together in given if together), zero)
        self.tolerance = np.sqrt(3) * player_deviation(path) if stated.player else None
        self.rng, self.shape, self.still = np.random.default_rng(seed), (draws, path.drive.shape[1]), still

    def at(self, k: int) -> np.ndarray:
        """(draws + still, n_u) errors of the drive number `k`: rounding is uniform, of converter and arithmetic together, jitter normal."""
        error = np.zeros((self.shape[0] + self.still, self.shape[1]))
        if self.rounding[k].any():
            error[: self.shape[0]] += (2 * self.rng.random(self.shape, dtype=np.float32) - 1) * self.rounding[k]
        if self.late[k].any():
            error[: self.shape[0]] += self.rng.standard_normal((self.shape[0], 1)) * self.late[k]
        return error

    def replayed(self) -> np.ndarray | float:
        """(draws + still, n_y) errors of the followed signal that the player's tables leave: uniform within their tolerance."""
        if self.tolerance is None:
            return 0.0
        error = np.zeros((self.shape[0] + self.still, len(self.tolerance)))
        error[: self.shape[0]] = (2 * self.rng.random((self.shape[0], len(self.tolerance))) - 1) * self.tolerance
        return error


# (n, devices) from states (n_s, devices) and drives (n_u, devices)
Evaluated = Callable[[np.ndarray, np.ndarray], np.ndarray]


class _Part:
    """A part of the path for many devices at once."""

    def __init__(self, path: UncertainPath, name: str) -> None:
        constants = path.constants[name]
        self.constants = ColumnWise(ca.Function("constants", [path.q], [ca.densify(constants(path.q))]))
        self.part = ColumnWise(path.of_sample[name])

    def of(self, q: np.ndarray) -> Evaluated:
        """For devices with the numbers q (devices, n_q)."""
        constants = self.constants(q.T)
        return lambda S, drive: self.part(S, drive, constants)


class _Step:
    """All devices from sample to sample; where states go on without the displacement, it is found at the samples alone at which it is
    wanted, from that of the described device."""

    def __init__(self, path: UncertainPath, linear: Propagated) -> None:
        self.states, self.apart, self.n_x = linear.states, path.apart(), path.model.x.numel()
        if self.apart:
            self.step, self.balanced = _Part(path, "states"), _Part(path, "balanced")
        else:
            allowed = STEP_ERROR * linear.combined("pose", path.uncertainties).max(axis=0)
            self.step = _Part(path, path.quickest_step(linear.states, allowed))

    def of(self, q: np.ndarray) -> Callable[[int, np.ndarray, np.ndarray, bool], np.ndarray]:
        """(n_s, devices) S at sample k, from the one before; where it is not `wanted`, the displacement may be an old one."""
        step, balanced = self.step.of(q), self.balanced.of(q) if self.apart else None

        def stepped(k: int, S: np.ndarray, drive: np.ndarray, wanted: bool) -> np.ndarray:
            if balanced is None:
                return step(S, drive)
            S[: self.n_x] = step(S, drive)
            if wanted:
                S[self.n_x :] = self.states[k, self.n_x :, None]
                S[self.n_x :] = balanced(S, drive)
            return S

        return stepped
