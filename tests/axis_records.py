"""Records of the flexure axis that ctrlgen had no part in: exact steps of m, c, k, ten or more a sample, and their fitters."""

from __future__ import annotations

import numpy as np
from conftest import AXIS_FILE
from scipy.signal import cont2discrete

from ctrlgen import load_device
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.recordings.recording import Record, Recording

H, N, NOISE = 1e-3, 2500, 5e-9  # sample time [s], samples, noise of a reading [m]
SETTLING = 0.5  # s, some dozen time constants of the stage
M, C, K, KF = 0.5, 30.0, 2e5, 10.0
AXIS = load_device(AXIS_FILE)
FINE = 10  # steps a sample
BACKLASH = Hypothesis("backlash", "stage:axis", "axis")
LATE = Hypothesis("log_creep", "stage:axis", "axis")
LIMIT = Hypothesis("saturation", "actuator:axis", "axis")


def move(u, force=None, fine=10, numbers=(M, C, K, KF)):
    """Position [m] of the axis under `u` [V], held, plus force(t, q, v, memory) -> (N, memory)."""
    m, c, stiffness, k_f = numbers
    A, B = np.array([[0, 1], [-stiffness / m, -c / m]]), np.array([[0], [1 / m]])
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), H / fine)
    (a_qq, a_qv), (a_vq, a_vv), (b_q, b_v) = *Ad.tolist(), Bd[:, 0].tolist()  # plain numbers are quick one at a time
    q, v, memory, extra, out = 0.0, 0.0, 0.0, 0.0, []
    for k, volts in enumerate(np.asarray(u, float).tolist()):
        out.append(q)
        for j in range(fine):
            if force is not None:
                extra, memory = force((k + j / fine) * H, q, v, memory)
            pushed = k_f * volts + extra
            q, v = a_qq * q + a_qv * v + b_q * pushed, a_vq * q + a_vv * v + b_v * pushed
    return np.array(out, float)


def drive(n=N, slow=1.5, fast=0.3):
    t = np.arange(n) * H
    return (
        slow * np.sin(2 * np.pi * 2.3 * t) + fast * np.sin(2 * np.pi * 13.1 * t + 1) + 0.2 * np.sin(2 * np.pi * 41 * t)
    )


def record(u, y, role, first=0.0, h=H):
    n = len(u)
    u, y = (np.reshape(v, (n, -1)) for v in (u, y))
    time = first + np.arange(n) * (h if np.isfinite(h) else 1.0)
    return Record(role, role, time, h, u, y, False, None, np.ones(y.shape, bool))


def axis_fitter(force=None, n=N, seed=3, change=lambda y, u: y, u=None, white=None, numbers=(M, C, K, KF)):
    """A record to fit and one to hold out, of another drive, with white noise or what `white` makes of it."""
    rng = np.random.default_rng(seed)
    fit_u, held_u = (drive(n), 1.2 * np.sin(2 * np.pi * 1.7 * np.arange(n) * H)) if u is None else (u, u)
    n, parts = len(fit_u), []
    for role, given in (("fit", fit_u), ("hold_out", held_u)):
        e = rng.standard_normal(n)
        y = change(move(given, force, numbers=numbers), given) + NOISE * (e if white is None else white(e))
        parts.append(record(given, y, role, first=0.0 if role == "fit" else n * H))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, SETTLING))


def drives(n: int) -> tuple[np.ndarray, np.ndarray]:
    """One that turns every six samples, and one that rests, steps and turns."""
    t = np.arange(n) * H
    fit = 0.5 * np.sin(2 * np.pi * 83 * t) + 0.4 * np.sin(2 * np.pi * 23 * t)
    return fit, np.where(t < 0.1, 0.0, 0.6 * np.sin(2 * np.pi * 61 * t) + 0.3 * np.sign(np.sin(2 * np.pi * 3.1 * t)))


def fitter_of(change=lambda u: move(u), after=lambda y: y, n=1500, seed=4) -> Fitter:
    """A rest, a record to fit and one to hold out; `change` (u -> position), `after` (noisy reading -> reading)."""
    rng = np.random.default_rng(seed)
    parts = [record(np.zeros(600), after(NOISE * rng.standard_normal(600)), "rest")]
    for u, role in zip(drives(n), ("fit", "hold_out"), strict=True):
        parts.append(record(u, after(change(u) + NOISE * rng.standard_normal(n)), role))
    recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), tuple(parts), ())
    return Fitter(recording, estimate_noise(recording, SETTLING))


def runs_from_rest(force=None, read=lambda y: y, n=2000, seed=2) -> Recording:
    """A rest, a run to fit and one to hold out that begin there, of an axis under another `force` as in `move`; `read` (position ->
    reading without noise)."""
    rng, t = np.random.default_rng(seed), H * np.arange(n)
    parts = [record(np.zeros(400), read(np.zeros(400)) + NOISE * rng.standard_normal(400), "rest")]
    fit = 0.9 * np.sin(2 * np.pi * 1.3 * t) + 0.25 * np.sin(2 * np.pi * 9.7 * t)
    held = 0.8 * np.sin(2 * np.pi * 1.9 * t + 1) + 0.3 * np.sin(2 * np.pi * 6.1 * t)
    for role, u in (("fit", fit), ("hold_out", held)):
        u = np.minimum(t / 0.1, 1.0) * u
        parts.append(record(u, read(move(u, force, fine=100)) + NOISE * rng.standard_normal(n), role))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (None,), tuple(parts), ())


def fine(u: np.ndarray, push: np.ndarray | float = 0.0) -> np.ndarray:
    """The position ten times a sample, under a drive held and another force `push` [N]."""
    A, B = np.array([[0, 1], [-K / M, -C / M]]), np.array([[0], [1 / M]])
    Ad, Bd, *_ = cont2discrete((A, B, np.eye(2), np.zeros((2, 1))), H / FINE)
    x, out = np.zeros(2), []
    for force in KF * np.repeat(u, FINE) + push:
        out.append(x[0])
        x = Ad @ x + Bd[:, 0] * force
    return np.array(out)


def played(u: np.ndarray, gap: float = 6e-8) -> np.ndarray:
    """The position behind a play, dragged along between the samples too."""
    w, out = 0.0, []
    for q in fine(u):
        w = max(min(w, q + gap / 2), q - gap / 2)
        out.append(w)
    return np.array(out[::FINE])
