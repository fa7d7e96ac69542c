"""What the instruments of a calibration may feign: by how much poses that follow the calibrated Jacobian are off because a sensor law or a
sensor is not known exactly. Source: S0 section 3, whose instruments are stated and whose residuals are larger by far.

Where a number of a sensor law is one sd above the stated one, the implied poses are off by D = -(dh/dp)^-1 dh/dn sd, the fit takes of that
what is linear in the drives, D ~ U dJ' + d_0, and every pose of the calibrated device is off by as much.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from ctrlgen.devices import Device
from ctrlgen.devices.sensor import AutocollimatorSensor
from ctrlgen.model.read_poses import ReadPoses
from ctrlgen.recordings.pose_errors import CHANNELS, PoseErrors


@dataclass(frozen=True)
class InstrumentShare:
    """What one standard deviation of `name` makes of the calibrated device's poses: norms of the largest `rotation` [rad] and
    `translation` [m] error; `source` of the standard deviation."""

    name: str
    source: str
    rotation: float
    translation: float


def instrument_shares(
    device: Device, instruments: ReadPoses, drive: np.ndarray, poses: np.ndarray
) -> tuple[InstrumentShare, ...]:
    """One entry for each stated sd of a sensor law, and for each autocollimator, over `drive` (n, n_u) and `poses` (n, 6) [SI].

    An autocollimator's error is taken to grow with the angle up to its accuracy a at the largest angle, sd a/sqrt(3) (GUM 4.3.7): of all
    errors within the accuracy the one that a Jacobian takes over whole.
    """
    named = [(n.name, n.source, D) for n, D in zip(instruments.numbers, instruments.deviations(poses), strict=True)]
    for sensor in device.sensor:
        if isinstance(sensor, AutocollimatorSensor):
            i = CHANNELS.index(sensor.at)
            off, largest = np.zeros(poses.shape), np.abs(poses[:, i]).max()
            off[:, i] = poses[:, i] / (largest or 1.0) * sensor.accuracy.si / sqrt(3)
            named.append(
                (f"accuracy of the autocollimator at {sensor.at}", sensor.accuracy.source or "the device file", off)
            )
    design = np.column_stack([drive / np.abs(drive).max(), np.ones(len(drive))])
    found = []
    for name, source, off in named:
        taken = PoseErrors(design @ np.linalg.lstsq(design, off, rcond=None)[0])
        found.append(InstrumentShare(name, source, float(taken.rotation.max()), float(taken.translation.max())))
    return tuple(found)
