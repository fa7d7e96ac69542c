"""Along the path: after which ways what is left over repeats, as fringes, teeth and screws do, and where it jumps.

The path is what was read, which is right where the device is not yet understood, or what was foreseen, which does not
drift with the sensor.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ctrlgen.diagnosis.settings import SPATIAL_PERIODS
from ctrlgen.numerics.spectral_peaks import highest_peaks, periodogram, vertex


def spatial_periods(path: np.ndarray, left: np.ndarray, shortest: float = 0.0) -> tuple[float, ...]:
    """The ways [path's unit] after which `left` (n,) repeats along `path` (n,), the most conspicuous first; none below
    `shortest`, nor below what the samples along the path resolve (`resolved_way`).

    From |sum left exp(-2 pi i path/way)|^2 over its mean where nothing repeats, in units of which it is exponential. Each wave is
    taken out before the next is sought, so that neither its side lobes nor its images in the sampling come again (D. H. Roberts
    et al., Astron. J. 93 (1987) 968). A place where the path stands counts no more than twice as much as others do.
    """
    span = float(np.ptp(path))
    if span == 0:
        return ()
    n, padding = SPATIAL_PERIODS.cells, SPATIAL_PERIODS.padding
    cell = _cells(path, n)
    count = np.bincount(cell, minlength=n)
    weight = np.minimum(1.0, 2 * np.median(count[count > 0]) / count[cell])
    rest = left - np.average(left, weights=weight)
    if not np.any(rest):
        return ()
    shortest = max(shortest, resolved_way(path), SPATIAL_PERIODS.finest_cells * span / n)
    fast, slow, last = SPATIAL_PERIODS.fewest_cycles, SPATIAL_PERIODS.fewest_slow_cycles, int(span / shortest)
    found: list[float] = []
    for first, beyond, most in ((fast, last, SPATIAL_PERIODS.most), (slow, min(fast, last), SPATIAL_PERIODS.most_slow)):
        for _ in range(most if beyond > first else 0):
            along = np.bincount(cell, weights=weight * rest, minlength=n)
            power = periodogram(along, padding=padding) / np.sum((weight * rest) ** 2)
            cycles = _strongest(power, first, beyond, found)
            if cycles is None:
                break
            found.append(cycles)
            rest = _without_wave((path - np.mean(path)) / span, cycles, rest, weight)
    return tuple(span / cycles for cycles in found)


def slowest_periods(path: np.ndarray, left: np.ndarray, typical: float) -> tuple[float, ...]:
    """The way [path's unit] of few cycles over `path` (n,) of which a wave beside a straight line takes most from `left` (n,), each place
    counted once however long it was visited. None where the path is not short beside the `typical` size, of which the start values of the
    laws are shares: a spectrum does not tell so few cycles from a trend."""
    span = float(np.ptp(path)) if len(path) else 0.0
    if not 0 < span < SPATIAL_PERIODS.short_path * typical:
        return ()
    n = SPATIAL_PERIODS.jump_cells
    cell = _cells(path, n)
    count = np.bincount(cell, minlength=n)
    read = np.flatnonzero(count)
    mean, place = np.bincount(cell, weights=left, minlength=n)[read] / count[read], read / n
    least, best = np.inf, 0.0
    for cycles in np.linspace(*SPATIAL_PERIODS.slowest_cycles, SPATIAL_PERIODS.slowest_tried).tolist():
        angle = 2 * np.pi * cycles * place
        columns = np.column_stack([np.ones(len(place)), place, np.cos(angle), np.sin(angle)])
        rest = mean - columns @ np.linalg.lstsq(columns, mean, rcond=None)[0]
        if (squares := float(rest @ rest)) < least:
            least, best = squares, cycles
    return (span / best,)


def _strongest(power: np.ndarray, first: int, beyond: int, found: list[float]) -> float | None:
    """Cycles within the path of the highest peak of `power` between two numbers of them, apart from those `found`; None where
    chance would show one as high."""
    padding = SPATIAL_PERIODS.padding
    power = power[padding * first : padding * beyond].copy()
    for cycles in found:
        power[max(int(padding * (cycles - 2 - first)), 0) : max(int(padding * (cycles + 2 - first)) + 1, 0)] = 0.0
    least = float(np.log(len(power) / SPATIAL_PERIODS.false_alarm_p))
    best = highest_peaks(power, 1, distance=2 * padding, height=least)
    return first + (int(best[0]) + vertex(power, int(best[0]))) / padding if len(best) else None


def resolved_way(path: np.ndarray) -> float:
    """The shortest way [path's unit] that samples along `path` (n,) tell from its images; zero where they tell any.

    Samples at even distances tell none below two distances. In general their places repeat after a way where
    |sum exp(-2 pi i place/way)|^2, each place counted once however often it was visited, comes back to nearly its first value,
    and twice that is the shortest. Uneven places do not repeat. What is left differs by the direction of motion where anything
    lags, so that the places of one do not fill the gaps of the other.
    """
    span = float(np.ptp(path))
    if span == 0:
        return 0.0
    n, padding = SPATIAL_PERIODS.image_cells, 2
    cell, ahead = _cells(path, n), np.gradient(path) > 0
    power, whole = np.zeros(padding * n // 2 + 1), 0.0
    for visited in (cell[ahead], cell[~ahead]):
        places = np.zeros(n)
        places[visited] = 1.0
        power += periodogram(places, padding=padding)
        whole += np.sum(places) ** 2
    # what the width of a cell takes away
    power /= whole * np.sinc(np.arange(len(power)) / (padding * n)) ** 2
    first = padding * SPATIAL_PERIODS.fewest_cycles
    repeating = np.flatnonzero(power[first:] > SPATIAL_PERIODS.image)
    return 2 * padding * span / float(first + repeating[0]) if len(repeating) else 0.0


def _cells(path: np.ndarray, n: int) -> np.ndarray:
    """In which of n equal cells of the path each sample is."""
    return np.minimum(((path - path.min()) / np.ptp(path) * n).astype(int), n - 1)


def _without_wave(place: np.ndarray, cycles: float, values: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """`values` (n,) without the wave of so many cycles over the path that suits them best, its amplitude and phase linear in the
    `place`: the frequency of a peak is not exact."""
    angle = 2 * np.pi * cycles * place
    wave = np.column_stack([np.cos(angle), np.sin(angle)])
    columns = np.column_stack([np.ones(len(angle)), wave, place[:, None] * wave])
    root = np.sqrt(weight)
    return values - columns @ np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0]


def merged_periods(periods: Iterable[tuple[float, ...]]) -> tuple[float, ...]:
    """The ways along several paths, such as the one read and the one foreseen, each once."""
    kept: list[float] = []
    for way in (way for ways in periods for way in ways):
        if all(abs(way / other - 1) > SPATIAL_PERIODS.same_period for other in kept):
            kept.append(way)
    return tuple(kept)


def jump_positions(path: np.ndarray, left: np.ndarray) -> tuple[float, ...]:
    """The places [path's unit] at which the mean of `left` (n,) on both sides differs most, apart from its usual slope."""
    span = float(np.ptp(path))
    if span == 0:
        return ()
    n, side = SPATIAL_PERIODS.jump_cells, SPATIAL_PERIODS.jump_side
    cell = _cells(path, n)
    count = np.bincount(cell, minlength=n)
    total = np.bincount(cell, weights=left, minlength=n)
    read = np.flatnonzero(count)
    mean = np.interp(np.arange(n), read, total[read] / count[read])
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    step = (sums[2 * side :] - 2 * sums[side:-side] + sums[: -2 * side]) / side
    step = np.abs(step - np.median(step))
    best = highest_peaks(np.concatenate([[0.0], step, [0.0]]), SPATIAL_PERIODS.most, distance=side) - 1
    return tuple(float(path.min() + (k + side) / n * span) for k in best)
