"""CasADi SX functions as C99, in double or in true single precision, in the form in which an engineer would have written them.

CasADi's own generator writes one line an operation and computes in double whatever `casadi_real` is. This printer writes every
constant and every call in the chosen type. Rows of a result that differ in numbers only, as those of equal axes do, are one loop,
their numbers tables; linear combinations are rows of a matrix; what several rows need is computed once, before them. Functions
are called by the names that `ctrlgen.firmware.elementary` has them under.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import casadi as ca
import numpy as np

from ctrlgen.firmware.c_expression import PLACE, SCALAR, Call, Linear, Text, text_of
from ctrlgen.firmware.expression_graph import Graph, Node, reached
from ctrlgen.firmware.real import Real

Ranges = Mapping[str, tuple[np.ndarray, np.ndarray]]
WIDTH = 120  # columns of a line of C
FEWEST_OPERATIONS = 3  # of a law that is a function of its own
STANDS_FOR = {"z": ("wanted",), "x": ("state",)}  # arguments of kernels that a law's argument may be
SCALAR_NAMES = {"wanted": "z", "state": "x"}  # one element of them as the parameter of a law
RESERVED = (  # names of the templates
    "LOW", "HIGH", "SLACK", "P", "X_REST", "TARGET_LIMIT", "U_LOW", "U_HIGH", "U_SLACK", "U_LEAST", "U_MOST", "U_SAFE", "READY", "NULL",
)  # fmt: skip
DIVISORS = (1, 2, 3, 4, 6)  # of a loop's index, where several rows read the same element


@dataclass(frozen=True)
class Kernel:
    """A printed function: C `text`, the `arguments` it reads, its number of arithmetic `operations`, what it calls."""

    name: str
    text: str
    arguments: tuple[str, ...]
    operations: int
    calls: frozenset[str]

    @property
    def body(self) -> str:
        """Its text without its name: equal for equal functions."""
        return self.text.partition("static ")[2].replace(self.name, "")

    def call(self, result: str, **values: str) -> str:
        """A C call with each argument's expression by name."""
        return f"{self.name}({', '.join([*(values[a] for a in self.arguments), result])})"

    def value(self, **values: str) -> str:
        """A C call of a function that returns its only row."""
        return f"{self.name}({', '.join(values[a] for a in self.arguments)})"


def print_function(function: ca.Function, name: str, real: Real, ranges: Ranges | None = None) -> Kernel:
    """`function` (SX, dense arguments, one result) as a static C function writing to its last parameter, which may be an argument too.

    `ranges`: low and high of the arguments, where they are known. Raises CtrlgenError for an operation C has no
    counterpart of.
    """
    return Printer(real, ranges or {}).kernel(function, name, may_be_result=function.name_in())


@dataclass(frozen=True)
class Law:
    """A law of every axis, (n,) in terms of the kernels' arguments, that is a C function of its own where a kernel needs it: `about`
    states its equation, units and source."""

    name: str
    about: str
    function: ca.Function


