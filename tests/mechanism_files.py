"""Mechanism files of several tests, and what reads them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen import load_device
from ctrlgen.physics import hexapod, xy_stage

HEAD = 'kind = "mechanism"\nname = "m"\ntitle = "t"\nsource = "a test"\n'


SILICON = '[[material]]\nname = "silicon"\nyoung = "130 GPa"\npoisson = "0.28"\n'


def number(x: float, unit: str) -> str:
    return f'"{float(x)!r} {unit}"'


def place(point) -> str:
    return f"[{', '.join(number(v, 'm') for v in np.ravel(point))}]"


def vector(v) -> str:
    return f"[{', '.join(repr(float(x)) for x in np.ravel(v))}]"


def dm(matrix) -> np.ndarray:
    return ca.DM(ca.evalf(ca.SX(matrix))).full()


def loaded(folder, text: str):
    (folder / "device.toml").write_text(text)
    return load_device(folder / "device.toml")


def with_values(device):
    return device, device.values()


def blade(name: str, x: float) -> str:
    return f"""[[element]]
kind = "blade"
slender = true
name = "{name}"
from = "ground"
to = "stage"
at = ["{x} mm", "0 mm", "0 mm"]
along = [0, 1, 0]
across = [-1, 0, 0]
length = "20 mm"
thickness = "0.2 mm"
width = "8 mm"
material = "silicon"
"""


def pushed(body: str, name: str, at: str, gain: str, ends: tuple[str, str], travel: str) -> str:
    """A force along x on a body, at a place along y, and delta_x as output."""
    return f"""[[actuator]]
name = "{name}"
kind = "force"
on = "{body}"
at = ["0 mm", "{at}", "0 mm"]
along = [1, 0, 0]
gain = "{gain}"
low = "{ends[0]}"
high = "{ends[1]}"
travel = "{travel}"
[output]
body = "{body}"
at = ["0 mm", "0 mm", "0 mm"]
channels = ["delta_x"]
"""


PARALLELOGRAM = f"""{HEAD}{SILICON.replace('poisson = "0.28"', 'poisson = "0.28"' + chr(10) + 'stress_limit = "300 MPa"')}
[[body]]
name = "stage"
{blade("left", -10)}{blade("right", 10)}{pushed("stage", "coil", "-10 mm", gain="2 N/A", ends=("-1 A", "1 A"), travel="300 um")}"""


REST = pushed("plate", "push", "0 mm", gain="1 N/V", ends=("0 V", "1 V"), travel="50 um")


SPRING = """[[element]]
kind = "compliance"
name = "{name}"
from = "{first}"
to = "{to}"
at = ["{x} mm", "0 mm", "0 mm"]
theta_x_per_M_x = "1 rad/(N*m)"
theta_y_per_M_y = "1 rad/(N*m)"
theta_z_per_M_z = "1 rad/(N*m)"
delta_x_per_F_x = "{c} um/N"
delta_y_per_F_y = "10 um/N"
delta_z_per_F_z = "10 um/N"
"""


TWO_BODIES = f"""{HEAD}[[body]]
name = "a"
[[body]]
name = "b"
{SPRING.format(name="k_a", first="ground", to="a", x=0, c=0.5)}{SPRING.format(name="k_b", first="a", to="b", x=10, c=0.2)}"""


HINGE = """[[element]]
kind = "hinge"
name = "{name}"
from = "{first}"
to = "{to}"
at = ["{x} mm", "0 mm", "0 mm"]
along = [{along}]
hinge = {{ kind = "circular", R = "2 mm", t = "0.3 mm", b = "8 mm", equation = "paros_weisbord", outside = "accept" }}
rotation_limit = "{limit} deg"
material = "silicon"
"""


def hinged(limit: float) -> str:
    """An arm 30 mm long on one hinge, pushed across its end."""
    push = REST.replace(
        'at = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]', 'at = ["32 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]', 1
    )
    push = push.replace(
        'at = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]',
        'at = ["32 mm", "0 mm", "0 mm"]\nchannels = ["delta_y"]',
    )
    push = push.replace('travel = "50 um"', 'travel = "2 mm"')
    silicon = SILICON.replace('poisson = "0.28"', 'poisson = "0.28"\nstress_limit = "300 MPa"')
    hinge = HINGE.format(name="notch", first="ground", to="plate", x=2, along="1, 0, 0", limit=limit)
    return HEAD + silicon + '[[body]]\nname = "plate"\n' + hinge + push


def spring(numbers: str, first: str = "ground", to: str = "stage", at: str = "0", name: str = "extra") -> str:
    return f'[[element]]\nkind = "spring"\nname = "{name}"\nfrom = "{first}"\nto = "{to}"\nat = ["0 mm", "{at} mm", "0 mm"]\n{numbers}\n'


def chain(cubic: str, travel: str = "50 um") -> str:
    """Ground - k_a - body a - k_b - body b, which is pushed; a cubic spring from the ground to a, which no actuator holds."""
    push = (
        '[[actuator]]\nname = "stack"\nkind = "force"\non = "b"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
        f'gain = "1 N/V"\nlow = "-900 V"\nhigh = "900 V"\ntravel = "{travel}"\n'
        '[output]\nbody = "a"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'
    )
    return TWO_BODIES + spring(cubic, to="a") + push


def mems_hexapod_text(device) -> str:
    """S1's hexapod: three stages of [C^XY] whose strokes are prescribed, six struts, the platform."""
    p = device.values()
    h, g = p.hexapod, hexapod.geometry(p.hexapod)
    C = ca.DM(xy_stage.stage_compliance(p.stage, p.actuator)).full()
    lines = [HEAD, f'[[material]]\nname = "tungsten"\nyoung = {number(h.young, "Pa")}\npoisson = "{h.poisson}"\n']
    lines += [f'[[body]]\nname = "{name}"\n' for name in ("platform", "stage1", "stage2", "stage3")]
    for j in range(3):
        R = dm(g.rotation[j])
        rows = ", ".join(vector(row) for row in C)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "xy{j + 1}"\nfrom = "ground"\nto = "stage{j + 1}"\nat = {place(dm(g.centre[j]))}\n'
            f"along = {vector(R[:, 0])}\nacross = {vector(R[:, 1])}\ncompliance_si = [{rows}]\n"
        )
    for i in range(6):
        span = dm(g.platform[i] - g.base[i]).ravel()
        lines.append(
            f'[[element]]\nkind = "strut"\nname = "strut{i + 1}"\nslender = true\n'
            f'from = "stage{hexapod.STAGE_OF_STRUT[i] + 1}"\nto = "platform"\n'
            f"at = {place(dm(g.platform[i]))}\nalong = {vector(span)}\nacross = [0, 0, 1]\nlength = {number(np.linalg.norm(span), 'm')}\n"
            f"wire_length = {number(h.wire_length, 'm')}\nwire_diameter = {number(h.wire_diameter, 'm')}\n"
            f'rod_diameter = {number(h.rod_diameter, "m")}\nmaterial = "tungsten"\n'
        )
    for j in range(3):
        for c, axis in enumerate("XY"):
            lines.append(
                f'[[actuator]]\nname = "a{j + 1}{axis}"\nkind = "displacement"\non = "xy{j + 1}"\n'
                f"along = {vector(dm(g.rotation[j])[:, c])}\n"
                'gain = "1 um/V"\nlow = "0 V"\nhigh = "50 V"\ntravel = "50 um"\n'
            )
    lines.append(
        '[output]\nbody = "platform"\nat = ["0 m", "0 m", "0 m"]\n'
        'channels = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]\n'
    )
    return "\n".join(lines)
