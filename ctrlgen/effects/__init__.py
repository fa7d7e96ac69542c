"""The library of physical effects: one law a file.

To add a law:

1. Add one file here with a subclass of `Effect`: equation and validity in the docstring, place, parameters, source, `term`,
   and `rates` or `update` if it has states. Simulation, inversion, trajectory optimisation, generated C and diagnosis read it
   from there; this package finds the file by itself.
2. Plant it in `tests/planted_axis.py`: a recording made by the law's definition, written independently of its expression,
   from which the diagnosis must recover the parameters. `tests/test_recovery.py` fails while a law has none.

The theorems of `tests/test_effects.py` and `tests/test_effects_in_c.py` then hold the law to its claims: off means off, energy,
units, C equal to Python. What the diagnosis believes of it beforehand has defaults; `ctrlgen/estimation/priors.py` takes a row
where they are wrong.

A law of somebody else stands in his own package and is found by an entry point: `_installed.py`. `Effect.library` holds ours and, once
they were asked for, those; `laws()` is every law there is.

A law's file imports what it needs from here: `Effect`, `Param`, `Place`, `State` and the types of what it is given. Files that begin
with an underscore are no laws: the law's interface, the reader of [[effect]] tables, and expressions that several laws share.
"""

from importlib import import_module
from pkgutil import iter_modules

from ctrlgen.effects._between_samples import Between
from ctrlgen.effects._channel_group import group, is_group, means, overlap
from ctrlgen.effects._effect import Apart, Effect, Place
from ctrlgen.effects._family import Family
from ctrlgen.effects._installed import Installed, LeftOut, installed, law_of, laws, load_laws
from ctrlgen.effects._law_inputs import Expression, LawInputs, LawNumbers
from ctrlgen.effects._parameter import Channel, Param, State
from ctrlgen.effects._plainer import Plainer
from ctrlgen.effects._recording_effect import RecordingEffect, RecordingEffectTable
from ctrlgen.effects._region import ActsIn, Side
from ctrlgen.effects._requirements import REQUIREMENTS
from ctrlgen.effects._shape_bounds import ShapeBounds, either, itself
from ctrlgen.effects._table import EffectTable, faults_at, read_effect

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

__all__ = [
    "REQUIREMENTS",
    "ActsIn",
    "Apart",
    "Between",
    "Channel",
    "Effect",
    "EffectTable",
    "Expression",
    "Family",
    "Installed",
    "LawInputs",
    "LawNumbers",
    "LeftOut",
    "Param",
    "Place",
    "Plainer",
    "RecordingEffect",
    "RecordingEffectTable",
    "ShapeBounds",
    "Side",
    "State",
    "either",
    "faults_at",
    "group",
    "installed",
    "is_group",
    "itself",
    "law_of",
    "laws",
    "load_laws",
    "means",
    "overlap",
    "read_effect",
]
