"""Paths whose limits hold for what is not known exactly: chance constraints with a back-off of each limit.

A limit with the margin M = b - y at a sample holds for a device of which the numbers, surroundings and drives differ where M is
larger than what they take of it. To first order that is normal: u_l is its sd by what lasts along the path, u_s by what is new at
every sample. With the share e of the risk 1 - p for what scatters, all N limited quantities hold at all n samples with probability p if

    sum_i Phi(-beta_i) <= (1 - e)(1 - p),   beta_i = min_k (M_ik - z_s u_s,ik)/u_l,ik,   1 - Phi(z_s) = e (1 - p)/(N n),

Boole's inequality over quantities, and of what scatters over samples. What lasts breaks a limit at its worst sample or not at all.
The back-off of a limit is z u_l + z_s u_s, z the quantile of (1 - e)(1 - p), or where the sum is larger the one to which the betas below
it must be raised. Sources: A. Nemirovski, A. Shapiro, SIAM J. Optim. 17 (2006) 969 (safe approximation of chance constraints); M. Ono,
B. C. Williams, Proc. 47th IEEE CDC (2008) 3427 (risk allocation).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
import scipy

from ctrlgen.budget.limits import Margins, Slopes, margins, slopes_of_limits
from ctrlgen.budget.linear import Propagated, propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.core.errors import Fault, Infeasibility, InputError, SolverError, Unreachable
from ctrlgen.core.units import difference, show, show_difference
from ctrlgen.model.allocation import drive_ranges
from ctrlgen.model.assembly import build_model, movable
from ctrlgen.model.model import Model
from ctrlgen.trajectory import solution as described
from ctrlgen.trajectory.infeasibility import instead
from ctrlgen.trajectory.inverse.balanced import PathInverse
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.redundant import LeastEffortInverse, motion_inverse, path_inverse
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.scenario_file import Robust
from ctrlgen.trajectory.solution import Solution, judged_by, unlimited

SCATTER_RISK = 0.1  # of the risk, for what scatters: little of it is gained by more, as z grows with its logarithm
CUSHION = 0.01  # standard uncertainties that a moved path keeps more: its place is rounded
STEP = 1e-3  # typical sizes by which a path is moved for a difference
FARTHEST = 100.0  # typical sizes by which a path is moved where no displacement has limits
MOST_STEPS = 20  # of the search
ROUNDS = 4  # of it, each with a back-off for more limits at a time
DIGITS = 4  # of the place of a moved path
LEAST_WEIGHT = 1e-6  # of the largest: of a drive of which everything is known
SHOWN = 6  # limits that an explanation lists


def solve(scenario: Scenario, model: Model, progress: Callable[[str], None] = lambda _: None) -> Solution:
    """The drives that follow `scenario`, with limits that hold at the probability that it asks for, where it does.

    The model of a robust solution has limits tightened by what was reserved (`Limit.reserve`), and its scenario the place to which the
    path was moved (`Scenario.home`). Where more drives than axes push, those of the smallest expected error are taken. Raises as
    `ctrlgen.trajectory.solution.solve`; Unreachable where the path can be followed, but not at that probability.
    """
    if scenario.file.robust is None or model.probability is not None:
        return described.solve(scenario, model, progress)
    return _RobustPath(scenario, model, scenario.file.robust, progress).solved()


@dataclass(frozen=True)
class _Judged:
    """A path with what is uncertain: its margins, and its expected `error`, the root mean square along it of the combined standard
    uncertainty of the followed signal in typical sizes."""

    path: UncertainPath
    linear: Propagated
    slopes: Slopes
    found: Margins
    error: float


class _RobustPath:
    """One scenario at the probability that it asks for."""

    def __init__(self, scenario: Scenario, model: Model, robust: Robust, progress: Callable[[str], None]) -> None:
        self.asked, self.robust, self.progress = scenario, robust, progress
        self.scenario = replace(scenario, file=scenario.file.model_copy(update={"robust": None}))
        signal = model.signals[scenario.file.follow]
        if unknown := [channel for channel in robust.home if channel not in signal.channels]:
            what = f"{unknown[0]!r} is no channel of the {signal.name}; those are {', '.join(signal.channels)}"
            raise InputError(scenario.path, [Fault("robust.home", what)])
        self.stated = load_uncertainties(scenario, model)
        self.signal = signal
        self.model = _of_least_error(model, self.stated, scenario) if model.redundant else model

    def solved(self) -> Solution:
        """The solution. Raises Unreachable where it keeps the limits of the device as described alone."""
        home = self._home() if self.robust.home else dict(self.scenario.home)
        scenario = replace(self.scenario, home=home)
        try:
            solution = described.solve(scenario, self.model, self.progress)
        except Unreachable as error:
            raise Unreachable(f"{self._best(home)}{error}", error.infeasibility) from None
        self.progress("what is uncertain along the path")
        judged = self._judged(solution)
        chance = ChanceConstraint(judged.found, self.robust.chance)
        if not chance.holds:
            raise self._not_kept(solution, judged, chance)
        asked = replace(self.asked, home=home, inputs={**self.asked.inputs, **self.stated.inputs})
        kept = _reserved(judged, chance.reserve, self.model)
        return judged_by(solution, asked, self.model.tightened(kept, self.robust.chance))

    def _judged(self, solution: Solution, like: _Judged | None = None) -> _Judged:
        """`solution` with its margins; `like` is one of the same device, whose bounds are used again."""
        path = UncertainPath(solution, self.stated) if like is None else like.path.along(solution)
        try:
            linear = propagate(path)
        except FloatingPointError as fault:
            raise SolverError(f"{fault}; a law of the device has no slope along it") from None
        slopes = slopes_of_limits(path, linear) if like is None else like.slopes
        combined = linear.combined("pose", self.stated) / self.signal.scale
        error = float(np.sqrt(np.mean(np.sum(combined**2, axis=1))))
        return _Judged(path, linear, slopes, margins(path, linear, slopes), error)

    def _home(self) -> dict[str, float]:
        """The place of the path with the smallest expected error among those where the limits hold, by channel [SI]; where there is none,
        that where least is missing."""
        channels = [self.signal.channels.index(c) for c in self.robust.home]
        scale = np.array(self.signal.scale)[channels]
        known: dict[tuple[float, ...], tuple[Margins, float]] = {}

        def judged_at(place: np.ndarray, like: _Judged | None = None) -> _Judged:
            self.progress("expected error, moved by " + self._shown(self._named(place * scale)))
            return self._judged(unlimited(replace(self.scenario, home=self._named(place * scale)), self.model), like)

        start = judged_at(np.zeros(len(channels)))

        def at(place: np.ndarray) -> tuple[Margins, float]:
            key = tuple(float(v) for v in place)
            if key not in known:
                found = judged_at(place, start)
                known[key] = found.found, found.error / start.error
            return known[key]

        low, high = self._ends(start, channels, scale)

        def error(p: np.ndarray) -> np.ndarray:
            return np.array([at(p)[1]])

        place, counted = np.zeros(len(channels)), np.isfinite(start.found.bounds) & (start.found.sd.max(axis=1) > 0)
        size = start.found.sd.max(axis=1)[counted]
        z = float(-scipy.special.ndtri(1 - self.robust.chance))
        for _ in range(ROUNDS):

            def left(p: np.ndarray, z: float = z) -> np.ndarray:  # nearly linear, which their probability is not
                least = ChanceConstraint(at(p)[0], self.robust.chance).left(z).min(axis=1)
                return np.asarray(least[counted] / size - CUSHION)

            answer = scipy.optimize.minimize(
                lambda p: float(error(p)[0]), place, jac=lambda p: _slope(error, p, low, high)[0], method="SLSQP",
                bounds=list(zip(low, high, strict=True)), options={"ftol": 1e-4, "maxiter": MOST_STEPS},
                constraints={"type": "ineq", "fun": left, "jac": lambda p, left=left: _slope(left, p, low, high)},
            )  # fmt: skip
            place = np.clip(answer.x, low, high)
            chance = ChanceConstraint(at(place)[0], self.robust.chance)
            if chance.holds or chance.quantile <= z:
                break
            z = chance.quantile
        return self._named(
            np.array([_rounded(v, self.signal.units[i]) for v, i in zip(place * scale, channels, strict=True)])
        )

    def _ends(self, start: _Judged, channels: list[int], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each channel can be moved by itself before a displacement leaves its range, to first order [typical sizes]; zero is
        between both."""
        m, z = self.model, start.path.solution.trace.z
        bounds, command = m.z_bounds, start.path.solution.command
        middle = (command.min(axis=0) + command.max(axis=0)) / 2
        slope = _inverse_of(self.scenario, m).slope(middle)[:, channels] * scale
        low, high = np.full(len(channels), -FARTHEST), np.full(len(channels), FARTHEST)
        room = (bounds[0] - z.max(axis=0), bounds[1] - z.min(axis=0))  # one end of the path still inside
        for i, own in enumerate(slope.T):
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = np.sort(np.nan_to_num(np.array(room) / own, nan=np.inf), axis=0)
            low[i] = max(low[i], np.max(np.where(own != 0, ends[0], -np.inf)))
            high[i] = min(high[i], np.min(np.where(own != 0, ends[1], np.inf)))
        return np.minimum(low, 0.0), np.maximum(high, 0.0)

    def _named(self, moved: np.ndarray) -> dict[str, float]:
        return {channel: float(v) for channel, v in zip(self.robust.home, moved, strict=True)}

    def _shown(self, home: Mapping[str, float]) -> str:
        """'delta_z = +3.2 um'."""
        units = dict(zip(self.signal.channels, self.signal.units, strict=True))
        return ", ".join(f"{c} = {'+' if v > 0 else ''}{show(v, units[c])}" for c, v in home.items())

    def _best(self, home: Mapping[str, float]) -> str:
        """How a message about a path begins that may be moved."""
        return f"moved by {self._shown(home)}, the best place that was found: " if home else ""

    def _not_kept(self, solution: Solution, judged: _Judged, chance: ChanceConstraint) -> Unreachable:
        """The error that names the limits, by how much each is short at which sample, and the probability that the path has."""
        reserve, possible = chance.reserve, chance.possible
        short = np.where(judged.found.sd > 0, np.maximum(reserve - judged.found.margin, 0.0), 0.0)
        rows = sorted(self._missing(judged, reserve, short), key=lambda row: -row[0])
        samples = tuple(map(int, np.flatnonzero((short > 0).any(axis=(0, 2)))))
        could = f"{100 * possible:.3g} %" if possible > 0 else "no probability that is known"
        lines = [
            f"{self._best(solution.scenario.home)}cannot keep all limits with {self.robust.probability}, in {len(samples)} of "
            f"{short.shape[1]} samples; they are kept with {could}",
            *(text for _, text, _ in rows[:SHOWN]),
        ]
        if len(rows) > SHOWN:
            lines.append(f"  and {len(rows) - SHOWN} more limits")
        inverse = _inverse_of(self.scenario, self.model.tightened(_largest(judged, reserve), self.robust.chance))
        target = solution.scenario.target(self.model)
        line, found = instead(solution.scenario, inverse, target, [k for *_, k in rows])
        lines += [f"{line}, with the same reserves"] * bool(found)
        return Unreachable("\n".join(lines), Infeasibility(samples, rows[0][2], solution.command, None, found))

    def _missing(self, judged: _Judged, reserve: np.ndarray, short: np.ndarray) -> Iterator[tuple[float, str, int]]:
        """For each bound that is not kept: what is missing in standard uncertainties, a line of text, the worst sample."""
        found = judged.found
        for limit, own in judged.path.places:
            for side, away in enumerate(("above", "below")):
                k, i = np.unravel_index(int(np.argmax(short[side, :, own])), short[side, :, own].shape)
                at = side, int(k), own.start + int(i)
                if not short[at]:
                    continue
                bound, margin = float(found.bounds[side, at[2]]), float(found.margin[at])
                value = show(bound + (margin if side == 0 else -margin), limit.unit)
                left, taken, lacking = (show_difference(v, limit.unit) for v in (margin, reserve[at], short[at]))
                text = (
                    f"  {limit.label} at {limit.channels[i]}: {value} at sample {k}{self._moment(at[1])} is {left} {away} "
                    f"{show(bound, limit.unit)}, but what is uncertain takes {taken} there: short by {lacking}"
                )
                yield float(short[at] / found.sd[at]), text, at[1]

    def _moment(self, k: int) -> str:
        h = self.scenario.sample_time
        return "" if h is None else f" at {show(k * h, 's')}"


