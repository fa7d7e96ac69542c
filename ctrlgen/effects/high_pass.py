"""A sensor that forgets what stands still, as a charge amplifier that leaks does."""

from types import MappingProxyType

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, ShapeBounds, State


class HighPass(Effect):
    """dw/dt = (y - w)/tau, Delta y = -g w: g = 1 is a high-pass of first order, whose corner is 1/(2 pi tau); below, only a share leaks.

    Holds for one leak, R C of the amplifier or of its coupling, and where home is read as zero.
    """

    place = Place.SENSOR
    family = Family.TIMING
    order = 2
    source = "Kistler Instrumente AG, glossary: time constant of a charge amplifier, R C of its feedback"
    params = (
        Param("share", "1", (0.0, 1.2), "g: share of a constant reading that is lost in the end", off=0.0),
        Param("tau", "s", (1e-3, 1e4), "time constant of the leak", paced=True),
    )
    # what is forgotten within a millisecond is a gain
    at_bounds = MappingProxyType({"tau": ShapeBounds(low="sensor_gain")})
    states = (State("w", "channel", 1.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.share * s.states.w

    def rates(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"w": (s.value - s.states.w) / p.tau}
