"""Results as tables: columns with names and units, as pandas' DataFrame and xarray's Dataset; and as figures and a page.

What draws a result and what writes its page stand above the result itself (`ctrlgen.app.shown_results`), which is therefore looked up by
its name when it is asked for.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ctrlgen.core.errors import CtrlgenError, Fault, InputError
from ctrlgen.core.shown import Shown

if TYPE_CHECKING:
    import pandas

ABOVE = "ctrlgen.app.shown_results"
"""The module that draws results and writes their pages."""


@dataclass(frozen=True)
class Column:
    """`values` (n,) by the `name` and `unit` of their column; numbers in that unit. Texts have none: the empty unit."""

    name: str
    unit: str
    values: Any

    @property
    def heading(self) -> str:
        """'drive.axis [V]'; without a unit the name alone."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


class Tabular(Shown):
    """A result with a table in it."""

    @abstractmethod
    def columns(self) -> tuple[Column, ...]:
        """The columns of its table, of one length; the first is the index."""

    def to_pandas(self) -> pandas.DataFrame:
        """Its table as a DataFrame: columns are named `name [unit]`, numbers in that unit; the index is named so too."""
        import pandas  # takes half a second to import

        index, *columns = self.columns()
        data = {column.heading: column.values for column in columns}
        return pandas.DataFrame(data, index=pandas.Index(index.values, name=index.heading))

    def to_xarray(self) -> Any:
        """Its table as an xarray.Dataset: a variable a column, with its unit in `attrs["units"]`, over the index.

        Raises CtrlgenError where xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise CtrlgenError(
                "xarray is not installed; pip install 'ctrlgen[xarray]', or use to_pandas(), which needs nothing more"
            ) from error
        index, *columns = self.columns()
        variables = {c.name: (index.name, list(c.values) if not c.unit else c.values, _attributes(c)) for c in columns}
        return xarray.Dataset(variables, {index.name: (index.name, index.values, _attributes(index))})


def _attributes(column: Column) -> dict[str, str]:
    return {"units": column.unit} if column.unit else {}


class Drawing:
    """Figures of one result by name, each SVG text. A notebook shows them; `save` writes them."""

    def __init__(self, figures: Mapping[str, str]) -> None:
        self.figures = dict(figures)

    def __repr__(self) -> str:
        return f"<Drawing: {', '.join(self.figures)}>"

    def _repr_html_(self) -> str:
        """The figures, one below the other."""
        return "".join(f"<figure>{text}</figure>" for text in self.figures.values())

    def save(self, path: Path | str) -> tuple[Path, ...]:
        """Writes the one figure into the file `path` (.svg), or several into that folder, each as its name. Raises InputError."""
        path = Path(path)
        if path.suffix and path.suffix != ".svg":
            raise InputError("path", [Fault(str(path), "must end in .svg, or be a folder")])
        if path.suffix and len(self.figures) > 1:
            what = (
                f"is one file for {len(self.figures)} figures; name a folder, or plot one of {', '.join(self.figures)}"
            )
            raise InputError("path", [Fault(str(path), what)])
        files = [path if path.suffix else path / f"{name.replace('/', '_')}.svg" for name in self.figures]
        for file, text in zip(files, self.figures.values(), strict=True):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
        return tuple(files)


class Page:
    """The page of a result. A notebook shows it in a frame; `save` writes it with all its files, as the command line does."""

    def __init__(self, title: str, files: Mapping[str, bytes], page: str) -> None:
        self.title, self.files, self.name = title, dict(files), page

    def __repr__(self) -> str:
        return f"<Page: {self.title}, {self.name}, {len(self.html) // 1000} kB>"

    @property
    def html(self) -> str:
        """The whole page: one text that needs no other file."""
        return self.files[self.name].decode("utf-8")

    def _repr_html_(self) -> str:
        """The page in a frame of its own, so that neither its style nor the notebook's reaches the other."""
        return f'<iframe title="{escape(self.title)}" srcdoc="{escape(self.html)}" style="width:100%;height:40em;border:0"></iframe>'

    def save(self, folder: Path | str) -> Path:
        """Writes all files of the result into `folder`, beside what is there; returns the path of the page."""
        for name, content in self.files.items():
            (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
            (Path(folder) / name).write_bytes(content)
        return Path(folder) / self.name


class Drawn(Shown):
    """A result that can be drawn."""

    def plot(self, *names: str) -> Drawing:
        """Its figures, all or those of these names. Raises InputError for a name that it has none of."""
        figures: Mapping[str, str] = import_module(ABOVE).figures_of(self)
        return Drawing(chosen(figures, names))


class Reported(Drawn):
    """A result that has a page."""

    @property
    def report(self) -> Page:
        """Its page, as the command line writes it."""
        page: Page = import_module(ABOVE).page_of(self)
        return page


def chosen(figures: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """The figures of these names, all for none. Raises InputError."""
    names = tuple(names)
    if unknown := [name for name in names if name not in figures]:
        known = ", ".join(figures) or "none"
        raise InputError("plot", [Fault(name, f"is no figure of this result; there are {known}") for name in unknown])
    return {name: figures[name] for name in names or figures}
