"""Blades between held ends against finite elements: Kirchhoff plates, plane stress and solids, and what follows for a stage."""

from __future__ import annotations

import re
from typing import Any

import casadi as ca
import numpy as np
import pytest
from conftest import DEVICE
from mechanism_files import loaded

from ctrlgen import load_device
from ctrlgen.devices.mechanism.modes import condensed_modes, natural_frequencies
from ctrlgen.physics.flexure import Segment, blade_segment, segment_compliance
from ctrlgen.physics.held_flexure import held_blade, timoshenko_wire
from ctrlgen.physics.screw import move

skfem = pytest.importorskip("skfem", reason="the finite-element blades need scikit-fem")
from skfem.helpers import dd, ddot, sym_grad, trace  # noqa: E402

PLACES = {
    "axial": (3, 0),
    "delta_y": (4, 1),
    "delta_z": (5, 2),
    "theta_x": (0, 3),
    "theta_y": (1, 4),
    "theta_z": (2, 5),
}
THIN = 1e-5  # thickness over width of a plate in the sense of Kirchhoff


def about_the_middle(s: Segment) -> np.ndarray:
    return ca.DM(move(segment_compliance(s), None, (s.length / 2, 0, 0))).full()


def factors(q: float, r: float, nu: float) -> dict[str, float]:
    """Each compliance of a blade of length 1, width q and thickness r q over that of the slender one."""
    held, slender = (about_the_middle(blade(1.0, r * q, q, 1.0, nu)) for blade in (held_blade, blade_segment))
    return {name: held[at] / slender[at] for name, at in PLACES.items()}


def graded(n: int) -> np.ndarray:
    """From -1 to 1, finer toward both ends, where the stress is singular."""
    return np.sin(np.linspace(-1, 1, n + 1) * np.pi / 2)


def mesh(q: float, *parts: int, thickness: float = 0.0) -> Any:
    sizes = [(graded(parts[0]) + 1) / 2, graded(parts[-1]) / 2 * q]
    if thickness:
        sizes.insert(1, np.linspace(-0.5, 0.5, parts[1] + 1) * thickness)
    return (skfem.MeshHex if thickness else skfem.MeshQuad).init_tensor(*sizes)


def compliance(K: Any, held: np.ndarray, motions: list[np.ndarray]) -> np.ndarray:
    """Of the rigid end in its motions (each a displacement of the held degrees of freedom)."""
    solved = [skfem.solve(*skfem.condense(K, x=x, D=held)) for x in motions]
    return np.linalg.inv([[a @ (K @ b) for b in solved] for a in solved])


def to_middle(C: np.ndarray) -> np.ndarray:
    """(displacement, rotation) at the end of a length 1, to the middle."""
    T = np.array([[1.0, -0.5], [0.0, 1.0]])
    return T @ C @ T.T


def plate(q: float, nu: float) -> dict[str, float]:
    """Of a Kirchhoff plate of rigidity one: conforming cubic elements (Bogner, Fox, Schmit)."""
    m, element = mesh(q, 16 if q > 0.2 else 24, 8), skfem.ElementQuadBFS()
    basis = skfem.Basis(m, element, intorder=6)

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = dd(u), dd(v)
        return nu * (U[0][0] + U[1][1]) * (V[0][0] + V[1][1]) + (1 - nu) * ddot(U, V)

    K, dofs = energy.assemble(basis), basis.nodal_dofs
    end = np.isclose(m.p[0], 1.0)
    held = dofs[:, end | np.isclose(m.p[0], 0.0)].ravel()

    def moved(**values: Any) -> np.ndarray:
        x = np.zeros(K.shape[0])
        for name, value in values.items():
            x[dofs[element.dofnames.index(name)][end]] = value
        return x

    C = compliance(K, held, [moved(u=1.0), moved(u_x=1.0), moved(u=m.p[1][end], u_y=1.0)])
    EI = (1 - nu**2) * q
    bent = to_middle(C[:2, :2])
    return {
        "delta_y": bent[0, 0] * 12 * EI,
        "theta_z": bent[1, 1] * EI,
        "theta_x": C[2, 2] * 4 * EI / (2 * (1 + nu)),
    }


