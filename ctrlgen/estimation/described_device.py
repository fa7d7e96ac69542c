"""The device as described, fitted once to the same samples under the same errors: noise, outliers and search each ask for it."""

from __future__ import annotations

import operator
from collections import deque
from typing import Any

from ctrlgen.devices import Device
from ctrlgen.estimation.fit import Fit, Fitter

KEPT = 2  # before and after samples are marked, or the noise is learnt: each holds the slopes of a fit
# The last ones with what they depend on. Whether one was there changes no result.
_DESCRIBED: deque[tuple[tuple[Any, ...], tuple[Fitter, Fit]]] = deque(maxlen=KEPT)


def described(fitter: Fitter, device: Device) -> tuple[Fitter, Fit]:
    """`Fitter.described` of a device."""
    key = (fitter.recording, fitter.noise, fitter.errors, fitter.checkpoint, device)
    found = next((found for known, found in _DESCRIBED if all(map(operator.is_, known, key))), None)
    if found is None:
        found = fitter.described(device)
        _DESCRIBED.append((key, found))
    return found


def forget_described() -> None:
    """Those of an earlier diagnosis only take memory."""
    _DESCRIBED.clear()
