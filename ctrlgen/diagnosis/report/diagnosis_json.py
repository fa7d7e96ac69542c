"""diagnosis.json: the answer as plain numbers in the reader's units."""

from __future__ import annotations

import dataclasses
from typing import Any

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.selection.result import Diagnosis, Finding


def as_dict(diagnosis: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds; numbers that are not finite as None, nothing that changes from run to run."""
    return plain({
        "verdict": diagnosis.verdict,
        "findings": [_finding(found) for found in diagnosis.findings],
        "residual_location": diagnosis.residual_location,
        "held_out": {channel: dataclasses.asdict(error) for channel, error in diagnosis.held_out.items()},
        "detectability": diagnosis.detectability,
        "next_experiment": diagnosis.next_experiment,
        "search_history": diagnosis.search_history,
    })  # fmt: skip


def _finding(found: Finding) -> dict[str, Any]:
    return {
        "effect": found.effect,
        "location": found.location,
        "parameters": {
            name: {"value": e.value, "ci95": e.ci95, "unit": e.unit} for name, e in found.parameters.items()
        },
        "alternatives": [{"effect": effect, "location": location} for effect, location in found.alternatives],
        "held_out_gain": found.held_out_gain,
        "source": found.source,
    }
