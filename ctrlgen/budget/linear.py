"""The law of propagation of uncertainty (GUM 5) along a path: deviations of the state carried from sample to sample.

X_k = A_k X_{k-1} + F_q,  Y_k = C_k X_k + H_q,  X = dS/dq, Y = dy/dq: the forward sensitivities. What scatters from sample to
sample with covariance Q_k of the drive is carried as a covariance of the state:

    P_k = A_k P_{k-1} A_k' + B_k Q_k B_k',  cov y_k = C_k A_k P_{k-1} A_k' C_k' + (C_k B_k + D_k) Q_k (C_k B_k + D_k)'.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.budget.uncertain_path import UncertainPath
from ctrlgen.budget.uncertainty import Uncertainties
from ctrlgen.model.read_poses import ReadPoses
from ctrlgen.numerics.batched_evaluation import evaluate
from ctrlgen.trajectory.playback import playback_tolerance

BLOCK = 500  # samples whose Jacobians are kept at once
OF_SENSOR = ("sensor_scale", "sensor_zero", "sensor_law")  # kinds of lines that act through no state
SIGNIFICAND = 24  # bits of a number in single precision


@dataclass(frozen=True)
class Propagated:
    """First-order deviations along a path, SI, each for the followed signal and for the limited quantities.

    `nominal` name -> (n, n_y); `sensitivity` name -> (n, n_y, m) by the columns of the uncertainties, per unit; `scatter` name ->
    what scatters from sample to sample, by its name -> (n, n_y) standard deviation. `states` (before + n, n_s) of the described device.
    """

    nominal: dict[str, np.ndarray]
    sensitivity: dict[str, np.ndarray]
    scatter: dict[str, dict[str, np.ndarray]]
    states: np.ndarray

    def combined(self, name: str, stated: Uncertainties) -> np.ndarray:
        """(n, n_y) combined standard uncertainty, GUM 5.2: u_c^2 = Y cov Y' and what scatters."""
        Y = self.sensitivity[name]
        variance = np.sum((Y @ stated.covariance) * Y, axis=2)
        return np.sqrt(np.maximum(variance, 0.0) + sum(sd**2 for sd in self.scatter[name].values()))

    def of_sensor(self, path: UncertainPath, sample: int) -> np.ndarray:
        """(m, n_y) the sensitivity of the followed signal at one sample by what is stated of the sensor, zero by all else: it acts through
        no state, so that draws are exact with it."""
        kinds = [line.kind for line in path.uncertainties.lines for _ in line.paths]
        columns = np.array([kind in OF_SENSOR for kind in kinds])
        return np.where(columns[:, None], self.sensitivity["pose"][sample].T, 0.0)


def propagate(path: UncertainPath) -> Propagated:
    """The sensitivities and the scatter of a path. Raises FloatingPointError where these are not finite."""
    S = path.nominal()
    before, n, n_s = path.before, path.n, S.shape[1]
    columns = _columns(path)
    scatters = {name: _drive_covariance(path, name) for name in scattering(path)}
    nominal = {name: path.evaluate(name, S[before:], path.drive[before:]) for name in ("pose", "limits")}
    sensitivity = {name: np.zeros((n, y.shape[1], len(columns))) for name, y in nominal.items()}
    variance = {name: {of: np.zeros(y.shape) for of in scatters} for name, y in nominal.items()}
    if path.uncertainties.player:
        for name, sd in (("pose", player_deviation(path)), ("limits", np.zeros(1))):
            variance[name]["player"] = np.zeros(nominal[name].shape) + sd**2
    X, P = np.zeros((n_s, len(columns))), {of: np.zeros((n_s, n_s)) for of in scatters}
    outputs = {name: _slopes(path, name) for name, y in nominal.items() if y.shape[1]}
    for a, b, (A, B, F_q) in _along(path, _slopes(path, "step"), np.vstack([path.start, S[:-1]])):
        measured = {name: next(_along(path, slopes, S, (a, b)))[2] for name, slopes in outputs.items() if b > before}
        for k in range(a, b):
            j, v = k - a, path.drive[k]
            X = A[j] @ X + _with_gains(F_q[j], B[j], v)[:, columns]
            carried = {of: A[j] @ P[of] @ A[j].T for of in scatters}
            if k >= before:
                for name, (C, D, H_q) in measured.items():
                    sensitivity[name][k - before] = C[j] @ X + _with_gains(H_q[j], D[j], v)[:, columns]
                    direct = C[j] @ B[j] + D[j]
                    for of, Q in scatters.items():
                        total = _diagonal(C[j], carried[of]) + _diagonal(direct, Q[k])
                        variance[name][of][k - before] = total
            P = {of: carried[of] + B[j] @ Q[k] @ B[j].T for of, Q in scatters.items()}
    _add_sensor(path, nominal["pose"], sensitivity["pose"])
    if not all(np.isfinite(Y).all() for Y in (*sensitivity.values(), *nominal.values())):
        raise FloatingPointError("the sensitivities along the path are not finite")
    # What cancels in a channel leaves a variance of rounding's sign
    scatter = {name: {of: np.sqrt(np.maximum(value, 0.0)) for of, value in by.items()} for name, by in variance.items()}
    return Propagated(nominal, sensitivity, scatter, S)


def player_deviation(path: UncertainPath) -> np.ndarray:
    """(n_y,) [SI] standard deviation a/sqrt(3) of the followed signal under drives from tables of the tolerance a (GUM 4.3.7): a bound,
    for the tables are judged by their largest error."""
    return playback_tolerance(path.signal) / np.sqrt(3)