def sheet(q: float, nu: float) -> dict[str, float]:
    """In its plane: plane stress, quadratic elements, E and thickness one."""
    m = mesh(q, 32 if q > 0.3 else 48, 16 if q > 0.3 else 10)
    basis = skfem.Basis(m, skfem.ElementVector(skfem.ElementQuad2()), intorder=6)

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = sym_grad(u), sym_grad(v)
        return (nu * trace(U) * trace(V) + (1 - nu) * ddot(U, V)) / (1 - nu**2)

    K = energy.assemble(basis)
    end, begin = (basis.get_dofs(lambda x, at=at: np.isclose(x[0], at)) for at in (1.0, 0.0))
    z = basis.doflocs[1]

    def moved(component: str, value: Any) -> np.ndarray:
        x = np.zeros(K.shape[0])
        at = np.concatenate([end.nodal[component], end.facet[component]])
        x[at] = value(z[at])
        return x

    one = np.ones_like
    held = np.concatenate([end.flatten(), begin.flatten()])
    C = compliance(K, held, [moved("u^1", one), moved("u^2", one), moved("u^1", np.negative)])
    bent = to_middle(C[1:, 1:])
    return {"axial": C[0, 0] * q, "delta_z": bent[0, 0] * q**3, "theta_y": bent[1, 1] * q**3 / 12}


def solid(q: float, r: float, nu: float) -> dict[str, float]:
    """In space: quadratic hexahedra, E one."""
    t = r * q
    m = mesh(q, 14 if q >= 0.5 else 20, 2 if r < 0.2 else 4, 8, thickness=t)
    basis = skfem.Basis(m, skfem.ElementVector(skfem.ElementHex2()), intorder=4)
    first, second = nu / ((1 + nu) * (1 - 2 * nu)), 1 / (2 * (1 + nu))

    @skfem.BilinearForm
    def energy(u, v, _):
        U, V = sym_grad(u), sym_grad(v)
        return first * trace(U) * trace(V) + 2 * second * ddot(U, V)

    K = energy.assemble(basis)
    component = np.zeros(K.shape[0], int)
    for k in range(3):
        component[basis.get_dofs(elements=True).all(f"u^{k + 1}")] = k
    end, begin = (basis.get_dofs(lambda x, at=at: np.isclose(x[0], at)).flatten() for at in (1.0, 0.0))
    _, y, z = basis.doflocs
    still = 0 * y
    shapes = [*np.eye(3).tolist(), [still, -z, y], [z, still, still], [-y, still, still]]
    motions = []
    for shape in shapes:
        x = np.zeros(K.shape[0])
        x[end] = np.array([value + still for value in shape])[component[end], end]
        motions.append(x)
    C = compliance(K, np.concatenate([end, begin]), motions)
    T = np.eye(6)
    T[1, 5], T[2, 4] = -0.5, 0.5
    C = T @ C @ T.T
    slender = about_the_middle(blade_segment(1.0, t, q, 1.0, nu))
    order = ("axial", "delta_y", "delta_z", "theta_x", "theta_y", "theta_z")
    return {name: C[k, k] / slender[PLACES[name]] for k, name in enumerate(order)}


def close(found: dict[str, float], wanted: dict[str, float], within: float) -> None:
    wrong = {k: found[k] / wanted[k] - 1 for k in wanted if abs(found[k] / wanted[k] - 1) > within}
    assert not wrong


