"""What models leave, as numbers: misfits, errors and candidates of one channel whose noise has deviation one."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ctrlgen.diagnosis.estimation.error_model import ErrorModel
from ctrlgen.diagnosis.estimation.misfit import Misfit
from ctrlgen.diagnosis.estimation.noise import Noise

BLOCKS = 20


def noise_of(n_y: int = 1, known: bool = True, count: float = np.inf) -> Noise:
    """White noise of deviation one."""
    return Noise(np.ones(n_y), (np.zeros(0),) * n_y, np.full(n_y, known), ("",) * n_y, np.full(n_y, count))


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


def weighed_by(known: bool = True, **more) -> SimpleNamespace:
    """A fitter of which comparisons read nothing but the noise."""
    return SimpleNamespace(noise=noise_of(known=known), **more)
