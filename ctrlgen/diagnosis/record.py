"""diagnosis.json: the answer as plain numbers in the reader's units."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from ctrlgen.diagnosis.diagnosis import Diagnosis, Finding


def as_dict(diagnosis: Diagnosis) -> dict[str, Any]:
    """What diagnosis.json holds; numbers that are not finite as None, nothing that changes from run to run."""
    return plain({
        "verdict": diagnosis.verdict,
        "findings": [_finding(found) for found in diagnosis.findings],
        "where": diagnosis.where,
        "held_out": {channel: dataclasses.asdict(error) for channel, error in diagnosis.held_out.items()},
        "detectable": diagnosis.detectable,
        "next_experiment": diagnosis.next_experiment,
        "history": diagnosis.history,
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


def plain(value: Any) -> Any:
    """`value` in the types of JSON: arrays and tuples as lists, records as objects, NaN and infinity as None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): plain(member) for key, member in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(member) for member in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
