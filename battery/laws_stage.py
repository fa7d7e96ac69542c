"""Laws of the stage: forces on the moving mass, and what happens between it and the sensor's target."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from battery.plant_axis import Array, Hooks, Scene


def make_stiffening(scene: Scene, a: float, scale: float, quintic: float) -> Hooks:
    """F = -a scale (x^3 + quintic x^5), x = q/scale, `a` [N/m]: a cubic with a little quintic. a < 0 softens."""

    def force(t: float, q: float, v: float) -> float:
        x = q / scale
        return -a * scale * x**3 * (1 + quintic * x * x)

    return Hooks(force=force)


def make_hysteresis(scene: Scene, a: float, radii: list[float], weights: list[float]) -> Hooks:
    """Prandtl-Ishlinskii: F = -a sum_i w_i s_i, s_i the stop operator of radius r_i [m]; `a` [N/m]."""
    state = [0.0] * len(radii)
    last = [0.0]
    members = list(zip(range(len(radii)), radii, weights, strict=True))

    def force(t: float, q: float, v: float) -> float:
        moved = q - last[0]
        last[0] = q
        total = 0.0
        for i, r, w in members:
            s = min(max(state[i] + moved, -r), r)
            state[i] = s
            total += w * s
        return -a * total

    return Hooks(force=force)


def _relaxed(q: Array, tau: float, h: float) -> Array:
    """First-order lag of `q` with time constant `tau`, exact for q held over a step."""
    d = math.exp(-h / tau)
    return lfilter([0, 1 - d], [1, -d], q)


def make_log_creep(scene: Scene, a: float, first: float, decades: float) -> Hooks:
    """Target moves by q + a sum_i lag(q, tau_i)/10, ten tau_i evenly over `decades` from `first` [s]: a logarithm of time."""
    taus = np.logspace(np.log10(first), np.log10(first) + decades, 10)

    def carried(t: Array, q: Array, u: Array) -> Array:
        return q + a * sum(_relaxed(q, float(tau), scene.step) for tau in taus) / 10

    return Hooks(carried=carried)


def make_creep(scene: Scene, a: float, tau: float, second: float) -> Hooks:
    """q + a (0.85 lag(q, tau) + 0.15 lag(q, second tau)): not quite one relaxation."""

    def carried(t: Array, q: Array, u: Array) -> Array:
        return q + a * (0.85 * _relaxed(q, tau, scene.step) + 0.15 * _relaxed(q, second * tau, scene.step))

    return Hooks(carried=carried)


def make_backlash(scene: Scene, a: float) -> Hooks:
    """The sensor's target is dragged through a gap a [m]."""

    def carried(t: Array, q: Array, u: Array) -> Array:
        half, x, out = a / 2, 0.0, []
        for target in q.tolist():
            x = min(max(x, target - half), target + half)
            out.append(x)
        return np.array(out)

    return Hooks(carried=carried)


def lugre(scene: Scene, level: Callable[[float], float], stiffness: float) -> Callable[[float, float, float], float]:
    """LuGre: dz/dt = v - s_0 |v| z/g(v), F = -(s_0 z + s_1 dz/dt). C. Canudas de Wit et al., IEEE TAC 40 (1995) 419.

    The bristle's equation is solved exactly for v held over a step; the force is that of the step's middle.
    """
    h, m = scene.step, scene.axis.mass
    s_1 = 0.3 * math.sqrt(stiffness * m)
    z = [0.0]

    def force(t: float, q: float, v: float) -> float:
        g = level(v)
        end = math.copysign(g / stiffness, v)
        before = z[0]
        kept = math.exp(-stiffness * abs(v) / g * h / 2)
        middle = end + (before - end) * kept
        z[0] = end + (middle - end) * kept
        # s_1 fades with speed, so that the bristles add no viscous drag while sliding
        return -(stiffness * middle + s_1 * math.exp(-((v / (0.02 * scene.speed)) ** 2)) * (z[0] - before) / h)

    return force


