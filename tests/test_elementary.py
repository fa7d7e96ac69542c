"""Elementary functions in C of their own: accuracy, special values, no library, the same bits on a microcontroller."""

from __future__ import annotations

import ctypes
import importlib.util
import math
import re
import shutil
import subprocess
from decimal import Decimal, localcontext
from pathlib import Path

import numpy as np
import pytest

from ctrlgen.firmware.c import elementary
from ctrlgen.firmware.c.elementary import TURN_END, TURNS, elementary_text, polynomial
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import COMPILERS, FLAGS
from ctrlgen.verification.cores import M4F, cross_compile, cross_compilers
from ctrlgen.verification.emulation import Machine, available

EXACT = np.longdouble
PRECISE = np.finfo(EXACT).eps < 1e-18  # where it is no longer than a double, doubles are held to libm's own error
PI_2 = EXACT("1.5707963267948966192313216916397514420985846996875529")
KIND = {Real.DOUBLE: np.float64, Real.FLOAT: np.float32}
ONE = {
    "square_root": np.sqrt,
    "exponential": np.exp,
    "logarithm": np.log,
    "sine": np.sin,
    "cosine": np.cos,
    "tangent": np.tan,
    "arctangent": np.arctan,
    "arcsine": np.arcsin,
    "arccosine": np.arccos,
    "hyperbolic_tangent": np.tanh,
    "hyperbolic_sine": np.sinh,
    "hyperbolic_cosine": np.cosh,
    "whole_below": np.floor,
    "whole_above": np.ceil,
}
TWO = {"arctangent2": np.arctan2, "power": np.power}
# Largest errors in units of the last place, a little above what random search finds (0.85, 0.95, 0.92, 0.91 ...).
ULP = {
    "square_root": 0.5,
    "exponential": 1.1,
    "logarithm": 1.1,
    "sine": 1.1,
    "cosine": 1.1,
    "tangent": 1.9,
    "arctangent": 1.1,
    "arcsine": 2.0,
    "arccosine": 1.6,
    "hyperbolic_tangent": 1.6,
    "hyperbolic_sine": 1.9,
    "hyperbolic_cosine": 1.6,
    "whole_below": 0.0,
    "whole_above": 0.0,
    "arctangent2": 1.8,
}
ZERO_AT_ZERO = (
    "square_root",
    "sine",
    "tangent",
    "arctangent",
    "arcsine",
    "hyperbolic_tangent",
    "hyperbolic_sine",
    "whole_below",
)
N = 50_000


def source(real: Real, text: str | None = None) -> str:
    """All functions, and for each a loop over an array that others can call."""
    lines = ["#include <stdint.h>", elementary_text([*ONE, *TWO], real) if text is None else text]
    for name in [*ONE, *TWO]:
        arguments = "ab"[: 1 if name in ONE else 2]
        head = f"void {name}s({''.join(f'const {real.value} *{a}, ' for a in arguments)}{real.value} *r, int n)"
        call = f"{name}({', '.join(f'{a}[i]' for a in arguments)})"
        lines.append(f"{head};\n{head}\n{{\n    int i;\n    for (i = 0; i < n; i++) {{ r[i] = {call}; }}\n}}\n")
    return "\n".join(lines)


