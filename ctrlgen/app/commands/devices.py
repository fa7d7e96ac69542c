"""Devices and the papers' numbers: check, bode, workspace, reproduce. The work is imported by the command that does it."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.app.commands.app import DEVICE_PANEL, DevicePath, app, as_picture
from ctrlgen.app.commands.result_folder import name_of, note_source, out_of, out_option
from ctrlgen.app.console import err, out, progress
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.shipped_files import shipped_package


@app.command(rich_help_panel=DEVICE_PANEL)
def check(
    file: Annotated[
        Path,
        typer.Argument(
            help="A device file, a scenario, generated C, or with --device a recording; or its folder.",
            show_default=False,
        ),
    ],
    device_path: Annotated[
        Path | None, typer.Option("--device", help="The device that a recording was made on.", show_default=False)
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", help="Also draw a mechanism into this file, .svg or .png.", show_default=False),
    ] = None,
    point: Annotated[
        str | None,
        typer.Option(
            "--point",
            help='Of a mechanism: all of compliance and stiffness at this point of its output body, "0 mm, 5 mm, 0 mm".',
            show_default=False,
        ),
    ] = None,
) -> None:
    """Read a device, scenario or recording and list every fault, or summarise what it describes.

    Of a scenario it says whether its path can be followed, and where not, why and what could be followed instead; of a
    generated folder which files were changed; of a mechanism its stiffness, natural frequencies and Jacobian.

    Example:  ctrlgen check scenarios/devices/mems_hexapod.toml
    """
    from ctrlgen.app.check_files import check as checked

    checked(file, device_path, as_picture("--figure", figure) if figure is not None else None, point)


@app.command(rich_help_panel=DEVICE_PANEL)
def bode(
    device: DevicePath,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="The picture, .svg or .png, or the page, .html, to write.",
            show_default="NAME_bode.html",
        ),
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(
            help="Pose to linearise at: channel=value, separated by commas.",
            show_default="20 um of the third translation; without one the middle of the drives",
        ),
    ] = None,
    of: Annotated[
        str,
        typer.Option(help='What answers: "pose", or "reading" for all that sensors see, loads in flexures among it.'),
    ] = "pose",
) -> None:
    """Draw the frequency response from every drive to the pose, linearised at a pose; a page of it zooms and shows its values.

    Example:  ctrlgen bode scenarios/devices/mems_hexapod.toml --at delta_x=5um,delta_z=20um
    """
    from ctrlgen.controller.bode import draw_bode
    from ctrlgen.devices import load_device
    from ctrlgen.model.assembly import build_model
    from ctrlgen.trajectory.frame import Frame
    from ctrlgen.trajectory.workspace import middle_pose

    if of not in ("pose", "reading"):
        raise InputError("--of", [Fault("of", f"{of!r} is neither pose nor reading")])
    model = build_model(load_device(device))
    picture, signal_ = picture or Path(f"{name_of(device)}_bode.html"), model.signals["pose"]
    pose = middle_pose(model) if at is None else Frame(signal_.channels, signal_.units).pose(at, "--at")
    if picture.suffix == ".html":
        from ctrlgen.controller.bode_page import write_bode_page

        write_bode_page(model, pose, picture, of)
    else:
        draw_bode(model, pose, as_picture("--out", picture, ".html"), of)
    out.print(str(picture), soft_wrap=True, markup=False)


@app.command(rich_help_panel=DEVICE_PANEL)
def workspace(
    device: DevicePath,
    out_folder: Annotated[Path | None, out_option("out/NAME_workspace")] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="Pose of a slice, channel=value, separated by commas; repeat for more.",
            show_default="delta_z at 10, 20 and 30 um; without a third translation the middle of the drives",
        ),
    ] = None,
) -> None:
    """Map the poses a device can hold under all its limits: ranges, slices, the largest ball inside.

    Leaves workspace.html, workspace.svg and workspace.json in --out.

    Example:  ctrlgen workspace scenarios/devices/mems_hexapod.toml --at delta_z=20um
    """
    from ctrlgen.app.scenario_console import print_workspace
    from ctrlgen.app.scenario_pipeline import map_workspace
    from ctrlgen.devices import load_device

    folder = out_of(out_folder, device, "workspace")
    print_workspace(map_workspace(load_device(device), at or [], folder))
    note_source(folder, device)
    out.print(str(folder / "workspace.html"), soft_wrap=True, markup=False)


@app.command(rich_help_panel=DEVICE_PANEL)
def simulate(
    device: DevicePath,
    drives: Annotated[
        Path | None,
        typer.Argument(help="A file with a column of time and one of each drive, with units.", show_default=False),
    ] = None,
    step: Annotated[
        str | None,
        typer.Option(help="A step instead of a file: 1V, or of several drives 1X=0.1W,2X=0.2W.", show_default=False),
    ] = None,
    duration: Annotated[float, typer.Option(help="Of a step, in seconds; the first tenth is at rest.")] = 1.0,
    rate: Annotated[float, typer.Option(help="Of a step, in samples a second.", min=1e-3)] = 1000.0,
    out_folder: Annotated[
        Path | None, out_option(about="Folder for signals.csv and signals.svg; without it only the ranges are printed.")
    ] = None,
) -> None:
    """Drive a device as a file says, or by a step, from rest: the range of every signal, and what was measured beside it.

    Columns are found by name and unit, as ctrlgen look finds them. Readings in the file are compared with the simulated ones.

    Example:  ctrlgen simulate scenarios/devices/flexure_axis.toml --step 1V --duration 0.5
    """
    from ctrlgen.app.simulated import simulate_device, write_simulated

    result = simulate_device(device, drives, step, duration, rate)
    from ctrlgen.app.scenario_console import print_simulated

    print_simulated(result)
    if out_folder is not None:
        write_simulated(result, out_folder)
        out.print(str(out_folder / "signals.svg"), soft_wrap=True, markup=False)


@app.command(rich_help_panel=DEVICE_PANEL)
def laws(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Laws of which to print equation, range, parameters and source.", show_default=False),
    ] = None,
) -> None:
    """List the physical effects that a device file may name, those of installed packages included.

    Example:  ctrlgen laws creep
    """
    from ctrlgen.app.laws_console import print_laws

    print_laws(names or [])


@app.command(rich_help_panel=DEVICE_PANEL)
def reproduce(
    source: Annotated[
        list[str] | None, typer.Argument(help="S0, S1, S2, S3; all by default.", show_default=False)
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the rows as a JSON list instead of a table.")] = False,
    page: Annotated[
        Path | None, typer.Option("--out", "-o", help="Also write a page (.html) with the figures.", show_default=False)
    ] = None,
    differing: Annotated[
        bool, typer.Option("--differing", help="Show only rows that differ or cannot be computed.")
    ] = False,
) -> None:
    """Compare every number that the papers print with the program's own: printed, ours, difference, status, reason.

    Example:  ctrlgen reproduce S3 --differing
    """
    papers = shipped_package("papers").__name__
    everything = import_module(f"{papers}.all")
    row, hinges, console = (import_module(f"{papers}.{name}") for name in ("row", "s3_hinges", "console"))

    chosen = [name.upper() for name in source or everything.SOURCES]
    unknown = [name for name in chosen if name not in everything.SOURCES]
    if unknown:
        raise InputError(
            "reproduce", [Fault(name, f"is not a source; known: {', '.join(everything.SOURCES)}") for name in unknown]
        )
    if page is not None and page.suffix != ".html":
        raise InputError("--out", [Fault(str(page), "must end in .html")])
    with progress(len(chosen)) as advance:
        rows = []
        for name in chosen:
            advance(f"{name}, {everything.TITLES[name]}")
            rows += everything.reproduce([name])
    if page is not None:
        everything.write_page(rows, page)
    if json_:
        print(json.dumps(everything.as_json(rows), indent=1))
        return
    agreeing = (row.ReproductionStatus.REPRODUCED, row.ReproductionStatus.CORRECTED)
    console.print_reproduced([r for r in rows if not (differing and r.status in agreeing)])
    counts = everything.counts(rows)
    for name in chosen:
        numbers = ", ".join(f"{counts[(name, status.value)]} {status.value}" for status in row.ReproductionStatus)
        out.print(f"{name}, {everything.TITLES[name]}: {numbers}", soft_wrap=True)
    if lacking := sum(r.reason.startswith(hinges.NEEDS_FEM) for r in rows):
        err.print(f"{number_of(lacking, 'row')}: {hinges.NEEDS_FEM}", style="yellow", markup=False, soft_wrap=True)
