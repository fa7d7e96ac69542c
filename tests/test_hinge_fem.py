"""The finite-element hinge: converged, independent, and what it says about the hinge equations."""

from __future__ import annotations

import ast

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.physics import circular_hinge as c
from ctrlgen.physics import circular_hinge_table as table
from ctrlgen.physics.circular_hinge_table import ALPHA, DELTA_Y

pytest.importorskip("skfem", reason="the finite-element hinge needs scikit-fem")

from papers import hinge_fem as fem
from papers.hinge_errors import draw_hinge_errors, hinge_errors

NU = 0.33


def test_the_finite_element_hinge_imports_nothing_of_ours():
    tree = ast.parse((ROOT / "papers/hinge_fem.py").read_text())
    modules = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    modules |= {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert not any(module.startswith("ctrlgen") for module in modules)


@pytest.mark.long
@pytest.mark.parametrize("reading", fem.Reading, ids=lambda r: r.name)
@pytest.mark.parametrize("ratio", [0.05, 0.374, 0.8])
def test_the_finite_element_hinge_has_converged(ratio, reading):
    assert fem.change_on_refinement(fem.Notch(ratio, NU), reading) < 1e-3


def test_a_coarse_mesh_has_not_converged():
    assert fem.change_on_refinement(fem.Notch(0.05, NU), grid=fem.Grid(12, 2, 2)) > 1e-3


@pytest.mark.parametrize(("ratio", "within"), [(0.05, 0.02), (0.2, 0.03), (0.8, 0.11)])
def test_schotborghs_stretch_counts_in_links_as_long_as_the_radius(ratio, within):
    C = fem.compliance(fem.Notch(ratio, NU, block=1.0), fem.Reading.BLOCKS)
    assert c.c24(1.0, ratio, 1.0, 1.0) == pytest.approx(C[0, 0], rel=within)


@pytest.mark.parametrize(("ratio", "quotient"), [(0.05, 2.12), (0.2, 1.04), (0.8, 1.10)])
def test_schotborghs_locked_deflection_against_finite_elements(ratio, quotient):
    C = fem.compliance(fem.Notch(ratio, NU))
    locked = C[1, 1] - C[1, 2] ** 2 / C[2, 2]
    assert c.c23(1.0, ratio, 1.0, 1.0) / locked == pytest.approx(quotient, abs=0.01)


@pytest.mark.parametrize("reading", fem.Reading, ids=lambda r: r.name)
def test_the_finite_element_hinge_is_reciprocal(reading):
    C = fem.compliance(fem.Notch(0.374, NU), reading)
    assert C[1, 2] == pytest.approx(C[2, 1], rel=1e-8)  # solver rounding; equal without a symmetrising step
    assert C[1, 2] == pytest.approx(C[2, 2], rel=1e-8)  # R alpha_z/M_z, R = 1, by the symmetry of the notch
    assert np.abs(C[0, 1:]).max() < 1e-8 * C[0, 0]


def test_a_thin_finite_element_hinge_is_a_beam():
    distance = [fem.compliance(fem.Notch(r, NU))[2, 2] / c.c1(1.0, r, 1.0, 1.0) - 1 for r in (0.08, 0.04, 0.02)]
    assert distance == sorted(distance, reverse=True)
    assert distance[0] / distance[2] == pytest.approx(4, rel=0.15)  # the first correction is linear in t/R
    assert 0 < distance[2] < 0.01


def test_the_reading_matters_for_the_stretch():
    at = [fem.compliance(fem.Notch(0.65, NU), reading)[0, 0] for reading in (fem.Reading.CENTRE, fem.Reading.SECTION)]
    assert at[1] / at[0] == pytest.approx(1.281, abs=0.01)


@pytest.mark.long
def test_errors_of_the_equations_match_those_s3_prints():
    data = hinge_errors((0.05, 0.075, 0.1, 0.15, 0.2, 0.25, 0.374, 0.5, 0.65, 0.764, 0.8))
    for group, half in (("paros_weisbord", 0.1), ("paros_weisbord_simplified", 0.1), ("lobontiu", 0.1)):
        printed = table.named(DELTA_Y, group).errors
        assert data.summary(DELTA_Y, group) == pytest.approx(printed, abs=half)
    assert data.summary(ALPHA, "zhang_fasse")[1] < 6.5
    assert data.summary(DELTA_Y, "composed")[1] < 2.75
    assert np.isnan(data.errors[ALPHA]["tseytlin"][-1])
    for name in table.PLANAR:
        drawing = draw_hinge_errors(data, name)
        assert (
            drawing.startswith("<svg")
            and "t/R" in drawing
            and "paros weisbord" in drawing
            and drawing == draw_hinge_errors(data, name)
        )


@pytest.mark.long
@pytest.mark.parametrize(
    "ratio", [0.05, 0.8, *(pytest.param(r, marks=pytest.mark.exhaustive) for r in (0.1, 0.2, 0.4, 0.65))]
)
def test_four_times_finer_elements_change_nothing(ratio):
    coarse, fine = (fem.compliance(fem.Notch(ratio, NU), grid=g) for g in (fem.Grid(), fem.Grid().finer(4)))
    assert coarse.diagonal() == pytest.approx(fine.diagonal(), rel=1e-3)
