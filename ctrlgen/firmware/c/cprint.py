"""CasADi SX functions as C99, in double or in true single precision, in the form in which an engineer would have written them.

CasADi's own generator writes one line an operation and computes in double whatever `casadi_real` is. This printer writes every
constant and every call in the chosen type. Rows of a result that differ in numbers only, as those of equal axes do, are one loop,
their numbers tables; linear combinations are rows of a matrix; what several rows need is computed once, before them. Functions
are called by the names that `ctrlgen.firmware.c.elementary` has them under.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import casadi as ca
import numpy as np

from ctrlgen.core.escaping import c_comment
from ctrlgen.firmware.c.c_constants import DERIVED, WIDTH, Constants, Derived
from ctrlgen.firmware.c.c_expression import PLACE, Call, Linear, Text, text_of
from ctrlgen.firmware.c.c_rows import Rows, bare
from ctrlgen.firmware.c.expression_graph import GIVEN, Graph, Node, reached, same_number
from ctrlgen.firmware.c.real import Real
from ctrlgen.numerics.interval_arithmetic import Interval

Ranges = Mapping[str, tuple[np.ndarray, np.ndarray]]
FEWEST_OPERATIONS = 3  # of a law that is a function of its own
STANDS_FOR = {"z": ("wanted",), "x": ("state",)}  # arguments of kernels that a law's argument may be
SCALAR_NAMES = {"wanted": "z", "state": "x"}  # one element of them as the parameter of a law


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
        """The text without the function's name: the same for functions that compute the same."""
        return self.text.partition("static ")[2].replace(self.name, "")

    def call(self, result: str, **values: str) -> str:
        """A C call with each argument's expression by name."""
        values = {DERIVED: "&state->derived", **values}
        return f"{self.name}({', '.join([*(values[a] for a in self.arguments), result])})"

    def value(self, **values: str) -> str:
        """A C call of a function that returns its only row."""
        return f"{self.name}({', '.join(values[a] for a in self.arguments)})"


@dataclass(frozen=True)
class Law:
    """A law of every axis, (n,) in terms of the kernels' arguments, that is a C function of its own where a kernel needs it: `about`
    states its equation, units and source."""

    name: str
    about: str
    function: ca.Function
    named: ca.Function | None = None  # the same with the parameters as an argument


