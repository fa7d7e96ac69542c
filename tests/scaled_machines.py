"""The same machine of another size: a device or a scenario whose lengths, forces and drives are so many times as large."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

import numpy as np
from conftest import SCENARIOS

from ctrlgen.core.files import validate
from ctrlgen.core.units import exponents, read_quantity, same_dimension, written_unit
from ctrlgen.devices import Device

Scale = tuple[float, float, float]  # of length, force and drive
USUAL: Scale = (1, 1, 1)


@cache
def factor(unit: str, scale: Scale) -> float:
    """How many times a number in `unit` is as large where times and temperatures stay: a volt is W/A, and an ampere what is left of it."""
    length, force, drive = scale
    powers, mass = exponents(unit), force / length
    assert powers is not None, unit
    each = {"kg": mass, "m": length, "A": mass * length**2 / drive}
    return float(np.prod([each.get(name, 1.0) ** power for name, power in powers.items()]))


def scaled(text: str, scale: Scale) -> str:
    """The text of a file, every number in it that has a unit as many times as large."""

    def number(found: re.Match[str]) -> str:
        try:
            unit = written_unit(read_quantity(None, found[1]).text)
        except ValueError:
            return found[0]
        if found[1].endswith("%") or same_dimension(unit, "1") or same_dimension(unit, "K") or exponents(unit) is None:
            return found[0]
        return f'"{float(found[1].split()[0]) * factor(unit, scale)!r} {unit}"'

    return re.sub(r'"([+-]?[\d.][^"\n]*)"', number, text)


@cache
def device_of(file: Path, scale: Scale = USUAL) -> Device:
    table = tomllib.loads(scaled(file.read_text(), scale))
    return validate(Device.library[table["kind"]], table, "device")


def scenario_of(name: str, scale: Scale, folder: Path) -> Path:
    """A shipped scenario and its device, written into `folder`."""
    text = (SCENARIOS / name / "scenario.toml").read_text()
    device = SCENARIOS / name / tomllib.loads(text)["device"]
    (folder / "device.toml").write_text(scaled(device.read_text(), scale))
    path = folder / "scenario.toml"
    path.write_text(re.sub(r'(?m)^device = ".*"$', 'device = "device.toml"', scaled(text, scale)))
    return path
