"""The command line's application and the arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.version import program

# the parts of `ctrlgen --help`, in their order
PANELS = SCENARIO_PANEL, ACCURACY_PANEL, DEVICE_PANEL, RECORDING_PANEL, RESULT_PANEL = (
    "Drives and C of a scenario",
    "How well and how fast",
    "Devices",
    "Recordings of the real stage",
    "Results",
)

app = typer.Typer(
    name="ctrlgen",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Describe a flexure nanopositioner once; solve its trajectories, generate its C and prove that the C is right, and "
    "find the physics that a recording shows and the description leaves out.\n\n"
    "Start with:  [bold]ctrlgen example circle20 --to scenarios[/bold]\n\n"
    "then:  [bold]ctrlgen run scenarios/circle20[/bold]",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        print(program())
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print version and commit.")
    ] = False,
) -> None:
    """What stands before a command."""


ScenarioPath = Annotated[
    Path, typer.Argument(help="A scenario folder (with scenario.toml) or a scenario file.", show_default=False)
]
DevicePath = Annotated[
    Path, typer.Argument(help="A device file (device.toml, or stage.py that makes one).", show_default=False)
]
OtherDevice = Annotated[
    Path | None,
    typer.Option(
        "--device",
        help="Another device file than the scenario names, such as device.next.toml or stage.py. Adds _on_DEVICE to a default folder.",
        show_default=False,
    ),
]
BootstrapCount = Annotated[
    int,
    typer.Option(
        min=0,
        metavar="B",
        help="Bootstrap replicates, for intervals that do not rely on the noise model; 200 is usual and takes as "
        "long as 200 fits.",
    ),
]
SchedulerAddress = Annotated[
    str | None,
    typer.Option(help="A dask.distributed scheduler, tcp://HOST:8786; by default this computer.", show_default=False),
]
JobCount = Annotated[
    int | None, typer.Option(min=0, help="Processes on this computer; 0: only this one.", show_default="one per core")
]


def as_picture(option: str, path: Path, beside: str = "") -> Path:
    """`path`, if it is one of a picture; `beside` is another ending that the option takes. Raises InputError."""
    if path.suffix not in (".svg", ".png"):
        raise InputError(option, [Fault(str(path), f"must end in .svg or .png{beside and f', or in {beside}'}")])
    return path
