"""Paths whose limits hold for what is not known exactly: chance constraints with a back-off of each limit.

A limit with the margin M = b - y at a sample holds for a device of which the numbers, surroundings and drives differ where M is
larger than what they take of it. To first order that is normal; `lasting` is its sd by what is the same along the whole path, `scattered`
by what is new at every sample. All of N limited quantities hold at all of n samples with the probability p where

    M >= z_l u_lasting + z_s u_scattered,   1 - Phi(z_l) = e_l/N,   1 - Phi(z_s) = e_s/(N n),   e_l + e_s + e_far = 1 - p,

Boole's inequality over quantities, and of what scatters over samples. What lasts breaks a limit at its worst sample or not at all. Sources:
A. Nemirovski, A. Shapiro, SIAM J. Optim. 17 (2006) 969 (safe approximation of chance constraints); L. Blackmore, M. Ono, AIAA 2009-5876
(allocation of the risk).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.optimize import brentq, minimize
from scipy.stats import norm

from ctrlgen.budget.limits import Margins, Slopes, margins, slopes_of_limits
from ctrlgen.budget.linear import Propagated, propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties, load_uncertainties
from ctrlgen.core.errors import Fault, Infeasibility, InputError, SolverError, Unreachable
from ctrlgen.core.units import difference, show
from ctrlgen.model.model import Model
from ctrlgen.trajectory import solution as described
from ctrlgen.trajectory.infeasibility import instead
from ctrlgen.trajectory.least_effort import motion_inverse, path_inverse
from ctrlgen.trajectory.scenario import Robust, Scenario
from ctrlgen.trajectory.solution import Solution, judged_by, unlimited

SCATTER_RISK = 0.1  # of the risk, for what scatters: little of it is gained by more, as z grows with its logarithm
FAR_RISK = 0.01  # for all quantities that are so far from their limits that they are not counted
CUSHION = 0.01  # standard uncertainties that a moved path keeps more: its place is rounded
STEP = 1e-3  # typical sizes by which a path is moved for a difference
FARTHEST = 100.0  # typical sizes by which a path is moved where no displacement has limits
ROUNDS = 4  # of the search, after each of which the quantities are counted anew
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
        home = {}
        if self.robust.home:
            home = self._home()
        scenario = replace(self.scenario, home=home)
        solution = described.solve(scenario, self.model, self.progress)
        self.progress("what is uncertain along the path")
        judged = self._judged(solution)
        reserve = reserves(judged.found, self.robust.chance)
        asked = replace(self.asked, home=home, inputs={**self.asked.inputs, **self.stated.inputs})
        if np.any(_short(judged.found, reserve) > 0):
            raise self._not_kept(solution, judged, reserve)
        kept = _reserved(judged, reserve, self.model, solution)
        return judged_by(solution, asked, self.model.tightened(kept, self.robust.chance))

    def _judged(self, solution: Solution, like: _Judged | None = None) -> _Judged:
        """`solution` with its margins; `like` is one of the same device, whose bounds are used again."""
        path = UncertainPath(solution, self.stated) if like is None else like.path.along(solution)
        try:
            linear = propagate(path)
        except FloatingPointError as error:
            raise SolverError(f"{error}; a law of the device has no slope along it") from None
        slopes = slopes_of_limits(path, linear) if like is None else like.slopes
        combined = linear.combined("pose", self.stated) / self.signal.scale
        error = float(np.sqrt(np.mean(np.sum(combined**2, axis=1))))
        return _Judged(path, linear, slopes, margins(path, linear, slopes), error)

    def _home(self) -> dict[str, float]:
        """The place of the path with the smallest expected error among those where the limits hold, by channel [SI]; where there is none,
        that where least is missing."""
        channels = [self.signal.channels.index(c) for c in self.robust.home]
        scale = np.array(self.signal.scale)[channels]
        judged: dict[tuple[float, ...], _Judged] = {}
        first: list[_Judged] = []

        def at(place: np.ndarray) -> _Judged:
            key = tuple(float(v) for v in place)
            if key not in judged:
                self.progress("expected error, moved by " + self._shown(self._named(place * scale)))
                moved = replace(self.scenario, home=self._named(place * scale))
                judged[key] = self._judged(unlimited(moved, self.model), first[0] if first else None)
                first.append(judged[key])
            return judged[key]

        start = at(np.zeros(len(channels)))
        size = np.where(start.found.sd.max(axis=1) > 0, start.found.sd.max(axis=1), 1.0)
        counted = np.isfinite(start.found.bounds) & (start.found.sd.max(axis=1) > 0)
        low, high = self._ends(start, channels, scale)
        place = np.clip(np.zeros(len(channels)), low, high)
        for _ in range(ROUNDS):
            near = int(_near(at(place).found, self.robust.chance).sum())

            def left(p: np.ndarray, near: int = near) -> np.ndarray:
                found = at(p).found
                least = (found.margin - reserves(found, self.robust.chance, near)).min(axis=1)
                return least[counted] / size[counted] - CUSHION

            def error(p: np.ndarray) -> np.ndarray:
                return np.array([at(p).error / start.error])

            answer = minimize(
                lambda p: float(error(p)[0]), place, jac=lambda p: _slope(error, p, low, high)[0], method="SLSQP",
                bounds=list(zip(low, high, strict=True)), options={"ftol": 1e-4, "maxiter": 20},
                constraints={"type": "ineq", "fun": left, "jac": lambda p: _slope(left, p, low, high)},
            )  # fmt: skip
            place = np.clip(answer.x, low, high)
            if int(_near(at(place).found, self.robust.chance).sum()) <= near:
                break
        return self._named(
            np.array([_rounded(v, self.signal.units[i]) for v, i in zip(place * scale, channels, strict=True)])
        )

    def _ends(self, start: _Judged, channels: list[int], scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each channel can be moved by itself before a displacement leaves its range, to first order [typical sizes]; zero is
        between both."""
        m, z = self.model, start.path.solution.trace.z
        bounds, middle = m.z_bounds, samples_middle(start.path.solution.command)
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

    def _shown(self, home: dict[str, float]) -> str:
        """'delta_z = +3.2 um'."""
        units = dict(zip(self.signal.channels, self.signal.units, strict=True))
        return ", ".join(f"{c} = {'+' if v > 0 else ''}{show(v, units[c])}" for c, v in home.items())

    def _not_kept(self, solution: Solution, judged: _Judged, reserve: np.ndarray) -> Unreachable:
        """The error that names the limits, by how much each is short at which sample, and the probability that the path has."""
        short, found, model = _short(judged.found, reserve), judged.found, self.model
        rows: list[tuple[float, str, int]] = []
        place = 0
        for limit in judged.path.limits:
            own = slice(place, place + limit.expr.numel())
            place = own.stop
            for side in (0, 1):
                worst = short[side, :, own]
                if not worst.max(initial=0.0) > 0:
                    continue
                k, i = np.unravel_index(int(np.argmax(worst)), worst.shape)
                c, unit = own.start + int(i), limit.unit
                step = "K" if unit == "degC" else unit
                bound, sd = found.bounds[side, c], found.sd[side, k, c]
                value = bound + (found.margin[side, k, c] if side == 0 else -found.margin[side, k, c])
                away = "above" if side == 0 else "below"
                text = (
                    f"  {limit.label} at {limit.channels[i]}: {show(value, unit)} at sample {k}{self._moment(int(k))} is "
                    f"{show(found.margin[side, k, c], step)} {away} {show(bound, unit)}, but what is uncertain takes "
                    f"{show(reserve[side, k, c], step)} there: short by {show(worst[k, i], step)}"
                )
                rows.append((float(worst[k, i] / sd), text, int(k)))
        rows.sort(key=lambda row: -row[0])
        samples = tuple(map(int, np.flatnonzero((short > 0).any(axis=(0, 2)))))
        possible = _probability(found)
        could = (
            f"the path as it is keeps them with {100 * possible:.3g} %"
            if possible
            else "the path as it is keeps them with less than 50 %"
        )
        where = (
            f"moved by {self._shown(dict(solution.scenario.home))}, where least is missing, it "
            if self.robust.home
            else ""
        )
        lines = [
            f"{where}cannot keep all limits with {self.robust.probability}, in {len(samples)} of {len(short[0])} samples; {could}",
            *(text for _, text, _ in rows[:SHOWN]),
        ]
        if len(rows) > SHOWN:
            lines.append(f"  and {len(rows) - SHOWN} more limits")
        strict = model.tightened(_largest(judged, reserve), self.robust.chance)
        target = solution.scenario.target(model)
        line, found_paths = instead(
            solution.scenario, _inverse_of(self.scenario, strict), target, [k for *_, k in rows]
        )
        lines += [f"{line} with the same reserves"] * bool(found_paths)
        return Unreachable("\n".join(lines), Infeasibility(samples, rows[0][2], solution.command, None, found_paths))

    def _moment(self, k: int) -> str:
        h = self.scenario.sample_time
        return "" if h is None else f" at {show(k * h, 's')}"


