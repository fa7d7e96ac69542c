"""The mass of flexures: closed forms of beams, finite elements of a stepped one, and what a device file shows of it."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_files import HEAD, PARALLELOGRAM, SILICON, dm, hinged, loaded, with_values
from scipy.linalg import eigh

from ctrlgen import InputError, build_model
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.devices.mechanism.modes import condensed_modes, free_modes

RHO, E = 2330.0, 130e9
DENSE = SILICON.replace('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2330 kg/m^3"')
LENGTH, THICK, WIDE = 20e-3, 0.2e-3, 8e-3  # of PARALLELOGRAM's blades
BLADE = RHO * LENGTH * THICK * WIDE
SECTIONS = 6 / 5 * (THICK / LENGTH) ** 2 / 12  # share of the mass by which sections that turn act across


def dense(text: str) -> str:
    return text.replace('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2330 kg/m^3"')


def wire(name: str, first: str, to: str, x: float, length: float, diameter: float) -> str:
    """Along x, from x - length to x [mm]."""
    return (
        f'[[element]]\nkind = "wire"\nslender = true\nname = "{name}"\nfrom = "{first}"\nto = "{to}"\nat = ["{x} mm", "0 mm", "0 mm"]\n'
        f'along = [1, 0, 0]\nlength = "{length} mm"\ndiameter = "{diameter} mm"\nmaterial = "silicon"\n'
    )


def pushed(body: str, x: float, axis: str = "[0, 1, 0]", dynamics: str = "") -> str:
    """A force across at x [mm], which is followed."""
    return (
        f'[[actuator]]\nname = "push"\nkind = "force"\non = "{body}"\nat = ["{x} mm", "0 mm", "0 mm"]\nalong = {axis}\ngain = "1 N/V"\n'
        f'low = "-1 V"\nhigh = "1 V"\ntravel = "10 um"\n{dynamics}[output]\nbody = "{body}"\nat = ["{x} mm", "0 mm", "0 mm"]\n'
        'channels = ["delta_y"]\n'
    )


def bodies(*names: str, more: str = "") -> str:
    return "".join(f'[[body]]\nname = "{name}"\n{more}' for name in names)


STRUT = (
    '[[element]]\nkind = "strut"\nslender = true\nname = "strut"\nfrom = "ground"\nto = "tip"\nat = ["30 mm", "0 mm", "0 mm"]\n'
    'along = [1, 0, 0]\nlength = "30 mm"\nwire_length = "5 mm"\nwire_diameter = "0.5 mm"\nrod_diameter = "3 mm"\nmaterial = "silicon"\n'
)
TIP = 'mass = "2 g"\ncentre = ["30 mm", "0 mm", "0 mm"]\ninertia = ["20 g*mm^2", "20 g*mm^2", "20 g*mm^2"]\n'


def test_two_guided_blades_count_with_13_35_of_their_mass(tmp_path):
    """Przemieniecki's mass of a beam across its end, 13/35 m + 6/5 m r^2/l^2."""
    found = dm(Condensed(*with_values(loaded(tmp_path, dense(PARALLELOGRAM)))).mass)[0, 0]
    assert found == pytest.approx(2 * BLADE * (13 / 35 + SECTIONS), rel=1e-9)
    assert dm(Condensed(*with_values(loaded(tmp_path, PARALLELOGRAM))).mass)[0, 0] == 0.0


def test_a_cantilever_counts_with_33_140_of_its_mass(tmp_path):
    text = HEAD + DENSE + bodies("tip", more=TIP) + wire("beam", "ground", "tip", 30, 30, 1.0) + pushed("tip", 30)
    mass = RHO * 30e-3 * np.pi * 1e-6 / 4
    turned = 1.5 / 30e-3  # of the free end, per displacement
    wanted = mass * (33 / 140 + 6 / 5 * (1e-3 / 4 / 30e-3) ** 2) + 2e-3 + 20e-9 * turned**2
    assert dm(Condensed(*with_values(loaded(tmp_path, text))).mass)[0, 0] == pytest.approx(wanted, rel=1e-9)


def test_a_flexure_that_is_not_bent_moves_as_a_rigid_body(tmp_path):
    """A strut of wire, rod and wire: its mass along every axis, and its inertia about its middle and its axis."""
    c = Condensed(*with_values(loaded(tmp_path, HEAD + DENSE + bodies("tip") + STRUT + pushed("tip", 30))))
    motion = np.eye(6)  # twists at the origin, where the strut begins
    motion[:, 1], motion[:, 2] = [0, 1, 0, 0, 0, 15e-3], [0, 0, 1, 0, -15e-3, 0]  # about its middle
    M = dm(c.flexure_mass(0, motion, motion))
    wires, rod = RHO * np.pi * 0.5e-3**2 / 4 * 5e-3, RHO * np.pi * 3e-3**2 / 4 * 20e-3
    m = 2 * wires + rod
    about = rod * (20e-3**2 / 12 + 3e-3**2 / 16) + 2 * wires * (5e-3**2 / 12 + 0.5e-3**2 / 16 + 12.5e-3**2)
    spin = rod * 3e-3**2 / 8 + 2 * wires * 0.5e-3**2 / 8
    assert np.allclose(np.diag(M), [spin, about, about, m, m, m], rtol=1e-9, atol=0)
    assert np.abs(M - np.diag(np.diag(M)))[:3].max() < 1e-9 * m * 15e-3


