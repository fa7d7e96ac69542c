"""What models leave, as numbers: misfits, errors and candidates of one channel whose noise has deviation one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel
from ctrlgen.diagnosis.selection.model_selection import scored
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.held_out import refit_to_held_out
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.misfit import Misfit
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.settings import FIT, HELD_OUT_REFIT
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record

BLOCKS = 20


def record(role: str, n: int, n_y: int = 1, observed=None, drive=None) -> Record:
    """Readings of one record, zero unless `observed` is given, every millisecond."""
    y = np.zeros((n, n_y)) if observed is None else observed
    u = np.random.default_rng(9).standard_normal((n, 1)) if drive is None else drive
    return Record(role, role, 1e-3 * np.arange(n), 1e-3, u, y, False, None, np.ones(y.shape, bool))


def noise_of(n_y: int = 1, known: bool = True, count: float = np.inf) -> Noise:
    """White noise of deviation one."""
    source = NoiseSource.REST if known else NoiseSource.MISFIT
    return Noise(np.ones(n_y), (np.zeros(0),) * n_y, (source,) * n_y, ("",) * n_y, np.full(n_y, count))


def left(excess: float = 0.0, n: int = 1000, blocks=None) -> Misfit:
    """`excess` squares beyond those of noise on `n` samples: alike in all blocks, or in the given shares."""
    shares = np.full(BLOCKS, 1 / BLOCKS) if blocks is None else np.asarray(blocks, float)
    count = np.full((len(shares), 1), n / len(shares))
    squares = count + excess * shares[:, None]
    return Misfit(squares, squares.copy(), count, count.copy())


def errors_of(found: Misfit, known: bool = True, tau: float = 1.0) -> ErrorModel:
    """The errors of a model that leaves `found` on the records to fit: noise alone up to 1.1 times its size."""
    q = found.plain_mean
    far = known and bool(q[0] > 1.1**2)
    return ErrorModel(noise_of(known=known), np.sqrt(q) if far else np.zeros(1), np.array([tau if far else 1.0]))


def held_out_deviance(fitter: Fitter, fit: Fit, steps: int = HELD_OUT_REFIT.max_steps) -> float:
    """-2 ln likelihood of the held-out records under the posterior of the parameters."""
    refit = refit_to_held_out(fitter, fit, steps)
    return fitter.held_out_squares(refit.fit) + refit.penalty + refit.log_det


def recovered(fitter: Fitter, device: Device, cause: Hypothesis) -> tuple[CandidateModel, CandidateModel]:
    """The device as described and the same with a cause begun where the screen suspects it, each to its end under its own errors,
    as the search fits them."""
    weighed, described = fitter.described(device)
    trials = Trials(weighed, Screen(weighed, [cause]), lambda _: None)
    nominal = scored(weighed, described)
    best, *_ = trials.screen.run(described).suspects
    found = trials.fit(Structure(device).with_cause(cause, best.start), cause, steps=FIT.max_steps, nested=described)
    return nominal, trials.with_errors(found)


def weighed_by(known: bool = True, **more) -> SimpleNamespace:
    """A fitter of which comparisons read nothing but the noise."""
    return SimpleNamespace(noise=noise_of(known=known), **more)
