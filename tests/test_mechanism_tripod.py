"""The shipped tripod: what its stiffness, its inertia and its readings are by hand, and that copies of a leg are alike."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import DEVICE
from mechanism_files import dm, with_values

from ctrlgen import build_model, load_device
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.constraints import freedoms
from ctrlgen.devices.mechanism.modes import Modes, compared, condensed_modes
from ctrlgen.model.simulation import simulate

TRIPOD = load_device(DEVICE.parent / "tripod.toml")
E, NU, L, D, R, R_SPRING, K_SPRING, MASS, INERTIA = 205e9, 0.3, 20e-3, 0.6e-3, 30e-3, 20e-3, 400.0, 0.12, 27e-6
I = np.pi * D**4 / 64
KAPPA = 6 * (1 + NU) / (7 + 6 * NU)  # of a round section (Cowper 1966)
BENDING, SHEAR = L**3 / (12 * E * I), L * 2 * (1 + NU) / (KAPPA * E * np.pi * D**2 / 4)
ACROSS = 1 / (BENDING + SHEAR)
PISTON = 3 * (ACROSS + K_SPRING)
TILT = 1.5 * (ACROSS * R**2 + E * I / L + ACROSS * L**2 / 4 + E / (2 * (1 + NU)) * 2 * I / L + K_SPRING * R_SPRING**2)


def test_the_tripod_has_the_stiffness_and_the_modes_of_its_wires_and_springs():
    assert freedoms(TRIPOD) == (3, 0)
    C = dm(Condensed(*with_values(TRIPOD)).output_compliance)  # twist per (F; M)
    assert 1 / C[5, 2] == pytest.approx(PISTON, rel=1e-9)
    assert 1 / C[0, 3] == pytest.approx(TILT, rel=1e-9) and 1 / C[1, 4] == pytest.approx(TILT, rel=1e-9)
    modes, left_out = condensed_modes(TRIPOD)
    wanted = np.sqrt([PISTON / MASS, TILT / INERTIA, TILT / INERTIA]) / (2 * np.pi)
    assert [m.frequency for m in modes] == pytest.approx(wanted, rel=1e-9)
    assert [m.whole for m in modes] == pytest.approx(wanted, rel=1e-9)  # the platform is rigid: nothing is lost
    assert left_out is not None and left_out > 10 * wanted[1]


def test_condensed_modes_are_no_faster_modes_and_modes_of_equal_frequency_are_one():
    """Masses on springs of their own: two at 87 Hz, one at 93 Hz. A model held to two of their motions has square means of these."""
    whole = np.array([87.0, 87.0, 93.0])
    full = Modes(whole, np.eye(3), np.eye(3))
    part = np.sqrt([0.5, 0.5, 0.34, 0.66])
    mixed = np.array([[part[0], part[1], 0.0], [-part[2] * part[0], part[2] * part[1], part[3]]]).T
    own = np.sqrt(whole**2 @ mixed**2)
    modes, left_out = compared(Modes(own, mixed, np.eye(3)), full)
    # The first is of both modes at 87 Hz in any basis; the second lies below the 93 Hz that it has 0.66 of
    assert [m.whole for m in modes] == [87.0, None] and own[1] < 93 and left_out == 87
    modes, left_out = compared(Modes(whole, np.eye(3)[:, [1, 0, 2]], np.eye(3)), full)
    assert [m.whole for m in modes] == [87.0, 87.0, 93.0] and left_out is None


def test_equal_currents_lift_the_platform_and_the_gauges_read_it():
    """3 x 6 N/A i = K z, after the ringing."""
    z = 300e-6
    ring = np.full((8000, 3), PISTON * z / 18)
    trace = simulate(build_model(TRIPOD), ring, 1e-3)
    assert trace.signals["pose"][-1, 2] == pytest.approx(z, rel=1e-6)  # e^(-0.01 w 8 s) of the step is left
    names = build_model(TRIPOD).signals["reading"].channels
    assert names == ("theta_x", "theta_y", "delta_z", "gauge_1", "gauge_2", "gauge_3")
    assert trace.signals["reading"][-1, 3:] == pytest.approx(z, rel=1e-6)