@dataclass
class Printer:
    """Prints the functions of one file. `ranges`: low and high of arguments by name; `numbers`: value and formula of each element of
    the arguments that are constants of the device; `laws`: what may be a function of its own."""

    real: Real
    ranges: Ranges
    numbers: Mapping[str, Sequence[tuple[float, str]]] = field(default_factory=dict)
    laws: Sequence[Law] = ()

    def __post_init__(self) -> None:
        self._graph = Graph()
        self._constants = _Constants(self.real)
        self._law_texts: dict[str, str] = {}

    @property
    def laws_text(self) -> str:
        """The laws that the kernels so far call."""
        return "\n".join(self._law_texts.values())

    def _calls(self, arguments: Mapping[str, int], rows: Sequence[Node]) -> dict[int, Call]:
        """The laws that rows need, by the number of their node, for every array that may stand for a law's argument."""
        needed, found = {node.number for node in reached(rows)}, dict[int, Call]()
        for law in self.laws:
            names = [name for name in law.function.name_in() if name not in self.numbers]
            standing = [
                [a for a in (name, *STANDS_FOR.get(name, ())) if arguments.get(a) == law.function.numel_in(name)]
                or [name]
                for name in names
            ]
            for chosen in product(*standing):
                renamed = dict(zip(names, chosen, strict=True))
                nodes = self._graph.rows(law.function, self.ranges, self.numbers, renamed)
                if any(node.number in needed for node in nodes):
                    found |= self._called(law, nodes)
        return found

    def _called(self, law: Law, nodes: Sequence[Node]) -> dict[int, Call]:
        """A law's rows as calls of one function of one axis; none where axes differ or depend on each other, or it is too short."""
        linear, texts = Linear({}), list[Text]()
        for i, node in enumerate(nodes):
            if node.leaf or any(n.index != i for n in reached([node]) if n.array):
                return {}
            texts.append(text_of(node, {}, linear, self.real))
        same = {(text.shape, tuple(self.real.literal(c.value) for c in text.constants)) for text in texts}
        if len(same) > 1 or texts[0].operations < FEWEST_OPERATIONS:
            return {}
        by_name = {read.array: read for read in texts[0].reads}
        found = {}
        for i, node in enumerate(nodes):
            reads = tuple(self._graph.read(array, i) for array in by_name)
            found[node.number] = Call(law.name, reads, texts[0].operations, texts[0].calls)
        if law.name not in self._law_texts:
            self._law_texts[law.name] = self._law_text(law, texts[0], list(by_name))
        return found

    def _law_text(self, law: Law, text: Text, arrays: Sequence[str]) -> str:
        T = self.real.value

        def filled(match: re.Match) -> str:
            kind, k = match[1], int(match[2])
            if kind == "t":
                return f"t{k + 1}"
            return (
                self._constants.named(text.constants[k])
                if kind == "c"
                else SCALAR_NAMES.get(text.reads[k].array, text.reads[k].array)
            )

        lines = [_bare(PLACE.sub(filled, line)) for line in text.lines] + [f"return {PLACE.sub(filled, text.result)};"]
        parameters = ", ".join(f"{T} {SCALAR_NAMES.get(array, array)}" for array in arrays)
        return f"{_comment(law.about)}static inline {T} {law.name}({parameters})\n{{\n{_indented(lines)}\n}}\n"

    @property
    def constants(self) -> str:
        """The named constants of all kernels so far, one line each with its formula."""
        return self._constants.text()

    def kernel(
        self, function: ca.Function, name: str, about: str = "", may_be_result: Sequence[str] = (),
        steps: tuple[str, int] | None = None, returned: bool = False,
    ) -> Kernel:  # fmt: skip
        """`function` (SX, dense arguments, one result) as a static C function writing to its last parameter.

        `about`: its comment. `may_be_result`: arguments that a caller may give as the result too. With `steps` (argument, count) the
        function is one step of an iteration on that argument, and the printed one takes `count` of them. The only row can be
        `returned` instead. Raises CtrlgenError for an
        operation C has no counterpart of.
        """
        rows = self._graph.rows(function, self.ranges, self.numbers)
        laws = self._calls({a: function.numel_in(a) for a in function.name_in()}, rows)
        body = _Body(rows, self.real, self._constants.named, [steps[0]] if steps else may_be_result, laws).run()
        sizes = {a: function.size1_in(a) for a in function.name_in()}
        parts = [(name, about, body.lines)]
        if steps:
            parts = _iterated(name, about, body, *steps, sizes)
        arguments = [
            tuple(a for a in sizes if any(re.search(rf"\b{a}\[", line) for line in lines)) for _, _, lines in parts
        ]
        if len(parts) > 1:
            arguments[1] = tuple(a for a in sizes if a in arguments[0] or a in arguments[1])
        texts = [
            _function(
                one,
                words,
                {a: sizes[a] for a in read},
                0 if returned else function.size1_out(0),
                lines,
                self.real.value,
            )
            for (one, words, lines), read in zip(parts, arguments, strict=True)
        ]
        operations = body.operations * (steps[1] if steps else 1)
        return Kernel(name, "\n".join(texts), arguments[-1], operations, body.calls)


