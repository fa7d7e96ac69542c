"""A blade that a drawing divides by bodies without mass is held at its two ends alone, not at every cut."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanism_files import HEAD, loaded, place, vector

from ctrlgen.devices.changed_numbers import with_numbers
from ctrlgen.devices.mechanism.bent_tangent import displaced_compliance
from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.devices.mechanism.point_compliance import point_compliance

skfem = pytest.importorskip("skfem", reason="the plates of finite elements need scikit-fem")
from skfem.helpers import dd, ddot  # noqa: E402

E, NU = 100e9, 0.33
SAME = 1e-9
MASS = 'mass = "1 g"\ninertia = ["1 kg*mm^2", "1 kg*mm^2", "1 kg*mm^2"]\n'


def drawing(
    lengths,
    thicknesses,
    width: float,
    *,
    turn=None,
    backwards=(),
    gap: float = 0.0,
    of_bodies: str = "",
    more: str = "",
) -> str:
    """Pieces in line from the ground to a stage at the origin, those numbered `backwards` drawn from their other end, a `gap` between."""
    turn = np.eye(3) if turn is None else turn
    x, y = turn[:, 0], turn[:, 1]
    text = f'{HEAD}[[material]]\nname = "metal"\nyoung = "{E / 1e9} GPa"\npoisson = "{NU}"\n[[body]]\nname = "stage"\n'
    at = -x * (sum(lengths) + gap * (len(lengths) - 1))
    for k, (l, t) in enumerate(zip(lengths, thicknesses, strict=True)):
        ends = ["ground" if k == 0 else f"cut{k}", "stage" if k == len(lengths) - 1 else f"cut{k + 1}"]
        free, along = (at + l * x, x) if k not in backwards else (at, -x)
        at = at + (l + gap) * x
        if k:
            text += f'[[body]]\nname = "cut{k}"\n{of_bodies}'
        first, second = ends if k not in backwards else ends[::-1]
        text += (
            f'[[element]]\nkind = "blade"\nname = "piece{k}"\nfrom = "{first}"\nto = "{second}"\nat = {place(free)}\n'
            f'along = {vector(along)}\nacross = {vector(y)}\nmaterial = "metal"\n'
            f'length = "{l!r} m"\nthickness = "{t!r} m"\nwidth = "{width!r} m"\n'
        )
    return (
        f'{text}{more}[[actuator]]\nname = "coil"\nkind = "force"\non = "stage"\nat = {place(np.zeros(3))}\nalong = {vector(y)}\n'
        f'gain = "1 N/V"\nlow = "-1 V"\nhigh = "1 V"\ntravel = "10 um"\n'
        f'[output]\nbody = "stage"\nat = {place(np.zeros(3))}\nchannels = ["delta_y"]\n'
    )


def rotation(rng) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.linalg.det(q)
    return q if abs(q[1, 1]) > 0.3 else rotation(rng)  # it is pushed along its y axis, and read along the drawing's


def pieces(rng, length: float) -> list[float]:
    cuts = np.sort(rng.uniform(0.05, 0.95, rng.integers(1, 7)))
    return [float(x) * length for x in np.diff([0.0, *cuts, 1.0]) if x > 0.01] or [length]


@pytest.mark.parametrize("seed", range(12))
def test_wherever_a_blade_is_divided_it_is_as_stiff_as_the_whole(tmp_path, seed):
    rng = np.random.default_rng(seed)
    parts = pieces(rng, rng.uniform(5e-3, 40e-3))
    length, turn = sum(parts), rotation(rng)
    width = length * rng.uniform(0.1, 4)
    thickness = min(width, length) * rng.uniform(0.01, 0.3)
    backwards = {k for k in range(len(parts)) if rng.random() < 0.5}
    whole = loaded(tmp_path, drawing([length], [thickness], width, turn=turn))
    divided = loaded(tmp_path, drawing(parts, [thickness] * len(parts), width, turn=turn, backwards=backwards))
    C, D = point_compliance(whole).compliance, point_compliance(divided).compliance
    size = np.sqrt(np.outer(np.diag(np.roll(C, 3, axis=1)), np.diag(np.roll(C, 3, axis=1))))
    assert np.all(np.abs(np.roll(D - C, 3, axis=1)) < SAME * size)
    moved = np.array([min(thickness, 1e-3 * length)])
    one, other = (np.diag(np.roll(displaced_compliance(nominal(x), moved), 3, axis=1)) for x in (whole, divided))
    assert other == pytest.approx(one, rel=0.02, abs=SAME * np.abs(one).max())


def plate(q: float, thicknesses) -> dict[tuple[int, int], float]:
    """Of a Kirchhoff plate of length 1 and width q between clamped ends, in strips of these thicknesses: its compliance about the moved
    end, by conforming cubic elements (Bogner, Fox, Schmit); in units of E."""
    n, across = len(thicknesses), np.sin(np.linspace(-1, 1, 9) * np.pi / 2) / 2 * q
    m, element = skfem.MeshQuad.init_tensor(np.linspace(0, 1, 4 * n + 1), across), skfem.ElementQuadBFS()
    basis = skfem.Basis(m, element, intorder=6)
    cubes = np.array(thicknesses) ** 3 / (12 * (1 - NU**2))

    @skfem.BilinearForm
    def energy(u, v, w):
        U, V = dd(u), dd(v)
        D = cubes[np.minimum((w.x[0] * n).astype(int), n - 1)]
        return D * (NU * (U[0][0] + U[1][1]) * (V[0][0] + V[1][1]) + (1 - NU) * ddot(U, V))

    K, dofs = energy.assemble(basis), basis.nodal_dofs
    end = np.isclose(m.p[0], 1.0)
    held = dofs[:, end | np.isclose(m.p[0], 0.0)].ravel()

    def moved(**values: Any) -> np.ndarray:
        x = np.zeros(K.shape[0])
        for name, value in values.items():
            x[dofs[element.dofnames.index(name)][end]] = value
        return skfem.solve(*skfem.condense(K, x=x, D=held))

    motions = [moved(u=1.0), moved(u_x=1.0), moved(u=m.p[1][end], u_y=1.0)]
    C = np.linalg.inv([[a @ (K @ b) for b in motions] for a in motions])
    return {(4, 1): C[0, 0], (2, 5): C[1, 1], (4, 5): C[0, 1], (0, 3): C[2, 2]}


@pytest.mark.parametrize("q", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("shape", ["even", "waist", "wedge"])
def test_a_blade_in_steps_of_thickness_is_a_plate_in_such_steps(tmp_path, q, shape):
    """Bending within 1.5 % of plates, torsion within 1 % where it is even and 11 % where it is not and no wider than long; held at every
    cut it was four to fifty times as stiff in torsion, and 7 % in bending at q = 0.3."""
    n, length = 8, 20e-3
    x = (np.arange(n) + 0.5) / n
    profile = {"even": 1 + 0 * x, "waist": 1 + 0.5 * (2 * x - 1) ** 2, "wedge": 1.5 - 0.7 * x}[shape]
    thickness = 1e-3 * q * length * profile
    device = loaded(tmp_path, drawing([length / n] * n, [float(t) for t in thickness], q * length))
    C = point_compliance(device).compliance
    units = {(4, 1): 1 / length, (2, 5): 1 / length**3, (4, 5): 1 / length**2, (0, 3): 1 / length**3}
    for at, wanted in plate(q, thickness / length).items():
        if at != (0, 3) or shape == "even" or q <= 1:
            within = 0.015 if at != (0, 3) else 0.01 if shape == "even" else 0.11
            assert C[at] == pytest.approx(wanted * units[at] / E, rel=within), at


def touched(text: str, by: str) -> str:
    """The same with something at the body between both pieces."""
    wire = (
        f'[[element]]\nkind = "wire"\nname = "beside"\nfrom = "ground"\nto = "cut1"\nat = {place((-1e-2, 0, 0))}\nalong = [0, 0, 1]\n'
        'length = "100 mm"\ndiameter = "1 um"\nmaterial = "metal"\n'
    )
    load = f'[[load]]\nname = "weight"\non = "cut1"\nat = {place((-1e-2, 0, 0))}\nforce = ["0 N", "1 mN", "0 N"]\n'
    return text.replace("[[actuator]]", {"element": wire, "load": load}[by] + "[[actuator]]", 1)


def test_what_holds_moves_or_loads_the_body_between_makes_it_a_clamp_and_so_does_a_gap(tmp_path):
    parts, thick, width = [10e-3, 10e-3], [0.2e-3, 0.2e-3], 10e-3
    one = point_compliance(loaded(tmp_path, drawing(parts, thick, width))).compliance[0, 3]
    held = {
        "mass": drawing(parts, thick, width, of_bodies=MASS),
        "gap": drawing(parts, thick, width, gap=2e-3),
        "element": touched(drawing(parts, thick, width), "element"),
        "load": touched(drawing(parts, thick, width), "load"),
    }
    for what, text in held.items():
        assert point_compliance(loaded(tmp_path, text)).compliance[0, 3] < 0.95 * one, what
    rounded = drawing([10.001e-3, 9.99e-3], thick, width, gap=9e-6)
    assert point_compliance(loaded(tmp_path, rounded)).compliance[0, 3] == pytest.approx(one, rel=2e-3)


@pytest.mark.parametrize(("degrees", "one_blade"), [(0.0, True), (0.02, True), (0.2, False), (5.0, False)])
def test_pieces_that_meet_at_an_angle_are_two_blades(tmp_path, degrees, one_blade):
    """A kink in the plane of the blade, by a thousandth of a radian and more: both keep their thin direction."""
    l, a = 10e-3, np.radians(degrees)
    along = np.array([np.cos(a), 0.0, -np.sin(a)])
    text = drawing([l, l], [0.2e-3, 0.2e-3], 10e-3)
    head, piece, rest = text.partition('name = "piece1"')
    straight = f"at = {place(np.zeros(3))}\nalong = {vector(np.array([1.0, 0.0, 0.0]))}"
    assert straight in rest
    kinked = f"at = {place(l * (along - [1.0, 0.0, 0.0]))}\nalong = {vector(along)}"
    device = loaded(tmp_path, head + piece + rest.replace(straight, kinked, 1))
    assert bool(device.blade_runs) is one_blade


def test_a_piece_is_as_wide_as_its_blade_is_long_and_check_says_what_is_one_blade(tmp_path):
    """Of sixteen pieces of a square blade each is sixteen times as wide as long, which no note tells."""
    divided = loaded(tmp_path, drawing([1e-3] * 16, [0.2e-3] * 16, 16e-3))
    assert not [remark for remark in divided.remarks() if remark.startswith("piece")]
    assert any("piece0" in line and "16 mm" in line for line in summary(divided))
    whole = loaded(tmp_path, drawing([16e-3], [0.2e-3], 16e-3))
    assert not any("piece0" in line and "16 mm" in line for line in summary(whole))


def test_pieces_keep_together_where_a_fit_changes_the_length_of_one(tmp_path):
    """Which elements are one blade is what the file says: in torsion it follows its length without a jump."""
    device = loaded(tmp_path, drawing([10e-3, 10e-3], [0.2e-3] * 2, 10e-3))
    lengths = [10e-3, 10.001e-3, 11e-3]
    turns = [point_compliance(with_numbers(device, {"element[1].length": l})).compliance[0, 3] for l in lengths]
    slope = (turns[2] - turns[0]) / (lengths[2] - lengths[0])
    assert turns[1] - turns[0] == pytest.approx(slope * 1e-6, rel=0.1)


def test_a_taper_that_no_plates_were_compared_with_is_told(tmp_path):
    def told(thicknesses, width):
        remarks = loaded(tmp_path, drawing([10e-3, 10e-3], thicknesses, width)).remarks()
        return [remark for remark in remarks if "plates" in remark]

    assert not told([0.2e-3, 0.2e-3], 30e-3) and not told([0.2e-3, 0.28e-3], 10e-3)
    assert told([0.2e-3, 0.28e-3], 30e-3) and told([0.2e-3, 0.4e-3], 10e-3)
