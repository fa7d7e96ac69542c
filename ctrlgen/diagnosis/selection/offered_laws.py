"""The laws that a diagnosis tries: those that the recording can test and the machine may have, and what is told of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.devices.machine import MachineParts
from ctrlgen.diagnosis.selection.of_each_record import may_differ
from ctrlgen.diagnosis.selection.speeds import counted_in_speeds
from ctrlgen.diagnosis.selection.way_covered import where_it_turns, with_longest_periods
from ctrlgen.effects import Effect
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.law_needs import not_offered, offered_as_faults, refusals, usual, with_odds
from ctrlgen.model.assembly import movable
from ctrlgen.recordings.recording import Recording

NOT_OFFERED = "not offered: {}"
OFFERED_AS_FAULTS = "offered as a fault, as rare as one in a hundred: {}"
OF_OTHER_PACKAGES = "laws of other packages were considered too: {}"
RESTRICTED = "only these effects were considered, beside the device's own parameters: {}"


@dataclass(frozen=True)
class OfferedLaws:
    """Hypotheses with the odds that the machine's parts give them, and the laws that are refused for what the machine is made of."""

    hypotheses: list[Hypothesis]
    parts: MachineParts
    refused: Mapping[str, str]
    """Why a law is not offered, by its name."""
    rare: Mapping[str, str]
    """Why a law is offered as a fault alone, by its name."""
    laws: Sequence[type[Effect]]
    """All that were considered."""
    chosen: bool
    """Whether the caller named the laws."""

    @property
    def notes(self) -> list[str]:
        """What is told of the machine and of the laws considered."""
        told = [NOT_OFFERED.format("; ".join(refusals(self.refused)))] if self.refused else []
        if self.rare:
            told.append(OFFERED_AS_FAULTS.format("; ".join(refusals(self.rare))))
        if brought := [f"{law.kind} ({law.package})" for law in self.laws if law.package]:
            told.append(OF_OTHER_PACKAGES.format(", ".join(brought)))
        told += [f"usual: {row.text}" for row in usual(self.parts)]
        if self.chosen:
            told.append(RESTRICTED.format(", ".join(law.kind for law in self.laws) or "none"))
        return told


def offered_laws(device: Device, fitter: Fitter, laws: Sequence[type[Effect]], *, chosen: bool) -> OfferedLaws:
    """What is offered of `laws` for the recording of `fitter`; laws that the caller has `chosen` are refused by no part."""
    suspected = _testable(device, fitter.recording, laws)
    parts = device.parts(nominal_physics(device))
    refused = {} if chosen else not_offered(_kinds(suspected), parts)
    suspected = [with_odds(h, parts) for h in suspected if h.effect not in refused]
    rare = offered_as_faults(_kinds(suspected), parts)
    return OfferedLaws(counted_in_speeds(suspected, fitter, device), parts, refused, rare, laws, chosen)


def _kinds(suspected: Sequence[Hypothesis]) -> list[str]:
    return list(dict.fromkeys(h.effect for h in suspected))


def _testable(device: Device, recording: Recording, effects: Sequence[type[Effect]]) -> list[Hypothesis]:
    """Hypotheses that the recording can test; of the device's parameters, those that change its readings."""
    acting = set(movable(device))
    shortest = min(r.sample_time for r in recording.records)
    sample_time = shortest if np.isfinite(shortest) else None
    ambient = any(r.ambient is not None for r in recording.records)
    offered = hypotheses(device, nominal_physics(device), recording.channels, sample_time, ambient, effects)
    offered = [h for h in offered if h.effect != PARAMETER or h.shifts or h.path in acting]
    offered = [h for h in offered if not h.prior.of_each_record or may_differ(h, recording)]
    return with_longest_periods(where_it_turns(offered, recording, device), recording, device)
