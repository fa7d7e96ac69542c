"""NIST's hexapod with inertia: its masses against a kinetic energy summed over points, its modes against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SCENARIOS
from scipy.linalg import eigh

from ctrlgen import InputError, build_model
from ctrlgen.devices import load_device
from ctrlgen.devices.mems_hexapod import matrices, natural_frequencies
from ctrlgen.model.quasi_static import natural_modes, quasi_static

DEVICE, BALANCED = (SCENARIOS / "devices" / f"{name}_hexapod.toml" for name in ("dynamic", "mems"))
R_A, THICKNESS = 1.572e-3, 0.432e-3  # S1 Table 2
ALPHA = np.radians([187.3, 172.7, 67.3, 52.7, -52.7, -67.3])
STAGE, TURN = (0, 1, 1, 2, 2, 0), np.radians([0, -120, 120])
STAGE_MASS, PLATFORM, STRUT = 0.0575e-6, 7.81e-6, 0.446e-6  # kg


def polar(r, angle, z):
    return np.array([r * np.cos(angle), r * np.sin(angle), z])


def kinetic_energy(J, speed):
    """Of stage speeds (6,): the platform as a disc cut into small pieces, each strut into a hundred."""
    twist = J @ speed
    total = 0.5 * STAGE_MASS * speed @ speed
    rings, turns = (np.arange(40) + 0.5) / 40, 2 * np.pi * np.arange(60) / 60
    r, angle = (v.ravel() for v in np.meshgrid(R_A * np.sqrt(rings), turns))  # of equal areas
    for z in -THICKNESS * (np.arange(20) + 0.5) / 20:
        points = np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(r.size, z)])
        v = twist[3:] + np.cross(twist[:3], points)
        total += 0.5 * PLATFORM / (20 * r.size) * np.sum(v**2)
    for alpha, j in zip(ALPHA, STAGE, strict=True):
        c, s = np.cos(TURN[j]), np.sin(TURN[j])
        lower = np.array([[c, -s], [s, c], [0, 0]]) @ speed[2 * j : 2 * j + 2]
        upper = twist[3:] + np.cross(twist[:3], polar(R_A, alpha, -THICKNESS))
        share = ((np.arange(100) + 0.5) / 100)[:, None]
        total += 0.5 * STRUT / 100 * np.sum(((1 - share) * lower + share * upper) ** 2)
    return total


def mass_and_stiffness():
    """(6, 6) each, at home, from the model's acceleration and balance."""
    import casadi as ca

    m = build_model(load_device(DEVICE))
    at = [m.x, m.z, m.u, m.p]
    A = ca.Function("A", at, [ca.jacobian(m.rates[-6:], m.z), ca.jacobian(m.balance, m.z)])
    by_mass, K = (v.full() for v in A(m.rest, np.zeros(6), np.zeros(6), m.p_nominal))
    return K @ np.linalg.inv(by_mass), -K


def test_the_mass_is_that_of_the_kinetic_energy_of_all_points():
    M, _ = mass_and_stiffness()
    J = matrices(load_device(DEVICE))["J"]
    for speed in np.random.default_rng(3).normal(size=(6, 6)):
        assert 0.5 * speed @ M @ speed == pytest.approx(kinetic_energy(J, speed), rel=1e-3)  # a sum over pieces
    assert np.abs(M - M.T).max() < 1e-9 * np.abs(M).max()


def test_the_modes_have_the_frequencies_of_mass_and_stiffness_and_the_stated_damping():
    M, K = mass_and_stiffness()
    wanted = np.sqrt(eigh((K + K.T) / 2, (M + M.T) / 2, eigvals_only=True)) / (2 * np.pi)
    device = load_device(DEVICE)
    model = build_model(device)
    modes = natural_modes(model, model.rest, np.zeros(6), np.zeros(6))
    assert np.allclose(sorted(f for f, _ in modes), wanted, rtol=1e-7)
    assert np.allclose([ratio for _, ratio in modes], 0.01, rtol=1e-6)
    assert np.allclose(natural_frequencies(device), wanted, rtol=1e-7)
    assert wanted.min() > 3e3


def test_without_inertia_it_is_the_device_in_balance():
    still, plain = quasi_static(build_model(load_device(DEVICE))), build_model(load_device(BALANCED))
    x, z, u = plain.rest + 80.0, np.full(6, 2e-5), np.full(6, 0.3)
    for a, b in zip(still.dynamics(x, z, u, []), plain.dynamics(x, z, u, []), strict=True):
        assert np.abs(a.full() - b.full()).max() == 0.0


@pytest.mark.parametrize(
    ("given", "wrong", "what"),
    [
        ('"7.81 mg"', '"7.81 mm"', "platform_mass"),
        ('"0.0575 mg"', '"-1 mg"', "stage_mass"),
        ('"1 %"', '"150 %"', "damping_ratio"),
    ],
)
def test_wrong_masses_are_faults(tmp_path, given, wrong, what):
    text = DEVICE.read_text()
    assert text.count(given) == 1
    (tmp_path / "d.toml").write_text(text.replace(given, wrong))
    with pytest.raises(InputError, match=what):
        load_device(tmp_path / "d.toml")
