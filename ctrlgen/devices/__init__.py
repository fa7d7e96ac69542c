"""Descriptions of devices, one kind in each file; `load_device` reads a device.toml."""

from __future__ import annotations

import reprlib
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import ctrlgen.effects  # noqa: F401  fills Effect.library before a device file is read
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.file_format import in_this_format, refuse_another_kind
from ctrlgen.core.files import read_toml, validate
from ctrlgen.devices.base import Device
from ctrlgen.devices.device_physics import BalancedPhysics, DevicePhysics, ImposedPhysics, InertialPhysics
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.python_file import KIND, changed_device, python_device, python_file_of
from ctrlgen.devices.signal import Signal

for _module in walk_packages(__path__, f"{__name__}."):
    if not _module.name.endswith(".figure"):  # drawing is imported when something is drawn
        import_module(_module.name)


def load_device(path: Path | str) -> Device:
    """The device described by a TOML file, or made by a Python file (`python_file`). Raises InputError listing every fault."""
    if Path(path).suffix == ".py":
        return python_device(Path(path))
    table = read_toml(Path(path) / "scenario.toml" if (Path(path) / "scenario.toml").is_file() else path)
    if "device" in table and "kind" not in table:
        raise InputError(path, [Fault("file", f"is a scenario; name its device, {table['device']}")])
    table = in_this_format(table, path)
    if "record" in table:
        raise InputError(path, [Fault("file", "describes a recording; name the device file that it was made on")])
    refuse_another_kind(table, path, "device", "name a device file")
    kind = table.get("kind")
    if kind == KIND:
        return changed_device(table, Path(path))
    if not isinstance(kind, str) or kind not in Device.library:
        known = ", ".join(f'"{name}"' for name in sorted({*Device.library, KIND}))
        what = "is missing" if kind is None else f"{reprlib.repr(kind)} is not a kind of device I know"
        raise InputError(path, [Fault("kind", f"{what}; write kind = one of {known}")])
    return validate(Device.library[kind], Device.library[kind].with_named_files(table, Path(path)), path)


def files_of(path: Path) -> tuple[Path, ...]:
    """The files that describe a device: its own, and the Python file, or those of matrices, that it names. Raises InputError."""
    if path.suffix == ".py":
        return (path,)
    table = read_toml(path)
    kind = Device.library.get(str(table.get("kind")))
    if kind is None:
        return (path, python_file_of(table, path)) if table.get("kind") == KIND else (path,)
    return (path, *kind.named_files(table, path))


__all__ = [
    "BalancedPhysics",
    "Device",
    "DevicePhysics",
    "ImposedPhysics",
    "InertialPhysics",
    "Limit",
    "Signal",
    "files_of",
    "load_device",
]
