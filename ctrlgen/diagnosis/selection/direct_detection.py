"""Effects that raw readings show without any model, such as quantisation: findings beside those of the search.

An effect is named where it changes the readings by more than a share of the noise; below that it counts as noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.selection.findings import Estimate, Finding
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.settings import DIRECT_DETECTION
from ctrlgen.effects import Channel, Effect, Place, means
from ctrlgen.estimation.hypothesis import DOMAIN, Hypothesis, nominal_physics, selected_laws
from ctrlgen.estimation.raw_readings import detect_directly
from ctrlgen.model.effect_terms import channels


def directly_detected_findings(search: SearchResult, laws: Sequence[type[Effect]] | None = None) -> tuple[Finding, ...]:
    """Findings of the sensor laws, of `laws` (None: all), that the readings of a channel show directly, where neither the
    device file nor the search has that law there; none for settled poses."""
    fitter = search.fitter
    recording, structure = fitter.recording, search.chosen.fit.structure
    if recording.kind != "series":
        return ()
    known = {(e.kind, e.at) for e in structure.device.effect} | {(c.effect, c.at) for c in structure.causes}
    findings = []
    for channel in channels(nominal_physics(structure.device), Place.SENSOR):
        name = f"reading.{channel.name}"
        if name not in recording.channels:
            continue
        i = recording.channels.index(name)
        values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
        for law in selected_laws() if laws is None else laws:
            seen = detect_directly(law, values) if law.place is Place.SENSOR and law.applies_to(channel) else None
            if (
                seen is None
                or seen[1] < DIRECT_DETECTION.noticed * fitter.noise.floor[i]
                or any(kind == law.kind and means(at, channel.name, channel.unit) for kind, at in known)
            ):
                continue
            findings.append(unfitted_finding(law, channel, seen[0]))
    return tuple(findings)


def unfitted_finding(law: type[Effect], channel: Channel, values: dict[str, float]) -> Finding:
    """The finding of a sensor law whose parameters [SI] were detected, not fitted: its intervals have no width."""
    parameters = {}
    for p in law.params:
        unit = channel.unit_of(p)
        value = float(from_si(values[p.name], unit))
        parameters[p.name] = Estimate(value, (value, value), unit)
    cause = Hypothesis(law.kind, f"{DOMAIN[Place.SENSOR]}:{channel.name}", channel.name)
    return Finding(law.kind, cause.location, parameters, (), None, {}, law.source, cause)
