"""Sensors as [[sensor]] tables of a device file: what they give, what they record of a motion, what is refused."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np
import pytest
from conftest import DEVICES

from ctrlgen import InputError, build_model, load_device
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace, simulate
from ctrlgen.model.virtual_sensors import simulate_sensors
from ctrlgen.physics.sensor_models import PEAK_TO_PEAK, SENSORS
from papers.sensor_calibration import find_fringes

NM, UM, CELSIUS = 1e-9, 1e-6, 273.15
EDDY = {"kind": "displacement", "at": "delta_x", "model": "3316"}


def with_sensors(kind: str, *sensors: dict[str, Any]) -> Model:
    table = tomllib.loads((DEVICES / f"{kind}.toml").read_text())
    table["sensor"] = list(sensors)
    return build_model(validate(Device.library[table["kind"]], table, "device with sensors"))


def ramp(model: Model, channel: str, end: float, seconds: float) -> Trace:
    """A trace whose readings are zero but for one channel, which goes straight from 0 to `end`."""
    reading = np.zeros((2, len(model.signals["reading"].channels)))
    reading[1, model.signals["reading"].channels.index(channel)] = end
    return Trace(np.array([0.0, seconds]), {"reading": reading}, np.zeros((2, 0)), np.zeros((2, 0)))


@pytest.fixture(scope="module")
def stage() -> Model:
    return build_model(load_device(DEVICES / "rrr_case2.toml"))


def test_the_shipped_stage_is_read_by_the_sensors_of_s2(stage):
    by_x, by_y, by_turn = (sensor.figures() for sensor in stage.device.sensor)
    assert by_x.step == pytest.approx(3.13 * NM, abs=0.005 * NM)  # S2 A.5.1.1
    assert by_y.filtered == pytest.approx(10.1 * NM, abs=0.05 * NM)  # S2 A.5.1.2
    assert by_x.high - by_x.low == pytest.approx(102.6 * UM, abs=0.05 * UM)  # S2 Table A.2
    assert by_turn.noise == pytest.approx(51 * NM / 20e-3, rel=0.01)  # rad, at the end of the arm


def test_a_recording_is_the_simulated_reading_but_for_the_stated_noise(stage):
    volts = np.tile([100.0, 40.0, 90.0], (100, 1))
    trace = simulate(stage, volts, 0.1)
    for filtered in (False, True):
        records = simulate_sensors(stage, trace, seed=1, filtered=filtered)
        for k, (record, sensor) in enumerate(zip(records, stage.device.sensor, strict=True)):
            settled = record.time > 1.0
            error = record.value[settled] - trace.signals["reading"][-1, k]
            figures = sensor.figures()
            stated = figures.filtered if filtered else figures.noise
            assert PEAK_TO_PEAK * error.std() == pytest.approx(stated, rel=0.3)  # 10 s hold some 60 independent values
            assert abs(error.mean()) < stated / PEAK_TO_PEAK
            assert record.time.size == 50_001  # 10 s at S2's 5 kHz


def test_the_same_seed_gives_the_same_recording_and_sensors_do_not_share_noise(stage):
    trace = ramp(stage, "delta_x", 0.0, 0.2)
    first, again, other = (simulate_sensors(stage, trace, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(first[0].volts, again[0].volts) and not np.array_equal(first[0].volts, other[0].volts)
    twins = with_sensors("rrr_case2", EDDY, EDDY | {"at": "delta_y"})
    one, two = simulate_sensors(twins, ramp(twins, "delta_x", 0.0, 0.2))
    assert not np.array_equal(one.volts, two.volts)


def test_a_warm_room_shifts_what_a_user_makes_of_the_volts(stage):
    trace = ramp(stage, "delta_x", 0.0, 0.2)
    cold, warm = (simulate_sensors(stage, trace, temperature=CELSIUS + T)[0].value.mean() for T in (22, 24))
    assert warm - cold == pytest.approx(2 * 89e-3 * 10.264e-6, rel=0.01)  # S2 A.6.2


def test_a_falling_sensor_is_read_the_right_way_round():
    far = {**EDDY, "sensitivity": "-10.264 um/V", "home": "10 um"}
    model = with_sensors("rrr_case2", far)
    (record,) = simulate_sensors(model, ramp(model, "delta_x", 50 * UM, 2.0))
    assert np.diff(record.volts[[0, -1]])[0] < -4.5
    assert record.value[-1] == pytest.approx(50 * UM, abs=0.05 * UM)


def test_an_interferometer_on_the_meso_hexapod_counts_the_way():
    model = with_sensors("meso_hexapod", {"kind": "interferometer", "at": "delta_z"})
    (record,) = simulate_sensors(model, ramp(model, "delta_z", 20 * UM, 4.0))
    assert record.value is None
    fringes = find_fringes(record.volts)
    travelled = 20 * UM * np.diff(fringes.at[[0, -1]]).item() / (record.volts.size - 1)
    assert travelled > 19 * UM and fringes.distance(632.8e-9) == pytest.approx(travelled, abs=2 * NM)


def test_the_mems_hexapod_takes_a_sensor_with_numbers_of_its_own():
    own = {
        "kind": "displacement",
        "at": "theta_z",
        "arm": "1.5 mm",
        "sensitivity": "1 um/V",
        "gain": 1,
        "bandwidth": "1 kHz",
        "noise": "6 mV",
        "filtered_noise": "2 mV",
        "filter_cutoff": "10 Hz",
        "offset_rate": "0 V/delta_degC",
        "calibrated_at": "22 degC",
        "low": "0 V",
        "high": "5 V",
        "adc": {"low": "0 V", "high": "5.12 V", "bits": 9},
    }
    (sensor,) = with_sensors("mems_hexapod", own).device.sensor
    assert sensor.figures().step == pytest.approx(10e-9 / 1.5e-3) and sensor.figures().high == pytest.approx(
        2.5e-6 / 1.5e-3
    )


def test_a_motion_beyond_the_range_is_refused_with_every_sensor_s_name(stage):
    trace = ramp(stage, "delta_y", 60 * UM, 0.1)
    trace.signals["reading"][1, 0] = -60 * UM
    with pytest.raises(
        InputError, match=r"(?s)sensor\[0\], delta_x.*-60 um.*-51\.3.*sensor\[1\], delta_y.*change home"
    ):
        simulate_sensors(stage, trace)


def test_a_device_without_sensors_says_how_to_add_one(model):
    with pytest.raises(InputError, match=r"\[\[sensor\]\]"):
        simulate_sensors(model, ramp(model, "delta_z", 0.0, 0.1))


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"at": "delta_q"}, r"sensor\[0\]\.at.*delta_q.*delta_x, delta_y, theta_z"),
        ({"at": "theta_z"}, r"sensor\[0\]\.arm.*is missing.*20 mm"),
        ({"arm": "20 mm"}, r"sensor\[0\]\.arm.*translation"),
        ({"home": "103 um"}, "beyond the measuring range of 102.6 um"),
        ({"low": "9 V", "high": "1 V"}, "low = 9 V must be below"),
        ({"high": "11 V"}, "exceeds the ADC's"),
        ({"filtered_noise": "6 mV"}, "filtered noise .* must lie between"),
        ({"sensitivity": "10 V/um"}, r"sensor\[0\]\.sensitivity.*um/V is needed"),
        ({"model": "3315"}, r"sensor\[0\]\.model.*3316.*fibre"),
        ({"kind": "ruler"}, r"sensor\[0\].*displacement.*interferometer"),
        ({"adc": {"low": "10 V", "high": "10 V"}}, "must be below high"),
        ({"gian": 3}, "did you mean 'gain'"),
        ({"wavelenght": "1 nm"}, "known here: at, arm, adc, kind, model, home"),  # what the other kind has is no help
    ],
)
def test_a_sensor_that_cannot_be_is_refused_with_a_remedy(changes, says):
    with pytest.raises(InputError, match=says):
        with_sensors("rrr_case2", EDDY | changes)


def test_a_sensor_without_a_model_lists_all_that_is_missing():
    with pytest.raises(InputError, match=r"sensitivity, gain, .*, high missing.*3316, 3317, 3338, fibre"):
        with_sensors("rrr_case2", {"kind": "displacement", "at": "delta_x"})


def test_the_models_a_file_may_name_are_those_of_s2():
    for name in SENSORS:
        with_sensors("rrr_case2", EDDY | {"model": name})
