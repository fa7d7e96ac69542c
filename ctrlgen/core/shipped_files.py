"""Folders of the repository that are part of the installed package: the C templates and the examples."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def shipped(name: str) -> Path:
    """The folder `name` of the repository: its copy in an installed package, `_NAME`, or that of a checkout.

    pyproject.toml lists what is copied into a wheel.
    """
    package = Path(str(files("ctrlgen")))
    copy = package / f"_{name}"
    return copy if copy.is_dir() else package.parent / name