@dataclass
class Printer:
    """Prints the functions of one file. `ranges`: low and high of arguments by name; `numbers`: value and formula of each element of
    the arguments that are constants of the device; `laws`: what may be a function of its own; `given`: path and range of the numbers
    that the C is given when it starts, `given_numbers` as `numbers` of functions in terms of these alone; `derived_type`: the C type of
    the structure of what follows from them."""

    real: Real
    ranges: Ranges
    numbers: Mapping[str, Sequence[tuple[float, str]]] = field(default_factory=dict)
    laws: Sequence[Law] = ()
    given: Mapping[str, Interval] = field(default_factory=dict)
    given_numbers: Mapping[str, Sequence[tuple[float, str]]] = field(default_factory=dict)
    derived_type: str = ""

    def __post_init__(self) -> None:
        self._graph = Graph(self.given)
        self._constants = Constants(self.real)
        self._constants.reserve(*(law.name for law in self.laws))
        self._law_texts: dict[str, str] = {}
        self._law_rows: dict[tuple[str, tuple[str, ...]], list[Node]] = {}

    @property
    def derived(self) -> list[Derived]:
        """What the kernels and tables so far read of the numbers that follow from those given at the start."""
        return list(self._constants.derived.values())

    def table(self, function: ca.Function) -> list[Node]:
        """The rows of a `function` of `given_numbers` alone."""
        return self._graph.rows(function, self.ranges, self.given_numbers)

    def member(self, node: Node) -> str:
        """A number outside the kernels: a literal, or a member of the structure of what is computed at the start."""
        return f"{DERIVED}->{self._constants.named(node)}" if node.source else self.real.literal(node.value)

    def array(self, nodes: Sequence[Node], name: str) -> str:
        """The member `name` of that structure that holds all of them."""
        return self._constants.array(nodes, name)

    def starting(self, members: Sequence[Derived], name: str, about: str) -> Kernel:
        """given, the numbers of the start -> those of `members`, one after the other."""
        rows = [source for member in members for source in member.sources]
        body = Rows(rows, self.real, self._constants, [], {}).run()
        text = _function(name, about, {GIVEN: len(self.given)}, len(rows), body.lines, self.real.value)
        return Kernel(name, text, (GIVEN,), body.operations, body.calls)

    def depends(self, member: Derived, path: str) -> bool:
        """Whether a member follows from the number at `path`."""
        return self._graph.read(GIVEN, list(self.given).index(path)) in reached(member.sources)

    @property
    def laws_text(self) -> str:
        """The laws that the kernels so far call."""
        return "\n".join(self._law_texts.values())

    def _calls(self, arguments: Mapping[str, int], rows: Sequence[Node]) -> dict[int, Call]:
        """The laws that rows need, by the number of their node, for every array that may stand for a law's argument."""
        needed, calls = {node.number for node in reached(rows)}, dict[int, Call]()
        for law in self.laws:
            names = [name for name in law.function.name_in() if name not in self.numbers]
            standing = [
                [a for a in (name, *STANDS_FOR.get(name, ())) if arguments.get(a) == law.function.numel_in(name)]
                or [name]
                for name in names
            ]
            for chosen in product(*standing):
                renamed = dict(zip(names, chosen, strict=True))
                if (law.name, chosen) not in self._law_rows:
                    self._law_rows[law.name, chosen] = self._rows(law.function, law.named, renamed)
                nodes = self._law_rows[law.name, chosen]
                if any(node.number in needed for node in nodes):
                    calls |= self._called(law, nodes)
        return calls

    def _rows(
        self, function: ca.Function, named: ca.Function | None, renamed: Mapping[str, str] | None = None
    ) -> list[Node]:
        """The rows of `function`, with the formulas of `named`, the same function in terms of parameters."""
        rows = self._graph.rows(function, self.ranges, self.given_numbers, renamed)
        if named is None:
            return rows
        return self._graph.with_formulas(rows, self._graph.rows(named, self.ranges, self.numbers, renamed))

    def _called(self, law: Law, nodes: Sequence[Node]) -> dict[int, Call]:
        """A law's rows as calls of one function of one axis; none where axes differ or depend on each other, or it is too short."""
        linear, texts = Linear({}), list[Text]()
        for i, node in enumerate(nodes):
            if node.leaf or any(n.index != i for n in reached([node]) if n.array):
                return {}
            texts.append(text_of(node, {}, linear, self.real))
        same = {
            (text.shape, tuple(same_number(c, self.real.literal(c.value)) for c in text.constants)) for text in texts
        }
        if len(same) > 1 or texts[0].operations < FEWEST_OPERATIONS:
            return {}
        by_name = {read.array: read for read in texts[0].reads}
        given = tuple({node.source.number: node for node in texts[0].constants if node.source}.values())
        calls = {}
        for i, node in enumerate(nodes):
            reads = tuple(self._graph.read(array, i) for array in by_name)
            calls[node.number] = Call(law.name, reads, texts[0].operations, texts[0].calls, given)
        if law.name not in self._law_texts:
            self._law_texts[law.name] = self._law_text(law, texts[0], list(by_name), given)
        return calls

    def _law_text(self, law: Law, text: Text, arrays: Sequence[str], given: Sequence[Node]) -> str:
        T = self.real.value

        def filled(match: re.Match[str]) -> str:
            kind, k = match[1], int(match[2])
            if kind == "t":
                return f"t{k + 1}"
            return (
                self._constants.named(text.constants[k])
                if kind == "c"
                else SCALAR_NAMES.get(text.reads[k].array, text.reads[k].array)
            )

        lines = [bare(PLACE.sub(filled, line)) for line in text.lines] + [f"return {PLACE.sub(filled, text.result)};"]
        names = [SCALAR_NAMES.get(array, array) for array in arrays] + [self._constants.named(node) for node in given]
        parameters = ", ".join(f"{T} {name}" for name in names)
        return f"{_comment(law.about)}static inline {T} {law.name}({parameters})\n{{\n{_indented(lines)}\n}}\n"

    @property
    def constants(self) -> str:
        """The named constants of all kernels so far, one line each with its formula."""
        return self._constants.text()

    def kernel(
        self,
        function: ca.Function,
        name: str,
        about: str = "",
        may_be_result: Sequence[str] = (),
        steps: tuple[str, int] | None = None,
        returned: bool = False,
        named: ca.Function | None = None,
        one_by_one: bool = False,
    ) -> Kernel:
        """`function` (SX, dense arguments, one result) as a static C function writing to its last parameter.

        `about`: its comment. `may_be_result`: arguments that a caller may give as the result too. With `steps` (argument, count) the
        function is one step of an iteration on that argument, and the printed one takes `count` of them. The only row can be
        `returned` instead. Short rows are written `one_by_one`, or as a loop over a table. `named` is the same function with an argument
        of `numbers`, from which its numbers have their formulas.
        Raises CtrlgenError for an operation C has no counterpart of.
        """
        rows = self._rows(function, named)
        laws = self._calls({a: function.numel_in(a) for a in function.name_in() if a not in self.given_numbers}, rows)
        body = Rows(rows, self.real, self._constants, [steps[0]] if steps else may_be_result, laws, one_by_one).run()
        body.lines = self._with_derived(body.lines)
        sizes = {a: function.size1_in(a) for a in function.name_in() if a not in self.given_numbers}
        parts = [(name, about, body.lines)]
        if steps:
            parts = _iterated(name, about, body, *steps, sizes)
        arguments = [_read(sizes, lines) for _, _, lines in parts]
        if len(parts) > 1:
            arguments[1] = tuple(a for a in (DERIVED, *sizes) if a in arguments[0] or a in arguments[1])
        texts = [
            _function(
                one,
                words,
                {a: sizes.get(a, self.derived_type) for a in read},
                0 if returned else function.size1_out(0),
                lines,
                self.real.value,
            )
            for (one, words, lines), read in zip(parts, arguments, strict=True)
        ]
        operations = body.operations * (steps[1] if steps else 1)
        return Kernel(name, "\n".join(texts), arguments[-1], operations, body.calls)

    def _with_derived(self, lines: Sequence[str]) -> list[str]:
        """`lines` with a local copy of each number of the structure that they name: it stays in a register."""
        words = set(re.findall(r"\b\w+\b", " ".join(lines)))
        used = [member.name for member in self.derived if len(member.nodes) == 1 and member.name in words]
        return [*(f"const {self.real.value} {name} = {DERIVED}->{name};" for name in used), *lines]


