"""The Jacobian of a device from settled poses: all its numbers, or the few by which the described one can differ. Source: S0 section 4.

With all numbers, T_j = J U_j + T_0 + e_j is fitted channel by channel (`ctrlgen.recordings.calibration`). With few, from the
device's own J_0,

    J = S Ad(R(rho), d) J_0 diag(g),   S = diag(s, s, s, 1, 1, 1)

g: gain and sense of each drive; rho, d: turn of the frame in which poses are read and the place of the point that is read; s: turns per
length, which is 1/size of the device. Records with the role fit are fitted, those held out say how well J holds.

T_j are the poses that readings imply under the sensor laws of the device file. Returns to home are no poses of their own: they are one
pose, read again. They tell drift, which is taken out where its interval leaves zero out, and repeatability; their mean is one row at zero
drive. As many rows they would make the errors of J as small as home is repeatable, whatever the other poses leave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from ctrlgen.calibration.home_returns import HomeReturns, at_home, home_returns
from ctrlgen.calibration.instrument_share import InstrumentShare, instrument_shares
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices import Device, load_device
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import build_model
from ctrlgen.model.read_poses import ReadPoses
from ctrlgen.physics.screw import adjoint, rotation_vector
from ctrlgen.recordings.calibration import calibrate_jacobian
from ctrlgen.recordings.plausibility import with_plausibility
from ctrlgen.recordings.pose_errors import CHANNELS, PoseErrors
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Record, Recording
from ctrlgen.trajectory.scenario import Input, device_inputs

READINGS = tuple(f"reading.{channel}" for channel in CHANNELS)


class JacobianNumbers(Enum):
    """Which numbers are fitted."""

    ALL = "all"
    """Every entry of the Jacobian."""
    FEW = "few"
    """Gains of the drives, frame and point of the readings, turns per length."""


@dataclass(frozen=True)
class FittedNumber:
    """One of the few numbers: its `name`, `value` and standard deviation `sd` in the `unit` written."""

    name: str
    unit: str
    value: float
    sd: float


@dataclass(frozen=True)
class MeasuredJacobian:
    """A calibrated Jacobian, SI: `jacobian` (channels, drives) with `sd`, and the pose `offset` (channels,) read at zero drive.

    `few`: what was fitted instead of all entries, empty otherwise. `before` and `after`: errors of the described device and with the
    Jacobian, over all poses in order, home left out; `held_out` (n,) True where a pose was not fitted. `condition`: of the fitted drives.
    `home`: of the returns to it, None where there are fewer than three. `instruments`: what these may feign.
    """

    device: Device
    inputs: dict[str, Input]
    recording: Recording
    jacobian: np.ndarray
    sd: np.ndarray
    offset: np.ndarray
    few: tuple[FittedNumber, ...]
    before: PoseErrors
    after: PoseErrors
    held_out: np.ndarray
    condition: float
    home: HomeReturns | None
    instruments: tuple[InstrumentShare, ...]

    @property
    def numbers(self) -> int:
        """How many numbers were fitted, the offset's included."""
        return (len(self.few) or self.jacobian.size) + len(self.offset)


def calibrate_poses(
    device: Path | str, recordings: Path | str | Sequence[Path | str], numbers: JacobianNumbers = JacobianNumbers.ALL
) -> MeasuredJacobian:
    """The Jacobian of the specimen whose settled poses `recordings` hold; `device` is the file that describes it.

    Raises InputError for a device of more than six drives, recordings that are no poses of six components, or poses that leave a
    combination of drives unmoved.
    """
    described = load_device(device)
    model = build_model(described)
    if (drives := len(model.signals["drive"].channels)) > len(CHANNELS):
        what = f"has {drives} drives, more than a pose has components: a Jacobian is calibrated for {len(CHANNELS)} or fewer"
        raise InputError(device, [Fault("drive", what)])
    recording = with_plausibility(load_recordings(recordings, model), model)
    if recording.kind != "poses" or set(recording.channels) != set(READINGS):
        what = f'must be settled poses (kind = "poses") of {", ".join(CHANNELS)}; a Jacobian is calibrated from these'
        raise InputError(recording.title, [Fault("recording", what)])
    taken = _poses_of(described, recording)
    fitted = ~taken.held_out
    drive, poses = (
        np.vstack([x[fitted], at_zero])
        for x, at_zero in ((taken.drive, taken.drive_at_home), (taken.pose, taken.pose_at_home))
    )
    every = calibrate_jacobian(drive, poses, offset=True)
    jacobian, sd, offset = every.jacobian, every.sd, every.offset
    few: tuple[FittedNumber, ...] = ()
    if numbers is JacobianNumbers.FEW:
        described_jacobian = np.linalg.lstsq(taken.drive, taken.expected, rcond=None)[0].T
        jacobian, sd, offset, few = _few(described, described_jacobian, drive, poses)
    if sd is None or offset is None:
        raise InputError(recording.title, [Fault("poses", "are as many as unknowns; record one more to judge them by")])
    return MeasuredJacobian(
        described,
        device_inputs(Path(device)),
        recording,
        jacobian,
        sd,
        offset,
        few,
        PoseErrors(taken.pose - taken.expected),
        PoseErrors(taken.pose - taken.drive @ jacobian.T - offset),
        taken.held_out,
        every.condition,
        taken.home,
        instrument_shares(described, taken.instruments, drive, poses),
    )


