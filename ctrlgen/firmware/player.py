"""What the template of the player needs: the solved trajectory as `compression` holds it."""

from __future__ import annotations

from typing import Any

from ctrlgen.firmware.compression import BUDGET, Compression, Table
from ctrlgen.firmware.spline import Spline
from ctrlgen.firmware.templates import comment
from ctrlgen.solution import Solution


def player_context(solution: Solution, compression: Compression, prefix: str) -> dict[str, Any]:
    """Everything the templates of one player need."""
    curve = compression.curve
    pieces = curve.pieces if isinstance(curve, Spline) else ()
    return {
        "prefix": prefix,
        "title": comment(solution.scenario.file.title),
        "samples": len(solution.drive),
        "closed": solution.scenario.closed,
        "curve": curve,
        "table": curve.drive if isinstance(curve, Table) else None,
        "segments": [piece.segments for piece in pieces],
        "scales": [1 / (piece.stop - piece.start) for piece in pieces],
        "low": compression.low,
        "high": compression.high,
        "chosen": compression.chosen,
        "lines": [_line(c) for c in compression.candidates],
        "budget": BUDGET,
        "rate": 1 / (solution.scenario.sample_time or 1.0),
    }


def _line(c: Any) -> str:
    """One candidate, as the header's comment lists it."""
    verdict = f"chosen: {c.remark}" if c.chosen else c.remark
    if c.bytes is None:
        return f"{c.kind:<8} {verdict}"
    off = f"{1e9 * c.length:.2g} nm, {c.angle:.2g} rad"
    return (
        f"{c.kind:<8} {c.size}: {c.bytes} bytes, {c.operations} operations, about {c.instructions} instructions, {off}; {verdict}"
    )
