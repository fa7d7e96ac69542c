"""The constants of a C file by name, each with the formula that it comes from.

Those that are known only when the program starts are members of a structure, which kernels read (`Derived`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ctrlgen.core.c_names import KEYWORDS
from ctrlgen.firmware.c.expression_graph import Node
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import words_of_c

WIDTH = 120  # columns of a line of C
# Names of arguments, variables and tables of the kernels, and members of `Derived` that are tables of limits.
LOCAL = "x z i d state wanted target drive result next value step given derived s_low s_high"
NUMBERED = re.compile(r"(t|TABLE_)\d+", re.IGNORECASE)  # what a kernel numbers
DERIVED = "derived"  # the structure's name in C


@dataclass(frozen=True)
class Derived:
    """A member of the structure of what is computed when the program starts: a number, or a table of several; each has a `formula`."""

    name: str
    nodes: tuple[Node, ...]
    formula: str

    @property
    def sources(self) -> tuple[Node, ...]:
        """The nodes that its numbers are computed by."""
        return tuple(node.source or node for node in self.nodes)


class Constants:
    """The named constants of a file."""

    def __init__(self, real: Real) -> None:
        self.real = real
        self.names: dict[tuple[str, str], str] = {}
        self.lines: list[str] = []
        self.derived: dict[tuple[int, ...], Derived] = {}  # by the numbers of its nodes
        self._reserved = {*LOCAL.split(), *KEYWORDS, *words_of_c()}

    def reserve(self, *names: str) -> None:
        """Names that no constant and no member of `derived` may have."""
        self._reserved |= set(names)

    def named(self, node: Node) -> str:
        """How a number is written in an expression: by its name where it has a formula."""
        if node.source is not None:
            return self._member((node,)).name
        literal = self.real.literal(node.value)
        if not node.formula:
            return f"({literal})" if literal.startswith("-") else literal
        key = literal, node.formula
        if key not in self.names:
            name = self.names[key] = _name_of(node.formula, self._reserved | set(self.names.values()))
            line = f"#define {name} ({literal}) /* {node.formula} */"
            if len(line) > WIDTH:
                line = f"/* {node.formula} */\n#define {name} ({literal})"
            self.lines.append(line)
        return self.names[key]

    def array(self, nodes: Sequence[Node], name: str = "") -> str:
        """A table of numbers of which some are known only when the program starts."""
        return f"{DERIVED}->{self._member(tuple(nodes), name).name}"

    def _member(self, nodes: tuple[Node, ...], name: str = "") -> Derived:
        key = tuple((node.source or node).number for node in nodes)
        if key not in self.derived:
            formula = next((node.formula for node in nodes if node.source and node.formula), "")
            taken = {member.name.upper() for member in self.derived.values()} | {
                name.upper() for name in self._reserved
            }
            name = name or _name_of(formula, taken).lower() or f"constant_{len(self.derived) + 1}"
            self.derived[key] = Derived(name, nodes, formula if len(nodes) == 1 else "")
        return self.derived[key]

    def text(self) -> str:
        """The lines of C that define the constants."""
        return "\n".join(self.lines)


def _name_of(formula: str, taken: set[str]) -> str:
    """A name for a constant: of the parameter that it is, or of those that it is made of, numbered."""
    paths = re.findall(r"[a-z_][\w\[\]]*(?:\.[\w\[\]]+)*", re.sub(r"\b[a-z]+\(", "(", formula))
    part = 0 if formula.startswith("f(") else -1  # of many parameters the sections that they stand in
    words = dict.fromkeys(re.sub(r"\W", "_", path.split(".")[part]).strip("_").upper() for path in paths)
    base = "_".join(list(words)[:2])
    name, k = (base if formula in paths else f"{base}_1"), 1
    while name in taken or NUMBERED.fullmatch(name):
        k += 1
        name = f"{base}_{k}"
    return name
