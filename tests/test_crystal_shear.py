"""A crystal's shear modulus is a number of its own: torsion and shear beside series, orthotropic plates and Timoshenko's beam."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mechanism_files import HEAD, loaded, place

from ctrlgen.devices.mechanism.point_compliance import point_compliance

skfem = pytest.importorskip("skfem", reason="the plates of finite elements need scikit-fem")
from skfem.helpers import dd  # noqa: E402

CRYSTALS = [
    (130.0, 0.28, 79.6),
    (169.0, 0.064, 50.9),
    (100.0, 0.3, 30.0),
]  # silicon along <100>, along <110> in (001), and a soft one


def one(crystal, length: float, section: str) -> str:
    """A stage at the end of a flexure along x, thin along y."""
    E, nu, G = crystal
    shear = "" if G is None else f'shear = "{G} GPa"\n'
    return (
        f'{HEAD}[[material]]\nname = "crystal"\nyoung = "{E} GPa"\npoisson = "{nu}"\n{shear}[[body]]\nname = "stage"\n'
        f'[[element]]\nname = "e"\nfrom = "ground"\nto = "stage"\nat = {place((0, 0, 0))}\nalong = [1, 0, 0]\nacross = [0, 1, 0]\n'
        f'material = "crystal"\n{section}\n'.replace("LENGTH", f'"{length!r} m"')
        + f'[[actuator]]\nname = "coil"\nkind = "force"\non = "stage"\nat = {place((0, 0, 0))}\nalong = [0, 1, 0]\ngain = "1 N/V"\n'
        f'low = "-1 V"\nhigh = "1 V"\ntravel = "10 um"\n[output]\nbody = "stage"\nat = {place((0, 0, 0))}\nchannels = ["delta_y"]\n'
    )


def compliance(tmp_path, *args) -> np.ndarray:
    return point_compliance(loaded(tmp_path, one(*args))).compliance


def torsion_constant(t: float, w: float) -> float:
    """Of a rectangle: Saint-Venant's series."""
    n = np.arange(1, 60, 2)
    return float(w * t**3 / 3 * (1 - 192 * t / (np.pi**5 * w) * np.sum(np.tanh(n * np.pi * w / (2 * t)) / n**5)))


@pytest.mark.parametrize("crystal", CRYSTALS)
@pytest.mark.parametrize("t, w", [(0.2e-3, 2e-3), (0.5e-3, 0.5e-3), (0.3e-3, 0.6e-3)])
def test_a_slender_blade_twists_by_its_shear_modulus_and_bends_without_it(tmp_path, crystal, t, w):
    E, nu, G = crystal
    length = 60e-3
    section = f'kind = "blade"\nslender = true\nlength = LENGTH\nthickness = "{t} m"\nwidth = "{w} m"'
    C = compliance(tmp_path, crystal, length, section)
    assert C[0, 3] == pytest.approx(length / (G * 1e9 * torsion_constant(t, w)), rel=5e-3)
    isotropic = compliance(tmp_path, (E, nu, None), length, section)
    assert C[0, 3] / isotropic[0, 3] == pytest.approx(E / (2 * (1 + nu)) / G, rel=1e-9)
    C[0, 3] = isotropic[0, 3]
    assert np.allclose(C, isotropic, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("crystal", CRYSTALS)
def test_a_thick_wire_shears_by_it(tmp_path, crystal):
    """l^3/3EI + l/(kappa G A), and twists by G pi d^4/32."""
    E, nu, G = crystal
    length, d = 4e-3, 1e-3
    C = compliance(tmp_path, crystal, length, f'kind = "wire"\nlength = LENGTH\ndiameter = "{d} m"')
    kappa, area, second = 6 * (1 + nu) / (7 + 6 * nu), np.pi * d**2 / 4, np.pi * d**4 / 64
    assert C[4, 1] == pytest.approx(length**3 / (3e9 * E * second) + length / (kappa * G * 1e9 * area), rel=1e-9)
    assert C[0, 3] == pytest.approx(length / (2e9 * G * second), rel=1e-9)


def plate_twist(q: float, crystal) -> float:
    """theta_x/M_x of a plate of length and thickness one and width q between clamped ends, [1/GPa]; by conforming cubic elements."""
    E, nu, G = crystal
    across = np.sin(np.linspace(-1, 1, 9) * np.pi / 2) / 2 * q
    along = (np.sin(np.linspace(-1, 1, 25) * np.pi / 2) + 1) / 2
    m, element = skfem.MeshQuad.init_tensor(along, across), skfem.ElementQuadBFS()
    basis = skfem.Basis(m, element, intorder=6)
    D, twisting = E / (12 * (1 - nu**2)), G / 12

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = dd(u), dd(v)
        bends = U[0][0] * V[0][0] + U[1][1] * V[1][1] + nu * (U[0][0] * V[1][1] + U[1][1] * V[0][0])
        return D * bends + 4 * twisting * U[0][1] * V[0][1]

    K: Any = energy.assemble(basis)
    dofs, end = basis.nodal_dofs, np.isclose(m.p[0], 1.0)
    x = np.zeros(K.shape[0])
    x[dofs[element.dofnames.index("u")][end]] = m.p[1][end]
    x[dofs[element.dofnames.index("u_y")][end]] = 1.0
    turned = skfem.solve(*skfem.condense(K, x=x, D=dofs[:, end | np.isclose(m.p[0], 0.0)].ravel()))
    return float(1 / (turned @ (K @ turned)))


@pytest.mark.parametrize("crystal", CRYSTALS)
@pytest.mark.parametrize("q", [0.3, 1.0, 3.0])
def test_a_wide_blade_between_held_ends_twists_as_an_orthotropic_plate(tmp_path, q, crystal):
    length = 10e-3
    t = 1e-4 * q * length
    C = compliance(
        tmp_path, crystal, length, f'kind = "blade"\nlength = LENGTH\nthickness = "{t!r} m"\nwidth = "{q * length!r} m"'
    )
    assert C[0, 3] == pytest.approx(plate_twist(q, crystal) / 1e9 / t**3, rel=0.015)


def test_the_shear_modulus_of_an_isotropic_material_changes_nothing_and_a_wrong_unit_is_told(tmp_path):
    E, nu = 130.0, 0.28
    for section in (
        'kind = "blade"\nlength = LENGTH\nthickness = "0.5 mm"\nwidth = "4 mm"',
        'kind = "wire"\nlength = LENGTH\ndiameter = "1 mm"',
        'kind = "hinge"\nhinge = { kind = "circular", R = "2 mm", t = "0.3 mm", b = "8 mm", equation = "paros_weisbord", '
        'outside = "accept" }',
    ):
        stated, left_out = (compliance(tmp_path, (E, nu, G), 5e-3, section) for G in (E / (2 * (1 + nu)), None))
        assert stated == pytest.approx(left_out, rel=1e-9, abs=1e-12 * np.abs(left_out).max())
    wrong = loaded(tmp_path, one((E, nu, 79.6e-3), 5e-3, 'kind = "wire"\nlength = LENGTH\ndiameter = "0.1 mm"'))
    assert any("shear" in x and "check the unit" in x for x in wrong.remarks())
