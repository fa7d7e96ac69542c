"""What a reader may say of how a measurement file is written, where the file itself leaves it open."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ctrlgen.devices.section import Section

MARKS = {"tab": "\t", "blank": " "}  # separators that are written as words


class Layout(Section):
    """`layout` of recording.toml: answers to what a measurement file does not say. Left out: the file decides."""

    encoding: str | None = None
    """Encoding of a text file, such as `"utf-8"`, `"utf-16"`, `"cp1252"` or `"latin-1"`."""
    separator: Literal[",", ";", "|", "tab", "blank"] | None = None
    """What separates the cells of a row of a text file; `blank` is any run of blanks and tabs."""
    decimal: Literal[".", ","] | None = None
    """The decimal mark of a text file: whether `1,234` is one and a bit, or a thousand."""
    thousands: Literal["", ".", ",", "'", "blank"] | None = None
    """The mark between groups of three digits of a text file; `""` says that there is none."""
    header: Annotated[int, Field(ge=0)] | None = None
    """Number from 1 of the line of a text file in which the columns' names stand; 0 says that there is none."""
    dates: Literal["day first", "month first"] | None = None
    """Which way round `03/04/2024` is."""
    missing: tuple[str | int | float, ...] | None = None
    """Numbers or texts that stand for a reading that is none, such as `[-9999, "FAULT"]`; they are left out. `[]` says that every number is
    a reading. Left out: numbers such as -9999 or 65535 are left out where they are far from all others, and asked where they are near."""
