"""Step 4: where a mismatch is. Effect sizes of what a fit leaves, by reading, actuator, band, travel, time, direction.

With w the residual whitened by the noise (unit variance where nothing is left), a part's size is its excess
mean(w^2) - 1: 0 is nothing, 1 as much again as the noise. Intervals of 95 % by bootstrap over blocks of samples, of
bands by chi^2. The coordinates that carry the excess in the fewest numbers say whether it is in the readings or before.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np
from scipy import signal, stats

from ctrlgen.core.units import difference
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.spectral_lines import SpectralLines, spectral_lines
from ctrlgen.diagnosis.settings import LOCALISATION


@dataclass(frozen=True)
class ResidualPart:
    """One part of the recording: `excess` of squares over the noise's, its interval, `share` of the whole excess, and
    the mean of what is left with its interval, in `unit`."""

    label: str
    excess: float
    ci95: tuple[float, float]
    share: float
    mean: float
    mean_ci95: tuple[float, float]
    unit: str
    n: int


@dataclass(frozen=True)
class FrequencyBand:
    """One band [Hz]: excess of the whitened spectrum, and the largest coherence of any reading with any drive; above
    `coherence_floor` it is there with 95 %."""

    low: float
    high: float
    excess: float
    ci95: tuple[float, float]
    coherence: float | None
    coherence_floor: float | None


@dataclass(frozen=True)
class Coordinates:
    """How sparse the excess is: `participation_ratio` how many numbers (participation ratio), of readings and of actuators;
    `alone` the share that each could explain by itself; `lives_in` the better kind, or that neither stands out."""

    participation_ratio: dict[str, float]
    explained_by_one: dict[str, dict[str, float]]
    located_in: str


@dataclass(frozen=True)
class ResidualLocation:
    """Where what one fit leaves is; `said` the sentences that follow from it."""

    excess: float
    by_reading: tuple[ResidualPart, ...]
    by_actuator: tuple[ResidualPart, ...]
    coordinates: Coordinates
    by_frequency: tuple[FrequencyBand, ...]
    by_travel: dict[str, tuple[ResidualPart, ...]]
    by_direction: dict[str, tuple[ResidualPart, ...]]
    by_time: tuple[ResidualPart, ...]
    by_temperature: tuple[ResidualPart, ...]
    spectral_lines: tuple[SpectralLines, ...]
    statements: tuple[str, ...]


def localise_residual(
    left: list[LtvModel], channels: tuple[str, ...], units: tuple[str, ...], seed: int = 0
) -> ResidualLocation:
    """The map of what is left along the records; `channels` the readings' names with the reader's `units`."""
    maps = _Maps(left, seed)
    axes = left[0].axes
    outputs = tuple(
        maps.sizes(maps.white[:, i], maps.usable[:, i], [(name, np.ones(maps.n, bool))], maps.residual[:, i], unit)[0]
        for i, (name, unit) in enumerate(zip(channels, units, strict=True))
    )
    actuators: list[ResidualPart] = []
    regions, directions = {}, {}
    for i, axis in enumerate(axes):
        a, sized, unit = maps.actuators[:, i], maps.actuators_white[:, i], left[0].units[i]
        actuators += maps.sizes(sized, maps.complete, [(axis, np.ones(maps.n, bool))], a, unit)
        regions[axis] = maps.sizes(sized, maps.complete, _quintiles(maps.z[:, i], left[0].travel_unit), a, unit)
        sides = [("forward", maps.direction[:, i] > 0), ("backward", maps.direction[:, i] < 0)]
        directions[axis] = maps.sizes(
            sized, maps.complete, sides, _without_position(a, maps.z[:, i], maps.complete), unit
        )
    norm, whole = np.sqrt(np.mean(maps.white**2, axis=1)), np.any(maps.usable, axis=1)
    ambient = _quintiles(maps.ambient, "delta_degC") if maps.ambient is not None else []
    found = ResidualLocation(
        maps.excess, _shared(outputs), _shared(tuple(actuators)), maps.coordinates(channels), _bands(left), regions,
        directions, maps.sizes(norm, whole, maps.times(), norm, "1"), maps.sizes(norm, whole, ambient, norm, "1"),
        tuple(found for a in left for i in range(len(channels)) if (found := spectral_lines(a.record, i, channels[i], units[i]))),
        (),
    )  # fmt: skip
    return ResidualLocation(**{**found.__dict__, "statements": _statements(found)})


def _quintiles(values: np.ndarray, unit: str) -> list[tuple[str, np.ndarray]]:
    edges = np.unique(np.quantile(values, np.linspace(0, 1, LOCALISATION.regions + 1)))
    shown = difference(edges, unit)
    return [
        (f"{shown[k]:.4g} ... {shown[k + 1]:.4g} {unit}", (values >= edges[k]) & (values <= edges[k + 1]))
        for k in range(len(edges) - 1)
    ]


def _without_position(values: np.ndarray, d: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """What is left when a smooth function of the position alone has taken its part: where the device went forward more
    often than back, that would look like a dependence on direction."""
    size = np.abs(d).max(initial=0.0) or 1.0
    powers = np.vander(d / size, LOCALISATION.position_degree + 1)
    return values - powers @ np.linalg.lstsq(powers[usable], values[usable], rcond=1e-10)[0]


def _shared(sizes: tuple[ResidualPart, ...]) -> tuple[ResidualPart, ...]:
    """Shares among these parts, which together are the whole."""
    total = sum(max(s.excess, 0.0) for s in sizes)
    return tuple(ResidualPart(**{**s.__dict__, "share": max(s.excess, 0.0) / total if total else 0.0}) for s in sizes)


class _Maps:
    """All records behind one another, in the coordinates of the readings and of the actuators."""

    def __init__(self, left: list[LtvModel], seed: int) -> None:
        self.left = left
        self.rng = np.random.default_rng(seed)
        self.white, self.residual, self.usable = (
            np.concatenate([getattr(a, name) for a in left]) for name in ("white", "residual", "usable")
        )
        self.z = np.concatenate([a.displacement for a in left])
        self.direction = np.concatenate([a.direction() for a in left])
        self.n = len(self.white)
        self.complete = np.all(self.usable, axis=1)
        given = all(a.record.ambient is not None for a in left)
        self.ambient = np.concatenate([a.record.ambient for a in left]) if given else None
        self.block = _blocks([len(a.white) for a in left])
        self.excess = float(np.sum(self.white**2) / max(self.usable.sum(), 1) - 1)
        coordinates = [equivalent_inputs(a) for a in left]
        self.actuators = np.concatenate([c[0] for c in coordinates])
        self.actuators_white = np.concatenate([c[1] for c in coordinates])
        self.along_each = np.concatenate([c[2] for c in coordinates])

    def sizes(
        self,
        white: np.ndarray,
        usable: np.ndarray,
        cells: list[tuple[str, np.ndarray]],
        values: np.ndarray,
        unit: str,
    ) -> tuple[ResidualPart, ...]:
        """The size of each cell (label, mask), with intervals."""
        found = []
        weights = self.rng.multinomial(
            self.block.max() + 1, np.ones(self.block.max() + 1) / (self.block.max() + 1), LOCALISATION.draws
        )
        total = max(float(np.sum(white[usable] ** 2) - usable.sum()), 1e-300)
        for label, mask in cells:
            chosen = mask & usable
            n = int(chosen.sum())
            if n < min(LOCALISATION.fewest_samples, max(len(white) // 20, 2)):
                continue
            count, squares, sums = (
                np.bincount(self.block[chosen], w, self.block.max() + 1)
                for w in (None, white[chosen] ** 2, values[chosen])
            )
            held = np.maximum(weights @ count, 1.0)
            drawn = [(weights @ part / held)[weights @ count > 0] for part in (squares, sums)]
            low, high = np.quantile(drawn[0] - 1, [0.025, 0.975])
            bounds = difference(np.quantile(drawn[1], [0.025, 0.975]), unit)
            excess = float(squares.sum() / n - 1)
            share = float(np.clip((squares.sum() - n) / total, 0, 1))
            mean = float(difference(sums.sum() / n, unit))
            found.append(
                ResidualPart(
                    label, excess, (float(low), float(high)), share, mean, (float(bounds[0]), float(bounds[1])), unit, n
                )
            )
        return tuple(found)

    def times(self) -> list[tuple[str, np.ndarray]]:
        """Tenths of each record, on the common clock."""
        cells, first = [], 0
        for a in self.left:
            n, t = len(a.white), a.record.time
            for part in np.array_split(
                np.arange(n), LOCALISATION.times if not a.settled else min(LOCALISATION.times, max(n // 4, 1))
            ):
                mask = np.zeros(self.n, bool)
                mask[first + part] = True
                unit = "" if a.settled else " s"
                cells.append(
                    (f"{PurePosixPath(a.record.name).name}: {t[part[0]]:.4g} ... {t[part[-1]]:.4g}{unit}", mask)
                )
            first += n
        return cells

    def coordinates(self, channels: tuple[str, ...]) -> Coordinates:
        """In which coordinates the excess is sparser."""
        w, a, rows = self.white[self.complete], self.actuators_white[self.complete], self.along_each[self.complete]
        total = float(np.sum(w**2) - w.size)
        if total < LOCALISATION.least_excess * np.sqrt(2 * w.size):
            return Coordinates({}, {}, "there is nothing left to place")
        alone = {
            kind: {name: float(x) for name, x in zip(names, np.clip((np.sum(v**2, axis=0) - len(w)) / total, 0, 1), strict=True)}
            for kind, names, v in (("reading", channels, w), ("actuator", self.left[0].axes, rows))
        }  # fmt: skip
        carried = {"reading": _participation(w), "actuator": _participation(a)}
        best = {kind: max(values.values()) for kind, values in alone.items()}
        gap = best["actuator"] - best["reading"]
        if len(channels) == 1:
            lives = "one reading cannot tell"
        elif abs(gap) < LOCALISATION.stands_out:
            lives = "neither stands out"
        else:
            lives = "actuator" if gap > 0 else "reading"
        return Coordinates(carried, alone, lives)


def _blocks(lengths: list[int]) -> np.ndarray:
    """The block of the bootstrap that each sample is in; single poses where there are few."""
    size = max(sum(lengths) // LOCALISATION.blocks, 1)
    blocks, first = [], 0
    for n in lengths:
        own = np.arange(n) // size
        blocks.append(first + own)
        first += own.max(initial=-1) + 1
    return np.concatenate(blocks)


def equivalent_inputs(a: LtvModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Disturbances of the axes that would explain each sample at rest, (n, n_axes): SI, in units of their noise, and
    the whitened residual along each axis' own direction."""
    per_noise = np.where(a.usable.any(axis=0), _per_noise(a), 0.0)
    slopes = a.H_f if a.settled else a.steady()[None]
    G = slopes * per_noise[:, None]
    size = np.linalg.norm(G, axis=1, keepdims=True)
    inverse = np.linalg.pinv(G, rcond=1e-6)
    sd = np.linalg.norm(inverse, axis=2)
    values = (inverse @ (a.residual * per_noise)[:, :, None])[:, :, 0]
    white = (inverse @ a.white[:, :, None])[:, :, 0] / np.where(sd > 0, sd, 1.0)
    own = np.einsum(
        "tia,ti->ta", np.broadcast_to(G / np.where(size > 0, size, 1.0), (len(white), *G.shape[1:])), a.white
    )
    return values, white, own


