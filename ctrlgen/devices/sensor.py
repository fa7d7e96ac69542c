"""Sensors that read a channel of the pose: [[sensor]] tables of any device file, such as

[[sensor]]
kind = "displacement"
at = "delta_x"
model = "3316" # one of S2's sensors; any of its numbers can be overridden beside it
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ctrlgen.core.errors import Fault
from ctrlgen.core.units import In, Quantity, from_si, same_dimension, show
from ctrlgen.devices.section import Section
from ctrlgen.physics import sensor_models

NUMBERS = (
    "sensitivity",
    "gain",
    "bandwidth",
    "noise",
    "filtered_noise",
    "filter_cutoff",
    "offset_rate",
    "calibrated_at",
    "low",
    "high",
)
READINGS, READING_TIME = 40.0, 30.0
"""Readings that S0 section 3.1 averages at a pose, and the seconds that they take."""
Volt = Annotated[Quantity, In("V")]
PositiveVolt = Annotated[Quantity, In("V", positive=True)]


def _given(section: Section) -> dict[str, Any]:
    """The quantities that the file gives, in SI."""
    fields = ((key, getattr(section, key)) for key in type(section).model_fields)
    return {key: value.si for key, value in fields if hasattr(value, "si")}


class Converter(Section):
    """The ADC behind a sensor; by default that of S2 A.3.1, dSPACE DS1104."""

    low: Volt | None = None
    """Lower end of the range. Left out: -10 V."""
    high: Volt | None = None
    """Upper end of the range. Left out: 10 V."""
    bits: Annotated[Quantity, In("1", low=1, high=32, whole=True)] | None = None
    """Resolution: the step is (high - low)/2^bits. Left out: 16."""
    rate: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Sampling rate. Left out: 5 kHz."""

    @model_validator(mode="after")
    def _has_a_range(self) -> Converter:
        adc = self.adc()
        if adc.low >= adc.high:
            raise ValueError(f"low = {adc.low:g} V must be below high = {adc.high:g} V")
        return self

    def adc(self) -> sensor_models.Adc:
        """The converter of the measuring sensor_models."""
        given = _given(self)
        return sensor_models.Adc(**given | ({"bits": round(given["bits"])} if "bits" in given else {}))


@dataclass(frozen=True)
class SensorFigures:
    """Resolution and range of a sensor in the channel's SI unit: ADC step, peak-to-peak noise, the same `filtered`, the lowest
    and highest reading. None where there is no filter or no limit of the range."""

    name: str
    step: float
    noise: float
    filtered: float | None
    low: float | None
    high: float | None


class _Mounted(Section):
    """What every sensor has: the channel that it reads, and the converter behind it."""

    at: str
    """Channel of the pose that is read, such as `delta_x`."""
    arm: Annotated[Quantity, In("mm", positive=True)] | None = None
    """Lever arm, for a rotation alone, which is read at its end: displacement = arm * angle."""
    adc: Converter = Converter()
    """The ADC behind the sensor."""

    @property
    def lever(self) -> float:
        """Displacement at the sensor per unit of the channel [m/rad], 1 for a translation."""
        return 1.0 if self.arm is None else self.arm.si


