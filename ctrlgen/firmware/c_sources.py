"""What the templates of the C are filled with, by arithmetic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ctrlgen.controller.correction import Corrections
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Integers, Real
from ctrlgen.firmware.online.checksum import checked_context
from ctrlgen.firmware.online.corrected import corrected_context, corrections_of
from ctrlgen.firmware.online.correction_vectors import correction_vectors
from ctrlgen.firmware.online.fixed_source import fixed_context
from ctrlgen.firmware.online.online import online_context
from ctrlgen.firmware.online.vectors import played_vectors, self_test_calls, vectors
from ctrlgen.firmware.package import owners
from ctrlgen.firmware.player.compression import Compression, compress
from ctrlgen.firmware.player.player_context import player_context
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.solution import Solution

Context = dict[str, Any]


class SourcesOfOne(NamedTuple):
    """The C of one arithmetic."""

    files: dict[str, tuple[str, Context]]
    """Of each template, the stem of its files and what it is filled with."""
    whole: Context
    """What is known of all its files, for the tests and for what stands around them."""


@dataclass(frozen=True)
class Sources:
    """What the C of every arithmetic is printed from."""

    scenario: Scenario
    controller: Controller
    targets: np.ndarray
    solution: Solution | None
    compression: dict[Real, Compression]
    """Of the drives that a player plays; empty where nothing was solved or the scenario has no rate."""
    samples: int
    """Of the path, the last included."""
    corrections: Corrections | None
    """Learnt from runs, where the scenario asks for it."""
    fixed: Context | None
    """What the controller in integers is printed from, where the scenario asks for it."""

    def of(self, real: Real) -> SourcesOfOne:
        """The sources of the arithmetic `real`."""
        scenario, solution, played = self.scenario, self.solution, bool(self.compression)
        stems = {piece: f"{owner}_{piece}_{real.suffix}" for piece, owner in owners(scenario).items()}
        added = {
            "checked": f"{scenario.controller_name}_checked_{real.suffix}" if scenario.file.checksum else None,
            "corrected": f"{scenario.controller_name}_corrected_{real.suffix}" if self.corrections else None,
        }
        online = online_context(scenario, self.controller, real, stems["online"])
        player = player_context(solution, self.compression[real], stems["player"]) if solution and played else {}
        corrected = None
        if self.corrections and added["corrected"]:
            corrected = corrected_context(scenario, self.corrections, online, added["corrected"], real)
        whole = {
            **player,
            **online,
            **stems,
            **({} if played else {"player": None}),
            **vectors(self.controller, self.targets, real),
            **played_vectors(self.compression.get(real), self.samples, scenario.clock),
            "solved": solution is not None,
            "left_out": () if solution is None else solution.left_out,
            **added,
            "correction": correction_vectors(self.corrections, corrected, real)
            if self.corrections and corrected
            else None,
        }
        whole |= self_test_calls(whole) | {"fixed": self.fixed}
        by_template = {"online": online, "selftest": whole, "vectors": whole}
        if played:
            by_template["player"] = online | player
        if added["checked"]:
            by_template["checked"] = checked_context(online, added["checked"])
        if corrected:
            by_template["corrected"] = corrected
        named = stems | {piece: stem for piece, stem in added.items() if stem}
        return SourcesOfOne({template: (named[template], context) for template, context in by_template.items()}, whole)


def sources_of(scenario: Scenario, model: Model, solution: Solution | None) -> Sources:
    """The sources of a `scenario`'s C; with a `solution` also its player, where the scenario has a rate."""
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    problem = scenario.bind(model)
    return Sources(
        scenario=scenario,
        controller=controller,
        targets=problem.targets,
        solution=solution,
        compression=compress(solution) if solution is not None and scenario.sample_time else {},
        samples=len(problem.samples if solution is None else solution.command),
        corrections=corrections_of(scenario, controller.kernels),
        fixed=_fixed(scenario, controller, problem.targets),
    )


def _fixed(scenario: Scenario, controller: Controller, targets: np.ndarray) -> Context | None:
    """The context of the controller in integers; None where the scenario does not ask for it."""
    if not scenario.file.fixed_point:
        return None
    names = {piece: f"{owner}_{piece}_{Integers.Q31.suffix}" for piece, owner in owners(scenario).items()}
    return fixed_context(scenario, controller, targets, names)
