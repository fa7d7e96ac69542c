"""Sensor laws that the raw readings show without any model: a channel that reads one number, and rounding to steps."""

from __future__ import annotations

import numpy as np

from ctrlgen.effects import Effect
from ctrlgen.numerics.quantisation_step import quantisation_step

# parameters [SI], and the rms change that the law makes to the readings
Detected = tuple[dict[str, float], float]


def detect_directly(law: type[Effect], readings: np.ndarray) -> Detected | None:
    """The law's parameters read from `readings` (n,) [SI], and its rms effect on them; None where they do not show the law."""
    detector = _DETECTORS.get(law.kind)
    return None if detector is None else detector(readings)


def _stuck(readings: np.ndarray) -> Detected | None:
    if np.ptp(readings) > 0:
        return None
    return {"share": 1.0, "level": float(readings[0])}, np.inf


def _quantisation(readings: np.ndarray) -> Detected | None:
    """Rounding to a step q changes a reading by q/sqrt(12) rms (Widrow and Kollar 2008)."""
    step = quantisation_step(readings)
    return ({"share": 1.0, "quantum": step}, step / np.sqrt(12.0)) if step else None


_DETECTORS = {"stuck": _stuck, "quantisation": _quantisation}
