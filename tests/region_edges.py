"""Cheap series with one law in a region, by the battery's plant and forms, and whether the ends' intervals hold the true ends.

    PYTHONPATH=.:tests python tests/region_edges.py 1 4

prints a line a case of the seeds 1 to 4, one case of each law a seed; only laws in a region are looked for.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass

import numpy as np
from axis_records import SETTLING

from battery import axis_cases, laws_region, region_cases
from battery.accepted import is_right
from battery.region import Region, edges_covered
from ctrlgen.core.files import validate
from ctrlgen.devices.axis import Axis
from ctrlgen.diagnosis.selection.finding_region import region_of
from ctrlgen.diagnosis.selection.findings import finding_estimates
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.effects import laws
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, hypotheses, nominal_physics
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.priors import prior_of
from ctrlgen.recordings.recording import Record, Recording

SECONDS = 1.2  # of the record to fit, at 1 kHz
NAMES = tuple(
    name for name in laws_region.NAMES if name != "friction_one_way"
)  # its region ends at rest, which nobody fits
OFFERED = tuple(law for kind, law in sorted(laws().items()) if prior_of(law).in_a_region or kind == "end_stop")


@dataclass(frozen=True)
class Found:
    """Of a case: the law that was planted, those found, and of each end told of the right one whether its interval holds the true one."""

    planted: str
    found: tuple[str, ...]
    covered: tuple[bool, ...]
    told: str


def found(name: str, seed: int) -> Found:
    """One case: drawn until the law has its size, then searched for among laws in a region alone."""
    rng = np.random.default_rng([seed, NAMES.index(name), 28])
    while True:
        try:
            bench, planted, answer = region_cases.once_drawn(name, rng, SECONDS)
            break
        except ValueError:
            continue
    device = validate(Axis, tomllib.loads(axis_cases.device_text(bench.stated)), "device")
    parts = []
    for take, y in zip(bench.takes, axis_cases.readings(bench, planted), strict=True):
        n, h = len(y), bench.scene.sample_time
        time, ambient = take.start + h * np.arange(n), None if take.ambient is None else take.ambient
        rise = None if ambient is None or bench.fit.ambient is None else ambient - np.mean(bench.fit.ambient)
        u, y = take.drive.reshape(n, 1), y.reshape(n, 1)
        parts.append(Record(take.role, take.role, time, h, u, y, bench.linear, rise, np.ones((n, 1), bool)))
    recording = Recording(
        "t", device.name, "series", ("reading.axis",), ("um",), (bench.scene.noise,), tuple(parts), ()
    )
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    offered = hypotheses(device, nominal_physics(device), recording.channels, h, rise is not None, OFFERED)
    screen = Screen(fitter, [h for h in offered if h.effect != PARAMETER])
    result = Searcher(fitter, screen, lambda _: None).run(device)
    fit, true = result.chosen.fit, Region(**answer["region"])
    estimates = finding_estimates(result.fitter, fit)
    covered, told = [], f"{true.low:.4g} to {true.high:.4g}"
    for k, cause in enumerate(fit.structure.causes):
        if not is_right(cause.effect, cause.location, answer["planted"][0]):
            continue
        own = {u.name: estimates[u.path] for u in fit.structure.free_parameters if u.cause == k}
        if (told_of := region_of(cause.law, own)) is None:
            continue
        entry = told_of.model_dump()
        covered = edges_covered({"effect": cause.effect, "parameters": {}, "region": entry}, true)
        told += f"; {entry['lower'] and entry['lower']['ci95']}, {entry['upper'] and entry['upper']['ci95']} {entry['unit']}"
        break
    return Found(name, tuple(c.effect for c in fit.structure.causes), tuple(covered), told)


if __name__ == "__main__":
    first, last, *names = sys.argv[1:]
    for seed in range(int(first), int(last) + 1):
        for law in names or NAMES:
            print(seed, found(law, seed), flush=True)
