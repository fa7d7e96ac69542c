"""A step at one moment: of a force or of a reading."""

from typing import ClassVar

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State, itself
from ctrlgen.effects._smooth_step import CLOCK, WHEN, smooth_step


class Step(Effect, listed=False):
    """Delta x = A e(t), e from 0 to 1 within the time T about the moment t_0: one law, named once per place."""

    source = "definition"
    at_bounds = itself("moment", "rise")
    family = Family.EVENTS
    states: ClassVar[tuple[State, ...]] = CLOCK

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return getattr(p, self.amplitude().name) * smooth_step(s, p)


class ForceStep(Step):
    """Delta F = f e(t), e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    title = (
        "A force that sets in at a moment: something dropped on the stage, a cable that drags, air that is switched on"
    )
    place = Place.FORCE
    requires = frozenset({"force"})
    active = True
    params = (Param("force", "channel", (-1.0, 1.0), "after the step", off=0.0), *WHEN)


class SensorStep(Step):
    """Delta y = b e(t), e from 0 to 1 within the time T about the moment t_0. Holds for one event."""

    title = "A reading that jumps at a moment: counts lost, a target touched"
    place = Place.SENSOR
    params = (Param("offset", "channel", (-1e3, 1e3), "after the step", off=0.0), *WHEN)


class SensorStepPerRecord(Step):
    """Delta y = g b e(t), db/dt = 0: b is constant within a record, another in each, and fitted there; g = 1.

    Holds for one event in one of several runs, which begin on a clock of their own. Outside a diagnosis b = 0.
    """

    title = "A reading that jumps at a moment of one record: counts lost, a target touched"
    place = Place.SENSOR
    params = (Param("share", "1", (0.0, 2.0), "1: the offset is free", off=0.0), *WHEN)
    states = (*CLOCK, State("offset", "channel", 1.0, per_record=True))

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.share * s.states.offset * smooth_step(s, p)
