"""Simulators of laws of an axis, which know a law by its definition and not by its expression, and the numbers they plant.

Ramps, plays by the hundred, forces in steps of a tenth of a sample; each is drive [V] and time [s] -> reading [m].
"""

from __future__ import annotations

import numpy as np
from axis_records import AXIS, KF, H, K, move
from recovery import Planted
from scipy.linalg import expm
from scipy.stats import norm


def given(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A drive to fit and one to hold out [V]."""
    t = H * np.arange(n)
    fit = 1.5 * np.sin(2 * np.pi * 2.3 * t) + 0.3 * np.sin(2 * np.pi * 13.1 * t + 1) + 0.2 * np.sin(2 * np.pi * 41 * t)
    return fit, 1.3 * np.sin(2 * np.pi * 1.7 * t)


def asymmetric_gain(u, t):
    return move(np.where(u > 0, 1.03 * u, 0.97 * u))


def reversed(u, t):
    return move(-u)


def drive_offset(u, t):
    return move(u + 0.05)


def square_drive(u, t):
    return move(u + 0.02 * u**2)


def cubic_drive(u, t):
    return move(u - 0.012 * u**3)


def stiffness_drift(u, t):
    """Softer by 4 % a second, in the middle of each tenth of a sample."""
    return move(u, lambda now, q, v, memory: (0.04 * (t[0] + now + H / 20) * K * (q + v * H / 20), memory))


def slew_rate(u, t):
    """12 V/s, as steps to the middle of each tenth of a sample."""
    half = 12 * H / 20

    def behind(now, q, v, out):
        wanted = u[int(now / H + 1e-6)]
        middle = out + np.clip(wanted - out, -half, half)
        return KF * (middle - wanted), middle + np.clip(wanted - middle, -half, half)

    return move(u, behind)


def asymmetric_slew_rate(u, t):
    """12 V/s up and 20 V/s down, as steps to the middle of each tenth of a sample."""

    def behind(now, q, v, out):
        wanted = u[int(now / H + 1e-6)]
        middle = out + np.clip(wanted - out, -20 * H / 20, 12 * H / 20)
        return KF * (middle - wanted), middle + np.clip(wanted - middle, -20 * H / 20, 12 * H / 20)

    return move(u, behind)


def back_emf(u, t):
    """A coil of 4 Ohm and 12 mH that gives 40 N/A, and so takes 40 V*s/m, in exact steps of a twentieth of a sample."""
    ohm, henry, per_ampere = 4.0, 12e-3, 40.0
    kept = np.exp(-ohm / henry * H / 20)

    def behind(now, q, v, ampere):
        volts = u[min(int(now / H + 1e-6), len(u) - 1)]
        end = (volts - per_ampere * v) / ohm
        middle = end + (ampere - end) * kept
        return per_ampere * middle - KF * volts, end + (middle - end) * kept

    return move(u, behind)


def amplifier_lag(u, t):
    """An amplifier of 30 Hz that rings, D = 0.5, in exact steps of a twentieth of a sample."""
    tau = 1 / (2 * np.pi * 30)
    late = np.array([[0, 1 / tau], [-1 / tau, -2 * 0.5 / tau]])
    half, whole = expm(late * H / 20), expm(late * H / 10)

    def behind(now, q, v, off):
        """`off`: what is delivered and its slope, both less what is asked for now."""
        k = int(now / H + 1e-6)
        if abs(now - k * H) < H / 20 and k:
            off = off - np.array([u[k] - u[k - 1], 0.0])
        off = np.zeros(2) - np.array([u[0], 0.0]) if k == 0 and now < H / 20 else off
        return KF * (half @ off)[0], whole @ off

    return move(u, behind)


def notch(u, t):
    """A notch of 60 Hz, D = 0.4, that takes out nine tenths: (s^2 + 0.1 2 D w s + w^2)/(s^2 + 2 D w s + w^2), in exact steps of a
    twentieth of a sample."""
    w, D = 2 * np.pi * 60, 0.4
    kept = expm(np.array([[0, 1, 0], [-(w**2), -2 * D * w, 1], [0, 0, 0]]) * H / 20)

    def behind(now, q, v, state):
        x = np.array([*(np.zeros(2) if isinstance(state, float) else state), u[min(int(now / H + 1e-6), len(u) - 1)]])
        middle = kept @ x
        return -KF * 0.9 * 2 * D * w * middle[1], (kept @ middle)[:2]

    return move(u, behind)


def one_sided_saturation(u, t):
    return move(np.maximum(u, -1.1))


def drive_quantisation(u, t):
    """Ten bits for 8 V, the levels a quarter of a step off zero."""
    return move(8 / 1024 * (np.round(u / 8 * 1024 - 0.25) + 0.25))


def soft_saturation(u, t):
    """The drive as the angle of a triangle: 2.2 V are never reached."""
    return move(2.2 * np.sin(np.arctan(u / 2.2)))


def sensor_saturation(u, t):
    y = move(u)
    return 1.5e-4 * np.sin(np.arctan(y / 1.5e-4))


def sensor_limit(u, t):
    return np.minimum(move(u), 4e-5)


def coil_heating(u, t):
    """Copper of 4 Ohm that 8 W would heat by 80 K in the end, in steps of a sample; cold at first."""
    resistance, warmth, out = 4.0, 0.0, []
    for volts in u:
        hot = resistance * (1 + 3.9e-3 * warmth)
        out.append(volts * resistance / hot)
        end = 10.0 * volts**2 / hot
        warmth = end + (warmth - end) * np.exp(-H / 0.5)
    return move(np.array(out))


def cubic_sensor(u, t):
    y = move(u)
    return y + 2e6 * y**3


def cyclic_from_home(u, t):
    """A phasor of 0.3 um that turns once in 22 um, read from where it is at home."""
    y, home = move(u), 3e-7 * np.exp(1.2j)
    return y + np.imag(home * (np.exp(2j * np.pi * y / 2.2e-5) - 1))


def high_pass(u, t):
    """A leak of 0.2 s by its answer to a step, exp(-t/tau), in place of a state: reading = sum of what each step leaves."""
    y = move(u)
    kept = np.exp(-H * np.arange(len(y)) / 0.2)
    return np.convolve(np.diff(y, prepend=0.0), kept)[: len(y)]


def warm_up(u, t):
    """A frame that a source of 1 K in the end heats with 0.7 s, in steps of a sample from the zero of the clock; 300 nm of it is read."""
    warm = 1 - np.prod([(1 - H / 0.7)] * round(t[0] / H))
    read = []
    for _ in t:
        read.append(warm)
        warm += H / 0.7 * (1 - warm)
    return move(u) + 3e-7 * np.array(read)


def rectified(u, t):
    """What is negative is cut off."""
    return np.maximum(move(u), 0)


def stitching_error(u, t):
    """With the slope of 0.4 um on 2 um in its middle."""
    y = move(u)
    return y + 4e-7 * norm.cdf(np.sqrt(2 * np.pi) * (y - 2e-5) / 2e-6)


def sensor_step(u, t):
    return move(u) + 2e-7 * np.clip((t - 1.1) / 0.02 + 0.5, 0, 1)


def vibration_per_record(u, t):
    """The mains, by a turning phasor of 0.1 um that stands at 0.4 rad when the first record begins and at 2.9 rad with the other."""
    turned = np.cumprod(np.full(len(t), np.exp(2j * np.pi * 50 * H)))
    return move(u) + np.imag(1e-7 * np.exp((2.9 if t[0] else 0.4) * 1j) * turned)


def drive_hysteresis(u, t):
    """Two hundred plays, all alike in weight, where the law has eight: its numbers count in eighths."""
    radii = 0.4 * (np.arange(200) + 0.5) / 200
    play, out = np.zeros(200), []
    for volts in u:
        play = np.clip(play, volts - radii, volts + radii)
        out.append(volts + 0.1 * (play.mean() - volts))
    return move(np.array(out))


def asymmetric_drive_hysteresis(u, t):
    """The same two hundred plays, of which the lower edge goes away from the upper one by 0.3 |u| for the widest."""
    radii = 0.4 * (np.arange(200) + 0.5) / 200
    play, out = np.zeros(200), []
    for volts in u:
        play = np.clip(play, volts - radii * (1 + 0.3 * abs(volts) / 0.4), volts + radii)
        out.append(volts + 0.1 * (play.mean() - volts))
    return move(np.array(out))


def asymmetric_hysteresis(u, t):
    """Dahl's friction of 2e4 N/m and 10 um, in the displacement warped by 0.5, in steps of a tenth of a sample."""
    L, r, a, k = AXIS.mechanics.stroke.si, 1e-5, 0.5, 2e4

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        slope = 1 + a * q / np.hypot(q, L)
        dw = slope * (q - before)
        z += dw * (1 - np.sign(dw) * z / r)
        return -k * z * slope, (z, q)

    return move(u, force)


def cogging(u, t):
    """0.1 N every 25 um, half a tenth of a sample on: in the middle of a step."""
    return move(u, lambda time, q, v, memory: (-0.1 * np.sin(2 * np.pi * (q + v * H / 20) / 2.5e-5 + 0.7), memory))


def cogging_from_home(u, t):
    """0.1 N every 25 um, in the middle of a step, of a stage that rests at the zero of its reading."""

    def force(time, q, v, memory):
        return -0.1 * (np.sin(2 * np.pi * (q + v * H / 20) / 2.5e-5 + 0.7) - np.sin(0.7)), memory

    return move(u, force)


def force_factor(u, t):
    """10 % less of the force at 50 um from 1e-5 m, in the middle of a step."""

    def force(time, q, v, memory):
        return -KF * u[min(int(time / H + 1e-6), len(u) - 1)] * 0.1 * ((q + v * H / 20 - 1e-5) / 5e-5) ** 2, memory

    return move(u, force)


def one_sided_stiffening(u, t):
    """2e8 N/m^2 beside a stiffness of 2e5 N/m: 10 % more of it at 100 um on the one side, less on the other."""
    return move(u, lambda time, q, v, memory: (-2e8 * (q + v * H / 20) ** 2, memory))  # in the middle of a step


def butterfly(u, t):
    """All of it, beside a tenth less of the drive, by the square of the polarisation of two hundred plays."""
    radii, limit = 0.4 * (np.arange(200) + 0.5) / 200, AXIS.actuator.drive_limit.si
    play, out = np.zeros(200), []
    for volts in u:
        play = np.clip(play, volts - radii, volts + radii)
        out.append(0.9 * volts + play.mean() ** 2 / limit)
    return move(np.array(out))


def directional_friction(u, t):
    """0.9 N forward and 0.5 N backward, built up over 3 um, in steps of a tenth of a sample."""

    def force(time, q, v, memory):
        z, way = memory or (0.0, 0.0)
        step = v * H / 10
        z, way = z + (step - abs(step) * z) / 3e-6, way + abs(step)
        return -0.7 * z - 0.2 * (1 - np.exp(-way / 3e-6)), (z, way)

    return move(u, force)


def eddy_current_brake(u, t):
    """Of 0.021 N at most, at 0.7 mm/s, by the field: that of the currents stands across that of the poles and turns it."""

    def force(time, q, v, before):
        middle = v + (v - before) / 2  # of a step
        away = np.arctan2(abs(middle), 7e-4)  # by which it is turned
        return -0.042 * np.sin(away) * np.cos(away) * np.sign(middle), v

    return move(u, force)


def bouc_wen(u, t):
    """F = -k z, dz = dd (1 - (beta sgn(dd z) + gamma)|z|), beta = 8e4/m, gamma = 2e4/m, in steps of a tenth of a sample."""

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        step = q - before
        z += step * (1 - (8e4 * np.sign(step * z) + 2e4) * abs(z))
        return -2e4 * z, (z, q)

    return move(u, force)


def slack_friction(u, t):
    """Eight sliders that yield at 1/36 ... 8/36 of 0.8 N after 1 ... 8 um, each behind a slack of 20 um, in steps of a tenth of a
    sample: a slider is dragged while its spring would carry more than it holds."""
    yields, half = 1e-6 * np.arange(1, 9), 1e-5
    slider = np.zeros(8)

    def force(time, q, v, memory):
        gap = q - slider
        bent = np.sign(gap) * np.maximum(np.abs(gap) - half, 0)
        dragged = np.abs(bent) > yields
        slider[dragged] += (bent - np.sign(bent) * yields)[dragged]
        bent = np.clip(bent, -yields, yields)
        return -0.8 * bent.sum() / yields.sum(), memory

    return move(u, force)


ON_AXIS = {
    asymmetric_gain: Planted("actuator:axis", {"gain": 0.03}),
    reversed: Planted("actuator:axis", {}),
    drive_offset: Planted("actuator:axis", {"offset": 0.05}),
    square_drive: Planted("actuator:axis", {"curvature": 0.02}),
    cubic_drive: Planted("actuator:axis", {"curvature": -0.012}),
    stiffness_drift: Planted("stage:axis", {"rate": 0.04}, within={"rate": 0.02}),
    amplifier_lag: Planted("actuator:axis", {"share": 1.0, "tau": 1 / (2 * np.pi * 30), "damping": 0.5}),
    notch: Planted("actuator:axis", {"share": 0.9, "tau": 1 / (2 * np.pi * 60), "damping": 0.4}),
    one_sided_saturation: Planted("actuator:axis", {"level": -1.1}),
    drive_quantisation: Planted("actuator:axis", {"quantum": 8 / 1024, "grid": 0.25}, within={"grid": 0.02}),
    soft_saturation: Planted("actuator:axis", {"level": 2.2, "sharpness": 2.0}),
    sensor_saturation: Planted("sensor:axis", {"level": 1.5e-4, "sharpness": 2.0}),
    sensor_limit: Planted("sensor:axis", {"level": 4e-5}),
    slew_rate: Planted("actuator:axis", {"rate": 12.0}),
    asymmetric_slew_rate: Planted("actuator:axis", {"rate": 12.0, "excess": -2 / 3}),
    back_emf: Planted("actuator:axis", {"emf": 40.0, "tau": 3e-3}, within={"emf": 0.03, "tau": 0.03}),
    coil_heating: Planted("actuator:axis", {"rise": 3.9e-3 * 10 / 4, "tau": 0.5}, within={"rise": 0.05, "tau": 0.05}),
    cubic_sensor: Planted("sensor:axis", {"curvature": 2e6}),
    warm_up: Planted("sensor:axis", {"size": 3e-7, "tau": 0.7}, within={"size": 0.05, "tau": 0.05}),
    cyclic_from_home: Planted("sensor:axis", {"amplitude": 3e-7, "period": 2.2e-5, "phase": 1.2}),
    high_pass: Planted("sensor:axis", {"share": 1.0, "tau": 0.2}),
    stitching_error: Planted("sensor:axis", {"offset": 4e-7, "position": 2e-5, "width": 2e-6}, within={"width": 0.1}),
    vibration_per_record: Planted("disturbance:axis", {"amplitude": 1e-7, "frequency": 50.0}),
    sensor_step: Planted("disturbance:axis", {"offset": 2e-7, "moment": 1.1, "rise": 0.02}, within={"rise": 0.1}),
    butterfly: Planted(
        "actuator:axis", {"share": 1.0, "linear": 0.1, "reach": 0.4}, within={"share": 0.1, "linear": 0.2, "reach": 0.1}
    ),
    directional_friction: Planted(
        "stage:axis", {"force": 0.7, "skew": 2 / 7, "reach": 3e-6}, within={"force": 0.02, "skew": 0.05, "reach": 0.05}
    ),
    force_factor: Planted("stage:axis", {"fall": 0.1 / 5e-5**2, "centre": 1e-5}, within={"fall": 0.02, "centre": 0.02}),
    one_sided_stiffening: Planted("stage:axis", {"k2": 2e8}, within={"k2": 0.02}),
    slack_friction: Planted(
        "stage:axis", {"force": 0.8, "slack": 2e-5, "reach": 8e-6}, within={"force": 0.02, "slack": 0.02, "reach": 0.05}
    ),
    drive_hysteresis: Planted("actuator:axis", {"share": 0.1, "reach": 0.4}, within={"share": 0.1, "reach": 0.1}),
    asymmetric_drive_hysteresis: Planted(
        "actuator:axis",
        {"share": 0.1, "reach": 0.4, "lower": 0.3},
        within={"share": 0.15, "reach": 0.15, "lower": 0.15},
    ),
    eddy_current_brake: Planted(
        "stage:axis", {"damping": 0.042 / 7e-4, "speed": 7e-4}, within={"damping": 0.02, "speed": 0.02}
    ),
    rectified: Planted("sensor:axis", {"share": 0.5}),
    cogging_from_home: Planted("stage:axis", {"force": 0.1, "period": 2.5e-5, "phase": 0.7}, within={"force": 0.02}),
    cogging: Planted("stage:axis", {"force": 0.1, "period": 2.5e-5}, within={"force": 0.02}),
    bouc_wen: Planted(
        "stage:axis",
        {"stiffness": 2e4, "reach": 1e-5, "loop": 0.8},
        within={"stiffness": 0.03, "reach": 0.03, "loop": 0.05},
    ),
    asymmetric_hysteresis: Planted(
        "stage:axis",
        {"stiffness": 2e4, "reach": 1e-5, "skew": 0.5},
        within={"stiffness": 0.03, "reach": 0.03, "skew": 0.1},
    ),
}
