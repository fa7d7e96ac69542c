"""Flexures that lie in one another, numbers that no material has, and round pieces that are thick: what is said."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_files import HEAD, PARALLELOGRAM, SILICON, loaded, number, place, pushed, vector
from scipy.spatial.transform import Rotation

from ctrlgen import InputError
from ctrlgen.devices.mechanism.overlaps import overlap_remarks

LENGTH, THICK, WIDE = 20e-3, 0.4e-3, 8e-3


def two(R: np.ndarray, shift: np.ndarray, length: float, backward: bool = False, about: float = 0.0) -> str:
    """Two parallel blades in a frame `R`, the second moved in it by `shift` [m] and turned `about` their axis, drawn from either end."""
    text = HEAD + SILICON + '[[body]]\nname = "stage"\n'
    ends = (np.zeros(3), shift)
    for k, (end, l) in enumerate(zip(ends, (LENGTH, length), strict=True)):
        along, across, bodies = R[:, 0], R @ [0, np.cos(about * k), np.sin(about * k)], ("ground", "stage")
        at = R @ end
        if k and backward:
            at, along, bodies = at - l * along, -along, bodies[::-1]
        text += (
            f'[[element]]\nkind = "blade"\nname = "e{k}"\nfrom = "{bodies[0]}"\nto = "{bodies[1]}"\nat = {place(at)}\n'
        )
        text += f"along = {vector(along)}\nacross = {vector(across)}\nlength = {number(l, 'm')}\nthickness = {number(THICK, 'm')}\n"
        text += f'width = {number(WIDE, "m")}\nmaterial = "silicon"\n'
    return text + pushed("stage", "coil", "0 mm", "1 N/A", ("-1 A", "1 A"), "10 um")


@pytest.mark.parametrize("seed", range(8))
def test_parallel_blades_that_run_in_one_another_are_told_however_they_are_drawn(tmp_path, seed):
    rng = np.random.default_rng(seed)
    R, backward = Rotation.random(random_state=seed).as_matrix(), bool(seed % 2)
    along, length = rng.uniform(-5e-3, 5e-3), rng.uniform(8e-3, 15e-3)
    for across, apart in (((0.9 * THICK, 0.5 * WIDE), False), ((1.01 * THICK, 0), True), ((0, 1.01 * WIDE), True)):
        device = loaded(tmp_path, two(R, np.array([along, *across]), length, backward))
        told = overlap_remarks(device.placed_elements)
        assert bool(told) != apart and set(told) <= set(device.remarks())
        if told:
            shared = min(0, along) - max(-LENGTH, along - length)
            assert float(told[0].split("over ")[1].split(" mm")[0]) == pytest.approx(1e3 * shared, rel=1e-3)
    crossed = loaded(tmp_path, two(R, np.array([along, 0.4 * WIDE, 0.0]), length, backward, about=np.pi / 2))
    assert overlap_remarks(crossed.placed_elements)  # one through the other's edge
    beside = loaded(tmp_path, two(R, np.array([along, 0.6 * WIDE, 0.0]), length, backward, about=np.pi / 2))
    assert not overlap_remarks(beside.placed_elements)
    in_line = loaded(tmp_path, two(R, np.array([-LENGTH, 0.0, 0.0]), length, backward))
    assert not overlap_remarks(in_line.placed_elements)


@pytest.mark.parametrize("backward", [False, True])
def test_one_blade_twice_is_a_fault_also_from_its_other_end(tmp_path, backward):
    with pytest.raises(InputError, match="e1 lies where e0 lies"):
        loaded(tmp_path, two(np.eye(3), np.zeros(3), LENGTH, backward))


@pytest.mark.parametrize(
    "old, new, told",
    [
        ('young = "130 GPa"', 'young = "130000 GPa"', "above diamond"),
        ('young = "130 GPa"', 'young = "130 kPa"', "below rubber"),
        ('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2.33 kg/m^3"', "below foams"),
        ('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2330 g/cm^3"', "above osmium"),
        ('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2.33 g/cm^3"', None),
    ],
)
def test_a_number_that_no_material_has_is_told(tmp_path, old, new, told):
    remarks = [x for x in loaded(tmp_path, PARALLELOGRAM.replace(old, new)).remarks() if x.startswith("silicon")]
    assert (not remarks) if told is None else told in remarks[0]


@pytest.mark.parametrize(
    "sizes, told",
    [
        ('diameter = "2 mm"', None),
        ('diameter = "8 mm"', r"0.4 times as thick as long: what its ends hold is left out, .* by about +1.9 % along"),
        ('diameter = "8 mm"\nslender = true', "shear and held ends are left out"),
        ('diameter = "30 mm"', "1.5 times as thick as long, which is no flexure"),
        ('wire_length = "4 mm"\nwire_diameter = "1.6 mm"\nrod_diameter = "3 mm"', "its wires are 0.4 times as thick"),
    ],
)
def test_a_round_piece_that_is_thick_is_told(tmp_path, sizes, told):
    kind = "strut" if "rod" in sizes else "wire"
    text = (
        HEAD
        + SILICON
        + f'[[body]]\nname = "stage"\n[[element]]\nkind = "{kind}"\nname = "w"\nfrom = "ground"\nto = "stage"\n'
    )
    text += f'at = ["0 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\nlength = "20 mm"\n{sizes}\nmaterial = "silicon"\n'
    device = loaded(tmp_path, text + pushed("stage", "coil", "0 mm", "1 N/A", ("-1 A", "1 A"), "10 um"))
    notes = [x for x in device.remarks() if x.startswith("w: ")]
    assert (not notes) if told is None else all(part in notes[0] for part in told.split(" .* "))