def _iterated(
    name: str, about: str, body: _Body, argument: str, count: int, sizes: Mapping[str, int]
) -> list[tuple[str, str, list[str]]]:
    """Functions that take `count` steps of an iteration on `argument`: name, comment, lines. Axes that do not depend on each other are
    iterated one after the other; others together, by a function that is one step."""
    size, T, own = len(body.rows), body.real.value, f"{argument}[i]"
    loop = body.lines[body.lines.index(f"for (i = 0; i < {size}; i++) {{") :] if body.single_loop else []
    if loop and all(found == own for line in loop for found in re.findall(rf"\b{argument}\[[^]]*\]", line)):
        head, inner = body.lines[: -len(loop)], [line.replace(own, "value") for line in loop[1:-1]]
        moving = {"value"}
        before, during = [], []
        for line in inner:
            words = set(re.findall(r"\w+", line))
            named = re.match(rf"\s*const {T} (t\d+) =", line)
            if named and not words & moving:
                before.append(line)
            else:
                moving |= {named[1]} if named else set()
                during.append(f"    {line}".replace("result[i] =", "value ="))
        return [(
            name, about,
            [*head, loop[0], f"    {T} value = {own};", "    int step;", *before, f"    for (step = 0; step < {count}; step++) {{",
             *during, "    }", "    result[i] = value;", "}"],
        )]  # fmt: skip
    read = [a for a in sizes if any(re.search(rf"\b{a}\[", line) for line in body.lines)]
    call = ", ".join("result" if a == argument else a for a in read)
    start = [f"for (i = 0; i < {size}; i++) {{", f"    result[i] = {argument}[i];", "}"]
    again = [f"for (step = 0; step < {count}; step++) {{", f"    {name}_step({call}, result);", "}"]
    return [
        (f"{name}_step", about, body.lines),
        (name, f"{count} such steps.", ["int i;", "int step;", *start, *again]),
    ]


def _function(name: str, about: str, arguments: Mapping[str, int], size: int, lines: Sequence[str], T: str) -> str:
    """A static function; with `size` 0 it returns its only row."""
    read = [f"const {T} {a}[{n}]" for a, n in arguments.items()]
    comment = _comment(about)
    if not size:
        lines = [line.replace("result[0] =", "return") for line in lines]
        return f"{comment}static {T} {name}({', '.join(read)})\n{{\n{_indented(lines)}\n}}\n"
    parameters = ", ".join([*read, f"{T} result[{size}]"])
    return f"{comment}static void {name}({parameters})\n{{\n{_indented(lines)}\n}}\n"


def _comment(about: str) -> str:
    text = about.replace("*/", "* /").replace("/*", "/ *")
    return "\n".join(textwrap.wrap(f"/* {text} */", WIDTH, subsequent_indent=" * ")) + "\n" if about else ""


def _indented(lines: Sequence[str]) -> str:
    wrapped = []
    for line in lines:
        inner = len(line) - len(line.lstrip()) + 4
        wrapped += textwrap.wrap(
            line.strip(), WIDTH, initial_indent=" " * inner, subsequent_indent=" " * (inner + 4), break_long_words=False,
            break_on_hyphens=False,
        )  # fmt: skip
    return "\n".join(wrapped)


