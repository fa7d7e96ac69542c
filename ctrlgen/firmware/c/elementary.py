"""C text of the elementary functions, so that the generated C calls no library.

Each argument is reduced to a short range (by halves of ln 2, quarter turns, the reciprocal or the root), on which a polynomial
is evaluated. The polynomial interpolates the function's Taylor series at Chebyshev points and has the lowest degree whose error
is a small fraction of a rounding. It is computed in integers of many bits, so that every machine prints the same digits.

NaN gives NaN, every finite argument a finite number, but the root of a negative one. The square root is rounded correctly, by the
core's own instruction or in integers. The comment above each C function says what it returns where C's own would be infinite or undefined.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render

PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")
ERROR_SHARE = 64  # a polynomial's error is at most one rounding divided by this
BITS, TERMS = 200, 100  # of the series: far more than double needs
# Angle [rad] up to which sine, cosine and tangent are accurate to the last digits.
TURNS = {Real.DOUBLE: 1e5, Real.FLOAT: 1e4}
# Angle [rad] beyond which quarter turns overflow 32 bits (double) or rounding is too coarse (float).
TURN_END = {Real.DOUBLE: 2.0**31, Real.FLOAT: 2.0**20}
ASIN_NEAR, TANH_NEAR, SINH_NEAR = 0.5625, 0.625, 1.0  # argument up to which the series itself is used
# Square roots by the instructions of cores, correctly rounded by IEEE 754
ROOTS = {
    Real.FLOAT: {
        "arm": "vsqrt.f32 %0, %1",
        "arm_places": '"=t"(y) : "t"(a)',
        "aarch64": "fsqrt %s0, %s1",
        "sse": "sqrtss %1, %0",
    },
    Real.DOUBLE: {
        "arm": "vsqrt.f64 %P0, %P1",
        "arm_places": '"=w"(y) : "w"(a)',
        "aarch64": "fsqrt %d0, %d1",
        "sse": "sqrtsd %1, %0",
    },
}
# Function -> the functions that it calls
NEEDS = {
    "sine": ("quarters",),
    "cosine": ("quarters",),
    "tangent": ("quarters",),
    "arctangent2": ("arctangent",),
    "arcsine": ("square_root", "small_arcsine"),
    "arccosine": ("square_root", "small_arcsine"),
    "hyperbolic_tangent": ("exponential",),
    "hyperbolic_sine": ("exponential",),
    "hyperbolic_cosine": ("exponential",),
    "power": ("exponential", "logarithm", "whole_below"),
}


def elementary_text(calls: Iterable[str], real: Real) -> str:
    """The C of the static functions in `calls` and of those they need, in an order in which each is known before its use."""
    wanted = set(calls)
    wanted |= {name for call in wanted for name in NEEDS.get(call, ())}
    return render("elementary.c", _context(real) | {"wanted": wanted}).strip("\n") + "\n" if wanted else ""


@lru_cache
def _context(real: Real) -> dict[str, Any]:
    """What the templates of elementary functions read in one arithmetic: names, numbers and tables."""
    kind = np.finfo(np.float64 if real is Real.DOUBLE else np.float32)
    fraction, bias = kind.nmant, kind.maxexp - 1
    width, end = (64, "ULL") if real is Real.DOUBLE else (32, "U")
    ln2, half_pi = _log_two(), PI / 2
    exact = math.ceil(math.log2(TURNS[real] / (math.pi / 2) + 1))  # bits of the number of quarter turns
    one_bits = bias << fraction
    middle = _bits(math.sqrt(0.5), real)
    last = 2 ** (bias + 1)
    high, low = float(ln2 * (bias + 1)), float(ln2 * (1 - bias))
    inward = 1 - 4 * real.epsilon
    return {
        "real": real,
        "word": f"uint{width}_t",
        "signed": f"int{width}_t",
        "fraction": fraction,
        "bias": float(bias),
        # 1/sqrt from half the exponent (the constants minimise the largest relative error, 3.4 %; a step
        # y (1.5 - a y^2/2) takes an error e to 1.5 e^2), one step for the root itself, and the last digit in integers
        "root_guess": "0x5F3759DFU" if real is Real.FLOAT else "0x5FE6EB50C7B537A9ULL",
        "root_steps": 2 if real is Real.FLOAT else 3,
        "roots": ROOTS[real],
        "arm_fp": 4 if real is Real.FLOAT else 8,
        "bias_bits": f"{bias}{end}",
        "root_up": 4.0 ** ((fraction + 2) // 2),
        "root_down": 0.5 ** ((fraction + 2) // 2),
        "mask": f"0x{(1 << fraction) - 1:X}{end}",
        "hidden": f"0x{1 << fraction:X}{end}",
        "infinity": f"0x{2 * kind.maxexp - 1 << fraction:X}{end}",
        "not_a_number": f"0x{(2 * kind.maxexp - 1 << fraction) + (1 << (fraction - 1)):X}{end}",
        "sign": f"0x{1 << (width - 1):X}{end}",
        "largest": float(kind.max),
        "smallest": float(kind.tiny),
        "one_bits": f"0x{one_bits:X}{end}",
        "log_offset": f"0x{one_bits - middle:X}{end}",
        "log_up": 2.0 ** (fraction + 2),
        "log_up_bits": float(fraction + 2),
        "exp_high": high * inward,
        "exp_low": low * inward,
        "last": last,
        "per_ln2": float(1 / ln2),
        "ln2": _parts(ln2, fraction + 1, last.bit_length().bit_length(), 2),
        "per_quarter": float(1 / half_pi),
        "quarter": _parts(half_pi, fraction + 1, exact, 3 if real is Real.DOUBLE else 4),
        "half_pi": _parts(half_pi, fraction + 1, 0, 2),
        "turn_exact": TURNS[real],
        "turn_end": TURN_END[real],
        "atan_half": _parts(_arctan_half(), fraction + 1, 0, 2),
        "asin_near": ASIN_NEAR,
        "atan_low": math.sqrt(2) - 1,
        "atan_high": math.sqrt(2) + 1,
        "tanh_near": TANH_NEAR,
        "sinh_near": SINH_NEAR,
        "all_whole": 2.0**fraction,
        "horner": partial(_horner, real),
    }


def _horner(real: Real, name: str, variable: str, indent: int = 4) -> str:
    """Statements that leave a polynomial's value in p."""
    first, *others = (c for c in reversed(polynomial(name, real)))
    lines = [f"p = {real.literal(first)};"]
    lines += [f"p = (p * {variable}) {'-' if c < 0 else '+'} {real.literal(abs(c))};" for c in others]
    return "\n".join(" " * indent + line for line in lines)