@dataclass(frozen=True)
class ChanceConstraint:
    """All limits of a path with the margins `found` at the `probability`: the equations of the module's text."""

    found: Margins
    probability: float

    @property
    def _share(self) -> float:
        return SCATTER_RISK if self.found.scattered.any() else 0.0

    @property
    def _allowed(self) -> float:
        return (1 - self._share) * (1 - self.probability)

    @cached_property
    def _scatter(self) -> np.ndarray:
        """(n, channels) z_s u_s."""
        f = self.found
        if not self._share:
            return f.scattered
        count = np.sum(np.isfinite(f.bounds)) * f.margin.shape[1]
        return np.asarray(-scipy.special.ndtri(self._share * (1 - self.probability) / count) * f.scattered)

    @cached_property
    def _beta(self) -> np.ndarray:
        """(2, channels)."""
        left = self.found.margin - self._scatter
        with np.errstate(divide="ignore", invalid="ignore"):
            beta = np.where(self.found.lasting > 0, left / self.found.lasting, np.where(left < 0, -np.inf, np.inf))
        # that a limit without uncertainty holds is left to the solver
        return np.asarray(np.where(self.found.sd > 0, beta, np.inf).min(axis=1))

    @cached_property
    def _risk(self) -> float:
        return float(scipy.special.ndtr(-self._beta).sum())

    @property
    def holds(self) -> bool:
        """Whether they do."""
        return self._risk <= self._allowed

    @property
    def possible(self) -> float:
        """The probability with which they hold; zero or less where Boole's inequality gives none."""
        return 1 - self._risk / (1 - self._share)

    @cached_property
    def quantile(self) -> float:
        """z of the back-off."""
        z = float(-scipy.special.ndtri(self._allowed))

        def risk(raised: float) -> float:
            return float(scipy.special.ndtr(-np.maximum(self._beta, raised)).sum() - self._allowed)

        if self.holds or risk(z) <= 0:  # of a single limit that is short, but for rounding
            return z
        return float(scipy.optimize.brentq(risk, z, 1 - scipy.special.ndtri(self._allowed / self._beta.size)))

    @property
    def reserve(self) -> np.ndarray:
        """(2, n, channels) the back-off of each limit [SI]."""
        return np.asarray(self.quantile * self.found.lasting + self._scatter)

    def left(self, z: float) -> np.ndarray:
        """(2, n, channels) what is left of the margins beside the back-off with a quantile z."""
        return np.asarray(self.found.margin - z * self.found.lasting - self._scatter)


