"""Devices and the papers' numbers: check, bode, workspace, reproduce."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ctrlgen.app import pipeline
from ctrlgen.app.commands.app import DEVICE_PANEL, DevicePath, OutFolder, app
from ctrlgen.app.console import err, out, print_recording, print_reproduced, print_shaper, print_workspace, progress
from ctrlgen.core.errors import Fault, InputError, Unreachable
from ctrlgen.core.files import read_toml
from ctrlgen.core.units import show
from ctrlgen.devices import load_device
from ctrlgen.devices.mechanism import Mechanism
from ctrlgen.devices.mechanism_dynamics import summary
from ctrlgen.devices.sensor import describe
from ctrlgen.firmware.package import MANIFEST, verify_package
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.schema import FILE as RECORDING
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.scenario import load_scenario, model_of
from ctrlgen.trajectory.solution import check_feasibility, check_motion, check_static


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
) -> None:
    """Read a device, scenario or recording and list every fault, or summarise what it describes.

    Of a scenario it says whether its path can be followed, and where not, why and what could be followed instead; of a
    generated folder which files were changed; of a mechanism its stiffness, natural frequencies and Jacobian.

    Example:  ctrlgen check scenarios/devices/mems_hexapod.toml
    """
    if device_path is not None:
        print_recording(load_recordings([file], build_model(load_device(device_path))))
        return
    if (file / RECORDING).is_file() or (file.name == RECORDING and file.is_file()):
        raise InputError(file, [Fault("--device", "is missing; name the device file that this recording was made on")])
    if (file / MANIFEST).is_file():
        if faults := verify_package(file):
            raise InputError(file, faults)
        out.print(f"{file}: every file is as it was generated", markup=False)
        return
    if file.is_dir() or (file.suffix != ".py" and "kind" not in read_toml(file)):
        scenario = load_scenario(file)
        model = model_of(scenario)
        command = scenario.command(model)
        out.print(f"{scenario.file.title}: {len(command)} samples, device {scenario.device.name}", markup=False)
        print_shaper(scenario, model)
        try:
            if scenario.file.robust is not None:
                from ctrlgen.budget.robust import solve  # scipy takes a moment to import
                from ctrlgen.reporting.report import robust_sentence

                out.print(str(robust_sentence(solve(scenario, model))), markup=False, soft_wrap=True)
                return
            if scenario.file.feedforward == "static":
                _, needed = check_static(scenario, model)
            elif model.inertial:
                *_, needed = check_motion(scenario, model)
            else:
                _, needed = check_feasibility(scenario, model, command)
        except Unreachable as error:
            if scenario.file.outcome == "solved":
                raise
            out.print(f"as expected: {error}", markup=False, soft_wrap=True)
            return
        unsettled = (
            "the memories of its effects do not settle within a period: solve it to know whether it can be followed"
        )
        if model.inertial:
            unsettled = "no drive was found in the first place: solve it to know why"
        out.print(
            "the path can be followed within every limit" if needed.exact else unsettled, markup=False, soft_wrap=True
        )
        return
    device = load_device(file)
    model = build_model(device)
    if figure is not None:
        from ctrlgen.reporting.mechanism_figure import draw_mechanism  # matplotlib takes a second to import

        if not isinstance(device, Mechanism):
            raise InputError("--figure", [Fault(device.name, 'is no mechanism; only kind = "mechanism" is drawn')])
        draw_mechanism(device, _picture("--figure", figure))
    numbers = list(device.quantities())
    unsourced = [path for path, q in numbers if q.source is None]
    out.print(
        f"{device.title}: {len(numbers)} numbers, {len(unsourced)} without a source of their own, {len(model.axes)} actuators",
        markup=False,
    )
    if model.redundant:
        weights = ", ".join(f"{w:g}" for w in model.drive_weights)
        out.print(
            f"  {model.u.numel()} drives for {len(model.axes)} axes: those of least effort, weights {weights}",
            markup=False,
        )
    for line in summary(device) if isinstance(device, Mechanism) else ():
        out.print(f"  {line}", markup=False, soft_wrap=True)
    for limit in (*model.limits, *model.rate_limits):
        low = "" if limit.lower is None else f"{show(limit.lower, limit.unit)} <= "
        out.print(f"  {low}{limit.label}" + ("" if limit.upper is None else f" <= {show(limit.upper, limit.unit)}"))
    units = dict(zip(model.signals["reading"].channels, model.signals["reading"].units, strict=True))
    for sensor in device.sensor:
        out.print(f"  sensor: {describe(sensor, units[sensor.at])}", markup=False, soft_wrap=True)
    for remark in device.remarks():
        out.print(f"  note: {remark}", markup=False, soft_wrap=True)


def _picture(option: str, path: Path) -> Path:
    """`path`, if it is one of a picture."""
    if path.suffix not in (".svg", ".png"):
        raise InputError(option, [Fault(str(path), "must end in .svg or .png")])
    return path


@app.command(rich_help_panel=DEVICE_PANEL)
def bode(
    device: DevicePath,
    picture: Annotated[Path, typer.Option("--out", help="The picture to write, .svg or .png.", show_default=False)],
    at: Annotated[str, typer.Option(help="Pose to linearise at: channel=value, separated by commas.")] = "delta_z=20um",
) -> None:
    """Draw the frequency response from every drive to the pose, linearised at a pose.

    Example:  ctrlgen bode scenarios/devices/mems_hexapod.toml --out bode.svg --at delta_x=5um,delta_z=20um
    """
    from ctrlgen.reporting.bode import draw_bode  # python-control takes most of a second to import

    model = build_model(load_device(device))
    signal_ = model.signals["pose"]
    pose = Frame(signal_.channels, signal_.units).pose(at, "--at")
    draw_bode(model, pose, _picture("--out", picture))
    out.print(str(picture), soft_wrap=True, markup=False)


@app.command(rich_help_panel=DEVICE_PANEL)
def workspace(
    device: DevicePath,
    out_folder: OutFolder,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="Pose of a slice, channel=value, separated by commas; repeat for more.",
            show_default="delta_z at 10, 20 and 30 um; without a third translation the middle of the drives",
        ),
    ] = None,
) -> None:
    """Map the poses a device can hold under all its limits: ranges, slices, the largest ball inside.

    Leaves workspace.svg and workspace.json in --out.

    Example:  ctrlgen workspace scenarios/devices/mems_hexapod.toml --out out/workspace --at delta_z=20um
    """
    print_workspace(pipeline.map_workspace(load_device(device), at or [], out_folder))
    out.print(str(out_folder / "workspace.svg"), soft_wrap=True, markup=False)


@app.command(rich_help_panel=DEVICE_PANEL)
def reproduce(
    source: Annotated[
        list[str] | None, typer.Argument(help="S0, S1, S2, S3; all by default.", show_default=False)
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the rows as a JSON list instead of a table.")] = False,
    page: Annotated[
        Path | None, typer.Option("--out", help="Also write a page (.html) with the figures.", show_default=False)
    ] = None,
    differing: Annotated[bool, typer.Option("--differing", help="Show only rows that are not reproduced.")] = False,
) -> None:
    """Compare every number that the papers print with the program's own: printed, ours, difference, status, reason.

    Example:  ctrlgen reproduce S3 --differing
    """
    from ctrlgen.reproduce import all as everything  # takes seconds to import; no other command needs it
    from ctrlgen.reproduce.row import ReproductionStatus
    from ctrlgen.reproduce.s3_hinges import NEEDS_FEM

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
    print_reproduced([row for row in rows if not (differing and row.status is ReproductionStatus.REPRODUCED)])
    counts = everything.counts(rows)
    for name in chosen:
        numbers = ", ".join(f"{counts[(name, status.value)]} {status.value}" for status in ReproductionStatus)
        out.print(f"{name}, {everything.TITLES[name]}: {numbers}", soft_wrap=True)
    if lacking := sum(row.reason == NEEDS_FEM for row in rows):
        err.print(f"{lacking} rows of S3: {NEEDS_FEM}", style="yellow", markup=False, soft_wrap=True)
