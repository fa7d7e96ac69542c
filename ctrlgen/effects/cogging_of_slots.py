"""A force that repeats along the way with its second harmonic: slots that are sharper than a sine."""

import math

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself

SHARE = "of the second harmonic per largest force of the first"


class CoggingOfSlots(Effect):
    """F = -A (sin p + a sin 2p + b cos 2p), p = 2 pi d/Lambda + phi: the second harmonic is sqrt(a^2 + b^2) of the first.

    Of a potential, so that it takes and gives back. Holds as `cogging`.
    """

    place = Place.FORCE
    family = Family.PERIODIC
    requires = frozenset({"force", "velocity"})
    source = (
        "T. Sebastian, V. Gangla, IEEE Trans. Ind. Appl. 32 (1996) 730: cogging torque, periodic in the slots and poles"
    )
    params = (
        Param("force", "channel", (-2.0, 2.0), "A: largest force of the first harmonic", off=0.0),
        Param("period", "travel", (1e-4, 2.0), "Lambda: way of one period"),
        Param("phase", "deg", (-360.0, 360.0), "phi: phase at home"),
        Param("sine", "1", (-1.0, 1.0), f"a: share {SHARE}, in phase with it"),
        Param("cosine", "1", (-1.0, 1.0), f"b: share {SHARE}, a quarter of its own period ahead"),
    )
    at_bounds = itself("period", "phase", "sine", "cosine")
    of_even_harmonics = ("sine", "cosine")

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        angle = 2 * math.pi * s.displacement / p.period + p.phase
        return -p.force * (ca.sin(angle) + p.sine * ca.sin(2 * angle) + p.cosine * ca.cos(2 * angle))
