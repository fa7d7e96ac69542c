"""What is compared of the generated C, and the result of one comparison of one signal."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import numpy as np
from pydantic import Field, PlainSerializer, computed_field

from ctrlgen.core.units import from_si
from ctrlgen.reporting.result_file import FiniteOrNull, Keys
from ctrlgen.verification.host import HostBuild


class ComparisonKind(StrEnum):
    """What is compared, in the words of the reports."""

    FOLLOWED = "scenario, online C - CasADi"
    SETTLED = "random targets, online C - CasADi"
    SHIPPED_TEST = "the folder's own test"
    EQUILIBRIA = "random targets, online C -> model - target"
    CHASED = "hostile sequence, online C - CasADi"
    FOLLOWED_INTEGERS = "scenario, C in integers - whole numbers"
    SETTLED_INTEGERS = "random targets, C in integers - whole numbers"
    CHASED_INTEGERS = "hostile sequence, C in integers - whole numbers"
    TIMED = "calls at times that vary, online C - CasADi"
    EXCESS = "hostile sequence -> model: excess over a limit"
    RATE = "hostile sequence: change of a drive over its rate"
    ABOUT = "poses of pivots, online C - CasADi"
    OPTIMUM = "scenario, online C - IPOPT"
    ONLINE_PATH = "online C -> model - command"
    PLAYER_PATH = "player C -> model - command"
    CURVE = "player C - its curve"
    PLAYED_OPTIMUM = "player C - IPOPT"
    PLAYED_ROOT = "player C - Newton's method"
    CORRECTED = "corrected targets, C - CasADi"
    LEARNT = "numbers of corrections after runs, C - reference"
    BETWEEN = "player C a quarter on - its curve"

    @property
    def is_controller(self) -> bool:
        """Whether the C is held to the controller evaluated by CasADi, or in whole numbers by Python."""
        return self in CONTROLLER


CONTROLLER = (
    *(ComparisonKind.FOLLOWED, ComparisonKind.SETTLED, ComparisonKind.CHASED, ComparisonKind.TIMED),
    *(ComparisonKind.FOLLOWED_INTEGERS, ComparisonKind.SETTLED_INTEGERS, ComparisonKind.CHASED_INTEGERS),
)


class ComparisonEntry(Keys):
    """Generated C against the model, one build and one signal."""

    build: Annotated[HostBuild, PlainSerializer(str, return_type=str)] = Field(
        title="Build", description="Compiler, arithmetic and flags."
    )
    what: Annotated[ComparisonKind, PlainSerializer(str, return_type=str)] = Field(
        title="What", description="What was compared."
    )
    signal: str = Field(description="The compared signal.")
    unit: str = Field(description="Unit of worst, rms and limit.")
    worst: FiniteOrNull = Field(description="Largest deviation.")
    rms: FiniteOrNull = Field(description="Root mean square deviation.")
    limit: float = Field(description="Largest deviation that passes.")
    samples: int = Field(description="Samples compared.")
    first: int | None = Field(description="First sample out of tolerance; null where there is none.")

    @computed_field(description="Whether the largest deviation is within the limit.")  # type: ignore[prop-decorator]
    @property
    def passed(self) -> bool:
        """Whether every sample is within the limit; NaN is not."""
        return self.first is None


def entry_of(
    build: HostBuild, what: ComparisonKind, signal: str, unit: str, difference: np.ndarray, limit: float
) -> ComparisonEntry:
    """Largest and root mean square value of a difference (n, channels) [SI], in `unit`."""
    size = np.abs(difference).max(axis=1)
    beyond = np.flatnonzero(~(size <= limit))
    scale = 1.0 if unit == "K" else from_si(1.0, unit)
    return ComparisonEntry(
        build=build,
        what=what,
        signal=signal,
        unit=unit,
        worst=float(size.max()) * scale,
        rms=float(np.sqrt(np.mean(difference**2))) * scale,
        limit=limit * scale,
        samples=len(difference),
        first=int(beyond[0]) if beyond.size else None,
    )
