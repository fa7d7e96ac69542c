"""C without its conditions and macros: what a C preprocessor would leave of a text, comments and layout kept.

It knows `#if`, `#elif`, `#else`, `#endif`, `#define`, `#undef` and `#include`, and macros whose calls stand on one line with arguments
that hold no parentheses. A macro whose body has several lines gives each the indentation of the line that it stands alone on. That is
less than C has, and enough for `codegen/limiter`; a test compares it with a compiler's own preprocessor.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
WORD = re.compile(r"\b[A-Za-z_]\w*\b")
DEFINE = re.compile(r"(\w+)(?:\(([^)]*)\))?(?:\s+(.*))?")


@dataclass(frozen=True)
class Macro:
    """`body` in place of a name, or of a call with `parameters`."""

    body: str
    parameters: tuple[str, ...] | None = None

    def called(self, arguments: str) -> str:
        """The body with the `arguments` in place of the parameters."""
        names = dict(zip(self.parameters or (), (a.strip() for a in arguments.split(",")), strict=True))
        return re.sub(r"\s*##\s*", "", WORD.sub(lambda match: names.get(match[0], match[0]), self.body))

    def defined_as(self, name: str) -> str:
        """The #define in C of a macro of that `name`."""
        parameters = "" if self.parameters is None else f"({', '.join(self.parameters)})"
        lines = self.body.split("\n")
        return f"#define {name}{parameters} " + " \\\n    ".join(lines)


def resolved(text: str, macros: Mapping[str, Macro], include: Callable[[str], str | None]) -> str:
    """`text` with its conditions resolved and its macros expanded. `include` gives the text of a file by its name, None for one whose
    include is left out. Raises ValueError for a directive or a call that is none of the kinds above."""
    return _Preprocessor(dict(macros), include).run(text)


@dataclass
class _Preprocessor:
    macros: dict[str, Macro]
    include: Callable[[str], str | None]

    def run(self, text: str) -> str:
        # Of each condition that is open: whether this part is read, whether one was.
        taken: list[tuple[bool, bool]] = []
        kept: list[str] = []
        for line in self._logical_lines(text):
            directive = re.match(r"#\s*(\w+)\s*(.*)", line, re.DOTALL)
            reading = all(read for read, _ in taken)
            if directive is None:
                kept += [self._expanded(line)] if reading else []
                continue
            kind, rest = directive[1], COMMENT.sub("", directive[2]).strip()
            if kind == "if":
                holds = reading and self._holds(rest)
                taken.append((holds, holds))
            elif kind in ("elif", "else"):
                _, before = taken.pop()
                outside = all(read for read, _ in taken)
                holds = outside and not before and (kind == "else" or self._holds(rest))
                taken.append((holds, before or holds))
            elif kind == "endif":
                taken.pop()
            elif reading:
                kept += self._directive(kind, rest)
        if taken:
            raise ValueError("a condition is not closed")
        return "\n".join(kept)

    def _logical_lines(self, text: str) -> list[str]:
        """Lines of `text`; one that begins inside a comment is of the line where it began."""
        lines: list[str] = []
        for line in text.split("\n"):
            if lines and "/*" in COMMENT.sub("", lines[-1]):
                lines[-1] += f"\n{line}"
            else:
                lines.append(line)
        return lines

    def _directive(self, kind: str, rest: str) -> list[str]:
        if kind == "define":
            name, parameters, body = DEFINE.fullmatch(rest).groups()  # type: ignore[union-attr]
            split = None if parameters is None else tuple(p.strip() for p in parameters.split(","))
            self.macros[name] = Macro(body or "", split)
            return []
        if kind == "undef":
            self.macros.pop(rest, None)
            return []
        if kind == "include":
            text = self.include(rest.strip('"<>'))
            return [] if text is None else [self.run(text).rstrip("\n")]
        raise ValueError(f"#{kind} {rest}")

    def _holds(self, condition: str) -> bool:
        """The value of a condition; a name that is no macro is 0, as in C."""
        text = re.sub(r"\bdefined\((\w+)\)", lambda m: str(int(m[1] in self.macros)), condition)
        text = WORD.sub("0", self._replaced(text))
        for c, python in (("&&", " and "), ("||", " or ")):
            text = text.replace(c, python)
        return bool(eval(re.sub(r"!(?!=)", " not ", text), {"__builtins__": {}}))

    def _expanded(self, line: str) -> str:
        """`line` with the macros that are outside comments."""
        indent = line[: len(line) - len(line.lstrip())]
        parts, at = [], 0
        for comment in COMMENT.finditer(line):
            parts += [self._replaced(line[at : comment.start()]).replace("\n", f"\n{indent}"), comment[0]]
            at = comment.end()
        return "".join([*parts, self._replaced(line[at:]).replace("\n", f"\n{indent}")])

    def _replaced(self, code: str) -> str:
        """`code` without comments, its macros expanded until none is left but, as in C, in what it stands for itself."""
        at = 0
        # Of each expansion that may not have ended: the macro, and how many characters stand behind it.
        expanding: list[tuple[str, int]] = []
        while match := WORD.search(code, at):
            at = match.end()
            expanding = [(name, behind) for name, behind in expanding if match.end() <= len(code) - behind]
            macro = self.macros.get(match[0])
            if macro is None or match[0] in (name for name, _ in expanding):
                continue
            end, body = match.end(), macro.body
            if macro.parameters is not None:
                call = re.compile(r"\s*\(([^()]*)\)").match(code, end)
                if call is None:
                    continue  # its name alone is an argument
                end, body = call.end(), macro.called(call[1])
            expanding.append((match[0], len(code) - end))
            code = code[: match.start()] + body + code[end:]
            at = match.start()
        return code
