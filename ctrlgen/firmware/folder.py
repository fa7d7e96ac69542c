"""Model and solution -> a package of C99, the only writer of C.

`online` controllers (any reachable target -> drives; in integers too where the scenario asks for it) and `player`s (the solved trajectory,
compressed), each in double and in float, with a test of reference `vectors` that runs on the target; around them the package of
`ctrlgen.firmware.package`. Same input, same bytes.

The C is at the root, where Arduino looks in a library without src/; the build files name it for PlatformIO, CMake and
Zephyr. Programs for a computer are in test/.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.shown import Shown
from ctrlgen.firmware.c.deviations import deviations_context
from ctrlgen.firmware.c.misra import CPPCHECK
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.online.checksum import checked_context
from ctrlgen.firmware.online.corrected import corrected_context, corrections_of
from ctrlgen.firmware.online.correction_vectors import correction_vectors
from ctrlgen.firmware.online.fixed_source import fixed_context
from ctrlgen.firmware.online.online import online_context
from ctrlgen.firmware.online.stated_pivot import StatedPivot
from ctrlgen.firmware.online.vectors import played_vectors, self_test_calls, vectors
from ctrlgen.firmware.package import PIECES, owners, write_package
from ctrlgen.firmware.player.compression import Compression, compress
from ctrlgen.firmware.player.player_context import player_context
from ctrlgen.firmware.player_only import check_online
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario, check_tightened
from ctrlgen.trajectory.solution import Solution


@dataclass(frozen=True, repr=False)
class CFolder(Shown):
    """The generated package: its `path`, and the names of its parts in each arithmetic."""

    path: Path
    name: str
    # In integers too where the scenario asks for it; so are its test and its vectors
    online: dict[Arithmetic, str]
    player: dict[Real, str]
    selftest: dict[Arithmetic, str]
    vectors: dict[Arithmetic, str]
    # The symbol that the header's `..._init` calls
    init: dict[Arithmetic, str]
    compression: dict[Real, Compression]
    # The symbol that the player's `..._sample` calls
    sample: dict[Real, str]
    operations: int
    worst_operations: int
    # In the controller's state, behind its own: constants of the start and what follows from them.
    given_numbers: int = 0
    # Integers in the controller's state
    state_words: int = 1
    # The online controller with a checksum over its state, where the scenario asks for it
    checked: dict[Real, str] = field(default_factory=dict)
    # The online controller with a learnt correction of its targets, where the scenario asks for it
    corrected: dict[Real, str] = field(default_factory=dict)

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "path": self.path,
            "controller": self.name,
            "arithmetic": ", ".join(real.value for real in self.online),
            "operations a sample": self.operations,
            "at worst": self.worst_operations,
        }

    @property
    def arithmetics(self) -> tuple[Arithmetic, ...]:
        """Those in which there is a controller."""
        return tuple(self.online)

    def sources(self, real: Arithmetic) -> list[Path]:
        """The C of the library in one arithmetic."""
        pieces: tuple[Mapping[Any, str], ...] = (
            *(self.online, self.checked, self.corrected),
            *(self.player, self.selftest, self.vectors),
        )
        return [self.path / f"{names[real]}.c" for names in pieces if real in names]

    def runner(self, real: Arithmetic) -> Path:
        """The program that prints what the test of reference vectors finds; for a computer."""
        return self.path / "test" / f"test_{self.name}_{real.suffix}.c"


def generate(
    scenario: Scenario,
    model: Model,
    out: Path | str,
    solution: Solution | None = None,
    figures: Mapping[str, str] | None = None,
) -> CFolder:
    """Writes the package of `scenario` to `out`; with a `solution` also its player. Raises CtrlgenError.

    `figures` (name -> SVG text, as `ctrlgen.trajectory.solution_plots.draw_solution` gives) are put beside the README.
    """
    out = Path(out)
    check_tightened(scenario, model)
    check_online(scenario, model)
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    played = solution if scenario.sample_time else None
    problem = scenario.bind(model)
    command = problem.samples if solution is None else solution.command
    targets = problem.targets
    names = {
        piece: {real: f"{owner}_{piece}_{real.suffix}" for real in Real} for piece, owner in owners(scenario).items()
    }
    checked = {real: f"{scenario.controller_name}_checked_{real.suffix}" for real in Real if scenario.file.checksum}
    corrections = corrections_of(scenario, controller.kernels)
    corrected = {real: f"{scenario.controller_name}_corrected_{real.suffix}" for real in Real if corrections}
    fixed = _fixed(scenario, controller, targets)
    compression = compress(played) if played else {}
    left_out = () if solution is None else solution.left_out
    contexts, written = {}, []
    for real in Real:
        of: dict[str, Any] = {piece: names[piece][real] for piece in PIECES} | ({} if played else {"player": None})
        online = online_context(scenario, controller, real, of["online"])
        samples = {} if played is None else player_context(played, compression[real], of["player"])
        reference = vectors(controller, targets, real) | played_vectors(
            compression.get(real), len(command), scenario.clock
        )
        contexts[real] = samples | online | of | reference | {"solved": solution is not None, "left_out": left_out}
        contexts[real] |= {"checked": checked.get(real), "corrected": corrected.get(real)}
        added = corrected_context(scenario, corrections, online, corrected[real], real) if corrections else None
        contexts[real] |= {
            "correction": correction_vectors(corrections, added, real) if corrections and added else None
        }
        contexts[real] |= self_test_calls(contexts[real]) | {"fixed": fixed}
        by_template = {"online": online, "selftest": contexts[real], "vectors": contexts[real]}
        if played:
            by_template["player"] = online | samples
        if checked:
            of["checked"] = checked[real]
            by_template["checked"] = checked_context(online, checked[real])
        if added:
            of["corrected"] = corrected[real]
            by_template["corrected"] = added
        for template, context in by_template.items():
            for kind in ("h", "c"):
                written.append(write(f"{template}.{kind}", context, out / f"{of[template]}.{kind}"))
        written.append(write("test.c", contexts[real], out / "test" / f"test_{scenario.name}_{real.suffix}.c"))
    if fixed is not None:
        written += _write_fixed(fixed, out, scenario.name)
    of_c = {path.name: path.read_text(encoding="utf-8") for path in written}
    written.append(write("DEVIATIONS.md", {"cppcheck": CPPCHECK, **deviations_context(of_c)}, out / "DEVIATIONS.md"))
    write_package(out, scenario, contexts, figures or {}, written)
    cost = contexts[Real.FLOAT]["cost"]
    init = {real: f"{names['online'][real]}_init_{contexts[real]['build']}" for real in Real}
    integers = {} if fixed is None else {Integers.Q31: fixed}
    return CFolder(
        out,
        scenario.name,
        names["online"] | {real: c["prefix"] for real, c in integers.items()},
        names["player"] if played else {},
        names["selftest"] | {real: c["selftest"] for real, c in integers.items()},
        names["vectors"] | {real: c["vectors"] for real, c in integers.items()},
        init | {real: f"{c['prefix']}_init_{c['build']}" for real, c in integers.items()},
        compression,
        {real: f"{names['player'][real]}_sample_{contexts[real]['played_build']:08x}" for real in compression},
        operations=cost["step"],
        worst_operations=cost["worst"],
        given_numbers=contexts[Real.FLOAT]["given_numbers"],
        state_words=len(contexts[Real.FLOAT]["words"]),
        checked=checked,
        corrected=corrected,
    )


def _fixed(scenario: Scenario, controller: Controller, targets: np.ndarray) -> dict[str, Any] | None:
    """The context of the controller in integers; None where the scenario does not ask for it."""
    if not scenario.file.fixed_point:
        return None
    names = {piece: f"{owner}_{piece}_{Integers.Q31.suffix}" for piece, owner in owners(scenario).items()}
    return fixed_context(scenario, controller, targets, names)


def _write_fixed(context: dict[str, Any], out: Path, name: str) -> list[Path]:
    """The controller in integers and the test of it."""
    pieces = {"fixed": "prefix", "fixed_selftest": "selftest", "fixed_vectors": "vectors"}
    written = [
        write(f"{template}.{kind}", context, out / f"{context[piece]}.{kind}")
        for template, piece in pieces.items()
        for kind in ("h", "c")
    ]
    return [*written, write("fixed_test.c", context, out / "test" / f"test_{name}_{Integers.Q31.suffix}.c")]


def write_harness(folder: CFolder, scenario: Scenario, model: Model, real: Arithmetic, path: Path) -> None:
    """The program that `ctrlgen.verification` builds around one pair of controllers."""
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    corrections = corrections_of(scenario, controller.kernels)
    context = {
        "real": real,
        "online": folder.online[real],
        "prefix": folder.online[real],
        "player": None if isinstance(real, Integers) else folder.player.get(real),
        "corrected": None if isinstance(real, Integers) else folder.corrected.get(real),
        "numbers": corrections.count if corrections else 0,
        "measured": corrections.channels if corrections else 0,
        "n": len(model.axes),
        "nu": model.u.numel(),
        "nx": model.x.numel(),
        "n_s": model.n_states,
        "m": len(controller.kernels.target.channels),
        "rated": controller.rate is not None,
        "rate": scenario.sample_time is not None,
        "estimated": controller.kernels.contraction is not None,
        "ringing": controller.kernels.ringing is not None,
        "times": controller.kernels.times,
        "pivoted": StatedPivot(controller.kernels).acts,
    }
    write("fixed_harness.c" if isinstance(real, Integers) else "harness.c", context, path)
