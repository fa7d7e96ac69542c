"""What each contributor does to the pose along a path, its share, and what is left where sds are halved: the lines of an error budget."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.budget.linear import Propagated
from ctrlgen.budget.monte_carlo import Drawn
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.core.units import difference, same_dimension
from ctrlgen.devices import Signal

JITTER_STEP = 1e-6  # s


@dataclass(frozen=True)
class Group:
    """Channels of the followed signal with one kind of unit: translations in nm, rotations in urad."""

    name: str
    unit: str
    channels: tuple[int, ...]

    def shown(self, si: float) -> float:
        """An SI difference in the unit of the group."""
        return float(difference(si, self.unit))


@dataclass(frozen=True)
class BudgetLine:
    """One contributor. By group, SI: `sensitivity`, the largest deviation along the path for the step `per`; `peak` and `rms`, its
    standard uncertainty there; `alone`, what its second order adds at one sd.

    `shares`: by how much the variance, its mean along the path over all channels of a group, falls without it, by group; `share`: of the
    group in which it counts most; `halved`: the combined peak [SI, by group] if its sd and those of all before it were half. `called`
    is its name and, of a number in a list of tables, that of its table.
    """

    name: str
    called: str
    sd: str
    per: str
    source: str
    sensitivity: dict[str, float]
    peak: dict[str, float]
    rms: dict[str, float]
    shares: dict[str, float]
    halved: dict[str, float]
    alone: dict[str, float]

    @property
    def share(self) -> float:
        """Of the group in which it counts most; never below zero, as it is where two correlated numbers work against each other."""
        return max([0.0, *self.shares.values()])


def groups_of(signal: Signal) -> tuple[Group, ...]:
    """Channels of a signal by kind: translations in nm, rotations in urad, and what has another unit in that."""
    units: dict[tuple[str, str], list[int]] = {}
    for i, unit in enumerate(signal.units):
        kinds = (("translation", "nm", "m"), ("rotation", "urad", "rad"))
        name, shown = next(((n, s) for n, s, base in kinds if same_dimension(unit, base)), (f"in {unit}", unit))
        units.setdefault((name, shown), []).append(i)
    order = sorted(units, key=lambda key: key[0] != "translation")
    return tuple(Group(*key, tuple(units[key])) for key in order)


def rms(values: np.ndarray) -> float:
    """Root mean square of (n, channels) along the path, of the channel where it is largest."""
    return float(np.sqrt(np.mean(values**2, axis=0)).max())


def largest(values: np.ndarray, group: Group) -> float:
    """The largest of (n, channels) in size, in a channel of a group."""
    return float(np.abs(values[:, group.channels]).max())


@dataclass(frozen=True)
class _Seen:
    """One contributor by itself: what it is called, the columns of the covariance or the name of what scatters, and, each (n, channels)
    [SI], its deviation for one step, its standard uncertainty, its second order."""

    name: str
    texts: tuple[str, str, str]
    columns: slice | None
    scatters: str | None
    by_step: np.ndarray
    deviation: np.ndarray
    bend: np.ndarray


def budget_lines(
    path: UncertainPath, linear: Propagated, groups: tuple[Group, ...], drawn: Drawn | None
) -> tuple[BudgetLine, ...]:
    """Every contributor, the largest share first."""
    combination = _Combination(path, linear)
    whole = combination.of([], 0.0)
    seen = [*_numbers(path, linear, drawn), *_scattering(path, linear)]
    shares = {one.name: _shares(whole, combination.of([one], 0.0), groups) for one in seen}
    seen.sort(key=lambda one: -max([0.0, *shares[one.name].values()]))
    lines = []
    for rank, one in enumerate(seen, 1):
        half = combination.of(seen[:rank], 0.5)
        by_group = {
            "sensitivity": {g.name: largest(one.by_step, g) for g in groups},
            "peak": {g.name: largest(one.deviation, g) for g in groups},
            "rms": {g.name: rms(one.deviation[:, g.channels]) for g in groups},
            "halved": {g.name: largest(half, g) for g in groups},
            "alone": {g.name: largest(one.bend, g) for g in groups},
            "shares": shares[one.name],
        }
        sd, per, source = one.texts
        lines.append(BudgetLine(one.name, path.model.device.called(one.name), sd, per, source, **by_group))
    return tuple(lines)


def _numbers(path: UncertainPath, linear: Propagated, drawn: Drawn | None) -> Iterator[_Seen]:
    Y, first = linear.sensitivity["pose"], 0
    for uncertain in path.uncertainties.lines:
        columns = slice(first, first + len(uncertain.sds))
        first = columns.stop
        deviation = np.sqrt(np.sum((Y[:, :, columns] * uncertain.sds) ** 2, axis=2))
        by_step = np.abs(Y[:, :, columns] * uncertain.per[1]).max(axis=2)
        bend = np.zeros((1, Y.shape[1]))
        if drawn is not None:  # of several columns the one that bends most
            bend = np.abs(drawn.alone[:, columns].sum(axis=0) / 2).max(axis=0)
        texts = uncertain.text, uncertain.per[0], uncertain.source
        yield _Seen(uncertain.name, texts, columns, None, by_step, deviation, bend)


def _scattering(path: UncertainPath, linear: Propagated) -> Iterator[_Seen]:
    stated = path.uncertainties
    for name, deviation in linear.scatter["pose"].items():
        per, by_step = _by_step(path, linear, name, deviation)
        texts = stated.texts[name], per, stated.sources[name]
        yield _Seen(f"drive.{name}", texts, None, name, by_step, deviation, np.zeros_like(deviation))


def _shares(combined: np.ndarray, without: np.ndarray, groups: tuple[Group, ...]) -> dict[str, float]:
    """By how much the variance of each group falls without it; 0 in a group that nothing moves."""
    total = {g.name: float(np.sum(combined[:, g.channels] ** 2)) for g in groups}
    left = {g.name: float(np.sum(without[:, g.channels] ** 2)) for g in groups}
    return {name: 1 - left[name] / whole if whole else 0.0 for name, whole in total.items()}


class _Combination:
    """The combined standard uncertainty with some sds changed."""

    def __init__(self, path: UncertainPath, linear: Propagated) -> None:
        self.linear, self.covariance = linear, path.uncertainties.covariance

    def of(self, changed: Sequence[_Seen], factor: float) -> np.ndarray:
        """The combined uncertainty (n, channels) [SI] with the standard deviations of what is `changed` times `factor`."""
        Y, scale = self.linear.sensitivity["pose"], np.ones(len(self.covariance))
        for one in changed:
            if one.columns is not None:
                scale[one.columns] = factor
        variance = np.maximum(np.sum((Y @ (self.covariance * np.outer(scale, scale))) * Y, axis=2), 0.0)
        scattering = {one.scatters for one in changed}
        for name, sd in self.linear.scatter["pose"].items():
            variance = variance + (sd * (factor if name in scattering else 1.0)) ** 2
        return np.asarray(np.sqrt(variance))


def _by_step(path: UncertainPath, linear: Propagated, name: str, deviation: np.ndarray) -> tuple[str, np.ndarray]:
    """Text and deviation (n, channels) of one step: of a converter and of arithmetic the path under the rounded drives."""
    if name == "jitter":
        return "1 us", deviation / path.uncertainties.jitter * JITTER_STEP
    if name == "player":
        return "tolerance", deviation * np.sqrt(3)
    single = path.drive.astype(np.float32).astype(float)
    rounded = path.nominal(path.rounded() if name == "converter" else single)
    pose = path.evaluate("pose", rounded[path.before :], path.drive[path.before :])
    return "1 LSB" if name == "converter" else "rounding", pose - linear.nominal["pose"]
