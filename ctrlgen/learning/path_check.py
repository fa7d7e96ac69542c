"""Whether the drives and readings of each run by itself are of the path."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.learning.lifted import Lifted
from ctrlgen.learning.runs import Runs, errors, root_mean_square
from ctrlgen.recordings.plausibility import suspected

OFF_PATH = 0.5
"""Of the path's extent, by which the model under the recorded drives may be off the path (rms). Judgement: drives of another path, or in
another unit, are off by as much as it is long."""
OFF_LEARNT = 0.1
"""Of it, for a run after the first, beyond what the runs before could teach. Judgement: a path that is nearer is hardly another one."""
OF_TAUGHT = 0.3
"""Of what the run before showed beyond the model, for what was learnt from it otherwise than in proportion. Judgement."""
STILL = 0.1
"""Of the command's motion (rms), below which readings are not of a stage that moves. Judgement: a stage so soft has another description."""
COMMANDED = 0.2
"""Of the path's extent, by which a channel must be commanded to move for that to be looked at: less may be the coupling of the others."""
AS_ANOTHER = 0.9
"""Correlation of a reading with what the drives make of another channel, or against its own, from which it is taken for that. Judgement:
what a stage couples, or lags by, leaves less."""
AS_ITSELF = 0.5
"""Correlation with its own below which it may be another one. Judgement: of a stage that lags behind by 60 degrees it is more."""
FAR_READING = 3.0
"""Times the size of the path, by which the readings may be off it (rms). Judgement: a wrong unit is a factor of a thousand, a sign two."""


def check_belongs(runs: Runs, lifted: Lifted, source: str) -> None:
    """Refuses runs whose drives or readings are not of this path. Raises InputError."""
    command, scale = lifted.solution.command, np.array(lifted.signal.scale)
    extent = np.sqrt(np.mean(((command - command.mean(axis=0)) / scale) ** 2))
    size = np.sqrt(np.mean((command / scale) ** 2)) or extent
    faults, beyond, first = list[Fault](), np.zeros(command.shape), None
    for run in runs.runs:
        model = lifted.run(run.drive)
        led = (model - command) / scale
        off = root_mean_square(led)
        # Drives that were learnt lead the model off by what runs before showed beyond it, or a share of that
        if first is not None:
            share = -np.sum(led * beyond) / max(float(np.sum(beyond**2)), 1e-300)
            led = led + np.clip(share, 0.0, 1.0) * beyond
        allowed = (
            OFF_PATH * extent if first is None else OFF_LEARNT * extent + OF_TAUGHT * root_mean_square(beyond) + first
        )
        if root_mean_square(led) > min(OFF_PATH * extent, allowed):
            what = (
                f"its drives would lead the device as described {100 * off / extent:.0f} % of the path's extent away from the path: "
                "it is of another scenario or another device, or the columns of the drives have other units"
            )
            if (shift := _shift(model / scale, command / scale, off, lifted.closed)) is not None:
                what = f"it begins {number_of(shift, 'sample')} after the path does; let it begin where the path begins, by `rows`"
            faults.append(Fault(run.name, what))
            continue
        away = errors(run, lifted)[0].mean(axis=0) / scale
        if first is None:
            first = off
        beyond = away + (command - model) / scale
        about = (command - command.mean(axis=0)) / scale
        for channel, error, moved, read in zip(lifted.signal.channels, away.T, about.T, runs.observed, strict=True):
            far, moves = root_mean_square(error), float(np.std(error + moved)) / max(root_mean_square(moved), 1e-300)
            if far > FAR_READING * size:
                what = f"its {channel} is {far / size:.0f} times the path's size away from it; check the column, its unit, sign and origin"
                faults.append(Fault(run.name, what))
            elif read and root_mean_square(moved) > COMMANDED * extent and moves < STILL:
                what = f"its {channel} moves by {moves:.2g} of what is commanded; check the column, its unit, and that the stage is driven"
                faults.append(Fault(run.name, what))
    faults = faults or _misplaced(runs, lifted, extent)
    if faults:
        raise InputError(source, [*faults, *suspected(runs.notes)])


def _misplaced(runs: Runs, lifted: Lifted, extent: float) -> list[Fault]:
    """A fault for each channel of the first run that moves against what its drives make of it, or of channels that move as the drives make
    one another move: drives that were learnt from it would lead away from the path."""
    run, names, scale = runs.runs[0], lifted.signal.channels, np.array(lifted.signal.scale)
    command = lifted.solution.command
    about, made = ((of - of.mean(axis=0)) / scale for of in (command, lifted.run(run.drive)))
    read = (errors(run, lifted)[0].mean(axis=0) + command) / scale
    moved = [i for i in np.flatnonzero(runs.observed).tolist() if root_mean_square(about[:, i]) > COMMANDED * extent]
    alike = {i: {j: _correlation(read[:, i], made[:, j]) for j in moved} for i in moved}
    as_what = {i: max((abs(r), j) for j, r in of.items())[1] for i, of in alike.items()}
    taken = {i: j for i, j in as_what.items() if abs(alike[i][j]) > AS_ANOTHER and alike[i][i] < AS_ITSELF}
    if set(taken) != set(taken.values()):  # an actuator that acts otherwise, which the next run tells
        taken = {i: j for i, j in taken.items() if i == j}
    faults = list[Fault]()
    for i, j in taken.items():
        against = f"against what the drives make of {'it' if i == j else names[j]}"
        how = against if alike[i][j] < 0 else f"as the drives make {names[j]} move"
        what = (
            f"its {names[i]} moves {how} (correlation {alike[i][j]:.2f}): check order and sign of the columns, the polarity and the "
            "order of the drives, and that drives and readings begin at one moment"
        )
        faults.append(Fault(run.name, what))
    return faults


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Of two motions (n,); zero where one stands still."""
    return float(np.corrcoef(a, b)[0, 1]) if np.std(a) > 0 and np.std(b) > 0 else 0.0


def _shift(model: np.ndarray, command: np.ndarray, off: float, closed: bool) -> int | None:
    """By how many samples a closed path is entered late, where that explains that it is `off`."""
    if not closed:
        return None
    spectra = np.fft.rfft(model, axis=0) * np.conj(np.fft.rfft(command, axis=0))
    agreement = np.fft.irfft(spectra, n=len(command), axis=0).sum(axis=1)
    shift = int(-agreement.argmax() % len(command))
    return shift if shift and root_mean_square(np.roll(model, shift, axis=0) - command) < off / 4 else None
