"""S2 C.1 to C.24 beside beam theory integrated over the circular profile, or finite elements, each within its range of t/R."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from scipy.integrate import quad

from ctrlgen.physics import circular_hinge as c

from .row import PrintedNumber, identity
from .s3_hinges import NEEDS_FEM

NU = 0.33
G = 1 / (2 * (1 + NU))  # in units of E
ROUNDING = 1e-9
CLOSED = "closed form, against beam theory integrated over the profile"
THIN = "limit of a thin hinge, against the closed form"
EMPIRICAL = (
    "fit of its authors to finite elements or stress functions, against beam theory; allowed: what these differ by"
)
LOCKED = "rotation of the end locked, which is the deflection less R^2 alpha_z/M_z"

# equation, compliance, t/R at which it is compared (R = b = E = 1), difference that is allowed, reason
EQUATIONS: tuple[tuple[str, str, Callable[[float], float], float, float, str], ...] = (
    ("C.1", "turn", lambda t: c.c1(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.2", "bend", lambda t: c.c2(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.3", "stretch", lambda t: c.c3(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.4", "shear", lambda t: c.c4(1.0, t, 1.0, G), 0.3, ROUNDING, CLOSED),
    ("C.5", "turn", lambda t: c.c5(1.0, t, 1.0, 1.0), 0.01, 0.01, THIN),
    ("C.6", "bend", lambda t: c.c6(1.0, t, 1.0, 1.0), 0.01, 0.01, THIN),
    ("C.7", "stretch", lambda t: c.c7(1.0, t, 1.0, 1.0), 0.01, 0.01, THIN),
    ("C.8", "shear", lambda t: c.c8(1.0, t, 1.0, G), 0.01, 0.01, THIN),
    ("C.9", "turn", lambda t: c.c9(1.0, t, 1.0, 1.0), 0.4, 0.05, EMPIRICAL),
    ("C.10", "turn", lambda t: c.c10(1.0, t, 1.0, 1.0), 0.2, 0.05, EMPIRICAL),
    ("C.11", "turn", lambda t: c.c11(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.12", "bend", lambda t: c.c12(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.13", "stretch", lambda t: c.c13(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.14", "shear", lambda t: c.c14(1.0, t, 1.0, G), 0.3, ROUNDING, CLOSED),
    ("C.15", "turn", lambda t: c.c15(1.0, t, 1.0, 1.0, NU), 0.05, 0.05, EMPIRICAL),
    ("C.16", "turn", lambda t: c.c16(1.0, t, 1.0, 1.0, NU), 0.15, 0.05, EMPIRICAL),
    ("C.17", "turn", lambda t: c.c17(1.0, t, 1.0, 1.0, NU), 0.5, 0.05, EMPIRICAL),
    ("C.18", "turn", lambda t: c.c18(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.19", "bend", lambda t: c.c19(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.20", "stretch", lambda t: c.c20(1.0, t, 1.0, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.21", "shear", lambda t: c.c21(1.0, t, 1.0, 1.0, G, 1.0), 0.3, ROUNDING, CLOSED),
    ("C.22", "turn", lambda t: c.c22(1.0, t, 1.0, 1.0), 0.3, 0.05, EMPIRICAL),
    ("C.23", "locked", lambda t: c.c23(1.0, t, 1.0, 1.0), 0.3, 0.05, EMPIRICAL),
    ("C.24", "stretch", lambda t: c.c24(1.0, t, 1.0, 1.0), 0.3, 0.05, EMPIRICAL),
)


def rows() -> list[PrintedNumber]:
    """Each closed equation over beam theory, and each fitted one over finite elements where scikit-fem is installed, less one."""
    found = []
    for name, what, law, t, allowed, reason in EQUATIONS:
        at = f"{reason}, at t/R = {t:g}"
        if reason != EMPIRICAL:
            found.append(identity("S2", name, float(law(t)) / _integrated(what, t) - 1, allowed, at))
        elif find_spec("skfem") is None:
            found.append(PrintedNumber("S2", name, "0", "1", None, NEEDS_FEM, allowed))
        else:
            by_reading = {key: float(law(t)) / value - 1 for key, value in _by_finite_elements(what, t).items()}
            nearest = min(by_reading.values(), key=abs)
            every = ", ".join(f"{100 * off:+.1f} % {key}" for key, off in by_reading.items())
            found.append(identity("S2", name, nearest, allowed, f"{at}: {every}"))
    return found


def _by_finite_elements(what: str, t: float) -> dict[str, float]:
    """The compliance of a plane notch for each way to read the motion of its ends."""
    from . import hinge_fem

    found = {}
    # the rotation of the end sections is the same whichever of their points is read
    for reading in (hinge_fem.Reading.CENTRE,) if what == "turn" else hinge_fem.Reading:
        C = hinge_fem.compliance(hinge_fem.Notch(t, NU), reading)
        locked = C[1, 1] - C[1, 2] ** 2 / C[2, 2]
        found[reading.name.lower()] = float({"turn": C[2, 2], "stretch": C[0, 0], "locked": locked}[what])
    return found


def _integrated(what: str, t: float) -> float:
    """Compliance about the free end by beam theory over the profile t + 2R - 2 sqrt(R^2 - x^2), R = b = E = 1."""

    def over(power: int, arm: Callable[[float], float]) -> float:
        def integrand(phi: float) -> float:
            return arm(np.sin(phi)) * np.cos(phi) / (t + 2 * (1 - np.cos(phi))) ** power

        return float(quad(integrand, -np.pi / 2, np.pi / 2, epsabs=0, epsrel=1e-12, points=[0.0], limit=400)[0])

    stretch = over(1, lambda x: 1.0)
    integrals = {
        "turn": lambda: 12 * over(3, lambda x: 1.0),
        "bend": lambda: 12 * over(3, lambda x: (1 - x) ** 2),
        "stretch": lambda: stretch,
        "shear": lambda: stretch / G,
    }
    return integrals[what]()
