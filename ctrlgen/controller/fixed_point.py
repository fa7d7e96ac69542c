"""The controller in integers of 32 bits, for cores without a floating-point unit: its scales, its maps, and by how much it is off.

It is for actuators with a lag in a device whose displacements are a matrix times the target: z = M t, states s = f(z) by proven
polynomials, drives u = D_x x + D_s s + d. Where a limit would be broken, it goes from where the device is toward the wanted displacement on
a straight line, as far as halving that line `trials` times finds all limits kept; the start of the line is a place that it was at, and can
stay at: that its drives keep their limits is shown here, by intervals. In C it is codegen/templates/fixed.c.j2.

What the stage is off the target, of a device that is as described: with V for counts of 2^-b,

    |M t - z| <= e_z,   |f^-1(s) - z| <= e_s,   |x - s| <= (1 - |A|)^-1 |B| e_u,   x+ = A x + B u,

e_z the rounding of the displacement, e_s the polynomial's error and rounding as a displacement, e_u the rounding of a drive with what is
cut off it at a limit. The last holds because a state is not integrated: it is taken from the displacement anew in each sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log2

import numpy as np

from ctrlgen.controller.contraction import FOREVER
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.fixed_errors import Bits, Off, error_bounds
from ctrlgen.controller.fixed_maps import NoFixedPoint, RealMaps, real_maps
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.motion_feedforward import MotionKernels
from ctrlgen.numerics.scaled_integers import (
    LARGEST,
    DoesNotFit,
    IntegerPolynomial,
    IntegerRows,
    bits_for,
    counts,
    integer_polynomial,
    integer_rows,
)

HALF = LARGEST // 2  # of what 32 bits hold: so far goes a range, and what is beyond it can still be said
SHARE_BITS = 28  # of shares of composite limits: their sum, eight directions beyond their limits, is below 2^31
FINEST = 4  # parts of the way that a lag goes in a sample, by which the halving stops: what is left delays a jump by a quarter at most
ROUNDED = 1e-6  # of a drive's range: what roundings of states may come to
TRIALS = (4, 16)  # fewest and most


@dataclass(frozen=True)
class FixedPoint:
    """The maps and the numbers of the C.

    `..._ends`: (2, n) lowest and highest integers of displacement, state and drive. `known`: as of the estimate in real numbers.
    `displacement_slack`, `drive_slack`: by which they may be beyond by rounding alone. `bound`, `bound_limit`: the sum of magnitudes of
    these rows of the displacement is at most this only where every composite limit is kept.
    """

    bits: Bits
    displacement: IntegerRows
    state: tuple[tuple[int, IntegerPolynomial], ...]
    settle_drive: IntegerRows  # of the wanted state
    step_drive: IntegerRows  # of the present and the wanted state
    bound: IntegerRows | None
    bound_limit: int
    displacement_ends: np.ndarray
    state_ends: np.ndarray
    drive_ends: np.ndarray
    displacement_slack: np.ndarray
    drive_slack: np.ndarray
    known: np.ndarray
    settling: int
    unknown: int
    trials: int
    off: Off

    def state_of(self, displacement: np.ndarray) -> np.ndarray:
        """The integers of the states that hold a displacement's."""
        return np.array([polynomial(displacement[i]) for i, polynomial in self.state])


def fixed_point(controller: Controller) -> FixedPoint:
    """The integers of a `controller`. Raises NoFixedPoint with the reason where there are none."""
    kernels = controller.kernels
    if (why := _why_not(controller)) is not None:
        raise NoFixedPoint(why)
    try:
        return _scaled(controller, real_maps(kernels))
    except DoesNotFit:
        raise NoFixedPoint("its numbers are too far apart for integers of 32 bits") from None


def _why_not(controller: Controller) -> str | None:
    """What of a device or its scenario the integers do not have."""
    kernels, m = controller.kernels, controller.kernels.nominal
    low, high = m.z_bounds
    reasons = (
        (kernels.sample_time is None, "the scenario has no sample_rate"),
        (isinstance(kernels, MotionKernels) or m.inertial, "the device has inertia"),
        (kernels.rated, "the device has limits on rates of drives"),
        (m.redundant, "the device has more drives than axes"),
        (bool(m.device.given_at_start), "the device has constants that are given at the start ([run_time])"),
        (m.x.numel() > m.n_states, "an effect of the device remembers"),
        (m.n_states == 0, "its actuators have no state: this is written for actuators with a lag"),
        (not np.all((low <= 0) & (high >= 0)), "a displacement cannot be zero"),
        (not np.all([m.u_bounds[0] <= 0, m.u_bounds[1] >= 0]), "a drive cannot be zero"),
    )
    for found, reason in reasons:
        if found:
            return reason
    if not np.all(np.isfinite([*m.z_bounds, *m.u_bounds])):
        return "a displacement or a drive has no limit"
    if kernels.target_directions is None:
        return "its displacements are not a matrix times the target"
    if kernels.guarded_limits and kernels.bound is None:
        return "limits on stress or rotation have no bound that is linear in the displacement"
    if controller.state_can_be_limited:
        return "a displacement in range can need a state beyond its limits"
    contraction = kernels.contraction
    if contraction is None or contraction.unknown == FOREVER:
        return "a state of the device does not forget"
    return None