class Library:
    """The compiled functions of one arithmetic, on arrays."""

    def __init__(self, real: Real, compiler: str, folder: Path, text: str | None = None, *options: str) -> None:
        self.real, self.kind = real, KIND[real]
        file = folder / f"{compiler}_{real.suffix}{len(options)}.c"
        file.write_text(source(real, text))
        flags = [*FLAGS, *options, "-shared", "-fPIC", str(file), "-o", str(file.with_suffix(".so"))]
        done = subprocess.run([compiler, *flags], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[:3000]
        self._c = ctypes.CDLL(str(file.with_suffix(".so")))

    def __call__(self, name: str, *arguments: np.ndarray) -> np.ndarray:
        given = [np.ascontiguousarray(a, dtype=self.kind) for a in arguments]
        result = np.empty_like(given[0])
        getattr(self._c, f"{name}s")(*(ctypes.c_void_p(a.ctypes.data) for a in (*given, result)), len(result))
        return result

    def worst(self, name: str, *arguments: np.ndarray) -> float:
        """Largest error in units of the last place of the exact result."""
        given = [np.asarray(a, dtype=self.kind) for a in arguments]
        exact = (ONE | TWO)[name](*(a.astype(EXACT) for a in given))
        unit = np.spacing(np.maximum(np.abs(exact).astype(self.kind), np.finfo(self.kind).tiny)).astype(EXACT)
        return float(np.max(np.abs(self(name, *given).astype(EXACT) - exact) / unit))


@pytest.fixture(scope="module", params=COMPILERS)
def libraries(request, tmp_path_factory) -> dict[Real, Library]:
    if not shutil.which(request.param):
        pytest.skip(f"{request.param} is missing: the elementary functions were not built by it")
    folder = tmp_path_factory.mktemp("elementary")
    return {real: Library(real, request.param, folder) for real in Real}


def points(name: str, real: Real, rng: np.random.Generator) -> list[np.ndarray]:
    """Arguments over the whole documented range: dense, random, of every size, near what is difficult."""
    kind = np.finfo(KIND[real])
    tiny, big = float(kind.tiny), float(kind.max) * 0.99

    def sized(low: float, high: float, signs: tuple[int, ...] = (-1, 1)) -> np.ndarray:
        return np.exp(rng.uniform(np.log(low), np.log(high), N)) * rng.choice(signs, N)

    turns, top = TURNS[real], np.log(float(kind.max)) - 1e-3
    if name in ("sine", "cosine", "tangent"):
        k = np.arange(-int(turns / 1.5708), int(turns / 1.5708))
        near = (k * PI_2).astype(KIND[real])  # next to zeros and poles
        near = np.concatenate([near, np.nextafter(near, KIND[real](np.inf)), np.nextafter(near, KIND[real](-np.inf))])
        return [np.linspace(-7, 7, N), rng.uniform(-turns, turns, N), sized(tiny, turns), near]
    return {
        "square_root": [sized(tiny, big, (1,)), np.linspace(0, 10, N)],
        "logarithm": [sized(tiny / 1e3, big, (1,)), np.linspace(0.4, 2.5, N)],
        "exponential": [np.linspace(np.log(tiny) + 1e-3, top, N), np.linspace(-1, 1, N), sized(tiny, 80)],
        "arcsine": [np.linspace(-1, 1, N), sized(tiny, 1), 1 - sized(1e-8, 1, (1,))],
        "arccosine": [np.linspace(-1, 1, N), sized(tiny, 1), 1 - sized(1e-8, 1, (1,))],
        "arctangent": [np.linspace(-4, 4, N), sized(tiny, big)],
        "whole_below": [np.linspace(-3, 3, N), sized(tiny, big), rng.integers(-999, 999, N) / 2],
        "whole_above": [np.linspace(-3, 3, N), sized(tiny, big), rng.integers(-999, 999, N) / 2],
    }.get(name, [np.linspace(-3, 3, N), sized(tiny, top)])


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("name", ONE)
def test_the_error_is_a_unit_in_the_last_place_or_two(libraries, name, real, rng):
    allowed = ULP[name] if PRECISE or real is Real.FLOAT else max(ULP[name] + 1, 0.0)
    for x in points(name, real, rng):
        assert libraries[real].worst(name, x) <= allowed


@pytest.mark.parametrize("options", [(), ("-DCTRLGEN_PORTABLE_SQRT",)], ids=["instruction", "portable"])
@pytest.mark.parametrize("real", list(Real))
def test_the_square_root_is_rounded_as_ieee_754_says(compiler, tmp_path, real, options, rng):
    """Bit for bit as numpy's: dense and random over all sizes, subnormal ones, squares and their neighbours, and infinity."""
    c, kind = Library(real, compiler, tmp_path, None, *options), np.finfo(KIND[real])
    word = np.uint32 if real is Real.FLOAT else np.uint64
    everything = rng.integers(0, np.array(np.inf, KIND[real]).view(word), 1_000_000, dtype=word).view(KIND[real])
    digits = (1 + np.arange(2**20) * 2.0**-20).astype(KIND[real])
    odd = rng.integers(2**22, 2**23, N).astype(np.float64) / 2**11
    squares = (odd * odd).astype(KIND[real])
    near = [np.nextafter(squares, KIND[real](side)) for side in (0, np.inf)]
    subnormal = np.arange(1, 2000).astype(word).view(KIND[real])
    for a in (
        everything,
        digits,
        2 * digits,
        squares,
        *near,
        subnormal,
        [kind.max, kind.tiny, np.inf, 0.0, -0.0, -1.0, np.nan],
    ):
        a = np.asarray(a, dtype=KIND[real])
        with np.errstate(invalid="ignore"):
            assert np.array_equal(c("square_root", a), np.sqrt(a), equal_nan=True)


@pytest.mark.parametrize("real", list(Real))
def test_two_arguments(libraries, real, rng):
    c = libraries[real]
    y, x = (np.exp(rng.uniform(-20, 20, N)) * rng.choice((-1, 1), N) for _ in range(2))
    assert c.worst("arctangent2", y, x) <= ULP["arctangent2"]
    assert c.worst("arctangent2", rng.uniform(-1, 1, N), rng.uniform(-1, 1, N)) <= ULP["arctangent2"]
    a, b = np.exp(rng.uniform(-5, 5, N)).astype(c.kind), rng.uniform(-7, 7, N).astype(c.kind)
    exact = a.astype(EXACT) ** b.astype(EXACT)
    error = np.abs(c("power", a, b) / exact - 1) / real.epsilon
    assert np.max(error / (1 + np.abs(b * np.log(a)))) <= 2
    whole = np.array([-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0])
    assert c("power", np.full(7, -2.0), whole) == pytest.approx((-2.0) ** whole, rel=8 * real.epsilon)
    assert c("power", [-2.0, 0.0, 0.0, 0.0], [0.5, 2.0, -1.0, 0.0]).tolist() == [0, 0, np.finfo(c.kind).max, 1]
    corners = c("arctangent2", [0.0, 0.0, 0.0, 1.0, -1.0], [0.0, 1.0, -1.0, 0.0, 0.0])
    assert corners.tolist() == np.arctan2(*np.array([[0, 0, 0, 1, -1], [0, 1, -1, 0, 0]], dtype=c.kind)).tolist()


@pytest.mark.parametrize("real", list(Real))
def test_special_values(libraries, real):
    c = libraries[real]
    kind = np.finfo(c.kind)
    big, small = float(kind.max), float(kind.smallest_subnormal)
    infinite = np.array([np.inf, -np.inf])
    for name in ONE:
        assert np.isnan(c(name, [np.nan])[0]), name
        finite = [0.0, -0.0, small, -small, 1.0, -1.0, 2.0, -2.0, 1e7, -1e7, 3e9, -3e9, 1e20, -1e20, big, -big]
        assert np.isfinite(c(name, finite[::2] if name == "square_root" else finite)).all(), name
        if name in ZERO_AT_ZERO:
            assert c(name, [0.0, -0.0]).tolist() == [0.0, 0.0], name
    for name in TWO:
        assert np.isnan(c(name, [np.nan, 1.0], [1.0, np.nan])).all()
    assert c("exponential", [0.0, *infinite, 1e4, -1e4]).tolist() == [1.0, big, 0.0, big, 0.0]
    assert c("logarithm", [1.0, 0.0, -1.0, -np.inf]).tolist() == [0.0, -big, -big, -big]
    assert c("logarithm", [np.inf, small]) == pytest.approx([np.log(big), np.log(small)], rel=4 * real.epsilon)
    assert c("hyperbolic_tangent", [*infinite, 50.0, -50.0]).tolist() == [1.0, -1.0, 1.0, -1.0]
    assert c("hyperbolic_cosine", [0.0, *infinite]).tolist() == [1.0, big / 2, big / 2]
    assert c("hyperbolic_sine", infinite).tolist() == [big / 2, -big / 2]
    assert c("arctangent", infinite) == pytest.approx([np.pi / 2, -np.pi / 2], rel=real.epsilon)
    assert c("arcsine", [1.0, 7.0, -7.0]) == pytest.approx([np.pi / 2, np.pi / 2, -np.pi / 2], rel=real.epsilon)
    assert c("arccosine", [1.0, 7.0, -7.0]) == pytest.approx([0.0, 0.0, np.pi], rel=real.epsilon)
    assert c("sine", [*infinite, 1e10]).tolist() == [0, 0, 0] and c("cosine", [*infinite, 1e10]).tolist() == [1, 1, 1]
    assert c("tangent", [*infinite, 1e10]).tolist() == [0, 0, 0] and np.isnan(c("square_root", [-1.0, -np.inf])).all()


@pytest.mark.parametrize("real", list(Real))
def test_both_ends_are_reached_monotonously(libraries, real):
    c = libraries[real]
    high, low = np.log(float(np.finfo(c.kind).max)), np.log(float(np.finfo(c.kind).tiny))
    for name, near in (
        ("exponential", high),
        ("exponential", low),
        ("hyperbolic_tangent", 19.0),
        ("hyperbolic_tangent", 9.0),
    ):
        x = np.unique((near + np.linspace(-1e-3, 1e-3, N)).astype(c.kind))
        assert np.all(np.diff(c(name, x)) >= 0), name
        assert np.all(np.isfinite(c(name, x)))
    edge = np.nextafter(np.linspace(low * 1.001, high * 1.001, N).astype(c.kind), c.kind(0))
    assert np.all(np.diff(c("exponential", edge)) >= 0)


@pytest.mark.parametrize("real", list(Real))
def test_angles_beyond_the_exact_range_are_bounded_and_as_wrong_as_their_rounding(libraries, real, rng):
    c = libraries[real]
    x = rng.uniform(TURNS[real], TURN_END[real], N).astype(c.kind)
    for name, exact in (("sine", np.sin), ("cosine", np.cos)):
        assert np.all(np.abs(c(name, x)) <= 1)
        assert np.max(np.abs(c(name, x) - exact(x.astype(EXACT))) / x) < 2 * real.epsilon


@pytest.mark.long
@pytest.mark.parametrize("real", list(Real))
def test_a_wrong_coefficient_is_seen(compiler, tmp_path, real, rng):
    """The last digits of a coefficient of each polynomial decide."""
    text = elementary_text([*ONE, *TWO], real)
    for name, k in (("exponential", 1), ("logarithm", 0), ("sine", 0), ("tangent", 0), ("arcsine", 1)):
        coefficient = abs(polynomial(name, real)[k])
        wrong = text.replace(real.literal(coefficient), real.literal(coefficient * (1 + 300 * real.epsilon)))
        (tmp_path / name).mkdir()
        broken = Library(real, compiler, tmp_path / name, wrong)
        assert max(broken.worst(name, x) for x in points(name, real, rng)) > ULP[name], name


def test_polynomials_against_decimal_arithmetic():
    """The series, summed to 40 digits by another arithmetic, at points of the range."""
    with localcontext() as context:
        context.prec = 50
        for real in Real:
            c = [Decimal(v) for v in polynomial("exponential", real)]
            for k in (*range(-20, 0), *range(1, 21)):
                x = Decimal(k) * Decimal("0.0173")
                ours = 1 + x + x * x * sum(v * x**i for i, v in enumerate(c))
                assert abs(ours / x.exp() - 1) < Decimal(real.epsilon) / 40
            c = [Decimal(v) for v in polynomial("logarithm", real)]
            for k in range(1, 18):
                s = Decimal(k) / 100
                ours = 2 * s + s**3 * sum(v * s ** (2 * i) for i, v in enumerate(c))
                assert abs(ours / ((1 + s) / (1 - s)).ln() - 1) < Decimal(real.epsilon) / 40


def test_constants_do_not_depend_on_the_mathematics_library(monkeypatch):
    """A cosine that is wrong in the last digit moves no printed digit."""
    text = {real: elementary_text([*ONE, *TWO], real) for real in Real}
    another = importlib.util.module_from_spec(elementary.__spec__)  # a copy that has computed nothing yet
    elementary.__spec__.loader.exec_module(another)
    right, calls = math.cos, []

    def wrong(x):
        calls.append(x)
        return float(np.nextafter(right(x), 2))

    monkeypatch.setattr(math, "cos", wrong)
    assert {real: another.elementary_text([*ONE, *TWO], real) for real in Real} == text
    assert calls


@pytest.mark.long
@pytest.mark.parametrize("real", list(Real))
def test_only_what_is_called_is_printed_and_no_library(real, compiler, tmp_path):
    assert elementary_text([], real) == ""
    for name in [*ONE, *TWO]:
        text = elementary_text([name], real)
        assert set(re.findall(r"\b([a-z_]+)\(", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))) <= {
            *re.findall(rf"^static (?:{real.value}|int32_t) (\w+)\(", text, flags=re.M),
            "if",
            "defined",
            "__asm__",
        }
        (tmp_path / "a.c").write_text(
            f"#include <stdint.h>\n{text}\n"
            f"{real.value} used({'' if name in ONE else f'{real.value} b, '}{real.value} a);\n"
            f"{real.value} used({'' if name in ONE else f'{real.value} b, '}{real.value} a)\n"
            f"{{\n    return {name}({'' if name in ONE else 'b, '}a);\n}}\n"
        )
        words = [compiler, *FLAGS, "-c", str(tmp_path / "a.c"), "-o", str(tmp_path / "a.o")]
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        if shutil.which("nm"):
            unknown = subprocess.run(["nm", "-u", str(tmp_path / "a.o")], capture_output=True, text=True, check=True)
            assert unknown.stdout.split() == [], name


