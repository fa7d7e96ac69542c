"""The fastest law of time in continuous time, piece by piece of a curve, and how near each limit is along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.devices.limit import Limit
from ctrlgen.model.model import Model
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.drive_law import (
    BalancedLaw,
    BalancedPath,
    InertialLaw,
    Law,
    Side,
    depends_on_speed,
    distances_at,
    drive_law,
    sides_of,
)
from ctrlgen.path_timing.maximum_velocity import landed, largest_speeds, largest_steps, steps_in_time
from ctrlgen.path_timing.time_optimal_nlp import RateBound, SpeedProgramme
from ctrlgen.path_timing.timing_law import TimingLaw
from ctrlgen.trajectory.paths import smooth_step
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES

NODES = 800  # of all pieces together, at which the speed is bounded
FEWEST_NODES = 60  # of a piece
SWING = 4  # samples that a drive with inertia takes at least for its whole range: what the next samples can still show
BEGIN_NODES = 200  # of the law with which IPOPT begins
SLOWER = 1.5  # times the duration, again and again, until a law keeps all limits
TRIES = 60
PACE_SAMPLES = 64  # of the duration with which that begins


@dataclass(frozen=True)
class Piece:
    """The fastest law of a piece: `time` (n,) [s], `share`, `speed` [1/s], and the `distances` (n, sides) of the limits in their units,
    of the rates of drives after each node. `steps` (n,) are the longest of a sample from each of the shares, where these decide;
    else `law` is to be sampled. `bound` (n,) the largest speed at each place alone, where that is known."""

    time: np.ndarray
    share: np.ndarray
    speed: np.ndarray
    distances: np.ndarray
    steps: np.ndarray | None
    law: TimingLaw | None
    bound: np.ndarray | None

    def sampled(self, sample_time: float, more: int) -> np.ndarray:
        """The shares of the samples, both ends among them, `more` than needed."""
        if self.steps is not None:
            return landed(self.share, self.steps, more)
        assert self.law is not None
        n = int(np.ceil(self.law.duration / sample_time * (1 - 1e-9))) + more
        share = self.law.at(np.linspace(0, self.law.duration, n + 1))
        return np.concatenate([self.share[:1], share[1:-1], self.share[-1:]])


@dataclass(frozen=True)
class Optimum:
    """The fastest law of all pieces; `sides` name the columns of their distances."""

    pieces: tuple[Piece, ...]
    sides: tuple[Side, ...]

    @property
    def duration(self) -> float:
        """Duration of all pieces together [s]."""
        return sum(float(p.time[-1]) for p in self.pieces)

    def law(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Time [s], share, speed and the bound of each place [1/s] at the nodes of all pieces; not finite where there is no bound."""
        starts = np.cumsum([0.0, *(p.time[-1] for p in self.pieces[:-1])])
        rows = [
            (p.time + t, p.share, p.speed, np.full(len(p.time), np.nan) if p.bound is None else p.bound)
            for p, t in zip(self.pieces, starts, strict=True)
        ]
        time, share, speed, bound = (np.concatenate(column) for column in zip(*rows, strict=True))
        return time, share, speed, bound

    def samples(self, sample_time: float, more: int = 0) -> np.ndarray:
        """The shares of the samples, `more` of them than needed at least spread over the pieces in proportion."""
        shares = [np.zeros(1)]
        for piece in self.pieces:
            extra = int(np.ceil(piece.time[-1] / self.duration * more))
            shares.append(piece.sampled(sample_time, extra)[1:])
        return np.concatenate(shares)


