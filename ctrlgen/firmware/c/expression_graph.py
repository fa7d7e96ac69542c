"""The expressions of CasADi functions as one graph, in the form in which they are printed as C.

Equal expressions are one node. Numbers are folded, and those that come from named parameters keep their formula. A product is a
number times a bare product, (c x) (d y) = (c d) (x y), where the ranges of x and y say that x y neither overflows nor vanishes.

A number that the program is given when it starts is folded like any other, but keeps the expression that it is computed by then, its
`source`; no decision is taken on its value, only on its range.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.numerics.interval_arithmetic import UNBOUNDED, Interval, interval_of, product_of, quotient_of

CONSTANT, READ = -1, -2  # operations of leaves, beside CasADi's
TRUSTED = 1e15  # products between 1/TRUSTED and TRUSTED neither overflow nor underflow a float
MOST_FACTORS = 64  # largest whole exponent that is printed as products
LONGEST_FORMULA = 120  # characters of a number's formula; a longer one says nothing to a reader
SAME_NUMBER = 1e-6  # relative difference of a number computed in two orders, digits lost to cancellation included
PRODUCT = {ca.OP_MUL: product_of, ca.OP_DIV: quotient_of}
GIVEN = "given"  # the array of the numbers that the program is given when it starts
TWICE_PRINTED = (ca.OP_SIGN, ca.OP_FABS, ca.OP_FMIN, ca.OP_FMAX)  # their operands appear twice in C
WHOLE_WORD = re.compile(r"[\w.\[\]]+")  # a number or the path of a parameter
_FORMULA = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0}^2",
    ca.OP_TWICE: "2 * {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_ASSIGN: "{0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_ASIN: "asin({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_POW: "{0}^{1}",
    ca.OP_CONSTPOW: "{0}^{1}",
    ca.OP_TANH: "tanh({0})",
}


@dataclass(frozen=True, eq=False)
class Node:
    """An expression: a number (`value`, with the `formula` that it comes from), element `index` of an `array`, or an operation."""

    number: int  # nodes are numbered as they are made: operands before what uses them
    operation: int
    operands: tuple[Node, ...] = ()
    within: Interval = UNBOUNDED
    value: float = math.nan
    formula: str = ""
    array: str = ""
    index: int = 0
    # Of a number that is known when the program starts: its expression in the numbers given then
    source: Node | None = None

    @property
    def constant(self) -> bool:
        """Whether it is a number."""
        return self.operation == CONSTANT

    @property
    def fixed(self) -> bool:
        """Whether it is a number that is known now."""
        return self.constant and self.source is None

    @property
    def leaf(self) -> bool:
        """Whether it is a number or an element of an array."""
        return self.operation in (CONSTANT, READ)


class Graph:
    """Makes nodes, each of them once. `given`: path and range of the parameters that the program is given when it starts."""

    def __init__(self, given: Mapping[str, Interval] | None = None) -> None:
        self._nodes: dict[tuple[Any, ...], Node] = {}
        self._count = 0
        self._given = {path: self.read(GIVEN, k, within) for k, (path, within) in enumerate((given or {}).items())}

    def constant(self, value: float, formula: str = "", source: Node | None = None) -> Node:
        """A number, and the formula of parameters that it comes from; with a `source` the value is that of the device file."""
        key = (CONSTANT, value, formula) if source is None else (CONSTANT, source.number, formula)
        within = (value, value) if source is None else source.within
        return self._nodes.get(key) or self._make(
            key, CONSTANT, within=within, value=value, formula=formula, source=source
        )

    def read(self, array: str, index: int, within: Interval = UNBOUNDED) -> Node:
        """Element `index` of an argument or of a local array."""
        key = (READ, array, index)
        return self._nodes.get(key) or self._make(key, READ, within=within, array=array, index=index)

    def rows(
        self,
        function: ca.Function,
        ranges: Mapping[str, tuple[np.ndarray, np.ndarray]],
        numbers: Mapping[str, Sequence[tuple[float, str]]] | None = None,
        renamed: Mapping[str, str] | None = None,
    ) -> list[Node]:
        """The rows of the only result of an SX `function` with dense arguments.

        `ranges`: low and high of arguments, where they are known. `numbers`: value and formula of each element of arguments that are
        not read when the C runs. `renamed`: arguments that have another name in the C.
        """
        at = dict[int, Node]()
        values = [self.constant(0.0)] * function.size1_out(0)
        for k in range(function.n_instructions()):
            op, inputs = function.instruction_id(k), function.instruction_input(k)
            outputs = function.instruction_output(k)
            if op == ca.OP_OUTPUT:
                values[function.sparsity_out(0).row()[outputs[1]]] = at[inputs[0]]
            elif op == ca.OP_CONST:
                at[outputs[0]] = self.constant(function.instruction_constant(k))
            elif op == ca.OP_INPUT:
                at[outputs[0]] = self._input(function, inputs, ranges, numbers or {}, renamed or {})
            else:
                at[outputs[0]] = self.apply(op, [at[i] for i in inputs])
        return values

    def with_formulas(self, rows: Sequence[Node], named: Sequence[Node]) -> list[Node]:
        """`rows` with the formulas of the same rows in terms of parameters, `named`; a row of another form stays without formulas.

        The numbers are those of `rows`: what is computed from parameters in another order differs in the last digits.
        """
        made: dict[tuple[int, int], Node | None] = {}
        return [self._paired(row, other, made) or row for row, other in zip(rows, named, strict=True)]

    def _paired(self, row: Node, named: Node, made: dict[tuple[int, int], Node | None]) -> Node | None:
        """`row` with the formulas of `named`; None where their forms differ."""
        left = [(row, named)]
        while left:
            a, b = left[-1]
            pairs = list(zip(a.operands, b.operands, strict=False))
            missing = [pair for pair in pairs if (pair[0].number, pair[1].number) not in made]
            if missing and a.operation == b.operation:
                left.extend(missing)
                continue
            left.pop()
            parts = [made.get((x.number, y.number)) for x, y in pairs]
            result: Node | None = None
            if a.constant and b.constant:
                near = abs(a.value - b.value) <= SAME_NUMBER * abs(a.value)
                result = self.constant(a.value, b.formula or a.formula, a.source) if near else None
            elif a.leaf or b.leaf:
                result = a if a is b else None
            elif a.operation == b.operation and len(a.operands) == len(b.operands) and None not in parts:
                result = self._operation(a.operation, *(part for part in parts if part is not None))
            made[a.number, b.number] = result
        return made[row.number, named.number]

    def _input(
        self,
        function: ca.Function,
        place: Sequence[int],
        ranges: Mapping[str, Any],
        numbers: Mapping[str, Any],
        renamed: Mapping[str, str],
    ) -> Node:
        name, row = function.name_in(place[0]), int(function.sparsity_in(place[0]).row()[place[1]])
        if name in numbers:
            value, path = numbers[name][row]
            return self.constant(value, path, self._given.get(path))
        name = renamed.get(name, name)
        low, high = ranges.get(name, (None, None))
        return self.read(name, row, UNBOUNDED if low is None else (float(low[row]), float(high[row])))

    def apply(self, op: int, a: Sequence[Node]) -> Node:
        """The node of CasADi's operation `op` on the nodes `a`."""
        a = list(a)
        if all(node.constant for node in a):
            return self._folded(op, a)
        if op in (ca.OP_SQ, ca.OP_INV):
            op, a = (ca.OP_MUL, [a[0], a[0]]) if op == ca.OP_SQ else (ca.OP_DIV, [self.constant(1.0), a[0]])
        if op == ca.OP_IF_ELSE_ZERO and a[0].fixed:
            return a[1] if a[0].value else self.constant(0.0)
        if op in (ca.OP_NEG, ca.OP_TWICE, ca.OP_ASSIGN):
            return self._scaled(a[0], self.constant({ca.OP_NEG: -1.0, ca.OP_TWICE: 2.0, ca.OP_ASSIGN: 1.0}[op]))
        if op == ca.OP_MUL and (a[0].constant or a[1].constant):
            number, other = a if a[0].constant else a[::-1]
            return self._scaled(other, number)
        if op == ca.OP_DIV and a[1].constant:  # a multiplication is several times cheaper
            return self._scaled(a[0], self._folded(ca.OP_INV, [a[1]]))
        if op in PRODUCT:
            return self._product(op, *a)
        if op in (ca.OP_FMIN, ca.OP_FMAX):
            low, high = sorted(a, key=lambda node: node.within)
            if low.within[1] <= high.within[0]:  # known before the device runs
                return low if op == ca.OP_FMIN else high
            (c, x), (d, y) = self._split(a[0]), self._split(a[1])
            if c.fixed and d.fixed and c.value == d.value > 0 and c.value != 1.0:
                return self._scaled(self._operation(op, x, y), c)
        if op in (ca.OP_ADD, ca.OP_SUB):
            return self._sum(op, *a)
        if op in (ca.OP_POW, ca.OP_CONSTPOW) and a[1].fixed and _by_products(a[1].value):
            return self._power(a[0], a[1].value)
        return self._operation(op, *a)

    def _sum(self, op: int, a: Node, b: Node) -> Node:
        if b.fixed and b.value == 0.0:
            return a
        if a.fixed and a.value == 0.0:
            return b if op == ca.OP_ADD else self._scaled(b, self.constant(-1.0))
        if b.constant and b.value < 0:
            op, b = (ca.OP_SUB if op == ca.OP_ADD else ca.OP_ADD), self._folded(ca.OP_NEG, [b])
        c, x = self._split(b)
        if c.value < 0:
            op, b = (ca.OP_SUB if op == ca.OP_ADD else ca.OP_ADD), self._scaled(x, self._folded(ca.OP_NEG, [c]))
        c, x = self._split(a)
        if op == ca.OP_ADD and c.value < 0:
            op, a, b = ca.OP_SUB, b, self._scaled(x, self._folded(ca.OP_NEG, [c]))
        return self._operation(op, a, b)

    def _product(self, op: int, a: Node, b: Node) -> Node:
        """a b or a/b with the numbers gathered in front, if the bare operands' product is of a size that can be trusted."""
        (c, x), (d, y) = self._split(a), self._split(b)
        if _one(c) and _one(d):
            return self._operation(op, a, b)
        factor = self._folded(op, [c, d])
        size = max(abs(v) for v in PRODUCT[op](x.within, y.within))
        factors = [abs(v) for v in factor.within]
        if not (1 / TRUSTED < size < TRUSTED and min(factors) > 1 / TRUSTED and max(factors) < TRUSTED):
            return self._operation(op, a, b)
        if x.constant:  # c/(d y) = (c/d)/y
            return self._operation(op, factor, y)
        return self._scaled(self._operation(op, x, y), factor)

    def _power(self, base: Node, exponent: float) -> Node:
        """base^exponent by squaring, with one root where the exponent is not whole."""
        factors, square, left = list[Node](), base, int(abs(exponent))
        if abs(exponent) % 1.0:
            factors.append(self._operation(ca.OP_SQRT, base))
        while left:
            if left % 2:
                factors.append(square)
            left //= 2
            if left:
                square = self._operation(ca.OP_MUL, square, square)
        result = factors[0] if factors else self.constant(1.0)
        for factor in factors[1:]:
            result = self._operation(ca.OP_MUL, result, factor)
        return self._operation(ca.OP_DIV, self.constant(1.0), result) if exponent < 0 else result

    def _split(self, node: Node) -> tuple[Node, Node]:
        """(c, x) with node = c x; x is the number one where the node is a number."""
        if node.constant:
            return node, self.constant(1.0)
        if node.operation == ca.OP_MUL and node.operands[0].constant:
            return node.operands[0], node.operands[1]
        return self.constant(1.0), node

    def _scaled(self, node: Node, factor: Node) -> Node:
        if node.constant:
            return self._folded(ca.OP_MUL, [factor, node])
        c, x = self._split(node)
        if not _one(c):
            factor = self._folded(ca.OP_MUL, [factor, c])
        return x if _one(factor) else self._operation(ca.OP_MUL, factor, x)

    def _folded(self, op: int, a: Sequence[Node]) -> Node:
        values = [node.value for node in a]
        with np.errstate(all="ignore"):
            value = float(_computed(op, values))
        formula = ""
        if op in _FORMULA and any(node.formula for node in a):
            call = _FORMULA[op].endswith("({0})")
            formula = _FORMULA[op].format(*(node.formula if call else _term(node) for node in a))
            one = [i for i, node in enumerate(a) if node.value == 1.0 and not node.formula]
            if op == ca.OP_MUL and one:
                formula = a[1 - one[0]].formula
            if op == ca.OP_DIV and one == [1]:
                formula = a[0].formula
            if op == ca.OP_MUL and any(node.value == -1.0 and not node.formula for node in a):
                formula = f"-{_term(next(node for node in a if node.formula))}"
            if (
                op == ca.OP_MUL
                and formula.count("(1 / ") == 1
                and formula.endswith(")")
                and a[1].formula.startswith("1 / ")
            ):
                formula = f"{_term(a[0])} / {a[1].formula[4:]}"
        formula = _short(formula) if len(formula) > LONGEST_FORMULA or formula.count("f(") > 1 else formula
        return self.constant(value, formula, self._source(op, a) if any(node.source for node in a) else None)

    def _source(self, op: int, a: Sequence[Node]) -> Node:
        """The expression of a number in those that the program is given."""
        parts = [node.source or node for node in a]
        less_one = len(parts) == 2 and parts[1].fixed and parts[1].value == {ca.OP_SUB: 1.0, ca.OP_ADD: -1.0}.get(op)
        # e^y - 1 = 2 t/(1 - t), t = tanh(y/2), which keeps the digits near y = 0.
        if less_one and parts[0].operation == ca.OP_EXP:
            half = self.apply(ca.OP_MUL, [self.constant(0.5), parts[0].operands[0]])
            t = self._operation(ca.OP_TANH, half)
            return self._operation(
                ca.OP_DIV, self.apply(ca.OP_TWICE, [t]), self.apply(ca.OP_SUB, [self.constant(1.0), t])
            )
        return self.apply(op, parts)

    def _operation(self, op: int, *operands: Node) -> Node:
        key = (op, *(node.number for node in operands))
        if key in self._nodes:
            return self._nodes[key]
        return self._make(key, op, operands=operands, within=interval_of(op, [node.within for node in operands]))

    def _make(self, key: tuple[Any, ...], op: int, **rest: object) -> Node:
        node = Node(self._count, op, **rest)  # type: ignore[arg-type]
        self._count += 1
        self._nodes[key] = node
        return node