def scattering(path: UncertainPath) -> list[str]:
    """What is stated to scatter from sample to sample of the drives."""
    stated = path.uncertainties
    present = {"converter": stated.bits is not None, "jitter": stated.jitter > 0, "arithmetic": stated.single}
    return [name for name, given in present.items() if given]


def drive_deviations(path: UncertainPath, name: str) -> tuple[np.ndarray, bool]:
    """(before + n, n_u) standard deviation [SI] of each drive, and whether it is one deviation of all channels together.

    A converter's is LSB/sqrt(12), that of rounding to single precision the same of its last digit. A change of drive that comes
    late by dt leaves out (v_k - v_{k-1}) dt/h of the mean drive of its sample, h.
    """
    v = path.drive
    if name == "converter":
        return np.tile(path.lsb() / np.sqrt(12), (len(v), 1)), False
    if name == "arithmetic":
        last = np.exp2(np.floor(np.log2(np.maximum(np.abs(v), np.finfo(np.float32).tiny))) + 1 - SIGNIFICAND)
        return last / np.sqrt(12), False
    change = np.vstack([np.zeros(v.shape[1]), np.diff(v, axis=0)])
    return change * path.uncertainties.jitter / path.sample_time, True


def _drive_covariance(path: UncertainPath, name: str) -> np.ndarray:
    """The covariance Q (before + n, n_u, n_u) of the drives' errors at each sample [SI]."""
    sd, together = drive_deviations(path, name)
    return sd[:, :, None] * sd[:, None, :] * (1.0 if together else np.eye(sd.shape[1]))


def _diagonal(C: np.ndarray, P: np.ndarray) -> np.ndarray:
    """The diagonal of C P C'."""
    return np.sum((C @ P) * C, axis=1)


def _columns(path: UncertainPath) -> np.ndarray:
    """(m,) the place of each column of the uncertainties in (q, common gain, channel gains); a number that acts on no motion has that
    of a column of zeros behind them. The gains of channels are one column a channel."""
    places = list[int]()
    for line in path.uncertainties.lines:
        if line.kind == "number":
            places += [path.free.index(p) if p in path.free else path.nothing for p in line.paths]
        elif line.kind == "surroundings":
            places.append(len(path.free))
        elif line.kind in ("gain", "channel_gain"):
            places += range(*path.gains(line.kind).indices(path.nothing))
        else:  # of the sensor, which moves nothing by itself
            places += [path.nothing] * len(line.paths)
    return np.array(places, int)


def _add_sensor(path: UncertainPath, nominal: np.ndarray, sensitivity: np.ndarray) -> None:
    """What scale, zero and laws of a sensor make of the followed signal that was brought to its readings: `sensitivity` (n, n_y, m)."""
    k = 0
    for line in path.uncertainties.lines:
        if line.kind == "sensor_law":
            read = ReadPoses(path.model.device, line.paths, pose_alone=True)
            places = [[number.path for number in read.numbers].index(name) for name in line.paths]
            sensitivity[:, :, k : k + len(places)] = read.slopes(nominal)[:, :, places]
        for name in line.paths:
            if line.kind in ("sensor_scale", "sensor_zero"):
                i = path.signal.channels.index(name)
                sensitivity[:, i, k] = nominal[:, i] if line.kind == "sensor_scale" else 1.0
            k += 1


def _with_gains(by_q: np.ndarray, by_drive: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Derivatives by q, a common gain, each channel's gain, and by nothing."""
    of_channels = by_drive * v
    return np.column_stack([by_q, of_channels.sum(axis=1), of_channels, np.zeros(len(by_q))])


def _slopes(path: UncertainPath, name: str) -> ca.Function:
    """(S, v) -> derivatives of a part of the path by S, v and q, at the described numbers."""
    if name not in path.slopes:
        path.slopes[name] = _made_slopes(path, name)
    return path.slopes[name]


def _made_slopes(path: UncertainPath, name: str) -> ca.Function:
    constants = path.constants[name]
    S, u = path.state, path.model.u
    c = ca.SX.sym("c", constants.numel_out(0))
    of_sample = path.of_sample[name]
    value = of_sample(S, u, c)
    at = constants(path.q_nominal)
    by_c = _derivatives(constants, path.q_nominal, at)
    derivatives = [ca.jacobian(value, S), ca.jacobian(value, u), ca.mtimes(ca.jacobian(value, c), by_c)]
    numbers = ca.substitute(derivatives, [c], [ca.SX(at)])
    return ca.Function(f"{name}_slopes", [S, u], [ca.densify(d) for d in numbers], {"cse": True})


def _derivatives(f: ca.Function, q: np.ndarray, value: ca.DM) -> ca.DM:
    """df/dq at one q, where f has the `value`, a direction after the other: f is long, and the formulas of its Jacobian take far longer
    to write down than to evaluate."""
    forward = f.forward(1)
    return ca.horzcat(ca.DM(f.numel_out(0), 0), *(forward(q, value, direction) for direction in np.eye(len(q))))


def _along(
    path: UncertainPath, slopes: ca.Function, S: np.ndarray, only: tuple[int, int] | None = None
) -> Iterator[tuple[int, int, list[np.ndarray]]]:
    """First and last sample of a block, and the three matrices at each of its samples."""
    for a in range(0, len(S), BLOCK) if only is None else (only[0],):
        b = min(a + BLOCK, len(S)) if only is None else only[1]
        values = evaluate(slopes.map(b - a), S[a:b], path.drive[a:b])
        yield (
            a,
            b,
            [
                value.reshape(b - a, slopes.size2_out(i), slopes.size1_out(i)).transpose(0, 2, 1)
                for i, value in enumerate(values)
            ],
        )
