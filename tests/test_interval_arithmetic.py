"""Bounds of every operation of a graph hold whatever its arguments are."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics.interval_arithmetic import bounds

a, b = ca.SX.sym("a"), ca.SX.sym("b")
EXPRESSIONS = {
    "sum": a + b,
    "difference": a - b,
    "product": a * b,
    "quotient": a / (b + 5),
    "negative": -a,
    "square": a**2 * b,
    "twice": 2 * a,
    "inverse": 1 / (b - 9),
    "root": ca.sqrt(a**2 + 1),
    "magnitude": ca.fabs(a) * b,
    "least": ca.fmin(a, b),
    "most": ca.fmax(a, 0.3),
    "exponential": ca.exp(a),
    "saturated": ca.tanh(b),
    "wave": ca.sin(a) + ca.cos(b),
    "sign": ca.sign(a),
    "choice": ca.if_else(a < b, a, 2 * b),
    "logic": ca.logic_and(a < b, ca.logic_not(a)),
    "unknown": ca.atan2(a, b),
    "pole": a / b,
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_every_value_is_between_its_bounds(name, rng):
    f = ca.Function("f", [a, b], [EXPRESSIONS[name]], ["a", "b"], ["r"])
    for _ in range(20):
        (a_0, a_1), (b_0, b_1) = np.sort(rng.uniform(-3, 3, (2, 2)), axis=1)
        low, high = bounds(f, {"a": (np.array([a_0]), np.array([a_1])), "b": (np.array([b_0]), np.array([b_1]))})
        values = f.map(500)(rng.uniform(a_0, a_1, (1, 500)), rng.uniform(b_0, b_1, (1, 500))).full()
        assert np.all(values >= low[0] - 1e-12) and np.all(values <= high[0] + 1e-12)
        if name not in ("unknown", "pole"):
            assert np.isfinite([low[0], high[0]]).all()
