"""A sensor that picks up the drive of an actuator: electrical feedthrough, by a capacitance or a lead that both share."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself


class Feedthrough(Effect):
    """Delta y = g ((1 - b) u_k + b u_(k-1)), u what the amplifier `of` delivers at samples k, whatever the stage does.

    b = 0: the drive of the reading's own row. b = 1: a reading that is taken just before the drive is put out, or averaged since the
    row before; between the two one that is taken b of a sample early. Settled Delta y = g u. Holds where leads and electronics pass on
    all that is recorded: below their bandwidth and, for a capacitance into a charge amplifier, above its lower cut-off.
    """

    title = "A sensor that picks up the drive of an actuator: electrical feedthrough"
    place = Place.SENSOR
    family = Family.CROSS_TALK
    pairs = True
    partner_place = Place.DRIVE
    order = 1  # the electronics pick it up: behind the transducer, before what filters and samples
    requires = frozenset({"delivered"})
    source = "J. E.-Y. Lee, A. A. Seshia, Sensors and Actuators A 167 (2011) 237: resonators embedded in feedthrough"
    params = (
        Param("gain", "channel/partner", (-0.5, 0.5), "g: reading per drive", off=0.0),
        Param("before", "1", (0.0, 1.0), "b: share that is of the drive one sample before"),
    )
    at_bounds = itself("before")
    states = (
        State("now", "partner", 1.0, stepped=True, free=True),
        State("before", "partner", 1.0, stepped=True),
    )

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        now = s.drives[s.partner]
        return p.gain * (now + p.before * (s.states.before - now))

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return {"now": s.drives[s.partner], "before": s.states.now}

    def resting(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return dict.fromkeys(("now", "before"), s.drives[s.partner])
