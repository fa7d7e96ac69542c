"""Recordings: diagnose, calibrate, batch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ctrlgen.app.commands.app import (
    RECORDING_PANEL,
    BootstrapCount,
    DevicePath,
    JobCount,
    SchedulerAddress,
    app,
    as_picture,
)
from ctrlgen.app.commands.result_folder import note_source, out_of, out_option
from ctrlgen.app.console import complain, counted, err, out, progress
from ctrlgen.app.diagnosis_console import print_batch, print_bootstrap, print_diagnosis, print_explanation
from ctrlgen.core.errors import Fault, InputError


@app.command(rich_help_panel=RECORDING_PANEL)
def look(
    files: Annotated[
        list[Path], typer.Argument(help="Measurement files; the last of several is held out.", show_default=False)
    ],
    device: Annotated[
        Path | None,
        typer.Option(
            "--device", help="The device they were made on: which column is which signal.", show_default=False
        ),
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option("--to", help="The recording.toml to write; without it it is printed.", show_default=False),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw the columns into this file, .svg or .png.", show_default=False)
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(metavar="SIGNAL=COLUMN", help="Which column a signal is; repeat for more.", show_default=False),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a signal or column; repeat for more.", show_default=False),
    ] = None,
    time: Annotated[str | None, typer.Option(help="The column that is the time.", show_default=False)] = None,
    rate: Annotated[str | None, typer.Option(help="Rows a second, such as 1kHz.", show_default=False)] = None,
    poses: Annotated[bool, typer.Option("--poses", help="The rows are settled poses.")] = False,
    table: Annotated[
        str | None, typer.Option(help="Which table or sheet, from 1 or by name.", show_default=False)
    ] = None,
    layout: Annotated[
        str | None,
        typer.Option(help="How the file is written, as in recording.toml: 'decimal = \",\"'.", show_default=False),
    ] = None,
) -> None:
    """Say what measurement files hold, what is odd, and with --device which column is which signal, as a recording.toml to begin with.

    Columns are matched by unit, name and range. What the files do not say is asked: a line "to be answered" with the option that
    answers it, and a comment in the recording.toml.

    Example:  ctrlgen look scenarios/nist_hexapod/measured.csv
    """
    from ctrlgen.app.look_console import look as looked
    from ctrlgen.recordings.look.answers import read_answers

    if to is not None and device is None:
        raise typer.BadParameter("--to writes a recording of a device; add --device stage.toml")
    answers = read_answers(table, layout, column or [], unit or [], time, rate, poses)
    looked(files, device, to, None if figure is None else as_picture("--figure", figure), answers)


@app.command(rich_help_panel=RECORDING_PANEL)
def diagnose(
    device: DevicePath,
    recording: Annotated[
        list[Path],
        typer.Argument(
            help="A recording.toml, or the folder that holds one, or measurement files; several are joined.",
            show_default=False,
        ),
    ],
    out_folder: Annotated[Path | None, out_option("out/NAME_diagnose, NAME of the recording")] = None,
    seed: Annotated[int, typer.Option(help="Seed of all random numbers; the same seed gives the same answer.")] = 0,
    laws: Annotated[
        str | None,
        typer.Option(
            help="Effects to consider, separated by commas; by default all. The device's own parameters always are.",
            metavar="NAME,...",
            show_default=False,
        ),
    ] = None,
    explain: Annotated[
        str | None,
        typer.Option(
            help="An effect of which to say where it was tried, what it reached and why it was not taken.",
            metavar="NAME",
            show_default=False,
        ),
    ] = None,
    bootstrap: BootstrapCount = 0,
    scheduler: SchedulerAddress = None,
    jobs: JobCount = None,
) -> None:
    """Find the physics that a device file leaves out: what it is, where it
    acts, its numbers with intervals, validated on held-out records.

    A recording.toml names files (CSV, MATLAB, HDF5, TDMS, MDF4, JSON), their
    columns, units and roles (fit, hold_out, rest);
    scenarios/nist_hexapod/recording.toml is one, and ctrlgen check FILE
    --device DEVICE says what is wrong with yours.

    A measurement file whose columns are named and have units needs no
    recording.toml: one is written beside it (as ctrlgen look does).

    Leaves in --out: report.html (open this first), diagnosis.json,
    device.next.toml (the device file with the findings added), and
    next_experiment/ where another recording would decide between causes.

    The verdict is one of: consistent, explained, partly (confirmed causes take
    away most of the mismatch), ambiguous (another cause explains the data as
    well as a main one), unexplained. The exit status is 0 for every verdict,
    and 2 for input that cannot be used. The same command continues an
    interrupted diagnosis from the fits already made.

    --explain backlash answers for one effect: where it was tried, from what
    starts, what it reached and why it was not taken.

    Example:  ctrlgen diagnose scenarios/rrr_matrices/device.toml scenarios/rrr_matrices
    """
    from ctrlgen.app.look_console import described
    from ctrlgen.diagnosis.diagnosis_folder import Replicates, diagnose_into, unfinished
    from ctrlgen.estimation.hypothesis import selected_laws

    if scheduler is not None and not bootstrap:
        raise typer.BadParameter(
            "--scheduler only distributes the replicates of --bootstrap; add --bootstrap 200, or leave it out"
        )
    first = recording[0]
    folder = out_of(out_folder, first, "diagnose")
    try:
        replicates = Replicates(bootstrap, scheduler, jobs) if bootstrap else None
        chosen = None if laws is None else [name.strip() for name in laws.split(",") if name.strip()]
        if explain is not None:
            selected_laws([explain])
        recording = described(recording, device)
        with progress() as advance:
            result = diagnose_into(device, recording, folder, seed, advance, replicates, chosen, jobs)
    except KeyboardInterrupt:
        kept = unfinished(folder)
        if kept.exists():
            err.print(
                f"the fits made so far are in {escape(str(kept))}; the same command continues from them", soft_wrap=True
            )
        raise
    except InputError as error:
        complain(error)
        raise typer.Exit(2) from None
    print_diagnosis(result)
    if explain is not None:
        print_explanation(result, explain)
    if result.bootstrap is not None:
        print_bootstrap(result.bootstrap)
    note_source(folder, first)
    out.print(f"[bold]report[/bold]  {escape(str(folder / 'report.html'))}", soft_wrap=True)


@app.command(rich_help_panel=RECORDING_PANEL)
def calibrate(
    device: DevicePath,
    recording: Annotated[
        list[Path],
        typer.Argument(help="A recording.toml, or the folder that holds one; several are joined.", show_default=False),
    ],
    out_folder: Annotated[
        Path | None,
        out_option(
            about="Folder for constants.h, constants.bin, constants.json and calibration.html; without it only tables are printed."
        ),
    ] = None,
    scenario: Annotated[
        Path | None,
        typer.Option(
            help="A scenario whose error budget is drawn up before and after; its device is DEVICE.", show_default=False
        ),
    ] = None,
    jacobian: Annotated[
        str | None,
        typer.Option(
            help="Fit the Jacobian to settled poses instead: `all` its numbers, or the `few` by which the described one can differ.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Fit the constants of one specimen to a short recording of it, for the C that is given them when it starts.

    The numbers that the device file names in [run_time] are fitted, within their bounds, and no others:

    \b
      [run_time]
      constants = [
          "actuator.time_constant",
          { number = "actuator.thermal_resistance", low = "450 K/W", high = "650 K/W" },
      ]

    A constant that the recording does not determine keeps its default. Leaves in --out: constants.h (a C initialiser), constants.bin (with
    a check sum, for a memory written apart from the program), constants.json, calibration.html, and
    device.calibrated.toml, the device file with these numbers. Where the readings disagree whatever
    the constants, ctrlgen diagnose says what the device file leaves out.

    With --jacobian the poses of a recording give the Jacobian, with its error analysis: jacobian.csv, jacobian.json,
    calibration.html, and device.calibrated.toml, a stage by this matrix. `few` are gain and sense of each drive, turn of the
    frame and place of the point that is read, turns per length.

    Example:  ctrlgen calibrate scenarios/devices/mems_hexapod_run_time.toml scenarios/hexapod_specimen -o out/specimen
    """
    from ctrlgen.app.calibration_console import print_calibration
    from ctrlgen.calibration.budgets_compared import budgets
    from ctrlgen.calibration.calibrate import calibrate as calibrated
    from ctrlgen.calibration.device_file import NAME, write_calibrated_device
    from ctrlgen.core.files import check_folder, whole_folder

    if out_folder is not None:
        check_folder(out_folder)
    if jacobian is not None:
        _calibrate_jacobian(device, recording, jacobian, scenario, out_folder)
        return
    with progress() as advance:
        result = calibrated(device, recording, advance)
        both = None if scenario is None else budgets(result, scenario, device, advance)
        if out_folder is not None:
            from ctrlgen.calibration.calibration_page import write_calibration

            advance("report")
            with whole_folder(out_folder) as draft:
                write_calibration(draft, result, both)
                write_calibrated_device(result, device, draft / NAME)
    print_calibration(result, both)
    if out_folder is not None:
        out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'calibration.html'))}", soft_wrap=True)


