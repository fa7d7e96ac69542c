"""The measuring chain: S2's printed figures, fringe counting, and sensitivities recovered from simulated recordings."""

from __future__ import annotations

import runpy
from dataclasses import replace

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen.physics import sensor_models as chain
from ctrlgen.physics.sensor_models import SENSORS, Adc, Interferometer
from papers.sensor_calibration import (
    CalibrationRun,
    SensitivityStatistics,
    Slope,
    calibrate_sensor,
    find_fringes,
    move,
    record,
    sensitivity_statistics,
)

LASER = Interferometer()
NM, UM, CELSIUS = 1e-9, 1e-6, 273.15


def slopes(sensor: chain.Sensor, distance: float, speed: float, seeds: range) -> list[Slope]:
    runs = (record(sensor, LASER, distance, speed, np.random.default_rng(seed)) for seed in seeds)
    return [calibrate_sensor(run, LASER.wavelength) for run in runs]


# S2 prints 3.10 for 3338
@pytest.mark.parametrize(("name", "nm"), [("3316", 3.13), ("3317", 3.08), ("3338", 3.11), ("fibre", 3.59)])
def test_adc_resolution(name, nm):
    assert SENSORS[name].resolution_adc() / NM == pytest.approx(nm, abs=0.005)


@pytest.mark.parametrize(
    ("name", "filtered", "unfiltered"), [("3316", 18.5, 51), ("3317", 10.1, 35), ("3338", 15.3, 51), ("fibre", 3.5, 47)]
)
def test_noise_resolution(name, filtered, unfiltered):
    assert SENSORS[name].resolution_noise(True) / NM == pytest.approx(filtered, abs=0.05)
    assert SENSORS[name].resolution_noise(False) / NM == pytest.approx(unfiltered, abs=0.5)


def test_the_fibre_sensors_filtered_noise_is_below_its_least_significant_bit():
    fibre = SENSORS["fibre"]
    assert fibre.resolution_noise(True) < fibre.resolution_adc() < fibre.resolution_noise(False)


def test_a_warm_room_costs_range_and_a_cold_one_does_not():
    sensor = SENSORS["3316"]
    assert sensor.offset(CELSIUS + 25) == pytest.approx(0.267, rel=1e-9)
    assert sensor.usable_range(CELSIUS + 25) / UM == pytest.approx(99.9, abs=0.05)
    assert sensor.usable_range() == sensor.usable_range(CELSIUS + 10) == pytest.approx(102.64 * UM, rel=1e-9)
    assert sensor.usable_range(CELSIUS + 500) == 0.0
    assert SENSORS["fibre"].usable_range(CELSIUS + 30) == pytest.approx(11.77 * UM, rel=1e-9)


def test_the_adc_rounds_to_its_step_and_clips():
    adc = Adc()
    ramp = np.linspace(-11, 11, 4001)
    read = adc.read(ramp)
    inside = np.abs(ramp) < 9.999
    assert np.abs(read - ramp)[inside].max() <= adc.step / 2 * (1 + 1e-9)
    assert np.allclose(read / adc.step, np.round(read / adc.step), atol=1e-6)
    assert read.min() == -10.0 and read.max() == 10.0 - adc.step


@pytest.mark.parametrize("name", SENSORS)
def test_simulated_noise_has_the_stated_size_with_and_without_filter(name):
    sensor = SENSORS[name]
    still = np.full(500_000, 0.5 * sensor.usable_range())
    for filtered, stated in ((False, sensor.noise), (True, sensor.filtered_noise)):
        volts = sensor.read(still, np.random.default_rng(2), filtered=filtered)
        sd = volts[5000:].std()
        # 100 s hold some 600 independent values of the slow part; the ADC adds step/sqrt(12).
        assert sd * chain.PEAK_TO_PEAK == pytest.approx(stated, rel=0.1)


def test_noise_no_filter_could_leave_is_refused():
    with pytest.raises(ValueError, match=r"3316: filtered noise .* must lie between"):
        replace(SENSORS["3316"], filtered_noise=1e-4).noise_parts()
    with pytest.raises(ValueError, match="must lie between"):
        replace(SENSORS["3316"], filtered_noise=6e-3).noise_parts()


def test_a_sensor_driven_out_of_the_adc_is_refused():
    with pytest.raises(ValueError, match=r"exceeds the ADC.*stay within 99\.9"):
        SENSORS["3316"].read(move(101 * UM, 20 * UM, 5e3), np.random.default_rng(0), CELSIUS + 25)


def test_noise_alone_may_drive_a_sensor_out_of_the_adc_at_its_lower_end():
    """Half of it peak to peak fits between the signal and the end, or it does not."""
    sensor, still = replace(SENSORS["3316"], noise=0.05, filtered_noise=0.03), np.zeros(1000)
    ends = [replace(sensor, low=sensor.adc.low + share * sensor.noise) for share in (0.1, 0.6)]
    with pytest.raises(ValueError, match="exceeds the ADC"):
        ends[0].read(still, np.random.default_rng(0))
    assert ends[1].read(still, np.random.default_rng(0)).size == 1000


