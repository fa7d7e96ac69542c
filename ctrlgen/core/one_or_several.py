"""Arguments that may be one or several: a text alone is no sequence of its letters, a table none of its keys."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any


def several(given: Any) -> list[Any]:
    """What is `given`, as a list: a text, a path or a table is one member."""
    return [given] if isinstance(given, str | PathLike | Mapping) else list(given)
