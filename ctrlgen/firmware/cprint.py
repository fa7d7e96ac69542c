"""A CasADi SX function as C99, in double or in true single precision.

CasADi's own generator computes in double whatever `casadi_real` is (constants, `sqrt`); this
printer writes every constant and every call in the chosen type, stores all outputs last (so
that an output may be the same array as an input), and passes only the arguments that are read.

Square roots need no library: where the range of the argument is known (`intervals`) and narrow, they are a straight
line and a few of Heron's steps, y <- (y + a/y)/2, elsewhere a call of `root`. Powers with a
constant whole or half exponent are products and roots. The other functions are called by the names that `elementary` has
them under.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum

import casadi as ca
import numpy as np

from ctrlgen.core.errors import CtrlgenError
from ctrlgen.numerics.interval_arithmetic import UNBOUNDED, Interval, intervals, product_of, quotient_of


class Real(Enum):
    """The arithmetic of the generated C."""

    DOUBLE = "double"
    FLOAT = "float"

    @property
    def suffix(self) -> str:
        """Name suffix of files and functions."""
        return "f64" if self is Real.DOUBLE else "f32"

    @property
    def bytes(self) -> int:
        """Size of a number."""
        return 8 if self is Real.DOUBLE else 4

    @property
    def epsilon(self) -> float:
        """Distance from one to the next number."""
        return float(np.finfo(np.float64 if self is Real.DOUBLE else np.float32).eps)

    def literal(self, value: float) -> str:
        """The shortest decimal that reads back as the same number of this type."""
        if not math.isfinite(value):
            raise CtrlgenError(f"the constant {value} cannot be written as C")
        if self is Real.DOUBLE:
            text = repr(float(value))
        else:
            with np.errstate(over="ignore", under="ignore"):
                single = np.float32(value)
            if not np.isfinite(single) or (value != 0 and abs(single) < np.finfo(np.float32).tiny):
                raise CtrlgenError(
                    f"the constant {value:g} does not fit a float; rescale the model or export double only"
                )
            text = str(single)
        if "." not in text and "e" not in text:
            text += ".0"
        return text + ("f" if self is Real.FLOAT else "")


WIDER = 0.01  # than the range: arguments may leave it by rounding
MOST_STEPS = {
    Real.DOUBLE: 4,
    Real.FLOAT: 3,
}  # of Heron's method from a linear start; with more, calling `root` is as cheap
MOST_FACTORS = 64  # largest whole exponent that is printed as products
TRUSTED = 1e15  # products between 1/TRUSTED and TRUSTED neither overflow nor underflow a float
PRODUCT = {ca.OP_MUL: product_of, ca.OP_DIV: quotient_of}
_OPERATOR = re.compile(r" (?:[-+*/<>?]|<=|==|!=|&&|\|\|) |\(-[a-z]|[a-z]\w*\(")

_NAME = re.compile(r"\bt\d\w*")
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_CALLS = {  # of `elementary`
    ca.OP_EXP: "exponential", ca.OP_LOG: "logarithm", ca.OP_SIN: "sine", ca.OP_COS: "cosine", ca.OP_TAN: "tangent",
    ca.OP_ASIN: "arcsine", ca.OP_ACOS: "arccosine", ca.OP_ATAN: "arctangent", ca.OP_ATAN2: "arctangent2",
    ca.OP_TANH: "hyperbolic_tangent", ca.OP_SINH: "hyperbolic_sine", ca.OP_COSH: "hyperbolic_cosine",
    ca.OP_POW: "power", ca.OP_CONSTPOW: "power", ca.OP_FLOOR: "whole_below", ca.OP_CEIL: "whole_above",
}  # fmt: skip


@dataclass(frozen=True)
class Kernel:
    """A printed function: C `text`, the `arguments` it reads, its number of arithmetic `operations`, what it calls."""

    name: str
    text: str
    arguments: tuple[str, ...]
    operations: int
    calls: frozenset[str]

    def call(self, result: str, **values: str) -> str:
        """A C call with each argument's expression by name."""
        return f"{self.name}({', '.join([*(values[a] for a in self.arguments), result])})"


