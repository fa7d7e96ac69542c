"""Reads the arguments of `user_device`: names with sizes, ranges and rates, parameters, limits; every fault is collected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.names import LONGEST_NAME, is_name
from ctrlgen.core.units import Quantity, read_quantity, same_dimension, to_si, written_unit
from ctrlgen.devices.section import Section
from ctrlgen.devices.user.ports import Law

# Domain of a parameter -> section of the device.
SECTIONS = {"mechanism": "mechanism", "stage": "stage", "actuator": "actuator", "sensor": "sensing"}
PLACEHOLDER = Quantity(1.0, "1")  # for a quantity that cannot be read, so that the rest is checked too
NEED_MASS = ("damping_force", "acceleration")


class ArgumentReader:
    """Reads the arguments of `user_device` and collects their faults."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.faults: list[Fault] = []
        self.ranges: dict[tuple[str, str], tuple[float, float]] = {}

    def ports(self, where: str, given: Mapping[str, Any]) -> dict[str, Quantity]:
        """Largest sizes by name; one that cannot be read is a fault and counts as 1. A pair of lowest and highest value also goes into
        `ranges`."""
        sizes: dict[str, Quantity] = {}
        if not isinstance(given, Mapping) or not all(is_name(n) for n in given):
            what = f'must be names with their largest size, such as {{"motor": "10 V"}}: letters, digits and _, {LONGEST_NAME} at most'
            self.faults.append(Fault(where, what))
            return sizes
        for name, text in given.items():
            try:
                if isinstance(text, (tuple, list)):
                    sizes[name] = self._pair(where, name, text)
                    continue
                sizes[name] = read_quantity(None, text)
                if sizes[name].si <= 0 or to_si(0.0, written_unit(sizes[name].text)):
                    raise ValueError(
                        f"{text!r} is not a size; write the largest value, above zero, in a unit that begins at zero"
                    )
            except ValueError as error:
                self.faults.append(Fault(f"{where}.{name}", str(error)))
                sizes[name] = PLACEHOLDER
        return sizes

    def _pair(self, where: str, name: str, given: Sequence[Any]) -> Quantity:
        """The larger end of a range, which is kept. Raises ValueError."""
        if len(given) != 2:
            raise ValueError(f'{list(given)!r} must be the lowest and the highest value, such as ("0 V", "150 V")')
        low, high = (read_quantity(None, text) for text in given)
        units = [written_unit(q.text) for q in (low, high)]
        if not same_dimension(*units):
            raise ValueError(f"{low.text!r} and {high.text!r} are not of one dimension")
        if any(to_si(0.0, unit) for unit in units):
            raise ValueError(f"{high.text!r} does not count from zero; write it in a unit that does, such as K")
        if not low.si < high.si:
            raise ValueError(f"{low.text!r} is not below {high.text!r}; write the lowest value first")
        self.ranges[where, name] = (low.si, high.si)
        return high if abs(high.si) >= abs(low.si) else Quantity(-low.si, low.text.lstrip("-"))

    def parameters(self, given: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, str]]:
        """(tables of value, sd and source; domains; units) of the parameters by name."""
        tables, domains, units = {}, {}, {}
        for name, stated in given.items():
            where = f"parameters.{name}"
            table = dict(stated) if isinstance(stated, Mapping) else {"value": stated}
            if isinstance(stated, (tuple, list)):
                table = dict(zip(("value", "sd"), stated, strict=False))
                if len(stated) != 2:
                    self.faults.append(Fault(where, f'{stated!r} must be (value, sd), such as ("0.5 kg", "10 g")'))
            domain = table.pop("domain", "mechanism")
            if domain not in SECTIONS:
                self.faults.append(Fault(where, f"domain = {domain!r} must be one of {', '.join(SECTIONS)}"))
                domain = "mechanism"
            if not is_name(name) or name.startswith("model_") or hasattr(Section, name):
                self.faults.append(Fault(where, "is not a name that a parameter can have; choose another one"))
                continue
            try:
                read_quantity(None, table)
            except ValueError as error:
                self.faults.append(Fault(where, str(error)))
                table = {"value": PLACEHOLDER.text}
            units[name], tables[name], domains[name] = written_unit(str(table["value"])), table, domain
        return tables, domains, units

    def limits(self, given: Mapping[str, Any]) -> dict[str, tuple[Law, Quantity]]:
        """The limits on expressions, each a law with the largest magnitude that it may have."""
        limits: dict[str, tuple[Law, Quantity]] = {}
        for name, stated in given.items():
            if not (isinstance(stated, (tuple, list)) and len(stated) == 2 and callable(stated[0])):
                what = 'must be (law, largest value), such as (lambda d, p: p.k * d.x, "300 MPa")'
                self.faults.append(Fault(f"limits.{name}", what))
                continue
            size = self.ports("limits", {name: stated[1]})[name]
            if ("limits", name) in self.ranges:
                self.faults.append(Fault(f"limits.{name}", "has two values; a limit is on the magnitude, write one"))
            limits[name] = (stated[0], size)
        return limits

    def drive_rates(self, given: Mapping[str, Any], drive: Mapping[str, Quantity]) -> dict[str, Quantity]:
        """The limits on the rates of drives, checked for names, dimensions and signs."""
        rates = self.ports("drive_rate", given)
        for name, q in rates.items():
            if name not in drive:
                self.faults.append(Fault(f"drive_rate.{name}", f"is no drive; there are {', '.join(drive) or 'none'}"))
            elif q is not PLACEHOLDER and not same_dimension(
                written_unit(q.text), f"({written_unit(drive[name].text)})/s"
            ):
                what = f"{q.text!r} is no rate of a drive in {written_unit(drive[name].text)}"
                self.faults.append(
                    Fault(f"drive_rate.{name}", f"{what}; write for example {written_unit(drive[name].text)}/ms")
                )
            elif not (pair := self.ranges.get(("drive_rate", name), (-1.0, 1.0)))[0] < 0 < pair[1]:
                self.faults.append(
                    Fault(f"drive_rate.{name}", "must be a rate below zero and one above; else it never returns")
                )
        return {name: q for name, q in rates.items() if name in drive}

    def weights(self, given: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Quantity]]) -> dict[str, float]:
        """How much drives count, checked for names and sizes."""
        drive, axes = sizes["drive"], sizes["axes"]
        for name, weight in given.items():
            if name not in drive:
                self.faults.append(
                    Fault(f"drive_weight.{name}", f"is no drive; there are {', '.join(drive) or 'none'}")
                )
            elif isinstance(weight, bool) or not isinstance(weight, (int, float)) or not 0 < weight < np.inf:
                self.faults.append(Fault(f"drive_weight.{name}", f"{weight!r} must be a number above zero"))
        if given and len(drive) <= len(axes):
            what = f"is of more drives than axes, and there are {len(drive)} for {len(axes)}; leave it out"
            self.faults.append(Fault("drive_weight", what))
        return {name: float(w) for name, w in given.items() if isinstance(w, (int, float))}

    def imposed(
        self, laws: Mapping[str, Law | None], ports: Mapping[str, Any], sizes: Mapping[str, Mapping[str, Quantity]]
    ) -> None:
        """Collects what does not go with `needed_force`, and speeds that do not fit the axes."""
        beside = [name for name, law in laws.items() if law is not None and name != "needed_force"]
        beside += [name for name, given in ports.items() if given]
        self.faults += [
            Fault(name, "and needed_force are both given; where the motion is imposed, needed_force holds all forces")
            for name in beside
        ]
        axes, speed = sizes["axes"], sizes["speed"]
        if set(axes) != set(speed):
            self.faults.append(Fault("speed", f"must be given of each axis: {', '.join(axes)}"))
        for name in axes.keys() & speed.keys():
            if not same_dimension(written_unit(speed[name].text), f"({written_unit(axes[name].text)})/s"):
                self.faults.append(
                    Fault(f"speed.{name}", f"{speed[name].text!r} is no speed of an axis in {axes[name].text!r}")
                )

    def laws(self, given: dict[str, Law | None], state: Mapping[str, Any], same: bool) -> dict[str, Law]:
        """The laws that are given, checked for what is missing and what excludes what; `same`: the readings are the axes."""
        present = {name: law for name, law in given.items() if law is not None}
        if "needed_force" in present:
            return present
        need = {
            "mass": any(m in present for m in NEED_MASS)
            and f"is missing: {' and '.join(m for m in NEED_MASS if m in present)} "
            "needs the inertia of each axis, on which the forces of effects act",
            "rates": bool(state) and "is missing: a state needs its rate",
            "pose": not same and "is missing: readings that are not the axes themselves need pose(d, p)",
            "restoring_force": "mass" not in present
            and "is missing: an axis without mass rests where restoring_force = force",
        }
        self.faults += [Fault(name, what) for name, what in need.items() if what and name not in present]
        if "acceleration" in present:
            for other in ("force", "restoring_force", "damping_force"):
                if other in present:
                    self.faults.append(
                        Fault(
                            other, "and acceleration are both given; acceleration holds all forces, give one of the two"
                        )
                    )
        elif "force" not in present:
            self.faults.append(Fault("force", "is missing; give force(u, x, d, v, p) or acceleration(u, x, d, v, p)"))
        if "rates" in present and not state:
            self.faults.append(Fault("state", 'is missing: rates are of states; name them, such as {"current": "1 A"}'))
        return {n: law for n, law in present.items() if n != "rates" or state}
