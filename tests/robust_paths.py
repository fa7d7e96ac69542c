"""Robust scenarios of one axis and of the circle, and devices at the quantile of what is uncertain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from conftest import SCENARIOS

import ctrlgen
from ctrlgen import build_model, load_scenario, simulate
from ctrlgen.budget.limits import margins, slopes_of_limits
from ctrlgen.budget.linear import propagate
from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import load_uncertainties
from ctrlgen.devices.changed_numbers import changed

EXAMPLE = SCENARIOS / "circle_robust"
RISK = 1e-3
SD = 0.05  # of the stiffness of the one axis
STROKE = 50e-6  # m


def without(scenario, **other):
    """The same path without a probability, or with another place for it."""
    robust = scenario.file.robust.model_copy(update=other) if other else None
    return replace(scenario, file=scenario.file.model_copy(update={"robust": robust}))


def axis(**limits):
    """One axis k d = g u whose stroke has limits."""
    return ctrlgen.user_device(
        "axis",
        parameters={"g": "0.2 N/V", "k": "1 N/um"},
        drive={"a": "1000 V"},
        axes={"x": limits.get("x", "50 um")},
        force=lambda u, p: [p.g * u.a],
        restoring_force=lambda d, p: p.k * d.vector,
    )


def along(folder, micrometres, device, probability='"99.9 %"', home="", sd="5 %"):
    """A scenario of one axis, a row of equilibria."""
    points = ", ".join(f'{{ x = "{float(v)!r} um" }}' for v in micrometres)
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "axis"\n[robust]\nprobability = {probability}\n{home}[path]\nkind = "poses"\npoints = [{points}]\n'
    )
    (folder / "uncertainty.toml").write_text(
        f'title = "u"\n[numbers]\n"mechanism.k" = {{ sd = "{sd}", source = "chosen" }}\n'
    )
    return load_scenario(folder, device)


def worst_numbers(solution, distance):
    """The numbers of the device at `distance` standard uncertainties toward the end of the strokes: its design point, GUM 5."""
    stated = load_uncertainties(solution.scenario, solution.model)
    path = UncertainPath(solution, stated)
    linear = propagate(path)
    slopes = slopes_of_limits(path, linear)
    found = margins(path, linear, slopes)
    (own,) = (place for limit, place in path.places if limit.name == "stroke")
    k, i = np.unravel_index(
        int(np.argmin(found.margin[1, :, own] / found.sd[1, :, own])), found.margin[1, :, own].shape
    )
    g = linear.sensitivity["limits"][k, own.start + int(i)]
    away = distance * stated.covariance @ g / math.sqrt(g @ stated.covariance @ g)
    values = {name: number.si for name, number in solution.model.device.quantities()}
    numbers, gain, column = {}, np.ones(solution.drive.shape[1]), 0
    for line in stated.lines:
        for j, name in enumerate(line.paths):
            if line.kind == "number":
                numbers[name] = values[name] + away[column]
            elif line.kind == "gain":
                gain += away[column]
            elif line.kind == "channel_gain":
                gain[j] += away[column]
            column += 1
    return numbers, gain


def farthest(solution, distance):
    """The largest displacement [m] of that device under the drives of the solution, in the second of two periods of the simulator."""
    numbers, gain = worst_numbers(solution, distance)
    device = build_model(changed(solution.model.device, numbers))
    driven = np.vstack([solution.drive, solution.drive]) * gain
    trace = simulate(device, driven, solution.scenario.sample_time, solution.trace.x[0])
    return float(trace.signals["displacement"][len(solution.drive) :].max())
