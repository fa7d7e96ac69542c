"""The mutants of a file, and a seeded draw of them.

Left out by rule, because nothing that a test may see depends on them, or because any test sees them:

- docstrings and other texts (no operator changes them), and what stands inside an f-string of an error: in `raise`, in
  `Fault(...)`, in `warn(...)`, in a logger's call, or assigned to `what`;
- annotations of types, which are not evaluated; blocks under TYPE_CHECKING; `__all__`;
- contracts that working code does not touch: `strict=` of zip, `frozen=`, `eq=`, `slots=`, `init=` and `repr=` of dataclasses;
- `@cache` and `@cached_property` taken away from what is computed again alike;
- comparisons by identity in place of equality and back, which agree on small numbers, names and None;
- arithmetic replaced by shifts, bits, powers and remainders: on floats and CasADi's symbols these raise at once, and would flatter the
  count, as ~ and `not` in place of a minus would. Plus, minus, times and divided by replace one another.
"""

from __future__ import annotations

import ast
import difflib
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cosmic_ray.plugins
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code

from mutants.seen import Seen

ARITHMETIC = {"Add", "Sub", "Mul", "Div"}
CONTRACTS = {"strict", "frozen", "eq", "slots", "init", "repr"}
SAYING = {"Fault", "warn", "debug", "info", "warning", "error", "exception"}
Place = tuple[int, int]  # line, from 1, and column, from 0


@dataclass(frozen=True)
class Mutant:
    """One change of one place of a file (relative to the root): the `occurrence`-th of cosmic-ray's `operator`."""

    area: str
    file: str
    operator: str
    occurrence: int
    line: int
    definition: str

    def code(self, source: str) -> str | None:
        """The file's text with the change; None where there is none, or none that Python reads."""
        changed = mutate_code(source, cosmic_ray.plugins.get_operator(self.operator)(), self.occurrence)
        if changed is None or changed == source:
            return None
        try:
            same = ast.dump(ast.parse(changed)) == ast.dump(ast.parse(source))
        except SyntaxError:
            return None
        return None if same else changed

    def diff(self, source: str) -> str:
        """The change as a unified diff."""
        lines = (text.splitlines(keepends=True) for text in (source, self.code(source) or source))
        return "".join(difflib.unified_diff(*lines, self.file, self.file, n=1))


def operators() -> list[str]:
    """The names of the operators in use, sorted."""
    return sorted(name for name in cosmic_ray.plugins.operator_names() if _used(name))


def _used(name: str) -> bool:
    kind = name.partition("/")[2]
    if cosmic_ray.plugins.get_operator(name).arguments() or kind == "NoOp":
        return False
    words = kind.split("_")
    if words[0] == "ReplaceBinaryOperator":
        return set(words[1:]) <= ARITHMETIC
    if words[0] == "ReplaceComparisonOperator":
        identity = {"Is", "IsNot"}
        return len(identity & set(words[1:])) != 1
    if words[0] == "ReplaceUnaryOperator":
        return "Invert" not in words and words[1:] != ["USub", "Not"]
    return True


def mutants(root: Path, area: str, path: Path) -> Iterator[Mutant]:
    """Every mutant of one file that the rules leave."""
    source = path.read_text()
    nodes, spared = list(ast_nodes(get_ast(source))), left_out(source)
    definitions = _definitions(source)
    for name in operators():
        operator = cosmic_ray.plugins.get_operator(name)()
        places = [place for node in nodes for place in operator.mutation_positions(node)]
        for occurrence, (begin, end) in enumerate(places):
            if not any(a <= begin and end <= b for a, b in spared):
                yield Mutant(
                    area, str(path.relative_to(root)), name, occurrence, begin[0], definitions.get(begin[0], "")
                )


def drawn(root: Path, areas: dict[str, list[Path]], count: int, seed: int, known: Seen | None = None) -> list[Mutant]:
    """`count` mutants, as many of each area, at most one at a place: first the place is drawn, then one of its changes.

    Areas that come first get one more where the count does not divide. With `known`, lines that a test can see alone.
    """
    chosen = []
    for k, (area, paths) in enumerate(areas.items()):
        rng = random.Random(f"{seed} {area}")
        share = count // len(areas) + (k < count % len(areas))
        places: dict[tuple[str, int, str], list[Mutant]] = {}
        for path in paths:
            for m in mutants(root, area, path):
                kind = (
                    "number"
                    if "Number" in m.operator
                    else "comparison"
                    if "Comparison" in m.operator
                    else m.operator[:27]
                )
                places.setdefault((m.file, m.line, kind), []).append(m)
        keys = sorted(places)
        rng.shuffle(keys)
        found = 0
        for key in keys:
            if found == share:
                break
            candidates = places[key]
            rng.shuffle(candidates)
            source = (root / key[0]).read_text()
            one = next((m for m in candidates if m.code(source) is not None), None)
            if one is not None and (known is None or known.tests(one.file, one.line)):
                chosen.append(one)
                found += 1
    return chosen


def left_out(source: str) -> list[tuple[Place, Place]]:
    """Where the rules leave mutants out: from, to."""
    found: list[ast.AST] = []
    lines: list[tuple[Place, Place]] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation:
            found.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            kept = [d for d in node.decorator_list if _name(d) in ("cache", "lru_cache", "cached_property")]
            lines += [((d.lineno, 0), (d.end_lineno + 1, 0)) for d in kept]
            found += [node.returns] if getattr(node, "returns", None) else []
        elif isinstance(node, ast.keyword) and node.arg in CONTRACTS:
            found.append(node.value)
        elif (isinstance(node, ast.If) and _name(node.test) == "TYPE_CHECKING") or (
            isinstance(node, ast.Assign) and any(_name(t) == "__all__" for t in node.targets)
        ):
            found.append(node)
        if (
            isinstance(node, ast.Raise)
            or (isinstance(node, ast.Call) and _name(node.func) in SAYING)
            or (isinstance(node, ast.Assign) and any(_name(t) == "what" for t in node.targets))
        ):
            found += [text for text in ast.walk(node) if isinstance(text, ast.JoinedStr)]
    return lines + [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in found]


def _name(node: ast.expr) -> str:
    """The last name of what is called, tested or assigned."""
    if isinstance(node, ast.Call):
        node = node.func
    return getattr(node, "attr", getattr(node, "id", ""))


def _definitions(source: str) -> dict[int, str]:
    """The innermost function or class by line."""
    found: dict[int, str] = {}
    for node in ast.walk(ast.parse(source)):  # outer ones come first
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.update(dict.fromkeys(range(node.lineno, node.end_lineno + 1), node.name))
    return found
