"""Tip-tilt platform on four piezo stacks at the corners of a square: four drives for three axes.

Four stacks of stiffness k and gain g stand at the corners (+-r, +-r) under a rigid plate and push it up. With the heights z of its middle
and t_x = r theta_x, t_y = r theta_y of its sides over it, corner i is at z + y_i t_x - x_i t_y, x_i and y_i = +-1. In balance

    g sum u_i = 4 k z,   g sum u_i y_i = 4 k t_x,   -g sum u_i x_i = 4 k t_y,

and the drives (+1, -1, +1, -1) round the square push nothing: they twist the plate, which does not yield. Near an end of the stroke
they let the platform tilt farther than the pseudo-inverse of the three equations does.
"""

import casadi as ca

import ctrlgen

X, Y = ca.DM([1, -1, -1, 1]), ca.DM([1, 1, -1, -1])  # corners, in half sides, round the square
STACKS = ("ne", "nw", "sw", "se")

device = ctrlgen.user_device(
    "tilt_platform",
    title="tip-tilt platform on four piezo stacks",
    source="an example of our own: stacks of 15 um, 600 N at 150 V and amplifiers of a catalogue",
    parameters={
        "gain": {"value": "4 N/V", "sd": "0.05 N/V", "source": "600 N blocked at 150 V, catalogue"},
        "stiffness": {"value": "40 N/um", "sd": "1 N/um", "source": "catalogue"},
        "half_side": {"value": "20 mm", "source": "drawing"},
    },
    drive={name: ("0 V", "150 V") for name in STACKS},
    drive_rate=dict.fromkeys(STACKS, "20 V/ms"),  # 0.15 A of an amplifier into 7.5 uF
    axes={"tilt_x": "8 um", "tilt_y": "8 um", "lift": ("-1 um", "15 um")},
    force=lambda u, p: [p.gain * ca.dot(Y, u.vector), -p.gain * ca.dot(X, u.vector), p.gain * ca.sum1(u.vector)],
    restoring_force=lambda d, p: 4 * p.stiffness * d.vector,
    reading={"theta_x": "0.4 mrad", "theta_y": "0.4 mrad", "delta_z": "15 um"},
    pose=lambda d, p: [d.tilt_x / p.half_side, d.tilt_y / p.half_side, d.lift],
)
