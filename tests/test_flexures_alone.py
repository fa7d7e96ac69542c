"""How flexures ring by themselves: against plates of finite elements, beams that are divided, and what is told of it."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_files import HEAD, PARALLELOGRAM, SILICON, loaded

from ctrlgen.devices.mechanism.condensed import nominal
from ctrlgen.devices.mechanism.flexures_alone import alone_lines, alone_remarks, lowest_alone
from ctrlgen.devices.mechanism.modes import free_modes
from ctrlgen.physics.flexure_modes import lowest_bending, lowest_twist
from ctrlgen.physics.held_flexure import held_blade

DENSE = SILICON.replace('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2330 kg/m^3"')


def plate(q: float, nu: float) -> np.ndarray:
    """(6,) frequencies of a Kirchhoff plate of length 1 and width q, clamped at both ends, in sqrt(D/(rho h)): cubic elements."""
    skfem = pytest.importorskip("skfem", reason="the finite-element plate needs scikit-fem")
    from scipy.sparse.linalg import eigsh
    from skfem.helpers import dd, ddot

    x, z = ((np.sin(np.linspace(-1, 1, n) * np.pi / 2)) / 2 for n in (13, 7))
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(x, z * q), skfem.ElementQuadBFS(), intorder=6)

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = dd(u), dd(v)
        return nu * (U[0][0] + U[1][1]) * (V[0][0] + V[1][1]) + (1 - nu) * ddot(U, V)

    @skfem.BilinearForm
    def mass(u, v, _):
        return u * v

    K, M = energy.assemble(basis), mass.assemble(basis)
    free = np.setdiff1d(np.arange(K.shape[0]), basis.nodal_dofs[:, np.isclose(abs(basis.mesh.p[0]), 0.5)].ravel())
    return np.sqrt(np.sort(eigsh(K[free][:, free], 6, M[free][:, free], sigma=0)[0]))


@pytest.mark.parametrize("q", [0.1, 0.3, 0.5, 1.0, 2.0, 4.0])
def test_a_blade_rings_and_twists_as_a_plate(q):
    """To 1.6 and 3 %; the half of a blade that is four times as wide as long is wider than its compliances were compared."""
    nu, thin = 0.3, 1e-4
    found, unit = plate(q, nu), np.sqrt(thin**2 / (12 * (1 - nu**2))) / (2 * np.pi)
    bends = lowest_bending((held_blade(1.0, thin, q, 1.0, nu),), 1.0) / unit
    twists = lowest_twist((held_blade(0.5, thin, q, 1.0, nu),), 1.0) / unit
    assert bends == pytest.approx(found[0], rel=0.016)
    assert twists == pytest.approx(found[np.argmin(abs(found - twists))], rel=0.03 if q < 4 else 0.06)


BODY = '[[body]]\nname = "{}"\n{}'
HEAVY = 'mass = "10 kg"\ninertia = ["1 kg*m^2", "1 kg*m^2", "1 kg*m^2"]\ncentre = ["30 mm", "0 mm", "0 mm"]\n'
PUSH = (
    '[[actuator]]\nname = "push"\nkind = "force"\non = "tip"\nat = ["30 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\ngain = "1 N/V"\n'
    'low = "-1 V"\nhigh = "1 V"\ntravel = "10 um"\n{}[output]\nbody = "tip"\nat = ["30 mm", "0 mm", "0 mm"]\nchannels = ["delta_y"]\n'
)


def wire(name: str, first: str, to: str, end: float, length: float, d: float) -> str:
    return (
        f'[[element]]\nkind = "wire"\nslender = true\nname = "{name}"\nfrom = "{first}"\nto = "{to}"\nat = ["{end} mm", "0 mm", "0 mm"]\n'
        f'along = [1, 0, 0]\nlength = "{length} mm"\ndiameter = "{d} mm"\nmaterial = "silicon"\n'
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_strut_rings_as_one_that_is_divided_and_ends_in_a_mass(tmp_path, seed):
    """Of wires in line, with a mass at the end that is a thousand times theirs, the first mode above those of the mass."""
    rng = np.random.default_rng(seed)
    l, d, D = rng.uniform(3, 10), rng.uniform(0.3, 0.8), rng.uniform(1, 3)
    strut = (
        '[[element]]\nkind = "strut"\nslender = true\nname = "strut"\nfrom = "ground"\nto = "tip"\nat = ["30 mm", "0 mm", "0 mm"]\n'
        f'along = [1, 0, 0]\nlength = "30 mm"\nwire_length = "{l} mm"\nwire_diameter = "{d} mm"\nrod_diameter = "{D} mm"\n'
        'material = "silicon"\n'
    )
    text = HEAD + DENSE + BODY.format("tip", HEAVY) + strut + PUSH.format("")
    found = lowest_alone(nominal(loaded(tmp_path, text)))["strut"]
    n, pieces, names = 3, [], ["ground"]
    for length, thick in ((l, d), (30 - 2 * l, D), (l, d)):
        pieces += [(length / n, thick)] * n
    text, end = "", 0.0
    for k, (length, thick) in enumerate(pieces):
        end += length
        names.append(f"b{k}" if k < len(pieces) - 1 else "tip")
        text += wire(f"w{k}", names[-2], names[-1], end, length, thick)
    bodies = "".join(BODY.format(name, HEAVY if name == "tip" else "") for name in names[1:])
    frequencies = free_modes(loaded(tmp_path, HEAD + DENSE + bodies + text + PUSH.format(""))).frequencies
    assert np.abs(frequencies / found - 1).min() < 0.01


def test_what_is_told(tmp_path):
    """Of a blade that rings below the modes of a light stage; of materials without a density; up to where the response is told."""
    mass = 'name = "stage"\nmass = "1 g"\ninertia = ["0.1 kg*mm^2", "0.1 kg*mm^2", "0.1 kg*mm^2"]\n'
    light = PARALLELOGRAM.replace('name = "stage"\n', mass, 1)
    assert alone_lines(loaded(tmp_path, light)) == ["flexures of silicon count without mass: no density is stated"]
    dense = light.replace('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2330 kg/m^3"')
    (said,) = alone_lines(loaded(tmp_path, dense))
    wanted = 4.73004**2 / (2 * np.pi) * np.sqrt(130e9 / 2330 / 12) * 0.2e-3 / 20e-3**2  # E I/(rho A)
    assert lowest_alone(nominal(loaded(tmp_path, dense)))["left"] == pytest.approx(wanted, rel=1e-4)
    assert f"from {wanted:.0f} Hz on (left, right)" in said
    for below, told in (("20 kHz", True), ("1 kHz", False)):
        table = f'[dynamics]\ndamping_ratio = "1 %"\nmodes_below = "{below}"\n[output]'
        device = loaded(tmp_path, dense.replace("[output]", table))
        assert bool(alone_remarks(device)) == told and set(alone_remarks(device)) <= set(device.remarks())
