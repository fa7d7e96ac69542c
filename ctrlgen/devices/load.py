"""What acts on a device all the time: forces, moments, payloads, as a device file or a scenario states them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field, model_validator

from ctrlgen.core.names import Name
from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.place import Place
from ctrlgen.devices.section import Section

Force = Annotated[Quantity, In("N")]
Moment = Annotated[Quantity, In("N*m")]
Acceleration = Annotated[Quantity, In("m/s^2")]
Gravity = tuple[Acceleration, Acceleration, Acceleration]
GROUND_NAME = "ground"


class Load(Section):
    """`[[load]]`: what acts on a body all the time: a force or a moment, such as of a preload or on a platform, or a mass that stands
    on it."""

    name: Name
    """In messages and reports."""
    on: str = Field("platform", min_length=1)
    """The body that it acts on; stages of the papers have one, the platform."""
    against: str = GROUND_NAME
    """The body that a force pushes against, as a spring between both does."""
    at: Place | None = None
    """Where it acts, in the global frame; it moves with the body. Left out: the point whose pose is followed."""
    force: tuple[Force, Force, Force] | None = None
    """Its components along x, y and z, which keep their directions."""
    moment: tuple[Moment, Moment, Moment] | None = None
    """Moments about x, y and z; half of each keeps its axis in space, half turns with the body (semitangential)."""
    mass: Annotated[Quantity, In("g", positive=True)] | None = None
    """Of a payload at a point, in place of a force: it is moved with the body, and weighs where `gravity` is stated."""
    pattern: str = ""
    """The pattern by which it is copied."""

    @model_validator(mode="after")
    def _is_one_thing(self) -> Load:
        pushes = self.force is not None or self.moment is not None
        if pushes == (self.mass is not None):
            raise ValueError("give either force or mass (a moment stands alone, or beside a force)")
        if self.mass is not None and self.against != GROUND_NAME:
            raise ValueError("against: belongs to a force; a mass pushes against nothing")
        return self

    @property
    def text(self) -> str:
        """In words: 'push on stage: force 0 N, 0 N, -1 N'."""
        parts = [
            f"{key} {', '.join(q.text for q in numbers)}"
            for key, numbers in (("force", self.force), ("moment", self.moment))
            if numbers is not None
        ]
        parts += [] if self.mass is None else [f"mass {self.mass.text}"]
        parts += [] if self.at is None else [f"at {', '.join(q.text for q in self.at)}"]
        on = self.on if self.against == GROUND_NAME else f"{self.on} against {self.against}"
        return f"{self.name} on {on}: {'; '.join(parts)}"


def joined(loads: Sequence[Load], more: Sequence[Load]) -> tuple[Load, ...]:
    """Loads and `more` of them, which replace those of the same name."""
    names = {load.name for load in more}
    return (*(load for load in loads if load.name not in names), *more)