def make_coulomb(scene: Scene, a: float, presliding: float) -> Hooks:
    """LuGre with a constant level a [N]; bristles bend by `presliding` [m] before they slip."""
    return Hooks(force=lugre(scene, lambda v: a, a / presliding)) if a else Hooks()


def make_stribeck(scene: Scene, a: float, presliding: float, ratio: float, speed: float) -> Hooks:
    """LuGre with g(v) = a (1 + (ratio - 1) exp(-(v/speed)^2)) [N]."""
    if not a:
        return Hooks()
    return Hooks(force=lugre(scene, lambda v: a * (1 + (ratio - 1) * math.exp(-((v / speed) ** 2))), a / presliding))


def make_viscous(scene: Scene, a: float, width: float) -> Hooks:
    """Damping that is stronger one way: F = -a v (1 + tanh(v/width))/2, `a` [N s/m]."""
    return Hooks(force=lambda t, q, v: -a * v * (1 + math.tanh(v / width)) / 2)


def make_quadratic_damping(scene: Scene, a: float) -> Hooks:
    """F = -a v |v|, `a` [N s^2/m^2]."""
    return Hooks(force=lambda t, q, v: -a * v * abs(v))


def make_end_stop(scene: Scene, a: float, peak: float, contact: float, side: float) -> Hooks:
    """A Hertz contact F = -contact delta^1.5 (1 + 0.3 s/m delta') beyond (1 - a) `peak` on one `side` (+1, -1)."""
    if a == 0:
        return Hooks()
    at = (1 - a) * peak

    def force(t: float, q: float, v: float) -> float:
        deep = side * q - at
        return -side * contact * deep**1.5 * max(0.0, 1 + 0.3 * side * v) if deep > 0 else 0.0

    return Hooks(force=force)


def make_resonance(scene: Scene, a: float, frequency: float, ratio: float) -> Hooks:
    """A second mass a m on a spring to the stage: own `frequency` [Hz], damping `ratio`.

    r = q_2 - q; the stage feels a m (w^2 r + 2 ratio w r'). Trapezoidal rule on r'' = -w^2 r - 2 ratio w r' - q''.
    """
    h = scene.step
    w = 2 / h * math.tan(math.pi * frequency * h)  # the rule lowers frequencies: bent beforehand
    m2, d = a * scene.axis.mass, 2 * ratio * w
    state = [0.0, 0.0]  # q_2, v_2
    half = (h * w) ** 2 / 4 + h * d / 2

    def force(t: float, q: float, v: float) -> float:
        q2, v2 = state
        new = (v2 * (1 - half) + h * (w * w * (q - q2) + d * v)) / (1 + half)
        middle = (v2 + new) / 2
        state[0], state[1] = q2 + h * middle, new
        return m2 * (w * w * (q2 + h / 2 * middle - q) + d * (middle - v))

    return Hooks(force=force)


def make_cogging(scene: Scene, a: float, period: float, phase: float, second: float) -> Hooks:
    """F = -a (sin p + second sin 2 p), p = 2 pi q/period + phase: slots of a motor, a little sharper than a sine."""

    def force(t: float, q: float, v: float) -> float:
        p = 2 * math.pi * q / period + phase
        return -a * (math.sin(p) + second * math.sin(2 * p))

    return Hooks(force=force)


def make_stiffness(scene: Scene, a: float) -> Hooks:
    """The spring is off by the share a: F = -a k q."""
    return Hooks(force=lambda t, q, v: -a * scene.axis.stiffness * q)


def make_expansion(scene: Scene, a: float, tau: float) -> Hooks:
    """The actuator's own heat moves the target: q + a lag(u^2, tau), `a` [m/V^2]."""
    return Hooks(carried=lambda t, q, u: q + a * _relaxed(u**2, tau, scene.step))


