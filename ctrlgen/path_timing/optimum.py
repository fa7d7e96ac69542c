"""The fastest law of time in continuous time, piece by piece of a curve, and how near each limit is along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import factorial

import numpy as np

from ctrlgen.core.errors import SolverError
from ctrlgen.devices.base import Limit
from ctrlgen.model.model import Model
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.drive_law import BalancedLaw, BalancedPath, InertialLaw, Side, distances_at, sides_of
from ctrlgen.path_timing.programme import RateBound, SpeedProgramme
from ctrlgen.path_timing.speed_bound import landed, largest_speeds, largest_steps
from ctrlgen.path_timing.timing_law import TimingLaw
from ctrlgen.trajectory.path_inverse import PathInverse
from ctrlgen.trajectory.paths import smooth_step

NODES = 1200  # of all pieces together, at which the speed is bounded
FEWEST_NODES = 60  # of a piece
SWING = 6  # samples that a drive with inertia takes at least for its whole range: what the next samples can still show
BEGIN_NODES = 200  # of the law with which IPOPT begins
SLOWER = 1.5  # times the duration, again and again, until a law keeps all limits
TRIES = 60
PACE_SAMPLES = 64  # of the duration with which that begins


@dataclass(frozen=True)
class Piece:
    """The fastest law of a piece: `time` (n,) [s], `share`, `speed` [1/s], the `distances` (n, sides) of the limits in their units, and
    of the rates of drives after each node. `places` (N + 1,) are those of the samples, where a sample's longest step decides them;
    else `law` is to be sampled. `bound` (n,) the largest speed at each place alone, where that is known."""

    time: np.ndarray
    share: np.ndarray
    speed: np.ndarray
    distances: np.ndarray
    places: np.ndarray | None
    law: TimingLaw | None
    bound: np.ndarray | None


@dataclass(frozen=True)
class Optimum:
    """The fastest law of all pieces; `sides` name the columns of their distances."""

    pieces: tuple[Piece, ...]
    sides: tuple[Side, ...]

    @property
    def duration(self) -> float:
        """[s]"""
        return sum(float(p.time[-1]) for p in self.pieces)

    def samples(self, sample_time: float, more: int = 0) -> np.ndarray:
        """The shares of the samples, `more` of them than needed at least spread over the pieces in proportion."""
        found = [np.zeros(1)]
        for piece in self.pieces:
            if piece.places is not None and not more:
                found.append(piece.places[1:])
                continue
            own = piece.time[-1] / self.duration * more
            if piece.places is not None:
                n = len(piece.places) - 1
                at = np.linspace(0, n, n + int(np.ceil(own)) + 1)
                found.append(np.interp(at, np.arange(n + 1), piece.places)[1:])
                continue
            assert piece.law is not None
            n = int(np.ceil(piece.law.duration / sample_time * (1 - 1e-9)) + np.ceil(own))
            share = piece.law.at(np.linspace(0, piece.law.duration, n + 1))
            found.append(np.append(share[1:-1], piece.share[-1]))
        return np.concatenate(found)


def optimum_of(
    model: Model, curve: Curve, sample_time: float, progress: Callable[[str], None] = lambda _: None, sampled: bool = True
) -> Optimum:
    """The fastest law along `curve`; without memories of effects. Raises SolverError where none is found, and InputError for a device
    of which nothing bounds the speed. Where not `sampled`, the samples' places are left out."""
    follow = curve.scenario.file.follow
    if model.inertial:
        return _programmed(model, InertialLaw(model, follow), curve, sample_time, progress)
    inverse = PathInverse(model, follow, sample_time)
    law = BalancedLaw(model, follow, inverse)
    if model.rate_limits:
        return _programmed(model, law, curve, sample_time, progress)
    sides = sides_of(model.limits, model)
    assert inverse.moving is not None
    pieces = []
    for a, b in curve.pieces:
        share = _nodes(a, b, len(curve.pieces))
        path = law.along(curve.derivatives(share, 0, (a, b))[0], share, curve.closed)
        typical = 1 / (PACE_SAMPLES * sample_time)
        speeds = largest_speeds(law, path, share, sides, typical)
        if not speeds.all():
            raise SolverError(
                f"at {100 * share[int(np.argmin(speeds))]:.3g} % of the path no speed keeps the limits; make the path smaller, or shift it"
            )
        time = np.concatenate([[0.0], np.cumsum(_times(share, speeds))])
        speed = np.where(np.isfinite(speeds), speeds, np.max(speeds[np.isfinite(speeds)], initial=0.0))
        distances = distances_at(law, sides).map(len(share))(path.places(share).T, speed[None])[0].full().T
        places = None
        if sampled:
            steps = largest_steps(path, share, speeds, sample_time, inverse.moving.drive)
            places = landed(lambda at, s=share, d=steps: float(np.interp(at, s, d)), (a, b))
        pieces.append(Piece(time, share, speeds, distances, places, None, speeds))
    return Optimum(tuple(pieces), tuple(sides))


