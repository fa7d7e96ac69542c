"""What every device description has: validated sections, quantities with sources, values in SI."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import casadi as ca
from pydantic import Field

from ctrlgen.core.units import Quantity
from ctrlgen.devices.section import Section
from ctrlgen.devices.sensor import AnySensor
from ctrlgen.effects import Effect


@dataclass(frozen=True)
class Signal:
    """A named vector of the model, in SI inside.

    `channels` are its components' names, `units` the units a reader sees, `column` the
    prefix of its columns in a CSV, `expr` (n,) the symbolic value, `scale` a typical size in SI per channel.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    column: str
    expr: ca.SX
    scale: tuple[float, ...]

    @property
    def columns(self) -> tuple[str, ...]:
        """CSV column names with units, such as 'd_1X [um]'."""
        return tuple(f"{self.column}{c} [{u}]" for c, u in zip(self.channels, self.units, strict=True))


@dataclass(frozen=True, eq=False)
class Limit:
    """lower <= expr <= upper, channel by channel; SI. None where a side is free.

    A limit on anything but a model variable itself must be convex in the displacement, never negative, and zero
    at home: the online controller restores it by shrinking the displacement toward home.
    """

    name: str
    label: str
    channels: tuple[str, ...]
    unit: str
    expr: ca.SX
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True)
class Links:
    """The physics of one device as a chain of symbolic maps; `ctrlgen.model.model` joins them.

    drive u -> `heat` -> state x by `rates` -> `force` on the axis == `resistance` of the displacement d -> `pose`.
    Each map takes and gives SX column vectors in SI. A device whose actuators remember nothing has no `state` and
    no heat; `force_unit` says in what the balance is: N, or m where displacement itself is commanded.
    `heat_signal` is (label, unit, column prefix, typical size) of what the drive becomes before it acts.

    With a `mass` per axis the displacement has inertia, mass d'' = force - resistance(d) - `drag`(d'), instead of
    standing in balance. With `feedback` (u, y, d', x) -> drive the loop is closed on y, the reading or the displacement
    as `measured` says: u is the reference, and `heat` (u - y) drives the states. An `imposed` device is moved by its
    drive (displacement, velocity, acceleration) and reads the force that takes. `bipolar` says whether the drive has
    both signs.
    `moving` (drive, x, d, d') -> force and rates of the states stands instead of `force` and `rates` where they depend
    on the velocity too, or the states on the displacement.
    `second_order` is what finite turns of a linear mechanism's links add to `pose`, `yielding` by how much less stages
    yield to the links' load at d than at home.
    """

    axes: tuple[str, ...]
    components: tuple[str, ...]
    pose_units: tuple[str, ...]
    pose_scale: tuple[float, ...]
    drive: Signal
    state: Signal | None
    rest: tuple[float, ...]
    displacement_scale: float
    force_scale: float
    force: Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
    resistance: Callable[[ca.SX], ca.SX]
    pose: Callable[[ca.SX], ca.SX]
    limits: Callable[[SimpleNamespace], Sequence[Limit]]
    force_unit: str = "N"
    rates: Callable[[ca.SX, ca.SX], ca.SX] = lambda x, heat: ca.SX(0, 1)
    heat: Callable[[ca.SX], ca.SX] = lambda u: u
    heat_signal: tuple[str, str, str, float] | None = None
    resistance_parts: Callable[[ca.SX], dict[str, ca.SX]] = lambda d: {}
    travel_unit: str = "um"
    mass: tuple[float | ca.SX, ...] | None = None
    drag: Callable[[ca.SX], ca.SX] | None = None
    feedback: Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX] | None = None
    measured: str = "reading"
    command_signal: tuple[str, str, str, float] | None = None
    imposed: bool = False
    bipolar: bool = True
    moving: Callable[[ca.SX, ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]] | None = None
    second_order: Callable[[ca.SX], ca.SX] | None = None
    yielding: Callable[[ca.SX], ca.SX] | None = None


class Device(Section):
    """Base of every device: one subclass, one file, named by `kind` in the device file."""

    library: ClassVar[dict[str, type[Device]]] = {}

    kind: str
    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$")
    title: str
    source: str
    effect: tuple[Effect, ...] = ()
    sensor: tuple[AnySensor, ...] = ()

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        kinds = getattr(cls.model_fields["kind"].annotation, "__args__", ())
        if kinds:  # a device that is no file has no word for its kind
            Device.library[kinds[0]] = cls

    def links(self, p: SimpleNamespace) -> Links:
        """The device's physics with the values `p` (numbers, or symbols where they are free)."""
        raise NotImplementedError

    def remarks(self) -> list[str]:
        """What a reader should know of the description, such as an equation used beyond its range."""
        return []

    def quantities(self) -> Iterator[tuple[str, Quantity]]:
        """Every number of the device with its dotted path, such as 'struts.wire_length'."""
        yield from _leaves(self, "")

    def values(self, free: dict[str, ca.SX] | None = None) -> SimpleNamespace:
        """SI numbers as nested namespaces; `free` replaces chosen paths by symbols."""
        return _namespace(self, "", free or {})


def _leaves(node: Any, prefix: str) -> Iterator[tuple[str, Quantity]]:
    if isinstance(node, Quantity):
        yield prefix, node
    elif isinstance(node, Section):
        for key in type(node).model_fields:
            yield from _leaves(getattr(node, key), f"{prefix}.{key}" if prefix else key)
    elif isinstance(node, Effect):
        for key, value in node.values.items():
            yield f"{prefix}.{key}", value
    elif isinstance(node, tuple):
        for index, member in enumerate(node):
            yield from _leaves(member, f"{prefix}[{index}]")


def _namespace(node: Any, prefix: str, free: dict[str, ca.SX]) -> Any:
    if isinstance(node, Quantity):
        return free.get(prefix, node.si)
    if isinstance(node, Section):
        return SimpleNamespace(
            **{
                key: _namespace(getattr(node, key), f"{prefix}.{key}" if prefix else key, free)
                for key in type(node).model_fields
            }
        )
    if isinstance(node, Effect):
        return SimpleNamespace(**{k: free.get(f"{prefix}.{k}", q.si) for k, q in node.values.items()})
    if isinstance(node, tuple):
        return tuple(_namespace(member, f"{prefix}[{i}]", free) for i, member in enumerate(node))
    return node
