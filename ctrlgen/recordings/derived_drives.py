"""Which drives of an imposed motion need not be recorded, because they are slopes, or the integral, of one that was."""

from __future__ import annotations

from collections.abc import Collection, Sequence

ORDERS = ("position", "velocity", "acceleration")
"""Of an imposed motion: each the slope of the one before."""
ALLOWED = (1, 2, -1)
"""Orders of derivatives that a recording states, those that are sought first."""


def derived_drives(missing: Sequence[str], recorded: Collection[str]) -> dict[str, tuple[str, int]]:
    """Of each missing drive, such as 'drive.velocity' or 'drive.q1_velocity', that is a derivative of a recorded one: that one and the
    order, by which it is the less differentiated the better."""
    found = {}
    for name in missing:
        kind = next((k for k in ORDERS if name.startswith("drive.") and name.endswith(k)), None)
        if kind is None:
            continue
        stem = name.removesuffix(kind)
        for order in ALLOWED:
            place = ORDERS.index(kind) - order
            if 0 <= place < len(ORDERS) and f"{stem}{ORDERS[place]}" in recorded:
                found[name] = (f"{stem}{ORDERS[place]}", order)
                break
    return found


def written(of: str, order: int) -> str:
    """A derivative as recording.toml writes it."""
    return f'{{ of = "{of}", order = {order} }}'
