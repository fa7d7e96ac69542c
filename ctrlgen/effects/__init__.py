"""The library of physical effects: every module here is one law, but for those that begin with an underscore.

A law's file needs `from ctrlgen.effects import Effect, Param, Place`; importing this package fills `Effect.library`.
"""

from importlib import import_module
from pkgutil import iter_modules

from ctrlgen.effects._effect import Effect, Param, Place, State, Where

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = ["Effect", "Param", "Place", "State", "Where"]
