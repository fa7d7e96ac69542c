"""A standard uncertainty as a file states it."""

from __future__ import annotations

from ctrlgen.core.units import parse
from ctrlgen.devices.section import Section


class Deviation(Section):
    """A standard uncertainty, GUM 3.3.5: the standard deviation of what is not known exactly."""

    sd: str
    """Standard deviation: a difference with its unit, such as "0.5 K", or a share of the number, such as "5 %"."""
    source: str
    """Where it comes from: repeated measurements, a certificate, a data sheet, experience."""


def parse_share(text: str) -> float:
    """A share such as "5 %" or "0.05" as a number. Raises ValueError."""
    body = text.strip()
    return parse(body.removesuffix("%").strip(), "1") * (0.01 if body.endswith("%") else 1.0)
