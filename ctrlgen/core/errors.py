"""The exceptions that ctrlgen raises on purpose. Each message says what is wrong, where, and what to do.

CtrlgenError
├── InputError        a file or an argument is wrong; lists every fault found
├── Unreachable       the device cannot follow the trajectory; carries what can be followed
├── SolverError       IPOPT or a simulation ended without a solution
└── ToolError         a compiler is missing or refuses the generated C
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ctrlgen.core.counts import number_of

if TYPE_CHECKING:
    import numpy as np


LISTED = 40  # faults of one input in a message: what a reader mends before he tries again
LONGEST_FAULT = 2000  # characters of one


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_FAULT else f"{text[: LONGEST_FAULT // 2]} ... {text[-LONGEST_FAULT // 2 :]}"


def visible(text: str) -> str:
    """`text` with every character that a terminal would obey instead of showing (controls, marks of direction) as its escape."""
    return "".join(c if c.isprintable() or c in "\n\t" else ascii(c)[1:-1] for c in text)


class CtrlgenError(Exception):
    """Base of every error that a user can cause; the command line prints it and exits with status 1."""


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with an input: `where` (a dotted key, a line) and `what`, with what to do."""

    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}"


class TableFaults(ValueError):
    """What is wrong with one table of a file, as its validator finds it: `core.files.validate` lists every fault by its key."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self.faults = tuple(faults)
        super().__init__("; ".join(map(str, self.faults)))


class InputError(CtrlgenError):
    """An input that cannot be used, with every fault at once."""

    def __init__(self, source: object, faults: Sequence[Fault]) -> None:
        self.source = str(source)
        self.faults = tuple(faults)
        count = number_of(len(self.faults), "fault")
        listed = [f"  - {_shortened(str(fault))}" for fault in self.faults[:LISTED]]
        if len(self.faults) > LISTED:
            listed.append(f"  - and {len(self.faults) - LISTED} more")
        super().__init__(visible("\n".join([f"{self.source}: {count}", *listed])))


@dataclass(frozen=True)
class Infeasibility:
    """Where a trajectory cannot be followed: `samples` at which a limit is broken, the `worst` of them, the `command`
    (n, channels) [SI].

    `nearest` (channels,) is the pose that can be held nearest to the worst sample, None where that sample itself can be held and
    only the pace is at fault. `alternatives`: paths (n, channels) [SI] that can be followed, by what they are compared with the
    commanded one ("shifted by delta_z = +12 um").
    """

    samples: tuple[int, ...]
    worst: int
    command: np.ndarray
    nearest: np.ndarray | None
    alternatives: Mapping[str, np.ndarray]


class Unreachable(CtrlgenError):
    """No admissible drive produces the commanded trajectory."""

    def __init__(self, message: str, infeasibility: Infeasibility) -> None:
        self.infeasibility = infeasibility
        super().__init__(message)


class SolverError(CtrlgenError):
    """A solver ended without a solution, although the target is not known to be unreachable."""


class ToolError(CtrlgenError):
    """A program outside ctrlgen (a C compiler) is missing or failed."""


class ExampleGiven(ValueError):
    """A text is no quantity of the wanted kind; the message says what to write instead."""


class WrongUnit(ExampleGiven):
    """A number without a unit, or with one of another dimension: what is `said` of it, and what to write `instead`."""

    def __init__(self, said: str, instead: str, joint: str) -> None:
        super().__init__(f"{said}{joint} {instead}")
        self.said, self.instead = said, instead
