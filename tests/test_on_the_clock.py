"""What holds for one recording alone is in no C and in no other recording."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from axis_records import AXIS

from ctrlgen.diagnosis.report.on_the_clock import a_pose_a_second, runs_on_the_clock, used_for_another_run
from ctrlgen.estimation.hypothesis import Hypothesis, hypotheses, nominal_physics

USE = "Use it."
CREEP, DRIFT, STEP = (
    Hypothesis("creep", "stage:axis", "axis"),
    Hypothesis("drift", "sensor:axis", "axis"),
    Hypothesis("sensor_step", "disturbance:axis", "axis"),
)
BEGUN = Hypothesis("coulomb_after", "stage:axis", "axis")
MASS = Hypothesis("parameter", "axis", path="mechanics.mass")
DEAD = Hypothesis("stuck", "sensor:axis", "axis")
MEND = "stuck at sensor:axis: nothing of the motion is read there; mend the sensor or its wiring, and record again."
RUNS = "of which another run knows nothing"


@pytest.mark.parametrize(
    "causes, told",
    [
        ((), USE),
        ((CREEP, MASS), USE),
        ((DEAD,), f"No cause that was found makes the C better. {MEND}"),
        ((CREEP, DEAD), f"{USE} {MEND}"),
        (
            (DRIFT,),
            f"No cause that was found makes the C better: drift at sensor:axis runs on the clock of these records, {RUNS}; "
            "device.next.toml keeps it for this recording as [[recording_effect]].",
        ),
        (
            (DRIFT, STEP),
            "No cause that was found makes the C better: drift at sensor:axis and sensor_step at disturbance:axis run on the clock of "
            f"these records, {RUNS}; device.next.toml keeps them for this recording as [[recording_effect]].",
        ),
        (
            (CREEP, DRIFT),
            f"{USE} Its C is without what holds for this recording alone: drift at sensor:axis runs on the clock of these records, {RUNS}; "
            "device.next.toml keeps it for this recording as [[recording_effect]].",
        ),
        (
            (BEGUN,),
            f"No cause that was found makes the C better: coulomb_after at stage:axis runs on the clock of these records, {RUNS}; "
            "device.next.toml keeps it for this recording as [[recording_effect]]. If coulomb_after at stage:axis lasts, state the law "
            "without its moment as an [[effect]].",
        ),
    ],
)
def test_that_no_c_has_what_runs_on_the_clock_of_the_records_is_told(causes, told):
    assert used_for_another_run([SimpleNamespace(cause=c) for c in causes], USE) == told


def test_every_law_that_is_a_function_of_time_alone_runs_on_the_clock():
    offered = hypotheses(AXIS, nominal_physics(AXIS), ("reading.axis",), None, False)
    of_time = [h for h in offered if h.effect != "parameter" and h.prior.of_time]
    assert len({h.effect for h in of_time}) > 3 and all(map(runs_on_the_clock, of_time))
    assert not any(
        map(runs_on_the_clock, (h for h in offered if h.effect in {"creep", "drive_gain", "delay", "coulomb"}))
    )


@pytest.mark.parametrize(
    "kind, step, causes, told",
    [
        (
            "poses",
            float("inf"),
            (CREEP, DRIFT, STEP),
            "drift at sensor:axis and sensor_step at disturbance:axis is one pose",
        ),
        ("poses", float("inf"), (CREEP,), None),
        ("poses", 2.0, (DRIFT,), None),
        ("series", 1e-3, (DRIFT,), None),
    ],
)
def test_a_second_of_poses_that_have_settled_is_a_pose(kind, step, causes, told):
    recording = SimpleNamespace(kind=kind, records=(SimpleNamespace(sample_time=step),))
    notes = a_pose_a_second(recording, [SimpleNamespace(cause=c) for c in causes])
    assert notes == ([] if told is None else [f"settled poses have no clock: 1 s of {told}"])