def draw_hysteresis(rng: np.random.Generator, scene: Scene) -> dict[str, list[float]]:
    """Eight to ten stops, radii from 3 % to 150 % of the rms travel."""
    n = int(rng.integers(8, 11))
    radii = scene.travel * np.linspace(0.05, 1.2, n) ** 1.2
    weights = np.exp(-rng.uniform(0.5, 2.0) * np.linspace(0, 1, n)) * rng.uniform(0.7, 1.3, n)
    return {"radii": radii.tolist(), "weights": (weights / weights.sum()).tolist()}


def draw_resonance(rng: np.random.Generator, scene: Scene) -> dict[str, float]:
    """Above the main resonance, inside the excited band."""
    f_0 = math.sqrt(max(scene.axis.stiffness / scene.axis.mass, (2 * math.pi * 8) ** 2)) / 2 / math.pi
    return {"frequency": float(f_0 * rng.uniform(1.2, 1.6)), "ratio": float(rng.uniform(0.01, 0.03))}


DRAW = {
    "stiffening": lambda rng, s: {"scale": s.peak, "quintic": float(rng.choice([0.0, rng.uniform(0, 0.1)]))},
    "softening": lambda rng, s: {"scale": s.peak, "quintic": float(rng.choice([0.0, rng.uniform(0, 0.1)]))},
    "hysteresis": draw_hysteresis,
    "creep": lambda rng, s: {"tau": float(10 ** rng.uniform(-0.7, 0.3)), "second": float(rng.uniform(2, 4))},
    "log_creep": lambda rng, s: {"first": 0.01, "decades": float(rng.uniform(2.5, 3.5))},
    "backlash": lambda rng, s: {},
    "coulomb": lambda rng, s: {"presliding": 0.003 * s.travel},
    "stribeck": lambda rng, s: {
        "presliding": 0.003 * s.travel,
        "ratio": float(rng.uniform(1.5, 2.2)),
        "speed": float(rng.uniform(0.1, 0.3) * s.speed),
    },
    "viscous": lambda rng, s: {"width": 0.05 * s.speed},
    "quadratic_damping": lambda rng, s: {},
    "end_stop": lambda rng, s: {
        "peak": s.peak,
        "contact": 20 * max(s.axis.stiffness, 1e4) / math.sqrt(0.1 * s.peak),
        "side": float(rng.choice([-1, 1])),
    },
    "resonance": draw_resonance,
    "cogging": lambda rng, s: {
        "period": float(s.peak * rng.uniform(0.1, 0.4)),
        "phase": float(rng.uniform(0, 2 * np.pi)),
        "second": float(rng.uniform(0, 0.2)),
    },
    "stiffness": lambda rng, s: {},
    "expansion": lambda rng, s: {"tau": float(10 ** rng.uniform(-0.7, 0.3))},
}
_SPRING = 1e-2
GUESS = {
    "stiffening": lambda s: _SPRING * max(s.axis.stiffness, 1e3),
    "softening": lambda s: -_SPRING * max(s.axis.stiffness, 1e3),
    "hysteresis": lambda s: _SPRING * max(s.axis.stiffness, 1e3),
    "creep": lambda s: 0.01,
    "log_creep": lambda s: 0.02,
    "backlash": lambda s: 0.005 * s.travel,
    "coulomb": lambda s: 0.005 * s.axis.force_constant * s.drive_peak,
    "stribeck": lambda s: 0.005 * s.axis.force_constant * s.drive_peak,
    "viscous": lambda s: 0.05 * s.axis.damping,
    "quadratic_damping": lambda s: 0.05 * s.axis.damping / s.speed,
    "end_stop": lambda s: 0.1,
    "resonance": lambda s: 0.005,
    "cogging": lambda s: 0.002 * s.axis.force_constant * s.drive_peak,
    "stiffness": lambda s: 0.2,
    "expansion": lambda s: 0.01 * s.travel / s.drive_peak**2,
}