def _per_noise(a: LtvModel) -> np.ndarray:
    """Whitened over plain residual, root mean square: the inverse of the noise where it is white."""
    plain = np.sqrt(np.sum(np.where(a.usable, a.residual, 0.0) ** 2, axis=0))
    return np.sqrt(np.sum(a.white**2, axis=0)) / np.where(plain > 0, plain, 1.0)


def _participation(w: np.ndarray) -> float:
    """(sum e)^2/sum e^2 over the coordinates' excess squares e: how many of them carry it."""
    e = np.maximum(np.sum(w**2, axis=0) - len(w), 0.0)
    return float(e.sum() ** 2 / np.sum(e**2)) if np.any(e > 0) else float("nan")


def _bands(left: list[LtvModel]) -> tuple[FrequencyBand, ...]:
    """Logarithmic bands from the longest record's own frequency to half the sample rate."""
    if left[0].settled:
        return ()
    longest, fastest = max(a.record.sample_time * len(a.white) for a in left), min(a.record.sample_time for a in left)
    edges = np.geomspace(1 / longest, 0.5 / fastest, LOCALISATION.bands + 1)
    power, count = np.zeros(LOCALISATION.bands), np.zeros(LOCALISATION.bands)
    coherences = [_coherence(a, edges) for a in left]
    for a in left:
        f = np.fft.rfftfreq(len(a.white), a.record.sample_time)[1:]
        spectrum = np.abs(np.fft.rfft(a.white, axis=0)[1:]) ** 2 / np.maximum(a.usable.sum(axis=0), 1)
        which = np.clip(np.searchsorted(edges, f * (1 + 1e-12), side="right") - 1, 0, LOCALISATION.bands - 1)
        for i in np.flatnonzero(a.usable.any(axis=0)):
            power += np.bincount(which, spectrum[:, i], LOCALISATION.bands)
            count += np.bincount(which, minlength=LOCALISATION.bands)
    found = []
    for k in range(LOCALISATION.bands):
        if count[k] == 0:
            continue
        level, m = power[k] / count[k], 2 * count[k]
        low, high = (float(level * m / stats.chi2.ppf(q, m) - 1) for q in (0.975, 0.025))
        seen = [value for c, _ in coherences if (value := c[k]) is not None]
        floor = max((f for c, f in coherences if c[k] is not None), default=None)
        found.append(
            FrequencyBand(
                float(edges[k]), float(edges[k + 1]), float(level - 1), (low, high), max(seen, default=None), floor
            )
        )
    return tuple(found)


