"""Models of displacement sensor, amplifier, ADC and interferometer, S2 Appendix A.

reading [V] = displacement/sensitivity + offset rate (temperature - calibration temperature) + noise, then quantised.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt

import numpy as np

from ctrlgen.core.units import parse

PEAK_TO_PEAK = 6.0  # standard deviations in a peak-to-peak figure; S2 does not state the duration of the measurement
SLOW_NOISE = 10.0  # cut-off frequency of the digital filter over the bandwidth of the noise that it passes whole


@dataclass(frozen=True)
class Adc:
    """`low`, `high` [V], `bits`, `rate` [Hz]. S2 A.3.1: dSPACE DS1104, +-10 V, 16 bit, sampled at 5 kHz."""

    low: float = -10.0
    high: float = 10.0
    bits: int = 16
    rate: float = 5e3

    @property
    def step(self) -> float:
        """Least significant bit [V]."""
        return (self.high - self.low) / 2**self.bits

    def read(self, volts: np.ndarray) -> np.ndarray:
        """`volts` rounded to the step and clipped to the range [V]."""
        return np.clip(np.round(volts / self.step) * self.step, self.low, self.high - self.step)


@dataclass(frozen=True)
class Sensor:
    """A calibrated displacement sensor with its amplifier, SI; voltages are those at the ADC.

    `sensitivity` Delta d/Delta V [m/V] including the amplifier's `gain`, negative where the voltage falls as the
    displacement grows; `bandwidth` [Hz] of the analogue filter;
    `noise`, `filtered_noise` [V] peak to peak without and with the digital low-pass of `filter_cutoff` [Hz];
    `offset_rate` Delta V/Delta T [V/K] against `calibrated_at` [K]; `low`, `high` [V] the linear range.
    """

    name: str
    sensitivity: float
    gain: float
    bandwidth: float
    noise: float
    filtered_noise: float
    filter_cutoff: float
    offset_rate: float
    calibrated_at: float
    low: float
    high: float
    adc: Adc = Adc()

    @property
    def bare_sensitivity(self) -> float:
        """Delta d/Delta V of the sensor without its amplifier [m/V]."""
        return self.sensitivity * self.gain

    def resolution_adc(self) -> float:
        """S2 eq. (A.2): sensitivity times the ADC's voltage range over 2^bits [m]."""
        return abs(self.sensitivity) * self.adc.step

    def resolution_noise(self, filtered: bool) -> float:
        """S2 A.5.1.2: peak-to-peak noise times sensitivity [m]."""
        return abs(self.sensitivity) * (self.filtered_noise if filtered else self.noise)

    def offset(self, temperature: float) -> float:
        """Thermal offset of the reading [V] at `temperature` [K]."""
        return self.offset_rate * (temperature - self.calibrated_at)

    def usable_range(self, temperature: float | None = None) -> float:
        """S2 eq. (A.4): [high - offset] sensitivity, counted from the shifted zero [m]; all of it at lower temperatures.

        S2 neglects a change from 22 to 22.5 degC, which costs up to 0.8 % of the range. In a colder room the zero shifts
        below `low`; the ADC still reads it and the whole range is usable.
        """
        lost = 0.0 if temperature is None else max(0.0, self.offset(temperature))
        return max(0.0, self.high - self.low - lost) * abs(self.sensitivity)

    def noise_parts(self) -> tuple[float, float]:
        """Standard deviations [V] of the slow part of the noise, which passes the digital filter, and of the broadband part.

        Two figures determine them: u^2 = s^2 + w^2 without and f^2 = s^2 k_s + w^2 k_w with the filter, k the share of each
        variance that the filter passes. Broadband noise alone would fall nearly tenfold from 1 kHz to 10 Hz; that of the
        eddy-current sensors falls threefold, so most of the rest is slow. Raises ValueError where the figures contradict
        each other.
        """
        pass_slow, pass_broad = (self._passed(cutoff) for cutoff in (self._slow_cutoff, self.bandwidth))
        u, f = self.noise / PEAK_TO_PEAK, self.filtered_noise / PEAK_TO_PEAK
        slow = (f**2 - u**2 * pass_broad) / (pass_slow - pass_broad)
        if not 0 <= slow <= u**2:
            least, most = (PEAK_TO_PEAK * u * sqrt(passed) for passed in (pass_broad, pass_slow))
            raise ValueError(
                f"{self.name}: filtered noise {self.filtered_noise:.3g} V must lie between {least:.3g} V and {most:.3g} V, "
                f"which is what a {self.filter_cutoff:g} Hz filter passes of {self.noise:.3g} V"
            )
        return sqrt(slow), sqrt(u**2 - slow)

    @property
    def _slow_cutoff(self) -> float:
        return self.filter_cutoff / SLOW_NOISE  # well inside the filter's band; S2 gives no spectrum

    def _passed(self, cutoff: float) -> float:
        """Share of the variance of first-order noise of bandwidth `cutoff` [Hz] that passes the digital filter."""
        impulse = np.zeros(round(20 * self.adc.rate / self._slow_cutoff))
        impulse[0] = 1.0
        response = _first_order(impulse, cutoff, self.adc.rate)
        return float(np.sum(low_pass(response, self.filter_cutoff, self.adc.rate, settled=False) ** 2))

    def read(
        self,
        displacement: np.ndarray,
        rng: np.random.Generator,
        temperature: float | None = None,
        filtered: bool = False,
    ) -> np.ndarray:
        """The recording of the ADC [V] of a `displacement` (n,) [m] sampled at its rate, counted from the end of the linear range
        where the voltage begins.

        Raises ValueError where the signal exceeds the ADC's range.
        """
        start = self.low if self.sensitivity > 0 else self.high
        true = start + self.gain * displacement / self.bare_sensitivity
        true = true + (0.0 if temperature is None else self.offset(temperature))
        slow, broad = self.noise_parts()
        margin = PEAK_TO_PEAK / 2 * sqrt(slow**2 + broad**2)
        if true.max() + margin > self.adc.high or true.min() - margin < self.adc.low:
            raise ValueError(
                f"{self.name}: {true.min():.3g} to {true.max():.3g} V exceeds the ADC's {self.adc.low:g} to {self.adc.high:g} V; "
                f"move the sensor or stay within {1e6 * self.usable_range(temperature):.4g} um"
            )
        noise = slow * _low_pass_noise(true.size, self._slow_cutoff, self.adc.rate, rng)
        noise += broad * _low_pass_noise(true.size, self.bandwidth, self.adc.rate, rng)
        recorded = self.adc.read(true + noise)
        return low_pass(recorded, self.filter_cutoff, self.adc.rate) if filtered else recorded


