"""A time that was recorded wrongly, by what it makes of an axis: m x'' + c x' + k x is, in times that are s times too long,

    s^2 m x'' + s c x' + k x.

A mass off by s^2 and a damping off by s at once are therefore as likely a wrong rate as two wrong numbers, and no reading tells which.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.reporting.numbers import number


def time_base_step(diagnosis: Diagnosis) -> list[str]:
    """What to look at first where mass and damping of an axis are both found off as a wrong time makes them; nothing otherwise."""
    found = [c.path for c in diagnosis.search.chosen.causes if c.effect == PARAMETER]
    for mass in (path for path in found if path.endswith(".mass")):
        axis = mass.removesuffix("mass")
        times = _times_too_long(diagnosis, axis) if f"{axis}damping" in found else None
        if times is not None:
            how = f"{number(times, 3)} times too long" if times > 1 else f"{number(1 / times, 3)} times too short"
            return [
                f"Check the time first: {mass} and {axis}damping are off as times that are {how} would make them (a sample time, "
                "a rate or the unit of a column); the readings cannot tell which."
            ]
    return []


def _times_too_long(diagnosis: Diagnosis, axis: str) -> float | None:
    """s, where the numbers of an axis are off by that within `VERDICT.clock_deviations` of what the fit tells of them."""
    fit = diagnosis.search.chosen.fit
    places = {u.path: i for i, u in enumerate(fit.structure.free_parameters)}
    offs, rows = {}, {}
    for name in ("mass", "damping", "stiffness"):
        i = places.get(axis + name)
        row = np.zeros(len(fit.theta))
        if i is not None:
            nominal = fit.structure.free_parameters[i].nominal
            if not nominal * fit.theta[i] > 0:
                return None
            offs[name], row[i] = float(np.log(fit.theta[i] / nominal)), 1 / fit.theta[i]
        rows[name] = row
    # a stiffness that is not free is as stated
    k = offs.get("stiffness", 0.0)
    by_mass, by_damping = (offs["mass"] - k) / 2, offs["damping"] - k
    apart = (rows["mass"] - rows["stiffness"]) / 2 - (rows["damping"] - rows["stiffness"])
    sd = float(np.sqrt(apart @ fit.covariance @ apart))
    if abs(by_mass - by_damping) > VERDICT.clock_deviations * sd or abs(by_damping) < np.log(VERDICT.clock_off):
        return None
    return float(np.exp(by_damping))
