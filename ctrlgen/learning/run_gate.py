"""Whether runs belong together: the same zero, the same clock, the same path; what of that can be told is taken out and named.

Two runs show the same beyond the model, D_j = y_j - y(u_j), but for what their noise and the answer of the device to other drives make
of it. What a run shows against another one is therefore regressed, over all samples and channels, on

    D_j - D_i = z + g (y(u_j) - y(u_i)) - tau dy/dt + e,

a zero z in each channel, the answer g, and a time tau by which it came late, with standard errors that hold for correlated e
(`ctrlgen.learning.response.regressed`). Zeros count from the first run, the clock from the run whose own deviation from the model is
least late, or from the middle one of three and more. What is left, e, is small where both are runs of one path on one stage.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.budget.sensor_statement import SensorStatement
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import show
from ctrlgen.learning.hidden_parts import hidden_by
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.response import regressed
from ctrlgen.learning.runs import Run, Runs, errors, in_time, root_mean_square
from ctrlgen.learning.sensor_budget import rate_of
from ctrlgen.learning.steady_drift import SURE

LEAST_LATE = 0.1
"""Samples: a delay below it moves a path by less than what sampling leaves of its time."""
ANSWER = 0.1
"""Share of a change of drives by which the device may answer otherwise: no more of it is taken for a zero or a delay. As
`LearningOptions.mismatch`."""
OUT_OF_TIME = 1.0
"""Samples from which on it is told that the first run comes late: two of the standard deviations that are assumed of a clock."""
MOSTLY = 0.7
"""Of what a run shows beyond the model, rms, that one constant makes for it to be told: half of its square."""
FOREIGN = 0.05
"""Of the path's extent, that two runs of it may differ by beyond zero, clock, drives and noise. Judgement: friction leaves less."""
OF_CHANGE = 2.5
"""Times what the change of drives moves the model by: a reversed actuator makes twice that, and is named by its answer."""
OF_ERROR = 0.5
"""Of what the one of both shows beyond the model that shows less. Judgement: an error that does not repeat to half teaches nothing."""
OF_NOISE = 4.0
"""Times the noise of both means. Judgement: noise that is slower than a period is told from few of them."""


@dataclass(frozen=True)
class _Seen:
    """What one run shows beyond the model, in typical sizes: `off` (n, n_y), the model's own run `model` (n, n_y), the noise of the mean
    (n_y,), and `late` [s], how late it is against the model."""

    off: np.ndarray
    model: np.ndarray
    noise: np.ndarray
    late: float


def belonging(runs: Runs, lifted: Lifted, source: str) -> Runs:
    """The runs with one zero and one clock; notes name what was taken out. Raises InputError for runs that are not of the same path."""
    if len(runs.runs) < 2:
        return runs
    scale, names = np.array(lifted.signal.scale), lifted.signal.channels
    seen = [_seen(run, runs, lifted) for run in runs.runs]
    late, i_clock = np.array([s.late for s in seen]), 0
    if not lifted.static:
        i_clock = int(np.argmin(np.abs(late - (np.median(late) if len(seen) > 2 else 0.0))))
    kept, notes, faults = list(runs.runs), list(runs.notes), list[Fault]()
    zeros, delays = np.zeros((len(seen), len(names))), np.zeros(len(seen))
    i_path = _typical(seen, runs, lifted)
    for j, run in enumerate(runs.runs):
        left = _against(seen[j], seen[i_path], runs, lifted)[2]
        if j != i_path and (share := _foreign(seen[j], seen[i_path], left, lifted)):
            what = (
                f"what it reads differs from {runs.runs[i_path].name} by {100 * share:.0f} % of the path's extent, beyond zero, clock and "
                "drives: it is of another path, or the stage was changed between them; leave out the one that does not belong here"
            )
            faults.append(Fault(run.name, what))
            continue
        tau, y = _against(seen[j], seen[i_clock], runs, lifted)[1], run.y
        if tau:
            y = in_time(run, lifted, np.full(len(names), tau))
            notes.append(
                f"{run.name}: its readings come {abs(tau) / lifted.sample_time:.2f} samples {'later' if tau > 0 else 'earlier'} than those "
                f"of {runs.runs[i_clock].name}; taken out. Look at what starts the recording."
            )
        zeros[j] = _against(seen[j], seen[0], runs, lifted)[0] * scale
        if zeros[j].any():
            off = ", ".join(
                f"{c} by {show(z, u)}" for c, z, u in zip(names, zeros[j], lifted.signal.units, strict=True) if z
            )
            notes.append(
                f"{run.name}: its zero is off that of {runs.runs[0].name}, {off}; taken out. A drift of sensor or stage is not learnt."
            )
        kept[j], delays[j] = replace(run, y=y - zeros[j]), tau
    if faults:
        raise InputError(source, faults)
    untold = (zeros != 0) | _at_odds(seen, zeros != 0, runs, lifted)
    for j, zero in enumerate(untold):
        rate = np.zeros(seen[j].model.shape) if lifted.static else rate_of(lifted, seen[j].model)
        kept[j] = replace(kept[j], hidden=hidden_by(zero, delays[j], rate * runs.observed))
    return replace(runs, runs=tuple(kept), notes=tuple(notes))


