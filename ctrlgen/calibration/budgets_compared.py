"""What a calibration does to the error budget of a path: the constants as uncertain as is stated, or within their bounds, and then known
by the recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ctrlgen.budget.error_budget import ErrorBudget, budget_of
from ctrlgen.budget.robust import solve
from ctrlgen.budget.uncertainty import FILE, Uncertain, Uncertainties, load_uncertainties
from ctrlgen.calibration.calibrate import Calibration, sd_of_bounds
from ctrlgen.core.units import show_difference, to_si
from ctrlgen.devices import Device
from ctrlgen.devices.quantities import shared_path
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of

BOUNDS = "bounds of [run_time], uniform between them"


def budgets(
    calibration: Calibration, scenario: Path | str, device: Path | str, progress: Callable[[str], None] = lambda _: None
) -> tuple[ErrorBudget, ErrorBudget]:
    """The first-order error budgets of a path before and after. Before, a constant is as uncertain as uncertainty.toml beside the scenario
    or the device file states, else uniform between its bounds. What they state of other numbers counts in both. Raises InputError,
    Unreachable, SolverError."""
    read = load_scenario(scenario, device)
    model = model_of(read)
    states = (read.path.parent / FILE).is_file() or any(number.sd for _, number in model.device.quantities())
    stated = load_uncertainties(read, model) if states else None
    constants = calibration.device.given_at_start
    known = {shared_path(path) for line in (stated.lines if stated else ()) for path in line.paths}
    unknown = tuple(c for c in constants if c.path not in known)
    wide = np.diag([sd_of_bounds(c) ** 2 for c in unknown])
    before = _budget(read, calibration.device, _joined(stated, unknown, wide, [BOUNDS] * len(unknown)), progress)
    sources = ["calibration" if row.determined else BOUNDS for row in calibration.constants]
    # A path that is moved for the least error is moved once: both budgets are of the same one
    if (robust := read.file.robust) is not None:
        still = read.file.model_copy(update={"robust": robust.model_copy(update={"home": []})})
        read = replace(read, file=still, home=before.solution.scenario.home)
    after = _budget(read, calibration.calibrated, _joined(stated, constants, calibration.covariance, sources), progress)
    return before, after


def spoiled_by_sensor(calibration: Calibration, after: ErrorBudget) -> dict[str, float]:
    """The largest standard deviation [SI] of the true motion along the path of the budget `after`, by group, that a wrong scale of the
    sensor makes by way of the constants."""
    if calibration.of_sensor is None:
        return {g.name: 0.0 for g in after.groups}
    columns = [path for line in after.uncertainties.lines for path in line.paths]
    at = [columns.index(c.path) for c in calibration.device.given_at_start]
    Y = after.linear.sensitivity["pose"][:, :, at]
    sd = np.sqrt(np.maximum(np.sum((Y @ calibration.of_sensor) * Y, axis=2), 0.0))
    return {g.name: float(sd[:, g.channels].max()) for g in after.groups}


def _budget(scenario: Scenario, device: Device, stated: Uncertainties, progress: Callable[[str], None]) -> ErrorBudget:
    specimen = scenario.on(device)
    model = model_of(specimen)
    return budget_of(solve(specimen, model, progress), stated, draws=0, progress=progress)


def _joined(
    others: Uncertainties | None, constants: tuple[RunTimeConstant, ...], covariance: np.ndarray, sources: list[str]
) -> Uncertainties:
    """These constants with their covariance, and what is stated of other numbers."""
    if not constants and others is not None:
        return others
    paths, sds = {c.path for c in constants}, np.sqrt(np.diag(covariance))
    lines = [
        Uncertain(c.path, "number", (c.path,), (float(sd),), _shown(c, float(sd)), source, _step(c))
        for c, sd, source in zip(constants, sds, sources, strict=True)
    ]
    correlation = covariance / np.outer(sds, sds)
    if others is None:
        return Uncertainties(tuple(lines), correlation, None, 0.0, False, {}, {}, {})
    others, kept, columns, first = about_their_mean(others, paths), list[Uncertain](), list[int](), 0
    for line in others.lines:
        left = [i for i, path in enumerate(line.paths) if path not in paths]
        # of a list the numbers that are no constants stay
        if left:
            text, steps = line.per
            rest = tuple(line.paths[i] for i in left), tuple(line.sds[i] for i in left), tuple(steps[i] for i in left)
            kept.append(replace(line, paths=rest[0], sds=rest[1], per=(text, rest[2])))
            columns += [first + i for i in left]
        first += len(line.sds)
    k, n = len(constants), len(constants) + len(columns)
    joint = np.eye(n)
    joint[:k, :k], joint[k:, k:] = correlation, others.correlation[np.ix_(columns, columns)]
    return replace(others, lines=(*lines, *kept), correlation=joint)


def about_their_mean(stated: Uncertainties, constants: set[str]) -> Uncertainties:
    """What is `stated`, where the copies of a constant deviate from one another alone: with n of them their sd is s sqrt(1 - 1/n) and
    the coefficient of each two -1/(n - 1), for their mean is the constant itself."""
    correlation, lines, first = stated.correlation.copy(), list[Uncertain](), 0
    for line in stated.lines:
        sds, name = np.array(line.sds), line.name
        for path in constants:
            of_it = np.array([p != path and shared_path(p) == path for p in line.paths])
            if n := int(of_it.sum()):
                sds[of_it] *= np.sqrt(1 - 1 / n)
                columns = first + np.flatnonzero(of_it)
                correlation[np.ix_(columns, columns)] = np.where(np.eye(n), 1.0, -1 / (n - 1))
                name = f"{line.name}, copies about their mean"
        lines.append(replace(line, name=name, sds=tuple(map(float, sds))))
        first += len(sds)
    return replace(stated, lines=tuple(lines), correlation=correlation)


def _shown(c: RunTimeConstant, sd: float) -> str:
    return show_difference(sd, c.unit, 3)


def _step(c: RunTimeConstant) -> tuple[str, tuple[float, ...]]:
    if to_si(0.0, c.unit):
        return "1 K", (1.0,)
    return ("1 %", (0.01 * abs(c.default),)) if c.default else (f"1 {c.unit}", (to_si(1.0, c.unit),))