@dataclass(frozen=True)
class _Poses:
    """What a recording holds: of the poses away from home `drive` (n, n_u), implied `pose` and `expected` one (n, 6), and which are
    `held_out`; at home one row of zeros and the mean pose, or none."""

    drive: np.ndarray
    pose: np.ndarray
    expected: np.ndarray
    held_out: np.ndarray
    drive_at_home: np.ndarray
    pose_at_home: np.ndarray
    home: HomeReturns | None
    instruments: ReadPoses


def _poses_of(device: Device, recording: Recording) -> _Poses:
    """Every pose of the records, drift taken out. Raises InputError where a pose lacks a reading."""
    fitter = Fitter(recording, estimate_noise(recording, 0.0))
    nominal, instruments = fitter.fit(Structure(device), steps=0), ReadPoses(device)
    in_order = [recording.channels.index(reading) for reading in READINGS]
    parts, order = list[tuple[np.ndarray, ...]](), np.zeros(0)
    for record in recording.records:
        read = record.valid.any(axis=1)  # the others belong to another part of a divided record
        at = record.time[read]
        order = np.append(order, at if not np.isin(at, order).any() else at - at.min() + order.max() + 1)
        roles = np.full(read.sum(), record.role)
        readings = (_complete(record)[read][:, in_order], fitter.predict(nominal, record)[read][:, in_order])
        parts.append((record.drive[read], *readings, roles))
    drive, read, expected = (np.vstack(part) for part in list(zip(*parts, strict=True))[:3])
    role = np.concatenate([part[3] for part in parts])
    pose, still = instruments.poses(read), at_home(drive)
    home = home_returns(order[still], pose[still])
    if home is not None:
        pose = pose - home.drifted(order)
    mean = pose[still].mean(axis=0, keepdims=True) if still.any() else np.zeros((0, pose.shape[1]))
    away = ~still & (role != "rest")
    return _Poses(
        drive[away],
        pose[away],
        instruments.poses(expected)[away],
        role[away] == "hold_out",
        np.zeros((len(mean), drive.shape[1])),
        mean,
        home,
        instruments,
    )


def _complete(record: Record) -> np.ndarray:
    """The readings of a record. Raises InputError where a pose lacks one of them."""
    lacking = np.flatnonzero(~record.valid.all(axis=1) & record.valid.any(axis=1))
    if lacking.size:
        raise InputError(record.name, [Fault(f"pose {lacking[0] + 1}", "lacks a reading; remove the pose")])
    return record.observed


def _few(
    device: Device, J_0: np.ndarray, U: np.ndarray, T: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple[FittedNumber, ...]]:
    """J, the sd of its entries, the offset, and the few numbers, each channel as noisy as a fit of all entries leaves it."""
    names = build_model(device).signals["drive"].channels
    k = len(names)
    noise = calibrate_jacobian(U, T, offset=True).noise
    weight = 1 / np.sqrt(np.diag(noise)) if noise is not None else np.repeat([1e5, 1e6], 3)
    x = ca.SX.sym("x", k + 13)
    gains, turn, place, size, home = ca.vertsplit(x, [0, k, k + 3, k + 6, k + 7, k + 13])
    scale = ca.vertcat(*[1 + size] * 3, 1, 1, 1)
    J = ca.mtimes([ca.diag(scale), adjoint(rotation_vector(turn), place), ca.DM(J_0), ca.diag(gains)])
    residual = ca.vec(
        (ca.mtimes(J, ca.DM(U.T)) + ca.repmat(home, 1, len(U)) - ca.DM(T.T)) * ca.repmat(ca.DM(weight), 1, len(U))
    )
    evaluate = ca.Function("residual", [x], [residual, ca.jacobian(residual, x)])
    entries = ca.Function("entries", [x], [J, ca.jacobian(ca.vec(J.T), x)])
    design = np.vstack([np.kron(u, np.ones((6, 1))) * J_0 * weight[:, None] for u in U])
    start = np.concatenate([np.linalg.lstsq(design, (T * weight).ravel(), rcond=None)[0], np.zeros(13)])
    found = least_squares(
        lambda v: evaluate(v)[0].full().ravel(), start, jac=lambda v: evaluate(v)[1].full(), x_scale="jac", method="trf"
    )
    spread = float(found.fun @ found.fun) / (found.fun.size - found.x.size)
    covariance = spread * np.linalg.pinv(found.jac.T @ found.jac)
    value, slopes = (m.full() for m in entries(found.x))
    sd = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes)).reshape(value.shape)
    deviations = np.sqrt(np.diag(covariance))
    units = [("1", 1.0)] * k + [("deg", 180 / np.pi)] * 3 + [("mm", 1e3)] * 3 + [("1", 1.0)]
    told = [f"gain of {name}" for name in names]
    told += [f"turn of the frame about {axis}" for axis in "xyz"] + [f"place of the point, {axis}" for axis in "xyz"]
    values = [*found.x[: k + 6], 1 + found.x[k + 6]]
    few = tuple(
        FittedNumber(name, unit, factor * v, factor * s)
        for name, (unit, factor), v, s in zip(
            [*told, "turns per length"], units, values, deviations[: k + 7], strict=True
        )
    )
    return value, sd, found.x[k + 7 :], few