def granted(runs: Runs, lifted: Lifted, stated: SensorStatement) -> list[str]:
    """What of the first run is believed to be the stage's though a sensor of which nothing is `stated` makes the like: one constant along
    the whole path, and readings that come later, or sooner, than the device as described makes of its drives."""
    if stated.scale or stated.zero or stated.clock:
        return []
    run, signal = runs.runs[0], lifted.signal
    first, size = _seen(run, runs, lifted), np.array(signal.scale)
    constant, whole, words = first.off.mean(axis=0), np.sqrt(np.mean(first.off**2, axis=0)), list[str]()
    if of := [
        f"{c} by {show(d, u)}"
        for c, u, d, share, noise in zip(
            signal.channels,
            signal.units,
            constant * size,
            abs(constant) / np.maximum(whole, 1e-300),
            first.noise * size,
            strict=True,
        )
        if share > MOSTLY and abs(d) > SURE * noise
    ]:
        words.append(
            f"{run.name}: its readings are off the device as described by one constant along the path, {', '.join(of)}: taken for the "
            "stage's. A sensor that tells changes alone has no zero of the path: state [sensor.zero] in uncertainty.toml."
        )
    if abs(samples := first.late / lifted.sample_time) > OUT_OF_TIME:
        words.append(
            f"{run.name}: its readings come {abs(samples):.1f} samples {'later' if samples > 0 else 'sooner'} than the device as described "
            "makes of its drives, as of a recording that was started so; taken for the stage's. Look at what starts the recording, or "
            "state [sensor] clock in uncertainty.toml."
        )
    return words


def _at_odds(seen: list[_Seen], known: np.ndarray, runs: Runs, lifted: Lifted) -> np.ndarray:
    """(runs, n_y) where a later run has another zero than a further one whose drives are so near that no answer of the device explains it,
    although neither is `known` to be off the first: of both that one which is at odds with more runs, and both where these are as many."""
    odds = np.zeros((len(seen), len(seen), known.shape[1]), bool)
    for j in range(2, len(seen)):
        for i in range(1, j):
            odds[i, j] = odds[j, i] = (_against(seen[j], seen[i], runs, lifted)[0] != 0) & ~known[i] & ~known[j]
    count = odds.sum(axis=1)
    return np.asarray(np.any(odds & (count[:, None] >= count[None, :]), axis=1))


