"""The context of the player's template: the solved drives in the form that `compression` chose."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from ctrlgen.firmware.c.templates import ABI
from ctrlgen.firmware.player.compression import INSTRUCTION_BUDGET, Compression, PlayerCandidate, SampleTable
from ctrlgen.firmware.player.spline import Spline
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.solution import Solution
from ctrlgen.version import __version__


def player_context(solution: Solution, compression: Compression, prefix: str) -> dict[str, Any]:
    """The context of player.c.j2 and player.h.j2."""
    curve = compression.curve
    pieces = curve.pieces if isinstance(curve, Spline) else ()
    limited = {
        side: [(i, v) for i, v in enumerate(bound.tolist()) if np.isfinite(v)]
        for side, bound in (("low", compression.low), ("high", compression.high))
    }
    return {
        "prefix": prefix,
        "title": solution.scenario.file.title,
        "version": __version__,
        "given_at_start": bool(solution.model.device.given_at_start),
        "loads": solution.model.device.load_texts,
        "device_sha256": solution.scenario.device_sha256,
        "digest": solution.scenario.digest,
        "played_build": player_build(solution, compression),
        "samples": len(solution.drive),
        "closed": solution.scenario.closed,
        "whole": 2**32
        // len(solution.drive)
        * len(solution.drive),  # samples of the complete rounds that an index counts
        "curve": curve,
        "table": curve.drive if isinstance(curve, SampleTable) else None,
        "segments": [piece.segments for piece in pieces],
        "scales": [1 / (piece.stop - piece.start) for piece in pieces],
        "limited": limited if any(limited.values()) else None,
        "chosen": compression.chosen,
        "lines": [_line(c) for c in compression.candidates],
        "budget": INSTRUCTION_BUDGET,
        "rate": 1 / in_time(solution.scenario.clock).sample_time,
    }


def player_build(solution: Solution, compression: Compression) -> int:
    """What tells this player from others of the same name: a word of interface, inputs, rate and drives as the C has them."""
    scenario = solution.scenario
    about = ABI, scenario.device_sha256, sorted(scenario.digest.items()), scenario.sample_time, scenario.closed
    drives = compression.curve.values(compression.real)
    return int(hashlib.sha256(repr(about).encode() + drives.tobytes()).hexdigest()[:8], 16)


def _line(c: PlayerCandidate) -> str:
    """One candidate, as the header's comment lists it."""
    verdict = f"chosen: {c.remark}" if c.chosen else c.remark
    if c.bytes is None or c.length is None:
        return f"{c.kind:<8} {verdict}"
    off = f"{1e9 * c.length:.2g} nm, {c.angle:.2g} rad"
    return f"{c.kind:<8} {c.size}: {c.bytes} bytes, {c.operations} operations, about {c.instructions} instructions, {off}; {verdict}"
