"""Residual localisation: how large the residual of a fit is by reading, actuator, frequency, travel, direction and time.

With w the residual whitened by the noise model, the size of a part is its excess mean(w^2) - 1: 0 is noise alone, 1 is as
much power again as the noise has. 95 % intervals come from a bootstrap over blocks of samples, those of frequency bands
from the chi-square distribution. Where fewer coordinates carry the excess, of the readings or of the actuators, there its
cause is more likely.
"""

from __future__ import annotations

from pathlib import PurePosixPath

import numpy as np

from ctrlgen.core.percent import percent
from ctrlgen.core.units import difference
from ctrlgen.diagnosis.evidence.frequency_bands import frequency_bands
from ctrlgen.diagnosis.evidence.gathered_residual import gathered_residual
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel
from ctrlgen.diagnosis.evidence.residual_location import (
    CoordinatesEntry,
    LocatedIn,
    ResidualLocationEntry,
    ResidualPartEntry,
)
from ctrlgen.diagnosis.evidence.spectral_lines import spectral_lines
from ctrlgen.diagnosis.settings import LOCALISATION

ROUNDING = 1e-12  # of a range: an edge nearer to zero is zero but for rounding


def localise_residual(
    models: list[LtvModel], channels: tuple[str, ...], units: tuple[str, ...], seed: int = 0
) -> ResidualLocationEntry:
    """Localises the residual of the LTV models `models`, one a record; `channels` names the readings, `units` their units.

    `seed` draws the bootstrap.
    """
    maps = _Maps(models, seed)
    axes = models[0].axes
    outputs = [
        maps.sizes(maps.white[:, i], maps.usable[:, i], [(name, np.ones(maps.n, bool))], maps.residual[:, i], unit)[0]
        for i, (name, unit) in enumerate(zip(channels, units, strict=True))
    ]
    actuators: list[ResidualPartEntry] = []
    regions, directions = {}, {}
    for i, axis in enumerate(axes):
        a, sized, unit = maps.actuators[:, i], maps.actuators_white[:, i], models[0].units[i]
        actuators += maps.sizes(sized, maps.complete, [(axis, np.ones(maps.n, bool))], a, unit)
        regions[axis] = maps.sizes(sized, maps.complete, regions_of(maps.z[:, i], models[0].travel_unit), a, unit)
        sides = [("forward", maps.direction[:, i] > 0), ("backward", maps.direction[:, i] < 0)]
        directions[axis] = maps.sizes(
            sized, maps.complete, sides, _without_position(a, maps.z[:, i], maps.complete), unit
        )
    norm, whole = np.sqrt(np.mean(maps.white**2, axis=1)), np.any(maps.usable, axis=1)
    ambient = regions_of(maps.ambient, "delta_degC") if maps.ambient is not None else []
    located = ResidualLocationEntry(
        excess=maps.excess,
        by_reading=_shared(outputs),
        by_actuator=_shared(actuators),
        coordinates=maps.coordinates(channels),
        by_frequency=frequency_bands(models),
        by_travel=regions,
        by_direction=directions,
        by_time=maps.sizes(norm, whole, maps.times(), norm, "1"),
        by_temperature=maps.sizes(norm, whole, ambient, norm, "1"),
        spectral_lines=[
            row
            for a in models
            for i, (name, unit) in enumerate(zip(channels, units, strict=True))
            if (row := spectral_lines(a.record, i, name, unit))
        ],
        gathered=gathered_residual(models),
        statements=[],
    )
    return located.model_copy(update={"statements": _statements(located)})


