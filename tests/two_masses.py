"""Two masses in a row, whose equations are known, as a mechanism: a mode of its bodies that its one axis does not have."""

from __future__ import annotations

import numpy as np
from mechanism_files import HEAD

M1, M2, K1, K2, ZETA = 0.2, 0.1, 2e4, 3e4, 0.01  # kg, N/m


def two_masses(more: str = "") -> str:
    """Ground, spring K1, mass M1 that is pushed, spring K2, mass M2 that is followed, along x."""
    text = HEAD
    for name, mass in (("first", M1), ("second", M2)):
        text += f'[[body]]\nname = "{name}"\nmass = "{mass} kg"\ninertia = ["90 kg*mm^2", "90 kg*mm^2", "90 kg*mm^2"]\n'
    stiff = "".join(f'theta_{x}_per_M_{x} = "1e-6 rad/(N*m)"\n' for x in "xyz")
    stiff += "".join(f'delta_{x}_per_F_{x} = "1e-6 um/N"\n' for x in "yz")
    for name, ends, k in (("a", ("ground", "first"), K1), ("b", ("first", "second"), K2)):
        text += f'[[element]]\nkind = "compliance"\nname = "{name}"\nfrom = "{ends[0]}"\nto = "{ends[1]}"\n'
        text += f'at = ["0 mm", "0 mm", "0 mm"]\n{stiff}delta_x_per_F_x = "{1 / k} m/N"\n'
    text += (
        '[[actuator]]\nname = "coil"\nkind = "force"\non = "first"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
    )
    text += 'gain = "1 N/A"\nlow = "-20 A"\nhigh = "20 A"\ntravel = "900 um"\n'
    text += '[output]\nbody = "second"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'
    return text + f'[dynamics]\ndamping_ratio = "{100 * ZETA} %"\n{more}'


MASS, STIFFNESS = np.diag([M1, M2]), np.array([[K1 + K2, -K2], [-K2, K2]])


def damping() -> np.ndarray:
    squares, V = np.linalg.eig(np.linalg.solve(MASS, STIFFNESS))
    return MASS @ V @ np.diag(2 * ZETA * np.sqrt(squares)) @ np.linalg.inv(V)
