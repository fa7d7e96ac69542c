"""What the sensors of a device record of a simulated motion: model -> readings -> measuring chain -> volts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import show
from ctrlgen.devices.sensor import InterferometerSensor
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace


@dataclass(frozen=True)
class SensorReadings:
    """One sensor's recording: `time` (n,) [s] at its ADC's rate, `volts` (n,), and `value` (n,) of `channel` in SI.

    `value` is what a user makes of the volts with the sensitivity and the place of pose 0, not knowing the room's
    temperature; None for an interferometer, whose fringes are to be counted.
    """

    channel: str
    time: np.ndarray
    volts: np.ndarray
    value: np.ndarray | None


def simulate_sensors(
    model: Model, trace: Trace, seed: int = 0, temperature: float | None = None, filtered: bool = False
) -> tuple[SensorReadings, ...]:
    """Every sensor's recording of the trace's readings, which are joined by straight lines between its samples.

    `temperature` [K] of the room, by default that of the calibration. `filtered`: behind the digital low-pass. The
    sensor's bandwidth colours its noise and leaves the motion alone. The same `seed` gives the same noise.
    Raises InputError where the device has no sensor, or a reading leaves a sensor's range.
    """
    if not model.device.sensor:
        raise InputError(model.name, [Fault("sensor", "there is none; add a [[sensor]] table to the device file")])
    signal, records, faults = model.signals["reading"], [], []
    for k, sensor in enumerate(model.device.sensor):
        channel = signal.channels.index(sensor.at)
        rate = sensor.adc.adc().rate
        span = trace.time[-1] - trace.time[0]
        time = trace.time[0] + np.arange(int(span * rate * (1 + 1e-12)) + 1) / rate
        reading = np.interp(time, trace.time, trace.signals["reading"][:, channel])
        rng = np.random.default_rng([seed, k])
        if isinstance(sensor, InterferometerSensor):
            volts = sensor.interferometer().read(reading * sensor.lever, rng, sensor.adc.adc())
            records.append(SensorReadings(sensor.at, time, volts, None))
            continue
        s, start = sensor.sensor(), sensor.start()
        d = reading * sensor.lever + start
        if d.min() < 0 or d.max() > s.usable_range(temperature):
            unit, ends = signal.units[channel], (0.0 - start, s.usable_range(temperature) - start)
            went = " to ".join(show(value, unit) for value in (reading.min(), reading.max()))
            held = " to ".join(show(value / sensor.lever, unit) for value in ends)
            faults.append(
                Fault(f"sensor[{k}], {sensor.at}", f"goes from {went}, the sensor's range is {held}; change home")
            )
            continue
        try:
            volts = s.read(d, rng, temperature, filtered)
        except ValueError as fault:
            faults.append(Fault(f"sensor[{k}], {sensor.at}", str(fault)))
            continue
        near = s.low if s.sensitivity > 0 else s.high
        records.append(SensorReadings(sensor.at, time, volts, ((volts - near) * s.sensitivity - start) / sensor.lever))
    if faults:
        raise InputError(model.name, faults)
    return tuple(records)