def _nodes(a: float, b: float, pieces: int) -> np.ndarray:
    return np.linspace(a, b, max(NODES // pieces, FEWEST_NODES) + 1)


def _times(share: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """(n - 1,) the time between places by the trapezoidal rule of the slowness."""
    slowness = 1 / speeds
    return np.diff(share) * (slowness[1:] + slowness[:-1]) / 2


def _programmed(
    model: Model, law: BalancedLaw | InertialLaw, curve: Curve, sample_time: float, progress: Callable[[str], None]
) -> Optimum:
    """By IPOPT, piece by piece; an open piece from rest to rest."""
    sides = sides_of(model.limits, model)
    rates, rate_sides = _rates(model, sample_time)
    pieces = []
    for a, b in curve.pieces:
        path: BalancedPath | None = None
        if isinstance(law, BalancedLaw):
            share = _nodes(a, b, len(curve.pieces))
            path = law.along(curve.derivatives(share, 0, (a, b))[0], share, curve.closed)

        def places(at: np.ndarray, ends: tuple[float, float] = (a, b), path: BalancedPath | None = path) -> np.ndarray:
            if path is not None:
                return path.places(at)
            tables = curve.derivatives(at, law.order, ends)
            return np.hstack(list(tables))

        programme = SpeedProgramme(law, places, (a, b), curve.closed, sides, rates)
        begin = _begin(programme, curve.closed, (a, b), PACE_SAMPLES * sample_time)
        found = programme.fastest(begin, progress)
        distances, u = (v.full().T for v in programme.distances.map(len(found.share))(places(found.share).T, found.derivatives.T))
        changes = np.diff(u, axis=0) / np.diff(found.time)[:, None]
        changes = np.vstack([changes, changes[:1] if curve.closed else changes[-1:]])
        near = [
            ((s.bound - changes[:, i]) if s.upper else (changes[:, i] - s.bound)) / s.unit for i, s in rate_sides
        ]  # fmt: skip
        bound = None
        if path is not None and model.n_states:
            bound = largest_speeds(law, path, found.share, sides, 1 / found.duration)  # type: ignore[arg-type]
        distances = np.column_stack([distances, *near])
        pieces.append(Piece(found.time, found.share, found.derivatives[:, 0], distances, None, found, bound))
    return Optimum(tuple(pieces), (*sides, *(s for _, s in rate_sides)))


def _rates(model: Model, sample_time: float) -> tuple[RateBound, list[tuple[int, Side]]]:
    """The bounds of the drives' rates, and with inertia what samples can follow; each with the drive's place."""
    low, high = (bound.copy() for bound in model.rate_bounds)
    sides = []
    signal = model.signals["drive"]
    for i, limit in zip(model.rate_places, model.rate_limits, strict=True):
        for upper, bound in ((False, limit.lower), (True, limit.upper)):
            if bound is not None:
                sides.append((i, Side(limit, 0, upper, bound, (limit.upper or 0.0) - (limit.lower or 0.0))))
    if model.inertial:
        span = np.ptp(np.array(model.u_bounds), axis=0)
        for i in np.flatnonzero(np.isfinite(span)):
            fastest = span[i] / (SWING * sample_time)
            label = f"change of drive {signal.channels[i]} by its range in {SWING} samples"
            own = Limit("sampled_drive", label, (signal.channels[i],), f"{signal.units[i]}/s", model.u[int(i)], -fastest, fastest)
            if fastest < high[i]:
                high[i] = fastest
                sides.append((int(i), Side(own, 0, True, fastest, 2 * fastest)))
            if -fastest > low[i]:
                low[i] = -fastest
                sides.append((int(i), Side(own, 0, False, -fastest, 2 * fastest)))
    return RateBound(low, high), sides


def _begin(programme: SpeedProgramme, closed: bool, ends: tuple[float, float], duration: float) -> TimingLaw:
    """A law that keeps all limits: even speed, or from rest to rest by a polynomial, as slowly as that takes. Raises SolverError."""
    order = programme.law.order
    t = np.linspace(0, 1, BEGIN_NODES)
    if closed:
        tables = np.stack([t, np.ones_like(t), *[np.zeros_like(t)] * (order - 1)])
    else:
        step = np.polynomial.Polynomial.fit(t, smooth_step(t, order + 1), 2 * order + 3, domain=[0, 1], window=[0, 1])
        tables = np.stack([smooth_step(t, order + 1), *(step.deriv(k)(t) for k in range(1, order + 1))])
        tables[1:, [0, -1]] = 0.0
    size = ends[1] - ends[0]
    for _ in range(TRIES):
        law = TimingLaw(t * duration, ends[0] + size * tables[0], (size * tables[1:] / duration ** np.arange(1.0, order + 1)[:, None]).T)
        distances, u = (
            v.full() for v in programme.distances.map(BEGIN_NODES)(programme.places(law.share).T, law.derivatives.T)
        )
        change = np.diff(u, axis=1) / (duration / (BEGIN_NODES - 1))
        good = np.all(distances >= -1e-9) and np.all(change <= programme.rates.high[:, None])
        if good and np.all(change >= programme.rates.low[:, None]):
            return law
        duration *= SLOWER
    raise SolverError("the path cannot be followed however slowly; make it smaller, or shift it")
