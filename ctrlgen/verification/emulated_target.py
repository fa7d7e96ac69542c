"""The results of the generated C on emulated processors."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field, PlainSerializer, computed_field

from ctrlgen.core.counts import number_of
from ctrlgen.firmware.c.real import Arithmetic
from ctrlgen.reporting.result_file import Keys


class CallKind(StrEnum):
    """A kind of call, in the words of the reports."""

    STEP_SCENARIO = "step, along the scenario"
    STEP_RANDOM = "step, random targets"
    STEP_HOSTILE = "step, hostile targets"
    SETTLE_SCENARIO = "settle, along the scenario"
    SETTLE_RANDOM = "settle, random targets"
    PLAYER = "player, a sample"


STEPS = (CallKind.STEP_SCENARIO, CallKind.STEP_RANDOM, CallKind.STEP_HOSTILE)
SETTLES = (CallKind.SETTLE_SCENARIO, CallKind.SETTLE_RANDOM)

RealName = Annotated[Arithmetic, PlainSerializer(lambda real: real.value, return_type=str)]


class CallCost(Keys):
    """Instructions of one kind of call on an emulated processor."""

    what: Annotated[CallKind, PlainSerializer(str, return_type=str)] = Field(
        title="What", description="The kind of call."
    )
    calls: int = Field(description="Calls counted.")
    mean: float = Field(description="Mean number of instructions.")
    worst: int = Field(description="Largest number of instructions.")
    worst_within: int | None = Field(description="The same where no limit is active.")


class Target(Keys):
    """The C on one emulated processor, compared with this computer bit by bit."""

    core: str = Field(description="The emulated processor.")
    compiler: str = Field(description="Compiler and flags.")
    real: RealName = Field(title="Real", description="Arithmetic: float, double or integers.")
    costs: tuple[CallCost, ...] = Field(description="Instructions by kind of call.")
    stack: int = Field(description="Bytes of stack.")
    code: int = Field(description="Bytes of code.")
    tables: int = Field(description="Bytes of constant data.")
    writable: int = Field(description="Bytes of static writable memory; 0 is required.")
    numbers: int = Field(description="Numbers compared.")
    differing: int = Field(description="Numbers that differ.")
    ulp: int = Field(description="Largest difference in units in the last place.")
    where: str = Field(description="First call whose numbers differ; empty without one.")

    @computed_field(description="Whether no number differs and no static memory is writable.")  # type: ignore[prop-decorator]
    @property
    def passed(self) -> bool:
        """Whether every number is this computer's, and nothing is kept in writable memory of its own."""
        return self.differing == 0 and self.writable == 0

    @computed_field(description="Largest number of instructions of one call, by kind.")  # type: ignore[prop-decorator]
    @property
    def instructions(self) -> dict[str, int | None]:
        """Most instructions of one call: along the scenario; answered with status 0; at all; to settle; of the player.

        A target within all limits costs more where a limit of several channels, such as a stress, is near: the cheap bound
        that the scenario stays below does not tell, and the limit itself is worked out.
        """
        kinds = STEPS if self.worst(STEPS) is not None else SETTLES
        return {
            "scenario": self.worst(kinds[:1]),
            "status_0": self.worst(kinds, status_0=True),
            "worst": self.worst(kinds),
            "settle": self.worst(SETTLES),
            "player": self.worst((CallKind.PLAYER,)),
        }

    def worst(self, kinds: tuple[CallKind, ...], *, status_0: bool = False) -> int | None:
        """Most instructions of one call of these kinds, or of those answered with status 0; None without one."""
        costs = [cost for cost in self.costs if cost.what in kinds]
        counts = [cost.worst_within if status_0 else cost.worst for cost in costs]
        return max((count for count in counts if count is not None), default=None)

    @property
    def name(self) -> str:
        """Core, compiler and arithmetic, such as 'Cortex-M4F, zig 0.13.0, float'."""
        return f"{self.core}, {self.compiler}, {self.real.value}"

    @property
    def short_name(self) -> str:
        """Core, arithmetic and compiler, such as 'Cortex-M4F float, zig'."""
        return f"{self.core} {self.real.value}, {self.compiler.split()[0]}"

    @property
    def fault(self) -> str:
        """What is wrong with the run; empty where nothing is."""
        faults = []
        if self.differing:
            faults.append(
                f"{self.differing} of {self.numbers} numbers {'differs' if self.differing == 1 else 'differ'} from this computer's by "
                f"up to {number_of(self.ulp, 'unit')} in the last place, first in {self.where}"
            )
        if self.writable:
            faults.append(f"{number_of(self.writable, 'byte')} of static writable memory, where none is promised")
        return "; ".join(faults)


class StoppedTarget(Keys):
    """An emulated run that stopped early."""

    core: str = Field(description="The emulated processor.")
    compiler: str = Field(description="Compiler and flags.")
    real: RealName = Field(title="Real", description="Arithmetic: float, double or integers.")
    words: str = Field(description="Why it stopped.")

    @property
    def name(self) -> str:
        """Core, compiler and arithmetic, such as 'Cortex-M4F, zig 0.13.0, float'."""
        return f"{self.core}, {self.compiler}, {self.real.value}"


class NotRun(Keys):
    """A check that did not run."""

    what: str = Field(description="The check.")
    remedy: str = Field(description="How to make it run.")
