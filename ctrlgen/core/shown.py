"""How results show themselves: in one line at a prompt, as a small table in a notebook."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from html import escape


class Shown:
    """A result that says in a few facts what it is, instead of printing every number that it holds."""

    @abstractmethod
    def facts(self) -> Mapping[str, object]:
        """What a reader wants to know first, by a word or two each; values are shown as text."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {', '.join(f'{name} {value}' for name, value in self.facts().items())}>"

    def _repr_html_(self) -> str:
        """The table that Jupyter shows."""
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td style='text-align:left'>{escape(str(value))}</td></tr>"
            for name, value in self.facts().items()
        )
        return f"<table><caption style='text-align:left'><b>{type(self).__name__}</b></caption>{rows}</table>"
