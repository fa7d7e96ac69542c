"""An error that repeats along the path: interferometer fringe, resolver or encoder pitch, screw pitch."""

import math

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself


class Cyclic(Effect):
    """Delta y = A sin(2 pi y/Lambda + phi). One harmonic; a distorted error takes several effects.

    Holds for A below Lambda/2 pi, so that the reading still rises with the position, and where a period fits into the
    travel: part of a longer one is an offset, a gain and a bow. For positions and angles only.
    """

    place = Place.SENSOR
    family = Family.PERIODIC
    channel_unit = ("m", "rad")
    source = "N. Bobroff, Appl. Opt. 26 (1987) 2676: residual errors in laser interferometry"
    params = (
        Param("amplitude", "channel", (-2.5e3, 2.5e3), "largest error", off=0.0),
        Param(
            "period",
            "channel",
            (1e-4, 1e4),
            "path of one period",
        ),
        Param("phase", "deg", (-360.0, 360.0), "phase at home"),
    )
    at_bounds = itself("period", "phase")

    @classmethod
    def contradiction(cls, p: dict[str, float]) -> str:
        back = 2 * math.pi * abs(p["amplitude"]) >= p["period"]
        return "its amplitude is so large beside its period that the reading would turn back" if back else ""

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.amplitude * ca.sin(2 * ca.pi * s.value / p.period + p.phase)


class CyclicFromHome(Cyclic):
    """Delta y = A (sin(2 pi y/Lambda + phi) - sin(phi)): home is read as zero, as by incremental scales and interferometers.

    Holds as `cyclic`, and where the reading was set to zero at home.
    """

    title = "An error that repeats along the path, of a sensor that is set to zero at home"

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return super().term(s, p) - p.amplitude * ca.sin(p.phase)
