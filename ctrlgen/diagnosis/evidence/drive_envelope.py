"""What the drives of a device did in its recordings: the range, rate and band in which the next experiment can surely be done."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.devices import ImposedPhysics
from ctrlgen.diagnosis.settings import EXCITATION
from ctrlgen.model.model import Model
from ctrlgen.recordings.recording import Record


@dataclass(frozen=True, eq=False)
class DriveEnvelope:
    """Range, rate and band of each drive, (n_u,) each.

    low, high: of its values [SI]. rate: of its largest change by time [SI/s], infinite for poses, which settle.
    band: highest frequency of its changes [Hz], see `occupied_band`; infinite for poses.
    """

    low: np.ndarray
    high: np.ndarray
    rate: np.ndarray
    band: np.ndarray

    @classmethod
    def recorded(cls, records: Sequence[Record], model: Model) -> DriveEnvelope:
        """What the `records` hold, within the limits that the device states; a stated rate takes the place of the recorded one."""
        low, high = (extreme(np.vstack([r.drive for r in records]), axis=0) for extreme in (np.min, np.max))
        stated_low, stated_high = model.u_bounds
        low, high = (np.clip(side, stated_low, stated_high) for side in (low, high))
        series = [r for r in records if not r.poses and len(r.drive) > 1]
        if not series:
            endless = np.full(len(low), np.inf)
            return cls(low, high, endless, endless)
        rate = np.max([fastest(r.drive, r.sample_time) for r in series], axis=0)
        slowest = np.minimum(-model.rate_bounds[0], model.rate_bounds[1])
        rate = np.where(np.isfinite(slowest), slowest, rate)
        # A line between two bins of a record's spectrum is within a bin of both
        widths = [occupied_band(r.drive, r.sample_time) + 1 / ((len(r.drive) - 1) * r.sample_time) for r in series]
        return cls(low, high, rate, np.max(widths, axis=0))

    def widened(self, model: Model) -> DriveEnvelope | None:
        """The range that the device states, its rate larger in proportion, in the same band; of an imposed motion the same speeds and
        accelerations in either direction. None where that is no more than was recorded."""
        moved, (low, high) = self.span > 0, model.u_bounds
        low, high = (
            np.where(np.isfinite(side) & moved, side, own) for side, own in ((low, self.low), (high, self.high))
        )
        if (free := free_drives(model)) < len(low):
            largest = np.maximum(np.abs(low), np.abs(high))
            turned = np.arange(len(low)) >= free
            low, high = np.where(turned, -largest, self.low), np.where(turned, largest, self.high)
        more = np.where(moved, (high - low) / np.where(moved, self.span, 1.0), 1.0)
        if not (more > 1 + EXCITATION.rounding).any():
            return None
        stated = np.minimum(-model.rate_bounds[0], model.rate_bounds[1])
        return replace(self, low=low, high=high, rate=np.where(np.isfinite(stated), stated, self.rate * more))

    @property
    def span(self) -> np.ndarray:
        """Width of the range (n_u,) [SI]."""
        return self.high - self.low

    def holds(self, drive: np.ndarray, sample_time: float) -> bool:
        """Whether a drive (n, n_u) [SI] stays within range, rate and band, but for rounding."""
        slack = EXCITATION.rounding * np.maximum(np.maximum(np.abs(self.low), np.abs(self.high)), self.span)
        if not ((drive >= self.low - slack).all() and (drive <= self.high + slack).all()):
            return False
        if not np.isfinite(sample_time) or np.isinf(self.rate).all():
            return True
        return bool(
            (fastest(drive, sample_time) <= self.rate * (1 + EXCITATION.rounding) + slack / sample_time).all()
            and (occupied_band(drive, sample_time) <= self.band * (1 + EXCITATION.rounding)).all()
        )

    def shaped(
        self,
        wanted: np.ndarray,
        sample_time: float,
        drives: Callable[[np.ndarray], np.ndarray] = lambda values: values,
        odd: bool = False,
    ) -> np.ndarray | None:
        """The drive nearest to `wanted` (n, k) within the envelope: ramped where it is too fast, then smoothed as little as need be.

        `drives` makes the n_u drives of the k values: those of an imposed motion are derivatives of its positions. `odd`: the
        values go on beyond their ends at the speed that they have there, and are not held. None where no smoothing is enough.
        """
        k = wanted.shape[1]
        values = ramped(np.clip(wanted, self.low[:k], self.high[:k]), self.rate[:k] * sample_time)
        for smooth in smoothed(values, odd):
            drive = drives(smooth)
            if self.holds(drive, sample_time):
                return drive
        return None


def free_drives(model: Model) -> int:
    """How many of the first drives are free: all, or of an imposed motion its positions."""
    imposed = isinstance(model.device.physics(model.device.values()), ImposedPhysics)
    return len(model.axes) if imposed else model.u.numel()


def fastest(drive: np.ndarray, sample_time: float) -> np.ndarray:
    """The largest change by time of each drive (n, n_u), from sample to sample [SI/s]."""
    return np.abs(np.diff(drive, axis=0)).max(axis=0, initial=0.0) / sample_time


def occupied_band(drive: np.ndarray, sample_time: float) -> np.ndarray:
    """Frequency (n_u,) [Hz] below which `EXCITATION.band_share` of the energy of the changes of a drive (n, n_u) lies.

    Of the changes, because a machine is moved by them: a large slow stroke hides in no rest of one per cent a chirp beside it.
    """
    power = np.abs(np.fft.rfft(np.diff(drive, axis=0), axis=0)) ** 2
    below, whole = np.cumsum(power, axis=0), power.sum(axis=0)
    first = np.argmax(below >= EXCITATION.band_share * whole, axis=0)
    return np.where(whole > 0, first / (max(len(drive) - 1, 1) * sample_time), 0.0)


def ramped(wanted: np.ndarray, most: np.ndarray) -> np.ndarray:
    """`wanted` (n, k), each value followed by steps of `most` (k,) at the largest."""
    if (np.abs(np.diff(wanted, axis=0)) <= most).all():
        return wanted
    values = np.empty_like(wanted)
    values[0] = wanted[0]
    for i in range(1, len(wanted)):
        values[i] = values[i - 1] + np.clip(wanted[i] - values[i - 1], -most, most)
    return values


def smoothed(values: np.ndarray, odd: bool) -> Iterator[np.ndarray]:
    """`values` (n, k) as they are, then averaged over ever wider Hann windows, up to a quarter of their length.

    The weights are positive and add to one: an average is neither beyond the range of what it averages nor faster.
    """
    yield values
    width = 3
    while width <= len(values) // 4:
        weights = np.hanning(width + 2)[1:-1]
        around = ((width // 2, width // 2), (0, 0))
        wide = (
            np.pad(values, around, mode="reflect", reflect_type="odd") if odd else np.pad(values, around, mode="edge")
        )
        yield np.column_stack([np.convolve(column, weights / weights.sum(), "valid") for column in wide.T])
        width = int(EXCITATION.wider * width) // 2 * 2 + 1