class Optimiser:
    """Finds the fastest laws of a `model` without memories along curves of its signal `follow`, sampled every `sample_time` [s].

    Raises InputError for a device of which nothing bounds the speed.
    """

    def __init__(self, model: Model, follow: str, sample_time: float) -> None:
        self.model, self.sample_time = model, sample_time
        self.law: Law = drive_law(model, follow, sample_time)
        self.sides = sides_of(model.limits, model)
        self.distances = distances_at(self.law, self.sides)
        by_speed = [s for s, dependent in zip(self.sides, depends_on_speed(self.distances), strict=True) if dependent]
        self.speed_distances = distances_at(self.law, by_speed)

    @property
    def by_place(self) -> bool:
        """Whether each place alone bounds the speed."""
        return isinstance(self.law, BalancedLaw) and not self.model.rate_limits

    def along(self, curve: Curve, progress: Callable[[str], None] = lambda _: None, sampled: bool = True) -> Optimum:
        """The fastest law along `curve`. Raises SolverError where none is found. Where not `sampled`, the samples' places are left out."""
        if not self.by_place:
            return self._programmed(curve, progress)
        pieces = tuple(self._bounded(curve, ends, sampled) for ends in curve.pieces)
        return Optimum(pieces, tuple(self.sides))

    def _path(self, curve: Curve, ends: tuple[float, float]) -> BalancedPath | None:
        """The equilibria along a piece; None with inertia."""
        if not isinstance(self.law, BalancedLaw):
            return None
        share = np.linspace(*ends, max(NODES // len(curve.pieces), FEWEST_NODES) + 1)
        return self.law.along(curve.derivatives(share, 0, ends)[0], share, curve.closed)

    def _bounded(self, curve: Curve, ends: tuple[float, float], sampled: bool) -> Piece:
        """A piece of the fastest law by the largest speed at each place."""
        path = self._path(curve, ends)
        assert path is not None and path.law.inverse.moving is not None
        share = path.share
        speeds = largest_speeds(
            self.distances, self.speed_distances, path, share, 1 / (PACE_SAMPLES * self.sample_time)
        )
        if not speeds.all():
            at = 100 * share[int(np.argmin(speeds))]
            raise SolverError(
                f"at {at:.3g} % of the path no speed keeps the limits; make the path smaller, or shift it"
            )
        slowness = 1 / speeds
        time = np.concatenate([[0.0], np.cumsum(np.diff(share) * (slowness[1:] + slowness[:-1]) / 2)])
        speed = np.where(np.isfinite(speeds), speeds, np.max(speeds[np.isfinite(speeds)], initial=0.0))
        distances = self.distances.map(len(share))(path.places(share).T, speed[None])[0].full().T
        steps = None
        if sampled and time[-1] > MOST_SAMPLES * self.sample_time:
            raise SolverError(
                f"the path takes more than {MOST_SAMPLES} set-points at this sample rate; give a lower one"
            )
        if sampled:
            steps = np.minimum(
                largest_steps(path, share, speeds, self.sample_time, path.law.inverse.moving.drive),
                steps_in_time(share, time, speed, self.sample_time, curve.closed),
            )
        return Piece(time, share, speeds, distances, steps, None, speeds)

    def _programmed(self, curve: Curve, progress: Callable[[str], None]) -> Optimum:
        """The fastest law by IPOPT, piece by piece; an open piece from rest to rest."""
        rates, rate_sides = _rates(self.law, self.sample_time)
        pieces = []
        for ends in curve.pieces:
            path = self._path(curve, ends)
            places = partial(self._places, curve, ends) if path is None else path.places
            programme = SpeedProgramme(self.law, places, ends, curve.closed, self.distances, rates)
            law = programme.fastest(_begin(programme, PACE_SAMPLES * self.sample_time), progress)
            distances, u = (
                v.full().T for v in self.distances.map(len(law.share))(places(law.share).T, law.derivatives.T)
            )
            changes = np.diff(u, axis=0) / np.diff(law.time)[:, None]
            changes = np.vstack([changes, changes[:1] if curve.closed else changes[-1:]])
            near = [(-1 if s.upper else 1) * (changes[:, i] - s.bound) / s.unit for i, s in rate_sides]
            bound = None
            if path is not None and self.model.n_states:
                bound = largest_speeds(self.distances, self.speed_distances, path, law.share, 1 / law.duration)
            table = np.column_stack([distances, *near])
            pieces.append(Piece(law.time, law.share, law.derivatives[:, 0], table, None, law, bound))
        return Optimum(tuple(pieces), (*self.sides, *(s for _, s in rate_sides)))

    def _places(self, curve: Curve, ends: tuple[float, float], share: np.ndarray) -> np.ndarray:
        """The target with its derivatives by the share, (n, place_size)."""
        return np.hstack(list(curve.derivatives(share, self.law.order, ends)))


def _rates(law: Law, sample_time: float) -> tuple[RateBound, list[tuple[int, Side]]]:
    """The bounds of the drives' rates, and with inertia what samples can follow; each with the drive's place."""
    model = law.model
    low, high = (bound.copy() for bound in model.rate_bounds)
    sides = []
    signal = model.signals["drive"]
    for i, limit in zip(model.rate_places, model.rate_limits, strict=True):
        for upper, bound in ((False, limit.lower), (True, limit.upper)):
            if bound is not None:
                sides.append((i, Side(limit, 0, upper, bound, limit.span)))
    if isinstance(law, InertialLaw):
        span = np.ptp(np.array(model.u_bounds), axis=0)
        for i in map(int, np.flatnonzero(np.isfinite(span))):
            fastest = span[i] / (SWING * sample_time)
            label = f"change of drive {signal.channels[i]} by its range in {SWING} samples"
            sampled_limit = Limit(
                "sampled_drive", label, (signal.channels[i],), f"{signal.units[i]}/s", model.u[i], -fastest, fastest
            )
            if fastest < high[i]:
                high[i] = fastest
                sides.append((i, Side(sampled_limit, 0, True, fastest, 2 * fastest)))
            if -fastest > low[i]:
                low[i] = -fastest
                sides.append((i, Side(sampled_limit, 0, False, -fastest, 2 * fastest)))
    return RateBound(low, high), sides


def _begin(programme: SpeedProgramme, duration: float) -> TimingLaw:
    """A law that keeps all limits: even speed, or from rest to rest by a polynomial, as slowly as that takes. Raises SolverError."""
    order, closed, ends = programme.law.order, programme.closed, programme.ends
    t = np.linspace(0, 1, BEGIN_NODES)
    if closed:
        tables = np.stack([t, np.ones_like(t), *[np.zeros_like(t)] * (order - 1)])
    else:
        step = np.polynomial.Polynomial.fit(t, smooth_step(t, order + 1), 2 * order + 3, domain=[0, 1], window=[0, 1])
        tables = np.stack([smooth_step(t, order + 1), *(step.deriv(k)(t) for k in range(1, order + 1))])
        tables[1:, [0, -1]] = 0.0
    size = ends[1] - ends[0]
    for _ in range(TRIES):
        law = TimingLaw(
            t * duration,
            ends[0] + size * tables[0],
            (size * tables[1:] / duration ** np.arange(1.0, order + 1)[:, None]).T,
        )
        distances, u = (
            v.full() for v in programme.distances.map(BEGIN_NODES)(programme.places(law.share).T, law.derivatives.T)
        )
        change = np.diff(u, axis=1) / (duration / (BEGIN_NODES - 1))
        good = np.all(distances >= -1e-9) and np.all(change <= programme.rates.high[:, None])
        if good and np.all(change >= programme.rates.low[:, None]):
            return law
        duration *= SLOWER
    raise SolverError("the path cannot be followed however slowly; make it smaller, or shift it")
