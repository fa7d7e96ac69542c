"""Questions about how a measurement file is written, with the keys of `layout` that answer them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from ctrlgen.core.errors import Fault, InputError


class Ambiguous(ValueError):
    """`what` a file leaves open, and its `answers`: keys of `layout` such as `decimal = ","`, each with what follows it in a sentence, such
    as when it is the answer. None where only another file helps, which `what` then says."""

    def __init__(self, what: str, answers: Mapping[str, str] | None = None) -> None:
        super().__init__(what, answers)
        self.what = what
        self.answers = dict(answers or {})

    def asked(self, written: Callable[[str], str]) -> str:
        """The question to a reader who gives an answer as `written` says of its key."""
        ways = " or ".join(f"{written(key)} {behind}".rstrip() for key, behind in self.answers.items())
        if not ways:
            return self.what
        return f"{self.what} Write {ways}" if self.what.endswith("?") else f"{self.what}: write {ways}"

    def __str__(self) -> str:
        return self.asked(lambda key: f"layout = {{ {key} }}")

    def of_column(self, name: str) -> Ambiguous:
        """The same question, of a column."""
        return Ambiguous(f"column {name!r} {self.what}", self.answers)


class AmbiguousFile(InputError):
    """A file that is not read before the `question` about it is answered; the message is that of recording.toml."""

    def __init__(self, path: Path, question: Ambiguous) -> None:
        super().__init__(path, [Fault(path.name, str(question))])
        self.question = question
