"""Circular hinges in mechanisms: their compliance, their limits, and the rotations that they leave."""

from __future__ import annotations

import numpy as np
import pytest
from mechanism_files import HINGE, dm, hinged, loaded, with_values
from scipy.integrate import quad

from ctrlgen import build_model
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.constraints import freedoms


def test_a_circular_hinge_is_that_of_its_equations_in_the_plane_and_of_beam_theory_out_of_it(tmp_path):
    """Against quadrature over the profile; the arm's stiffness is that of S2 C.1-C.4 about its end."""
    c = Condensed(*with_values(loaded(tmp_path, hinged(1.0))))
    C = dm(c.compliances[0])
    R, t, b, E, nu = 2e-3, 0.3e-3, 8e-3, 130e9, 0.28
    G = E / (2 * (1 + nu))
    I_0, I_2, I_3 = (
        quad(lambda x, f=f: f(x, t + 2 * R - 2 * np.sqrt(R * R - x * x)), -R, R, epsabs=0, epsrel=1e-12, limit=200)[0]
        for f in (lambda x, h: 1 / h, lambda x, h: x * x / h, lambda x, h: 1 / h**3)
    )
    alpha = 12 * I_3 / (E * b)
    assert C[2, 5] == pytest.approx(alpha, rel=1e-9) and C[4, 5] == C[2, 1] == pytest.approx(R * alpha, rel=1e-9)
    assert C[3, 0] == pytest.approx(I_0 / (E * b), rel=1e-9)
    assert C[1, 4] == pytest.approx(12 * I_0 / (E * b**3), rel=1e-9)
    assert C[5, 4] == C[1, 2] == pytest.approx(-R * 12 * I_0 / (E * b**3), rel=1e-9)
    assert C[5, 2] == pytest.approx(12 * (R**2 * I_0 + I_2) / (E * b**3) + 1.2 * I_0 / (G * b), rel=1e-9)
    assert C[0, 3] < min(3 * I_3 / (G * b), 12 * (C[4, 1] - R**2 * alpha) * 1.01 / b**2)  # either way of yielding alone
    assert C[0, 3] < 0.1 * alpha
    assert dm(c.stiffness)[0, 0] == pytest.approx(1 / (C[4, 1] + 2 * 30e-3 * C[4, 5] + (30e-3) ** 2 * alpha), rel=1e-9)


def test_a_hinges_rotation_and_the_stress_of_its_neck_are_limits(tmp_path):
    """1 mm at 32 mm from the neck turns it by very nearly 1/32; 6 M K/(b t^2) there, K = (1 + t/2R)^0.45."""
    device = loaded(tmp_path, hinged(1.0))
    assert freedoms(device) == (1, 0)
    c, model = Condensed(*with_values(device)), build_model(device)
    limits = {limit.name: limit for limit in model.limits}
    d = 1e-3
    force = dm(c.stiffness)[0, 0] * d
    values = dict(
        zip(
            (limit.name for limit in model.limits),
            model.evaluate_limits(model.rest, [d], [0.0], model.p_nominal),
            strict=True,
        )
    )
    turn = float(values["rotation_notch"][0])
    assert turn == pytest.approx(force * (dm(c.compliances[0])[2, 1] + 30e-3 * dm(c.compliances[0])[2, 5]), rel=1e-9)
    assert turn == pytest.approx(d / 32e-3, rel=0.02) and limits["rotation_notch"].upper == pytest.approx(np.radians(1))
    bending = 6 * force * 32e-3 / (8e-3 * 0.3e-3**2) * (1 + 0.3 / 4) ** 0.45
    assert float(values["stress_silicon"][0]) == pytest.approx(bending, rel=1e-6)
    assert limits["stress_silicon"].channels == ("notch_neck",)
    assert any("notch: alpha_z_per_M_z at t/R = 0.15 by C.1" in text for text in device.remarks())


def test_the_rotations_of_hinges_in_a_row_add_up(tmp_path):
    text = hinged(1.0).replace('[[body]]\nname = "plate"', '[[body]]\nname = "plate"\n[[body]]\nname = "link"')
    text = text.replace('to = "plate"\nat = ["2 mm"', 'to = "link"\nat = ["2 mm"')
    second = HINGE.format(name="second", first="link", to="plate", x=14, along="1, 0, 0", limit=1.0)
    device = loaded(tmp_path, text.replace("[[actuator]]", second + "[[actuator]]"))
    c = Condensed(*with_values(device))
    turns = [dm(c.rotation(k))[0, 0] for k in (0, 1)]
    assert min(turns) > 0 and sum(turns) == pytest.approx(dm(c.twists[device.bodies.index("plate")])[2, 0], rel=1e-9)


def test_two_hinges_on_one_line_leave_one_rotation_whichever_way_they_are_drawn(tmp_path):
    """Their necks stand one above the other at x = 0."""
    for x, along in ((2, "1, 0, 0"), (-2, "-1, 0, 0")):
        text = hinged(1.0).replace('"32 mm", "0 mm", "0 mm"', '"30 mm", "0 mm", "0 mm"')
        first = HINGE.format(name="notch", first="ground", to="plate", x=2, along="1, 0, 0", limit=1.0)
        assert first in text
        second = HINGE.format(name="above", first="ground", to="plate", x=x, along=along, limit=1.0)
        second = second.replace(f'at = ["{x} mm", "0 mm", "0 mm"]', f'at = ["{x} mm", "0 mm", "20 mm"]')
        assert freedoms(loaded(tmp_path, text.replace(first, first + second))) == (1, 5)
