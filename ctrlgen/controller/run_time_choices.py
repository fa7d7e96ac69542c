"""Numbers of a device that its generated controller is given when it starts: the values at which a controller is looked at.

A controller takes decisions before it runs, such as whether a drive can meet its limit. With run-time constants they must hold over
the whole box of values: they are taken for the file's values, with each constant alone at either end of its range, and with all
at ends of theirs, drawn `CORNERS` times.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.run_time import RunTimeConstant

CORNERS = 2  # drawn at random, beside those with all constants low and all high


def choices(constants: Sequence[RunTimeConstant]) -> Iterator[dict[str, float]]:
    """Values by path: each constant alone at either end, then all at ends of their ranges."""
    for constant in constants:
        yield {constant.path: constant.low}
        yield {constant.path: constant.high}
    if len(constants) > 1:
        rng = np.random.default_rng(len(constants))
        corners = [[0] * len(constants), [1] * len(constants), *rng.integers(0, 2, (CORNERS, len(constants))).tolist()]
        for corner in corners:
            yield {c.path: (c.low, c.high)[side] for c, side in zip(constants, corner, strict=True)}


def with_constants(device: Device, values: dict[str, float]) -> Device:
    """The device with its run-time constants at `values` [SI, by path], compiled in: it has no [run_time] of its own."""
    return changed(device, values).model_copy(update={"run_time": None})
