"""The largest speed at each place of a path, and the longest step of a sample: for a stage in balance that is the whole answer.

Along a path a first-order actuator, tau T' = R P - (T - T_amb), follows T(s) with the power

    P = (tau dT/ds s' + T - T_amb)/R,    0 <= P <= P_max,

so that at each place the speed s' is bounded by itself: by (R P_max - (T - T_amb))/(tau dT/ds) where the actuator heats, by
(T - T_amb)/(-tau dT/ds) where it cools, and by nothing that came before. The shortest time is int ds/s'_max. Here the bound is found
by bisection of the model's own limits, whatever drives and limits they are. Under drives that are held for a sample the step to the
next sample is bounded instead, in the same way, by the exact inverse of a sample; and as the place that can be reached next is the
further on the further on one is, the largest step is the best one. Source: Bobrow, Dubowsky, Gibson (1985): the maximum velocity curve.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import scipy

from ctrlgen.path_timing.drive_law import BalancedPath
from ctrlgen.trajectory.inverse.violations import NEGLIGIBLE, limited_values
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES

GROWING = 16.0  # by which a speed is enlarged until it breaks a limit
GROWN = 15  # times, from a billionth of what is typical, beyond which nothing bounds it
HALVINGS = 46  # to rounding
SLOWEST = 1e-9  # of the typical speed: a path that is followed no faster cannot be followed
GROWTH = 1.05  # of a step, by which the first that breaks a limit is looked for
FIRST_STEP = 0.2  # of the step that the continuous speed makes


def largest_speeds(
    distances: ca.Function, by_speed: ca.Function, path: BalancedPath, share: np.ndarray, typical: float
) -> np.ndarray:
    """(n,) the largest speed s' [1/s] at each of the shares, infinite where nothing changes; zero where none keeps the limits.
    `distances` (place, speed) of all limits, `by_speed` of those that change with it; `typical` a speed to begin with."""
    places = path.places(share)

    def kept(speed: np.ndarray, of: ca.Function = by_speed) -> np.ndarray:
        spare = of.map(len(share))(places.T, speed[None])[0].full()
        return np.all(np.where(np.isfinite(spare), spare, -1.0) >= -NEGLIGIBLE, axis=0)

    low = np.full(len(share), SLOWEST * typical)
    low[~kept(low, distances)] = 0.0
    high = np.maximum(low, SLOWEST * typical) * GROWING
    for _ in range(GROWN):
        grows = (low > 0) & kept(high)
        if not grows.any():
            break
        low = np.where(grows, high, low)
        high = np.where(grows, GROWING * high, high)
    free = (low > 0) & kept(high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        holds = kept(middle)
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    return np.where(free, np.inf, low)


def largest_steps(
    path: BalancedPath, share: np.ndarray, speeds: np.ndarray, sample_time: float, drive: ca.Function
) -> np.ndarray:
    """(n,) by how much of the path one sample leads at most from each of the shares; more than is left of an open piece ends there."""
    model = path.law.model
    x, z = path.states(share)
    left = np.full(len(share), 0.5) if path.closed else path.ends[1] - share

    def kept(step: np.ndarray) -> np.ndarray:
        x_then, z_then = path.states(share + step)
        u = drive.map(len(share))(x.T, z.T, z_then.T, x_then[:, : model.n_states].T).full().T
        good = np.all(np.isfinite(u), axis=1)
        for limit, values in limited_values(model, x, z, u):
            (low, high), beyond = limit.bounds, NEGLIGIBLE / 2 * (limit.span or model.force_scale)
            good &= np.all((values >= low - beyond) & (values <= high + beyond), axis=1)
        return good

    low = np.zeros(len(share))
    high = np.minimum(np.where(np.isfinite(speeds), FIRST_STEP * speeds * sample_time, left), left)
    open_ = np.ones(len(share), dtype=bool)  # not yet broken
    for _ in range(2000):
        holds = open_ & kept(high)
        low = np.where(holds, high, low)
        open_ = holds & (high < left)
        if not open_.any():
            break
        high = np.where(open_, np.minimum(high * GROWTH, left), high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        holds = kept(middle)
        low, high = np.where(holds, middle, low), np.where(holds, high, middle)
    reaches = low >= left  # the end: from there on the step is as long as the last that does not
    return np.where(reaches, np.maximum(left, np.append(0.0, low[~reaches])[-1]), low) if reaches.any() else low


def steps_in_time(
    share: np.ndarray, time: np.ndarray, speed: np.ndarray, sample_time: float, closed: bool
) -> np.ndarray:
    """(n,) by how much of a piece the continuous law leads in one sample from each of the shares; beyond an open end at its speed."""
    then = time + sample_time
    beyond = np.maximum(then - time[-1], 0.0)
    if closed:
        turns = np.floor(then / time[-1])
        return np.interp(then - turns * time[-1], time, share) + turns * (share[-1] - share[0]) - share
    return np.interp(then, time, share) + beyond * speed[-1] - share


def landed(share: np.ndarray, steps: np.ndarray, more: int = 0) -> np.ndarray:
    """The places (N + 1,) from the first to the last share in as few samples as the largest `steps` (n,) from there allow, and in some
    `more`: all steps are shortened by one factor so that the last one ends there."""

    def walk(factor: float, count: int) -> np.ndarray:
        """The places after up to `count` samples, no further than the first beyond the end where that is the factor one."""
        places = [float(share[0])]
        while len(places) <= count and (factor < 1 or places[-1] < share[-1]):
            places.append(places[-1] + factor * float(np.interp(places[-1], share, steps)))
        return np.array(places)

    count = len(walk(1.0, MOST_SAMPLES)) - 1 + more

    def beyond(factor: float) -> float:
        return float(walk(factor, count)[-1] - share[-1])

    most = float(np.nextafter(1.0, 0.0))
    factor = most if beyond(most) <= 0 else float(scipy.optimize.brentq(beyond, 0.0, most, xtol=1e-15))
    return np.append(walk(factor, count)[:count], share[-1])
