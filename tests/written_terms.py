"""Terms and rates that laws share, written out in numpy: for `written_laws`."""

from __future__ import annotations

import numpy as np
from numpy import abs, cos, exp, sign, sin, tanh
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

ROUNDING = 1e-12
H = 0.01
TWO_PI = 2 * np.pi
EVENT = {"moment": 0.7, "rise": 0.4}


def event(s, p):
    """From 0 to 1, half at the moment; a logistic curve of scale T/(2 pi)."""
    return 1 / (1 + exp(-(s.t - p.moment) * TWO_PI / p.rise))


SIDES = {"above": 1, "below": -1}


def beyond(x, width):
    """From 0 to 1, half at the edge; a logistic curve of scale w/4."""
    return 1 / (1 + exp(-4 * x / width))


def past(s, p, sign):
    """The same beyond an edge of the displacement, no faster than within a quarter of a sample."""
    return beyond(sign * (s.displacement - p.edge), np.hypot(p.width, s.velocity * H / 4))


def on_stretch(s):
    """On the stretch of 0.5 about 0.2 with the edges of `past`, 0.3 wide."""
    width = np.hypot(0.3, s.velocity * H / 4)
    return beyond(s.displacement + 0.05, width) - beyond(s.displacement - 0.45, width)


def ramp(x, corner):
    """From zero on in proportion, the corner rounded."""
    return x * x / (x + corner) if x > 0 else 0.0


def too_fast(s, p):
    x = np.maximum(abs(s.velocity) - p.speed, 0)
    return -p.damping * sign(s.velocity) * x * x / (x + p.speed / 100)


def turned(a: int, b: int):
    """What a rotation by p.angle from axis a toward b adds to component s.index."""

    def change(s, p):
        R = np.eye(3)
        R[[a, b], [a, b]], R[a, b], R[b, a] = cos(p.angle), -sin(p.angle), sin(p.angle)
        return np.concatenate([R @ s.all[:3], R @ s.all[3:]])[s.index] - s.value

    return change


def lost(s, p):
    """A conductance beyond the stated one: b DT (DT/T_rest)^0.6, but for the last thousandth of T_rest."""
    rise, rest = s.temperature - s.temperature_at_rest, s.temperature_at_rest
    return -s.holding_heat * p.coefficient * rise * (np.hypot(rise, rest / 1000) / rest) ** 0.6


def dead(s, p):
    e = np.hypot(p.rounding * p.width, 1e-6 * s.scale)
    return -(np.hypot(s.value + p.width, e) - np.hypot(s.value - p.width, e)) / 2


def clipped(s, p):
    e = p.level / 200
    return p.share * ((np.hypot(s.value + p.level, e) - np.hypot(s.value - p.level, e)) / 2 - s.value)


def gripping(s, p):
    """Springs that slip at r_j, each behind half the slack to either side."""
    r = p.reach * np.arange(1, 9) / 8
    plays = (
        np.array([getattr(s, f"play{j}") for j in range(1, 9)]) + s.turn + np.clip(s.start, -1, 1) * (r + p.slack / 2)
    )
    e = s.displacement - plays
    return -p.force * np.sum(sign(e) * np.maximum(abs(e) - p.slack / 2, 0)) / r.sum()


def met(s, p):
    """Where the beam through the point that is read meets the plane that turned and moved with the platform."""
    a = s.index - 3
    n = Rotation.from_rotvec(np.ravel(s.all[:3])).as_matrix()[:, a]
    stands = np.ravel(s.all[3:]) + n * p.position  # a point of the plane
    return p.share * (n @ stands / n[a] - p.position - s.value)


def collimated(s, p):
    """The face that looks along the partner's axis, drawn as a vector and turned."""
    a, b = s.index, s.partner
    c = 3 - a - b
    n = Rotation.from_rotvec(np.ravel(s.all[:3])).apply(np.eye(3)[b])
    away = np.cross(np.eye(3)[a], np.eye(3)[b])[c]  # where a small turn about a takes it
    return p.share * (np.arctan2(away * n[c], n[b]) - s.value)


