"""What a law reads, from names and values: its own states stand beside what the model gives."""

from __future__ import annotations

from dataclasses import fields
from types import SimpleNamespace

from ctrlgen.effects import LawInputs

NAMES = [f.name for f in fields(LawInputs)]


def law_inputs(**given) -> LawInputs:
    """`given` as a law reads it; names that no `LawInputs` has are states, and what is not given is None."""
    read = {name: given.get(name) for name in NAMES}
    read["states"] = SimpleNamespace(**{name: value for name, value in given.items() if name not in NAMES})
    return LawInputs(**read)