def regions_of(values: np.ndarray, unit: str) -> list[tuple[str, np.ndarray]]:
    """The fifths of `values` (n,): their ends as text in `unit`, and which of the values are in each (n,)."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, LOCALISATION.regions + 1)))
    shown = difference(edges, unit)
    shown = np.where(np.abs(shown) < ROUNDING * np.ptp(shown), 0.0, shown)
    return [
        (f"{shown[k]:.4g} ... {shown[k + 1]:.4g} {unit}", (values >= edges[k]) & (values <= edges[k + 1]))
        for k in range(len(edges) - 1)
    ]


def _without_position(values: np.ndarray, d: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """`values` without a polynomial of the position. Where forward motion covers other positions than backward motion, a
    dependence on position would otherwise look like one on direction."""
    size = np.abs(d).max(initial=0.0) or 1.0
    powers = np.vander(d / size, LOCALISATION.position_degree + 1)
    return values - powers @ np.linalg.lstsq(powers[usable], values[usable], rcond=1e-10)[0]


def _shared(parts: list[ResidualPartEntry]) -> list[ResidualPartEntry]:
    """The parts with their shares of the excess, where they make up the whole."""
    total = sum(max(p.excess, 0.0) for p in parts)
    return [p.model_copy(update={"share": max(p.excess, 0.0) / total if total else 0.0}) for p in parts]


class _Maps:
    """All records concatenated, in the coordinates of the readings and of the actuators."""

    def __init__(self, models: list[LtvModel], seed: int) -> None:
        self.models = models
        self.rng = np.random.default_rng(seed)
        self.white, self.residual, self.usable = (
            np.concatenate([getattr(a, name) for a in models]) for name in ("white", "residual", "usable")
        )
        self.z = np.concatenate([a.displacement for a in models])
        self.direction = np.concatenate([a.direction() for a in models])
        self.n = len(self.white)
        self.complete = np.all(self.usable, axis=1)
        given = all(a.record.ambient is not None for a in models)
        self.ambient = np.concatenate([a.record.ambient for a in models]) if given else None
        self.block = _blocks([len(a.white) for a in models])
        self.excess = float(np.sum(self.white**2) / max(self.usable.sum(), 1) - 1)
        coordinates = [equivalent_inputs(a) for a in models]
        self.actuators = np.concatenate([c[0] for c in coordinates])
        self.actuators_white = np.concatenate([c[1] for c in coordinates])
        self.along_each = np.concatenate([c[2] for c in coordinates])

    def sizes(
        self, white: np.ndarray, usable: np.ndarray, cells: list[tuple[str, np.ndarray]], values: np.ndarray, unit: str
    ) -> list[ResidualPartEntry]:
        """The residual in each cell (label, mask), with bootstrap intervals; cells of too few samples are left out."""
        parts = []
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
            parts.append(
                ResidualPartEntry(
                    label=label,
                    excess=excess,
                    ci95=(low, high),
                    share=share,
                    mean=mean,
                    mean_ci95=(bounds[0], bounds[1]),
                    unit=unit,
                    n=n,
                )
            )
        return parts

    def times(self) -> list[tuple[str, np.ndarray]]:
        """Tenths of each record, by the time of the recording."""
        cells, first = [], 0
        for a in self.models:
            n, t = len(a.white), a.record.time
            for part in np.array_split(
                np.arange(n), LOCALISATION.times if not a.poses else min(LOCALISATION.times, max(n // 4, 1))
            ):
                mask = np.zeros(self.n, bool)
                mask[first + part] = True
                unit = "" if a.poses else " s"
                cells.append(
                    (f"{PurePosixPath(a.record.name).name}: {t[part[0]]:.4g} ... {t[part[-1]]:.4g}{unit}", mask)
                )
            first += n
        return cells

    def coordinates(self, channels: tuple[str, ...]) -> CoordinatesEntry:
        """Sparsity of the excess in both kinds of coordinates."""
        w, a, rows = self.white[self.complete], self.actuators_white[self.complete], self.along_each[self.complete]
        total = float(np.sum(w**2) - w.size)
        if total < LOCALISATION.least_excess * np.sqrt(2 * w.size):
            return CoordinatesEntry(participation_ratio={}, explained_by_one={}, located_in=LocatedIn.NO_EXCESS)

        def explained(v: np.ndarray) -> np.ndarray:
            return np.clip((np.sum(v**2, axis=0) - len(w)) / total, 0, 1)

        alone = {
            kind: dict(zip(names, explained(v), strict=True))
            for kind, names, v in (("reading", channels, w), ("actuator", self.models[0].axes, rows))
        }
        ratios = {"reading": _participation(w), "actuator": _participation(a)}
        best = {kind: max(values.values()) for kind, values in alone.items()}
        gap = best["actuator"] - best["reading"]
        if len(channels) == 1:
            kind = LocatedIn.ONE_READING
        elif abs(gap) < LOCALISATION.stands_out:
            kind = LocatedIn.NEITHER
        else:
            kind = LocatedIn.ACTUATOR if gap > 0 else LocatedIn.READING
        return CoordinatesEntry(participation_ratio=ratios, explained_by_one=alone, located_in=kind)


def _blocks(lengths: list[int]) -> np.ndarray:
    """The bootstrap block of each sample, for records of these lengths; blocks of one pose where there are few."""
    size = max(sum(lengths) // LOCALISATION.blocks, 1)
    blocks, first = [], 0
    for n in lengths:
        of_record = np.arange(n) // size
        blocks.append(first + of_record)
        first += of_record.max(initial=-1) + 1
    return np.concatenate(blocks)


def equivalent_inputs(a: LtvModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Static equivalent inputs of the axes for the residual, each (n, n_axes): in SI units, over their standard deviation,
    and the whitened residual projected on the direction of each axis alone."""
    per_noise = np.where(a.usable.any(axis=0), _per_noise(a), 0.0)
    slopes = a.H_f if a.poses else a.steady()[None]
    G = slopes * per_noise[:, None]
    size = np.linalg.norm(G, axis=1, keepdims=True)
    inverse = np.linalg.pinv(G, rcond=1e-6)
    sd = np.linalg.norm(inverse, axis=2)
    values = (inverse @ (a.residual * per_noise)[:, :, None])[:, :, 0]
    white = (inverse @ a.white[:, :, None])[:, :, 0] / np.where(sd > 0, sd, 1.0)
    projected = np.einsum(
        "tia,ti->ta", np.broadcast_to(G / np.where(size > 0, size, 1.0), (len(white), *G.shape[1:])), a.white
    )
    return values, white, projected