def reached(roots: Iterable[Node], ends: Collection[int] = ()) -> list[Node]:
    """The nodes that roots need, operands first, not going below those of the numbers `ends`."""
    seen, left = dict[int, Node](), list(roots)
    while left:
        node = left.pop()
        if node.number not in seen:
            seen[node.number] = node
            if node.number not in ends:
                left.extend(node.operands)
    return [seen[number] for number in sorted(seen)]


def same_number(node: Node, literal: str) -> object:
    """Equal for numbers that are the same in C, where `literal` is how this one is written."""
    return literal if node.source is None else node.source.number


def _one(node: Node) -> bool:
    return node.fixed and node.value == 1.0


def _computed(op: int, values: Sequence[float]) -> float:
    if op in _EXACT and (op not in (ca.OP_DIV, ca.OP_INV) or values[-1] != 0.0):
        return _EXACT[op](*values)
    symbols = [ca.SX.sym("a") for _ in values]
    built = _FUNCTIONS.get((op, len(values)))
    if built is None:
        expression = ca.SX.unary(op, *symbols) if len(values) == 1 else ca.SX.binary(op, *symbols)
        built = ca.Function("f", symbols, [expression])
        _FUNCTIONS[op, len(values)] = built
    return built(*values)


_FUNCTIONS: dict[tuple[int, int], ca.Function] = {}
# Rounded correctly everywhere: Python's result is CasADi's, without a call of CasADi
_EXACT: Mapping[int, Callable[..., float]] = {
    ca.OP_ADD: operator.add,
    ca.OP_SUB: operator.sub,
    ca.OP_MUL: operator.mul,
    ca.OP_DIV: operator.truediv,
    ca.OP_NEG: operator.neg,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_INV: lambda a: 1.0 / a,
}


def _term(node: Node) -> str:
    """A number's formula as a part of another."""
    return _as_term(node.formula or f"{node.value:.9g}")


@lru_cache(maxsize=4096)
def _as_term(text: str) -> str:
    """A formula in brackets where it needs them."""
    if WHOLE_WORD.fullmatch(text):
        return text
    depth = list(accumulate((character == "(") - (character == ")") for character in text))
    call = re.match(r"\w*\(", text) is not None and all(depth[k] > 0 for k in range(text.index("("), len(text) - 1))
    return text if call else f"({text})"


def _short(formula: str) -> str:
    """What a long formula depends on: the parameters, or the sections of the device that they stand in."""
    paths = list(dict.fromkeys(re.findall(r"[a-z_][\w\[\]]*(?:\.[\w\[\]]+)*(?![\w.(])", formula)))
    text = f"f({', '.join(paths)})"
    sections = dict.fromkeys(path.partition(".")[0] for path in paths)
    return text if len(text) <= LONGEST_FORMULA else f"f({', '.join(sections)})"


def _by_products(exponent: float) -> bool:
    """Whether a power is cheaper, and as exact, by multiplications."""
    return (2 * exponent).is_integer() and abs(exponent) <= MOST_FACTORS