def _calibrate_jacobian(
    device: Path, recordings: list[Path], numbers: str, scenario: Path | None, out_folder: Path | None
) -> None:
    from ctrlgen.app.calibration_console import print_jacobian
    from ctrlgen.calibration.jacobian_page import write_jacobian
    from ctrlgen.calibration.measured_jacobian import JacobianNumbers, calibrate_poses
    from ctrlgen.core.files import whole_folder

    known = [kind.value for kind in JacobianNumbers]
    if numbers not in known or scenario is not None:
        what = f"{numbers!r} must be one of {', '.join(known)}" if numbers not in known else "goes without --scenario"
        raise InputError("calibrate", [Fault("--jacobian", what)])
    with progress() as advance:
        advance("poses")
        found = calibrate_poses(device, recordings, JacobianNumbers(numbers))
        if out_folder is not None:
            with whole_folder(out_folder) as draft:
                write_jacobian(draft, found)
    print_jacobian(found)
    if out_folder is not None:
        out.print(f"[bold]report[/bold]  {escape(str(out_folder / 'calibration.html'))}", soft_wrap=True)


@app.command(rich_help_panel=RECORDING_PANEL)
def batch(
    list_: Annotated[
        Path, typer.Argument(metavar="JOBS.toml", help="The list of diagnoses, see above.", show_default=False)
    ],
    out_folder: Annotated[
        Path | None,
        out_option(
            "out/NAME_batch, NAME of the list or of its folder",
            "Folder for one result folder per diagnosis, results.csv and batch.html.",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of all random numbers, instead of the list's.", show_default=False)
    ] = None,
    bootstrap: BootstrapCount = 0,
    scheduler: SchedulerAddress = None,
    jobs: JobCount = None,
) -> None:
    """Diagnose many recordings, on all cores or on a cluster; results made
    before from the same files are kept.

    JOBS.toml, paths as seen from it:

    \b
      [[job]]
      device = "devices/stage.toml"
      recordings = ["runs/*", ["a", "b"]]   # a diagnosis each; a and b joined

    It can be stopped at any time: every finished diagnosis stays, and the same
    command continues with the rest. The exit status is 1 when a diagnosis
    failed, and 2 for a list that cannot be used or a scheduler that is gone.

    Beside results.csv: results.parquet, and numbers.parquet with every number
    of every diagnosis, where pyarrow is installed.

    On a cluster add the address of its dask.distributed scheduler, --scheduler
    tcp://HOST:8786.

    Example:  ctrlgen batch scenarios/lever_runs/jobs.toml
    """
    from ctrlgen.app.batch import load_batch, run_batch

    folder = out_of(out_folder, list_, "batch")
    try:
        with counted("diagnosing") as told:
            rows = run_batch(load_batch(list_, seed, bootstrap), folder, scheduler, jobs, told)
    except InputError as error:
        complain(error)
        raise typer.Exit(2) from None
    print_batch(rows)
    note_source(folder, list_)
    out.print(f"[bold]table[/bold]  {escape(str(folder / 'results.csv'))}", soft_wrap=True)
    out.print(f"[bold]page[/bold]   {escape(str(folder / 'batch.html'))}", soft_wrap=True)
    if any(row.state == "failed" for row in rows):
        raise typer.Exit(1)
