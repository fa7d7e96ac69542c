"""How fast a stage with inertia stops ringing, whatever its targets are: what its controller tells UNSURE by.

The device y = (x, z) and the motion that it is to follow are led by the same drives, and their difference obeys e' = A e, so that with

    A^T P + P A <= -2 s P,      |e(t)|_P <= exp(-s t) |e(0)|_P      (A. M. Lyapunov),

|e|_P^2 = e^T P e: s is within a few percent of the slowest mode's damping ratio times its angular frequency. P is scaled so that with
|e|_P <= 1 no displacement, and no state that has a range, is off by more than `STILL` of its range. A break of the motion, which is a
jump of the target or a drive that was limited, adds at most sum p_i |d_i|, p_i^2 = P_ii. Drives within their limits alone can have made
|e|_P <= max_u |F(rest, u)|_P / s: that is what a motion of which nothing is known is taken for.

A is that of rest; where it varies over the ranges, |R dA R^-1| (P = R^T R, dA by interval arithmetic) is taken from s. Numbers of the
device that have a standard deviation are taken `SURE` of them off, all to the sides on which it rings longer. Without damping, or where
what is left of s is not positive, it is not shown that a ringing ever ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil

import casadi as ca
import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_continuous_lyapunov

from ctrlgen.controller.contraction import FOREVER, MOST, ROOM
from ctrlgen.controller.held_drives import left_by_held_drives
from ctrlgen.controller.lost_state import UNLIMITED
from ctrlgen.devices import Device
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.numerics.interval_arithmetic import bounds

STILL = 1e-3  # of its range, by which a stage may ring and is told as still
TOLD = 0.5  # of that, above which it is told: breaks too small to be counted may make as much
LEAST = 2e-3  # of that: a break that is none. 16 roundings of a float at the end of the range
GONE = 1e-3 * LEAST  # of that: less is set to zero, before it becomes a denormal number, on which some cores are slow
SURE = 2.0  # standard deviations, by which a number is off at most
LEFT = (0.02, 0.1, 0.3)  # shares of s that are given up for a smaller P
WEIGHTS = (0.0, 1.0, 1e2, 1e4)  # of the actuators' states beside the rest of P, of which the soonest is taken
ROUNDED = 1e-9  # of P: what rounding may leave of an inequality
# Of a bound: what a float may leave of it more in a sample, as its decay is rounded up (2^-23), written (2^-25) and multiplied (2^-24)
SLOWER = 2.0**-22


@dataclass(frozen=True)
class Ringing:
    """Bounds of the difference between device and motion, in units of `STILL` of the ranges.

    `weights` (n_y,) p of y = (x, z) and of the modes that are led beside them, per SI; `drive` (n_u,) what a sample adds per SI of a
    drive that was left; `decay` in a sample; `least` break that counts; `unknown` size of a motion of which nothing is known; `settling`
    samples until that is told no more about any equilibrium, in a float too, or FOREVER; `reach` (n_y,) what a difference of
    one can make of each number that is weighted; `held` (n_y,) what a held drive leaves, per change of such a number in a sample.
    """

    weights: np.ndarray
    drive: np.ndarray
    decay: float
    least: float
    unknown: float
    settling: int
    reach: np.ndarray
    held: np.ndarray

    def bounded(self, size: float, away: np.ndarray) -> float:
        """A ringing of this `size` about a motion that is `away` (n_y,) from rest, weighted: the device itself is never farther from rest
        than `unknown`."""
        return 0.0 if size < GONE else min(size, self.unknown + float(np.sum(np.abs(away))))


@dataclass(frozen=True)
class _Proof:
    """P of one linear system in scaled numbers, and what is left of s [1/s]."""

    P: np.ndarray
    rate: float

    @property
    def weights(self) -> np.ndarray:
        return np.sqrt(np.diag(self.P))


def ringing(model: Model, sample_time: float, structure: StructuralModel | None) -> Ringing:
    """Of a `model` with inertia whose numbers are free of parameters; with the modes of a `structure` that is led."""
    A, varies, forced, driven = _linear(model)
    size, told = _sizes(model, A)
    far, positions = _equilibria(model, A, forced), np.arange(model.x.numel(), len(A))
    whole, every = A, [A, *_uncertain(model)]
    if structure is not None:
        n, more = structure.axes, 2 * (len(structure.mass) - structure.axes)
        forced, driven = (_on_structure(structure, f) for f in (forced, driven))
        size, told = _with_amplitudes(structure, size), np.concatenate([told, np.zeros(more, dtype=bool)])
        # that it ends is not shown of actuators that remember and of forces that are not linear
        shown = model.x.numel() == n and not varies.any() and _slowest(A) > 0
        slower = min(_slowest(one) for one in every) / _slowest(A) if shown else 0.0
        led = replace(structure, damping_ratio=max(slower, 0.0) * structure.damping_ratio)
        every = [_of_structure(led) if shown else np.zeros((len(size), len(size)))]
        varies = np.zeros_like(every[0])
        far = np.concatenate([far, np.zeros(more)])  # amplitudes are left out of where a motion stays
        whole, positions = _through_lags(structure, A), model.x.numel() + np.arange(len(structure.mass))
    held = left_by_held_drives(whole, positions, told, size, sample_time)
    proofs = []
    for one in every:
        scaled, loose = (matrix / size[:, None] * size for matrix in (one, varies))
        found = [proof for proof in _proofs(scaled, loose, told, model.n_states) if proof.rate > 0]
        if not found:
            return _unproven(size, driven, held, sample_time)
        proofs.append(min(found, key=lambda p: _samples(p, forced / size, sample_time)))
    weights = np.max([p.weights for p in proofs], axis=0)
    rate = min(p.rate for p in proofs)
    unknown = max(float(p.weights @ (forced / size)) / p.rate for p in proofs)
    decay = float(np.exp(-rate * sample_time))
    seen = rate * sample_time - SLOWER
    if seen <= SLOWER or unknown > UNLIMITED:  # a float might see it decay half as fast, or not at all
        return _unproven(size, driven, held, sample_time)
    settling = ceil(np.log(max((unknown + float(weights @ (far / size))) / TOLD, 1.0)) / seen) + 1
    if settling >= MOST:
        return _unproven(size, driven, held, sample_time)
    reach = np.max([np.sqrt(np.diag(np.linalg.inv(p.P))) for p in proofs], axis=0) * weights
    least = max(LEAST, TOLD * (1 - decay))
    drive = sample_time * (weights / size) @ driven
    return Ringing(weights / size, drive, decay, least, unknown, settling, reach, held / weights)


def _unproven(size: np.ndarray, driven: np.ndarray, held: np.ndarray, sample_time: float) -> Ringing:
    """Of a device of which it was not shown that a ringing ends."""
    drive, never = sample_time * (1 / size) @ driven, np.full(len(size), np.inf)
    return Ringing(1 / size, drive, 1.0, LEAST, UNLIMITED, FOREVER, never, held)


def _equilibria(m: Model, A: np.ndarray, forced: np.ndarray) -> np.ndarray:
    """(n_y,) how far from rest a device is held at most by its drives, or a controller may believe it to be held."""
    far = np.abs(np.linalg.pinv(A)) @ forced
    nx = m.x.numel()
    far[nx:] = np.maximum(far[nx:], np.max(np.abs(m.z_bounds), axis=0))
    far[nx - len(m.axes) : nx] = 0.0  # of which none moves
    return far


def _samples(proof: _Proof, forced: np.ndarray, sample_time: float) -> float:
    return float(np.log(max(float(proof.weights @ forced) / proof.rate, 1.0)) / (proof.rate * sample_time))


def _linear(m: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """dF/dy at rest, by how much its entries vary at most, max |F| at rest over the drives, max |dF/du|; y = (x, z), y' = F(y, u)."""
    x, z, u = (ca.SX.sym(name, s.numel()) for name, s in (("x", m.x), ("z", m.z), ("u", m.u)))
    y, own = ca.vertcat(x, z), (m.x, m.z, m.u)
    F = ca.substitute(ca.vertcat(m.rates, m.v), ca.vertcat(*own), ca.vertcat(x, z, u))
    slope, by_drive = ca.jacobian(F, y), ca.jacobian(F, u)
    rest, still, off = m.rest, np.zeros(z.numel()), np.zeros(u.numel())
    A = ca.Function("A", [x, z, u], [ca.densify(slope)])(rest, still, off).full()
    room = ROOM * (m.z_bounds[1] - m.z_bounds[0])
    ranges = {"x": m.x_bounds, "z": (m.z_bounds[0] - room, m.z_bounds[1] + room), "u": m.u_bounds}

    def largest(expr: ca.SX, over: dict[str, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        f = ca.Function("f", [x, z, u], [ca.densify(ca.vec(expr))], ["x", "z", "u"], ["f"])
        found = np.max(np.abs(bounds(f, over)), axis=0).reshape(expr.shape, order="F")
        return np.where(np.isnan(found), np.inf, found)

    varies = np.zeros_like(A)
    if ca.symvar(slope):
        varies = largest(slope - ca.DM(A), ranges)
        varies[varies <= ROUNDED * np.abs(A)] = 0.0
    at_rest = {"x": (rest, rest), "z": (still, still), "u": m.u_bounds}
    return A, varies, largest(F, at_rest).ravel(), largest(by_drive, ranges)


def _sizes(m: Model, A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n_y,) the unit of each number of y, `STILL` of its range, of a velocity at the axis's own frequency; and which have a range."""
    n, nx = len(m.axes), m.x.numel()
    z = STILL * (m.z_bounds[1] - m.z_bounds[0])
    low, high = m.x_bounds
    ranged = np.isfinite(high - low)
    x = STILL * np.where(ranged, np.where(ranged, high, 0.0) - np.where(ranged, low, 0.0), m.x_scale)
    stiff = np.abs(np.diag(A[nx - n : nx, nx:]))
    x[nx - n :] = z * np.where(stiff > 0, np.sqrt(stiff), 1.0)
    return np.concatenate([x, z]), np.concatenate([ranged, np.ones(n, dtype=bool)])


def _proofs(A: np.ndarray, varies: np.ndarray, told: np.ndarray, states: int) -> Iterator[_Proof]:
    """P and what is left of s, in scaled numbers, of those that were tried."""
    slowest = -float(np.max(np.linalg.eigvals(A).real))
    if slowest <= 0 or not np.isfinite(varies).all():
        return
    kept = np.zeros(len(A))
    kept[:states] = 1.0
    for left in LEFT:
        rate = (1 - left) * slowest
        first = solve_continuous_lyapunov((A + rate * np.eye(len(A))).T, -np.eye(len(A)))
        for weight in WEIGHTS if states else WEIGHTS[:1]:
            P = (first + first.T) / 2 + weight * np.linalg.norm(first, 2) * np.diag(kept)
            try:
                R = cholesky(P)
            except (LinAlgError, ValueError):
                continue
            inverse = np.linalg.inv(R)
            S = R @ A @ inverse
            shown = -float(np.linalg.eigvalsh((S + S.T) / 2)[-1]) * (1 - ROUNDED)
            shown -= float(np.linalg.norm(np.abs(R) @ varies @ np.abs(inverse), 2))
            P *= float(np.max(np.diag(inverse @ inverse.T)[told]))
            yield _Proof(P, shown)


def _uncertain(m: Model) -> list[np.ndarray]:
    """dF/dy at rest of the device with each number that has a standard deviation off to either side, and with all on the slower side."""
    device: Device = m.device
    paths = {path: number for path, number in device.quantities() if number.sd and not number.whole}
    if not paths:
        return []
    free = build_model(device, tuple(paths))
    y, F = ca.vertcat(free.x, free.z), ca.vertcat(free.rates, free.v)
    slope = ca.Function("A", [free.p, free.x, free.z, free.u], [ca.densify(ca.jacobian(F, y))])
    nominal = np.array([number.si for number in paths.values()])
    off = SURE * np.array([number.sd or 0.0 for number in paths.values()])

    def at(p: np.ndarray) -> np.ndarray:
        return np.asarray(slope(p, m.rest, np.zeros(len(m.axes)), np.zeros(m.u.numel())).full())

    sides = [[at(nominal + side * one) for side in (-1, 1)] for one in np.diag(off)]
    slower = np.array([-1 if _slowest(low) <= _slowest(high) else 1 for low, high in sides])
    return [*(matrix for pair in sides for matrix in pair), at(nominal + slower * off)]


def _slowest(A: np.ndarray) -> float:
    return -float(np.max(np.linalg.eigvals(A).real)) if np.isfinite(A).all() else -np.inf


def _on_structure(structure: StructuralModel, F: np.ndarray) -> np.ndarray:
    """Magnitudes of y' of the whole structure where those of its own axes (v, z) are `F` (2 n, ...)."""
    n = structure.axes
    pushed = np.abs(np.linalg.inv(structure.mass)[:, :n]) @ np.abs(structure.mass[:n, :n]) @ F[:n]
    return np.concatenate([pushed[:n], F[n:], 0 * pushed[n:], pushed[n:]])


def _of_structure(structure: StructuralModel) -> np.ndarray:
    """A of y = (v, z, eta, eta')."""
    n, k, inverse = structure.axes, len(structure.mass), np.linalg.inv(structure.mass)
    positions, speeds = np.arange(n, n + k), np.concatenate([np.arange(n), np.arange(n + k, 2 * k)])
    A = np.zeros((2 * k, 2 * k))
    A[positions, speeds] = 1.0
    A[np.ix_(speeds, positions)] = -inverse @ structure.stiffness
    A[np.ix_(speeds, speeds)] = -inverse @ structure.damping
    return A


def _through_lags(structure: StructuralModel, own: np.ndarray) -> np.ndarray:
    """A of y = (states of the actuators, v, z, eta, eta'), of which `own` is that of the axes alone, without eta."""
    n, k, lags = structure.axes, len(structure.mass), len(own) - 2 * structure.axes
    A = np.zeros((lags + 2 * k, lags + 2 * k))
    A[:lags, : len(own)] = own[:lags]
    A[lags:, lags:] = _of_structure(structure)
    speeds = lags + np.concatenate([np.arange(n), np.arange(n + k, 2 * k)])
    A[speeds, :lags] = np.linalg.inv(structure.mass)[:, :n] @ structure.mass[:n, :n] @ own[lags : lags + n, :lags]
    return A


def _with_amplitudes(structure: StructuralModel, size: np.ndarray) -> np.ndarray:
    """The sizes of y = (v, z, eta, eta'): of a mode the amplitude at which it holds as much energy as an axis, and its rate."""
    n, stiff, mass = structure.axes, np.diag(structure.stiffness), np.diag(structure.mass)
    amplitude = np.sqrt(float(np.max(stiff[:n] * size[n:] ** 2)) / stiff[n:])
    return np.concatenate([size, amplitude, amplitude * np.sqrt(stiff[n:] / mass[n:])])


def followed(m: Model, motion: dict[str, ca.Function], channels: int, eta: Sequence[np.ndarray]) -> ca.Function:
    """target -> y (n_y,) of the motion and its derivative by time; `eta` per derivative of the target, of modes that are led."""
    target = ca.SX.sym("target", *motion["displacement"].size_in(0))
    each = ca.reshape(target, channels, -1)
    later = ca.vec(ca.horzcat(each[:, 1:], ca.SX.zeros(channels, 1)))
    y = ca.vertcat(motion["state"](target), motion["displacement"](target))
    rate = ca.jtimes(y, target, later)

    def amplitude(k: int) -> ca.SX:
        parts = (ca.mtimes(ca.DM(c), each[:, k + j]) for j, c in enumerate(eta) if k + j < each.size2())
        return sum(parts, ca.SX.zeros(len(eta[0]), 1))

    if eta:
        y = ca.vertcat(y, amplitude(0), amplitude(1))
        rate = ca.vertcat(rate, amplitude(1), amplitude(2))
    return ca.Function("followed", [target], [y, rate], ["target"], ["y", "rate"])
