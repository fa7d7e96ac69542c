"""Virtual sensors: what the sensors of a device record of a simulated motion, pose -> sensor, amplifier, ADC -> volts; of an
autocollimator angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import show
from ctrlgen.devices.sensor import AutocollimatorSensor, InterferometerSensor
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace


@dataclass(frozen=True)
class SensorReadings:
    """One sensor's recording: `time` (n,) [s] at its ADC's rate, `volts` (n,), and `value` (n,) of `channel` in SI. An autocollimator
    has a rate of its own, and no volts (None).

    `value` is computed from the volts with the sensitivity and the position of pose 0 at calibration temperature, as a
    user does; None for an interferometer, whose fringes have to be counted.
    """

    channel: str
    time: np.ndarray
    volts: np.ndarray | None
    value: np.ndarray | None


def simulate_sensors(
    model: Model, trace: Trace, seed: int = 0, temperature: float | None = None, filtered: bool = False
) -> tuple[SensorReadings, ...]:
    """Every sensor's recording of the trace's readings, which are interpolated linearly between its samples.

    `temperature` [K] of the room is that of the calibration unless given. `filtered`: after the digital low-pass. The
    sensor's bandwidth filters its noise, not the motion. The same `seed` gives the same noise. Raises InputError where
    the device has no sensor, or a reading leaves a sensor's range.
    """
    if not model.device.sensor:
        raise InputError(model.name, [Fault("sensor", "the device has none; add a [[sensor]] table to its file")])
    signal, records, faults = model.signals["reading"], [], []
    for k, sensor in enumerate(model.device.sensor):
        channel = signal.channels.index(sensor.at)
        rate = sensor.reading_rate if isinstance(sensor, AutocollimatorSensor) else sensor.adc.adc().rate
        span = trace.time[-1] - trace.time[0]
        time = trace.time[0] + np.arange(int(span * rate * (1 + 1e-12)) + 1) / rate
        reading = np.interp(time, trace.time, trace.signals["reading"][:, channel])
        rng = np.random.default_rng([seed, k])
        if isinstance(sensor, AutocollimatorSensor):
            try:
                records.append(SensorReadings(sensor.at, time, None, sensor.read(reading, rng)))
            except ValueError as fault:
                faults.append(Fault(f"sensor[{k}], {sensor.at}", str(fault)))
            continue
        if isinstance(sensor, InterferometerSensor):
            volts = sensor.interferometer().read(reading * sensor.lever, rng, sensor.adc.adc())
            records.append(SensorReadings(sensor.at, time, volts, None))
            continue
        s, start = sensor.sensor(), sensor.home_position()
        d = reading * sensor.lever + start
        if d.min() < 0 or d.max() > s.usable_range(temperature):
            unit, ends = signal.units[channel], (0.0 - start, s.usable_range(temperature) - start)
            reached = " to ".join(show(value, unit) for value in (reading.min(), reading.max()))
            allowed = " to ".join(show(value / sensor.lever, unit) for value in ends)
            faults.append(
                Fault(
                    f"sensor[{k}], {sensor.at}",
                    f"the reading goes from {reached}, but the sensor's range is {allowed}; change home, or the motion",
                )
            )
            continue
        try:
            volts = s.read(d, rng, temperature, filtered)
        except ValueError as fault:
            faults.append(Fault(f"sensor[{k}], {sensor.at}", str(fault)))
            continue
        start_volts = s.low if s.sensitivity > 0 else s.high
        records.append(
            SensorReadings(sensor.at, time, volts, ((volts - start_volts) * s.sensitivity - start) / sensor.lever)
        )
    if faults:
        raise InputError(model.name, faults)
    return tuple(records)
