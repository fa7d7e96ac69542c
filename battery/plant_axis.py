"""An independent single-axis flexure stage: m q'' + c q' + k q = k_f u + whatever the laws add.

Integration: the linear part is discretised exactly (matrix exponential) at a part of the sample time; the laws' forces are taken at
the predicted middle of that step (exponential midpoint rule, second order). Laws live in `battery.laws_*`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.linalg import expm

Array = np.ndarray
SUBSTEPS = 32  # a sample: stops and friction are then right to a third of the noise
ROUGH = 8  # where only the size of a law matters


@dataclass(frozen=True)
class Loop:
    """u = clip(kp kv (r - q) - kv q' + ki int(r - q) dt), `position_gain` kp [1/s], `velocity_gain` kv [V s/m], ki [V/(m s)]."""

    position_gain: float
    velocity_gain: float
    integral_gain: float = 0.0


@dataclass(frozen=True)
class Axis:
    """`mass` [kg], `damping` [N s/m], `stiffness` [N/m], `force_constant` [N/V], `stroke` [m], `drive_limit` [V].

    Without mass it follows its drive at once, as a piezo ceramic does: q = force_constant u/stiffness.
    """

    mass: float
    damping: float
    stiffness: float
    force_constant: float
    stroke: float
    drive_limit: float
    loop: Loop | None = None


@dataclass(frozen=True)
class Scene:
    """What a law may know when it is drawn or built: the axis and typical sizes of its motion, SI.

    `travel`, `speed`: rms of motion, `peak`: largest motion, `drive_peak`: largest amplifier drive, `span`: end of the clock, `noise`: sd.
    """

    axis: Axis
    travel: float = 2e-5
    speed: float = 5e-3
    peak: float = 6e-5
    drive_peak: float = 2.0
    span: float = 20.0
    noise: float = 5e-9
    sample_time: float = 1e-3
    substeps: int = SUBSTEPS

    @property
    def step(self) -> float:
        """Integration step [s]."""
        return self.sample_time / self.substeps

    @property
    def rough(self) -> Scene:
        """The same in fewer steps."""
        return replace(self, substeps=ROUGH)


@dataclass(frozen=True)
class Planted:
    """One law in a plant: its name, its amplitude (0 is absent) and its shape values, SI."""

    name: str
    amplitude: float
    shape: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Hooks:
    """Where a law acts, in the order in which the signal passes them; each is None where it does not.

    `drive(t, u)` -> u [V]; `force(t, q, v)` -> N, added; `carried(t, q, u)` -> what the sensor's target does [m], arrays on the fine grid;
    `sensed(t, y, ambient)` -> y, the same; `digital(t, y)` -> y at the samples, after noise. `direct`: the share of a change
    of drive that passes at once, where `drive` remembers.
    """

    drive: Callable[[float, float], float] | None = None
    force: Callable[[float, float, float], float] | None = None
    carried: Callable[[Array, Array, Array], Array] | None = None
    sensed: Callable[[Array, Array, Array], Array] | None = None
    digital: Callable[[Array, Array], Array] | None = None
    direct: float | None = None


def exact_step(axis: Axis, h: float) -> tuple[float, ...]:
    """(a11, a12, a21, a22, b1, b2, r1, r2) of (q, v)+ = A (q, v) + b F + r (F_end - F_begin), F the force in the middle of
    `h` and straight from begin to end: expm of the companion matrix with the force and its slope as states."""
    M = np.zeros((4, 4))
    M[0, 1] = 1.0
    M[1, :3] = [-axis.stiffness / axis.mass, -axis.damping / axis.mass, 1 / axis.mass]
    M[2, 3] = 1 / h
    E = expm(M * h)
    held, ramp = E[:2, 2], E[:2, 3]  # by the force at the beginning, and by its rise
    steps = E[0, 0], E[0, 1], E[1, 0], E[1, 1], held[0], held[1], ramp[0] - held[0] / 2, ramp[1] - held[1] / 2
    return tuple(map(float, steps))  # plain numbers are quick one at a time


def fine_drive(drive: Array, linear: bool, substeps: int) -> Array:
    """The command in the middle of every integration step, (n * substeps,): held, or linear from sample to sample."""
    if not linear:
        return np.repeat(drive, substeps)
    middle = (np.arange(substeps) + 0.5) / substeps
    following = np.append(drive[1:], drive[-1])
    return (drive[:, None] + (following - drive)[:, None] * middle).ravel()


def fine_rise(drive: Array, linear: bool, substeps: int) -> Array:
    """How much the command rises within every integration step, (n * substeps,)."""
    if not linear:
        return np.zeros(len(drive) * substeps)
    return np.repeat(np.diff(drive, append=drive[-1:]) / substeps, substeps)


@dataclass(frozen=True)
class Motion:
    """The motion on the fine grid, `substeps` a sample: `time` [s, common clock], `position` [m], `speed` [m/s], `drive` [V] after the
    drive laws."""

    time: Array
    position: Array
    speed: Array
    drive: Array
    substeps: int


def move(
    axis: Axis,
    drive: Array,
    hooks: Sequence[Hooks] = (),
    start: float = 0.0,
    scene: Scene | None = None,
    linear: bool = False,
) -> Motion:
    """Motion from rest under `drive` [V], or under a reference [m] where the axis has a loop."""
    scene = scene or Scene(axis)
    if axis.mass == 0:
        return _follow(axis, np.asarray(drive, dtype=float), hooks, start, scene, linear)
    h, substeps = scene.step, scene.substeps
    a11, a12, a21, a22, b1, b2, r1, r2 = exact_step(axis, h)
    m, c, k, k_f, limit, loop = (
        axis.mass,
        axis.damping,
        axis.stiffness,
        axis.force_constant,
        axis.drive_limit,
        axis.loop,
    )
    on_drive = [(x.drive, x.direct) for x in hooks if x.drive]
    on_force = [x.force for x in hooks if x.force]
    q = v = summed = asked = 0.0
    t, half, F, felt = start, h / 2, 0.0, 0.0
    qs, vs, us = [], [], []
    given = np.asarray(drive, dtype=float)
    rises = fine_rise(given, linear, substeps).tolist() if loop is None else [0.0] * (len(given) * substeps)
    for count, (u, rise) in enumerate(zip(fine_drive(given, linear, substeps).tolist(), rises, strict=True)):
        if loop is not None:
            if count % substeps == 0:  # a digital controller: computed at the sample, held until the next
                reference = float(given[count // substeps])
                asked = loop.velocity_gain * (loop.position_gain * (reference - q) - v) + loop.integral_gain * summed
            summed += (u - q) * h
            u = asked
        u = min(max(u, -limit), limit)
        for law, direct in on_drive:
            if rise:
                if direct is None:
                    rise = law(t + half, u + rise / 2) - law(t + half, u - rise / 2)
                else:
                    rise *= direct
            u = law(t + half, u)
        qs.append(q), vs.append(v), us.append(u)
        F = k_f * u
        if on_force:
            # with the laws' force of the step before: a stage that friction holds has no speed
            v_mid = v + half * (F + felt - c * v - k * q) / m
            q_mid = q + half * v
            felt = sum(law(t + half, q_mid, v_mid) for law in on_force)
            F += felt
        dF = k_f * rise
        q, v = a11 * q + a12 * v + b1 * F + r1 * dF, a21 * q + a22 * v + b2 * F + r2 * dF
        t += h
    return Motion(start + h * np.arange(len(qs)), np.array(qs), np.array(vs), np.array(us), substeps)


def _follow(axis: Axis, drive: Array, hooks: Sequence[Hooks], start: float, scene: Scene, linear: bool) -> Motion:
    """The motion of an axis without mass: at the beginning of every step, where the samples are."""
    h, n, substeps = scene.step, len(drive), scene.substeps
    t = start + h * np.arange(n * substeps)
    u = np.interp(np.arange(n * substeps) / substeps, np.arange(n), drive) if linear else np.repeat(drive, substeps)
    for hook in hooks:
        if hook.drive:
            u = np.array([hook.drive(time, value) for time, value in zip(t.tolist(), u.tolist(), strict=True)])
    q = axis.force_constant * u / axis.stiffness
    return Motion(t, q, np.gradient(q, h), u, substeps)


def read(motion: Motion, hooks: Sequence[Hooks] = (), ambient: Array | None = None) -> Array:
    """The sensor's signal at the samples, noise-free, (n,) [m]; `ambient` (n,) [K]."""
    n = len(motion.time) // motion.substeps
    T = np.full(n, 295.15) if ambient is None else ambient
    T_fine = np.repeat(T, motion.substeps)
    y = motion.position
    for x in hooks:
        if x.carried:
            y = x.carried(motion.time, y, motion.drive)
    for x in hooks:
        if x.sensed:
            y = x.sensed(motion.time, y, T_fine)
    return y[:: motion.substeps]


def digitise(time: Array, y: Array, hooks: Sequence[Hooks]) -> Array:
    """What the converter makes of the noisy signal `y` (n,) at `time` (n,)."""
    for x in hooks:
        if x.digital:
            y = x.digital(time, y)
    return y
