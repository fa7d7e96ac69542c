"""Runs the supporting analyses of a diagnosis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from ctrlgen.diagnosis.evidence.detectability import DetectabilityEntry, detectability
from ctrlgen.diagnosis.evidence.experiment_design import Experiment, next_experiment
from ctrlgen.diagnosis.evidence.experiment_files import files
from ctrlgen.diagnosis.evidence.ltv_linearisation import LtvModel, linearise_along
from ctrlgen.diagnosis.evidence.residual_localisation import localise_residual
from ctrlgen.diagnosis.evidence.residual_location import ResidualLocationEntry, ResidualLocations
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import UnmodelledForce, describe_unmodelled_force
from ctrlgen.diagnosis.selection.failures import FAILURES, reason_of
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.estimation.fit import Fit

# from the folder of the next experiment
NEXT_DEVICE = "../device.next.toml"
Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class SupportingAnalyses:
    """Where the residual is before and after the correction, the unknown input that would explain what is left, what was
    detectable, and the next experiment; `failed`: what could not be made, and why."""

    residual_location: ResidualLocations
    unmodelled_force: UnmodelledForce | None
    detectability: DetectabilityEntry
    next_experiment: Experiment | None
    failed: tuple[str, ...] = ()


def run_supporting_analyses(search: SearchResult, explained: bool, seed: int = 0) -> SupportingAnalyses:
    """All supporting analyses. `explained`: the residual of the chosen model passes its tests. `seed` draws bootstrap and drives."""
    fitter, recording = search.fitter, search.fitter.recording
    nominal, chosen = search.nominal.fit, search.chosen.fit
    records = [*fitter.fit_records, *fitter.held_out_records]
    failed: list[str] = []

    def tried(name: str, analysis: Callable[[], Result]) -> Result | None:
        """Its result; None, with a note, where it cannot be made: no finding depends on it."""
        try:
            return analysis()
        except FAILURES as error:
            failed.append(f"{name} is left out: {reason_of(error)}")
            return None

    def located(fit: Fit) -> tuple[list[LtvModel], ResidualLocationEntry]:
        models = [linearise_along(fitter, fit, record) for record in records]
        return models, localise_residual(models, recording.channels, recording.units, seed)

    nowhere: tuple[list[LtvModel], ResidualLocationEntry] = ([], ResidualLocationEntry.unknown())
    before = tried("the place of the residual before the correction", lambda: located(nominal)) or nowhere
    after = before
    if chosen is not nominal:
        after = tried("the place of the residual after the correction", lambda: located(chosen)) or nowhere
    force = None
    if after[0] and not explained:
        force = tried("the unknown input", lambda: describe_unmodelled_force(fitter, after[0]))
    experiment = tried("the next experiment", lambda: next_experiment(search, explained, seed))
    if experiment is not None:
        experiment = replace(experiment, files=files(fitter, chosen, experiment, NEXT_DEVICE))
    return SupportingAnalyses(
        residual_location=ResidualLocations(before=before[1], after=after[1]),
        unmodelled_force=force,
        detectability=detectability(chosen, search.final_screen, chosen.n),
        next_experiment=experiment,
        failed=tuple(failed),
    )
