"""Step 6: every hypothesis at once, by the score test.

With r the whitened residual of the fitted structure, J its whitened slopes (prior rows included) and s the slope of
the readings by one amplitude at `off`, for fixed shape,

    s_perp = s - U U's,   z = s_perp'r/|s_perp|,   amplitude = s_perp'r/|s_perp|^2,   J = U (...) with U'U = 1.

Under "nothing left out" the z of all hypotheses are jointly normal with the correlation cos(s_perp, s_perp'); the
largest |z| is judged against simulations of that. |cos| near one says what this record cannot tell apart.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from ctrlgen.diagnosis.selection.candidate_terms import CandidateTerm, Peaks, signal_peaks, signals_along
from ctrlgen.diagnosis.selection.ends_of_readings import ends_of_readings
from ctrlgen.diagnosis.selection.law_terms import LawTerms
from ctrlgen.diagnosis.selection.motion_regions import Along, motion_of, on_either_side, suggested
from ctrlgen.diagnosis.selection.regions import Leftover, Region, find_regions
from ctrlgen.diagnosis.selection.score_gradient import ScoreGradient, Sums, law_terms
from ctrlgen.diagnosis.selection.shown_by_records import moments_of, shown_along_path, spectral_peaks
from ctrlgen.diagnosis.selection.subset_search import SubsetSearch, Suspect
from ctrlgen.diagnosis.settings import CONFUSABLE, SCREEN
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis
from ctrlgen.estimation.law_prior import ACROSS
from ctrlgen.recordings.recording import Timing

Subsets = tuple[tuple[float, tuple[Suspect, ...]], ...]


@dataclass(frozen=True, eq=False)
class Screened:
    """Suspects, the most conspicuous first; `cosine` between their projected slopes; `amplitude_sd` [SI] of each;
    `undetectable` the hypotheses that this record cannot see, with the free number (its place in the fit's slopes)
    whose own effect looks most like theirs, -1 where they do not reach the readings at all; `twins` the hypotheses whose effect is
    that of a free number but for a factor, with the number and where they do what it does now; `dropped` the hypotheses whose law
    could not be evaluated, with the reason; `regions` where most of what is left is. What few screens are asked for is computed when it
    is: `threshold` by `by_chance`, `subsets` by `together`, `moves` of the threshold by `moved`."""

    suspects: tuple[Suspect, ...]
    cosine: np.ndarray
    by_chance: Callable[[], float]
    amplitude_sd: dict[tuple[str, str], float]
    together: Callable[[], Subsets] = tuple
    undetectable: dict[Hypothesis, int] = field(default_factory=dict)
    twins: dict[Hypothesis, tuple[int, dict[str, float]]] = field(default_factory=dict)
    dropped: dict[Hypothesis, str] = field(default_factory=dict)
    regions: dict[Along, tuple[Region, ...]] = field(default_factory=dict)
    moved: Callable[[float], np.ndarray] = field(default=lambda _: np.zeros(0))

    @cached_property
    def threshold(self) -> float:
        """The |z| that a record without mismatch exceeds with one percent chance, anywhere among all hypotheses."""
        return self.by_chance()

    @cached_property
    def subsets(self) -> Subsets:
        """Sets of two to four suspects that would jointly explain most, with the chi^2 they would: causes can hide each other."""
        return self.together()

    @cached_property
    def moves(self) -> np.ndarray:
        """By how much each free number of the fit would move (k,) [SI], at most, with one of the suspects beyond the threshold beside what
        is there."""
        return self.moved(self.threshold)


class Screen:
    """The hypotheses of one fitter, ready to be compared with any fit."""

    def __init__(self, fitter: Fitter, hypotheses: list[Hypothesis], seed: int = 0) -> None:
        self.fitter, self.hypotheses, self.seed = fitter, hypotheses, seed
        self.stated = tuple(hypotheses)
        self.peaks: Peaks | None = None
        self.motion: dict[Along, np.ndarray] = {}
        self.laws: dict[Timing, LawTerms] = {}

    def without(self, barred: Callable[[Hypothesis], bool]) -> Screen:
        """The same screen, its laws as compiled, that suspects none of those `barred`."""
        part = copy.copy(self)
        part.hypotheses = [h for h in self.hypotheses if not barred(h)]
        return part

    def in_regions(self, fit: Fit, locations: Collection[str]) -> Screened:
        """The laws in a region at `locations`, their edges at quantiles of the motion, whether or not a region stands out there."""
        self._follow(fit)
        regional = [h for h in self.hypotheses if h.prior.in_a_region and h.location in locations]
        part = Screen(self.fitter, regional, self.seed)
        part.peaks, part.motion = self.peaks, self.motion
        return part.run(fit, regions=on_either_side(self.motion))

    def run(
        self,
        fit: Fit,
        dropped: dict[Hypothesis, str] | None = None,
        regions: dict[Along, tuple[Region, ...]] | None = None,
        threshold: float | None = None,
    ) -> Screened:
        """All hypotheses that the fit does not contain yet, without those `dropped`, any whose law cannot be evaluated, and what no
        term of the model shows: offsets of the recorders' clocks, shifts that the file has, zeros of each record. Laws in a region are
        begun in the `regions`, those of what is left unless given. With the `threshold`, where another screen has told it, each is
        looked at alone: no sets."""
        beside, dropped = (h.beside(fit.structure.causes) for h in self.hypotheses), dropped or {}
        shown = (h for h in beside if h is not None and not _unseen(h))
        open_ = [h for h in shown if h not in dropped]
        sums: Sums | None = None
        columns: list[CandidateTerm] = []
        U, back = _directions(fit.J)
        regions = self._regions(fit) if regions is None else regions
        first, seen = 0, self.data_hints(fit, regions)
        for record, start in zip(
            self.fitter.fit_records, fit.initial_states or [None] * len(self.fitter.fit_records), strict=True
        ):
            slopes = ScoreGradient(self.fitter, fit, record, open_, seen, self._laws(fit, record.timing))
            # the columns must be the same on every record
            if slopes.laws.unusable:
                return self.run(fit, dropped | slopes.laws.unusable, regions, threshold)
            columns = slopes.columns
            n = record.valid.size
            white = fit.residual[first : first + n].reshape(record.valid.shape)
            free = U[first : first + n].reshape(*record.valid.shape, -1)
            first += n
            here = slopes.sums(white, free, start, each_alone=threshold is not None)
            sums = here if sums is None else sums.plus(here)
        if not columns or sums is None:
            none = np.zeros(len(fit.theta))
            return Screened((), np.zeros((0, 0)), lambda: np.inf, {}, dropped=dropped, moved=lambda _: none)
        size = np.linalg.norm(fit.J[:first], axis=0)
        along = (back @ sums.US) / np.maximum(size, 1e-150)[:, None]
        screened = self._screened(columns, sums, U.T @ fit.residual, np.abs(along), threshold)
        free_numbers = fit.structure.free_parameters
        sizes = {k: v - u.nominal for k, (u, v) in enumerate(zip(free_numbers, fit.theta, strict=True)) if u.amplitude}
        if threshold is not None:
            return replace(screened, dropped=dropped, regions=regions)
        twins = self._twins(columns, {k: size[k] * change for k, change in sizes.items()}, along, sums.SS)
        moved = partial(_moves, screened.suspects, sums.squares.copy(), sums.US, back, len(fit.theta))
        return replace(screened, twins=twins, dropped=dropped, regions=regions, moved=moved)

    def _twins(
        self, columns: list[CandidateTerm], does: dict[int, float], along: np.ndarray, SS: np.ndarray
    ) -> dict[Hypothesis, tuple[int, dict[str, float]]]:
        """The hypotheses whose slopes, of the products `SS` (columns, columns), are that of the size of one cause but for a factor, or make
        it up where there are no more of them than the law has numbers, the likest first: the place of the size among the free numbers,
        and a start at which they do what it does now. `does` is the length of that by place, `along` J's/|J| (free numbers, columns)."""
        by_hypothesis: dict[Hypothesis, list[int]] = {}
        for j in np.flatnonzero(np.diag(SS) > 0).tolist():
            if not columns[j].hypothesis.prior.in_a_region:
                by_hypothesis.setdefault(columns[j].hypothesis, []).append(j)
        found: dict[Hypothesis, tuple[float, int, dict[str, float]]] = {}
        for h, js in by_hypothesis.items():
            together = h.effect != PARAMETER and 1 < len(js) <= len(h.law.params)
            for k, length in does.items():
                cosine = np.abs(along[k, js]) / np.sqrt(np.diag(SS)[js])
                best, likeness = js[int(np.argmax(cosine))], float(cosine.max())
                if together:
                    part = np.linalg.lstsq(SS[np.ix_(js, js)], along[k, js], rcond=SCREEN.free_direction)[0]
                    likeness = float(np.sqrt(max(part @ along[k, js], 0.0)))
                if likeness < CONFUSABLE.cosine or (h in found and likeness <= found[h][0]):
                    continue
                # a residual falls with what the model adds
                column, amplitude = columns[best], -float(length / along[k, best])
                if column.range[0] <= amplitude <= column.range[1]:
                    found[h] = likeness, k, _suspect(column, 0.0, amplitude, 0.0, best).start
        return {h: (k, start) for h, (_, k, start) in sorted(found.items(), key=lambda f: -f[1][0])}

    def _laws(self, fit: Fit, timing: Timing) -> LawTerms:
        """The terms of the hypotheses' laws for records of one timing."""
        if timing not in self.laws:
            channels = self.fitter.recording.channels
            samples = sum(len(r.time) for r in self.fitter.fit_records if r.timing == timing)
            self.laws[timing] = law_terms(fit.structure.device, self.stated, channels, timing, samples)
        return self.laws[timing]

    def _follow(self, fit: Fit) -> Peaks:
        """How far the signals at every place go; with the motion along which regions are sought."""
        if self.peaks is None:
            signals = signals_along(self.fitter, fit)
            self.peaks = signal_peaks(signals)
            self.motion = motion_of(self.fitter, fit, signals)
        return self.peaks

    def data_hints(
        self, fit: Fit, regions: dict[Along, tuple[Region, ...]] | None = None
    ) -> Callable[[Place, int], DataHints]:
        """What the records show at each place, after what `fit` explains; `regions` of what is left, where they are known already."""
        regions = self._regions(fit) if regions is None else regions
        most = self._follow(fit)
        steps, across = (self._begins_at(hint, fit) for hint in ("drive_levels", ACROSS))
        along = shown_along_path(self.fitter, fit, steps=steps, across=across)
        ends = ends_of_readings(self.fitter, fit)
        moments, part = moments_of(self.fitter.recording)
        common = {"lines": spectral_peaks(self.fitter, fit), "moments": moments}

        def at(place: Place, i: int) -> DataHints:
            return DataHints(
                most.get((place, i), {}) | {"s": part},
                common | along.get((place, i), {}) | ends.get((place, i), {}) | suggested(regions, place, i),
                SCREEN.event_times * part,
            )

        return at

    def _begins_at(self, hint: str, fit: Fit) -> bool:
        """Whether a law that is suspected, and not in the fit, begins at this that the records show."""
        return any(
            number.start_from_data == hint
            for h in self.hypotheses
            if h not in fit.structure.causes
            for number in h.prior.parameters.values()
        )

    def _regions(self, fit: Fit) -> dict[Along, tuple[Region, ...]]:
        """The regions in which most of what is left is."""
        self._follow(fit)
        if not self.motion:
            return {}
        sought = {key: x for key, x in self.motion.items() if key[:2] != ("position", Place.SENSOR)}
        stretches = [key for key in sought if key[0] == "stretch"]
        return find_regions(Leftover.of(fit), sought, stretches, self.seed)

    def _screened(
        self,
        columns: list[CandidateTerm],
        sums: Sums,
        gradient: np.ndarray,
        likeness: np.ndarray,
        threshold: float | None = None,
    ) -> Screened:
        """`gradient` U'r (k,), zero at an optimum inside all bounds; `likeness` |J's|/|J| (free numbers, columns)."""
        # what does nothing at its largest amplitude, such as a lag in settled poses, leaves rounding
        largest = np.array([max(map(abs, c.range)) for c in columns])
        norm = np.where(sums.squares > (SCREEN.least_reach / largest) ** 2, sums.squares, 0.0)
        distinct = norm - np.sum(sums.US**2, axis=0)
        score = sums.Sr - gradient @ sums.US
        distinct_share = np.where(norm > 0, distinct / np.where(norm > 0, norm, 1.0), 0.0)
        seen = np.flatnonzero((distinct_share > SCREEN.own_share) & (norm > 0) & np.isfinite(norm))
        z = np.zeros(len(columns))
        z[seen] = score[seen] / np.sqrt(distinct[seen])
        for j in seen:
            if columns[j].one_sided and z[j] * columns[j].one_sided < 0:
                z[j] = 0.0
        ranked: dict[Hypothesis, list[int]] = {}
        for j in sorted(seen, key=lambda j: -abs(z[j])):
            ranked.setdefault(columns[j].hypothesis, []).append(int(j))
        order = [js[0] for js in ranked.values()]
        suspect = {j: _suspect(columns[j], z[j], score[j] / distinct[j], distinct_share[j], j) for j in map(int, seen)}
        suspects = tuple(
            replace(suspect[j], other_starts=tuple(suspect[i].start for i in others[: SCREEN.most_other_starts]))
            for j, *others in ranked.values()
        )
        sds = {
            (columns[j].hypothesis.effect, columns[j].hypothesis.location): float(
                columns[j].size / np.sqrt(distinct[j])
            )
            for j in order
        }
        resembles = np.argmax(likeness, axis=0) if len(likeness) else np.full(len(columns), -1)
        undetectable = {c.hypothesis: int(resembles[j]) if norm[j] > 0 else -1 for j, c in enumerate(columns)}
        undetectable = {h: k for h, k in undetectable.items() if h not in ranked}
        if threshold is not None:
            return Screened(suspects, np.zeros((0, 0)), lambda: threshold, sds, undetectable=undetectable)
        gram = sums.SS - sums.US.T @ sums.US
        d = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        cosine = np.clip(gram / np.outer(d, d), -1, 1)
        # a law in a region is tried alone: there are many, and each looks like the law everywhere
        everywhere = np.array([j for j in seen if not columns[j].hypothesis.prior.in_a_region], int)

        def together() -> Subsets:
            return SubsetSearch(columns, everywhere, score, distinct, distinct_share, cosine, _suspect).search()

        by_chance = partial(_largest_by_chance, cosine, seen, self.seed)
        return Screened(suspects, cosine, by_chance, sds, together, undetectable)


def _unseen(h: Hypothesis) -> bool:
    """Whether no slope of the model shows a hypothesis."""
    return h.shifts if h.effect == PARAMETER else h.law.shifts_drive or h.prior.of_each_record


def _suspect(column: CandidateTerm, z: float, amplitude: float, distinct_share: float, j: int) -> Suspect:
    h = column.hypothesis
    if h.effect == PARAMETER:
        start = {"value": column.shape["value"] + amplitude * column.size}
    else:
        start = {**column.shape, h.law.amplitude().name: amplitude * column.size}
    return Suspect(h, start, float(z), float(distinct_share), j)


def _largest_by_chance(cosine: np.ndarray, seen: np.ndarray, seed: int) -> float:
    """The 99th percentile of the largest |z| among those `seen` when nothing was left out."""
    if not len(seen):
        return np.inf
    values, vectors = np.linalg.eigh(cosine[np.ix_(seen, seen)])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    draws = np.random.default_rng(seed).standard_normal((SCREEN.null_draws, len(seen)))
    return float(np.quantile(np.abs(draws @ root.T).max(axis=1), SCREEN.false_alarm_quantile))


def _moves(
    suspects: Sequence[Suspect], norm: np.ndarray, US: np.ndarray, back: np.ndarray, n: int, threshold: float
) -> np.ndarray:
    """The largest change (n,) of each of the first n free numbers when one law everywhere that is suspected beyond the threshold joins the
    fit at its best amplitude a: dx = J+ s a. What the number itself hardly differs from is told as its alternative instead. `norm` s's
    (m,), `US` U's."""
    own = 1 - CONFUSABLE.cosine**2
    loud = [
        s for s in suspects if abs(s.z) > threshold and s.distinct_share > own and not s.hypothesis.prior.in_a_region
    ]
    at = [s.index for s in loud]
    distinct = norm[at] - np.sum(US[:, at] ** 2, axis=0)
    amplitudes = np.array([s.z for s in loud]) / np.sqrt(distinct)
    return np.abs(np.linalg.pinv(back.T) @ (US[:, at] * amplitudes)).max(axis=1, initial=0.0)[:n]


def _directions(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """U (N, k), orthonormal, that spans the slopes J (N, n) of the free numbers, and `back` (n, k) with J = U back'."""
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0] = 1.0
    U, s, V = np.linalg.svd(J / scale, full_matrices=False)
    kept = s > SCREEN.free_direction * s.max(initial=0.0)
    return U[:, kept], scale[:, None] * (V.T * s)[:, kept]
