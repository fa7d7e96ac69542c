"""The lines of a C function: rows of a result as loops, tables and what several rows need.

Rows whose text is the same with the places open (`ctrlgen.firmware.c.c_expression`) are one loop over a table of what differs; linear
combinations are rows of a matrix; an expression that several rows need is stored before them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ctrlgen.firmware.c.c_constants import Constants
from ctrlgen.firmware.c.c_expression import PLACE, SCALAR, Call, Linear, Text, text_of
from ctrlgen.firmware.c.expression_graph import Node, reached, same_number
from ctrlgen.firmware.c.real import Real

SHORT = 1  # lines of a row before its result, up to which rows are written one by one
DIVISORS = (2, 3, 4, 6)  # of a loop's index, where several rows read the same element


class Rows:
    """The lines of one function."""

    def __init__(
        self,
        rows: Sequence[Node],
        real: Real,
        constants: Constants,
        may_be_result: Sequence[str],
        laws: Mapping[int, Call],
        one_by_one: bool = False,
    ) -> None:
        self.laws, self.one_by_one = laws, one_by_one
        self.rows, self.real, self.may_be_result = list(rows), real, set(may_be_result)
        self.named, self.array = constants.named, constants.array
        self.ends: dict[int, Node] = {}
        self.lines: list[str] = []
        self.tables: dict[str, str] = {}  # name by C initialiser
        self.declared: list[str] = []
        self.locals = self.parts = self.operations = 0
        self.calls: frozenset[str] = frozenset()
        self.loops = False
        # Elements that every turn of a loop reads, by the name of their copy: they stay in registers.
        self.copies: dict[str, str] = {}
        self.copied: set[str] = set()
        self.groups = 0

    @property
    def single_loop(self) -> bool:
        """Whether the function is one loop over all rows and nothing else."""
        return self.groups == 1 and self.loops and not self.declared

    def run(self) -> Rows:
        """These rows, with `lines`, `operations` and `calls` filled in."""
        linear = Linear({})
        shared = _shared(self.rows, linear)
        for level in _levels(shared):
            self._store(level)
        result = "result"
        if self._reads_elsewhere():
            result = "next"
            self.declared.append(f"{self.real.value} next[{len(self.rows)}];")
        self._results(result)
        if result == "next":
            self.loops = True
            self.lines += [f"for (i = 0; i < {len(self.rows)}; i++) {{", "    result[i] = next[i];", "}"]
        tables = [
            f"static const {self.real.value} {name}{head} = {values};"
            for (head, values), name in ((k.split("|"), n) for k, n in self.tables.items())
        ]
        tables = [line for table in tables for line in table.split("\n")]
        self.lines = [*tables, *self.declared, *(["int i;"] if self.loops else []), *self.lines]
        return self

    def _reads_elsewhere(self) -> bool:
        """Whether a row reads an element of the result's array that another row may have written."""
        if len(self.rows) == 1:
            return False
        return any(
            node.array in self.may_be_result and node.index != i
            for i, row in enumerate(self.rows)
            for node in reached([row])
            if node.array
        )

    def _store(self, roots: Sequence[Node]) -> None:
        """What several rows need, in local arrays and variables."""
        linear = Linear(self.ends)
        new: dict[int, Node] = {}
        for group in self._groups(roots, linear, False):
            self.locals += 1
            if len(group.places) == 1:
                node = roots[group.places[0]]
                name = f"shared{self.locals}"
                self._write(group, f"const {self.real.value} {name} = ")
                new[node.number] = Node(-self.locals, -2, array=name, index=SCALAR)
            else:
                name = f"shared{self.locals}"
                self.declared.append(f"{self.real.value} {name}[{len(group.places)}];")
                for k, place in enumerate(group.places):
                    new[roots[place].number] = Node(-self.locals, -2, array=name, index=k)
                self._write(group, f"{name}[i] = ")
        self.ends |= new

    def _results(self, result: str) -> None:
        linear = Linear(self.ends)
        terms = [linear.terms(row) for row in self.rows]
        arrays = {t[0] for t in terms if t}
        as_row = len(arrays) == 1 and all(terms) and any(len(t[1]) > 2 for t in terms if t)
        if as_row and self.one_by_one:
            self._rows_one_by_one([t for t in terms if t], result)
            return
        for group in self._groups(self.rows, linear, as_row):
            index = str(group.places[0]) if len(group.places) == 1 else group.index(group.places)
            self._write(group, f"{result}[{index}] = ")

    def _rows_one_by_one(self, terms: Sequence[tuple[str, dict[int, float]]], result: str) -> None:
        """Rows of a matrix as one line each, without a loop: zeros and ones cost nothing, and a product or a sum of two that several rows
        have is computed once."""
        T, array = self.real.value, terms[0][0]

        def name(i: int) -> str:
            return f"{array}_{i}"

        read = sorted({i for _, row in terms for i in row})
        self.lines += [f"const {T} {name(i)} = {array}[{i}];" for i in read]
        literals = [{i: self.real.literal(abs(v)) for i, v in row.items()} for _, row in terms]
        one = self.real.literal(1.0)

        def term(row: int, i: int) -> str:
            return name(i) if literals[row][i] == one else f"({literals[row][i]} * {name(i)})"

        def pair(row: int, i: int, k: int) -> tuple[str, str, int, int]:
            return term(row, i), term(row, k), i, k

        # A pair of terms with its signs in several rows comes first in each: there it is one number.
        counts: dict[tuple[str, str, int, int, bool, bool], list[int]] = {}
        for r, (_, row) in enumerate(terms):
            for i in row:
                for k in row:
                    if i < k:
                        counts.setdefault((*pair(r, i, k), row[i] < 0, row[k] < 0), []).append(r)
        first: dict[int, tuple[int, int]] = {}
        for (_, _, i, k, *_), rows in sorted(counts.items(), key=lambda item: -len(item[1])):
            free = [r for r in rows if r not in first]
            if len(free) > 1:
                first |= dict.fromkeys(free, (i, k))
        for r, (_, row) in enumerate(terms):
            order = [*first.get(r, ()), *(i for i in sorted(row) if i not in first.get(r, ()))]
            text = ""
            for i in order:
                if not text:
                    text = f"(-{term(r, i)})" if row[i] < 0 else term(r, i)
                else:
                    text += f" {'-' if row[i] < 0 else '+'} {term(r, i)}"
            self.operations += len(order) - 1 + sum(text != one for text in literals[r].values())
            self.lines.append(f"{result}[{r}] = {bare('x = ' + (text or self.real.literal(0.0)) + ';')[4:]}")

    def _groups(self, roots: Sequence[Node], linear: Linear, as_row: bool) -> list[_Group]:
        """Roots of equal shape whose elements follow the loop's index, in the order of the first of each; with `as_row` all are rows of
        one matrix, the short ones too."""
        groups: list[_Group] = []
        for place, root in enumerate(roots):
            text = text_of(root, self.ends, linear, self.real, as_row, self.laws)
            self.calls |= text.calls
            self.operations += text.operations
            for group in () if self.one_by_one and len(text.lines) <= SHORT else groups:
                if group.takes(place, text):
                    break
            else:
                groups.append(_Group([place], [text]))
        return groups

    def _write(self, group: _Group, assignment: str) -> None:
        """A group's lines, as a loop where it has several rows."""
        many, first = len(group.places) > 1, group.texts[0]
        self.groups += 1
        offset = self.parts
        self.parts += len(first.lines)

        def filled(match: re.Match[str]) -> str:
            kind, k = match[1], int(match[2])
            if kind == "t":
                return f"t{offset + k + 1}"
            if kind == "c":
                return self._constant([text.constants[k] for text in group.texts])
            if kind == "r":
                return self._read(group, [text.reads[k] for text in group.texts])
            return self._row(group, [text.rows[k] for text in group.texts])

        written = [bare(PLACE.sub(filled, line)) for line in (*first.lines, f"{assignment}{first.result};")]
        if many:
            self.loops = True
            self.lines += [
                f"const {self.real.value} {copy} = {element};"
                for copy, element in self.copies.items()
                if copy not in self.copied
            ]
            self.copied |= set(self.copies)
            self.lines += [f"for (i = 0; i < {len(group.places)}; i++) {{", *(f"    {line}" for line in written), "}"]
        else:
            self.lines += written

    def _constant(self, nodes: Sequence[Node]) -> str:
        if any(node.source for node in nodes):
            same = len({same_number(node, self.real.literal(node.value)) for node in nodes}) == 1
            return self.named(nodes[0]) if same else f"{self.array(nodes)}[i]"
        literals = [self.real.literal(node.value) for node in nodes]
        if len(set(literals)) == 1:
            return self.named(nodes[0])
        return f"{self._table(f'[{len(nodes)}]', '{ ' + ', '.join(literals) + ' }')}[i]"

    def _read(self, group: _Group, nodes: Sequence[Node]) -> str:
        if nodes[0].index == SCALAR:
            return nodes[0].array
        indices = [node.index for node in nodes]
        return f"{nodes[0].array}[{indices[0] if len(set(indices)) == 1 else group.index(indices)}]"

    def _row(self, group: _Group, rows: Sequence[tuple[str, dict[int, float]]]) -> str:
        """A row of a matrix times an array."""
        array, indices = rows[0][0], sorted({i for _, row in rows for i in row})
        if len(rows) == 1:
            text = ""
            for i in indices:
                value = rows[0][1][i]
                term = f"{array}[{i}]"
                if abs(value) != 1.0:
                    literal = self.real.literal(abs(value) if text else value)
                    term = f"({f'({literal})' if literal.startswith('-') else literal} * {term})"
                elif value < 0 and not text:
                    term = f"(-{term})"
                text = f"{text} {'-' if value < 0 else '+'} {term}" if text else term
            return f"({text})"
        values = ["{ " + ", ".join(self.real.literal(row.get(i, 0.0)) for i in indices) + " }" for _, row in rows]
        table = self._table(f"[{len(rows)}][{len(indices)}]", "{\n    " + ",\n    ".join(values) + "\n}")
        for i in indices:
            self.copies[f"{array}_{i}"] = f"{array}[{i}]"
        return "(" + " + ".join(f"({table}[i][{k}] * {array}_{i})" for k, i in enumerate(indices)) + ")"

    def _table(self, head: str, values: str) -> str:
        """The name of a table of numbers, declared once."""
        return self.tables.setdefault(f"{head}|{values}", f"TABLE_{len(self.tables) + 1}")