@pytest.mark.parametrize("phase", [0.1, 1.5, 3.0, 4.5, 6.0])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_fringes_count_the_distance_to_a_quarter_wave(phase, noise):
    d = move(20 * UM, 4 * UM, 5e3)
    laser = replace(LASER, phase=phase, noise=noise)
    fringes = find_fringes(laser.read(d, np.random.default_rng(5), Adc()))
    angle = 4 * np.pi * d[[0, -1]] / laser.wavelength + phase
    extrema = int(np.floor(angle[1] / np.pi) - np.ceil(angle[0] / np.pi)) + 1
    assert abs(fringes.bright - fringes.dark) <= 1
    # An extremum within a quarter period of an end has no crossing on its outer side and is left out.
    assert extrema - 2 <= fringes.bright + fringes.dark <= extrema
    travelled = np.interp(fringes.at[[0, -1]], np.arange(d.size), d)
    assert fringes.distance(laser.wavelength) == pytest.approx(travelled[1] - travelled[0], abs=2 * NM)


def test_fringes_are_found_at_the_extrema():
    d = move(5 * UM, 4 * UM, 5e3)
    fringes = find_fringes(replace(LASER, noise=0.0).read(d, np.random.default_rng(0), Adc()))
    phase = 4 * np.interp(fringes.at, np.arange(d.size), d) / LASER.wavelength
    assert phase == pytest.approx(np.round(phase), abs=1e-3)


def test_a_mirror_at_rest_gives_no_fringes():
    still = LASER.read(np.zeros(5000), np.random.default_rng(0), Adc())
    with pytest.raises(ValueError, match="too few"):
        find_fringes(np.full(5000, 5.0))
    with pytest.raises(ValueError, match="too few"):
        find_fringes(np.concatenate([still[:2500], still[2500:] - 3]))


def test_without_noise_the_sensitivity_is_exact():
    d = move(95 * UM, 4 * UM, 5e3)
    fine = Adc(bits=40)
    recording = CalibrationRun(
        d / 10.264e-6, replace(LASER, noise=0.0).read(d, np.random.default_rng(0), fine), fine.rate
    )
    assert calibrate_sensor(recording, LASER.wavelength).sensitivity == pytest.approx(10.264e-6, rel=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("name", ["3316", "3317", "3338"])
def test_the_planted_sensitivity_is_recovered_within_the_stated_uncertainty(name):
    sensor = SENSORS[name]
    found = slopes(sensor, 95 * UM, 8 * UM, range(25))
    z = np.array([(s.sensitivity - sensor.sensitivity) / s.sd for s in found])
    assert np.abs(z).max() < 4.5  # 25 draws of Student's t with 8 degrees of freedom: 1 in 20 000 each
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.7  # the uncertainty is neither boastful nor timid; expected 1.15
    calibration = SensitivityStatistics(tuple(found))
    assert abs(calibration.mean - sensor.sensitivity) < 3.5 * calibration.sd_of_mean
    assert all(s.sd < 1e-4 * s.sensitivity for s in found)


def test_the_fibre_sensor_is_recovered_over_its_one_volt():
    sensor = SENSORS["fibre"]
    found = SensitivityStatistics(tuple(slopes(sensor, 11.5 * UM, 1 * UM, range(25))))
    assert abs(found.mean - sensor.sensitivity) < 3.5 * found.sd_of_mean
    assert found.sd_of_mean < 1e-4 * sensor.sensitivity


def test_a_wrong_wavelength_is_seen_in_the_sensitivity():
    run = record(SENSORS["3316"], LASER, 95 * UM, 8 * UM, np.random.default_rng(1))
    found = calibrate_sensor(run, 1.001 * LASER.wavelength)
    assert abs(found.sensitivity - SENSORS["3316"].sensitivity) > 20 * found.sd


def test_a_falling_voltage_gives_a_negative_sensitivity():
    far = replace(SENSORS["fibre"], sensitivity=-11.77e-6)
    run = record(far, LASER, 10 * UM, 2 * UM, np.random.default_rng(1))
    assert calibrate_sensor(run, LASER.wavelength).sensitivity == pytest.approx(-11.77e-6, rel=1e-3)


def test_a_constant_thermal_offset_leaves_the_sensitivity_alone():
    sensor = SENSORS["3338"]
    cold, warm = (record(sensor, LASER, 80 * UM, 8 * UM, np.random.default_rng(3), CELSIUS + T) for T in (22.0, 25.0))
    assert warm.sensor.mean() - cold.sensor.mean() == pytest.approx(3 * 0.159, abs=1e-4)
    a, b = (calibrate_sensor(run, LASER.wavelength) for run in (cold, warm))
    assert abs(a.sensitivity - b.sensitivity) < 4 * a.sd


def test_statistics_of_repeated_recordings():
    three = SensitivityStatistics(tuple(Slope(s, 0.0, 0.0) for s in (9.0, 10.0, 11.0)))
    assert three.mean == 10 and three.sd == 1
    assert three.max_deviation == pytest.approx(0.2) and three.sd_of_mean == pytest.approx(3**-0.5)
    with pytest.raises(ValueError, match="at least two"):
        sensitivity_statistics(
            [record(SENSORS["fibre"], LASER, 5 * UM, 5 * UM, np.random.default_rng(0))], LASER.wavelength
        )


def test_the_shipped_record_gives_back_the_sensitivity_that_was_planted():
    script = runpy.run_path(str(SCENARIOS / "sensor_calibration" / "calibrate.py"))
    found = script["calibrate"](SCENARIOS / "sensor_calibration" / "record.csv")
    planted = SENSORS["3316"].sensitivity
    assert abs(found.sensitivity - planted) < 3 * found.sd < 1e-3 * planted
    assert (
        abs(found.distance - 95e-6) < 3 * script["WAVELENGTH"] / 4
    )  # a quarter wave at each end, one for the first crossing
    assert found.sd > max(found.fit, found.wavelength, found.tilt)
