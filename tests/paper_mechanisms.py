"""The papers' devices written as mechanism files."""

from __future__ import annotations

import numpy as np
from mechanism_files import HEAD, dm, number, place, vector

from ctrlgen.physics import meso_hexapod_kinematics as meso


def rrr_text(device) -> str:
    """S3's 3-RRR stage: two links an arm, three hinges an arm, the arm copied by a pattern."""
    p, g = device.values(), device.values().lengths
    R3 = p.hinge3.R
    centre = np.array([g.l1 - g.l6, g.l4])  # of the platform, seen from Point 1
    point_3 = np.array([g.l1, g.l4 - g.l3])
    point_2 = point_3 - [0, 2 * R3 + g.l2]
    lines = [
        HEAD,
        f'[[material]]\nname = "sheet"\nyoung = {number(p.material.young, "Pa")}\npoisson = "{p.material.poisson!r}"\n',
        '[[pattern]]\nname = "arm"\ntimes = 3\nangles = ["0 deg", "-120 deg", "120 deg"]\n',
        '[[body]]\nname = "platform"\n',
    ]
    lines += [f'[[body]]\nname = "{name}"\npattern = "arm"\n' for name in ("lower", "upper")]
    for name, first, second, point, along in (
        ("hinge1", "ground", "lower", np.zeros(2), (1, 0, 0)),
        ("hinge2", "lower", "upper", point_2, (0, 1, 0)),
        ("hinge3", "upper", "platform", point_3, (0, 1, 0)),
    ):
        hinge, across = device.hinges[name], (0, 1, 0) if along[0] else (-1, 0, 0)
        equations = ", ".join(f'{key} = "{group}"' for key, group in hinge.equations.items())
        shear = "" if hinge.shear_factor is None else f', shear_factor = "{hinge.shear_factor.si!r}"'
        lines.append(
            f'[[element]]\nkind = "hinge"\nname = "{name}"\npattern = "arm"\nfrom = "{first}"\nto = "{second}"\nmaterial = "sheet"\n'
            f"at = {place([*(point - centre), 0.0])}\nalong = {vector(along)}\nacross = {vector(across)}\n"
            f'hinge = {{ kind = "circular", R = {number(hinge.R.si, "m")}, t = {number(hinge.t.si, "m")}, '
            f'b = {number(p.material.width, "m")}, equation = {{ {equations} }}, outside = "{hinge.outside}"{shear} }}\n'
        )
    lines.append(
        f'[[actuator]]\nname = "stack"\npattern = "arm"\nkind = "force"\non = "lower"\n'
        f"at = {place([*(np.array([g.l5, 0]) - centre), 0.0])}\n"
        'along = [0, -1, 0]\ngain = "1 N/V"\nlow = "0 V"\nhigh = "150 V"\ntravel = "50 um"\n'
    )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\nchannels = ["delta_x", "delta_y", "theta_z"]\n'
    )
    return "\n".join(lines)


def meso_hexapod_text(device) -> str:
    """S0's hexapod: three stages moved by two actuators each, six struts that hold their length alone (1e-12 of it across)."""
    p = device.values()
    h, directions = p.hexapod, p.directions.jacobian
    A, B = (dm(points) for points in meso.geometry(h))
    lines = [HEAD, '[[body]]\nname = "platform"\n']
    along, across, turning = 1e-6, 1e6, 1e6  # m/N and rad/(N m)

    def entries(axial):
        return (
            f'theta_x_per_M_x = "{turning} rad/(N*m)"\ntheta_y_per_M_y = "{turning} rad/(N*m)"\ntheta_z_per_M_z = "{turning} rad/(N*m)"\n'
            f'delta_x_per_F_x = "{axial} m/N"\ndelta_y_per_F_y = "{across} m/N"\ndelta_z_per_F_z = "{across} m/N"\n'
        )

    for j in range(3):
        lines.append(f'[[body]]\nname = "stage{j + 1}"\n')
        stiff = np.diag([1e-9] * 6)[:, [3, 4, 5, 0, 1, 2]]
        rows = ", ".join(vector(row) for row in stiff)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "xy{j + 1}"\nfrom = "ground"\nto = "stage{j + 1}"\nat = ["0 m", "0 m", "0 m"]\n'
            f"compliance_si = [{rows}]\n"
        )
    for i in range(6):
        span = A[:, i] - B[:, i]
        lines.append(
            f'[[element]]\nkind = "compliance"\nname = "strut{i + 1}"\nfrom = "stage{meso.STAGE_OF_STRUT[i] + 1}"\nto = "platform"\n'
            f"at = {place(A[:, i])}\nalong = {vector(span)}\nacross = [0, 0, 1]\n{entries(along)}"
        )
    for i, (axis, angle) in enumerate(zip(device.axes, directions, strict=True)):
        lines.append(
            f'[[actuator]]\nname = "a{axis}"\nkind = "displacement"\non = "xy{meso.STAGE_OF_ACTUATOR[i] + 1}"\n'
            f'along = {vector([np.cos(angle), np.sin(angle), 0.0])}\ngain = "1 um/V"\nlow = "-50 V"\nhigh = "50 V"\ntravel = "50 um"\n'
        )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\n'
        'channels = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]\n'
    )
    return "\n".join(lines)