def print_function(
    function: ca.Function, name: str, real: Real, ranges: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None
) -> Kernel:
    """`function` (SX, dense arguments, one result) as a static C function writing to its last parameter.

    `ranges`: low and high of the arguments, where they are known. Raises CtrlgenError for an operation C has no
    counterpart of.
    """
    printer = _Printer(function, real, ranges or {})
    results = printer.run()
    written = {i for i, _ in results}
    results += [(i, real.literal(0.0)) for i in range(function.size1_out(0)) if i not in written]
    lines = _read(printer.lines, [f"    result[{i}] = {text};" for i, text in sorted(results)])
    body = "\n".join(lines)
    arguments = tuple(name for name in function.name_in() if re.search(rf"\b{name}\[", body))
    parameters = ", ".join(
        [
            *(f"const {real.value} {a}[{function.size1_in(a)}]" for a in arguments),
            f"{real.value} result[{function.size1_out(0)}]",
        ]
    )
    text = f"static void {name}({parameters})\n{{\n{body}\n}}\n"
    operations = len(_OPERATOR.findall(body))
    return Kernel(
        name, text, arguments, operations, frozenset(c for c in printer.calls if re.search(rf"\b{c}\(", body))
    )


def _read(lines: list[str], results: list[str]) -> list[str]:
    """The lines that a result needs, and the results: what turned out to be a constant leaves operands that nothing reads."""
    kept, read = results[::-1], {word for line in results for word in _NAME.findall(line)}
    for line in reversed(lines):
        name, *operands = _NAME.findall(line)
        if name in read:
            read.update(operands)
            kept.append(line)
    return kept[::-1]


@dataclass(frozen=True)
class _Value:
    """`factor` times the C operand `text`, which lies `within`; a number of its own has `text` "1"."""

    text: str
    factor: float
    within: Interval

    @property
    def number(self) -> bool:
        return self.text == "1"

    def scaled(self, factor: float) -> _Value:
        return replace(self, factor=self.factor * factor)


