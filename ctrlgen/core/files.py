"""Files in and out: TOML with all faults at once, and writing that is whole or not at all."""

from __future__ import annotations

import difflib
import os
import shutil
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ctrlgen.core.errors import Fault, InputError

Model = TypeVar("Model", bound=BaseModel)


def read_text(path: Path | str) -> str:
    """The text of a file, UTF-8. Raises InputError when it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(path, [Fault("file", "does not exist; check the path")]) from None
    except IsADirectoryError:
        raise InputError(path, [Fault("file", "is a folder; name the file inside it")]) from None
    except UnicodeDecodeError as error:
        raise InputError(path, [Fault("file", f"is not UTF-8 text (byte {error.start}); save it as UTF-8")]) from None
    except OSError as error:
        raise InputError(path, [Fault("file", f"cannot be read: {error.strerror}")]) from None


def read_toml(path: Path | str) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError with the line of a syntax error."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, [Fault("syntax", f"{error}; see https://toml.io for the notation")]) from None


def validate(model: type[Model], table: dict[str, Any], path: Path | str) -> Model:
    """`table` as a `model`. Raises InputError listing every fault with its dotted key and a remedy."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise InputError(path, [_fault(model, details) for details in error.errors()]) from None


def _fault(model: type[BaseModel], details: Any) -> Fault:
    tags = {"function-before", *_tags(model)}  # pydantic's own names of the branches of a union
    location = [
        part for k, part in enumerate(details["loc"]) if not (part in tags and (k > 0 or part == "function-before"))
    ]
    where = ""
    for part in location:
        where += f"[{part}]" if isinstance(part, int) else (f".{part}" if where else str(part))
    message = str(details["msg"]).removeprefix("Value error, ")
    if details["type"] == "missing":
        message = "is missing; add it"
    elif details["type"] == "extra_forbidden":
        siblings = _keys(model, details["loc"][:-1])
        near = difflib.get_close_matches(str(location[-1]), siblings, n=1)
        message = "is not a key I know; " + (
            f"did you mean {near[0]!r}?" if near else f"known here: {', '.join(siblings)}"
        )
    elif details["type"] in _REMEDY:
        message = f"{details['input']!r}: {_REMEDY[details['type']]}"
    elif details["type"] == "literal_error":
        message = f"{details['input']!r} must be {details['ctx']['expected']}"
    return Fault(where or "file", message)


_REMEDY = {
    "tuple_type": "write a list, such as [..., ...]",
    "string_type": 'write a text in quotes, such as "..."',
    "int_type": "write a whole number",
    "int_parsing": "write a whole number",
    "float_type": "write a number without a unit",
    "float_parsing": "write a number without a unit",
    "bool_type": "write true or false",
    "model_type": "write a table, such as { ... } or [section]",
    "dict_type": 'write a table, such as { delta_z = "20 um" }',
}


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The tables that a field of this type may hold."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for member in getattr(annotation, "__args__", ()):
        yield from _models(member)


def _kinds(model: type[BaseModel]) -> set[str]:
    """Values of `kind` by which a table is known as this model."""
    kind = model.model_fields.get("kind")
    return set(getattr(getattr(kind, "annotation", None), "__args__", ()))


def _tags(model: type[BaseModel]) -> set[str]:
    """Values of `kind` by which unions inside `model` are told apart."""
    members = (member for field in model.model_fields.values() for member in _models(field.annotation))
    return {kind for member in members for kind in _kinds(member)}


def _keys(model: type[BaseModel], location: Sequence[Any]) -> list[str]:
    """What may stand in the table at `location`, a path of keys, indices and kinds."""
    models = [model]
    for part in location:
        fields = [m.model_fields[part] for m in models if part in m.model_fields]
        if fields:
            models = [member for field in fields for member in _models(field.annotation)]
        else:
            models = [m for m in models if part in _kinds(m)] or models
    return list(dict.fromkeys(key for m in models for key in m.model_fields))


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8, whole or not at all."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` whole or not at all: a temporary file beside `path`, then a rename."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """A folder that appears at `out` only when the block ends without an error.

    Yields a temporary folder beside `out`; on success it replaces `out`, which must be absent, empty, or an
    earlier result and nothing else (`.ctrlgen` lists what was made). On an error or Ctrl-C `out` is left as it was.
    Raises InputError when `out` cannot be written or holds somebody else's files.
    """
    try:
        out = Path(out).resolve()
        if out.exists() and not out.is_dir():
            raise InputError(out, [Fault("--out", "is a file; name a folder")])
        foreign = _foreign(out)
        if foreign:
            what = f"holds {foreign[0]}, which ctrlgen did not make; move it away, or name an empty or new folder"
            raise InputError(out, [Fault("--out", what)])
        out.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.name}."))
    except OSError as error:
        raise InputError(
            out, [Fault("--out", f"cannot be written ({error.strerror}); name a folder you may write")]
        ) from None
    retired = draft.with_name(draft.name + ".old")
    try:
        yield draft
        made = sorted(str(path.relative_to(draft)) for path in draft.rglob("*") if path.is_file())
        (draft / MARKER).write_text("\n".join(made) + "\n", encoding="utf-8")
        draft.chmod(0o755)
        if out.exists():
            os.replace(out, retired)
        os.replace(draft, out)
    except BaseException:
        if retired.exists() and not out.exists():
            os.replace(retired, out)
        shutil.rmtree(draft, ignore_errors=True)
        raise
    finally:
        shutil.rmtree(retired, ignore_errors=True)


def _foreign(out: Path) -> list[str]:
    """Files in `out` that an earlier run did not list as its own."""
    if not out.is_dir():
        return []
    marker = out / MARKER
    made = {MARKER, *marker.read_text(encoding="utf-8").splitlines()} if marker.exists() else set()
    return sorted(
        name for path in out.rglob("*") if path.is_file() and (name := str(path.relative_to(out))) not in made
    )


MARKER = ".ctrlgen"