def _read(sizes: Mapping[str, int], lines: Sequence[str]) -> tuple[str, ...]:
    """The names of the arguments that `lines` read."""
    return tuple(
        a
        for a in (DERIVED, *sizes)
        if any(re.search(rf"\b{a}->" if a == DERIVED else rf"\b{a}\[", line) for line in lines)
    )


def _iterated(
    name: str, about: str, body: Rows, argument: str, count: int, sizes: Mapping[str, int]
) -> list[tuple[str, str, list[str]]]:
    """Functions that take `count` steps of an iteration on `argument`: name, comment, lines. Axes that do not depend on each other are
    iterated one after the other; others together, by a function that is one step."""
    size, T, entry = len(body.rows), body.real.value, f"{argument}[i]"
    loop = body.lines[body.lines.index(f"for (i = 0; i < {size}; i++) {{") :] if body.single_loop else []
    if loop and all(index == entry for line in loop for index in re.findall(rf"\b{argument}\[[^]]*\]", line)):
        head, inner = body.lines[: -len(loop)], [line.replace(entry, "value") for line in loop[1:-1]]
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
        return [
            (
                name,
                about,
                [
                    *head,
                    loop[0],
                    f"    {T} value = {entry};",
                    "    int step;",
                    *before,
                    f"    for (step = 0; step < {count}; step++) {{",
                    *during,
                    "    }",
                    "    result[i] = value;",
                    "}",
                ],
            )
        ]
    read = _read(sizes, body.lines)
    call = ", ".join("result" if a == argument else a for a in read)
    start = [f"for (i = 0; i < {size}; i++) {{", f"    result[i] = {argument}[i];", "}"]
    again = [f"for (step = 0; step < {count}; step++) {{", f"    {name}_step({call}, result);", "}"]
    return [
        (f"{name}_step", about, body.lines),
        (name, f"{count} such steps.", ["int i;", "int step;", *start, *again]),
    ]


def _function(
    name: str, about: str, arguments: Mapping[str, int | str], size: int, lines: Sequence[str], T: str
) -> str:
    """A static function of arrays of so many numbers, and of pointers to such a type; with `size` 0 it returns its only row."""
    read = [f"const {n} *{a}" if isinstance(n, str) else f"const {T} {a}[{n}]" for a, n in arguments.items()]
    comment = _comment(about)
    if not size:
        lines = [line.replace("result[0] =", "return") for line in lines]
        return f"{comment}static {T} {name}({', '.join(read)})\n{{\n{_indented(lines)}\n}}\n"
    parameters = ", ".join([*read, f"{T} result[{size}]"])
    return f"{comment}static void {name}({parameters})\n{{\n{_indented(lines)}\n}}\n"


def _comment(about: str) -> str:
    return "\n".join(textwrap.wrap(f"/* {c_comment(about)} */", WIDTH, subsequent_indent=" * ")) + "\n" if about else ""


def _indented(lines: Sequence[str]) -> str:
    wrapped = []
    for line in lines:
        inner = len(line) - len(line.lstrip()) + 4
        wrapped += textwrap.wrap(
            line.strip(),
            WIDTH,
            initial_indent=" " * inner,
            subsequent_indent=" " * (inner + 4),
            break_long_words=False,
            break_on_hyphens=False,
        )
    return "\n".join(wrapped)
