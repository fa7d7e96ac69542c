"""Where what a device remembers stood when a record began: at rest, or settled under its first drive, as in the last part of a log.

Hot heaters are several of their prior deviations from cold ones, and of a device that is far from linear Gauss-Newton steps from there may
end elsewhere. The better of both is where they are expected, and where a fit begins.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.least_squares import LeastSquaresProblem
from ctrlgen.estimation.settings import SIMULATION
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Record


def states_to_begin(problem: LeastSquaresProblem, theta: np.ndarray) -> np.ndarray:
    """The free initial states (n_s,) [SI] of all records of a problem with which a fit from the numbers `theta` (k,) begins."""
    found = [start_of(problem.simulators[r.timing], problem.error, theta, r) for r in problem.records]
    return np.concatenate([np.zeros(0), *found])


def start_of(simulator: Simulator, error: ErrorModel, theta: np.ndarray, record: Record) -> np.ndarray:
    """Those of one record: zero at rest, else what is added where the device has settled under its first drive."""
    rest = np.zeros(len(simulator.free_initial_states))
    settled = _settled(simulator, theta, record)
    if settled is None:
        return rest

    def objective(start: np.ndarray) -> float:
        y = simulator.simulate(record, theta, start)
        white = error.whiten(np.where(record.valid, record.observed - y, 0.0), record.valid)
        value = float(np.sum(white**2))
        return value if np.isfinite(value) else np.inf

    return min((rest, settled), key=objective)


def _settled(simulator: Simulator, theta: np.ndarray, record: Record) -> np.ndarray | None:
    """What is added to the free initial states where the device has been under the first drive of a record as long as it, at most
    `SIMULATION.settling_samples`: to those of actuators without inertia behind them and of what slews, and where the record goes on from
    what it does not tell, to those of relaxing laws and of the motion. None where there are none of these, or rest is that."""
    m, free = simulator.model, simulator.free_initial_states
    slewing = set(simulator.slews)
    settling = [(place, k) for place, k in enumerate(free) if k not in m.free_memories or place in slewing]
    if (
        not settling
        or (m.inertial and not simulator.resumed)
        or simulator.poses
        or not np.isfinite(simulator.sample_time)
        or not record.drive[0].any()
    ):
        return None
    rows = min(len(record.time), SIMULATION.settling_samples)
    ambient = None if record.ambient is None else np.repeat(record.ambient[:1], rows)
    same = {name: getattr(record, name)[:rows] for name in ("time", "observed", "valid")}
    held = replace(record, drive=np.repeat(record.drive[:1], rows, axis=0), ambient=ambient, **same)
    end = simulator.simulate_states(held, theta)[0][-1]
    start, rest = np.zeros(len(free)), simulator.initial_state(record, theta)
    for place, k in settling:
        start[place] = end[k] - rest[k]
    return start if np.isfinite(start).all() else None
