"""Maps and polynomials in integers of 32 bits are off by no more than they say, and never overflow."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics.proven_polynomial import proven_polynomial
from ctrlgen.numerics.scaled_integers import DoesNotFit, integer_polynomial, integer_rows


def test_integer_maps_are_off_by_no_more_than_they_say_whatever_the_sizes():
    rng = np.random.default_rng(3)
    for _ in range(20):
        slope = rng.normal(size=(3, 4)) * 10.0 ** rng.integers(-6, 7)
        bits_in, bits_out = rng.integers(5, 40, 4), np.full(3, 0)
        at_zero = rng.normal(size=3) * np.abs(slope).max()
        largest = np.full(4, 2.0**31)
        reach = np.abs(slope) @ (largest * 2.0**-bits_in) + np.abs(at_zero)
        bits_out = np.floor(np.log2(2.0**30 / reach)).astype(int)
        rows = integer_rows(slope, at_zero, (bits_in, bits_out), largest, largest)
        values = rng.integers(-(2**31), 2**31, (200, 4))
        values[0] = np.where(np.array(rows.coefficients[0]) > 0, 2**31 - 1, -(2**31))
        off = [np.abs(rows(v) - (slope @ (v * 2.0**-bits_in) + at_zero) * 2.0**bits_out) for v in values]
        assert np.all(np.max(off, axis=0) <= rows.off * (1 + 1e-6)) and np.all(rows.off < 40)
        for row, o in zip(rows.coefficients, rows.offset, strict=True):
            assert max(map(abs, row)) < 2**31 and sum(abs(c) * 2**31 for c in row) + abs(o) < 2**62
    with pytest.raises(DoesNotFit):
        integer_rows(np.array([[1e9]]), np.zeros(1), (np.zeros(1), np.zeros(1)), np.array([2.0**31]), np.ones(1))


@pytest.mark.parametrize("low", [0.0, 1.5, -0.6])
def test_integer_polynomials_are_off_by_no_more_than_they_say(low):
    v = ca.SX.sym("v")
    f = ca.Function("f", [v], [ca.exp(v) - 3])
    polynomial = proven_polynomial(f, low, 2.0, 1e-8)
    bits_in, bits_out = 28, 24
    ends = round(low * 2**bits_in), round(2.0 * 2**bits_in)
    integers = integer_polynomial(polynomial, (bits_in, bits_out), ends)
    exact = np.polynomial.Polynomial(polynomial.coefficients)
    places = np.linspace(*ends, 3001).astype(int)
    off = [
        abs(integers(int(p)) - exact((p * 2.0**-bits_in - polynomial.centre) / polynomial.half) * 2.0**bits_out)
        for p in places
    ]
    assert 0.1 * integers.off < max(off) <= integers.off < 10
    assert max(map(abs, integers.coefficients)) < 2**31
    with pytest.raises(DoesNotFit):
        integer_polynomial(polynomial, (bits_in, 29), ends)


def test_a_middle_that_the_argument_cannot_say_is_in_the_bound():
    v = ca.SX.sym("v")
    polynomial = proven_polynomial(ca.Function("f", [v], [ca.exp(v)]), 1.1, 2.0, 1e-8)
    integers = integer_polynomial(polynomial, (9, 24), (564, 1024))  # 1.55 * 2^9 = 793.6
    exact = np.polynomial.Polynomial(polynomial.coefficients)
    off = [
        abs(integers(p) - exact((p * 2.0**-9 - polynomial.centre) / polynomial.half) * 2.0**24)
        for p in range(564, 1025)
    ]
    assert 0.8 * integers.off < max(off) <= integers.off
