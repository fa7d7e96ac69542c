"""A converter, counter or encoder of coarse steps."""

import casadi as ca
import numpy as np

from ctrlgen.effects import Effect, Param, Place
from ctrlgen.numerics.quantisation_step import quantisation_step


class Quantisation(Effect):
    """Delta y = s (q floor(y/q + 1/2) - y), s = 1 for true rounding to steps q.

    Holds for rounding to the nearest step. Linear in s; in q and y it jumps: search q, do not descend. Readings that
    all lie on a lattice show q themselves; what it does to them is q/sqrt 12.
    """

    place = Place.SENSOR
    stage = 4
    source = "B. Widrow, I. Kollar, Quantization Noise (2008)"
    params = (
        Param("share", "1", (0.0, 1.5), "1 where every reading is rounded", off=0.0),
        Param("quantum", "channel", (1e-7, 1.0), "step", grid=(1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1)),
    )

    def term(self, s, p):
        return p.share * (p.quantum * ca.floor(s.value / p.quantum + 0.5) - s.value)

    @classmethod
    def read_off(cls, readings):
        step = quantisation_step(readings)
        return ({"share": 1.0, "quantum": step}, step / np.sqrt(12.0)) if step else None
