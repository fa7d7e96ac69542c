"""Propagation of distributions by Monte Carlo (GUM supplement 1, JCGM 101) along a path, on the nonlinear model.

Each draw is a device with other numbers, surroundings and gains, and drives with an error of their own at every sample; all draws
take each sample together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from ctrlgen.budget.linear import Propagated, drive_deviations, player_deviation
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.numerics.columnwise import ColumnWise

STEP_ERROR = 1e-3  # of the combined uncertainty: what a step of a draw may leave


class Limited(Protocol):
    """What is asked of the limits along the path."""

    def near(self, sample: int) -> np.ndarray:
        """(2, channels) which bounds some draws may break at a sample."""

    def broken(self, sample: int, values: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """(draws,) which draws, with the limited quantities (draws, channels) and deviations (draws, m), break one of those."""


@dataclass(frozen=True)
class Drawn:
    """What the draws gave, SI: deviations of the followed signal `pose` (draws, kept, n_y) at the samples `kept`; limited quantities
    `limits` (draws, 2, channels), each at its own sample for the lower and the upper bound; `columns` (draws, m) the deviations that
    were drawn; `lost`, how many further draws ended in no number; `broken` (draws,), which of them break a limit anywhere on the path.

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
    rng, stated, pose = np.random.default_rng(seed), path.uncertainties, linear.nominal["pose"]
    m = len(stated.sds)
    deviations = rng.standard_normal((draws, m)) @ _square_root(stated.covariance)
    one_by_one = np.diag(stated.sds)
    columns = np.vstack([deviations, one_by_one, -one_by_one, np.zeros((1, m))])  # the last one: the described device
    q, gain = _numbers(path, columns)
    scatter = _Scatter(path, rng, draws, 2 * m + 1)
    step = _Steps(path, linear, q)
    outputs = {"pose": _OfDraws(path, "pose", q), "limits": _OfDraws(path, "limits", q)}
    S = np.tile(path.start[:, None], len(q))
    found = np.empty((len(q), len(kept), pose.shape[1]))
    limits = np.empty((len(q), *critical.shape))
    broken = np.zeros(draws, bool)
    place = {int(k): i for i, k in enumerate(kept)}
    for k, v in enumerate(path.drive):
        drive = (v * gain + scatter.at(k)).T
        sample = k - path.before
        here = critical == sample
        limiting = sample >= 0 and bool(np.any(here) or limited.near(sample).any())
        S = step(k, S, drive, limiting or sample in place)
        if sample in place:
            found[:, place[sample]] = outputs["pose"](S, drive).T - pose[sample] + scatter.replayed()
        if limiting:
            values = outputs["limits"](S, drive).T
            limits[:, here] = np.stack([values] * 2, axis=1)[:, here]
            broken |= limited.broken(sample, values[:draws], deviations)
    good = np.isfinite(found[:draws]).all(axis=(1, 2)) & np.isfinite(limits[:draws]).all(axis=(1, 2))
    return Drawn(
        kept, found[:draws][good], limits[:draws][good], deviations[good],
        (found[draws:-1] - found[-1]).reshape(2, m, *found.shape[1:]), int((~good).sum()), broken[good],
    )  # fmt: skip


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
        own = columns[:, k : k + len(line.sds)]
        k += len(line.sds)
        if line.kind == "surroundings":
            q[:, -1] += own[:, 0]
        elif line.kind != "number":
            gain += own
        else:
            for i, name in enumerate(line.paths):
                if name in path.free:
                    q[:, path.free.index(name)] += own[:, i]
    return q, gain


class _Scatter:
    """Errors of the drives that are drawn anew at every sample; none for the last `still` rows."""

    def __init__(self, path: UncertainPath, rng: np.random.Generator, draws: int, still: int) -> None:
        stated = path.uncertainties
        names = {"converter": stated.bits is not None, "arithmetic": stated.single, "jitter": stated.jitter > 0}
        given = [drive_deviations(path, name) for name, given in names.items() if given]
        zero = np.zeros(path.drive.shape)
        self.rounding = np.sqrt(3 * sum((sd**2 for sd, together in given if not together), zero))
        self.late = sum((sd for sd, together in given if together), zero)
        self.tolerance = np.sqrt(3) * player_deviation(path) if stated.player else None
        self.rng, self.shape, self.still = rng, (draws, path.drive.shape[1]), still

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


class _OfDraws:
    """A part of the path for all draws at once."""

    def __init__(self, path: UncertainPath, name: str, q: np.ndarray) -> None:
        constants = path.constants[name]
        self.constants = ColumnWise(ca.Function("constants", [path.q], [ca.densify(constants(path.q))]))(q.T)
        self.part = ColumnWise(path.of_sample[name])

    def __call__(self, S: np.ndarray, drive: np.ndarray) -> np.ndarray:
        """(n, draws) from states (n_s, draws) and drives (n_u, draws)."""
        return self.part(S, drive, self.constants)


class _Steps:
    """All draws from sample to sample; where states go on without the displacement, it is found at the samples alone at which it is
    wanted, from that of the described device."""

    def __init__(self, path: UncertainPath, linear: Propagated, q: np.ndarray) -> None:
        self.states, self.apart, self.n_x = linear.states, path.apart(), path.model.x.numel()
        if self.apart:
            self.step, self.balanced = _OfDraws(path, "states", q), _OfDraws(path, "balanced", q)
        else:
            allowed = STEP_ERROR * linear.combined("pose", path.uncertainties).max(axis=0)
            self.step = _OfDraws(path, path.quickest_step(linear.states, allowed), q)

    def __call__(self, k: int, S: np.ndarray, drive: np.ndarray, wanted: bool) -> np.ndarray:
        """(n_s, draws) S at sample k, from the one before; where it is not `wanted`, the displacement may be an old one."""
        if not self.apart:
            return self.step(S, drive)
        S[: self.n_x] = self.step(S, drive)
        if wanted:
            S[self.n_x :] = self.states[k, self.n_x :, None]
            S[self.n_x :] = self.balanced(S, drive)
        return S
