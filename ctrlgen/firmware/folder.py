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

from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.shown import Shown
from ctrlgen.firmware.c.deviations import deviations_context
from ctrlgen.firmware.c.misra import CPPCHECK
from ctrlgen.firmware.c.real import Arithmetic, Integers, Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c_sources import SourcesOfOne, sources_of
from ctrlgen.firmware.online.corrected import corrections_of
from ctrlgen.firmware.online.stated_pivot import StatedPivot
from ctrlgen.firmware.package import write_package
from ctrlgen.firmware.player.compression import Compression
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
    sources = sources_of(scenario, model, solution)
    of = {real: sources.of(real) for real in Real}
    fixed = sources.fixed
    written = [path for real in Real for path in _write(of[real], out, f"test_{scenario.name}_{real.suffix}.c")]
    written += _write_fixed(fixed, out, scenario.name) if fixed else []
    of_c = {path.name: path.read_text(encoding="utf-8") for path in written}
    written.append(write("DEVIATIONS.md", {"cppcheck": CPPCHECK, **deviations_context(of_c)}, out / "DEVIATIONS.md"))
    write_package(out, scenario, {real: each.whole for real, each in of.items()}, figures or {}, written)

    def names(template: str, prefix: str | None = None) -> dict[Any, str]:
        """The stems of one piece by arithmetic; with `prefix`, what holds that of the integers in their context."""
        stems = {real: each.files[template][0] for real, each in of.items() if template in each.files}
        return stems | ({Integers.Q31: fixed[prefix]} if fixed and prefix else {})

    init = {real: f"{stem}_init_{of[real].whole['build']}" for real, stem in names("online").items()}
    init |= {Integers.Q31: f"{fixed['prefix']}_init_{fixed['build']}"} if fixed else {}
    single = of[Real.FLOAT].whole
    return CFolder(
        out,
        scenario.name,
        names("online", "prefix"),
        names("player"),
        names("selftest", "selftest"),
        names("vectors", "vectors"),
        init,
        sources.compression,
        {real: f"{stem}_sample_{of[real].whole['played_build']:08x}" for real, stem in names("player").items()},
        operations=single["cost"]["step"],
        worst_operations=single["cost"]["worst"],
        given_numbers=single["given_numbers"],
        state_words=len(single["words"]),
        checked=names("checked"),
        corrected=names("corrected"),
    )


def _write(c: SourcesOfOne, out: Path, test: str) -> list[Path]:
    """The C of one arithmetic, and the `test` of it."""
    written = [
        write(f"{template}.{kind}", context, out / f"{stem}.{kind}")
        for template, (stem, context) in c.files.items()
        for kind in ("h", "c")
    ]
    return [*written, write("test.c", c.whole, out / "test" / test)]


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
