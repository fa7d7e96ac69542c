"""What the equations of a mechanism read of its description."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Protocol

from ctrlgen.devices.mechanism.copies import Copied, Placed


class Drawing(Protocol):
    """What the equations need of a mechanism's description (`devices.mechanism.Mechanism`)."""

    actuator: tuple[Any, ...]
    body: tuple[Any, ...]
    pattern: tuple[Any, ...]
    reading: tuple[Any, ...]
    material: tuple[Any, ...]
    element: tuple[Any, ...]
    super_element: tuple[Any, ...]
    output: Any
    dynamics: Any
    effect: tuple[Any, ...]
    load: tuple[Any, ...]
    gravity: Any
    kinematics: Any

    @property
    def second_order(self) -> bool:
        """Whether pose and force are of second order at least."""
        ...

    @property
    def geometric_stiffening(self) -> bool:
        """Whether the energy is of fourth order, as an element states."""
        ...

    @property
    def model_fields_set(self) -> set[str]:
        """What the file states."""
        ...

    @property
    def bodies(self) -> tuple[str, ...]:
        """The names of all bodies, copies with their number."""
        ...

    def body_number(self, name: str, pattern: str, copy: int) -> int | None:
        """The number of a body, as a table of a pattern names it in its copy."""
        ...

    @property
    def placed_bodies(self) -> tuple[Copied, ...]:
        """Every copy of every body, by its number."""
        ...

    @property
    def placed_elements(self) -> tuple[Placed, ...]:
        """Every copy of every element."""
        ...

    @property
    def placed_super_elements(self) -> tuple[Any, ...]:
        """Every copy of every super-element (`ported_parts.Ported`)."""
        ...

    @property
    def placed_actuators(self) -> tuple[Placed, ...]:
        """Every copy of every actuator."""
        ...

    @property
    def placed_loads(self) -> tuple[Placed, ...]:
        """Every copy of every load."""
        ...

    @property
    def placed_readings(self) -> tuple[Placed, ...]:
        """Every copy of every reading."""
        ...

    @property
    def reading_scale(self) -> tuple[float, ...]:
        """A typical size of each reading beside those of the output."""
        ...

    @property
    def size(self) -> float:
        """The largest distance of an element's end from the origin [m]."""
        ...

    @property
    def channel_scale(self) -> tuple[float, ...]:
        """A typical size of each channel that is followed."""
        ...

    @property
    def cubic_steps(self) -> int:
        """Steps of Newton's method that find the stretch of the cubic springs."""
        ...

    def values(self) -> SimpleNamespace:
        """The numbers of the description in SI."""
        ...
