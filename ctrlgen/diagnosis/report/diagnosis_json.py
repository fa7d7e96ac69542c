"""diagnosis.json: the answer as plain numbers in the reader's units."""

from __future__ import annotations

import dataclasses
from typing import Any

from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.report.narrative import sentence
from ctrlgen.diagnosis.report.shares_sentences import family_shares, shares_sentences
from ctrlgen.diagnosis.selection.attribution import Share
from ctrlgen.diagnosis.selection.diagnosis_result import Diagnosis, Finding
from ctrlgen.diagnosis.shares.shares_table import as_json
from ctrlgen.estimation.spikes import Spikes
from ctrlgen.reporting.result_file import origin


@dataclasses.dataclass(frozen=True)
class Provenance:
    """What a diagnosis was made from: SHA-256 of its input files by name, and the seed."""

    inputs: dict[str, str]
    seed: int


def diagnosis_record(diagnosis: Diagnosis, provenance: Provenance) -> dict[str, Any]:
    """What diagnosis.json holds, see `diagnosis_schema`; numbers that are not finite as None, nothing that changes from run to run."""
    return plain({
        **origin(provenance.inputs, provenance.seed, diagnosis.notes),
        "verdict": diagnosis.verdict,
        "sentence": sentence(diagnosis),
        "findings": [_finding(finding) for finding in diagnosis.findings],
        "attribution": {
            "explained": diagnosis.attribution.explained,
            "rest": _share(diagnosis.attribution.rest),
            "held_out": diagnosis.attribution.held_out,
        },
        "shares": _shares(diagnosis),
        "empirical_terms": [
            {
                "effect": t.effect.kind, "at": t.effect.at, "of": t.effect.of, "channel": t.channel, "function_of": t.kind.value,
                "share": t.share, "rms_before": t.rms_before, "rms_after": t.rms_after, "unit": t.unit,
            }
            for t in diagnosis.empirical_terms
        ],
        "residual_location": diagnosis.residual_location,
        "held_out": {channel: dataclasses.asdict(error) for channel, error in diagnosis.held_out.items()},
        "spikes": {s.channel: _spikes(s) for s in diagnosis.spikes},
        "detectability": diagnosis.detectability,
        "next_experiment": diagnosis.next_experiment,
        "search_history": diagnosis.search_history,
    })  # fmt: skip


def _finding(finding: Finding) -> dict[str, Any]:
    return {
        "effect": finding.effect,
        "location": finding.location,
        "of": finding.cause.of,
        "share": _share(finding.share),
        "worth": {channel: dataclasses.asdict(worth) for channel, worth in finding.worth.items()},
        "parameters": {
            name: {"value": e.value, "ci95": e.ci95, "unit": e.unit} for name, e in finding.parameters.items()
        },
        "alternatives": [{"effect": h.effect, "location": h.location, "of": h.of} for h in finding.alternatives],
        "source": finding.source,
    }


def _spikes(spikes: Spikes) -> dict[str, Any]:
    return {
        "count": spikes.count, "samples": spikes.samples, "per_thousand": spikes.per_thousand, "size": spikes.size,
        "unit": spikes.unit, "in_noise": spikes.in_noise,
    }  # fmt: skip


def _shares(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The model-free shares before and after, in the recording's units, with the families of laws and what follows."""
    if diagnosis.shares is None:
        return None
    units = dict(zip(diagnosis.recording.channels, diagnosis.recording.units, strict=True))
    tables = {"before": diagnosis.shares.before, "after": diagnosis.shares.after}
    families = {
        when: [{"family": family.value, "share": share} for family, share in family_shares(diagnosis, table)]
        for when, table in tables.items()
    }
    return {
        "statements": shares_sentences(diagnosis),
        "reached": {
            c.channel: {"value": reached.share, "ci95": reached.ci95}
            for c in diagnosis.shares.before.channels
            for reached in [diagnosis.shares.reached(c.channel)]
        },
        **{when: {**as_json(table, units), "families": families[when]} for when, table in tables.items()},
    }


def _share(share: Share | None) -> dict[str, Any] | None:
    return None if share is None else dataclasses.asdict(share)
