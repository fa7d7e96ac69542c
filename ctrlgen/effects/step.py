"""A step at one moment: of a force or of a reading."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, itself
from ctrlgen.effects._smooth_step import CLOCK, WHEN, smooth_step


class Step(Effect, listed=False):
    """Delta x = A e(t), e from 0 to 1 within the time T about the moment t_0: one law, named once per place."""

    source = "definition"
    at_bounds = itself("moment", "rise")
    family = Family.EVENTS
    states = CLOCK

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
