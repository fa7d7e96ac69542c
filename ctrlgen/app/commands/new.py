"""Files to begin with: new device, new scenario, new recording. The work is imported by the command that does it."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.app.commands.app import DEVICE_PANEL, app
from ctrlgen.app.console import out
from ctrlgen.core.errors import Fault, InputError

new = typer.Typer(
    no_args_is_help=True, help="Begin a device, a scenario or a recording: a commented file that passes check."
)
app.add_typer(new, name="new", rich_help_panel=DEVICE_PANEL)


@new.command()
def device(
    file: Annotated[Path, typer.Argument(help="The device file to write, such as stage.toml.", show_default=False)],
    kind: Annotated[
        str,
        typer.Option(
            help="What it is: piezo, voice-coil, xy, tip-tilt, hexapod, servo, tested-axis, mechanism, matrix.",
            show_default=False,
        ),
    ],
    name: Annotated[
        str | None,
        typer.Option(help="Name of the device and of its C functions.", show_default="as the file"),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="A number, such as mass=80g; repeat for more.", show_default=False
        ),
    ] = None,
    ask: Annotated[
        bool | None,
        typer.Option(
            "--ask/--no-ask", help="Ask for the numbers that --set does not give.", show_default="in a terminal"
        ),
    ] = None,
) -> None:
    """Begin a device file: its numbers are asked for in a terminal, or given by --set; those that nobody gave are marked as assumed.

    Kinds: piezo (one axis, a stack and two blades), voice-coil (one axis with mass), xy (two stacks), tip-tilt (a mirror on
    three stacks), hexapod (six struts on three planar stages), servo (one axis that goes where it is told), tested-axis (one
    that a machine moves while its force is read), mechanism (your own, from its drawing), matrix (a stage by its compliance at
    a point).

    Example:  ctrlgen new device stage.toml --kind piezo --set voltage=150V --set free_stroke=30um
    """
    from ctrlgen.app.editor_schemas import name_schema
    from ctrlgen.app.new_files.questions import KINDS, read
    from ctrlgen.app.new_files.write import write_device

    given = dict(_pair(text) for text in set_ or [])
    if sys.stdin.isatty() if ask is None else ask:
        for question in KINDS[kind].questions if kind in KINDS else ():
            while question.key not in given:
                answer = typer.prompt(question.text, default=question.answer)
                try:
                    read(question, answer)
                except ValueError as error:
                    out.print(f"  {error}", markup=False, soft_wrap=True)
                else:
                    given |= {question.key: answer} if answer != question.answer else {}
                    break
    write_device(file, kind, name, given)
    name_schema("device", file)
    out.print(str(file), soft_wrap=True, markup=False)
    out.print(f"next:  ctrlgen check {shlex.quote(str(file))}", soft_wrap=True, markup=False)
    then = "recording log.csv" if kind == "tested-axis" else "scenario circle"
    out.print(f"then:  ctrlgen new {then} --device {shlex.quote(str(file))}", soft_wrap=True, markup=False)


@new.command()
def scenario(
    folder: Annotated[Path, typer.Argument(help="The folder of the scenario, such as circle.", show_default=False)],
    device_path: Annotated[Path, typer.Option("--device", help="The device file.", show_default=False)],
    path: Annotated[
        str, typer.Option(help="The path: circle, line, raster, spiral.", show_default="circle, or line of one axis")
    ] = "",
) -> None:
    """Begin a scenario: a path in the middle of what the device can reach, half as large as would fit.

    Example:  ctrlgen new scenario circle --device scenarios/devices/xy_lever_stage.toml
    """
    from ctrlgen.app.editor_schemas import name_schema
    from ctrlgen.app.new_files.write import write_scenario

    write_scenario(folder, device_path, path or None)
    name_schema("scenario", folder / "scenario.toml")
    out.print(str(folder / "scenario.toml"), soft_wrap=True, markup=False)
    command = ["ctrlgen", "run", str(folder), "--out", f"out/{folder.name}"]
    out.print(f"next:  {shlex.join(command)}", soft_wrap=True, markup=False)


@new.command()
def recording(
    logs: Annotated[
        list[Path], typer.Argument(help="Measurement files; the last of several is held out.", show_default=False)
    ],
    device_path: Annotated[Path, typer.Option("--device", help="The device file.", show_default=False)],
    to: Annotated[
        Path | None, typer.Option("--to", help="The file to write.", show_default="recording.toml beside the first log")
    ] = None,
) -> None:
    """Begin a recording.toml for logs of a device: which column is which signal, as ctrlgen look finds them, with a comment where
    something is assumed.

    Example:  ctrlgen new recording scenarios/lever_runs/run_a.csv --device scenarios/devices/xy_lever_stage.toml --to run.toml
    """
    from ctrlgen.app.look_console import look

    look(logs, device_path, to or logs[0].with_name("recording.toml"), None)


def _pair(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not equals:
        raise InputError("--set", [Fault(text, "must be KEY=VALUE, such as mass=80g")])
    return key.strip(), value.strip()