def reserves(found: Margins, probability: float, near: int | None = None) -> np.ndarray:
    """(2, n, channels) what is kept of each margin so that all limits hold along the path with the `probability`; `near` is the number of
    limited quantities that count, by default of those near their limits."""
    count = max(int(_near(found, probability).sum()) if near is None else near, 1)
    risk, n = 1 - probability, found.margin.shape[1]
    of_scatter = SCATTER_RISK if found.scattered.any() else 0.0
    z_lasting = norm.isf((1 - of_scatter - FAR_RISK) * risk / count)
    z_scattered = norm.isf(of_scatter * risk / (count * n)) if of_scatter else 0.0
    return np.asarray(z_lasting * found.lasting + z_scattered * found.scattered)


def _near(found: Margins, probability: float) -> np.ndarray:
    """(2, channels) which limited quantities count: the others break their limits with `FAR_RISK` of the risk in all."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(found.sd > 0, found.margin / found.sd, np.inf).min(axis=1)
    return np.asarray(ratio < norm.isf(FAR_RISK * (1 - probability) / (ratio.size * found.margin.shape[1])))


def _short(found: Margins, reserve: np.ndarray) -> np.ndarray:
    """(2, n, channels) what is missing of each reserve."""
    return np.asarray(np.where(found.sd > 0, np.maximum(reserve - found.margin, 0.0), 0.0))


def _probability(found: Margins) -> float | None:
    """The largest at which the limits hold along the path; None below 0.5."""

    def missing(digits: float) -> float:
        reserve = reserves(found, 1 - 10.0**-digits)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(found.sd > 0, (reserve - found.margin) / found.sd, -np.inf)
        return float(ratio.max())

    least = -np.log10(0.5)
    return None if missing(least) > 0 else 1 - 10.0 ** -brentq(missing, least, 15.0, xtol=1e-3)


def _largest(judged: _Judged, reserve: np.ndarray) -> dict[str, tuple[float, float]]:
    """Limit -> what is reserved of its lower and upper bound [SI] where it is least safe."""
    left = judged.found.margin - reserve
    found, place = dict[str, tuple[float, float]](), 0
    for limit in judged.path.limits:
        own = slice(place, place + limit.expr.numel())
        place = own.stop
        at = [np.unravel_index(int(np.argmin(left[s, :, own])), left[s, :, own].shape) for s in (0, 1)]
        found[limit.name] = (float(reserve[0, :, own][at[0]]), float(reserve[1, :, own][at[1]]))
    return found


def _reserved(judged: _Judged, reserve: np.ndarray, model: Model, solution: Solution) -> dict[str, tuple[float, float]]:
    """The same, but no bound is moved past what the path itself needs, which holds with its own reserve at every sample, or past where
    the device rests: there is nothing uncertain of a device at rest, and its controller starts there."""
    largest, y, place = _largest(judged, reserve), judged.linear.nominal["limits"], 0
    rest = dict(zip((limit.name for limit in model.limits), _at_rest(model), strict=True))
    found = {}
    for limit in judged.path.limits:
        own = np.concatenate([y[:, place : place + limit.expr.numel()].ravel(), rest[limit.name]])
        place += limit.expr.numel()
        below, above = largest[limit.name]
        if limit.lower is not None:
            below = min(below, max(float(own.min()) - limit.lower, 0.0))
        if limit.upper is not None:
            above = min(above, max(limit.upper - float(own.max()), 0.0))
        found[limit.name] = (below if limit.lower is not None else 0.0, above if limit.upper is not None else 0.0)
    return found


def _at_rest(model: Model) -> list[np.ndarray]:
    """The limited quantities of each limit at rest at home."""
    home = model.rest, np.zeros(len(model.axes)), np.clip(0.0, *model.u_bounds), model.p_nominal
    values = model.evaluate_limits(*home)
    return [np.asarray(v.full()).ravel() for v in (values if len(model.limits) > 1 else [values])]


def _of_least_error(model: Model, stated: Uncertainties, scenario: Scenario) -> Model:
    """A model with more drives than axes whose drives of least effort are those of the smallest expected error.

    The error that gain g_i of drive i causes is C B_i u_i g_i, that of a number q that acts on this drive alone C (dB_i/dq) u_i; C is the
    compliance at home, in typical sizes of the signal. So their sum of squares is least with the weights w_i / r_i^2 = sum_q sd_q^2
    |C dB_i/dq|^2. What all drives share acts on the forces, whichever of them make these.
    """
    from ctrlgen.model.assembly import build_model

    able = [p for line in stated.lines if line.kind == "number" for p in line.paths]
    free = tuple(p for p in able if p in _moving(model))
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
    low, high = model.u_bounds
    span = np.where(np.isfinite(high - low), high - low, 2 * model.u_scale)
    weights = variance * span**2
    if not weights.any():
        return model
    return replace(model, drive_weights=np.maximum(weights / weights.max(), LEAST_WEIGHT))


def _moving(model: Model) -> frozenset[str]:
    from ctrlgen.model.assembly import movable

    return frozenset(movable(model.device))


def samples_middle(command: np.ndarray) -> np.ndarray:
    """(channels,) the middle of a path."""
    return np.asarray((command.min(axis=0) + command.max(axis=0)) / 2)


def _inverse_of(scenario: Scenario, model: Model):
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
