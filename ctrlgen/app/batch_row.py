"""One line of the table of a batch."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BatchRow:
    """One line of the table: `state` is "done", "done before" or "failed", and then `error` says why.

    `warning`: what of its recording is not plausible beside its device, such as a unit.
    `before`, `after`, `noise`: held-out error [`unit`] of the `channel` whose error is largest beside its noise.
    """

    name: str
    state: str
    verdict: str = ""
    findings: str = ""
    channel: str = ""
    before: float | None = None
    after: float | None = None
    noise: float | None = None
    unit: str = ""
    error: str = ""
    warning: str = ""