@pytest.mark.parametrize(
    "nu", [pytest.param(0.17, marks=pytest.mark.long), 0.33, pytest.param(0.42, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("q", [0.05, 0.35, 1.0, 1.8, 4.0])
def test_a_thin_blade_is_a_plate(q, nu):
    close(factors(q, THIN, nu), plate(q, nu) | sheet(q, nu), 0.01)


@pytest.mark.long
@pytest.mark.parametrize("nu", [pytest.param(0.25, marks=pytest.mark.exhaustive), 0.33])
@pytest.mark.parametrize(
    "q, r", [(0.1, 1.0), (0.15, 0.4), (0.3, 0.1), (0.3, 0.8), (0.7, 0.2), (0.7, 0.6), (1.5, 0.1), (3.0, 0.1)]
)
def test_a_thick_blade_is_a_solid(q, r, nu):
    """The elements themselves are within half a per cent."""
    close(factors(q, r, nu), solid(q, r, nu), 0.02)


@pytest.mark.parametrize("q", [0.01, 0.02])
def test_a_narrow_thin_blade_is_slender(q):
    """Its ends hold what is about half a width long: of torsion 2/sqrt(24 (1 - nu)) = 0.49 widths."""
    assert list(factors(q, 0.1, 0.3).values()) == pytest.approx([1.0] * 6, abs=0.5 * q)


def test_a_square_bar_is_the_same_about_both_axes():
    """Of the two fits: none knows of the other."""
    for q in (0.05, 0.2, 0.4):
        f = factors(q, 1.0, 0.33)
        assert (f["delta_y"], f["theta_y"]) == pytest.approx((f["delta_z"], f["theta_z"]), rel=0.005)


def test_every_compliance_has_a_slope_at_a_square_section():
    t = ca.SX.sym("t")
    C = segment_compliance(held_blade(1.0, t, 0.2, 1.0, 0.3))
    assert np.isfinite(ca.DM(ca.substitute(ca.jacobian(ca.vec(C), t), t, 0.2)).full()).all()


def test_a_wire_deflects_by_shear_beside_bending():
    """F l^3/3EI + F l/(kappa G A), kappa G A = 6 (1 + nu)/(7 + 6 nu) E/(2 (1 + nu)) pi d^2/4."""
    l, d, E, nu = 3.0, 0.4, 7.0, 0.3
    C = ca.DM(segment_compliance(timoshenko_wire(l, d, E, nu))).full()
    area, second = np.pi * d**2 / 4, np.pi * d**4 / 64
    assert C[4, 1] == pytest.approx(l**3 / (3 * E * second) + l * 2 * 1.3 * 8.8 / (7.8 * E * area), rel=1e-12)
    assert C[4, 1] == C[5, 2] and C[4, 5] == pytest.approx(l**2 / (2 * E * second), rel=1e-12)


def test_the_modes_of_a_parallelogram_are_those_of_its_leaf_springs_as_plates():
    """25 x 10 x 0.3 mm: of slender blades the first is 3.6 % too low and the third, by the blades' width, a quarter too high."""
    device = load_device(DEVICE.parent / "parallelogram.toml")
    modes, _ = condensed_modes(device)
    q, r, nu = 0.4, 0.03, 0.33
    assert modes[0].frequency == pytest.approx(42.35 / np.sqrt(factors(q, r, nu)["delta_y"]), rel=1e-3)
    assert natural_frequencies(device)[2] == pytest.approx(1241, rel=0.015)  # plates of finite elements


@pytest.mark.parametrize(
    "change, says",
    [
        ({}, None),
        (
            {"width": "130 mm"},
            "it is 5.2 times as wide as it is long; its equations were compared with finite elements up to 5",
        ),
        ({"thickness": "13 mm", "width": "20 mm"}, "it is 0.52 times as thick as it is long"),
        ({"slender": "true"}, "shear and held ends are left out"),
        ({"slender": "true", "width": "2 mm"}, None),
    ],
)
def test_a_blade_outside_of_its_range_is_told(tmp_path, change, says):
    text = (DEVICE.parent / "parallelogram.toml").read_text()
    if "slender" in change:
        text = text.replace('kind = "blade"', 'kind = "blade"\nslender = true')
    for key, value in change.items():
        text = re.sub(rf'(?m)^{key} = (\{{[^}}]*\}}|".*")$', f'{key} = "{value}"', text)
    told = [remark for remark in loaded(tmp_path, text).remarks() if remark.startswith("left: ")]
    assert (not told) if says is None else says in told[0]
