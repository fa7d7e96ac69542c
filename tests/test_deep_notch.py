"""A notch that is deep cannot curve across: against solids of finite elements, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_files import hinged, loaded

from ctrlgen.physics.circular_hinge import plane_strain_share


def bending(ratio: float, deep: float, nu: float) -> float:
    """theta_z per M_z [1] of a notch of R = 1, t = `ratio` and b = `deep` between rigid ends, times E b: quadratic hexahedra."""
    skfem = pytest.importorskip("skfem", reason="the finite-element notch needs scikit-fem")
    from scipy.sparse.linalg import spsolve
    from skfem.helpers import ddot, sym_grad, trace

    x = np.sinh(2.2 * np.linspace(-1, 1, 15)) / np.sinh(2.2)
    z = np.sin(np.linspace(-1, 1, 6) * np.pi / 2) / 2 * deep
    straight = skfem.MeshHex2.from_mesh(skfem.MeshHex.init_tensor(x, np.linspace(-0.5, 0.5, 4), z))
    places = straight.doflocs.copy()
    places[1] *= ratio + 2 * (1 - np.sqrt(np.maximum(1 - places[0] ** 2, 0)))
    basis = skfem.Basis(skfem.MeshHex2(places, straight.t), skfem.ElementVector(skfem.ElementHex2()), intorder=4)
    first, second = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = sym_grad(u), sym_grad(v)
        return first * trace(U) * trace(V) + 2 * second * ddot(U, V)

    K, at = energy.assemble(basis), basis.doflocs
    end, begun = np.isclose(at[0], 1), np.isclose(at[0], -1)
    component = np.zeros(K.shape[0], int)
    for k in range(3):
        component[basis.get_dofs(elements=True).all(f"u^{k + 1}")] = k
    moved = np.zeros((K.shape[0], 2))
    moved[end & (component == 1), 0] = 1.0
    moved[end & (component == 0), 1] = -at[1][end & (component == 0)]
    free = np.flatnonzero(~(end | begun))
    moved[free] = -spsolve(K[free][:, free].tocsc(), (K @ moved)[free])
    return float(np.linalg.inv(moved.T @ (K @ moved))[1, 1] * deep)


@pytest.mark.long
@pytest.mark.parametrize("ratio", [0.05, 0.15])
def test_a_deep_notch_is_stiffer_as_a_solid(ratio):
    """Over one that is shallow, half of sqrt(t R), which is nearly in plane stress; 0.05 is half a per cent of the stiffness."""
    nu, unit = 0.3, np.sqrt(ratio)
    shallow = bending(ratio, 0.5 * unit, nu) / (1 - nu**2 * plane_strain_share(1.0, ratio, 0.5 * unit))
    for q in (1.5, 4.0, 10.0):
        found = (1 - bending(ratio, q * unit, nu) / shallow) / nu**2
        assert plane_strain_share(1.0, ratio, q * unit) == pytest.approx(found, abs=0.05)


def test_a_deep_notch_is_told_with_what_it_changes(tmp_path):
    def notes(text: str) -> list[str]:
        return [x for x in loaded(tmp_path, text).remarks() if "as deep as its neck" in x]

    (said,) = notes(hinged(1.0))
    stiffer = 1 / (1 - 0.28**2 * plane_strain_share(2e-3, 0.3e-3, 8e-3)) - 1
    assert "26.7 times as deep as its neck" in said and f"{100 * stiffer:.2g} % stiffer" in said
    assert not notes(hinged(1.0).replace('b = "8 mm"', 'b = "1 mm"'))
    assert (
        plane_strain_share(2e-3, 0.3e-3, 1.0) == pytest.approx(1.0, abs=1e-3) and plane_strain_share(1.0, 1.0, 0.0) == 0
    )