WEIGHTS = {f"c{j}": float(np.cos(3 * j)) for j in range(1, 18)}


def bends(share):
    """Cubic B-splines on knots a fourteenth apart, held beyond 0 and 1."""
    knots = (np.arange(21) - 3) / 14
    return float(BSpline(knots, list(WEIGHTS.values()), 3)(np.clip(share, 0, 1)))


def remembered(s, p):
    j = np.arange(1, 9)
    lag = s.displacements[s.partner] - np.array([getattr(s, f"play{k}") for k in j])
    return p.size * float(np.array([WEIGHTS[f"c{k}"] for k in j]) @ (lag / (0.3 * j / 8)))


def slewed(s, p):
    return p.share * (s.mean - s.rise / 2 + s.w - s.value)


def stop(s, p):
    side, e = sign(p.gap), 1e-3 * s.travel
    x = max(side * (s.displacement - p.gap), 0.0)
    return -side * p.stiffness * x**2 / (x + 1e-3 * e) * (1 + x / e) ** (p.power - 1)


def buffer(s, p):
    side = sign(p.gap)
    x = max(side * (s.displacement - p.gap), 0.0)
    return -side * p.stiffness * x**2 / (x + 1e-6 * s.travel) * max(1 + side * s.velocity / p.speed, 0.0)


def logarithmic(s, p):
    return p.gain / 2 * sum(min(max(2 * p.decades - j, 0), 1) * getattr(s, f"z{j}") for j in range(9))


def powered(s, p):
    """As `logarithmic`, each half a decade 10^(p/2) times as much."""
    weights = [min(max(2 * p.decades - j, 0), 1) * 10 ** (p.exponent * j / 2) for j in range(9)]
    return p.gain / 2 * sum(w * getattr(s, f"z{j}") for j, w in enumerate(weights))


def weighted(s, p, here):
    """sum_j w_j (here - play_j); each play is counted from where it began, a share of its radius off the turn."""
    j = np.arange(1, 9)
    w, began = j**-p.taper, s.turn + np.clip(s.start, -1, 1) * p.reach * j / 8
    return float(w @ (here - began - [getattr(s, f"play{k}") for k in j])) / w.sum()


def heavy_narrow(s, p):
    """sum_j w_j (value - play_j) of plays r (j/8)^2, each of which takes its part of the weight that the narrower ones leave."""
    left, behind = 1.0, 0.0
    for j in range(1, 9):
        w = left * (PARTS[f"part{j}"] if j < 8 else 1.0)
        radius = p.reach * (j / 8) ** 2
        behind += w * (s.value - getattr(s, f"play{j}") - s.turn - np.clip(s.start, -1, 1) * radius)
        left -= w
    return behind


PARTS = {f"part{j}": 0.9 - 0.1 * j for j in range(1, 8)}


def risen(drive):
    """What plays of reach 0.3 and taper 0.5 come to together once a drive has risen to `drive`."""
    j = np.arange(1, 9)
    return drive - float(j**-0.5 @ np.minimum(0.3 * j / 8, drive)) / (j**-0.5).sum()


def dahl_rate(s, p):
    v = s.velocity / p.smoothing
    return s.velocity * (1 - s.z / tanh(v)) / p.reach


def lugre_rate(s, p):
    g = 1 + (p.breakaway - 1) * exp(-((s.velocity / p.speed) ** 2))
    return (s.velocity - abs(s.velocity) * s.z / g) / p.reach


def second_mass(s, p):
    w, m = TWO_PI * p.frequency, p.stiffness / (TWO_PI * p.frequency) ** 2
    return p.stiffness * (s.q - s.displacement) + 2 * p.damping * w * m * (w * s.p - s.velocity)


def second_mass_rates(s, p):
    w = TWO_PI * p.frequency
    return {
        "q": w * s.p,
        "p": (w**2 * (s.displacement - s.q) + 2 * p.damping * w * (s.velocity - w * s.p)) / w,
    }


# kind: shape parameters, term, rates where it has some
