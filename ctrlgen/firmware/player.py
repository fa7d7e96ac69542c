"""What the template of the player needs: the solved trajectory."""

from __future__ import annotations

from typing import Any

from ctrlgen.firmware.templates import comment
from ctrlgen.solution import Solution


def player_context(solution: Solution, prefix: str) -> dict[str, Any]:
    """Everything the templates of one player need."""
    return {
        "prefix": prefix,
        "title": comment(solution.scenario.file.title),
        "samples": len(solution.drive),
        "closed": solution.scenario.closed,
        "table": solution.drive,
        "rate": 1 / (solution.scenario.sample_time or 1.0),
    }