def _per_noise(a: LtvModel) -> np.ndarray:
    """Ratio of the rms whitened residual to the rms residual: for white noise the inverse of its standard deviation."""
    plain = np.sqrt(np.sum(np.where(a.usable, a.residual, 0.0) ** 2, axis=0))
    return np.sqrt(np.sum(a.white**2, axis=0)) / np.where(plain > 0, plain, 1.0)


def _participation(w: np.ndarray) -> float:
    """Participation ratio (sum e)^2/sum e^2 of the coordinates' excess squares e: the effective number with excess."""
    e = np.maximum(np.sum(w**2, axis=0) - len(w), 0.0)
    return float(e.sum() ** 2 / np.sum(e**2)) if np.any(e > 0) else float("nan")


def _statements(located: ResidualLocationEntry) -> list[str]:
    """What follows from the parts, in sentences."""
    sentences = []
    if located.by_reading:
        most = max(located.by_reading, key=lambda s: s.share)
        if most.ci95[0] > 0:
            sentences.append(f"{most.label} has {percent(most.share)} of the excess over the noise")
    if there := located.gathered:
        sentences.append(f"{percent(there.share)} of it lies in {there.place}, {there.n} of {there.of} samples")
    kind = located.coordinates.located_in
    if kind in (LocatedIn.ACTUATOR, LocatedIn.READING):
        name, share = max(located.coordinates.explained_by_one[kind].items(), key=lambda item: item[1])
        sentences.append(f"{kind} {name} alone could explain {percent(share)} of it")
    for axis, sides in located.by_direction.items():
        if len(sides) == 2:
            (a, b), (c, d) = sides[0].mean_ci95, sides[1].mean_ci95
            if a > d or c > b:
                gap = sides[0].mean - sides[1].mean
                sentences.append(
                    f"{axis} depends on direction: {gap:.3g} {sides[0].unit} between forward and backward motion"
                )
    return [*sentences, *(f"{line.channel} in {line.record}: {line.statement}" for line in located.spectral_lines)]
