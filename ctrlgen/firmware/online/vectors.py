"""Reference vectors: targets and the controller's answers to them, for the self test that runs in the firmware."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.feedforward import Controller
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render
from ctrlgen.firmware.online.limit_tables import FLOAT_SLACK
from ctrlgen.firmware.online.stated_pivot import pivot_vectors
from ctrlgen.firmware.online.vector_cases import Call, limiter_calls
from ctrlgen.firmware.player.compression import Compression, SampleTable
from ctrlgen.firmware.player.spline import Spline
from ctrlgen.trajectory.inverse.clock import Clock, in_time

VECTORS = 24  # reference vectors along the command
BEYOND = 16  # far beyond every limit
CASES = 64  # at most, into the limiter's branches
SETTLE, FRESH = 1, 2  # bits of how a vector is run: settle and not step; from a device at rest
PLAYED = 17  # samples of the player
BETWEEN = (0.1, 0.5, 1.3, 1.7)  # of a sample time before, and after, which the player is asked
MEETINGS = 4  # pieces of the player whose knots and ends it is asked behind
UNUSABLE = 3  # NaN, infinity, minus infinity: each in every channel of the target, and as the time of the player


def vectors(controller: Controller, command: np.ndarray, real: Real) -> dict[str, Any]:
    """Targets with the drives and the status that the model answers, and the tolerance of the drives.

    The tolerance is the change of drive that four roundings of target, displacement and actuator state cause, or one of a number of a
    target that a limit scales.
    """
    controller = controller if real is Real.DOUBLE else replace(controller, slack=FLOAT_SLACK)
    rng = np.random.default_rng(0)
    scale = np.array(controller.kernels.target.scale)
    still = controller.kernels.sample_time is None
    calls = [Call(target, k == 0 or still, k == 0) for k, target in enumerate(command[:VECTORS])]
    far = rng.normal(size=(BEYOND, command.shape[1])) * 40 * scale
    calls += [Call(target, True, False) for target in (*far, np.full(command.shape[1], 1e9))]
    calls += limiter_calls(controller, real.epsilon, CASES)
    rows, tolerance, state = [], 0.0, controller.rest()
    rounding = 4 * real.epsilon
    for call in calls:
        target = real.held(call.target)
        before = controller.rest() if call.fresh else state
        step = controller.step(before, target, settle=call.settle)
        state = step.state
        # rounding may make the line search accept another trial in float: only the status is compared there
        exact = not step.status & ControllerStatus.DRIVE
        how = SETTLE * call.settle + FRESH * call.fresh
        rows.append(
            {
                "target": target,
                "drive": real.held(step.drive),
                "status": int(step.status),
                "how": how,
                "exact": exact,
            }
        )
        if exact and not step.status & ControllerStatus.INPUT:
            reached = step.displacement, step.actuator_state
            off = controller.rounding(before, target, reached, call.settle, rounding).drive
            tolerance = max(tolerance, float(off.max()))
            # Scaled from far away, it moves by the rounding of what it was scaled from.
            if step.status:
                for unit in np.eye(len(target)):
                    near = controller.step(before, target * (1 + rounding / 4 * unit), settle=call.settle)
                    if near.status == step.status:
                        tolerance = max(tolerance, float(np.max(np.abs(near.drive - step.drive))))
    tolerance = max(tolerance, 1e-12 * float(np.max(controller.kernels.nominal.u_scale)))
    return {
        "rows": rows,
        "tolerance": tolerance,
        "unusable": UNUSABLE * command.shape[1],
        "beyond": min(len(command), VECTORS),
        "lost": sum(part.size for part in controller.rest()) + 1,
        "turned": pivot_vectors(controller.kernels, real),
    }


def played_vectors(compression: Compression | None, samples: int, clock: Clock) -> dict[str, Any]:
    """Samples of the player, the first and the last among them, times between them, and the tolerance of both.

    The tolerance is 16 roundings of the largest drive, since a processor may fuse products and sums.
    """
    if compression is None:
        return {"played": [], "played_tolerance": 0.0, "played_unusable": 0, "timed": []}
    indices = np.unique(np.linspace(0, samples - 1, PLAYED).round().astype(int))
    drives = compression.drives(indices)
    rounding = 16 * compression.real.epsilon * float(np.max(np.abs(drives)))
    return {
        "played": [
            {"index": int(k), "drive": compression.real.held(drive)} for k, drive in zip(indices, drives, strict=True)
        ],
        "played_unusable": UNUSABLE,
        "played_tolerance": max(rounding, float(np.finfo(np.float32).tiny)),
        "timed": _timed(compression, indices, samples, 1 / in_time(clock).sample_time),
    }


def self_test_calls(c: dict[str, Any]) -> dict[str, int]:
    """What the self test of a context counts: "online_calls" of the controller, and all "calls", with those of the player, its wrap or
    end and the refused ones among them."""
    parts = {"estimate": "estimated", "ringing": "ringing", "timed": "times", "correction": "correction"}
    counted = {name: _counts(c, name) if c[of] else 0 for name, of in parts.items()}
    correction = counted["correction"]
    online = len(c["rows"]) + 2 * c["unusable"] + 2 + 2 * c["lost"] + _pivot_calls(c) + sum(counted.values())
    player = 0
    if c["player"]:
        wraps = c["closed"] and c["whole"] < 2**32
        player = len(c["played"]) + len(c["timed"]) + 6 + wraps + c["played_unusable"]
    return {"online_calls": online, "calls": online + player, "correction_calls": correction}


def _counts(c: dict[str, Any], part: str) -> int:
    """Calls that a part of the self test counts."""
    return render(f"selftest_{part}.c", c | {"lit": c["real"].literal}).count("count(outcome")


def _pivot_calls(c: dict[str, Any]) -> int:
    """Calls with a pivot: those with reference answers; each number of a pose and of a pivot that is none; missing pointers."""
    return len(c["turned"]) + c["m"] + 3 + 3 if c["turned"] else 0


def _meetings(curve: SampleTable | Spline) -> Iterator[tuple[int, float]]:
    """Samples of a spline, and shares of a sample time after them, that lie behind a knot between two samples, and where pieces meet."""
    if not isinstance(curve, Spline):
        return
    for piece in curve.pieces[:MEETINGS]:
        length = piece.stop - piece.start
        for k in range(piece.start, piece.stop - 1):
            left = (length - (k - piece.start) * piece.segments % length) / piece.segments  # samples to the next knot
            if left < 1:
                yield k, (left + 1) / 2
                break
        if piece.stop < curve.samples or not curve.periodic:
            yield piece.stop - 1, 0.5


def _timed(compression: Compression, indices: np.ndarray, samples: int, rate: float) -> list[dict[str, Any]]:
    """Times of the player with their drives, rounded as in the C: the place of a time on the curve is then exactly the C's."""
    number: Any = np.float32 if compression.real is Real.FLOAT else np.float64
    places = {(int(k) + share) / rate for k in indices for share in BETWEEN}
    places |= {(k + share + 0.5) % samples / rate for k, share in _meetings(compression.curve)}
    times: np.ndarray = np.array(sorted(places), dtype=number)
    times = times[times < number(samples / rate)]
    place: np.ndarray = times * number(rate) + number(samples - 0.5 if compression.closed else -0.5)
    place = np.maximum(place, number(0))
    whole = np.floor(place).astype(int)
    fraction = (place - whole.astype(number)).astype(float)
    fraction = np.where(compression.closed | (whole < samples - 1), fraction, 0.0)
    drives = compression.drives(whole % samples, fraction)
    return [{"time": float(t), "drive": compression.real.held(drive)} for t, drive in zip(times, drives, strict=True)]
