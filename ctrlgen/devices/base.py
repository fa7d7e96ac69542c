"""The base of every device description: what all kinds have, and their numbers in SI."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar, Self

import casadi as ca
from pydantic import PrivateAttr, model_validator

from ctrlgen.core.mode_lines import ModeShape
from ctrlgen.core.names import CName
from ctrlgen.core.shown import Shown
from ctrlgen.core.units import Quantity
from ctrlgen.devices.device_physics import DevicePhysics
from ctrlgen.devices.load import Gravity, Load
from ctrlgen.devices.machine import Machine, MachineParts, machine_parts
from ctrlgen.devices.quantities import member_at, si_namespace, walk
from ctrlgen.devices.reported_units import in_units_of
from ctrlgen.devices.run_time import RunTime, RunTimeConstant, run_time_constants
from ctrlgen.devices.section import Section
from ctrlgen.devices.sensor import AnySensor
from ctrlgen.devices.structural_model import StructuralModel
from ctrlgen.effects import EffectTable, RecordingEffectTable


class Device(Shown, Section):
    """Base of every device: one subclass in one file, chosen by `kind` in the device file."""

    library: ClassVar[dict[str, type[Device]]] = {}
    works_by: ClassVar[str | None] = None
    """By what the actuators of this kind work (`machine.FAMILIES`), None where the kind does not say."""
    on_flexures: ClassVar[bool | None] = None
    """Whether the stages of this kind stand on flexures, None where the kind does not say."""

    kind: str
    """Chooses the equations of the device."""
    name: CName
    """A C identifier in lower case; recordings and scenarios name the device by it, and generated functions bear it."""
    title: str
    """The device in words, for reports."""
    source: str
    """Where the numbers come from: a paper, a data sheet, a measurement."""
    effect: tuple[EffectTable, ...] = ()
    """`[[effect]]` tables: physical effects that the kind leaves out; each adds one term to the model."""
    recording_effect: tuple[RecordingEffectTable, ...] = ()
    """`[[recording_effect]]` tables: effects that one recording had alone, named by its title as `recording`, such as a drift on its clock.
    They act where that recording is diagnosed, and nowhere else: no path, no C and no other recording has them.
    """
    sensor: tuple[AnySensor, ...] = ()
    """`[[sensor]]` tables: what reads the channels of the pose. They do not enter the model; `ctrlgen check` gives
    their resolution and range, `ctrlgen.simulate_sensors` their recordings.
    """
    machine: Machine | None = None
    """`[machine]`: what it is made of, for a diagnosis."""
    run_time: RunTime | None = None
    """`[run_time]`: which of these numbers the generated controller is given when it starts, because they differ between specimens or
    drift. Without it every number is compiled in.
    """

    # by signal, such as ("reading.axis", "mm"); empty: the units of the kind of device
    _told_in: tuple[tuple[str, str], ...] = PrivateAttr(())

    names_files: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Lists of tables whose entries may name a file beside the device file, each with the key that does."""

    @classmethod
    def with_named_files(cls, table: dict[str, Any], path: Path) -> dict[str, Any]:
        """The tables of a device file at `path`, with what stands in files that it names. Raises InputError."""
        return table

    @classmethod
    def named_files(cls, table: dict[str, Any], path: Path) -> tuple[Path, ...]:
        """Those files."""
        return ()

    def in_recording(self, title: str) -> Self:
        """The device as it was in the recording of this title: the effects that this one had alone are among its effects, after the
        others, and those of other recordings are gone."""
        own = tuple(e.effect for e in self.recording_effect if e.recording == title)
        return self.model_copy(update={"effect": (*self.effect, *own), "recording_effect": ()})

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        numbers = sum(1 for _ in self.quantities())
        effects = ", ".join(f"{e.kind} at {e.at}" for e in self.effect) or "none"
        return {"name": self.name, "title": self.title, "kind": self.kind, "numbers": numbers, "effects": effects}

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        kinds = getattr(cls.model_fields["kind"].annotation, "__args__", ())
        if kinds:  # a device that is not read from a file has no name for its kind
            Device.library[kinds[0]] = cls

    @model_validator(mode="after")
    def _run_time_numbers(self) -> Device:
        run_time_constants(self)
        return self

    @property
    def given_at_start(self) -> tuple[RunTimeConstant, ...]:
        """The numbers that the generated controller is given when it starts."""
        return run_time_constants(self)

    def physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The device's physics with the values `p` (SI numbers, or symbols where they are free)."""
        raise NotImplementedError

    def told_physics(self, p: SimpleNamespace) -> DevicePhysics:
        """The physics as `physics` gives it, told in the units that `told_in` was given."""
        physics = self.physics(p)
        return in_units_of(physics, dict(self._told_in)) if self._told_in else physics

    def told_in(self, units: Mapping[str, str]) -> Device:
        """The same device, whose reports state numbers in the `units` of signals, such as {'reading.axis': 'mm'}."""
        told = self.model_copy()
        told._told_in = tuple(units.items())
        return told

    def excluded_actuators(self) -> dict[str, str]:
        """Families of actuators (`machine.FAMILIES`) that a device of this kind and these numbers cannot have, with the reason."""
        return {}

    def parts(self, physics: DevicePhysics) -> MachineParts:
        """What it is made of: as stated, else as its `physics` and its kind tell."""
        return machine_parts(self.machine, physics, self.works_by, self.on_flexures, self.excluded_actuators())

    def with_unstated_inertia(self) -> tuple[Device, float] | None:
        """The same device with the inertia that its file states and its model leaves out, and the damping ratio that is assumed; None
        where there is no such inertia."""
        return None

    def structural_model(self) -> StructuralModel | None:
        """The device with modes that its model leaves out, linear at home; None where it has none."""
        return None

    def mode_shapes(self) -> tuple[ModeShape, ...]:
        """Its modes as lines to draw; none of a device that is not drawn."""
        return ()

    def with_unstated_stretching(self) -> Device | None:
        """The same device with flexures that stretch where its model leaves that out; None where there are none."""
        return None

    def range_remarks(self) -> list[str]:
        """Where its model leaves the range in which it holds, under constant loads or within its travels, and by how much it is off."""
        return []

    def remarks(self) -> list[str]:
        """Remarks on the description for the reader, such as an equation that is used outside its range."""
        return []

    def quantities(self) -> Iterator[tuple[str, Quantity]]:
        """Every number of the device with its dotted path, such as 'struts.wire_length'."""
        return ((path, number) for path, _, number in walk(self))

    def copies(self, path: str) -> tuple[str, ...]:
        """The paths of how far the number at `path` is off in each copy of its table, zero as described; none where nothing is copied."""
        return ()

    def deviating(self, deviations: Mapping[str, float]) -> Self:
        """The device whose copies are off [SI], by the paths of `copies`."""
        raise NotImplementedError

    def loaded(self, loads: Sequence[Load], gravity: Gravity | None) -> Device:
        """The device with constant loads, and with gravity, beside those of its file. Raises ValueError where it cannot have them."""
        raise ValueError(f"a device of the kind {self.kind} has no bodies that could be loaded")

    @property
    def load_texts(self) -> tuple[str, ...]:
        """The constant loads in words, and gravity."""
        loads, gravity = getattr(self, "load", ()), getattr(self, "gravity", None)
        falls = () if gravity is None else (f"gravity {', '.join(q.text for q in gravity)}",)
        return (*(load.text for load in loads), *falls)

    def called(self, path: str) -> str:
        """The path of a number, with the name, or the kind, of its table where that stands in a list: 'actuator[0].gain (px)'."""
        tables = [member_at(self, path[: index.end()]) for index in re.finditer(r"\[\d+\]", path)]
        names = [
            next((n for n in (getattr(t, k, None) for k in ("name", "kind")) if isinstance(n, str)), "") for t in tables
        ]
        name = next((n for n in reversed(names) if n), "")
        return f"{path} ({name})" if name else path

    def values(self, free: dict[str, ca.SX] | None = None) -> SimpleNamespace:
        """SI numbers as nested namespaces; `free` gives symbols for some paths in place of their numbers."""
        return si_namespace(self, "", free or {})
