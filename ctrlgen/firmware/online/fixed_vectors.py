"""Reference vectors of the controller in integers: calls and the answers to them, each exact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import floor
from typing import Any

import numpy as np

from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.fixed_point import FixedPoint
from ctrlgen.controller.fixed_step import WORD, FixedController, FixedStep
from ctrlgen.firmware.c.real import Real

ALONG = 16  # vectors along the command
ANYWHERE = 6  # displacements drawn in the range, and on its corners; from each a jump
OUTWARD = 0.05  # of its range, by which a displacement goes beyond
TOWARD = 3  # calls with one target far away, which is come to in several
SETTLE, FRESH, UNTOLD, FORGOTTEN = 1, 2, 4, 8  # bits of how a vector is run


def fixed_vectors(controller: Controller, fixed: FixedPoint, command: np.ndarray) -> dict[str, Any]:
    """Rows of target, drive, displacement, state, status and `how`: settle and not step, from a device at rest, without a target,
    behind `forget`. `cooling`, `settling`: the samples that the test waits for."""
    twin = FixedController(fixed)
    rows: list[dict[str, Any]] = []
    state = twin.rest()
    for how, target in _calls(controller, twin, command):
        if how & FRESH:
            state = twin.rest()
        if how & FORGOTTEN:
            state = twin.forgotten()
        step = twin.step(state, None if how & UNTOLD else target, settle=bool(how & SETTLE))
        state = step.after
        rows.append(_row(how, target, step))
    return {
        "rows": rows,
        "unlike": {name: _spoilt(ends) for name, ends in (("x", fixed.state_ends), ("z", fixed.displacement_ends))},
        "settling": fixed.settling,
        "cooling": fixed.unknown,
    }


def edges(bits: Sequence[int]) -> list[list[tuple[int, int | None]]]:
    """Of each number of a target, which counts 2^-bits: bits of floats, and what they count, halves away from zero; None for those that are
    no number or that 32 bits do not count."""
    return [[(Real.FLOAT.bits(value), _counted(value, b)) for value in _edges(b)] for b in bits]


def _edges(bits: int) -> list[float]:
    """Floats at which a conversion changes its way."""
    one, most = np.float32(2.0**-bits), np.float32(2.0 ** (31 - bits))
    around = [0.49 * one, one / 2, 1.49 * one, 1.5 * one, 2**23 * one, (2**24 - 1) * one, 2**25 * one]
    below = np.nextafter(most, np.float32(0.0))
    ends = [below, most, 2 * most, np.float32(np.inf)]
    sizes = [np.float32(0.0), np.finfo(np.float32).smallest_subnormal, *around, *ends]
    return [float(sign * size) for size in sizes for sign in (1, -1)] + [np.nan]


def _counted(value: float, bits: int) -> int | None:
    if not np.isfinite(value):
        return None
    size = floor(abs(Fraction(value)) * Fraction(2) ** bits + Fraction(1, 2))
    return None if size >= WORD else size if value > 0 else -size


def _row(how: int, target: np.ndarray, step: FixedStep) -> dict[str, Any]:
    return {
        "how": how,
        "target": [int(v) for v in target],
        "status": int(step.status),
        "numbers": list(step.numbers),
    }


def _spoilt(ends: np.ndarray) -> list[list[int]]:
    """Of each number of a state the nearest integers that it cannot have, below and above."""
    return [[int(low) - 1, int(high) + 1] for low, high in ends.T]


def _calls(controller: Controller, twin: FixedController, command: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """`how` and target of each call, in this order."""
    (low, high), rng = controller.kernels.nominal.z_bounds, np.random.default_rng(1)
    M, n = controller.kernels.target_directions, len(low)
    assert M is not None

    def target(z: np.ndarray) -> np.ndarray:
        return twin.counts(np.linalg.solve(M, z))

    along = [twin.counts(t) for t in command[:ALONG]]
    calls = [(SETTLE | FRESH, along[0]), *((0, t) for t in along), (UNTOLD, along[0]), (SETTLE | UNTOLD, along[0])]
    inside = [np.clip(0.0, low, high) + 0.3 * s * (high - low) for s in rng.uniform(0, 1, (ANYWHERE, n))]
    corners = [np.where(rng.random(n) < 0.5, low, high) for _ in range(ANYWHERE)]
    for start, far in zip(inside, corners, strict=True):
        calls += [(SETTLE | FRESH, target(start)), *((0, target(far)) for _ in range(TOWARD)), (SETTLE, target(far))]
    slack = twin.fixed.displacement_slack * 2.0**-twin.fixed.bits.displacement
    middle = (low + high) / 4
    for i in range(n):
        for end, way in ((low[i], -1), (high[i], 1)):
            for by in (slack[i] / 2, OUTWARD * (high[i] - low[i])):
                z = middle.copy()
                z[i] = end + way * by
                calls.append((SETTLE | FRESH, target(z)))
    for absurd in (-WORD, WORD - 1):
        calls += [(FRESH, np.full(command.shape[1], absurd)), (SETTLE, np.full(command.shape[1], absurd))]
    return [*calls, (FRESH | FORGOTTEN, along[0]), (FRESH, along[0])]
