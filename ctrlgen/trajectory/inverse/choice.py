"""Which inverse a model has along a path, and why it may have none."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.devices import Signal
from ctrlgen.model.allocation import allocate, why_not_ganged
from ctrlgen.model.model import Model
from ctrlgen.trajectory.inverse.balanced import BalancedInverse
from ctrlgen.trajectory.inverse.clock import Clock, Sampled
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.path_inverse import PathInverse
from ctrlgen.trajectory.inverse.redundant import RedundantInverse

HOME_DRIVE = 1e-3  # of the full drive, at which the slopes near home are taken: a heater's power has none at zero volt


def choose_inverse(model: Model, follow: str, clock: Clock) -> PathInverse:
    """The inverse of a model along paths of its signal `follow`. Raises InputError where its drives do not push the axes, or do not move
    the followed channels, independently of one another."""
    if model.redundant:
        allocation = allocate(model)
        return RedundantInverse(model, choose_inverse(allocation.ganged, follow, clock), allocation)
    if not model.inertial:
        return BalancedInverse(model, follow, clock)
    assert isinstance(clock, Sampled)  # a motion with derivatives by time has one
    return InertialInverse(model, follow, clock)


def count_faults(model: Model, follow: str) -> list[Fault]:
    """What keeps a model from being inverted: it takes a drive or more and one axis for each channel that is followed."""
    signal, drives, axes = model.signals[follow], model.u.numel(), len(model.axes)
    channels = len(signal.channels)
    told = f"{number_of(channels, 'channel')} of the {follow}"
    if drives > axes and not model.redundant:
        return [Fault("device", f"{model.name} has an imposed motion and no drives; nothing leads it along a path")]
    if model.redundant and (why := why_not_ganged(model)) is not None:
        lacking = f"has {number_of(drives, 'drive')} for {number_of(axes, 'axis', 'axes')} and {why}"
        what = f"{lacking}: the drives of least effort cannot be computed; let one drive act on several actuators"
        return [Fault("device", f"{model.name} {what}")]
    if drives < channels:
        ways = "; ".join(_direction(signal, way) for way in _reached(model, signal).T)
        what = f"has {number_of(drives, 'drive')} for {told}; near home it moves only along {ways}"
        return [
            Fault("device", f"{model.name} {what}; follow a signal of {number_of(drives, 'channel')}, or add drives")
        ]
    flexible = model.inertial and not model.redundant  # then the other axes are flexible modes, which follow
    if channels != axes and not flexible:
        what = f"{model.name} has {number_of(axes, 'axis', 'axes')} for {told}; follow its displacement"
        return [Fault("follow", what)]
    return []


def _reached(model: Model, signal: Signal) -> np.ndarray:
    """(channels, n_u) d signal / d u between equilibria near home, in the signal's typical sizes, each column of length one."""
    unknown = ca.vertcat(model.x, model.z)
    rows = ca.vertcat(model.settling, model.balance)
    at = [unknown, model.u, model.p]
    slopes = ca.Function(
        "slopes", at, [ca.jacobian(rows, unknown), ca.jacobian(rows, model.u), ca.jacobian(signal.expr, unknown)]
    )
    home = (np.concatenate([model.rest, np.zeros(len(model.axes))]), model.u_scale * HOME_DRIVE, model.p_nominal)
    K, B, C = (v.full() for v in slopes(*home))
    moved = C @ -np.linalg.lstsq(K, B, rcond=None)[0] / np.array(signal.scale)[:, None]
    return moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)


def _direction(signal: Signal, way: np.ndarray) -> str:
    """'x + 0.5 y' in typical sizes of the channels; what is below a thousandth is left out."""
    terms = [(c, v) for c, v in zip(signal.channels, way / way[np.abs(way).argmax()], strict=True) if abs(v) > 1e-3]
    return " + ".join(c if abs(v - 1) < 1e-3 else f"{v:.3g} {c}" for c, v in terms).replace("+ -", "- ")
