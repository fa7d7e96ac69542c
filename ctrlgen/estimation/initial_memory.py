"""Where the plays of a hysteresis stood when a record began, or what a rate limits: what moved before it is not recorded.

Plays that were dragged along remember where the motion turned last. One that the motion does not drag along at first has no slope by
that place, and a search from the middle of all plays stays there: a few places are tried first.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ctrlgen.estimation.least_squares import initial_state_sd
from ctrlgen.estimation.settings import FIT, INITIAL_MEMORY
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.gaps import rows_of
from ctrlgen.recordings.recording import Record

White = Callable[[Record, np.ndarray], np.ndarray]  # (record, readings) -> whitened residual (n n_y,)


def begins_elsewhere(simulator: Simulator, record: Record, white: np.ndarray) -> bool:
    """Whether a device with a memory that is looked for here begins worse than it goes on."""
    return bool(simulator.plays or simulator.gaps or simulator.slews) and begins_worse(record, white)


def arbitrary_states(simulator: Simulator) -> list[int]:
    """Places among the free initial states of those of which other records tell nothing."""
    return [i for i, k in enumerate(simulator.free_initial_states) if k in simulator.model.arbitrary_memories]


def at_the_best_quarter(
    simulator: Simulator, theta: np.ndarray, record: Record, expected: np.ndarray, white: White
) -> np.ndarray:
    """The free initial states `expected`, in their prior deviations, and each arbitrary one at the quarter of its typical size, such as a
    turn, with which the record is foretold best: from a phase half a turn off no step leads to the right one."""
    sd, states = initial_state_sd(simulator), expected.copy()
    for k in arbitrary_states(simulator):
        tried = [states.copy() for _ in INITIAL_MEMORY.quarters]
        for start, quarter in zip(tried, INITIAL_MEMORY.quarters, strict=True):
            start[k] = quarter / FIT.start_size
        states = min(tried, key=lambda s: float(np.sum(white(record, simulator.simulate(record, theta, sd * s)) ** 2)))
    return states


def begins_worse(record: Record, white: np.ndarray) -> bool:
    """Whether the whitened residual (n n_y,) of a record is larger in its first part than after it."""
    squares = white.reshape(len(record.time), -1) ** 2
    rows = _first_rows(record)
    return bool(squares[:rows].mean() > INITIAL_MEMORY.worse * max(squares[rows:].mean(), 1.0))


def memory_before(
    simulator: Simulator, theta: np.ndarray, record: Record, begun: np.ndarray, expected: np.ndarray, white: White
) -> np.ndarray:
    """The free initial states in their prior deviations, likeliest at those `expected`, with which the first part of a record is foretold
    best: as `begun`, or with a turning point before the record at one of several ways back from where it begins, or, from what is
    expected, the driven side of a gap at one of several places in it: what is crossed soon leaves one step of its slope no guide, which
    then bends the speed instead. Or with what a rate limits so far behind: what has caught up with the drive has no slope."""
    sd = initial_state_sd(simulator)
    first = rows_of(record, np.arange(len(record.time)) < _first_rows(record))

    def squares(states: np.ndarray) -> float:
        residual = white(first, simulator.simulate(first, theta, sd * states))
        return float(residual @ residual + (states - expected) @ (states - expected))

    def moved(turn: int, start: int, place: float, side: float) -> np.ndarray:
        states = best.copy()
        states[[turn, start]] = place, side / sd[start]
        return states

    best, least = begun, squares(begun)
    for play, turn, start in simulator.plays:
        # dragged along from either side, the narrowest play tells where the motion begins
        far = [moved(turn, start, place, 0.0) for place in (INITIAL_MEMORY.far, -INITIAL_MEMORY.far)]
        ends = [simulator.simulate_states(first, theta, sd * f)[0][0, play] / sd[turn] + f[turn] for f in far]
        here = float(np.mean(ends))
        for way in (0.0, *INITIAL_MEMORY.ways_back):
            for side, place in ((-1.0, here + way), (1.0, here - way), (0.0, here + way), (0.0, here - way)):
                states = moved(turn, start, place, side)
                if (value := squares(states)) < least:
                    best, least = states, value
    for start in simulator.gaps:
        for side in INITIAL_MEMORY.sides:
            states = expected.copy()
            states[start] = side / sd[start]
            if (value := squares(states)) < least:
                best, least = states, value
    for start in simulator.slews:
        for behind in INITIAL_MEMORY.behind:
            states = best.copy()
            states[start] = expected[start] + behind
            if (value := squares(states)) < least:
                best, least = states, value
    return best


def _first_rows(record: Record) -> int:
    return min(INITIAL_MEMORY.rows, max(len(record.time) // 4, 1))
