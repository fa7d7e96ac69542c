"""Command line: parse, call, print. Decides nothing."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen import job
from ctrlgen.devices import load_device
from ctrlgen.devices.sensor import describe
from ctrlgen.errors import CtrlgenError, Fault, InputError, Unreachable
from ctrlgen.files import read_toml
from ctrlgen.firmware.package import MANIFEST, verify_package
from ctrlgen.model import build_model
from ctrlgen.paths import Frame
from ctrlgen.recording import load_recordings
from ctrlgen.recording_file import FILE as RECORDING
from ctrlgen.scenario import load_scenario
from ctrlgen.terminal import (
    CHECK,
    complain,
    counted,
    err,
    out,
    print_batch,
    print_bootstrap,
    print_comparison,
    print_diagnosis,
    print_recording,
    print_reproduced,
    print_solution,
    print_workspace,
    progress,
    show_warning,
)
from ctrlgen.units import show

app = typer.Typer(
    name="ctrlgen", no_args_is_help=True, add_completion=False, rich_markup_mode="rich", pretty_exceptions_enable=False,
    help="Describe a flexure nanopositioner once; solve its trajectories, generate its C, and prove that the C is right.\n\n"
    "Start with:  [bold]ctrlgen run scenarios/circle20 --out out/circle20[/bold]",
)  # fmt: skip

ScenarioPath = Annotated[
    Path, typer.Argument(help="A scenario folder (with scenario.toml) or a scenario file.", show_default=False)
]
DevicePath = Annotated[Path, typer.Argument(help="A device file (device.toml).", show_default=False)]
OutFolder = Annotated[
    Path,
    typer.Option(
        "--out", help="Result folder; replaced whole when the work is done, never half written.", show_default=False
    ),
]

BootstrapCount = Annotated[
    int,
    typer.Option(
        min=0, metavar="B", help="Replicates for intervals that do not trust the noise's model; 200 is usual."
    ),
]
SchedulerAddress = Annotated[
    str | None,
    typer.Option(help="A dask.distributed scheduler, tcp://HOST:8786; by default this computer.", show_default=False),
]
JobCount = Annotated[
    int | None, typer.Option(min=0, help="Processes of this computer; 0: none but this one.", show_default="one a core")
]


@app.command()
def run(scenario: ScenarioPath, out_folder: OutFolder) -> None:
    """Solve a scenario, generate its C, compare the C with the model, and report.

    Leaves in --out: report.html (open this first), summary.json, trajectory.csv, figures/, and c/ with its
    CMake file and test. The exit status is 1 when anything is out of tolerance or unreachable.

    Example:  ctrlgen run scenarios/circle20 --out out/circle20
    """
    with progress(job.STAGES) as advance:
        outcome = job.run(scenario, out_folder, advance)
    print_solution(outcome)
    print_comparison(outcome)
    out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'report.html'))}", soft_wrap=True)
    _exit(outcome)


@app.command()
def solve(scenario: ScenarioPath, out_folder: OutFolder) -> None:
    """Solve a scenario for its drives (IPOPT) and report the margin to every limit; no C.

    Example:  ctrlgen solve scenarios/raster --out out/raster
    """
    with progress(2) as advance:
        outcome = job.solve_into(scenario, out_folder, advance)
    print_solution(outcome)
    out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'report.html'))}", soft_wrap=True)
    _exit(outcome)


@app.command()
def generate(scenario: ScenarioPath, out_folder: OutFolder) -> None:
    """Write the C of a scenario: online controller and player, double and float; needs no compiler.

    Leaves in --out a folder that drops into a firmware project as it is; its README.md says how.

    Example:  ctrlgen generate scenarios/circle20 --out out/c && cmake -S out/c -B out/build
    """
    with progress(2) as advance:
        c = job.generate_into(scenario, out_folder, advance)
    for name in [*c.online.values(), *c.player.values()]:
        out.print(f"{out_folder / name}.c", soft_wrap=True, markup=False)
    out.print(f"online controller: {c.operations} arithmetic operations a call, {c.worst_operations} at most")


@app.command()
def compare(scenario: ScenarioPath) -> None:
    """Generate the C, build it with every compiler present, and compare it with the model; keeps nothing.

    Example:  ctrlgen compare scenarios/circle20
    """
    with progress(job.STAGES - 1) as advance:
        outcome = job.compare_only(scenario, advance)
    print_comparison(outcome)
    _exit(outcome)


@app.command()
def fmu(
    scenario: ScenarioPath,
    out_folder: OutFolder,
    fmi: Annotated[int, typer.Option(help="Version of the FMI standard, 3 or 2.")] = 3,
) -> None:
    """Write controller and plant as FMI co-simulation units, for Simulink, Dymola, OpenModelica, FMPy and others.

    The controller takes targets and gives drives; the plant takes drives and gives every signal of the model. Both
    wrap the C that runs elsewhere, step by whole samples, and hold their sources; binaries are for this computer and
    need a C compiler. In a loop step the controller first, hand its drives on, then step the plant: a target is what
    stands at the end of the step. With start_settled = true both start in the equilibrium at their first inputs.

    Example:  ctrlgen fmu scenarios/circle20 --out out/fmu
    """
    from ctrlgen.firmware.fmu import write_fmus

    made = write_fmus(load_scenario(scenario), out_folder, fmi)
    for path in made.paths:
        out.print(str(path), soft_wrap=True, markup=False)
    out.print(f"FMI {fmi}.0, {'binaries for ' + made.binary if made.binary else 'no binaries'}", markup=False)
    if made.remark:
        out.print(made.remark, markup=False, soft_wrap=True)


@app.command()
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
) -> None:
    """Read a device, scenario or recording and list every fault, or say what it describes. Nothing is computed.

    Of a generated folder it says which files were changed.

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
    if file.is_dir() or "kind" not in read_toml(file):
        scenario = load_scenario(file)
        count = len(scenario.command(build_model(scenario.device)))
        out.print(f"{scenario.file.title}: {count} samples, device {scenario.device.name}", markup=False)
        return
    device = load_device(file)
    model = build_model(device)
    numbers = list(device.quantities())
    unsourced = [path for path, q in numbers if q.source is None]
    out.print(
        f"{device.title}: {len(numbers)} numbers, {len(unsourced)} without a source of their own, {len(model.axes)} actuators",
        markup=False,
    )
    for limit in model.limits:
        low = "" if limit.lower is None else f"{show(limit.lower, limit.unit)} <= "
        out.print(f"  {low}{limit.label}" + ("" if limit.upper is None else f" <= {show(limit.upper, limit.unit)}"))
    units = dict(zip(model.signals["reading"].channels, model.signals["reading"].units, strict=True))
    for sensor in device.sensor:
        out.print(f"  sensor: {describe(sensor, units[sensor.at])}", markup=False, soft_wrap=True)
    for remark in device.remarks():
        out.print(f"  note: {remark}", markup=False, soft_wrap=True)


