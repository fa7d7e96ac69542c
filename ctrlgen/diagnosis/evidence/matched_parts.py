"""The parts of a matched filter: what the held-out records show beyond a model without a cause, along what the cause changes, stretch
by stretch."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.diagnosis.evidence.independent_stretches import GAP, Memory, Whitened, matched_innovations, stretches
from ctrlgen.diagnosis.settings import LUCK
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.free_parameters import FreeParameter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.initial_memory import arbitrary_states
from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class WithoutCauses:
    """A fit without some of its causes, its other numbers `theta` (k,) [SI] as they are. `root` (k, k): R R' is their covariance."""

    structure: Structure
    theta: np.ndarray
    root: np.ndarray

    def of(self, full: Fit) -> Fit:
        """The same as a fit, with what does not depend on numbers of the `full` one."""
        return replace(full, structure=self.structure, theta=self.theta)


def without_causes(full: Fit, causes: Collection[Hypothesis]) -> WithoutCauses:
    """`full` without these of its causes, whose place is not taken by other numbers: what those could take is taken out later."""
    structure = full.structure
    places = {_key(structure, p): i for i, p in enumerate(structure.free_parameters)}
    for k in reversed(range(len(structure.causes))):
        if structure.causes[k] in causes:
            structure = structure.without(k)
    free = structure.free_parameters
    at = [places.get(_key(structure, p)) for p in free]
    theta = np.array([p.nominal if i is None else full.theta[i] for p, i in zip(free, at, strict=True)])
    known = np.array([i is not None for i in at], bool)
    C = np.zeros((len(free), len(free)))
    chosen = [i for i in at if i is not None]
    C[np.ix_(known, known)] = full.covariance[np.ix_(chosen, chosen)]
    return WithoutCauses(structure, theta, _root(C))


def matched_parts(fitter: Fitter, full: Fit, causes: Collection[Hypothesis], memory: Memory) -> np.ndarray:
    """t_b (b,) of all held-out records: the whitened residual without the `causes` times what they change, each beyond what other numbers
    can take, summed over each stretch.

    Raises ArithmeticError where a prediction diverges.
    """
    bare = without_causes(full, causes)
    return matched_innovations([_of_record(fitter, bare, full, r, memory) for r in fitter.held_out_records])


def _of_record(fitter: Fitter, bare: WithoutCauses, full: Fit, record: Record, memory: Memory) -> Whitened:
    """What `bare` leaves of a held-out record, from rest, and what `full` changes. What the beginning of the record alone can tell, such
    as the phase of the mains there, it tells, and is then no evidence."""
    simulator = fitter.simulator(bare.structure, record)
    changed = change_by(fitter, bare, full, record)
    sd = initial_state_sd(simulator)
    predicted, Y = simulator.sensitivities(record, bare.theta, _told_by_beginning(fitter, bare.of(full), record))
    if not all(np.isfinite(v).all() for v in (predicted, changed, Y)):
        raise ArithmeticError("the prediction diverges")
    k = len(bare.theta)
    left = np.where(record.valid, record.observed - predicted, 0.0)
    values = [left[..., None], changed[..., None], Y[..., :k] @ bare.root, Y[..., k:] * sd]
    white = fitter.error.whiten(np.concatenate(values, axis=2), record.valid)
    labels = stretches(record, np.sum(white[..., 1] ** 2, axis=1), memory)
    if arbitrary_states(fitter.simulator(full.structure, record)):
        labels[: _beginning(record)] = GAP
    inside = labels != GAP
    rows = white[inside].reshape(-1, white.shape[2])
    stretch = np.repeat(labels[inside], white.shape[1])
    return Whitened(rows[:, 0], rows[:, 1], rows[:, 2 : 2 + k], rows[:, 2 + k :], stretch)


def change_by(fitter: Fitter, bare: WithoutCauses, full: Fit, record: Record) -> np.ndarray:
    """What `full` changes of the prediction (n, n_y) [SI], both from rest: the held-out readings tell neither initial states, nor what a
    reading that is late shows of the time before; their beginning tells what nothing else can."""
    unread = replace(record, valid=np.zeros_like(record.valid))
    with_, without = (
        fitter.simulator(f.structure, record).simulate(unread, f.theta, _told_by_beginning(fitter, f, record))
        for f in (full, bare.of(full))
    )
    return with_ - without


def _beginning(record: Record) -> int:
    return round(LUCK.foretelling * len(record.time))


def _told_by_beginning(fitter: Fitter, fit: Fit, record: Record) -> np.ndarray:
    """The free initial states [SI] of a model at rest, but those that no other record foretells as the beginning of this one tells them."""
    simulator = fitter.simulator(fit.structure, record)
    states = np.zeros(len(simulator.free_initial_states))
    if chosen := arbitrary_states(simulator):
        read = record.valid & (np.arange(len(record.time)) < _beginning(record))[:, None]
        states[chosen] = fitter.begun(fit, replace(record, valid=read))[0][chosen]
    return states


def _key(structure: Structure, p: FreeParameter) -> tuple[Hypothesis | None, str]:
    """What a number is in any structure: a cause's, or the device's own."""
    return (None, p.path) if p.cause is None else (structure.causes[p.cause], p.name)


def _root(covariance: np.ndarray) -> np.ndarray:
    """R (k, k) with R R' the covariance; without parameters that the records to fit leave open."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    known = np.isfinite(sd) & (sd > 0)
    unit = np.where(known, sd, 1.0)
    correlation = np.nan_to_num(covariance / np.outer(unit, unit) * np.outer(known, known))
    size, V = np.linalg.eigh((correlation + correlation.T) / 2)
    return unit[:, None] * V * np.sqrt(np.maximum(size, 0.0))