def _scaled(controller: Controller, real: RealMaps) -> FixedPoint:
    """The integers of real maps. Raises DoesNotFit, and NoFixedPoint where a place could not be kept."""
    m, contraction = controller.kernels.nominal, controller.kernels.contraction
    assert contraction is not None
    z_low, z_high = m.z_bounds
    z_most = np.maximum(-z_low, z_high)
    t_most = np.abs(np.linalg.inv(real.M)) @ z_most
    s_ends = _state_ends(real, z_low, z_high)
    bits = Bits(
        _bits(t_most, HALF), _bits(z_most, HALF), _bits(np.abs(s_ends).max(axis=0), LARGEST - 2**20),
        _bits(np.maximum(*np.abs(m.u_bounds)), HALF),
    )  # fmt: skip
    displacement = integer_rows(
        real.M, np.zeros(len(real.M)), (bits.target, bits.displacement), np.full(len(real.M), 2.0**31),
        t_most * 2.0**bits.target,
    )  # fmt: skip
    z_ends = _ends(z_low, z_high, bits.displacement)
    state = tuple(
        (i, integer_polynomial(p, (int(bits.displacement[i]), int(b)), (int(z_ends[0][i]), int(z_ends[1][i]))))
        for (i, p), b in zip(real.state, bits.state, strict=True)
    )
    off_state = np.array([polynomial.off for _, polynomial in state])
    x_ends = np.array(
        [np.floor(s_ends[0] * 2.0**bits.state - off_state), np.ceil(s_ends[1] * 2.0**bits.state + off_state)]
    )
    x_most = np.abs(x_ends).max(axis=0)
    settle = integer_rows(*real.settle, (bits.state, bits.drive), x_most, x_most)
    twice = np.concatenate([x_most, x_most])
    step = integer_rows(*real.step, (np.tile(bits.state, 2), bits.drive), twice, twice)
    excess = _excess(real, m.u_bounds, x_ends * 2.0**-bits.state)
    slack = np.ceil(np.maximum(settle.off, step.off) + excess * 2.0**bits.drive) + 1
    off = error_bounds(real, bits, (displacement.off, off_state, np.maximum(settle.off, step.off)), slack)
    bound, limit = _bound(controller.kernels, bits, z_ends, off.stage)
    return FixedPoint(
        bits,
        displacement,
        state,
        settle,
        step,
        bound,
        limit,
        z_ends,
        x_ends.astype(np.int64),
        _ends(*m.u_bounds, bits.drive),
        np.ceil(np.maximum(controller.slacks[0], off.target + off.displacement) * 2.0**bits.displacement).astype(
            np.int64
        ),
        slack.astype(np.int64),
        np.maximum(np.floor(contraction.known * 2.0**bits.state), 1).astype(np.int64),
        contraction.settling,
        contraction.unknown,
        _trials(real.by_state),
        off,
    )


def _bits(sizes: np.ndarray, most: int) -> np.ndarray:
    return np.array([bits_for(float(size), most) for size in sizes])


def _ends(low: np.ndarray, high: np.ndarray, bits: np.ndarray) -> np.ndarray:
    """(2, n) the integers of the ends of a range, inside it."""
    return np.array(
        [
            [counts(v, b, up=True) for v, b in zip(low, bits, strict=True)],
            [counts(v, b, up=False) for v, b in zip(high, bits, strict=True)],
        ]
    )


def _state_ends(real: RealMaps, z_low: np.ndarray, z_high: np.ndarray) -> np.ndarray:
    """(2, n_s) lowest and highest states of displacements in range: the polynomials rise or fall all over it."""
    ends = []
    for i, p in real.state:
        of = np.polynomial.Polynomial(p.coefficients)
        ends.append(sorted(float(of((v - p.centre) / p.half)) for v in (z_low[i], z_high[i])))
    return np.array(ends).T


def _excess(real: RealMaps, u_bounds: tuple[np.ndarray, np.ndarray], x_ends: np.ndarray) -> np.ndarray:
    """(n_u,) by how much drives that keep a state in range where it is may be beyond their limits: for roundings of states. Raises
    NoFixedPoint where it is more."""
    n = x_ends.shape[1]
    (by_both, at_zero), middle, half = real.step, x_ends.mean(axis=0), np.diff(x_ends, axis=0)[0] / 2
    excess = np.zeros(len(at_zero))
    for slope, constant in (real.settle, (by_both[:, :n] + by_both[:, n:], at_zero)):
        centre, reach = slope @ middle + constant, np.abs(slope) @ half
        excess = np.maximum.reduce([excess, u_bounds[0] - (centre - reach), centre + reach - u_bounds[1]])
    if np.any(excess > ROUNDED * (u_bounds[1] - u_bounds[0])):
        raise NoFixedPoint("a displacement in range cannot be kept by drives within their limits")
    return excess


def _bound(
    kernels: ControllerKernels, bits: Bits, z_ends: np.ndarray, stage: np.ndarray
) -> tuple[IntegerRows | None, int]:
    """The rows of the bound of composite limits, and the limit of the sum of their magnitudes, less what the stage may be off and what
    rounding does."""
    bound = kernels.bound
    if bound is None:
        return None, 0
    largest = np.abs(z_ends).max(axis=0).astype(float)
    size = np.full(len(bound.rows), SHARE_BITS)
    rows = integer_rows(bound.rows, np.zeros(len(bound.rows)), (bits.displacement, size), largest, largest)
    reserve = bound.rest + float(np.sum(np.abs(bound.rows) @ stage))
    return rows, counts(1 - reserve, SHARE_BITS, up=False) - ceil(float(rows.off.sum()))


def _trials(by_state: np.ndarray) -> int:
    """Halvings of the line: until a part is small beside what a lag goes of its way in a sample, so that it never stands still."""
    moved = 1 - float(np.abs(by_state).sum(axis=1).max())
    fewest, most = TRIALS
    if log2(FINEST / moved) > most:
        raise NoFixedPoint("its lags are too long for its sample time")
    return max(fewest, ceil(log2(FINEST / moved)))
