"""Factors that a file states beside its numbers without a convention that says whether they are in them: told, not applied."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

FACTOR = re.compile(
    r"(^|[ _.])(gain|scale|scaling|factor|slope|multiplier|conversion|sensitivity)($|[ _.])", re.IGNORECASE
)
APPLIED = ("scale_factor",)  # which the CF conventions define
NI_SCALE = "NI_"  # begins the properties of scales that the reader of TDMS applies


def unapplied(name: str, attributes: Iterable[tuple[str, Any]]) -> list[str]:
    """A note for each attribute of the column `name` that looks like a factor other than one."""
    said = []
    for key, value in attributes:
        if key in APPLIED or key.startswith(NI_SCALE) or not FACTOR.search(re.sub(r"(?<=[a-z])(?=[A-Z])", "_", key)):
            continue
        try:
            number = float(value)
        except (TypeError, ValueError):
            continue
        if number != 1:
            said.append(
                f"{name}: {key} = {number:g} stands beside it and is not applied; where its numbers lack it, write scale = {number:g}"
            )
    return said