@pytest.mark.long
@pytest.mark.parametrize("cross", ["zig", "arm-none-eabi-gcc"])
def test_a_microcontroller_computes_the_same_bits(libraries, cross, tmp_path, rng):
    if not available() or cross not in cross_compilers():
        pytest.skip(f"unicorn, pyelftools or {cross} is missing: the functions did not run on an emulated core")
    real, core, n = Real.FLOAT, M4F, 300
    pointers = "const float *a, const float *b, float *r"
    calls = [f"case {k}: {f}s({'a' if f in ONE else 'a, b'}, r, {n}); break;" for k, f in enumerate([*ONE, *TWO])]
    entry = f"int all(int what, {pointers});\nint all(int what, {pointers})\n{{\n"
    entry += f"    switch (what) {{ {' '.join(calls)} default: break; }}\n"
    (tmp_path / "m.c").write_text(source(real) + entry + "    return 0;\n}\n")
    cross_compile(cross, core, [tmp_path / "m.c"], tmp_path, "all", tmp_path / "m.elf")
    machine = Machine(core, tmp_path / "m.elf")
    a, b, r = (machine.reserve(n, real) for _ in range(3))
    for k, name in enumerate([*ONE, *TWO]):
        x = (
            np.concatenate([p[:: max(1, len(p) // 90)] for p in points(name, real, rng)])[:n]
            if name in ONE
            else rng.normal(size=n)
        )
        x = np.resize(x, n).astype(np.float32)
        x[:7] = 0.0, np.nan, np.inf, -np.inf, -1.0, 1e30, -1e30
        y = rng.normal(size=n).astype(np.float32)
        machine.write(a, x, real)
        machine.write(b, y, real)
        machine.call("all", k, a, b, r)
        here, there = libraries[real](name, *((x,) if name in ONE else (x, y))), machine.read(r, n, real)
        number = ~np.isnan(here)
        assert np.array_equal(number, ~np.isnan(there)), name
        assert np.array_equal(here[number].view(np.uint32), there[number].view(np.uint32)), name
