"""Simulators of laws of settled poses, which know a law by its definition and not by its expression, and the numbers they plant.

Exact rotations, plays by the hundred, steps from pose to pose; on S1's hexapod, assembled as one structure: heater powers [W] ->
poses (theta; delta) [rad, um], on an axis: what is asked -> what is reached.
"""

from __future__ import annotations

import numpy as np
from axis_records import H
from recovery import Planted, at
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from battery.plant_hexapod import Faults, Hexapod


def posed(change):
    """A law of the pose alone."""
    return lambda u: change(Hexapod().settled(u))


def rotated(axis, angle):
    """Components in a frame turned about an axis."""
    R = Rotation.from_rotvec(angle * np.eye(3)["xyz".index(axis)]).as_matrix()
    return posed(lambda p: np.hstack([p[:, :3] @ R.T, p[:, 3:] @ R.T]))


def along_a_screw(p):
    """The translation of exp(twist)."""
    out = p.copy()
    for row, (theta, delta) in enumerate(zip(p[:, :3], p[:, 3:], strict=True)):
        w = np.array([[0, -theta[2], theta[1]], [theta[2], 0, -theta[0]], [-theta[1], theta[0], 0]])
        twist = np.zeros((4, 4))
        twist[:3, :3], twist[:3, 3] = w, delta
        out[row, 3:] = expm(twist)[:3, 3]
    return out


def raised(p, height=20e3):
    """The second order of where a point 20 mm above goes: beyond theta x h."""
    h = np.array([0, 0, height])
    go = Rotation.from_rotvec(p[:, :3]).apply(h) - h - np.cross(p[:, :3], h)
    return np.hstack([p[:, :3], p[:, 3:] + go])


def carried(u):
    """The third stage carries the platform 2 % further than it goes."""
    plant = Hexapod()
    return plant.pose(plant.displacement(plant.temperature(u)) * (1 + at(2, 0.02)))


def losing(u):
    """Every lever bends by 5 um/N times the bar's force, S1 eq. (4)."""
    plant = Hexapod()
    a, T = plant.n.actuator, plant.temperature(u)
    F = 2 * a.beams * (a.expansion + a.expansion_slope * T) * (T - a.ambient)
    F = F * a.young * a.beam_width * a.thickness * np.sin(a.beam_angle)
    return plant.pose(plant.displacement(T) - 5.0 * F)


def cooled(u, b=2e-4):
    """Every conductance to the surroundings rises by b a kelvin: R_th P = DT (1 + b DT), solved for DT."""
    plant = Hexapod()
    rise = plant.n.actuator.thermal_resistance * plant.power(u)
    T = plant.n.actuator.ambient + (np.sqrt(1 + 4 * b * rise) - 1) / (2 * b)
    return plant.pose(plant.displacement(T))


ON_HEXAPOD = {
    "abbe_arm": (
        posed(lambda p: p + np.outer(p[:, 1] * 2e3, at(3, 1))),
        Planted("sensor:delta_x", {"arm": 2e-3}, "theta_y"),
    ),
    "link_compliance": (
        posed(lambda p: p + np.outer(p[:, 4] * 2e-5, at(0, 1))),
        Planted("mechanism:theta_x", {"tilt": 20.0}, "delta_y"),
    ),
    "frame_rotation_x": (rotated("x", 0.01), Planted("mechanism:all", {"angle": 0.01})),
    "frame_rotation_y": (rotated("y", -0.01), Planted("mechanism:all", {"angle": -0.01})),
    "screw_motion": (posed(along_a_screw), Planted("mechanism:all", {"share": 1.0})),
    "raised_point": (posed(raised), Planted("mechanism:all", {"height": 0.02})),
    "coupling": (
        lambda u: Hexapod(faults=Faults(coupling=at(2, 0.01))).settled(u),
        Planted("stage:2X", {"gain": 0.01}, "2Y"),
    ),
    "lever_ratio": (carried, Planted("stage:2X", {"gain": 0.02})),
    "lost_motion": (losing, Planted("stage:all", {"compliance": 5e-6})),
    "soft_saturation": (
        lambda u: Hexapod().settled(0.9 * np.sin(np.arctan(u / 0.9))),
        Planted("actuator:all", {"level": 0.9, "sharpness": 2.0}),
    ),
    "heat_loss": (cooled, Planted("actuator:all", {"coefficient": 2e-4, "power": 1.0})),
    "heater_resistance": (
        lambda u: Hexapod(faults=Faults(resistance=5e-5), voltage=True).settled(
            np.sqrt(u * Hexapod().n.actuator.heater_resistance)
        ),
        Planted("actuator:all", {"slope": 5e-5}),
    ),
}


