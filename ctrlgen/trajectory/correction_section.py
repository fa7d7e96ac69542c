"""`[[correction]]` of scenario.toml: what the C adds to a channel of the followed signal, and learns, along another one or along itself."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ctrlgen.core.units import In, Quantity
from ctrlgen.devices.section import Section

MOST_ENTRIES = 1024  # of a table: 4 kB in float
MOST_HARMONICS = 16  # slots and poles of a motor, or threads and balls of a screw, in a period; costs grow with it
GAIN = 0.8  # a fifth is left after a run, 1/25 after two; settles on devices that answer up to 2.5 times as much as described


class CorrectionSection(Section):
    """One `[[correction]]` table: what the C adds to a commanded channel, bounded, and learns from measured runs."""

    of: str
    """The channel of the followed signal that is corrected."""
    over: str | None = None
    """The channel along which the error repeats, such as the angle of a motor. Left out: the corrected one itself."""
    kind: Literal["table", "harmonic"]
    """`table`: entries at even distances with straight lines between them. `harmonic`: sines and cosines of a period, without a mean."""
    period: Annotated[Quantity, In(None)] | None = None
    """Way of `over` after which the error repeats, such as "360 deg"; a table is then closed. Needed by `harmonic`."""
    range: tuple[Annotated[Quantity, In(None)], Annotated[Quantity, In(None)]] | None = None
    """From where to where an open table goes, in place of `period`; beyond it its ends are held."""
    entries: Annotated[int, Field(ge=4, le=MOST_ENTRIES)] | None = None
    """Number of entries of a table."""
    harmonics: Annotated[int, Field(ge=1, le=MOST_HARMONICS)] | None = None
    """The highest harmonic of the period."""
    bound: Annotated[Quantity, In(None, positive=True)]
    """The most that is ever added. So far may a wrong sensor, or a damaged table, lead the device astray."""
    gain: Annotated[float, Field(gt=0, le=1)] = GAIN
    """Share of what a run shows that is taken over after it."""

    @model_validator(mode="after")
    def _meaning(self) -> CorrectionSection:
        if self.kind == "harmonic" and (self.period is None or self.harmonics is None):
            raise ValueError('kind = "harmonic" needs period = "360 deg" and harmonics = 8, such as these')
        if self.kind == "table" and (self.entries is None or (self.period is None) == (self.range is None)):
            raise ValueError(
                'kind = "table" needs entries = 64, such as this, and either period or range = ["-50 um", "50 um"]'
            )
        if (self.range if self.kind == "harmonic" else self.harmonics) is not None:
            raise ValueError(
                f'{"range" if self.kind == "harmonic" else "harmonics"} has no meaning for kind = "{self.kind}"; leave it out'
            )
        if self.kind == "harmonic" and self.entries is not None:
            raise ValueError('entries has no meaning for kind = "harmonic"; leave it out')
        if self.period is not None and not self.period.si > 0:
            raise ValueError(f'period = "{self.period.text}" must be larger than zero')
        if self.range is not None and not self.range[0].si < self.range[1].si:
            raise ValueError("range must go from a smaller to a larger value")
        return self

    @property
    def along(self) -> str:
        """The channel along which the error repeats."""
        return self.over or self.of
