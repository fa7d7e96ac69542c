"""The base of every table of a device file."""

from __future__ import annotations

from typing import ClassVar

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A table of a device file. Unknown keys are faults; nothing changes after loading. The docstring below a key describes it.

    `domain` is the part of the device to which a report assigns its numbers; `relative_sd` their relative standard deviation
    where the file states none; None where any deviation from the file would be a finding, 0 where they are set and not measured.
    """

    domain: ClassVar[str] = "mechanism"
    relative_sd: ClassVar[float | None] = None

    # built where first used: a device waits for the tables of no other kind
    model_config = ConfigDict(
        extra="forbid", frozen=True, arbitrary_types_allowed=True, allow_inf_nan=False, defer_build=True
    )
