"""What a residual may be a function of: smooth functions of the signals of a record, in columns.

A kind of regressor is a set of columns: cubic B-splines of a signal (C. de Boor, A Practical Guide to Splines (1978)), its
sign, what play operators of several widths leave of it (rate-independent memory, as in Prandtl-Ishlinskii models), what
low-passes leave of it (memory of a time constant), or products of two signals.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from scipy.interpolate import BSpline
from scipy.signal import lfilter

from ctrlgen.diagnosis.settings import SHARES
from ctrlgen.diagnosis.shares.design import Columns, Design, Kind
from ctrlgen.diagnosis.shares.signals import Signals

# signals of one kind, up to which each gets all its columns
FEW = 2
WARMTH = "temperature"


def own_axes(signals: Sequence[Signals], channel: str) -> frozenset[str]:
    """The axes that move a reading: those whose part of it, in a linear regression of what the model predicts on positions,
    speeds and accelerations, is at least `SHARES.own_axis` of the largest one's. All axes where no such reading is given."""
    axes = tuple(signals[0].position)
    if len(axes) < 2 or any(channel not in s.reading for s in signals):
        return frozenset(axes)
    y = np.concatenate([s.reading[channel] for s in signals])
    parts, columns = [], []
    for axis in axes:
        d = np.concatenate([s.position[axis] for s in signals])
        signals_of_axis = [d]
        if not signals[0].settled:
            v = [s.speed_of(axis) for s in signals]
            acceleration = [s.derivative(x) for s, x in zip(signals, v, strict=True)]
            signals_of_axis += [np.concatenate(v), np.concatenate(acceleration)]
        columns += signals_of_axis
        parts.append(len(signals_of_axis))
    X = np.column_stack([standardised(c) for c in columns])
    slopes = np.linalg.lstsq(X, y - y.mean(), rcond=1e-8)[0]
    ends = np.cumsum([0, *parts])
    moved = [float(np.std(X[:, a:b] @ slopes[a:b])) for a, b in pairwise(ends)]
    largest = max(moved)
    return frozenset(axis for axis, part in zip(axes, moved, strict=True) if part >= SHARES.own_axis * largest)


def standardised(values: np.ndarray) -> np.ndarray:
    """`values` (N, ...) of zero mean and unit variance along the first axis; zero where they do not vary."""
    values = values - values.mean(axis=0)
    size = values.std(axis=0)
    return values / np.where(size > 0, size, 1.0)


def splines(x: np.ndarray, count: int) -> np.ndarray:
    """x and `count` + 1 cubic B-splines of it (N, count + 2); knots halfway between equal steps and equal counts.

    A B-spline is at most one anywhere, so that a smoother with bounded coefficients is bounded too.
    """
    low, high = float(x.min()), float(x.max())
    if not high > low:
        return np.empty((len(x), 0))
    part = np.linspace(0, 1, count - 1)[1:-1]
    inner = (np.quantile(x, part) + low + part * (high - low)) / 2
    knots = np.concatenate([[low] * 4, inner, [high] * 4])
    basis = BSpline.design_matrix(np.clip(x, low, high), knots, 3).toarray()
    return np.column_stack([x, basis])


def plays(x: np.ndarray, half_widths: np.ndarray) -> np.ndarray:
    """Play operators P_r <- max(x - r, min(x + r, P_r)) of half widths r (m, k) of inputs x (n, m): (n, m, k).

    They begin at the first input. M. A. Krasnosel'skii, A. V. Pokrovskii, Systems with Hysteresis (1989), ch. 2.
    """
    P, out = np.repeat(x[0][:, None], half_widths.shape[1], axis=1), np.empty((len(x), *half_widths.shape))
    low, high = x[:, :, None] - half_widths, x[:, :, None] + half_widths
    for k in range(len(x)):
        P = np.maximum(low[k], np.minimum(high[k], P))
        out[k] = P
    return out


def direction(speed: np.ndarray, fastest: float) -> np.ndarray:
    """Sign of the speed, zero where it is below `SHARES.standing` of the fastest."""
    return np.where(np.abs(speed) > SHARES.standing * fastest, np.sign(speed), 0.0)


def low_pass(u: np.ndarray, samples: float) -> np.ndarray:
    """u (n,) through a first-order lag of a time constant in samples, begun in balance."""
    a = np.exp(-1 / samples)
    return lfilter([1 - a], [1.0, -a], u, zi=[a * u[0]])[0]


