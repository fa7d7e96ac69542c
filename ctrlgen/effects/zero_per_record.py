"""A sensor whose zero is set anew for every record."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State


class ZeroPerRecord(Effect):
    """Delta y = g b, dy/dt = 0: b is constant within a record, another in each, and fitted there; g = 1.

    A device file states it of readings whose zero is arbitrary: force sensors, charge amplifiers, incremental scales. Holds
    where nothing else keeps the mean of a reading. Outside a diagnosis b = 0.
    """

    place = Place.SENSOR
    family = Family.GAIN
    source = "definition"
    params = (Param("share", "1", (0.0, 2.0), "1: the zero is free", off=0.0),)
    states = (State("zero", "channel", 1.0, per_record=True),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * s.states.zero