def warmed(u, late=0.1, tau=0.05, dt=H / 10):
    """A tenth of every heater's power comes with another 50 ms of delay: readings a sample apart, ten steps between them."""
    fine = np.repeat(u, 10, axis=0)
    keep = np.exp(-dt / tau)
    lagged = lfilter([0, 1 - keep], [1, -keep], fine, axis=0)
    # Held through a step, of which the delayed heat has come half of the way
    lagged += (fine - lagged) * (1 - keep) / 2
    return Hexapod().series((1 - late) * fine + late * lagged, dt)[::10]


def payload(r):
    """A table that gives way by 0.002 (sin(y + 40 deg) - sin(40 deg)) where it stands then [rad]."""
    y = r.copy()
    for _ in range(50):
        y = r + 0.002 * (np.sin(y + np.radians(40)) - np.sin(np.radians(40)))
    return y


# As far as a rig that was put up by hand
FAR_OFF = {
    "abbe_arm": (
        posed(lambda p: p + np.outer(p[:, 1] * 0.4e6, at(3, 1))),
        Planted("sensor:delta_x", {"arm": 0.4}, "theta_y"),
    ),
    "frame_rotation_x": (rotated("x", 0.08), Planted("mechanism:all", {"angle": 0.08})),
}


def played(u, radius=2e-5):
    """A fifth of the way through two hundred plays, which stood at the upper end when the record began."""
    radii = radius * (np.arange(200) + 0.5) / 200
    play, out = radii.copy(), []
    for d in u:
        play = np.clip(play, d - radii, d + radii)
        out.append(0.8 * d + 0.2 * play.mean())
    return np.array(out)


def widened(u, radius=2e-5):
    """A fifth of the way through two hundred plays, whose upper edge goes away from the lower one by 0.4 |d| for the widest."""
    radii = radius * (np.arange(200) + 0.5) / 200
    play, out = np.zeros(200), []
    for d in u:
        play = np.maximum(np.minimum(play, d + radii + 0.4 * abs(d) * radii / radius), d - radii)
        out.append(0.8 * d + 0.2 * play.mean())
    return np.array(out)


def yielding(u, n=1):
    """d - z/5, dz = dd (1 - (0.8 sgn(dd z) + 0.2)|z/20 um|^n), in two hundred steps from pose to pose."""
    z, before, out = 0.0, 0.0, []
    for d in u:
        step = (d - before) / 200
        for _ in range(200):
            z += step * (1 - (0.8 * np.sign(step * z) + 0.2) * abs(z / 2e-5) ** n)
        before = d
        out.append(d - 0.2 * z)
    return np.array(out)


# Of poses one after the other: their order is the memory
IN_ORDER = {
    "displacement_hysteresis": (
        played,
        Planted("stage:axis", {"share": 0.2, "reach": 2e-5}, within={"share": 0.1, "reach": 0.1}),
    ),
    "asymmetric_displacement_hysteresis": (
        widened,
        Planted(
            "stage:axis",
            {"share": 0.2, "reach": 2e-5, "upper": 0.4},
            within={"share": 0.1, "reach": 0.15, "upper": 0.1},
        ),
    ),
    "displacement_bouc_wen": (
        yielding,
        Planted("stage:axis", {"share": 0.2, "reach": 2e-5, "loop": 0.8}, within={"loop": 0.05}),
    ),
    "displacement_bouc_wen_of_power": (
        lambda u: yielding(u, 2),
        Planted(
            "stage:axis",
            {"share": 0.2, "reach": 2e-5, "loop": 0.8, "power": 2.0},
            within={"loop": 0.05, "power": 0.03},
        ),
    ),
}
