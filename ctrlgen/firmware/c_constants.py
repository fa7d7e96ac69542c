"""The constants of a C file by name, each with the formula that it comes from."""

from __future__ import annotations

import re

from ctrlgen.firmware.expression_graph import Node
from ctrlgen.firmware.real import Real

WIDTH = 120  # columns of a line of C
RESERVED = (  # names of the templates
    "LOW", "HIGH", "SLACK", "P", "X_REST", "TARGET_LIMIT", "U_LOW", "U_HIGH", "U_SLACK", "U_LEAST", "U_MOST", "U_SAFE", "READY", "NULL",
)  # fmt: skip


class Constants:
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
            line = f"#define {name} ({literal}) /* {node.formula} */"
            if len(line) > WIDTH:
                line = f"/* {node.formula} */\n#define {name} ({literal})"
            self.lines.append(line)
        return self.names[key]

    def text(self) -> str:
        """Their lines."""
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