@dataclass(frozen=True)
class Economised:
    """A power series, to be used between `low` and `high`; an error of it is `weight` times that of the function, relatively."""

    series: Callable[[int], Fraction]
    low: float
    high: float
    weight: float


@lru_cache
def _tanh_terms() -> tuple[Fraction, ...]:
    """(tanh(x) - x)/x^3 in powers of x^2, from t' = 1 - t^2: (2 k + 1) t_k = -sum t_i t_(k - 1 - i)."""
    t = [Fraction(1)]
    for k in range(1, TERMS + 1):
        total = sum((t[i] * t[k - 1 - i] for i in range(k)), Fraction(0))
        t.append(Fraction(_fixed(-total / (2 * k + 1)), 1 << BITS))
    return tuple(t[1:])


def _odd(sign: int) -> Callable[[int], Fraction]:
    return lambda k: Fraction(sign ** (k + 1), math.factorial(2 * k + 3))


_WIDER = 1.001  # than the reduced range: arguments may leave it by rounding
_HALF = math.log(2) / 2 * _WIDER
_EIGHTH = (math.pi / 4 * _WIDER) ** 2
_ATAN = (math.sqrt(2) - 1) ** 2 * _WIDER
_LOG = _ATAN**2  # (f/(2 + f))^2 for 1 + f = sqrt(2)
SERIES = {
    # (e^x - 1 - x)/x^2 in x, (ln((1 + x)/(1 - x)) - 2 x)/x^3 and the others (f(x) - x)/x^3 in x^2, (cos x - 1 + x^2/2)/x^4 in x^2
    "exponential": Economised(lambda k: Fraction(1, math.factorial(k + 2)), -_HALF, _HALF, _HALF**2),
    "logarithm": Economised(lambda k: Fraction(2, 2 * k + 3), 0.0, _LOG, _LOG / 2),
    "sine": Economised(_odd(-1), 0.0, _EIGHTH, _EIGHTH),
    "cosine": Economised(lambda k: Fraction((-1) ** k, math.factorial(2 * k + 4)), 0.0, _EIGHTH, _EIGHTH**2 / 0.7),
    "tangent": Economised(lambda k: abs(_tanh_terms()[k]), 0.0, _EIGHTH, _EIGHTH),
    "arctangent": Economised(lambda k: Fraction((-1) ** (k + 1), 2 * k + 3), 0.0, _ATAN, _ATAN),
    "arcsine": Economised(
        lambda k: Fraction(math.comb(2 * k + 2, k + 1), 4 ** (k + 1) * (2 * k + 3)), 0.0, ASIN_NEAR**2, ASIN_NEAR**2
    ),
    "hyperbolic_tangent": Economised(lambda k: _tanh_terms()[k], 0.0, TANH_NEAR**2, TANH_NEAR**2 / 0.88),
    "hyperbolic_sine": Economised(_odd(1), 0.0, SINH_NEAR**2, SINH_NEAR**2),
}