def build_design(signals: Sequence[Signals], rows: Sequence[np.ndarray]) -> Design:
    """The columns of all kinds at the `rows` drawn from each record; memories run through every sample before."""
    builder = _Builder(signals, rows)
    made = [Columns(**{**vars(b), "values": standardised(b.values)}) for b in builder.columns()]
    varying = [Columns(**{**vars(b), "values": b.values[:, np.any(b.values != 0, axis=0)]}) for b in made]
    kept = tuple(b for b in varying if b.values.shape[1])
    N = sum(map(len, rows))
    X = np.column_stack([b.values for b in kept]) if kept else np.empty((N, 0))
    return Design(X, kept, tuple(builder.axes), builder.same_as)


class _Builder:
    """The drawn samples of the signals of all records, one after another."""

    def __init__(self, signals: Sequence[Signals], rows: Sequence[np.ndarray]) -> None:
        self.signals, self.rows, self.settled = signals, rows, signals[0].settled
        self.axes = list(signals[0].position)
        self.position = {a: self.drawn([s.position[a] for s in signals]) for a in self.axes}
        full = {a: [s.speed_of(a) for s in signals] for a in self.axes}
        self.speed = {a: self.drawn(full[a]) for a in self.axes}
        fastest = {a: max(float(np.abs(v).max(initial=0.0)) for v in full[a]) for a in self.axes}
        # a step counts over the range
        if self.settled:
            fastest = {a: float(np.ptp(np.concatenate([s.position[a] for s in signals]))) for a in self.axes}
        self.direction = {a: direction(self.speed[a], fastest[a]) for a in self.axes}
        self.acceleration = {
            a: self.drawn([s.derivative(v) for s, v in zip(signals, full[a], strict=True)]) for a in self.axes
        }
        drives = {name: self.drawn([s.drive[name] for s in signals]) for name in signals[0].drive}
        self.same_as = {name: same for name, u in drives.items() if (same := self._same(u))}
        self.drive = {name: u for name, u in drives.items() if name not in self.same_as}

    def drawn(self, parts: Sequence[np.ndarray]) -> np.ndarray:
        """The drawn samples of one array a record."""
        return np.concatenate([np.asarray(part)[rows] for part, rows in zip(parts, self.rows, strict=True)])

    def _same(self, u: np.ndarray) -> str | None:
        """The signal that a drive follows up to `SHARES.same_signal`, None where there is none or the drive does not vary."""
        groups = {"position": self.position}
        if not self.settled:
            groups |= {"speed": self.speed, "acceleration": self.acceleration}
        u = standardised(u)
        alike = [
            f"{name} of {axis}"
            for name, group in groups.items()
            for axis, x in group.items()
            if abs(float(np.mean(u * standardised(x)))) > SHARES.same_signal
        ]
        return alike[0] if alike else None

    def _unit(self, what: str, name: str) -> str:
        return self.signals[0].units.get(f"{what} {name}", "")

    def count(self, signals: int) -> int:
        """Splines of each of so many signals of one kind."""
        if self.settled:
            return SHARES.spline_columns_poses
        return SHARES.spline_columns if signals <= FEW else SHARES.spline_columns_many

    def columns(self) -> Iterator[Columns]:
        """The blocks of columns, not yet standardised."""
        nothing: frozenset[str] = frozenset()
        for a in self.axes:
            d, v, axis = self.position[a], self.speed[a], frozenset([a])
            unit, speed_unit = self._unit("position", a), self._unit("speed", a)
            yield Columns(Kind.PROPORTION, a, unit, axis, d, d[:, None])
            yield Columns(Kind.POSITION, a, unit, axis, d, splines(d, self.count(len(self.axes))))
            yield Columns(Kind.DIRECTION, f"speed of {a}", speed_unit, axis, v, self.direction[a][:, None])
            if not self.settled:
                yield Columns(Kind.SPEED, f"speed of {a}", speed_unit, axis, v, splines(v, self.count(len(self.axes))))
                acc = self.acceleration[a]
                values = splines(acc, SHARES.spline_columns_many)
                yield Columns(Kind.ACCELERATION, f"acceleration of {a}", "", axis, acc, values)
        for name, u in self.drive.items():
            unit = self._unit("drive", name)
            yield Columns(Kind.DRIVE, name, unit, nothing, u, splines(u, self.count(len(self.drive))))
        yield from self._memories()
        yield from self._products()
        yield from self._slow()

    def _memories(self) -> Iterator[Columns]:
        """What play operators and low-passes leave of positions and drives."""
        names = [("position", a) for a in self.axes] + [("drive", u) for u in self.drive]
        if not names:
            return
        inputs = [np.column_stack([np.asarray(getattr(s, what)[name]) for what, name in names]) for s in self.signals]
        half = np.ptp(np.concatenate(inputs), axis=0) / 2
        widths = half[:, None] * np.array(SHARES.plays)
        left = self.drawn([x[:, :, None] - plays(x, widths) for x in inputs])
        for i, (what, name) in enumerate(names):
            x, unit = self.drawn([part[:, i] for part in inputs]), self._unit(what, name)
            kind = Kind.TRAVEL_HISTORY if what == "position" else Kind.DRIVE_HISTORY
            axes = frozenset([name] if what == "position" else [])
            values = left[:, i]
            # butterflies and loops that differ by side
            if not self.settled and len(names) <= 2 * FEW:
                values = np.column_stack([values, values * standardised(x)[:, None], values**2])
            yield Columns(kind, name, unit, axes, x, values)
            if what == "drive":
                yield Columns(Kind.DRIVE_LAG, name, unit, frozenset(), x, self._lags([part[:, i] for part in inputs]))

    def _lags(self, parts: list[np.ndarray]) -> np.ndarray:
        """Low-passed less direct u and u^2 (N, 2 k); u^2 is what heats."""
        longest = max(SHARES.longest_lag * max(map(len, parts)), 5.0)
        lags = np.array(SHARES.pose_lags) if self.settled else np.geomspace(4, longest, SHARES.lags)
        columns = [
            self.drawn([low_pass(u**power, samples) - u**power for u in parts]) for samples in lags for power in (1, 2)
        ]
        return np.column_stack(columns)

    def _products(self) -> Iterator[Columns]:
        """Products of two signals of zero mean and unit variance."""
        signals: list[tuple[str, frozenset[str], np.ndarray]] = []
        for a in self.axes:
            axis = frozenset([a])
            signals.append((a, axis, self.position[a]))
            signals.append((f"direction of {a}", axis, self.direction[a]))
            if not self.settled:
                signals.append((f"speed of {a}", axis, self.speed[a]))
        # their number grows with the square
        if len(self.drive) <= FEW:
            signals += [(u, frozenset(), x) for u, x in self.drive.items()]
        if self.ambient is not None:
            signals.append((WARMTH, frozenset(), self.ambient))
        plain = {name: standardised(x) for name, _, x in signals}
        for (one, at, x), (other, of, _) in combinations(signals, 2):
            moving = {one, other} - set(self.axes)
            # of two axes the positions alone
            if at and of and at != of and moving:
                continue
            kind = Kind.WARM_PRODUCT if other == WARMTH else Kind.PRODUCT
            product = (plain[one] * plain[other])[:, None]
            yield Columns(kind, one, "", at | of, x, product, (self._called(one), self._called(other)))

    def _called(self, signal: str) -> str:
        """What a factor of a product is called: 'position', 'direction', 'the drive'; with its name where there are several."""
        if signal in self.drive:
            return "the drive" if len(self.drive) == 1 else signal
        what, of, axis = signal.partition(" of ") if signal not in self.axes else ("position", " of ", signal)
        return what if len(self.axes) == 1 else f"{what}{of}{axis}"

    @cached_property
    def ambient(self) -> np.ndarray | None:
        """Temperature at the drawn samples, where all records have one that varies."""
        parts = [s.temperature for s in self.signals if s.temperature is not None]
        if len(parts) < len(self.signals) or not np.ptp(np.concatenate(parts)) > 0:
            return None
        return self.drawn(parts)

    def _slow(self) -> Iterator[Columns]:
        """Temperature, a trend on the common clock, and the zero point of each record."""
        nothing: frozenset[str] = frozenset()
        if self.ambient is not None:
            values = splines(self.ambient, self.count(1))
            yield Columns(Kind.TEMPERATURE, WARMTH, "K", nothing, self.ambient, values)
        t = self.drawn([s.time for s in self.signals])
        unit = "" if self.settled else "s"
        yield Columns(Kind.TIME, "pose" if self.settled else "time", unit, nothing, t, splines(t, self.count(1)))
        if len(self.rows) > 1:
            record = np.repeat(np.arange(len(self.rows)), list(map(len, self.rows)))
            one = (record[:, None] == np.arange(len(self.rows))).astype(float)
            yield Columns(Kind.RECORD, "record", "", nothing, record.astype(float), one)
