"""Affine maps and polynomials in integers of 32 bits with products of 64, each with a bound of what rounding makes of them.

A number v is an integer V that counts 2^-b of its unit; b, its bits, may be negative. A map is computed as

    V_out = (sum_j C_j V_j + O) / 2^s,      rounded to nearest,

with integers C_j, O, and s as large as intervals over the arguments permit: every |C_j V_j| and every sum is below 2^62, every C_j below
2^31. A polynomial is Horner's rule in the same way, one shift a step. So nothing overflows. The bounds take in that C_j and O are rounded,
and the rounding at the end. They are rigorous up to roundings of double precision, which are 2^-21 of those of 32 bits.
Source: R. E. Moore, Interval Analysis (1966); R. Yates, Fixed-Point Arithmetic: An Introduction (2013).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, floor

import numpy as np

from ctrlgen.numerics.proven_polynomial import ProvenPolynomial

LARGEST = 2**31 - 1  # of a coefficient, an argument and an intermediate value: int32_t
ROOM = 2**62  # of a sum of products: int64_t has another binary digit, which the rounding takes
MOST_SHIFT = 61  # binary digits by which a sum is shifted
STEP = 30  # binary digits of a polynomial's argument: it is below 2^30


class DoesNotFit(Exception):
    """Numbers whose sizes are too far apart for integers of 32 bits."""


def bits_for(size: float, most: int) -> int:
    """The most bits with which a magnitude `size` > 0 is an integer of at most `most`."""
    bits = floor(np.log2(most / size))
    return bits if size * 2.0**bits <= most else bits - 1


def shifted(value: int, shift: int) -> int:
    """value / 2^shift, halves up, as the C has it."""
    return (value + (1 << (shift - 1))) >> shift


@dataclass(frozen=True)
class IntegerRows:
    """An affine map: `coefficients` (n_out, n_in), `offset` (n_out,), `shift`; `off` (n_out,), by how many counts the result is off
    that of the real map of the same arguments at most."""

    coefficients: tuple[tuple[int, ...], ...]
    offset: tuple[int, ...]
    shift: int
    off: np.ndarray

    def __call__(self, arguments: np.ndarray) -> np.ndarray:
        """The integers (n_out,) that the C computes of integers (n_in,)."""
        given = [int(v) for v in arguments]
        return np.array(
            [
                shifted(sum(c * v for c, v in zip(row, given, strict=True)) + o, self.shift)
                for row, o in zip(self.coefficients, self.offset, strict=True)
            ]
        )


def integer_rows(
    slope: np.ndarray, at_zero: np.ndarray, bits: tuple[np.ndarray, np.ndarray], largest: np.ndarray, usual: np.ndarray
) -> IntegerRows:
    """slope (n_out, n_in) v + at_zero (n_out,) in integers. `bits` of arguments and of results; `largest` magnitudes (n_in,) that the
    arguments' integers can have, and the `usual` ones, for which the bound holds. Raises DoesNotFit."""
    bits_in, bits_out = bits
    exact = slope * 2.0 ** (bits_out[:, None] - bits_in[None, :])
    constant = at_zero * 2.0**bits_out
    size = max(float(np.abs(exact).max(initial=0.0)), 2.0**-MOST_SHIFT)
    total = float((np.abs(exact) @ largest + np.abs(constant)).max(initial=0.0))
    shift = min(MOST_SHIFT, bits_for(size, LARGEST), bits_for(max(total, 1.0), ROOM // 2))
    if shift < 1:
        raise DoesNotFit
    scaled, offset = np.rint(exact * 2.0**shift), np.rint(constant * 2.0**shift)
    wrong = np.abs(scaled * 2.0**-shift - exact) @ usual + np.abs(offset * 2.0**-shift - constant)
    return IntegerRows(
        tuple(tuple(int(c) for c in row) for row in scaled), tuple(int(o) for o in offset), shift, 0.5 + wrong
    )


@dataclass(frozen=True)
class IntegerPolynomial:
    """Horner's rule: value_n = coefficients_0, value_k-1 = (value_k V) / 2^shift + coefficient, V the argument less `centre`.

    `off`: by how many counts the result is off that of the real polynomial of the same argument at most.
    """

    centre: int
    coefficients: tuple[int, ...]  # the highest power first
    shifts: tuple[int, ...]  # of the steps, one fewer
    off: float

    def __call__(self, argument: int) -> int:
        """The integer that the C computes."""
        value = self.coefficients[0]
        for coefficient, shift in zip(self.coefficients[1:], self.shifts, strict=True):
            value = shifted(value * (int(argument) - self.centre), shift) + coefficient
        return value


def integer_polynomial(polynomial: ProvenPolynomial, bits: tuple[int, int], ends: tuple[int, int]) -> IntegerPolynomial:
    """`polynomial` of an argument and with a result of these `bits`, the argument's integers between these `ends`, which are below 2^30.
    Raises DoesNotFit."""
    bits_in, bits_out = bits
    centre = round(polynomial.centre * 2.0**bits_in)
    low, high = ends[0] - centre, ends[1] - centre
    if max(-low, high) >= 2**STEP:
        raise DoesNotFit
    argument = np.array([low, high]) / 2.0**STEP
    powers = np.arange(len(polynomial.coefficients))
    exact = polynomial.coefficients * (2.0 ** (STEP - bits_in) / polynomial.half) ** powers
    values = _horner_intervals(exact, argument)  # of the highest power first
    sizes = [max(float(np.abs(v).max()), 2.0**-900) for v in values]
    fits = [bits_for(size, LARGEST // 2) for size in sizes]
    fits[-1] = bits_out
    # A step shifts by STEP and by what the result has fewer bits than the value before
    for k in range(len(fits) - 2, -1, -1):
        fits[k] = min(fits[k], fits[k + 1] + MOST_SHIFT - STEP)
    for k in range(1, len(fits) - 1):
        fits[k] = min(fits[k], fits[k - 1] + STEP - 1)
    shifts = [STEP + before - after for before, after in pairwise(fits)]
    if sizes[-1] * 2.0**bits_out >= LARGEST - len(fits) or min(shifts, default=1) < 1:
        raise DoesNotFit
    scaled = [c * 2.0**f for c, f in zip(exact[::-1], fits, strict=True)]
    coefficients = tuple(round(c) for c in scaled)
    if max(map(abs, coefficients)) > LARGEST:
        raise DoesNotFit
    reach, off = float(np.abs(argument).max()), abs(coefficients[0] - scaled[0])
    for k, shift in enumerate(shifts, 1):
        off = off * reach * 2.0 ** (STEP - shift) + 0.5 + abs(coefficients[k] - scaled[k])
    shown = abs(polynomial.centre * 2.0**bits_in - centre)  # counts of the argument
    steepness = polynomial.steepest * 2.0 ** (bits_out - bits_in)
    return IntegerPolynomial(centre, coefficients, tuple(shifts), off + shown * steepness)


def _horner_intervals(coefficients: np.ndarray, argument: np.ndarray) -> list[np.ndarray]:
    """Low and high of Horner's values, the highest power first."""
    values = [np.full(2, coefficients[-1])]
    for c in coefficients[-2::-1]:
        products = np.outer(values[-1], argument)
        values.append(np.array([products.min(), products.max()]) + c)
    return values


def counts(value: float, bits: int, up: bool) -> int:
    """A number as an integer of counts: the one not below it where `up`, else the one not above."""
    scaled = value * 2.0**bits
    return ceil(scaled) if up else floor(scaled)
