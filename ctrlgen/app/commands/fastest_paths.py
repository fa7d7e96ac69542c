"""The fastest motion along a path: fastest."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen.app.commands.app import ACCURACY_PANEL, OtherDevice, ScenarioPath, app
from ctrlgen.app.commands.result_folder import out_option
from ctrlgen.app.console import out, progress
from ctrlgen.app.fastest_console import print_fastest


@app.command(rich_help_panel=ACCURACY_PANEL)
def fastest(
    scenario: ScenarioPath,
    out_folder: Annotated[
        Path | None,
        out_option(
            about="Folder for fastest.html, fastest.json, figures, the set-points as a scenario and the player in C; without it only "
            "the tables are printed."
        ),
    ] = None,
    sample_rate: Annotated[
        str | None,
        typer.Option(help='Rate of the set-points, such as "10 kHz".', show_default="that of the scenario"),
    ] = None,
    frequency: Annotated[
        str | None,
        typer.Option(help='Also the largest path that can be repeated so often, such as "50 Hz".', show_default=False),
    ] = None,
    device: OtherDevice = None,
) -> None:
    """Find the shortest time in which a path can be followed within all limits, and what bounds it.

    A heater only heats and cools passively, a voice coil has so much current: along a path now one limit binds, now another. The
    fastest law of time keeps one of them at its bound at every place (time-optimal path following: Bobrow 1985, Verscheure 2009). It
    is compared with even speed and with the scenario's own law of time, each as short as it can be; a table and a figure say which
    limit binds where. The set-points at the sample rate are confirmed by the exact inverse.

    In --out, scenario/ is an ordinary scenario of the set-points, for ctrlgen run, budget and verify, and player/ its C; with
    --frequency, at_frequency/ holds the same of the largest path.

    Example:  ctrlgen fastest scenarios/circle20 --frequency "50 Hz" -o out/fastest
    """
    from ctrlgen.core.files import check_folder, whole_folder
    from ctrlgen.path_timing.fastest import fastest as fastest_path
    from ctrlgen.trajectory.scenario import load_scenario

    if out_folder is not None:
        check_folder(out_folder)
    with progress() as advance:
        loaded = load_scenario(scenario, device)
        motion = fastest_path(loaded, sample_rate=sample_rate, frequency=frequency, progress=advance)
        if out_folder is not None:
            from ctrlgen.firmware.player_only import generate_player
            from ctrlgen.path_timing.fastest_page import write_fastest

            advance("player and report")
            with whole_folder(out_folder) as draft:
                write_fastest(draft, motion)
                generate_player(motion.solution, draft / "player")
                if motion.repetition is not None and motion.repetition.solution is not None:
                    generate_player(motion.repetition.solution, draft / "at_frequency" / "player")
    print_fastest(motion)
    if out_folder is not None:
        out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'fastest.html'))}", soft_wrap=True)
