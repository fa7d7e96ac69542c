"""The plainer law inside a law that generalises it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Plainer:
    """The law `kind`, which a law is where its numbers `where` have these values; what `kind` alone has is then as in `beside`.

    Both count in the units of the laws' bounds. Numbers of one name mean the same in both laws; where they do not,
    `Effect.as_plainer` translates them. `left`: parts in proportion to the signal, over the amplitude, which the law `kind` has not; of
    each the law that says it beside `kind` at the same place. `constant`: the number whose part is a constant once the stage has moved: an
    offset beside `kind` says the same.
    """

    kind: str
    where: Mapping[str, float]
    beside: Mapping[str, float] = field(default_factory=dict)
    left: Mapping[str, str] = field(default_factory=dict)
    constant: str = ""