@lru_cache
def polynomial(name: str, real: Real) -> tuple[float, ...]:
    """Coefficients, lowest first, of the polynomial of least degree through a series of `SERIES` in the Chebyshev points of
    its range whose error is at most one over `ERROR_SHARE` of a rounding. In fixed point of `BITS` bits."""
    one = SERIES[name]
    terms = _terms(name)
    tolerance = round(real.epsilon / 2 / ERROR_SHARE / one.weight * 2.0**100) << (BITS - 100)
    for degree in range(1, len(terms)):
        points = [_chebyshev(k + 0.5, degree + 1, one.low, one.high) for k in range(degree + 1)]
        coefficients = _through(points, [_sum(terms, x) for x in points])
        between = [_chebyshev(k, degree + 1, one.low, one.high) for k in range(degree + 2)]
        if all(abs(_sum(coefficients, x) - _sum(terms, x)) <= tolerance for x in between):
            break
    return tuple(float(Fraction(c, 1 << BITS)) for c in coefficients)


@lru_cache
def _terms(name: str) -> tuple[int, ...]:
    return tuple(_fixed(SERIES[name].series(k)) for k in range(TERMS))


def _fixed(value: Fraction) -> int:
    return round(value * (1 << BITS))


def _chebyshev(k: float, n: int, low: float, high: float) -> int:
    """Rounded to few bits: the points need not be exact, only the same everywhere."""
    return round((low + high + (high - low) * math.cos(math.pi * k / n)) * 2**30) << (BITS - 31)


def _sum(coefficients: Sequence[int], x: int) -> int:
    total = 0
    for c in reversed(coefficients):
        total = (total * x >> BITS) + c
    return total


def _through(points: list[int], values: list[int]) -> list[int]:
    """Coefficients, lowest first, of the polynomial through the points, by Newton's divided differences."""
    differences = list(values)
    for order in range(1, len(points)):
        for i in range(len(points) - 1, order - 1, -1):
            differences[i] = ((differences[i] - differences[i - 1]) << BITS) // (points[i] - points[i - order])
    coefficients = [0] * len(points)
    for x, d in zip(reversed(points), reversed(differences), strict=True):
        coefficients = [d - (x * coefficients[0] >> BITS), *(a - (x * b >> BITS) for a, b in pairwise(coefficients))]
    return coefficients


def _arctan_half() -> Fraction:
    terms = (Fraction((-1) ** k, (2 * k + 1) * 2 ** (2 * k + 1)) for k in range(TERMS))
    return Fraction(_fixed(sum(terms, Fraction(0))), 1 << BITS)


def _log_two() -> Fraction:
    """ln 2 = 2 artanh(1/3)."""
    terms = (Fraction(2, (2 * k + 1) * 3 ** (2 * k + 1)) for k in range(70))
    return Fraction(_fixed(sum(terms, Fraction(0))), 1 << BITS)


def _parts(value: Fraction, digits: int, spare: int, number: int) -> list[float]:
    """`value` as a sum of numbers; all but the last leave `spare` of the `digits` bits free, so that their products with
    whole numbers of so many bits are exact."""
    parts = []
    for i in range(number):
        left = digits - (spare if i < number - 1 else 0)
        unit = Fraction(2) ** (math.floor(math.log2(abs(value))) + 1 - left)
        parts.append(float(round(value / unit) * unit))
        value -= Fraction(parts[-1])
    return parts


def _bits(value: float, real: Real) -> int:
    """The bits of a number, as an integer."""
    if real is Real.DOUBLE:
        return int(np.float64(value).view(np.uint64))
    return int(np.float32(value).view(np.uint32))
