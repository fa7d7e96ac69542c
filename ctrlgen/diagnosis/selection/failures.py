"""What a trial may end with beside a fit: an error of the law, of the device or of the program."""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.core.errors import CtrlgenError, InputError
from ctrlgen.diagnosis.selection.cause_entry import cause_name
from ctrlgen.estimation.hypothesis import Hypothesis

_OF_CODE = (TypeError, AttributeError, LookupError)  # their messages alone do not say what is wrong
UNSOLVED = (CtrlgenError, ValueError, ArithmeticError, RuntimeError)
"""What a simulation of laws that have been fitted may end with: a stage that cannot be built, a balance or integrator that does not
converge. For where nobody is told of it: other errors are this program's own, and end the diagnosis."""
FAILURES = (*UNSOLVED, *_OF_CODE)
"""What a trial may end with, and then says so: also a law that cannot be written down at its place."""


@dataclass(frozen=True)
class Failure:
    """A trial that ended in an error: the `cause` that it was made for, None for the device without a new one, and `why`."""

    cause: Hypothesis | None
    why: str

    def __str__(self) -> str:
        return f"{cause_name(self.cause) if self.cause else 'a trial'}: {self.why}"


def reason_of(error: Exception) -> str:
    """Why a trial failed, as its error says it."""
    if isinstance(error, InputError):
        return "; ".join(f.what for f in error.faults)
    text = str(error)
    return f"{type(error).__name__}: {text}" if isinstance(error, _OF_CODE) or not text else text