def _largest(judged: _Judged, reserve: np.ndarray) -> dict[str, tuple[float, float]]:
    """Limit -> what is reserved of its lower and upper bound [SI] where it is least safe."""
    left, found = judged.found.margin - reserve, dict[str, tuple[float, float]]()
    for limit, own in judged.path.places:
        below, above = (float(reserve[s, :, own].flat[int(np.argmin(left[s, :, own]))]) for s in (0, 1))
        found[limit.name] = (0.0 if limit.lower is None else below, 0.0 if limit.upper is None else above)
    return found


def _reserved(judged: _Judged, reserve: np.ndarray, model: Model) -> dict[str, tuple[float, float]]:
    """The same, but no bound is moved past what the path itself needs, which holds with its own reserve at every sample, or past where
    the device rests: there is nothing uncertain of a device at rest, and its controller starts there."""
    largest, y = _largest(judged, reserve), judged.linear.nominal["limits"]
    rest, found = _at_rest(model), dict[str, tuple[float, float]]()
    for limit, own in judged.path.places:
        values = np.concatenate([y[:, own].ravel(), rest[limit.name]])
        below, above = largest[limit.name]
        low, high = limit.bounds
        room_below, room_above = max(float(values.min()) - low, 0.0), max(high - float(values.max()), 0.0)
        found[limit.name] = (min(below, room_below), min(above, room_above))
    return found


