"""A law that is found is tried in a finer form, with more numbers, where it leaves more than noise: hysteresis with free weights."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import H, record
from play_records import NOISE, SERVO, N, lagging, moved
from recovery import fitter_of

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.estimation.hypothesis import Hypothesis

OFFERED = [Hypothesis(kind, "stage:axis", "axis") for kind in ("displacement_hysteresis", "backlash", "creep")]
TWO_GROUPS = np.r_[np.linspace(1e-6, 3e-6, 80), np.linspace(2e-5, 3e-5, 20)]  # half widths of plays of equal weight [m]
EVEN = np.linspace(1e-7, 2e-5, 200)


def found(radii: np.ndarray):
    device = validate(Device.library["servo"], SERVO, "device")
    rng, parts = np.random.default_rng(1), []
    for seed, role in ((2, "fit"), (4, "hold_out")):
        u = moved(seed)
        parts.append(record(u, lagging(u, radii) + NOISE * rng.standard_normal(N), role, h=H))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    return Searcher(fitter, Screen(fitter, OFFERED), lambda _: None).run(device).chosen


@pytest.mark.long
def test_two_groups_of_plays_are_one_hysteresis_and_nothing_beside_it():
    chosen = found(TWO_GROUPS)
    assert [c.effect for c in chosen.causes] == ["weighted_displacement_hysteresis"]
    values = chosen.fit.values(0)
    parts, left, narrow = [values[f"part{j}"] for j in range(1, 8)], 1.0, 0.0
    for j, part in enumerate([*parts, 1.0], 1):
        if values["reach"] * (j / 8) ** 2 < 8e-6:
            narrow += part * left
        left *= 1 - part
    assert values["share"] * narrow == pytest.approx(0.12, rel=0.1)  # a hundred widths by eight
    assert np.sqrt(chosen.held_out.plain_mean[0]) < 2  # of the noise, for the same reason; 9 with the plain law


@pytest.mark.long
def test_plays_of_even_weights_keep_the_plain_law():
    assert [c.effect for c in found(EVEN).causes] == ["displacement_hysteresis"]
