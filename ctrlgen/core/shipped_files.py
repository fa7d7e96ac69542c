"""Folders of the repository that are part of the installed package: the C templates, the examples, the papers' numbers."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.resources import files
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from ctrlgen.core.errors import CtrlgenError


def shipped(name: str) -> Path:
    """The folder `name` of the repository: its copy in an installed package, `_NAME`, or that of a checkout.

    pyproject.toml lists what is copied into a wheel.
    """
    package = Path(str(files("ctrlgen")))
    copy = package / f"_{name}"
    return copy if copy.is_dir() else package.parent / name


def shipped_package(name: str) -> ModuleType:
    """The Python package `name` beside ctrlgen in a checkout, or its copy `ctrlgen._NAME` in an installed package.

    Raises CtrlgenError where neither is there.
    """
    folder = shipped(name)
    if folder.name != name:
        return import_module(f"ctrlgen.{folder.name}")
    loaded = sys.modules.get(name)
    if loaded is not None and [Path(part) for part in getattr(loaded, "__path__", ())] == [folder]:
        return loaded
    # Under a name of its own, since another package may have that one; within it all imports are relative
    private, first = f"_ctrlgen_{name}", folder / "__init__.py"
    if private not in sys.modules:
        spec = spec_from_file_location(private, first, submodule_search_locations=[str(folder)])
        if spec is None or spec.loader is None or not first.is_file():
            raise CtrlgenError(f"{folder} is missing: {name} comes with a clone of ctrlgen and with its wheel")
        module = sys.modules[private] = module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules[private]
