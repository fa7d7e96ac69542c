"""What `ctrlgen check` says of a device, a scenario, a recording or generated C."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ctrlgen.app.console import out
from ctrlgen.app.diagnosis_console import print_recording
from ctrlgen.app.scenario_console import print_shaper
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError, Unreachable
from ctrlgen.core.file_format import refuse_another_kind
from ctrlgen.core.files import read_toml
from ctrlgen.core.units import parse
from ctrlgen.devices import Device, load_device
from ctrlgen.devices.matrix import MatrixDevice
from ctrlgen.devices.mechanism.mechanism import Mechanism
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.devices.mechanism.point_compliance import point_compliance
from ctrlgen.devices.sensor import describe
from ctrlgen.effects import laws
from ctrlgen.estimation.law_needs import not_offered, offered_as_faults, refusals, usual
from ctrlgen.firmware.package import MANIFEST, verify_package
from ctrlgen.model.assembly import build_model
from ctrlgen.model.effect_terms import available
from ctrlgen.recordings.schema import FILE as RECORDING
from ctrlgen.trajectory.infeasibility import check_feasible
from ctrlgen.trajectory.scenario import load_scenario, model_of


def check(file: Path, device: Path | None = None, figure: Path | None = None, point: str | None = None) -> None:
    """Prints a summary of `file`; a recording needs the `device` that it was made on. `figure` also draws a mechanism; `point`, such as
    "0 mm, 5 mm, 0 mm", is where its compliance and stiffness are printed in full.

    Raises InputError with every fault of the file, and Unreachable for a scenario whose path cannot be followed.
    """
    if device is not None:
        _check_recording(file, device)
    elif (file / RECORDING).is_file() or (file.name == RECORDING and file.is_file()):
        raise InputError(file, [Fault("--device", "is missing; name the device file that this recording was made on")])
    elif (file / MANIFEST).is_file():
        if faults := verify_package(file):
            raise InputError(file, faults)
        out.print(f"{file}: every file is as it was generated", markup=False)
    elif file.is_dir() or (file.suffix != ".py" and "kind" not in read_toml(file)):
        if not file.is_dir():
            refuse_another_kind(read_toml(file), file, "scenario", "name a device file or a scenario")
        if not file.is_dir() and not {"device", "path", "record"} & read_toml(file).keys():
            what = 'is missing; a device file begins with kind = "axis" or another (ctrlgen new device begins one)'
            raise InputError(file, [Fault("kind", f"{what}, a scenario has device and path")])
        _check_scenario(file)
    else:
        _check_device(file, figure, point)


def _check_recording(file: Path, device: Path) -> None:
    from ctrlgen.recordings.plausibility import with_plausibility
    from ctrlgen.recordings.reader import load_recordings  # the libraries of file formats take a moment to import

    model = build_model(load_device(device))
    print_recording(with_plausibility(load_recordings([file], model), model))


def _check_scenario(file: Path) -> None:
    """Whether the path can be followed; not where the scenario expects that it cannot, when the reason is printed."""
    scenario = load_scenario(file)
    model = model_of(scenario)
    problem = scenario.bind(model)
    out.print(
        f"{scenario.file.title}: {number_of(len(problem.samples), 'sample')}, device {scenario.device.name}",
        markup=False,
    )
    print_shaper(problem)
    try:
        if scenario.file.robust is not None:
            from ctrlgen.budget.robust import solve
            from ctrlgen.verification.summary import robust_sentence

            out.print(robust_sentence(solve(scenario, model)), markup=False, soft_wrap=True)
            return
        needed = check_feasible(problem)
    except Unreachable as error:
        if scenario.file.outcome == "solved":
            raise
        out.print(f"as expected: {error}", markup=False, soft_wrap=True)
        return
    unsettled = "the memories of its effects do not settle within a period: solve it to know whether it can be followed"
    if model.inertial:
        unsettled = "no drive was found in the first place: solve it to know why"
    verdict = "the path can be followed within every limit" if needed.exact else unsettled
    out.print(verdict, markup=False, soft_wrap=True)


def _point_of(device: Device, text: str) -> np.ndarray:
    """The place (3,) [m] that was asked for."""
    parts = text.split(",")
    if not isinstance(device, Mechanism):
        raise InputError("--point", [Fault(device.name, 'is no mechanism; only kind = "mechanism" has points')])
    try:
        place = np.array([parse(part.strip(), "m") for part in parts])
    except ValueError as error:
        raise InputError("--point", [Fault(text, str(error))]) from None
    if place.shape != (3,):
        raise InputError("--point", [Fault(text, 'is no point; give x, y and z, such as "0 mm, 5 mm, 0 mm"')])
    return place


def _check_device(file: Path, figure: Path | None, point: str | None) -> None:
    device = load_device(file)
    asked = None if point is None else _point_of(device, point)
    model = build_model(device)
    for title in dict.fromkeys(each.recording for each in device.recording_effect):
        build_model(device.in_recording(title))  # says what its effects have wrong
    if figure is not None:
        from ctrlgen.devices.mechanism.figure import draw_mechanism  # matplotlib takes a moment to import

        if not isinstance(device, Mechanism):
            raise InputError("--figure", [Fault(device.name, 'is no mechanism; only kind = "mechanism" is drawn')])
        draw_mechanism(device, figure)
    numbers = list(device.quantities())
    unsourced = [path for path, q in numbers if q.source is None]
    out.print(
        f"{device.title}: {number_of(len(numbers), 'number')}, {len(unsourced)} without a source of their own, "
        f"{number_of(len(model.axes), 'actuator')}",
        markup=False,
    )
    if model.redundant:
        weights = ", ".join(f"{w:g}" for w in model.drive_weights)
        out.print(
            f"  {model.u.numel()} drives for {number_of(len(model.axes), 'axis', 'axes')}: those of least effort, weights {weights}",
            markup=False,
        )
    for line in (
        summary(device) if isinstance(device, Mechanism) else device.lines() if isinstance(device, MatrixDevice) else []
    ):
        out.print(f"  {line}", markup=False, soft_wrap=True)
    if asked is not None and isinstance(device, Mechanism):
        for line in point_compliance(device, asked).lines():
            out.print(f"  {line}", markup=False, soft_wrap=True)
    for limit in (*model.limits, *model.rate_limits):
        out.print(f"  {limit.text}")
    units = dict(zip(model.signals["reading"].channels, model.signals["reading"].units, strict=True))
    for sensor in device.sensor:
        out.print(f"  sensor: {describe(sensor, units[sensor.at])}", markup=False, soft_wrap=True)
    for each in device.recording_effect:
        out.print(f"  in no path and no C: {each.text}", markup=False, soft_wrap=True)
    physics = device.physics(device.values())
    parts, there = device.parts(physics), available(physics)
    out.print(f"  machine: {parts.text}", markup=False, soft_wrap=True)
    able = [name for name, law in sorted(laws().items()) if law.requires <= there]
    for said, refused in (
        ("not offered", not_offered(able, parts)),
        ("offered as a fault", offered_as_faults(able, parts)),
    ):
        for line in refusals(refused):
            out.print(f"  {said} in a diagnosis: {line}", markup=False, soft_wrap=True)
    for row in usual(parts):
        out.print(f"  usual: {row.text}", markup=False, soft_wrap=True)
    for remark in device.remarks():
        out.print(f"  note: {remark}", markup=False, soft_wrap=True)
