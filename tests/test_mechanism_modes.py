"""Degrees of freedom and natural frequencies of mechanisms, against exact constraint and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import DEVICE
from mechanism_files import HEAD, PARALLELOGRAM, REST, SILICON, blade, dm, loaded, with_values

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.constraints import freedoms
from ctrlgen.devices.mechanism.modes import natural_frequencies


def test_the_first_natural_frequency_of_a_parallelogram_is_that_of_its_mass_on_its_blades(tmp_path):
    """sqrt(K/m)/(2 pi) of a mass that does not turn, pushed at the middle height of the blades."""
    text = PARALLELOGRAM.replace(
        '[[body]]\nname = "stage"',
        '[[body]]\nname = "stage"\nmass = "50 g"\ncentre = ["0 mm", "-10 mm", "0 mm"]\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]',
    )
    K = 24 * 130e9 * 8e-3 * 0.2e-3**3 / 12 / 20e-3**3
    modes = natural_frequencies(loaded(tmp_path, text))
    assert len(modes) == 6 and modes[0] == pytest.approx(np.sqrt(K / 0.05) / (2 * np.pi), rel=1e-9)
    assert modes[1] > 4 * modes[0]


WIRE = '[[element]]\nkind = "wire"\nslender = true\nname = "{name}"\nfrom = "ground"\nto = "plate"\nat = ["{x} mm", "{y} mm", "{z} mm"]\n'
WIRE += 'along = [{along}]\nlength = "10 mm"\ndiameter = "0.2 mm"\nmaterial = "silicon"\n'
SIX = [
    (0, 0, 0, "1, 0, 0"),
    (0, 20, 0, "1, 0, 0"),
    (0, 0, 20, "0, 1, 0"),
    (20, 0, 0, "0, 0, 1"),
    (0, 20, 0, "0, 0, 1"),
    (0, 0, 20, "1, 0, 0"),
]


@pytest.mark.parametrize(("wires", "free", "over"), [(1, 5, 0), (3, 3, 0), (6, 0, 0), (7, 0, 1)])
def test_degrees_of_freedom_are_those_of_exact_constraint(tmp_path, wires, free, over):
    """Each wire that is independent of the others takes one freedom; a seventh over-constrains."""
    text = HEAD + SILICON + '[[body]]\nname = "plate"\n'
    for k, (x, y, z, along) in enumerate([*SIX, (20, 20, 0, "0, 0, 1")][:wires]):
        text += WIRE.format(name=f"w{k}", x=x, y=y, z=z, along=along)
    assert freedoms(loaded(tmp_path, text + REST)) == (free, over)


def test_freedoms_of_known_guides(tmp_path):
    assert freedoms(loaded(tmp_path, PARALLELOGRAM)) == (1, 1)  # two leaf springs: one motion, over-constrained once
    one = PARALLELOGRAM.replace(blade("right", 10), "")
    assert freedoms(loaded(tmp_path, one)) == (3, 0)  # one leaf spring
    mirror = (DEVICE.parent / "tip_tilt_mirror.toml").read_text()
    assert freedoms(loaded(tmp_path, mirror)) == (3, 0)  # x, y and the turn about z: the wires are soft across


def test_bodies_without_mass_change_no_natural_frequency(tmp_path):
    """The levers' wires made of two halves with a body between: series of both is the whole wire."""
    whole = (DEVICE.parent / "xy_lever_stage.toml").read_text()
    old = 'name = "push_x"\nfrom = "lever_x"\nto = "block_1"\nat = ["65 mm", "0 mm", "0 mm"]\nalong = [-1, 0, 0]\nlength = "15 mm"'
    assert old in whole
    section = 'diameter = "1.2 mm"\nmaterial = "steel"\n'
    first = 'name = "push_x"\nfrom = "lever_x"\nto = "joint"\nat = ["72.5 mm", "0 mm", "0 mm"]\nalong = [-1, 0, 0]\nlength = "7.5 mm"\n'
    second = first.replace("push_x", "push_x2").replace("lever_x", "joint", 1).replace('to = "joint"', 'to = "block_1"')
    second = second.replace("72.5 mm", "65 mm")
    halves = (
        whole.replace(old, f'{first}{section}\n[[element]]\nkind = "wire"\n{second.rstrip()}')
        + '\n[[body]]\nname = "joint"\n'
    )
    modes = [natural_frequencies(loaded(tmp_path, text)) for text in (whole, halves)]
    assert modes[1] == pytest.approx(modes[0], rel=1e-7)
    c = [Condensed(*with_values(loaded(tmp_path, text))) for text in (whole, halves)]
    assert np.abs(dm(c[1].jacobian) - dm(c[0].jacobian)).max() < 1e-9 * np.abs(dm(c[0].jacobian)).max()


@pytest.mark.parametrize("ahead", [12.0, -12.0])
def test_a_mass_beside_the_end_of_a_beam_has_the_frequencies_of_deflection_and_turn(tmp_path, ahead):
    """K of the cantilever's end in its plane, M = [[m, m e], [m e, I + m e^2]] with the centre of mass e ahead of the end."""
    E, l, d, m, inertia, e = 130e9, 20e-3, 0.5e-3, 0.03, 4e-6, ahead * 1e-3
    wire = (
        '[[element]]\nkind = "wire"\nslender = true\nname = "w"\nfrom = "ground"\nto = "tip"\nat = ["20 mm", "0 mm", "0 mm"]\n'
        'length = "20 mm"\ndiameter = "0.5 mm"\nmaterial = "silicon"\n'
    )
    body = f'[[body]]\nname = "tip"\nmass = "30 g"\ncentre = ["{20 + ahead} mm", "0 mm", "0 mm"]\n'
    body += 'inertia = ["4 kg*mm^2", "4 kg*mm^2", "4 kg*mm^2"]\n'
    modes = natural_frequencies(loaded(tmp_path, HEAD + SILICON + body + wire + REST.replace("plate", "tip")))
    EI = E * np.pi * d**4 / 64
    K = np.linalg.inv([[l**3 / (3 * EI), l**2 / (2 * EI)], [l**2 / (2 * EI), l / EI]])
    M = np.array([[m, m * e], [m * e, inertia + m * e**2]])
    wanted = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real) / (2 * np.pi)
    for f in wanted:
        assert np.abs(modes / f - 1).min() < 1e-9


@pytest.mark.parametrize("count", [3, 60])
def test_the_freedoms_of_a_long_chain_are_counted(tmp_path, count):
    """Each stage is guided by two leaf springs from the one below: one motion and one redundant constraint a stage."""
    text = HEAD + SILICON
    for k in range(count):
        below = f"s{k - 1}" if k else "ground"
        text += f'[[body]]\nname = "s{k}"\n'
        for side in (-10, 10):
            text += (
                blade(f"b{k}_{'l' if side < 0 else 'r'}", side)
                .replace('from = "ground"', f'from = "{below}"')
                .replace('to = "stage"', f'to = "s{k}"')
                .replace('"0 mm", "0 mm"]', f'"{20 * k} mm", "0 mm"]', 1)
            )
    device = loaded(
        tmp_path, text + REST.replace("plate", "s0").replace('channels = ["delta_z"]', 'channels = ["delta_x"]')
    )
    assert freedoms(device) == (count, count)