class DisplacementSensor(_Mounted):
    """Displacement sensor with amplifier, ADC and digital filter (S2 Appendix A)."""

    kind: Literal["displacement"]
    """A sensor whose voltage is linear in the displacement."""
    model: Literal["3316", "3317", "3338", "fibre"] | None = None
    """One of the sensors of S2 Appendix A, whose numbers hold where none is written here. Left out: every number must
    be given.
    """
    home: Annotated[Quantity, In("um", low=0.0)] | None = None
    """Position of pose 0 in the measuring range, counted from the end of the range at which the voltage begins. Left out: in the middle."""
    sensitivity: Annotated[Quantity, In("um/V")] | None = None
    """Displacement per voltage at the ADC, amplifier included; negative where the voltage falls as the displacement
    grows.
    """
    gain: Annotated[Quantity, In("1", positive=True)] | None = None
    """Gain of the amplifier, which `sensitivity` contains."""
    bandwidth: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Cut-off frequency of the analogue filter."""
    noise: PositiveVolt | None = None
    """Noise at the ADC, peak to peak, without the digital filter."""
    filtered_noise: PositiveVolt | None = None
    """Noise at the ADC, peak to peak, after the digital filter."""
    filter_cutoff: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Cut-off frequency of the digital low-pass filter."""
    offset_rate: Annotated[Quantity, In("V/delta_degC")] | None = None
    """Voltage offset per kelvin of difference from `calibrated_at`."""
    calibrated_at: Annotated[Quantity, In("degC")] | None = None
    """Temperature of the calibration, at which the offset is zero."""
    low: Volt | None = None
    """Lower end of the linear range."""
    high: Volt | None = None
    """Upper end of the linear range."""

    @model_validator(mode="after")
    def _is_complete(self) -> DisplacementSensor:
        given = self._numbers()
        missing = [key for key in NUMBERS if key not in given]
        if self.model is None and missing:
            raise ValueError(
                f"{', '.join(missing)} missing; give them, or model = one of {', '.join(sensor_models.SENSORS)}"
            )
        sensor, faults = self.sensor(), []
        if sensor.sensitivity == 0:
            faults.append("sensitivity must not be zero")
        if sensor.low >= sensor.high:
            faults.append(f"low = {sensor.low:g} V must be below high = {sensor.high:g} V")
        elif sensor.low < sensor.adc.low or sensor.high > sensor.adc.high:
            faults.append(
                f"the linear range {sensor.low:g} ... {sensor.high:g} V exceeds the ADC's {sensor.adc.low:g} ... {sensor.adc.high:g} V"
            )
        elif self.home_position() > sensor.usable_range():
            faults.append(
                f"home = {self.home_position() * 1e6:.4g} um is beyond the measuring range of {sensor.usable_range() * 1e6:.4g} um"
            )
        if given.keys() & {"noise", "filtered_noise", "filter_cutoff", "bandwidth"} or self.adc != Converter():
            try:
                sensor.noise_parts()
            except ValueError as fault:
                faults.append(str(fault))
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def _numbers(self) -> dict[str, float]:
        return {key: value for key, value in _given(self).items() if key in NUMBERS}

    def sensor(self) -> sensor_models.Sensor:
        """The model of the sensor with these numbers."""
        given: dict[str, Any] = self._numbers() | {"adc": self.adc.adc()}
        if self.model is not None:
            return replace(sensor_models.SENSORS[self.model], **given)
        return sensor_models.Sensor(name="sensor", **given)

    def home_position(self) -> float:
        """Position of pose 0 in the measuring range [m]."""
        return self.sensor().usable_range() / 2 if self.home is None else self.home.si

    def figures(self) -> SensorFigures:
        """Resolution and range at the calibration temperature."""
        sensor, lever, home = self.sensor(), self.lever, self.home_position()
        return SensorFigures(
            sensor.name,
            sensor.resolution_adc() / lever,
            sensor.resolution_noise(filtered=False) / lever,
            sensor.resolution_noise(filtered=True) / lever,
            -home / lever,
            (sensor.usable_range() - home) / lever,
        )


class InterferometerSensor(_Mounted):
    """Michelson interferometer with a photodiode, S2 A.3.4, with S2's numbers unless given. Its reading is the fringe voltage."""

    kind: Literal["interferometer"]
    """An interferometer whose fringe voltage is read."""
    wavelength: Annotated[Quantity, In("nm", positive=True)] | None = None
    """Wavelength of the laser; half of it is one fringe. Left out: 632.8 nm."""
    mean: Volt | None = None
    """Mean of the fringe voltage. Left out: 5 V."""
    amplitude: PositiveVolt | None = None
    """Amplitude of the fringe voltage. Left out: 4 V."""
    noise: Annotated[Quantity, In("V", low=0.0)] | None = None
    """Standard deviation of the voltage's noise. Left out: 0.02 V."""

    def interferometer(self) -> sensor_models.Interferometer:
        """The model of the interferometer with these numbers."""
        keys = ("wavelength", "mean", "amplitude", "noise")
        return sensor_models.Interferometer(**{key: value for key, value in _given(self).items() if key in keys})

    def figures(self) -> SensorFigures:
        """Resolution at the steepest part of a fringe, dV = 4 pi/lambda * amplitude * dd."""
        laser = self.interferometer()
        slope = 4 * pi * laser.amplitude / laser.wavelength * self.lever
        noise = sensor_models.PEAK_TO_PEAK * laser.noise / slope
        return SensorFigures("interferometer", self.adc.adc().step / slope, noise, None, None, None)