class _Body:
    """The lines of one function."""

    def __init__(
        self, rows: Sequence[Node], real: Real, named: Callable[[Node], str], may_be_result: Sequence[str],
        laws: Mapping[int, Call],
    ) -> None:  # fmt: skip
        self.laws = laws
        self.rows, self.real, self.named, self.may_be_result = list(rows), real, named, set(may_be_result)
        self.ends: dict[int, Node] = {}
        self.lines: list[str] = []
        self.tables: dict[str, str] = {}  # name by C initialiser
        self.declared: list[str] = []
        self.locals = self.parts = self.operations = 0
        self.calls: frozenset[str] = frozenset()
        self.loops = False
        self.copies: dict[
            str, str
        ] = {}  # elements that every turn of a loop reads, by the name of their copy: they stay in registers
        self.copied: set[str] = set()
        self.groups = 0

    @property
    def single_loop(self) -> bool:
        """Whether the function is one loop over all rows and nothing else."""
        return self.groups == 1 and self.loops and not self.declared

    def run(self) -> _Body:
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
            for node in reached([row], [])
            if node.array
        )

    def _store(self, roots: Sequence[Node]) -> None:
        """What several rows need, in local arrays and variables."""
        linear = Linear(self.ends)
        new: dict[int, Node] = {}
        for group in self._groups(roots, list(range(len(roots))), linear, []):
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
        for group in self._groups(self.rows, list(range(len(self.rows))), linear, self.rows if as_row else []):
            index = str(group.places[0]) if len(group.places) == 1 else group.index("i", group.places)
            self._write(group, f"{result}[{index}] = ")

    def _groups(
        self, roots: Sequence[Node], places: Sequence[int], linear: Linear, as_rows: Sequence[Node]
    ) -> list[_Group]:
        """Roots of equal shape whose elements follow the loop's index, in the order of the first of each."""
        groups: list[_Group] = []
        forced = {node.number for node in as_rows}
        for place in places:
            root = roots[place]
            text = text_of(root, self.ends, linear, self.real, root.number in forced, self.laws)
            self.calls |= text.calls
            self.operations += text.operations
            for group in groups:
                if group.takes(place, text):
                    break
            else:
                groups.append(_Group([place], [text]))
        return groups

    def _write(self, group: _Group, assignment: str) -> None:
        """A group's lines, as a loop where it has several rows."""
        many, first = len(group.places) > 1, group.texts[0]
        self.groups += 1
        offset = 0 if many else self.parts

        def filled(match: re.Match) -> str:
            kind, k = match[1], int(match[2])
            if kind == "t":
                return f"t{offset + k + 1}"
            if kind == "c":
                return self._constant([text.constants[k] for text in group.texts])
            if kind == "r":
                return self._read(group, [text.reads[k] for text in group.texts])
            return self._row(group, [text.rows[k] for text in group.texts])

        written = [_bare(PLACE.sub(filled, line)) for line in (*first.lines, f"{assignment}{first.result};")]
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
            self.parts += len(first.lines)
            self.lines += written

    def _constant(self, nodes: Sequence[Node]) -> str:
        literals = [self.real.literal(node.value) for node in nodes]
        if len(set(literals)) == 1:
            return self.named(nodes[0])
        return f"{self._table(f'[{len(nodes)}]', '{ ' + ', '.join(literals) + ' }')}[i]"

    def _read(self, group: _Group, nodes: Sequence[Node]) -> str:
        if nodes[0].index == SCALAR:
            return nodes[0].array
        indices = [node.index for node in nodes]
        return f"{nodes[0].array}[{indices[0] if len(set(indices)) == 1 else group.index('i', indices)}]"

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