def bare(line: str) -> str:
    """An assignment without parentheses about the whole value."""
    head, _, value = line.rstrip(";").partition(" = ")
    depth = 0
    for k, character in enumerate(value):
        depth += (character == "(") - (character == ")")
        if depth == 0 and k < len(value) - 1:
            return line
    return f"{head} = {value[1:-1]};" if value.startswith("(") else line


@dataclass
class _Group:
    """Rows of equal shape: their places in the result and their texts."""

    places: list[int]
    texts: list[Text]

    def takes(self, place: int, text: Text) -> bool:
        """Adds a row where its shape is that of the others and its places follow the loop's index."""
        if text.shape != self.texts[0].shape:
            return False
        places, texts = [*self.places, place], [*self.texts, text]
        if self.index(places) is None:
            return False
        for k in range(len(text.reads)):
            indices = [t.reads[k].index for t in texts]
            if len(set(indices)) > 1 and self.index(indices) is None:
                return False
        self.places, self.texts = places, texts
        return True

    @staticmethod
    def index(values: Sequence[int]) -> str | None:
        """`values` as an expression of the loop's index i = 0, 1, 2 ...; None where they follow no simple one."""
        first, step = values[0], values[1] - values[0]
        if step > 0 and all(v == first + step * k for k, v in enumerate(values)):
            scaled = "i" if step == 1 else f"({step} * i)"
            return scaled if first == 0 else f"{scaled} + {first}"
        for divisor in DIVISORS:
            if all(v == first + k // divisor for k, v in enumerate(values)):
                return f"i / {divisor}" if first == 0 else f"(i / {divisor}) + {first}"
        return None


def _shared(rows: Sequence[Node], linear: Linear) -> list[Node]:
    """The largest expressions that several rows, or several of these, need."""
    row_roots = {row.number: row for row in rows if not _plain(row, linear)}
    roots = dict(row_roots)
    while shared := _needed_by_several(roots, linear):
        roots |= {node.number: node for node in shared}
    used = {n.number for root in roots.values() for n in reached(root.operands, roots)}
    return [node for number, node in sorted(roots.items()) if number not in row_roots or number in used]


def _needed_by_several(roots: Mapping[int, Node], linear: Linear) -> list[Node]:
    """The largest expressions below several `roots`: other roots need them than need what they are a part of."""
    bits = {number: 1 << k for k, number in enumerate(roots)}  # sets of roots are bits: unions are what this costs
    needed: dict[int, int] = {}  # node -> the roots above it
    above: dict[int, set[int]] = {}  # node -> those of each expression that it is a part of
    order = [node for node in reached(roots.values()) if not _plain(node, linear)]
    for node in reversed(order):  # what uses a node before the node
        those = bits.get(node.number) or needed.get(node.number, 0)
        for operand in node.operands if those else ():  # below the row of a matrix nothing is needed by itself
            needed[operand.number] = needed.get(operand.number, 0) | those
            above.setdefault(operand.number, set()).add(those)
    return [
        node
        for node in order
        if node.number not in roots
        and needed.get(node.number, 0).bit_count() > 1
        and above[node.number] != {needed[node.number]}
    ]


def _plain(node: Node, linear: Linear) -> bool:
    """What is read where it is needed rather than stored before: leaves and rows of matrices."""
    return node.leaf or linear.row(node)


def _levels(stored: Sequence[Node]) -> list[list[Node]]:
    """Stored expressions in an order in which each is known before its use."""
    level, ends = dict[int, int](), {node.number for node in stored}
    for node in stored:  # operands have lower numbers
        below = [level[n.number] for n in reached(node.operands, ends) if n.number in level]
        level[node.number] = 1 + max(below, default=-1)
    return [[node for node in stored if level[node.number] == k] for k in range(max(level.values(), default=-1) + 1)]
