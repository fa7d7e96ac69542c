"""Learning from runs: learn."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen.app.commands.app import ACCURACY_PANEL, OtherDevice, ScenarioPath, app
from ctrlgen.app.commands.result_folder import out_option
from ctrlgen.app.console import out, progress
from ctrlgen.app.learning_console import print_learning


@app.command(rich_help_panel=ACCURACY_PANEL)
def learn(
    scenario: ScenarioPath,
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...",
            help="All recorded runs of the scenario so far, in their order: each a folder with recording.toml, or that file.",
            show_default=False,
        ),
    ],
    out_folder: Annotated[
        Path | None,
        out_option(
            about="Folder for learning.html, drives.csv, learning.json, figures and the player's C; without it only the table is printed."
        ),
    ] = None,
    device: OtherDevice = None,
) -> None:
    """Learn the next drives of a path from recorded runs of it: norm-optimal iterative learning, all limits kept.

    Drives computed for the device as described leave an error that repeats from run to run. Record a run with the drives of the scenario
    (several periods, or several runs, so that what repeats is told from noise), call this, record the next run with the drives it gives,
    and call it again with all runs so far. A recording holds the drives that were applied and the poses that were measured.

    The device's own sensitivities say how the drives must change; only what stands out of the noise is corrected, frequency by frequency.
    A run that came out worse than the best one is not gone on from, and the step is halved. It stops where what is left is noise, or
    where no more improvement is predicted. Where the poses change from run to run otherwise than predicted, as with a reversed or an
    exchanged actuator, it refuses and names the drive; that takes two runs.

    The error is that of the pose which the readings imply under the sensor laws of the device file. What the sensor may feign is left to
    it, and told: state how well scale, clock and zero are known as [sensor] in uncertainty.toml beside the scenario.

    With --device device.next.toml it goes on from what a diagnosis has explained, and learns only what is left.

    Example:  ctrlgen learn scenarios/lever_circle scenarios/lever_runs/run_a.toml scenarios/lever_runs/run_b.toml -o out/learn
    """
    from ctrlgen.core.files import check_folder, whole_folder
    from ctrlgen.learning.learn import learn as learn_next
    from ctrlgen.trajectory.scenario import load_scenario

    if out_folder is not None:
        check_folder(out_folder)
    with progress() as advance:
        learning = learn_next(load_scenario(scenario, device), recordings, progress=advance)
        if out_folder is not None:
            from ctrlgen.firmware.player_only import generate_player
            from ctrlgen.learning.learning_page import write_learning

            advance("report and player")
            with whole_folder(out_folder) as draft:
                write_learning(draft, learning)
                if learning.solution.scenario.sample_time is not None:
                    generate_player(learning.next, draft / "c")
    print_learning(learning)
    if out_folder is not None:
        out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'learning.html'))}", soft_wrap=True)
