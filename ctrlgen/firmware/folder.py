"""Model and solution -> a folder of C99: the only writer of C.

`online` controllers (any reachable target -> drives) and `player`s (the solved trajectory, compressed), each in
double and in float, with a CMake file and a test of reference vectors. Same input, same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ctrlgen.controller import Controller
from ctrlgen.firmware.compression import Compression, compress
from ctrlgen.firmware.cprint import Real
from ctrlgen.firmware.online import online_context
from ctrlgen.firmware.player import player_context
from ctrlgen.firmware.templates import write
from ctrlgen.firmware.vectors import vectors
from ctrlgen.model import Model
from ctrlgen.scenario import Scenario
from ctrlgen.solution import Solution


@dataclass(frozen=True)
class CFolder:
    """What was generated: `path`, and the names of the pieces in each arithmetic."""

    path: Path
    online: dict[Real, str]
    player: dict[Real, str]
    test: dict[Real, str]
    compression: dict[Real, Compression]
    operations: int
    worst_operations: int


def generate(scenario: Scenario, model: Model, out: Path, solution: Solution | None = None) -> CFolder:
    """Writes the C of `scenario` to `out`; with a `solution` also its player. Raises CtrlgenError."""
    controller = Controller(model, scenario.file.follow, scenario.sample_time)
    online = {real: f"{scenario.name}_online_{real.suffix}" for real in Real}
    player = (
        {real: f"{scenario.name}_player_{real.suffix}" for real in Real} if solution and scenario.sample_time else {}
    )
    compression = compress(solution) if solution and player else {}
    cost = (0, 0)
    for real in Real:
        context = online_context(scenario, controller, real, online[real])
        cost = (context["cost"]["step"], context["cost"]["worst"])
        write("online.h", context, out / f"{online[real]}.h")
        write("online.c", context, out / f"{online[real]}.c")
        command = scenario.command(model) if solution is None else solution.command
        write(
            "test.c",
            context | {"online": online[real]} | vectors(controller, command, real),
            out / f"test_{scenario.name}_{real.suffix}.c",
        )
        if solution and player:
            held = context | player_context(solution, compression[real], player[real])
            write("player.h", held, out / f"{player[real]}.h")
            write("player.c", held, out / f"{player[real]}.c")
    sources = " ".join(
        f"{scenario.name}_{piece}_${{real}}.c" for piece in ("online", "player") if piece == "online" or player
    )
    write("CMakeLists.txt", {"name": scenario.name, "sources": sources}, out / "CMakeLists.txt")
    test = {real: f"test_{scenario.name}_{real.suffix}" for real in Real}
    return CFolder(out, online, player, test, compression, *cost)


def write_harness(folder: CFolder, scenario: Scenario, model: Model, real: Real, path: Path) -> None:
    """The program that `ctrlgen.verification` builds around one pair of controllers."""
    context = {
        "real": real,
        "online": folder.online[real],
        "player": folder.player.get(real),
        "n": len(model.axes),
        "nx": model.x.numel(),
        "n_s": model.n_states,
        "m": len(model.signals[scenario.file.follow].channels),
        "rate": scenario.sample_time is not None,
    }
    write("harness.c", context, path)