class _Printer:
    """Walks a function's instructions. Numbers that multiply are gathered: (c x) (d y) is printed as (c d) (x y), where the
    ranges say that x y neither overflows nor vanishes without them."""

    def __init__(self, function: ca.Function, real: Real, ranges: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> None:
        self.function, self.real = function, real
        self.between, self.uses = intervals(function, ranges), _uses(function)
        self.lines: list[str] = []
        self.calls: set[str] = set()

    def run(self) -> list[tuple[int, str]]:
        """Row and C operand of every result; the lines before them are in `lines`."""
        f, at, results = self.function, dict[int, _Value](), list[tuple[int, str]]()
        for k in range(f.n_instructions()):
            op, inputs, outputs = f.instruction_id(k), f.instruction_input(k), f.instruction_output(k)
            if op == ca.OP_INPUT:
                text = f"{f.name_in(inputs[0])}[{_dense(f.sparsity_in(inputs[0]), inputs[1])}]"
                at[outputs[0]] = _Value(text, 1.0, self.between[k])
            elif op == ca.OP_OUTPUT:
                text = self._operand(at[inputs[0]])
                if "[" in text:  # read before any result is stored
                    text = self._named(k, text, self.between[k]).text
                results.append((_dense(f.sparsity_out(0), outputs[1]), text))
            elif op == ca.OP_CONST:
                at[outputs[0]] = _Value("1", f.instruction_constant(k), (1.0, 1.0))
            else:
                at[outputs[0]] = self._settled(self._value(k, op, [at[i] for i in inputs]), k)
        return results

    def _value(self, k: int, op: int, a: list[_Value]) -> _Value:
        """Of instruction `k`; what it needs is printed."""
        if op in (ca.OP_SQ, ca.OP_INV):
            op, a = (ca.OP_MUL, [a[0], a[0]]) if op == ca.OP_SQ else (ca.OP_DIV, [_Value("1", 1.0, (1.0, 1.0)), a[0]])
        if op in (ca.OP_NEG, ca.OP_TWICE, ca.OP_ASSIGN):
            return a[0].scaled({ca.OP_NEG: -1.0, ca.OP_TWICE: 2.0, ca.OP_ASSIGN: 1.0}[op])
        if op == ca.OP_MUL and (a[0].number or a[1].number):
            number, other = a if a[0].number else a[::-1]
            return other.scaled(number.factor)
        if op == ca.OP_DIV and a[1].number:  # a multiplication is several times cheaper
            return a[0].scaled(1 / a[1].factor)
        if op in (ca.OP_MUL, ca.OP_DIV):
            return self._product(k, op, *a)
        if op in (ca.OP_FMIN, ca.OP_FMAX):
            low, high = sorted(a, key=_range_of)
            if _range_of(low)[1] <= _range_of(high)[0]:  # known before the device runs
                return low if op == ca.OP_FMIN else high
            if a[0].factor == a[1].factor > 0 and not a[0].number:
                larger = _expression(op, [v.text for v in a], self.real)
                return replace(self._named(k, larger, _hull(a[0].within, a[1].within)), factor=a[0].factor)
        if op in (ca.OP_ADD, ca.OP_SUB) and a[1].factor < 0 and not a[1].number:
            op, a = (ca.OP_SUB if op == ca.OP_ADD else ca.OP_ADD), [a[0], a[1].scaled(-1.0)]
        if op == ca.OP_ADD and a[0].factor < 0 and not a[0].number:
            op, a = ca.OP_SUB, [a[1], a[0].scaled(-1.0)]
        if op in (ca.OP_POW, ca.OP_CONSTPOW) and a[1].number and _by_products(a[1].factor):
            return self._power(k, self._named(f"{k}_b", self._scaled(a[0]), _range_of(a[0])), a[1].factor)
        if op in (ca.OP_ADD, ca.OP_SUB) and a[1].number and a[1].factor == 0.0:
            return a[0]
        operands = [self._operand(v) for v in a]
        if op == ca.OP_SQRT:
            return self._root(k, operands[0], a[0])
        if op in _CALLS:
            self.calls.add(_CALLS[op])
        return self._named(k, _expression(op, operands, self.real), self.between[k])

    def _product(self, k: int, op: int, a: _Value, b: _Value) -> _Value:
        """a b or a/b with the factors gathered in front, if the bare operands' product is of a size that can be trusted."""
        within = PRODUCT[op](a.within, b.within)
        factor = a.factor * b.factor if op == ca.OP_MUL else a.factor / b.factor
        plain = a.factor == 1.0 and b.factor == 1.0
        size = max(abs(v) for v in within)
        if not plain and not (1 / TRUSTED < size < TRUSTED and 1 / TRUSTED < abs(factor) < TRUSTED):
            return self._named(k, f"{self._operand(a)} {_BINARY[op]} {self._operand(b)}", self.between[k])
        if a.number:  # c/(d x) = (c/d)/x
            return self._named(k, f"{self._literal(factor)} / {b.text}", self.between[k])
        return replace(self._named(k, f"{a.text} {_BINARY[op]} {b.text}", within), factor=factor)

    def _root(self, k: int, operand: str, a: _Value) -> _Value:
        within = _range_of(a)
        plan = heron_plan(within, self.real)
        if plan is None:
            return self._named(k, self._root_call(operand), self.between[k])
        if a.factor != 1.0:
            operand = self._named(f"{k}_a", operand, within).text
        (start, slope), steps = plan
        y = self._named(f"{k}_0", f"{self._literal(start)} + ({self._literal(slope)} * {operand})", within)
        for step in range(1, steps + 1):
            expression = f"{self._literal(0.5)} * ({y.text} + ({operand} / {y.text}))"
            y = self._named(f"{k}_{step}" if step < steps else k, expression, self.between[k])
        return y

    def _root_call(self, operand: str) -> str:
        self.calls.add("root")
        return f"root({operand})"

    def _power(self, k: int, base: _Value, exponent: float) -> _Value:
        """base^exponent by squaring, with one root where the exponent is not whole."""
        factors, square, left, step = list[str](), base.text, int(abs(exponent)), 0
        if abs(exponent) % 1.0:
            factors.append(self._named(f"{k}_r", self._root_call(base.text), UNBOUNDED).text)
        while left:
            if left % 2:
                factors.append(square)
            left //= 2
            if left:
                step += 1
                square = self._named(f"{k}_{step}", f"{square} * {square}", UNBOUNDED).text
        while len(factors) > 1:
            step += 1
            factors = [self._named(f"{k}_{step}", f"{factors[0]} * {factors[1]}", UNBOUNDED).text, *factors[2:]]
        one = self._literal(1.0)
        result = (factors or [one])[0]
        return self._named(k, f"{one} / {result}" if exponent < 0 else result, self.between[k])

    def _settled(self, value: _Value, k: int) -> _Value:
        """Multiplied out where several need it, so that it is done once."""
        if value.number or value.factor == 1.0 or self.uses[k] < 2:
            return value
        return self._named(f"{k}_c" if value.text == f"t{k}" else k, self._scaled(value), self.between[k])

    def _named(self, k: int | str, expression: str, within: Interval) -> _Value:
        self.lines.append(f"    const {self.real.value} t{k} = {expression};")
        return _Value(f"t{k}", 1.0, within)

    def _operand(self, value: _Value) -> str:
        """As it may stand beside an operator."""
        if value.number:
            return _signed(self._literal(value.factor))
        text = self._scaled(value)
        return value.text if text == value.text else f"({text})"

    def _scaled(self, value: _Value) -> str:
        if value.factor == -1.0:
            return f"-{value.text}"
        literal = self._literal(value.factor)
        return value.text if literal == self._literal(1.0) else f"{_signed(literal)} * {value.text}"

    def _literal(self, value: float) -> str:
        return self.real.literal(value)


def _hull(a: Interval, b: Interval) -> Interval:
    return min(a[0], b[0]), max(a[1], b[1])


def _range_of(value: _Value) -> Interval:
    """Low and high of a value, its factor included."""
    return product_of((value.factor, value.factor), value.within)


def _uses(function: ca.Function) -> list[int]:
    """How often the value of each instruction is read."""
    counts, by_slot = [0] * function.n_instructions(), dict[int, int]()
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        if op != ca.OP_INPUT:
            for slot in function.instruction_input(k):
                counts[by_slot[slot]] += 1
        if op in (ca.OP_SQ, ca.OP_SIGN, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX):  # printed with their operands twice
            for slot in function.instruction_input(k):
                counts[by_slot[slot]] += 1
        if op != ca.OP_OUTPUT:
            by_slot[function.instruction_output(k)[0]] = k
    return counts


def heron_plan(within: Interval, real: Real) -> tuple[tuple[float, float], int] | None:
    """(start, slope) of the line that is nearest to the root within a range, relatively, and the steps from there to rounding.

    The line y = s (a + sqrt(low high)) has equal relative errors at both ends and at the geometric mean; a step takes
    an error e to e^2/(2 (1 + e)), which is positive. None where more steps than `MOST_STEPS` are needed.
    """
    low, high = within
    if not 0.0 < low <= high < math.inf:
        return None
    low, high = low * (1 - WIDER), high * (1 + WIDER)
    middle = math.sqrt(low * high)
    at_end, at_middle = (low + middle) / math.sqrt(low), 2 * math.sqrt(middle)
    slope = 2 / (at_end + at_middle)
    error, steps = (at_end - at_middle) / (at_end + at_middle), 0
    if error > real.epsilon / 4:
        error, steps = error**2 / (2 * (1 - error)), 1  # the line is low in the middle
    while error > real.epsilon / 4 and steps <= MOST_STEPS[real]:
        error, steps = error**2 / (2 * (1 + error)), steps + 1
    return ((slope * middle, slope), steps) if steps <= MOST_STEPS[real] else None


def _dense(sparsity: ca.Sparsity, nonzero: int) -> int:
    """Row of a column vector's nonzero."""
    return int(sparsity.row()[nonzero])


def _by_products(exponent: float) -> bool:
    """Whether a power is cheaper, and as exact, by multiplications."""
    return (2 * exponent).is_integer() and abs(exponent) <= MOST_FACTORS


def _signed(literal: str) -> str:
    return f"({literal})" if literal.startswith("-") else literal


def _expression(op: int, a: list[str], real: Real) -> str:
    """One operation on the operands `a`."""
    zero, one, two = real.literal(0.0), real.literal(1.0), real.literal(2.0)
    if op in _BINARY:
        return f"{a[0]} {_BINARY[op]} {a[1]}"
    if op in _COMPARE:
        return f"({a[0]} {_COMPARE[op]} {a[1]}) ? {one} : {zero}"
    if op in _CALLS:
        return f"{_CALLS[op]}({', '.join(a)})"
    forms = {
        ca.OP_ASSIGN: "{0}", ca.OP_NEG: "-{0}", ca.OP_SQ: "{0} * {0}", ca.OP_TWICE: f"{two} * {{0}}", ca.OP_INV: f"{one} / {{0}}",
        ca.OP_FMIN: "({0} < {1}) ? {0} : {1}", ca.OP_FMAX: "({0} > {1}) ? {0} : {1}", ca.OP_FABS: f"({{0}} < {zero}) ? -{{0}} : {{0}}",
        ca.OP_SIGN: f"({{0}} > {zero}) ? {one} : (({{0}} < {zero}) ? -{one} : {zero})",
        ca.OP_IF_ELSE_ZERO: f"({{0}} != {zero}) ? {{1}} : {zero}", ca.OP_NOT: f"({{0}} != {zero}) ? {zero} : {one}",
        ca.OP_AND: f"(({{0}} != {zero}) && ({{1}} != {zero})) ? {one} : {zero}",
        ca.OP_OR: f"(({{0}} != {zero}) || ({{1}} != {zero})) ? {one} : {zero}",
    }  # fmt: skip
    if op not in forms:
        raise CtrlgenError(f"CasADi operation {op} has no C99 form here; add it to ctrlgen/firmware/cprint.py")
    return forms[op].format(*a)
