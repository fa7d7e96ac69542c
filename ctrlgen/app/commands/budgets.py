"""The error budget of a path: budget."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen.app.budget_console import print_budget
from ctrlgen.app.commands.app import ACCURACY_PANEL, OtherDevice, ScenarioPath, app
from ctrlgen.app.commands.result_folder import out_option
from ctrlgen.app.console import out, progress
from ctrlgen.core.errors import Fault, InputError

DRAWS = 10_000  # as in ctrlgen.budget.error_budget, which is imported when it is needed


@app.command(rich_help_panel=ACCURACY_PANEL)
def budget(
    scenario: ScenarioPath,
    out_folder: Annotated[
        Path | None,
        out_option(about="Folder for budget.html, budget.json and figures; without it only the tables are printed."),
    ] = None,
    uncertainty: Annotated[
        Path | None,
        typer.Option(help="The file of standard deviations.", show_default="uncertainty.toml beside the scenario"),
    ] = None,
    probability: Annotated[str, typer.Option(help='At which limits are judged, as "99.9 %" or 0.999.')] = "99.9 %",
    draws: Annotated[int, typer.Option(min=0, metavar="N", help="Monte Carlo draws; 0 leaves it out.")] = DRAWS,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws.")] = 0,
    finer: Annotated[
        Path | None,
        typer.Option(
            metavar="DEVICE",
            help="A finer description of the same device: how differently it moves under the same drives.",
            show_default=False,
        ),
    ] = None,
    device: OtherDevice = None,
) -> None:
    """Draw up what everything uncertain does to the pose along a path, in nm and urad, and to the limits.

    There is no position sensor: drives computed for the device as described act on one whose numbers differ. The error budget gives, for
    every uncertain number, the surroundings, supply, converter, jitter and arithmetic, its sensitivity (per K, per %, per LSB), its
    standard uncertainty along the path (peak and rms), and all combined (GUM) with the 95 % band; what to measure or tighten next;
    and by how much each limit is kept at a chosen probability. Monte Carlo on the nonlinear model (GUM supplement 1) must agree
    within 10 %, or it is said why not.

    What is uncertain stands in uncertainty.toml beside the scenario, each sd with its source:

    \b
      [numbers]
      "actuator.thermal_resistance" = { sd = "5 %", source = "five specimens" }
      [surroundings]
      sd = "0.5 K"
      source = "laboratory log"
      [drive]
      gain = { sd = "0.1 %", source = "data sheet of the reference" }
      converter = { bits = 16, source = "data sheet" }

    A number that has an sd in the device file, as a diagnosis writes it into device.next.toml, counts too.

    --finer names another description of the device, with the same drives and channels. Its difference along the path is known with its
    sign; it stands beside the band and is not combined with it.

    Example:  ctrlgen budget scenarios/circle20 -o out/budget
    """
    from ctrlgen.budget.error_budget import error_budget
    from ctrlgen.core.files import check_folder, whole_folder
    from ctrlgen.trajectory.scenario import load_scenario

    chance = _probability(probability)
    if out_folder is not None:
        check_folder(out_folder)
    with progress() as advance:
        drawn_up = error_budget(
            load_scenario(scenario, device),
            uncertainty,
            probability=chance,
            draws=draws,
            seed=seed,
            finer=finer,
            progress=advance,
        )
        if out_folder is not None:
            from ctrlgen.budget.budget_page import write_budget

            advance("report")
            with whole_folder(out_folder) as draft:
                write_budget(draft, drawn_up)
    print_budget(drawn_up)
    if out_folder is not None:
        out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'budget.html'))}", soft_wrap=True)


def _probability(text: str) -> float:
    """0.999 for '99.9 %' and for '0.999'. Raises InputError."""
    from ctrlgen.core.units import read_probability

    try:
        return read_probability(text)
    except ValueError as error:
        raise InputError("--probability", [Fault("value", str(error))]) from None