@app.command()
def bode(
    device: DevicePath,
    picture: Annotated[Path, typer.Option("--out", help="The picture to write, .svg or .png.", show_default=False)],
    at: Annotated[str, typer.Option(help="Pose to linearise at: channel=value, separated by commas.")] = "delta_z=20um",
) -> None:
    """Draw the frequency response from every drive to the pose, linearised at a pose.

    Example:  ctrlgen bode scenarios/devices/mems_hexapod.toml --out bode.svg --at delta_x=5um,delta_z=20um
    """
    from ctrlgen.bode import draw_bode  # python-control takes most of a second to import

    model = build_model(load_device(device))
    signal_ = model.signals["pose"]
    pose = Frame(signal_.channels, signal_.units).pose(at, "--at")
    if picture.suffix not in (".svg", ".png"):
        raise InputError("--out", [Fault(str(picture), "must end in .svg or .png")])
    draw_bode(model, pose, picture)
    out.print(str(picture), soft_wrap=True, markup=False)


@app.command()
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
    print_workspace(job.map_workspace(load_device(device), at or [], out_folder))
    out.print(str(out_folder / "workspace.svg"), soft_wrap=True, markup=False)


@app.command()
def reproduce(
    source: Annotated[
        list[str] | None, typer.Argument(help="S0, S1, S2, S3; all by default.", show_default=False)
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="Print the rows as a JSON list instead of a table.")] = False,
    page: Annotated[
        Path | None, typer.Option("--out", help="Also write a page with the figures (.html).", show_default=False)
    ] = None,
    differing: Annotated[bool, typer.Option("--differing", help="Show only rows that are not reproduced.")] = False,
) -> None:
    """Compare every number the papers print with the program's own: printed, ours, difference, status and why.

    Example:  ctrlgen reproduce S3 --differing
    """
    from ctrlgen.reproduce import all as everything  # scientific work of seconds; other commands need none of it
    from ctrlgen.reproduce.row import Status

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
    print_reproduced([row for row in rows if not (differing and row.status is Status.REPRODUCED)])
    counts = everything.counts(rows)
    for name in chosen:
        numbers = ", ".join(f"{counts[(name, status.value)]} {status.value}" for status in Status)
        out.print(f"{name}, {everything.TITLES[name]}: {numbers}", soft_wrap=True)


