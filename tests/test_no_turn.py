"""A curve that a drive goes along once is no loop, nothing that changes with time, and no part of a period."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, move, record

from ctrlgen import load_device
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

SERVO = 'kind = "servo"\nname = "cell"\ntitle = "a load cell"\nsource = "an example"\ntravel = "3 mm"\n'
UP = np.linspace(0.0, 2e-3, 21)
LOOP = (
    Hypothesis("displacement_hysteresis", "stage:axis", "axis"),
    {"share": 0.05, "reach": 2e-3, "taper": 0.0, "reversible": 0.5},
)
TIRED = Hypothesis("degradation", "actuator:axis", "axis"), {"rate": 1e-3, "levels_off": 60.0}
BENT = Hypothesis("bow", "sensor:axis", "axis"), {"curvature": -6.0}
DRIFTS = Hypothesis("drift", "sensor:axis", "axis"), {"rate": 1e-7}
REASON = "no drive turns back in the records to fit; before a turn {} cannot be told from a curve"
A_LOOP, A_CHANGE = REASON.format("a loop"), REASON.format("what changes with time")


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    file = tmp_path_factory.mktemp("cell") / "device.toml"
    file.write_text(SERVO)
    return load_device(file)


def against(device, kind, records, cause, values, exact=True):
    recording = Recording("t", device.name, kind, ("reading.axis",), ("mm",), (1e-7,), tuple(records), ())
    fitter = Fitter(recording, estimate_noise(recording, 0.5))
    return objections(recording, fitter.fit(Structure(device).with_cause(cause, values), steps=0), exact=exact)


@pytest.mark.parametrize(
    "strokes, cause, told",
    [
        ([UP], LOOP, A_LOOP),
        ([UP, UP], LOOP, A_LOOP),
        ([-UP], TIRED, A_CHANGE),
        ([UP, UP[::-1]], LOOP, None),
        ([np.r_[UP, UP[-2::-1]]], LOOP, None),
        ([np.r_[UP, UP[-2::-1]]], TIRED, None),
        ([UP], BENT, None),
        ([UP], DRIFTS, None),
    ],
)
def test_a_loop_needs_a_turn_in_one_record_or_a_way_back_in_another(cell, strokes, cause, told):
    records = [record(u, u - 6.0 * u**2, "fit", h=np.inf) for u in strokes]
    assert against(cell, "poses", records, *cause) == ({} if told is None else {0: told})


def test_what_is_only_held_out_does_not_turn_a_loop(cell):
    records = [record(u, u, role, h=np.inf) for u, role in ((UP, "fit"), (UP[::-1], "hold_out"))]
    assert against(cell, "poses", records, *LOOP) == {0: A_LOOP}


def test_what_has_inertia_turns_back_by_itself():
    step = np.where(np.arange(800) < 200, 0.0, 1.0)
    hysteresis = Hypothesis("hysteresis", "stage:axis", "axis"), {"stiffness": 2e4, "reach": 2e-5, "taper": 0.0}
    assert against(AXIS, "series", [record(step, move(step), "fit")], *hysteresis) == {}


@pytest.mark.parametrize(
    "periods, exact, told", [(0.4, True, True), (1.2, True, False), (1.2, False, True), (1.6, False, False)]
)
def test_less_than_a_period_repeats_nothing_even_where_noise_alone_is_left(cell, periods, exact, told):
    pitch = Hypothesis("cyclic", "sensor:axis", "axis"), {"amplitude": 1e-5, "period": 2e-3 / periods, "phase": 0.0}
    reason = f"the reading covers {periods:.1f} periods of it, and {1 if exact else 1.5} are needed to see it repeat"
    assert against(cell, "poses", [record(UP, UP, "fit", h=np.inf)], *pitch, exact) == ({0: reason} if told else {})