class AutocollimatorSensor(Section):
    """Electronic autocollimator on a face of the moved body (S0 section 3.2). It reads one rotation; which, and of which face, decides how
    the other two show in it: the laws `autocollimator` and `face_tilt`."""

    kind: Literal["autocollimator"]
    """An autocollimator, which reads an angle."""
    at: str
    """Channel of the pose that is read, a rotation such as `theta_x`."""
    accuracy: Annotated[Quantity, In("deg", positive=True)]
    """Bound of a reading's error, either sign, such as "7e-5 deg"; half the width of an even distribution (GUM 4.3.7)."""
    range: Annotated[Quantity, In("deg", positive=True)]
    """Measuring range from end to end, home in its middle, such as "0.55 deg"."""
    rate: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Readings a second. Left out: 40 in 30 s (S0 section 3.1)."""

    @property
    def reading_rate(self) -> float:
        """Readings a second [Hz]."""
        return READINGS / READING_TIME if self.rate is None else self.rate.si

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest angle that it reads [rad]."""
        return -self.range.si / 2, self.range.si / 2

    def read(self, angle: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Readings (n,) [rad] of `angle` (n,): each off by an even draw within the accuracy, of which S0 says no more. Raises ValueError
        beyond the range."""
        low, high = self.ends
        if angle.min(initial=0.0) < low or angle.max(initial=0.0) > high:
            reached = " to ".join(show(v, "deg") for v in (angle.min(), angle.max()))
            raise ValueError(
                f"the angle goes from {reached}, but the range is {show(low, 'deg')} to {show(high, 'deg')}"
            )
        return np.asarray(angle + rng.uniform(-self.accuracy.si, self.accuracy.si, angle.shape))


AnySensor = Annotated[DisplacementSensor | InterferometerSensor | AutocollimatorSensor, Field(discriminator="kind")]


def mounting_faults(sensors: Sequence[AnySensor], channels: Sequence[str], units: Sequence[str]) -> list[Fault]:
    """Faults of the sensors' mounting: an unknown channel, an arm that is missing or has no meaning."""
    faults, unit_of = [], dict(zip(channels, units, strict=True))
    for k, sensor in enumerate(sensors):
        where = f"sensor[{k}]"
        if sensor.at not in unit_of:
            faults.append(Fault(f"{where}.at", f"{sensor.at!r} is not one of {', '.join(channels)}"))
            continue
        is_rotation = same_dimension(unit_of[sensor.at], "rad")
        if isinstance(sensor, AutocollimatorSensor):
            if not is_rotation:
                faults.append(Fault(f"{where}.at", f"{sensor.at} is a translation; an autocollimator reads a rotation"))
            continue
        if is_rotation and sensor.arm is None:
            faults.append(
                Fault(f"{where}.arm", f'is missing: {sensor.at} is a rotation; write for example arm = "20 mm"')
            )
        if not is_rotation and sensor.arm is not None:
            faults.append(Fault(f"{where}.arm", f"has no meaning: {sensor.at} is a translation; leave it out"))
    return faults


def describe(sensor: AnySensor, unit: str) -> str:
    """One line of text with `sensor.figures()` in the channel's `unit`."""

    def text(value: float) -> str:
        return f"{from_si(value, unit):.4g}"

    if isinstance(sensor, AutocollimatorSensor):
        low, high = sensor.ends
        return (
            f"{sensor.at} [{unit}] by autocollimator: within {text(sensor.accuracy.si)}, {text(low)} ... {text(high)}"
        )
    figures = sensor.figures()

    filtered = "" if figures.filtered is None else f" ({text(figures.filtered)} filtered)"
    span = (
        "unlimited range"
        if figures.low is None or figures.high is None
        else f"{text(figures.low)} ... {text(figures.high)}"
    )
    return f"{sensor.at} [{unit}] by {figures.name}: step {text(figures.step)}, noise {text(figures.noise)}{filtered} peak to peak, {span}"
