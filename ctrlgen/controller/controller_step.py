"""One answer of a controller, and what it says of what was changed; small operations that its decisions share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntFlag

import casadi as ca
import numpy as np

from ctrlgen.numerics.batched_evaluation import quick

State = tuple[np.ndarray, ...]  # x, z, and of a device whose drives have rate limits the last drive


class ControllerStatus(IntFlag):
    """What the controller had to change. 0: the target is reached as commanded."""

    DISPLACEMENT = 1  # the target lies beyond the displacement range; the nearest target inside was taken
    COMPOSITE = 2  # a limit on stress or rotation: the displacement was scaled toward home
    STATE = 4  # the actuator state (temperature) was set to its limit
    DRIVE = 8  # a drive is at its limit: the target is reached later than commanded
    INPUT = 16  # the target is not a number or absurdly large: it is ignored, drives at zero or the nearest admissible value
    LOST = 32  # the state is none that the controller left: the safe drives until it is initialised again
    # 64 is of the constants that the C is given when it starts (`ctrlgen.firmware.online.start_constants`).
    # A drive changes as fast as it may: the target is reached later than commanded. Beside it DISPLACEMENT,
    # COMPOSITE and STATE say also that the device passes that limit, because a drive cannot turn back as fast as the limit asks.
    RATE = 128
    # A state that is believed may be wrong: nothing is promised of the device beside its drives (`estimate`)
    UNSURE = 256
    CLOCK = 512  # the time since the last call was no sample (`estimate`)
    # 1024 is of the C's checksum over its state (`ctrlgen.firmware.online.checksum`).


@dataclass(frozen=True)
class ControllerStep:
    """One answer of the controller, SI; `state` (x, z) is the one predicted for the next sample, with rate limits (x, z, drive)."""

    status: ControllerStatus
    displacement: np.ndarray
    actuator_state: np.ndarray
    drive: np.ndarray
    state: State


def answer(kernel: ca.Function, *arguments: object) -> np.ndarray:
    """The only result (n,) of a `kernel`."""
    return quick(kernel)(*arguments)


def clamp(wanted: np.ndarray, low: np.ndarray, high: np.ndarray, slack: np.ndarray) -> tuple[np.ndarray, bool]:
    """`wanted` clipped to low ... high (NaN to low), and whether that changed it by more than `slack`; true for NaN."""
    inside = (wanted > low) & (wanted < high)
    if inside.all():  # as most are; at a bound of zero the sign of the answer is the bound's
        return wanted, False
    raised = np.where(wanted > low, wanted, low)
    limited = np.where(raised < high, raised, high)
    with np.errstate(invalid="ignore"):  # inf - inf, of a state that overflowed
        return limited, not bool(np.all(np.abs(limited - wanted) <= slack))