def _at_rest(model: Model) -> dict[str, np.ndarray]:
    """The limited quantities of each limit at rest at home."""
    home = model.rest, np.zeros(len(model.axes)), np.clip(0.0, *model.u_bounds), model.p_nominal
    values = model.evaluate_limits.call(list(home))
    return {limit.name: v.full().ravel() for limit, v in zip(model.limits, values, strict=True)}


def _of_least_error(model: Model, stated: Uncertainties, scenario: Scenario) -> Model:
    """A model with more drives than axes whose drives of least effort are those of the smallest expected error.

    The error that gain g_i of drive i causes is C B_i u_i g_i, that of a number q that acts on this drive alone C (dB_i/dq) u_i; C is the
    compliance at home, in typical sizes of the signal. So their sum of squares is least with the weights w_i / r_i^2 = sum_q sd_q^2
    |C dB_i/dq|^2. What all drives share acts on the forces, whichever of them make these.
    """
    able = set(movable(model.device))
    free = tuple(p for line in stated.lines if line.kind == "number" for p in line.paths if p in able)
    symbolic = build_model(model.device, free)
    signal, n_u = symbolic.signals[scenario.file.follow], model.u.numel()
    B = ca.jacobian(symbolic.balance, symbolic.u)
    K = ca.jacobian(symbolic.balance, symbolic.z)
    J = ca.jacobian(signal.expr, symbolic.z)
    at = [symbolic.x, symbolic.z, symbolic.u, symbolic.p]
    slopes = ca.Function("push", at, [B, K, J, ca.jacobian(ca.vec(ca.densify(B)), symbolic.p)])
    home = (symbolic.rest, np.zeros(len(model.axes)), np.clip(0.0, *model.u_bounds), symbolic.p_nominal)
    pushed, stiff, seen, by_number = (v.full() for v in slopes(*home))
    C = seen @ np.linalg.inv(stiff) / np.array(signal.scale)[:, None]
    by_number = by_number.reshape(n_u, len(model.axes), len(free)).transpose(1, 0, 2)
    variance = np.zeros(n_u)
    for line in stated.lines:
        if line.kind == "channel gain":
            variance += np.array(line.sds) ** 2 * np.sum((C @ pushed) ** 2, axis=0)
        elif line.kind == "number":
            for path, sd in zip(line.paths, line.sds, strict=True):
                own = C @ by_number[:, :, free.index(path)] if path in free else np.zeros((1, n_u))
                size = np.sum(own**2, axis=0) * sd**2
                variance += size if np.count_nonzero(size) == 1 else 0.0
    weights = variance * drive_ranges(model) ** 2
    if not weights.any():
        return model
    return replace(model, drive_weights=np.maximum(weights / weights.max(), LEAST_WEIGHT))


def _inverse_of(scenario: Scenario, model: Model) -> PathInverse | InertialInverse | LeastEffortInverse:
    """The inverse of a model along the path."""
    if model.inertial:
        return motion_inverse(model, scenario.file.follow, scenario.sample_time or 0.0)
    return path_inverse(model, scenario.file.follow, scenario.sample_time)


def _slope(f: Callable[[np.ndarray], np.ndarray], place: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(m, n) differences of f (m,), toward the inside."""
    here, columns = f(place), []
    for i in range(len(place)):
        step = np.zeros(len(place))
        step[i] = STEP if place[i] + STEP <= high[i] else -STEP
        columns.append((f(place + step) - here) / step[i])
    return np.column_stack(columns)


def _rounded(value: float, unit: str) -> float:
    """With as many digits as are shown."""
    one = 1 / difference(1.0, unit)
    return float(f"{value / one:.{DIGITS}g}") * one
