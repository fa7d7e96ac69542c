"""Laws that other installed packages bring, found by their entry points.

A package states each of its laws in its pyproject.toml:

    [project.entry-points."ctrlgen.laws"]
    slack_cable = "my_stage.laws:SlackCable"

A law that cannot be used is left out, and a warning says of which package it is and why; nothing else of the package is touched.
"""

from __future__ import annotations

import hashlib
import sys
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from ctrlgen.core.errors import visible
from ctrlgen.effects._effect import Effect
from ctrlgen.effects._sound import faults_of
from ctrlgen.version import code_hash

GROUP = "ctrlgen.laws"
"""The group of entry points."""


@dataclass(frozen=True)
class LeftOut:
    """A law that is not used: its `kind`, the `package` that brings it, and `why`."""

    kind: str
    package: str
    why: str

    def __str__(self) -> str:
        return visible(f"the law {self.kind} of the package {self.package} is left out: {self.why}")


@dataclass(frozen=True)
class Installed:
    """The laws of installed packages by kind, those that were left out, and a `digest` of the code of the former, empty without any."""

    laws: Mapping[str, type[Effect]]
    left_out: tuple[LeftOut, ...]
    digest: str


def laws() -> Mapping[str, type[Effect]]:
    """Every law by its kind: those of ctrlgen, and those of installed packages. Warns, once, of each that is left out."""
    return {**Effect.library, **installed().laws}


def law_of(kind: str) -> type[Effect] | None:
    """The law of this kind; None without one. Packages are looked through only for what is not ctrlgen's."""
    return Effect.library.get(kind) or installed().laws.get(kind)


@cache
def installed() -> Installed:
    """The laws of the packages that are installed here, loaded once. Warns of each that is left out."""
    found, left_out = load_laws(entry_points(group=GROUP))
    for each in left_out:
        warnings.warn(str(each), stacklevel=2)
    for law in found.values():
        Effect.library[law.kind] = law
    return Installed(found, tuple(left_out), _digest(found))


def load_laws(points: Any) -> tuple[dict[str, type[Effect]], list[LeftOut]]:
    """(laws, left out) of entry points; of two that have one kind both are left out, for a file does not say which it means."""
    found: dict[str, list[type[Effect]]] = {}
    left_out = []
    for point in sorted(points, key=lambda p: (_package(p), p.name)):
        try:
            law = _load(point)
        except ValueError as error:
            left_out.append(LeftOut(point.name, _package(point), str(error)))
        else:
            found.setdefault(law.kind, []).append(law)
    for same in found.values():
        if len({law.package for law in same}) > 1:
            packages = " and ".join(law.package for law in same)
            why = f"{packages} both bring one of this name; rename one of the two, or uninstall a package"
            left_out += [LeftOut(law.kind, law.package, why) for law in same]
    return {kind: same[0] for kind, same in found.items() if len({law.package for law in same}) == 1}, left_out


def _package(point: EntryPoint) -> str:
    return str(point.dist.name) if point.dist is not None and point.dist.name else "(without a name)"


def _load(point: EntryPoint) -> type[Effect]:
    """The law that an entry point names. Raises ValueError that says why it cannot be used.

    Whatever else its module puts into the library on the way is taken out again.
    """
    before = dict(Effect.library)
    try:
        law = point.load()
    # a stranger's module may raise anything, and may call sys.exit
    except (Exception, SystemExit) as error:
        raise ValueError(f"{point.value} cannot be loaded: {type(error).__name__}: {error}") from error
    finally:
        Effect.library.clear()
        Effect.library.update(before)
    if not (isinstance(law, type) and issubclass(law, Effect)):
        raise ValueError(f"{point.value} is no law: it must be a class derived from ctrlgen.effects.Effect")
    if law.kind != point.name:
        raise ValueError(f"the entry point must be named as the law: {law.kind} = {point.value!r}")
    if faults := faults_of(law):
        raise ValueError("; ".join(faults))
    law.package = _package(point)
    return law


def _digest(found: Mapping[str, type[Effect]]) -> str:
    """Of the code of the packages that bring the laws: what a kept result was made by. Empty without any."""
    tops = {law.__module__.partition(".")[0] for law in found.values()}
    digests = [code for top in sorted(tops) for code in _codes(sys.modules[top])]
    return hashlib.sha256("".join(digests).encode()).hexdigest() if digests else ""


def _codes(module: ModuleType) -> Iterator[str]:
    """Digests of a package's folders, or of a module's own file."""
    if hasattr(module, "__path__"):
        yield from (code_hash(Path(folder)) for folder in module.__path__)
    elif module.__file__:
        yield hashlib.sha256(Path(module.__file__).read_bytes()).hexdigest()