@app.command()
def diagnose(
    device: DevicePath,
    recording: Annotated[
        list[Path],
        typer.Argument(help="A recording.toml, or the folder that holds one; several are joined.", show_default=False),
    ],
    out_folder: OutFolder,
    seed: Annotated[int, typer.Option(help="Of everything drawn at random; the same seed gives the same answer.")] = 0,
    bootstrap: BootstrapCount = 0,
    scheduler: SchedulerAddress = None,
    jobs: JobCount = None,
) -> None:
    """Find what a device file leaves out: where, which physics by name, with numbers, proved on held-out records.

    Leaves in --out: report.html (open this first), diagnosis.json, device.next.toml, the device file with what was
    found, and next_experiment/ where another recording would settle a doubt. The exit status is 0 whatever the
    verdict, and 2 for input that cannot be used.

    Example:  ctrlgen diagnose scenarios/devices/meso_hexapod.toml scenarios/nist_hexapod --out out/nist
    """
    from ctrlgen.diagnosis.job import Replicates, diagnose_into

    try:
        replicates = Replicates(bootstrap, scheduler, jobs) if bootstrap else None
        with progress() as advance:
            found = diagnose_into(device, recording, out_folder, seed, advance, replicates)
    except InputError as error:
        complain(error)
        raise typer.Exit(2) from None
    print_diagnosis(found)
    if replicates is not None:
        print_bootstrap(found.extra["bootstrap"])
    out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'report.html'))}", soft_wrap=True)


@app.command()
def batch(
    list_: Annotated[
        Path, typer.Argument(metavar="JOBS.toml", help="What to diagnose; see ctrlgen/batch.py.", show_default=False)
    ],
    out_folder: Annotated[
        Path, typer.Option("--out", help="Gets one result folder a diagnosis, and results.csv.", show_default=False)
    ],
    seed: Annotated[
        int | None, typer.Option(help="Of everything drawn at random, instead of the list's.", show_default=False)
    ] = None,
    bootstrap: BootstrapCount = 0,
    scheduler: SchedulerAddress = None,
    jobs: JobCount = None,
) -> None:
    """Diagnose many recordings, on all cores or on a cluster; results that are there already are kept.

    Stop it whenever you like: every finished diagnosis stays, and the same command goes on with the rest. The exit
    status is 1 when a diagnosis failed, and 2 for a list that cannot be used.

    Example:  ctrlgen batch jobs.toml --out out/jobs --scheduler tcp://cluster:8786
    """
    from ctrlgen.batch import load_batch, run_batch

    try:
        with counted("diagnosing") as told:
            rows = run_batch(load_batch(list_, seed, bootstrap), out_folder, scheduler, jobs, told)
    except InputError as error:
        complain(error)
        raise typer.Exit(2) from None
    print_batch(rows)
    out.print(f"[bold]table[/bold]  {escape(str(out_folder / 'results.csv'))}", soft_wrap=True)
    if any(row.state == "failed" for row in rows):
        raise typer.Exit(1)


def _exit(outcome: job.Outcome) -> None:
    if not outcome.passed:
        out.print("[red]out of tolerance[/red]")
        raise typer.Exit(1)


def execute(check: Callable[[], None] = lambda: None) -> int:
    """Parses and runs the command line; the exit status, with one clear message for everything that can go wrong.

    `check` is called before each stage of long work and raises KeyboardInterrupt when that should end.
    """
    try:
        CHECK.set(check)
        warnings.showwarning = show_warning
        status = app(standalone_mode=False)  # typer turns Ctrl-C into the status 130
        return status if isinstance(status, int) else 0
    except Unreachable as error:
        err.print("[bold red]unreachable[/bold red]: ", end="")
        err.print(str(error), markup=False, soft_wrap=True)
        return 1
    except CtrlgenError as error:
        complain(error)
        return 1
    except typer.Abort:
        return 130
    except OSError as error:
        err.print(f"error: {error.strerror}: {error.filename}", markup=False, soft_wrap=True)
        return 1
    except Exception as error:
        if not hasattr(error, "format_message"):
            raise
        context = getattr(error, "ctx", None)
        err.print(f"error: {error.format_message()}", markup=False, soft_wrap=True)
        err.print(f"try: {context.command_path if context else 'ctrlgen'} --help", markup=False)
        return 2