def test_a_beam_of_several_elements_rings_as_euler_and_bernoulli_say(tmp_path):
    """beta l = 1.8751, 4.6941 of a cantilever: cubic shapes overestimate by (beta l/n)^4/720 or so, sections that turn take 3e-4 off."""
    n, l, d = 6, 60.0, 0.5
    text = HEAD + DENSE + bodies(*(f"b{k}" for k in range(n)))
    text += "".join(wire(f"w{k}", f"b{k - 1}" if k else "ground", f"b{k}", l / n * (k + 1), l / n, d) for k in range(n))
    found = free_modes(loaded(tmp_path, text + pushed(f"b{n - 1}", l))).frequencies
    unit = np.sqrt(E / RHO) * d * 1e-3 / 4 / (l * 1e-3) ** 2 / (2 * np.pi)
    assert np.allclose(found[:4], np.array([1.87510407, 1.87510407, 4.69409113, 4.69409113]) ** 2 * unit, rtol=1e-3)


def test_a_strut_with_a_mass_at_its_end_rings_as_in_finite_elements(tmp_path):
    """Hermitian elements of scikit-fem, 12 for each piece, of a beam without shear with a point mass and inertia at its end. Its
    mass takes 2 % of the frequency; the shape at rest between its ends is as good as all shapes here, and never below."""
    skfem = pytest.importorskip("skfem", reason="the finite-element beam needs scikit-fem")
    from skfem.helpers import dd, ddot, dot, grad

    x = np.unique(np.concatenate([np.linspace(a, b, 13) for a, b in ((0, 5e-3), (5e-3, 25e-3), (25e-3, 30e-3))]))
    basis = skfem.Basis(skfem.MeshLine(x), skfem.ElementLineHermite(), intorder=7)

    def diameter(at):
        return np.where((at > 5e-3) & (at < 25e-3), 3e-3, 0.5e-3)

    @skfem.BilinearForm
    def bending(u, v, w):
        return E * np.pi * diameter(w.x[0]) ** 4 / 64 * ddot(dd(u), dd(v))

    @skfem.BilinearForm
    def inertia(u, v, w):
        d = diameter(w.x[0])
        return RHO * np.pi * d**2 / 4 * (u * v + d**2 / 16 * dot(grad(u), grad(v)))

    K, M = bending.assemble(basis).toarray(), inertia.assemble(basis).toarray()
    ends = [basis.get_dofs(lambda x, at=at: np.isclose(x[0], at)).all() for at in (0.0, 30e-3)]
    M[ends[1], ends[1]] += [2e-3, 20e-9]
    free = np.setdiff1d(np.arange(len(K)), ends[0])
    wanted = np.sqrt(eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)[0]) / (2 * np.pi)
    text = HEAD + bodies("tip", more=TIP) + STRUT + pushed("tip", 30)
    found = free_modes(loaded(tmp_path, text.replace(HEAD, HEAD + DENSE))).frequencies[0]
    light = free_modes(loaded(tmp_path, text.replace(HEAD, HEAD + SILICON))).frequencies[0]
    assert 0 <= found / wanted - 1 < 1e-4 and light / wanted > 1.015


def test_a_strut_has_the_mass_of_its_three_pieces_in_line(tmp_path):
    """A strut as three wires in line, whose bodies between have no mass: the same condensed to its end."""
    parts = wire("a", "ground", "p", 5, 5, 0.5) + wire("b", "p", "q", 25, 20, 3.0) + wire("c", "q", "tip", 30, 5, 0.5)
    found = [
        dm(Condensed(*with_values(loaded(tmp_path, HEAD + DENSE + text + pushed("tip", 30)))).mass)[0, 0]
        for text in (bodies("tip") + STRUT, bodies("p", "q", "tip") + parts)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_dynamics_solve_with_it_and_check_shows_its_modes(tmp_path):
    """A stage without a mass of its own: refused while its blades have none either."""
    text = PARALLELOGRAM.replace("[output]", '[dynamics]\ndamping_ratio = "3 %"\n[output]')
    with pytest.raises(InputError, match="move no mass"):
        loaded(tmp_path, text)
    device = loaded(tmp_path, dense(text))
    assert float(dm(build_model(device).mass)[0, 0]) == pytest.approx(2 * BLADE * (13 / 35 + SECTIONS), rel=1e-9)
    (mode,), _ = condensed_modes(device)
    stiffness = 24 * E * WIDE * THICK**3 / 12 / LENGTH**3
    assert mode.frequency == pytest.approx(
        np.sqrt(stiffness / (2 * BLADE * (13 / 35 + SECTIONS))) / (2 * np.pi), rel=1e-9
    )
    said = " ".join(summary(device))
    assert f"natural frequencies with the drives held: {mode.frequency:.1f} Hz" in said and "solved with it" in said


def test_a_hinge_of_a_material_with_a_density_is_said_to_have_none(tmp_path):
    device = loaded(tmp_path, dense(hinged(1.0)))
    assert any("notch: a hinge has no mass of its own" in remark for remark in device.remarks())
    assert dm(Condensed(*with_values(device)).mass)[0, 0] == 0.0
    assert not any("no mass" in remark for remark in loaded(tmp_path, hinged(1.0)).remarks())


@pytest.mark.parametrize("wrong", ["-2330 kg/m^3", "2330 kg", "0 kg/m^3", "dense"])
def test_a_density_that_is_none_is_a_fault(tmp_path, wrong):
    with pytest.raises(InputError, match="density"):
        loaded(tmp_path, dense(PARALLELOGRAM).replace("2330 kg/m^3", wrong))