def _bare(line: str) -> str:
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
        if self.index("i", places) is None:
            return False
        for k in range(len(text.reads)):
            indices = [t.reads[k].index for t in texts]
            if len(set(indices)) > 1 and self.index("i", indices) is None:
                return False
        self.places, self.texts = places, texts
        return True

    @staticmethod
    def index(i: str, values: Sequence[int]) -> str | None:
        """`values` as an expression of the loop's index 0, 1, 2 ...; None where they follow no simple one."""
        first = values[0]
        if len(values) == 2 and values[1] == first:
            return str(first)
        for step in (values[1] - first,) if values[1] > first else ():
            if all(v == first + step * k for k, v in enumerate(values)):
                scaled = i if step == 1 else f"({step} * {i})"
                return scaled if first == 0 else f"{scaled} + {first}"
        for divisor in DIVISORS[1:]:
            if all(v == first + k // divisor for k, v in enumerate(values)):
                return f"{i} / {divisor}" if first == 0 else f"({i} / {divisor}) + {first}"
        return None


def _shared(rows: Sequence[Node], linear: Linear) -> list[Node]:
    """The largest expressions that several rows, or several of these, need."""
    roots = {row.number: row for row in rows if not _plain(row, linear)}
    while True:
        order = [n for n in reached(roots.values()) if not n.leaf]
        of: dict[int, int] = {}  # the roots that need a node, as bits
        parents: dict[int, set[int]] = {}
        for bit, number in enumerate(sorted(roots)):
            of[number] = of.get(number, 0) | 0
            for operand in roots[number].operands if not _plain(roots[number], linear) else ():
                of[operand.number] = of.get(operand.number, 0) | 1 << bit
        needed = {number: bits for number, bits in of.items()}
        for node in reversed(order):
            if node.number in roots or _plain(node, linear):
                continue
            for operand in node.operands:
                needed[operand.number] = needed.get(operand.number, 0) | needed.get(node.number, 0)
                parents.setdefault(operand.number, set()).add(node.number)
        for bit, number in enumerate(sorted(roots)):
            for operand in roots[number].operands:
                parents.setdefault(operand.number, set()).add(-1 - bit)
        found = [
            node for node in order
            if node.number not in roots and not _plain(node, linear) and needed.get(node.number, 0).bit_count() > 1
            and any(p < 0 or needed.get(p) != needed[node.number] for p in parents.get(node.number, ()))
        ]  # fmt: skip
        if not found:
            break
        roots |= {node.number: node for node in found}
    own = {row.number for row in rows}
    used = {n.number for root in roots.values() for n in reached(root.operands, [r for r in roots.values()])}
    return [node for number, node in sorted(roots.items()) if number not in own or number in used]


def _plain(node: Node, linear: Linear) -> bool:
    """What is read where it is needed rather than stored before: leaves and rows of matrices."""
    return node.leaf or linear.row(node)


def _levels(stored: Sequence[Node]) -> list[list[Node]]:
    """Stored expressions in an order in which each is known before its use."""
    level: dict[int, int] = {}
    for node in stored:  # operands have lower numbers
        below = [level[n.number] for n in reached(node.operands, stored) if n.number in level]
        level[node.number] = 1 + max(below, default=-1)
    return [[node for node in stored if level[node.number] == k] for k in range(max(level.values(), default=-1) + 1)]


class _Constants:
    """The named constants of a file."""

    def __init__(self, real: Real) -> None:
        self.real = real
        self.names: dict[tuple[str, str], str] = {("", name): name for name in RESERVED}
        self.lines: list[str] = []

    def named(self, node: Node) -> str:
        """How a number is written in an expression: by its name where it has a formula."""
        literal = self.real.literal(node.value)
        if not node.formula:
            return f"({literal})" if literal.startswith("-") else literal
        key = literal, node.formula
        if key not in self.names:
            name = self.names[key] = _name_of(node.formula, set(self.names.values()))
            line = f"static const {self.real.value} {name} = {literal}; /* {node.formula} */"
            if len(line) > WIDTH:
                line = f"/* {node.formula} */\n{line.partition(' /*')[0]}"
            self.lines.append(line)
        return self.names[key]

    def text(self) -> str:
        return "\n".join(self.lines)


def _name_of(formula: str, taken: set[str]) -> str:
    """A name for a constant: of the parameter that it is, or of those that it is made of, numbered."""
    paths = re.findall(r"[a-z_][\w\[\]]*(?:\.[\w\[\]]+)*", re.sub(r"\b[a-z]+\(", "(", formula))
    part = 0 if formula.startswith("f(") else -1  # of many parameters the sections that they stand in
    words = dict.fromkeys(re.sub(r"\W", "_", path.split(".")[part]).strip("_").upper() for path in paths)
    base = "_".join(list(words)[:2])
    name, k = (base if formula in paths else f"{base}_1"), 1
    while name in taken:
        k += 1
        name = f"{base}_{k}"
    return name
