"""What raw readings show without any model: a finding beside those of the search.

It is named where it does more than a share of the noise to a reading; below, it is part of the noise.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.diagnosis.estimation.fit import Fitter
from ctrlgen.diagnosis.hypotheses.direct_detection import detect_directly
from ctrlgen.diagnosis.hypotheses.hypotheses import DOMAIN, Hypothesis, nominal_physics
from ctrlgen.diagnosis.selection.candidate_model import SearchResult
from ctrlgen.diagnosis.selection.result import Estimate, Finding
from ctrlgen.diagnosis.settings import DIRECT_DETECTION
from ctrlgen.effects import Channel, Effect, Place
from ctrlgen.model.effect_terms import channels


def directly_detected_findings(fitter: Fitter, search: SearchResult) -> tuple[Finding, ...]:
    """Findings of every sensor's law that reads itself off the recorded values, where the device and the search have none."""
    recording, structure = fitter.recording, search.chosen.fit.structure
    if recording.kind != "series":
        return ()
    known = {(e.kind, e.at) for e in structure.device.effect} | {(c.effect, c.at) for c in structure.causes}
    found = []
    for channel in channels(nominal_physics(structure.device), Place.SENSOR):
        name = f"reading.{channel.name}"
        if name not in recording.channels:
            continue
        i = recording.channels.index(name)
        values = np.concatenate([r.observed[r.valid[:, i], i] for r in recording.records])
        for law in Effect.library.values():
            seen = detect_directly(law, values) if law.place is Place.SENSOR and law.applies_to(channel) else None
            if (
                seen is None
                or seen[1] < DIRECT_DETECTION.noticed * fitter.noise.floor[i]
                or {(law.kind, channel.name), (law.kind, "all")} & known
            ):
                continue
            found.append(unfitted_finding(law, channel, seen[0]))
    return tuple(found)


def unfitted_finding(law: type[Effect], channel: Channel, values: dict[str, float]) -> Finding:
    """A sensor's law with parameters [SI] that were not fitted."""
    parameters = {}
    for p in law.params:
        unit = channel.unit_of(p)
        value = float(from_si(values[p.name], unit))
        parameters[p.name] = Estimate(value, (value, value), unit)
    cause = Hypothesis(law.kind, f"{DOMAIN[Place.SENSOR]}:{channel.name}", channel.name)
    return Finding(law.kind, cause.location, parameters, (), 0.0, law.source, cause)
