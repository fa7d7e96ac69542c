"""The bound of the controller in integers has every error in it, and its polynomials are those of both modes."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, load_device
from ctrlgen.controller import fixed_maps
from ctrlgen.controller.fixed_errors import Bits, error_bounds
from ctrlgen.controller.fixed_maps import NoFixedPoint, RealMaps, real_maps
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.numerics.proven_polynomial import ProvenPolynomial

SLOPES, PROVED = (
    np.array([3.0, 7.0]),
    np.array([2e-4, 5e-4]),
)  # of state 0, which follows displacement 1, and of state 1
PLACES = [1, 0]
M = np.array([[2.0, 0.5], [-1.0, 4.0]])
A, B = np.diag([0.5, 0.8]), np.array([[0.3, 0.0], [0.0, 0.4]])
BITS = Bits(*(np.array(bits) for bits in ([9, 8], [10, 11], [7, 9], [8, 10])))
COUNTS = np.array([2.0, 3.0]), np.array([5.0, 4.0]), np.array([6.0, 7.0])  # roundings of displacement, state and drive
CUT = np.array([9.0, 11.0])  # counts of a drive, cut off at its limit


def test_a_linear_device_is_off_by_the_whole_bound_where_every_error_has_its_worst_sign():
    """States s = k z, x+ = A x + B u, u = B^-1 (s - A x): every sign of every error is tried."""
    state = tuple(
        (i, ProvenPolynomial(np.array([0.0, k]), 0.0, 1.0, off, k, k))
        for i, k, off in zip(PLACES, SLOPES, PROVED, strict=True)
    )
    settle, step = np.linalg.inv(B) @ (np.eye(2) - A), np.linalg.inv(B) @ np.hstack([-A, np.eye(2)])
    real = RealMaps(M, state, (settle, np.zeros(2)), (step, np.zeros(2)), A, B)
    off = error_bounds(real, BITS, COUNTS, CUT)
    bits = BITS.displacement, BITS.state, BITS.drive, BITS.drive, BITS.target
    e_z, e_s, e_u, e_cut, e_t = (c * 2.0**-b for c, b in zip((*COUNTS, CUT, np.full(2, 0.5)), bits, strict=True))
    signs = [np.array(s) for s in product((-1.0, 1.0), repeat=2)]
    worst = {name: np.zeros(2) for name in ("target", "displacement", "state", "drive", "stage")}

    def seen(name, error):
        worst[name] = np.maximum(worst[name], np.abs(error))

    for of_z, of_s, of_p in product(signs, signs, signs):
        z = of_z * e_z
        s = SLOPES * (z[PLACES] + of_p * PROVED) + of_s * e_s
        seen("target", M @ (of_z * e_t)), seen("displacement", z), seen("state", s)
        for of_u in signs:
            x = np.linalg.solve(np.eye(2) - A, B @ (settle @ s + of_u * (e_u + e_cut)))
            stands = np.zeros(2)
            stands[PLACES] = x / SLOPES
            seen("stage", stands)
            for before in (s, -s):  # the state before has errors of its own
                seen("drive", step @ np.concatenate([before, s]) + of_u * e_u)
            seen("drive", settle @ s + of_u * e_u)
    for name, size in worst.items():
        assert np.allclose(getattr(off, name), size, rtol=1e-12), name
    # what a state is off is a displacement by the flattest slope of its polynomial, and the other way round by the steepest
    curved = tuple((i, replace(p, flattest=k / 2, steepest=3 * k)) for (i, p), k in zip(state, SLOPES, strict=True))
    of_curved = error_bounds(replace(real, state=curved), BITS, COUNTS, CUT)
    by_place = np.zeros(2)
    by_place[PLACES] = PROVED
    assert np.allclose(of_curved.stage, e_z + by_place + 2 * (off.stage - e_z - by_place), rtol=1e-12)
    assert np.allclose(of_curved.state, off.state + SLOPES * (2 * e_z[PLACES] - PROVED / 2), rtol=1e-12)


def test_a_polynomial_that_serves_one_mode_alone_is_refused(monkeypatch):
    device = load_device(SCENARIOS / "devices" / "mems_hexapod.toml")
    kernels = controller_of(build_model(device), "pose", 1e-3).kernels
    of_rest = real_maps(kernels).state
    (place, polynomial), *others = of_rest
    for changed in (
        (place + 1, polynomial),
        (place, replace(polynomial, coefficients=polynomial.coefficients * (1 + 1e-9))),
    ):
        answers = iter([of_rest, (changed, *others)])
        monkeypatch.setattr(fixed_maps, "state_polynomials", lambda *_, given=answers, **__: next(given))
        with pytest.raises(NoFixedPoint, match="do not follow from one displacement each"):
            real_maps(kernels)