@dataclass(frozen=True)
class Interferometer:
    """Michelson interferometer on a photodiode: mean and amplitude [V], rms `noise` [V]. S2 A.3.4: HeNe laser."""

    wavelength: float = 632.8e-9
    mean: float = 5.0
    amplitude: float = 4.0
    noise: float = 0.02
    phase: float = 0.0

    def read(self, displacement: np.ndarray, rng: np.random.Generator, adc: Adc) -> np.ndarray:
        """Photodiode voltage [V]; one bright fringe per half wavelength, because the beam travels the path twice."""
        angle = 4 * pi * displacement / self.wavelength + self.phase
        return adc.read(self.mean + self.amplitude * np.cos(angle) + self.noise * rng.standard_normal(angle.size))


def low_pass(signal: np.ndarray, cutoff: float, rate: float, settled: bool = True) -> np.ndarray:
    """`signal` (n,) after a second-order Butterworth low-pass; `settled`: as if its first value had lasted for ever.

    S2 gives the cutoff only; a first-order filter would pass more noise than S2 states.
    """
    # Most of a second to import, which no device file should wait for
    from scipy.signal import (
        butter,
        lfilter,
        lfilter_zi,
    )

    b, a = butter(2, cutoff, fs=rate)
    start = lfilter_zi(b, a) * (signal[0] if settled else 0.0)
    return np.asarray(lfilter(b, a, signal, zi=start)[0])


def _first_order(white: np.ndarray, cutoff: float, rate: float, before: float = 0.0) -> np.ndarray:
    """White noise of unit variance through a first-order low-pass of `cutoff` [Hz], scaled to unit variance."""
    from scipy.signal import lfilter

    pole = exp(-2 * pi * cutoff / rate)
    return np.asarray(lfilter([sqrt(1 - pole**2)], [1, -pole], white, zi=[pole * before])[0])


def _low_pass_noise(count: int, cutoff: float, rate: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit variance and first-order bandwidth `cutoff`, stationary from the first sample."""
    return _first_order(rng.standard_normal(count), cutoff, rate, before=rng.standard_normal())


def _eddy(name: str, sensitivity: str, noise: str, filtered: str, offset_rate: str) -> Sensor:
    return Sensor(
        name,
        parse(sensitivity, "m/V"),
        gain=10.0,  # A.1: 100 um is 1 V at the sensor and 10 V at the ADC; S2 sets it by potentiometer
        bandwidth=parse("1 kHz", "Hz"),
        noise=parse(noise, "V"),
        filtered_noise=parse(filtered, "V"),
        filter_cutoff=parse("10 Hz", "Hz"),
        offset_rate=parse(offset_rate, "V/delta_degC"),
        calibrated_at=parse("22 degC", "degC"),
        low=0.0,
        high=10.0,
    )


SENSORS = {
    "3316": _eddy("eddy-current 3316", "10.264 um/V", "5 mV", "1.8 mV", "89 mV/delta_degC"),
    "3317": _eddy("eddy-current 3317", "10.099 um/V", "3.5 mV", "1.0 mV", "82 mV/delta_degC"),
    "3338": _eddy("eddy-current 3338", "10.184 um/V", "5 mV", "1.5 mV", "159 mV/delta_degC"),
    # Its filtered noise (0.3 mV, 3.5 nm) is below the least significant bit (0.305 mV, 3.59 nm): only the digital filter's
    # mean over many samples, dithered by the noise, resolves it.
    "fibre": Sensor(
        "fibre-optic D20, near side",
        parse("11.770 um/V", "m/V"),
        gain=1.0,
        bandwidth=parse("200 kHz", "Hz"),
        noise=parse("4 mV", "V"),
        filtered_noise=parse("0.3 mV", "V"),
        filter_cutoff=parse("10 Hz", "Hz"),
        offset_rate=0.0,  # A.6.2: removed by tuning the peak to 5 V
        calibrated_at=parse("22 degC", "degC"),
        low=1.5,
        high=2.5,
    ),
}