def _coherence(a: LtvModel, edges: np.ndarray) -> tuple[list[float | None], float]:
    """Per band the largest coherence of a reading's residual with a drive, and what chance reaches with 5 %."""
    segment = max(len(a.white) // LOCALISATION.coherence_segments * 2, 8)
    averages = max(2 * len(a.white) // segment - 1, 2)
    best: list[float | None] = [None] * (len(edges) - 1)
    for i in range(a.white.shape[1]):
        for u in a.record.drive.T:
            if np.std(u) == 0 or np.std(a.residual[:, i]) == 0:
                continue
            f, c = signal.coherence(u, a.residual[:, i], 1 / a.record.sample_time, nperseg=segment)
            for k in range(len(best)):
                inside = (f >= edges[k]) & (f < edges[k + 1]) & (f > 0)
                if inside.any():
                    best[k] = max(best[k] or 0.0, float(np.mean(c[inside])))
    return best, float(1 - 0.05 ** (1 / (averages - 1)))


def _statements(found: ResidualLocation) -> tuple[str, ...]:
    said = []
    if found.by_reading:
        most = max(found.by_reading, key=lambda s: s.share)
        if most.ci95[0] > 0:
            said.append(f"{most.label} carries {most.share:.0%} of what is left over the noise")
    lives = found.coordinates.located_in
    if lives in ("actuator", "reading"):
        name, share = max(found.coordinates.explained_by_one[lives].items(), key=lambda item: item[1])
        said.append(f"{lives} {name} alone could carry {share:.0%} of it")
    for axis, sides in found.by_direction.items():
        if len(sides) == 2:
            (a, b), (c, d) = sides[0].mean_ci95, sides[1].mean_ci95
            if a > d or c > b:
                gap = sides[0].mean - sides[1].mean
                said.append(f"{axis} differs by direction: {gap:.3g} {sides[0].unit} between forward and backward")
    return (*said, *(f"{line.channel} in {line.record}: {line.statement}" for line in found.spectral_lines))
