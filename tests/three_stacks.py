"""Three stacks on two axes that harden, for tests of more drives than axes, and references for their drives: scipy's linear programme
for what can be pushed, its SLSQP for the least effort."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog, minimize

import ctrlgen
from ctrlgen import build_model, load_scenario

B = 0.2 * np.array([[1.0, 0.5, 0.0], [0.0, -0.5, 1.0]])  # N/V
LOW, HIGH = np.array([-100.0, 0.0, -20.0]), np.array([100.0, 150.0, 130.0])  # V
RANGE = HIGH - LOW
K, K3 = 1e6, 1e13
WEIGHTS = {"b": 4.0, "c": 0.25}
W = np.array([1.0, 4.0, 0.25])


def stage(**other):
    """Three stacks on two axes that harden."""
    words = dict(
        parameters={"g": "0.2 N/V", "k": "1 N/um", "k3": "1e13 N/m^3"},
        drive={"a": "100 V", "b": ("0 V", "150 V"), "c": ("-20 V", "130 V")},
        axes={"x": "50 um", "y": "50 um"},
        force=lambda u, p: [p.g * (u.a + 0.5 * u.b), p.g * (u.c - 0.5 * u.b)],
        restoring_force=lambda d, p: p.k * d.vector + p.k3 * d.vector**3,
    )
    return ctrlgen.user_device("stage", **(words | other))


def heavy(**other):
    """The same with mass and damping, without hardening."""
    return stage(
        parameters={"g": "0.2 N/V", "k": "1 N/um", "m": "1 kg", "c": "100 N*s/m"},
        restoring_force=lambda d, p: p.k * d.vector,
        damping_force=lambda v, p: p.c * v.vector,
        mass=lambda p: [p.m, p.m],
        **other,
    )


def circle(micrometres, x=0.0, y=0.0):
    return f'kind = "circle"\ndiameter = "{micrometres} um"\ncentre = {{ x = "{x} um", y = "{y} um" }}\nplane = ["x", "y"]\n'


def loaded(folder, device, path, timing='sample_rate = "1 kHz"\nduration = "0.1 s"\n'):
    (folder / "scenario.toml").write_text(f'title = "t"\ndevice = "{device.name}"\n{timing}[path]\n{path}')
    return load_scenario(folder, device), build_model(device)


def forces(z):
    return K * z + K3 * z**3


def reference(f, weights):
    """The least effort by SLSQP, from where a linear programme ends; in shares of the ranges."""
    S = B * RANGE
    start = linprog(np.zeros(3), A_eq=S, b_eq=f, bounds=list(zip(LOW / RANGE, HIGH / RANGE, strict=True))).x

    def effort(s):
        return np.sum(weights * s**2)

    found = minimize(
        effort,
        start,
        jac=lambda s: 2 * weights * s,
        bounds=list(zip(LOW / RANGE, HIGH / RANGE, strict=True)),
        constraints={"type": "eq", "fun": lambda s: S @ s - f, "jac": lambda s: S},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 500},
    )
    assert found.success
    return found.x * RANGE


def can_push(f):
    return linprog(np.zeros(3), A_eq=B, b_eq=f, bounds=list(zip(LOW, HIGH, strict=True))).status == 0
