"""The answer of a diagnosis: verdict, findings, held-out errors, and the evidence beside them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.core.units import to_si
from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import changed, written
from ctrlgen.diagnosis.evidence.bootstrap import Bootstrap
from ctrlgen.diagnosis.evidence.detectability import DetectabilityEntry
from ctrlgen.diagnosis.evidence.experiment_design import Experiment
from ctrlgen.diagnosis.evidence.residual_location import ResidualLocations
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import UnmodelledForce
from ctrlgen.diagnosis.selection.attribution import Attribution
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry, Estimate, Finding, Role, estimated_values
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.diagnosis.selection.untried import Untried
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.shares.empirical_terms import EmpiricalTerm
from ctrlgen.diagnosis.shares.gather import ResidualShares
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.profile_likelihood import Profile
from ctrlgen.estimation.residual_tests import ResidualTests
from ctrlgen.estimation.spikes import Spikes
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Tabular, Reported):
    """The answer: verdict, findings and supporting analyses, each in the recording's units; `search` and `fitter` hold how it came about.

    attribution: shares of the causes and of the rest. shares: of what the residual is a function, whatever the law, before and
    after; None where the records are too short. empirical_terms: smoothers of what no law reaches. spikes: isolated outliers, of
    the channels that have some. unmodelled_force: None where the findings explain all. next_experiment: None where no drive would
    decide anything. untried: causes that errors kept from being tried.
    """

    verdict: Verdict
    findings: tuple[Finding, ...]
    attribution: Attribution
    shares: ResidualShares | None
    empirical_terms: tuple[EmpiricalTerm, ...]
    held_out: dict[str, ChannelErrorEntry]
    residual_tests: ResidualTests
    residual_location: ResidualLocations
    unmodelled_force: UnmodelledForce | None
    detectability: DetectabilityEntry
    next_experiment: Experiment | None
    spikes: tuple[Spikes, ...]
    notes: tuple[str, ...]
    device: Device
    recording: Recording
    search: SearchResult
    fitter: Fitter
    untried: Untried
    profiles: tuple[Profile, ...] = ()
    bootstrap: Bootstrap | None = None

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "verdict": self.verdict.value,
            "found": "; ".join(f"{f.effect} at {f.location}" for f in self.findings) or "nothing",
            **{
                f"held-out error of {channel}": f"{e.rms_before:.4g} -> {e.rms_after:.4g} {e.unit}"
                for channel, e in self.held_out.items()
                if e.rms_before is not None and e.rms_after is not None
            },
        }

    @cached_property
    def values(self) -> dict[str, Estimate]:
        """Every fitted number by its path in `corrected`, uncertain ones of the device included, with 95 % intervals.

        A device written in Python has no file: this is what to put into its code.
        """
        return estimated_values(self.search.chosen.fit, self.profiles, self.search.final_screen.moves)

    def columns(self) -> tuple[Column, ...]:
        """A row a number of each cause: its value with the ends of its 95 % interval, in the `unit` of the row."""
        rows = [(f, name, e) for f in self.findings for name, e in f.parameters.items()]
        return (
            Column("cause", "", [f"{f.effect} at {f.location}" for f, _, _ in rows]),
            Column("parameter", "", [name for _, name, _ in rows]),
            Column("value", "", [e.value for _, _, e in rows]),
            Column("low", "", [e.ci95[0] for _, _, e in rows]),
            Column("high", "", [e.ci95[1] for _, _, e in rows]),
            Column("unit", "", [e.unit for _, _, e in rows]),
            Column("role", "", [str(f.role) for f, _, _ in rows]),
        )

    @property
    def unconfirmed(self) -> tuple[Hypothesis, ...]:
        """Causes that the held-out records do not confirm."""
        return tuple(f.cause for f in self.findings if f.role is Role.UNSEEN)

    @cached_property
    def corrected(self) -> Device:
        """The device with all findings, then what was detected directly, then empirical terms: as device.next.toml describes it."""
        fit = self.search.chosen.fit
        refitted = {
            u.path: float(v) for u, v in zip(fit.structure.free_parameters, fit.theta, strict=True) if u.cause is None
        }
        starts = tuple(fit.values(k) for k in range(len(fit.structure.causes)))
        device = changed(Structure(fit.structure.device, fit.structure.causes, starts).device_with_causes, refitted)
        beside = [f for f in self.findings if f.cause not in fit.structure.causes]
        read = [
            f.cause.law(
                f.cause.at, {n: written(float(to_si(e.value, e.unit)), e.unit) for n, e in f.parameters.items()}
            )
            for f in beside
        ]
        left = (term.effect for term in self.empirical_terms)
        return device.model_copy(update={"effect": (*device.effect, *read, *left)})
