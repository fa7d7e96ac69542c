"""One node of an expression graph as C: the lines that name its parts, and its own expression.

What differs between equal axes is left open: numbers, elements of arrays and rows of matrices appear as places, `<c0>`, `<r0>`,
`<d0>`, in the order of the text. Expressions whose text is the same with the places open are one loop in C.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca

from ctrlgen.core.errors import CtrlgenError
from ctrlgen.firmware.c.expression_graph import READ, TWICE_PRINTED, Node
from ctrlgen.firmware.c.real import Real

MOST_INLINE = 3  # operations of an expression that is written where it is used, and not on a line of its own
SCALAR = -1  # the index of what is stored in a variable of its own
FEWEST_TERMS = 3  # of a linear combination that is printed as a row of a matrix times an array
PLACE = re.compile(r"<([a-z])(\d+)>")

_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
# The functions of `elementary` that a printed expression calls
CALLS = {
    ca.OP_SQRT: "square_root",
    ca.OP_EXP: "exponential",
    ca.OP_LOG: "logarithm",
    ca.OP_SIN: "sine",
    ca.OP_COS: "cosine",
    ca.OP_TAN: "tangent",
    ca.OP_ASIN: "arcsine",
    ca.OP_ACOS: "arccosine",
    ca.OP_ATAN: "arctangent",
    ca.OP_ATAN2: "arctangent2",
    ca.OP_TANH: "hyperbolic_tangent",
    ca.OP_SINH: "hyperbolic_sine",
    ca.OP_COSH: "hyperbolic_cosine",
    ca.OP_POW: "power",
    ca.OP_CONSTPOW: "power",
    ca.OP_FLOOR: "whole_below",
    ca.OP_CEIL: "whole_above",
}
_FORMS = {
    ca.OP_FMIN: "({0} < {1}) ? {0} : {1}",
    ca.OP_FMAX: "({0} > {1}) ? {0} : {1}",
    ca.OP_FABS: "({0} < {zero}) ? -{0} : {0}",
    ca.OP_SIGN: "({0} > {zero}) ? {one} : (({0} < {zero}) ? -{one} : {zero})",
    ca.OP_IF_ELSE_ZERO: "({0} != {zero}) ? {1} : {zero}",
    ca.OP_NOT: "({0} != {zero}) ? {zero} : {one}",
    ca.OP_AND: "(({0} != {zero}) && ({1} != {zero})) ? {one} : {zero}",
    ca.OP_OR: "(({0} != {zero}) || ({1} != {zero})) ? {one} : {zero}",
}


class Linear:
    """Which nodes are linear combinations of the elements of one array, where the nodes `ends` are stored in arrays."""

    def __init__(self, ends: Mapping[int, Node]) -> None:
        self._ends = ends
        self._known: dict[int, tuple[str, dict[int, float]] | None] = {}

    def terms(self, node: Node) -> tuple[str, dict[int, float]] | None:
        """(array, {index: factor}); None for a node that is no such combination."""
        known = self._known
        left = [] if node.number in known else [node]
        while left:
            top = left[-1]
            operands = () if top.number in self._ends else top.operands
            missing = [n for n in operands if n.number not in known]
            if missing and top.number not in known:
                left.extend(missing)
                continue
            left.pop()
            if top.number not in known:
                known[top.number] = self._of(top)
        return known[node.number]

    def row(self, node: Node) -> bool:
        """Whether a node is printed as a row of a matrix times an array."""
        terms = self.terms(node)
        return terms is not None and len(terms[1]) >= FEWEST_TERMS

    def _of(self, node: Node) -> tuple[str, dict[int, float]] | None:
        node = self._ends.get(node.number, node)
        if node.operation == READ and node.index == SCALAR:
            return None
        if node.operation == READ:
            return node.array, {node.index: 1.0}
        if node.operation == ca.OP_MUL and node.operands[0].fixed:
            inner = self._known[node.operands[1].number]
            return inner and (inner[0], {i: node.operands[0].value * c for i, c in inner[1].items()})
        if node.operation in (ca.OP_ADD, ca.OP_SUB):
            a, b = (self._known[n.number] for n in node.operands)
            if a and b and a[0] == b[0]:
                sign = 1.0 if node.operation == ca.OP_ADD else -1.0
                return a[0], {i: a[1].get(i, 0.0) + sign * b[1].get(i, 0.0) for i in sorted({*a[1], *b[1]})}
        return None


@dataclass(frozen=True)
class Text:
    """C with places: `lines` that name parts t1, t2 ... (places `<t1>`), the `result`, and what stands at the places of this node."""

    lines: tuple[str, ...]
    result: str
    constants: tuple[Node, ...]
    reads: tuple[Node, ...]
    rows: tuple[tuple[str, dict[int, float]], ...]
    operations: int
    calls: frozenset[str]

    @property
    def shape(self) -> tuple[Any, ...]:
        """Equal for expressions that differ in their places only."""
        return self.lines, self.result, tuple(r.array for r in self.reads), tuple(array for array, _ in self.rows)


@dataclass(frozen=True)
class Call:
    """A law of one axis that is a C function of its own: its name, the elements that it reads, its operations, what it calls, and the
    numbers that it is handed because they are known only when the program starts."""

    name: str
    reads: tuple[Node, ...]
    operations: int
    calls: frozenset[str]
    given: tuple[Node, ...] = ()


def text_of(
    root: Node,
    ends: Mapping[int, Node],
    linear: Linear,
    real: Real,
    as_row: bool = False,
    laws: Mapping[int, Call] | None = None,
) -> Text:
    """`root` as C, in terms of `ends`, what is stored in local arrays, and of `laws`, both by the number of a node."""
    return _Body(root, ends, linear, real, as_row, laws or {}).text()


class _Body:
    def __init__(
        self, root: Node, ends: Mapping[int, Node], linear: Linear, real: Real, as_row: bool, laws: Mapping[int, Call]
    ) -> None:
        self.root, self.ends, self.linear, self.real, self.as_row, self.laws = root, ends, linear, real, as_row, laws
        self.nodes: dict[str, Node] = {}  # by place
        self.lines: list[str] = []
        self.parts: dict[int, tuple[str, int]] = {}  # text, operations in it; an atom has none
        self.calls: set[str] = set()
        self.operations = 0

    def text(self) -> Text:
        order = self._order()
        uses = Counter(n.number for node in order for n in self._operands(node))
        for node in order:
            if node.operation in TWICE_PRINTED:
                uses.update(n.number for n in self._operands(node))
        for node in order:
            written, inside = self._expression(node)
            self.operations += self._own_operations(node)
            named = node is not self.root and (uses[node.number] > 1 or inside > MOST_INLINE or "?" in written)
            if named and inside:
                self.lines.append(f"const {self.real.value} <t{len(self.lines)}> = {written};")
                written, inside = f"<t{len(self.lines) - 1}>", 0
            self.parts[node.number] = written, inside
        return self._numbered(self.parts[self.root.number][0])

    def _leaf(self, node: Node) -> bool:
        return node.leaf or self._is_end(node) or self._is_row(node) or node.number in self.laws

    def _is_end(self, node: Node) -> bool:
        return node.number in self.ends and node is not self.root

    def _is_row(self, node: Node) -> bool:
        return not node.constant and (self.linear.row(node) or (self.as_row and node is self.root))

    def _operands(self, node: Node) -> tuple[Node, ...]:
        return () if self._leaf(node) else node.operands

    def _order(self) -> list[Node]:
        """Operands before what uses them, in an order that the structure alone decides."""
        parts, seen, left = list[Node](), set[int](), [(self.root, False)]
        while left:
            node, done = left.pop()
            if done:
                parts.append(node)
            elif node.number not in seen:
                seen.add(node.number)
                left.append((node, True))
                left.extend((n, False) for n in reversed(self._operands(node)))
        return parts

    def _own_operations(self, node: Node) -> int:
        if self._is_row(node):
            terms = self.linear.terms(node)
            return 2 * len(terms[1]) - 1 if terms else 0
        if node.number in self.laws and not self._is_end(node):
            return self.laws[node.number].operations
        return 0 if self._leaf(node) else 1

    def _expression(self, node: Node) -> tuple[str, int]:
        """The text of a node in C, and the number of operations in it."""
        if node.number in self.ends and node is not self.root:
            return self._place("r", self.ends[node.number]), 0
        if self._is_row(node):
            return self._place("d", node), 1
        if node.number in self.laws:
            law = self.laws[node.number]
            self.calls |= law.calls
            places = [self._place("r", read) for read in law.reads] + [self._place("c", node) for node in law.given]
            return f"{law.name}({', '.join(places)})", 1
        if node.constant:
            return self._place("c", node), 0
        if node.operation == READ:
            return self._place("r", node), 0
        op, inside = node.operation, 1 + sum(self.parts[n.number][1] for n in node.operands)
        a = [self._operand(n) for n in node.operands]
        if op == ca.OP_MUL and node.operands[0].fixed and node.operands[0].value == -1.0:
            return f"-{a[1]}", inside
        if op in _BINARY:
            return f"{a[0]} {_BINARY[op]} {a[1]}", inside
        zero, one = self.real.literal(0.0), self.real.literal(1.0)
        if op in _COMPARE:
            return f"({a[0]} {_COMPARE[op]} {a[1]}) ? {one} : {zero}", inside
        if op in CALLS:
            self.calls.add(CALLS[op])
            return f"{CALLS[op]}({', '.join(self.parts[n.number][0] for n in node.operands)})", inside
        if op not in _FORMS:
            raise CtrlgenError(
                f"CasADi operation {op} has no C99 form here; add it to ctrlgen/firmware/c/c_expression.py"
            )
        return _FORMS[op].format(*a, zero=zero, one=one), inside

    def _operand(self, node: Node) -> str:
        """The text of a node as it may stand beside an operator, in brackets where it has to be."""
        text, inside = self.parts[node.number]
        whole = not inside or node.number in self.laws or (node.operation in CALLS and not self._leaf(node))
        return text if whole else f"({text})"

    def _place(self, kind: str, node: Node) -> str:
        place = f"<{kind}{len(self.nodes)}>"
        self.nodes[place] = node
        return place

    def _numbered(self, result: str) -> Text:
        """The text of a result with its places numbered in the order in which they stand."""
        parts: dict[str, list[Node]] = {"c": [], "r": [], "d": []}

        def renumbered(match: re.Match[str]) -> str:
            kind = match[1]
            if kind == "t":
                return match[0]
            parts[kind].append(self.nodes[match[0]])
            return f"<{kind}{len(parts[kind]) - 1}>"

        lines = tuple(PLACE.sub(renumbered, line) for line in self.lines)
        result = PLACE.sub(renumbered, result)
        rows = tuple(self.linear.terms(node) for node in parts["d"])
        return Text(
            lines,
            result,
            tuple(parts["c"]),
            tuple(parts["r"]),
            tuple(row for row in rows if row),
            self.operations,
            frozenset(self.calls),
        )
