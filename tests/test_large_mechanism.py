"""What describing a mechanism of a hundred bodies and two hundred blades costs."""

from __future__ import annotations

import time

import pytest
from mechanism_files import HEAD, loaded

from ctrlgen.devices.mechanism.mechanism_lines import summary

MOST = 8.0  # times the processor time of a quarter of the bodies: as their number to the power of 1.5. In proportion it would be 4


def towers(count: int, high: int) -> str:
    """Towers of parallelograms, joined at their tops by wires."""
    text = HEAD + '[[material]]\nname = "steel"\nyoung = "200 GPa"\npoisson = "0.3"\ndensity = "7800 kg/m^3"\n'
    element = 'along = {along}\nacross = [{across}]\nmaterial = "steel"\n'
    for c in range(count):
        for k in range(high):
            text += f'[[body]]\nname = "b_{c}_{k}"\nmass = "20 g"\ncentre = ["{60 * c} mm", "{40 * k} mm", "0 mm"]\n'
            text += 'inertia = ["2 kg*mm^2", "2 kg*mm^2", "2 kg*mm^2"]\n'
            below = f"b_{c}_{k - 1}" if k else "ground"
            for side in (-20, 20):
                text += (
                    f'[[element]]\nkind = "blade"\nname = "e_{c}_{k}_{side + 20}"\nfrom = "{below}"\nto = "b_{c}_{k}"\n'
                )
                text += f'at = ["{60 * c + side} mm", "{40 * k} mm", "0 mm"]\nlength = "35 mm"\nthickness = "0.5 mm"\nwidth = "12 mm"\n'
                text += element.format(along="[0, 1, 0]", across="1, 0, 0")
    for c in range(1, count):
        text += f'[[element]]\nkind = "wire"\nname = "w_{c}"\nfrom = "b_{c - 1}_{high - 1}"\nto = "b_{c}_{high - 1}"\n'
        text += f'at = ["{60 * c - 25} mm", "{40 * high - 40} mm", "0 mm"]\nlength = "10 mm"\ndiameter = "0.5 mm"\n'
        text += element.format(along="[1, 0, 0]", across="0, 1, 0")
    top = f"b_0_{high - 1}"
    text += (
        f'[[actuator]]\nname = "coil"\nkind = "force"\non = "{top}"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]\n'
    )
    text += 'gain = "10 N/A"\nlow = "-5 A"\nhigh = "5 A"\ntravel = "500 um"\n'
    return text + f'[output]\nbody = "{top}"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'


@pytest.mark.long
def test_four_times_the_bodies_take_little_more_than_four_times_as_long_to_describe(tmp_path):
    def described(count: int, high: int) -> tuple[float, str]:
        folder = tmp_path / f"{count}"
        folder.mkdir()
        begun = time.process_time()
        lines = summary(loaded(folder, towers(count, high)))
        return time.process_time() - begun, lines[0]

    described(2, 2)  # imports
    (quarter, few), (whole, many) = described(5, 5), described(10, 10)
    assert few == "25 bodies, 54 flexures, 1 actuator"
    assert many == "100 bodies, 209 flexures, 1 actuator"
    assert whole < MOST * quarter