def _seen(run: Run, runs: Runs, lifted: Lifted) -> _Seen:
    scale = np.array(lifted.signal.scale)
    repeated = errors(run, lifted)[0] / scale
    model = lifted.run(run.drive) / scale
    off = repeated.mean(axis=0) + lifted.solution.command / scale - model
    m = len(repeated)
    if m > 1:
        noise = np.sqrt(repeated.var(axis=0, ddof=1).mean(axis=0) / m)
    else:
        noise = np.where(np.isfinite(runs.noise), runs.noise / scale, np.std(np.diff(off, axis=0), axis=0) / np.sqrt(2))
    late = 0.0
    if not lifted.static:
        read = runs.observed
        parts = [
            *_zeros(model, read),
            *((model - model.mean(axis=0)) * np.eye(len(scale))[i] for i in np.flatnonzero(read)),
        ]
        parts.append(-rate_of(lifted, model))
        late = float(_fit(parts, off, read)[0][-1])
    return _Seen(off * runs.observed, model, noise * runs.observed, late)


def _zeros(like: np.ndarray, read: np.ndarray) -> list[np.ndarray]:
    return [np.ones(like.shape) * np.eye(like.shape[1])[i] for i in np.flatnonzero(read)]


def _fit(parts: list[np.ndarray], y: np.ndarray, read: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients of the parts (n, n_y) in y (n, n_y) over the channels that were read, and their standard errors."""
    return regressed([np.stack(parts, axis=2)[:, read]], [y[:, read]])


def _against(a: _Seen, b: _Seen, runs: Runs, lifted: Lifted) -> tuple[np.ndarray, float, np.ndarray]:
    """Zero (n_y,) and delay [s] of run a against run b as far as they are seen, and what is left (n, n_y) of their difference; in typical
    sizes."""
    read, n_y = runs.observed, len(lifted.signal.scale)
    zero, change, moved = np.zeros(n_y), a.off - b.off, a.model - b.model
    if a is b:
        return zero, 0.0, change
    parts = _zeros(change, read)
    first = len(parts)
    by_time = not lifted.static
    if by_time:
        parts.append(-rate_of(lifted, a.model))
    if np.any(moved * read):
        parts.append(moved)
    g, se = _fit(parts, change, read)
    se[:first] = np.maximum(se[:first], np.hypot(a.noise, b.noise)[read] / np.sqrt(lifted.n))
    answer = ANSWER * np.abs(moved.mean(axis=0))[read]
    zero[read] = np.where(np.abs(g[:first]) > np.maximum(SURE * se[:first], answer), g[:first], 0.0)
    tau = float(g[first]) if by_time else 0.0
    if by_time:
        moving = moved - moved.mean(axis=0)
        least = max(
            LEAST_LATE * lifted.sample_time,
            ANSWER * root_mean_square(moving[:, read]) / max(root_mean_square(parts[first][:, read]), 1e-300),
        )
        tau = tau if abs(tau) > max(SURE * float(se[first]), least) else 0.0
    left = change - sum(value * part for value, part in zip(g[: first + by_time], parts, strict=False))
    return zero, tau, left


def _typical(seen: list[_Seen], runs: Runs, lifted: Lifted) -> int:
    """The run from which the others differ least in the middle; of two the one that is nearer to the model."""
    if len(seen) == 2:
        return int(np.argmin([root_mean_square(s.off) for s in seen]))
    apart = [[root_mean_square(_against(a, b, runs, lifted)[2]) for b in seen if b is not a] for a in seen]
    return int(np.argmin([np.median(row) for row in apart]))


def _foreign(a: _Seen, b: _Seen, left: np.ndarray, lifted: Lifted) -> float:
    """By what share of the path's extent two runs differ, where that is more than runs of one path may; else 0."""
    command = lifted.solution.command / np.array(lifted.signal.scale)
    extent = root_mean_square(command - command.mean(axis=0))
    allowed = FOREIGN * extent + OF_CHANGE * root_mean_square(a.model - b.model)
    allowed += OF_ERROR * min(root_mean_square(a.off), root_mean_square(b.off)) + OF_NOISE * root_mean_square(
        np.hypot(a.noise, b.noise)[None]
    )
    return root_mean_square(left) / max(extent, 1e-300) if root_mean_square(left) > allowed else 0.0
