"""Devices written in Python, from their file: stage.py, or a TOML file with kind = "python" that changes its numbers.

stage.py makes the variable `device`, by `ctrlgen.user_device`. The TOML file names it and may state other values:

    kind = "python"
    file = "stage.py"
    [mechanism]
    stiffness = "21 N/mm"
"""

from __future__ import annotations

import sys
import traceback
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import tomlkit

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text, validate
from ctrlgen.core.units import Quantity, difference, written_unit
from ctrlgen.devices.base import Device
from ctrlgen.devices.section import Section

KIND = "python"
VARIABLE = "device"


def python_file_of(table: dict[str, Any], path: Path) -> Path:
    """The Python file that a device file of this kind names, beside it. Raises InputError."""
    name = table.get("file")
    if not isinstance(name, str) or not name.endswith(".py"):
        what = 'must name the Python file that makes the device, such as file = "stage.py"'
        raise InputError(path, [Fault("file", what)])
    return path.parent / name


def python_device(path: Path) -> Device:
    """The variable `device` of a Python file, which is run. Raises InputError for a file that fails or makes none."""
    read_text(path)  # says what is wrong with the file itself
    spec = spec_from_file_location(f"ctrlgen_device_{path.stem}", path)
    assert spec is not None and spec.loader is not None  # a .py file has a loader
    module = module_from_spec(spec)
    sys.modules[spec.name] = module  # so that its functions can be pickled
    beside = str(path.resolve().parent)
    sys.path.insert(0, beside)  # what stands beside it can be imported
    try:
        spec.loader.exec_module(module)
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # a user's code may raise anything
        raise InputError(path, [Fault(_line(path, error), f"raised {type(error).__name__}: {error}")]) from None
    finally:
        with suppress(ValueError):  # the file itself may have taken it out
            sys.path.remove(beside)
    made = getattr(module, VARIABLE, None)
    if not isinstance(made, Device):
        what = "is missing" if made is None else f"is {type(made).__name__}, and no device"
        raise InputError(path, [Fault(VARIABLE, f"{what}; end the file with {VARIABLE} = ctrlgen.user_device(...)")])
    return made


def changed_device(table: dict[str, Any], path: Path) -> Device:
    """The device of the Python file that `table` names, with the numbers, effects and sensors of `table` in place of its own."""
    device = python_device(python_file_of(table, path))
    fields = {key: getattr(device, key) for key in type(device).model_fields}
    stated = {key: value for key, value in table.items() if key not in ("kind", "file")}
    for key, value in stated.items():
        if isinstance(fields.get(key), Section) and isinstance(value, dict):
            stated[key] = {**{k: getattr(fields[key], k) for k in type(fields[key]).model_fields}, **value}
    return validate(type(device), {**fields, **stated}, path)


def as_toml(device: Device, file: str) -> str:
    """A device file of this kind for `device` of the Python file named `file`, with all its numbers and effects."""
    document = tomlkit.document()
    document.update({"kind": KIND, "file": file})
    for key in type(device).model_fields:
        section = getattr(device, key)
        if isinstance(section, Section):
            table = tomlkit.table()
            table.update({name: _number(getattr(section, name)) for name in type(section).model_fields})
            document.add(key, table)
    if device.effect:
        effects = tomlkit.aot()
        for e in device.effect:
            table = tomlkit.table()
            table.update(e.placed() | {name: _number(number) for name, number in e.values.items()})
            effects.append(table)
        document.add("effect", effects)
    return document.as_string()


def _number(number: Quantity) -> Any:
    unit = written_unit(number.text)
    sd = None if number.sd is None else f"{difference(number.sd, unit):.12g} {unit}"
    stated = {"value": number.text, "sd": sd, "source": number.source}
    table = tomlkit.inline_table()
    table.update({key: value for key, value in stated.items() if value is not None})
    return table


def _line(path: Path, error: BaseException) -> str:
    """The line of the file at which it failed."""
    if isinstance(error, SyntaxError) and error.lineno:
        return f"line {error.lineno}"
    lines = [
        frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename).name == path.name
    ]
    return f"line {lines[-1]}" if lines else "file"
