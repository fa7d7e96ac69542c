"""Files in and out: TOML with all faults at once, and writing that is whole or not at all."""

from __future__ import annotations

import difflib
import errno
import os
import re
import reprlib
import secrets
import shutil
import stat
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ctrlgen.core.errors import Fault, InputError, TableFaults, WrongUnit
from ctrlgen.core.file_limits import LARGEST_TEXT, TOO_DEEP, foreign_parts, unreadable_toml
from ctrlgen.core.names import meant
from ctrlgen.core.steps import STEPS

Model = TypeVar("Model", bound=BaseModel)


def read_text(path: Path | str) -> str:
    """The text of a file, UTF-8 with or without a byte order mark. Raises InputError when it cannot be read."""
    try:
        about = os.stat(path)
        if not stat.S_ISREG(about.st_mode) and not stat.S_ISDIR(about.st_mode):
            raise InputError(path, [Fault("file", "is no regular file; save what it gives as a file, and name that")])
        if about.st_size > LARGEST_TEXT:
            what = f"has {about.st_size / 1e6:.0f} MB; a text file has at most {LARGEST_TEXT / 1e6:.0f}: is it the right one?"
            raise InputError(path, [Fault("file", what)])
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, [Fault("file", "does not exist; check the path")]) from None
    except IsADirectoryError:
        raise InputError(path, [Fault("file", "is a folder; name the file inside it")]) from None
    except UnicodeDecodeError as error:
        raise InputError(path, [Fault("file", f"is not UTF-8 text (byte {error.start}); save it as UTF-8")]) from None
    except OSError as error:
        raise InputError(path, [Fault("file", f"cannot be read: {explained(error)}")]) from None
    except ValueError:  # a name with a null character
        raise InputError(repr(str(path)), [Fault("file", "is no name of a file; correct the path")]) from None


def explained(error: OSError) -> str:
    """What the operating system refused, and what to do about it where that is known."""
    said = error.strerror or str(error)
    remedy = _REMEDIES.get(error.errno or 0)
    return f"{said}; {remedy}" if remedy else said


_REMEDIES = {
    errno.ENOSPC: "free space on that disk, or write to another one",
    errno.EDQUOT: "your share of that disk is used up: free space, or write to another one",
    errno.EFBIG: "raise the limit of the size of a file (ulimit -f), or ask for fewer samples",
    errno.EROFS: "that disk is read-only: write to another one",
    errno.EACCES: "you may not; name a place where you may, or have it permitted",
    errno.EPERM: "you may not; name a place where you may, or have it permitted",
    errno.ELOOP: "a link leads back to itself; remove or correct the link",
    errno.ENOENT: "check the path",
    errno.EEXIST: "a file or a broken link stands where a folder is needed",
    errno.ENOTDIR: "a file stands where a folder is needed",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.EMFILE: "too many files are open: raise the limit (ulimit -n), or use fewer processes",
}
_NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG}  # only writing meets these


def unwritable(path: Path | str, error: OSError, where: str = "file") -> InputError:
    """The error for `path`, which could not be written."""
    above = error.filename and Path(error.filename) in Path(path).parents  # not the temporary file's name
    place = f" at {error.filename}" if above else ""
    return InputError(path, [Fault(where, f"cannot be written{place}: {explained(error)}")])


def read_toml(path: Path | str) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError with the line of a syntax error, and for what no file may hold (`file_limits`)."""
    text = read_text(path)
    if fault := unreadable_toml(text):
        raise InputError(path, [fault])
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        what = f"{error}; see https://toml.io for the notation"
        if Path(path).suffix.lower() != ".toml":
            what = f"{error}: it is no TOML, as devices and recordings are; what a file of measurements holds tells ctrlgen look"
        raise InputError(path, [Fault("syntax", what)]) from None
    except ValueError:  # of Python: more than 4300 digits
        raise InputError(path, [Fault("syntax", "has a whole number of thousands of digits; correct it")]) from None
    except RecursionError:
        raise InputError(path, [Fault("syntax", TOO_DEEP)]) from None
    if faults := foreign_parts(table):
        raise InputError(path, faults)
    return table


def validate(model: type[Model], table: dict[str, Any], path: Path | str) -> Model:
    """`table` as a `model`. Raises InputError listing every fault with its dotted key and a remedy."""
    if faults := foreign_parts(table):
        raise InputError(path, faults)
    try:
        return model.model_validate(table)
    except ValidationError as error:
        errors = _of_nearest_branches(model, error.errors())
        wrong = [details["loc"] for details in errors]
        told = [
            details
            for details in errors
            if details["type"] != "too_short" or not any(_inside(other, details["loc"]) for other in wrong)
        ]
        raise InputError(path, _with_all_units(model, told)) from None


def _with_all_units(model: type[BaseModel], errors: Sequence[Any]) -> list[Fault]:
    """The faults that pydantic tells, those of one number that may be of several dimensions as one that names a unit of each."""
    faults: list[Fault] = []
    numbers: dict[tuple[str, str], int] = {}  # where each is, and what is said of it: its place among the faults
    units = [details.get("ctx", {}).get("error") for details in errors]
    of_another_kind = {
        _place(model, details["loc"])
        for details, unit in zip(errors, units, strict=True)
        if isinstance(unit, ValueError) and not isinstance(unit, WrongUnit)
    }  # faults of numbers whose unit is right for one of the dimensions
    for details, unit in zip(errors, units, strict=True):
        if isinstance(unit, WrongUnit):
            if _place(model, details["loc"]) in of_another_kind:
                continue
            k = numbers.setdefault((_place(model, details["loc"]), unit.said), len(faults))
            if k < len(faults):
                faults[k] = Fault(faults[k].where, f"{faults[k].what}, or {unit.instead}")
                continue
        faults += [fault for fault in _faults(model, details) if fault not in faults]
    return faults


def _inside(place: Sequence[Any], outer: Sequence[Any]) -> bool:
    """Whether a fault is of a part of what another one is of: pydantic does not count the entries of a list that are wrong."""
    return len(place) > len(outer) and tuple(place[: len(outer)]) == tuple(outer)


def _faults(model: type[BaseModel], details: Any) -> list[Fault]:
    """What pydantic tells at one place, where a validator may have found several faults."""
    found = details.get("ctx", {}).get("error")
    if not isinstance(found, TableFaults):
        return [_fault(model, details)]
    place = _place(model, details["loc"])
    return [Fault(f"{place}.{fault.where}" if place else fault.where, fault.what) for fault in found.faults]


BRANCHES = ("function-before[", "function-after[", "literal[", "tuple[")  # how pydantic names branches of a union


def _of_nearest_branches(model: type[BaseModel], errors: Sequence[Any]) -> list[Any]:
    """The faults without those of branches of a union that a value was never meant for: it is of another type than they are, and another
    branch says more of it, or of a part of it."""
    places = [tuple(_location(model, details["loc"])) for details in errors]
    kept = []
    for k, (details, place) in enumerate(zip(errors, places, strict=True)):
        branch = any(str(part).startswith(BRANCHES) for part in details["loc"])
        others = [(other, at) for j, (other, at) in enumerate(zip(errors, places, strict=True)) if j != k]
        said = [other for other, at in others if at == place and not other["type"].endswith("_type")]
        if branch and (any(_inside(at, place) for _, at in others) or (details["type"].endswith("_type") and said)):
            continue
        kept.append(details)
    return kept


def _location(model: type[BaseModel], loc: Sequence[Any]) -> list[Any]:
    """Keys and numbers of entries on the way to a place, without the names of the branches of unions."""
    tags = {"one number", "two numbers", *_tags(model)}
    return [part for k, part in enumerate(loc) if not (k > 0 and part in tags) and not str(part).startswith(BRANCHES)]


def _place(model: type[BaseModel], loc: Sequence[Any]) -> str:
    """A place as a dotted key."""
    where = ""
    for part in _location(model, loc):
        where += f"[{part}]" if isinstance(part, int) else (f".{part}" if where else str(part))
    return where


def _fault(model: type[BaseModel], details: Any) -> Fault:
    location, where = _location(model, details["loc"]), _place(model, details["loc"])
    message = str(details["msg"]).removeprefix("Value error, ")
    if details["type"] == "missing":
        message = "is missing; add it"
    elif details["type"] == "extra_forbidden":
        siblings = _keys(model, details["loc"][:-1])
        message = f"is not a key I know; {meant(str(location[-1]), siblings, 'known here: ' + ', '.join(siblings))}"
    elif details["type"] in _REMEDY:
        message = f"{reprlib.repr(details['input'])}: {_REMEDY[details['type']]}"
    elif details["type"] in ("too_short", "too_long"):
        many, least, most = (details["ctx"].get(key) for key in ("actual_length", "min_length", "max_length"))
        message = (
            f"has {many} entries; give {least} or more" if most is None else f"has {many} entries; give {most} or fewer"
        )
    elif details["type"] == "literal_error":
        known = str(details["ctx"]["expected"])
        near = difflib.get_close_matches(str(details["input"]), re.findall("'([^']*)'", known), n=1)
        left_out = f"; leave {location[-1]} out where none is meant" if _may_be_left_out(model, location) else ""
        hint = f"; did you mean {near[0]!r}?" if near else left_out
        message = f"{reprlib.repr(details['input'])} must be {known}{hint}"
    elif details["type"] == "union_tag_invalid":
        where = f"{where}.kind" if where else "kind"
        message = f"{reprlib.repr(details['input']['kind'])} is not one I know; write {details['ctx']['expected_tags']}"
    elif details["type"] == "union_tag_not_found":
        message = 'has no kind; add kind = "..."'
    return Fault(where or "file", message)


_REMEDY = {
    "tuple_type": "write a list, such as [..., ...]",
    "string_type": 'write a text in quotes, such as "..."',
    "int_type": "write a whole number",
    "int_parsing": "write a whole number",
    "float_type": "write a number without a unit",
    "float_parsing": "write a number without a unit",
    "finite_number": "write a finite number",
    "bool_type": "write true or false",
    "bool_parsing": "write true or false",
    "model_attributes_type": "write a table, such as { ... } or [section]",
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


def _may_be_left_out(model: type[BaseModel], location: Sequence[Any]) -> bool:
    """Whether the value at `location` stands for nothing where it is left out: the key of a table without a default."""
    tables = _tables(model, location[:-1])
    return any(m.model_fields[location[-1]].default is None for m in tables if location[-1] in m.model_fields)


def _keys(model: type[BaseModel], location: Sequence[Any]) -> list[str]:
    """What may stand in the table at `location`, a path of keys, indices and kinds."""
    tables = _tables(model, location)
    return list(dict.fromkeys(field.alias or key for m in tables for key, field in m.model_fields.items()))


def _tables(model: type[BaseModel], location: Sequence[Any]) -> list[type[BaseModel]]:
    """The tables that may stand at `location`."""
    models = [model]
    for part in location:
        fields = [m.model_fields[part] for m in models if part in m.model_fields]
        if fields:
            models = [member for field in fields for member in _models(field.annotation)]
        else:
            models = [m for m in models if part in _kinds(m)] or models
    return models


def read_bytes(path: Path) -> bytes:
    """The content of a file that was read already, and so is no larger than its reader takes. Raises InputError."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(path, [Fault("file", f"cannot be read: {explained(error)}")]) from None


def decoded(content: bytes) -> str:
    """Any bytes as text, those that are no UTF-8 as lone surrogates (PEP 383); `encoded` gives them back."""
    return content.decode(errors="surrogateescape")


def encoded(text: str) -> bytes:
    """`text` as UTF-8, the lone surrogates of `decoded` as the bytes that they were."""
    return text.encode(errors="surrogateescape")


def write_text(path: Path, text: str) -> None:
    """Write `text` as UTF-8 (`encoded`), whole or not at all."""
    write_bytes(path, encoded(text))


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` whole or not at all (`whole_file`). Raises InputError."""
    with whole_file(path) as draft, draft.open("xb") as file:
        file.write(content)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A file that appears at `path` only when the block ends without an error.

    Yields the name of a temporary file beside `path` that the block is to write; on success it takes the place of `path`,
    on an error or Ctrl-C it is removed and `path` is left as it was. Raises InputError when `path` cannot be written.
    """
    draft = _draft(path)  # named before it is made: whatever stops the block, its name is known to what removes it
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield draft
        os.chmod(draft, 0o644)
        os.replace(draft, path)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _draft(path: Path) -> Path:
    """A name beside `path` that no other process takes."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}")


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """A folder that appears at `out` only when the block ends without an error.

    Yields a temporary folder beside `out`; on success it replaces `out`, which must be absent, empty, or an
    earlier result and nothing else (`.ctrlgen` lists what was made). On an error or Ctrl-C `out` is left as it was.
    Raises InputError when `out` cannot be written or holds somebody else's files.
    """
    out = check_folder(out)
    draft = _draft(out)
    retired = draft.with_name(draft.name + ".old")
    try:
        _make_draft(draft, out)
        yield draft
        (draft / STEPS).unlink(missing_ok=True)
        made = sorted(str(path.relative_to(draft)) for path in draft.rglob("*") if path.is_file())
        (draft / MARKER).write_text("\n".join(made) + "\n", encoding="utf-8")
        draft.chmod(0o755)
        if out.exists():
            os.replace(out, retired)
        os.replace(draft, out)
    except BaseException as error:
        if retired.exists() and not out.exists():
            os.replace(retired, out)
        shutil.rmtree(draft, ignore_errors=True)
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            raise unwritable(out, error, "--out") from None
        raise
    finally:
        shutil.rmtree(retired, ignore_errors=True)


def _make_draft(draft: Path, out: Path) -> None:
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        draft.mkdir(mode=0o700)
    except OSError as error:
        raise unwritable(out, error, "--out") from None


def check_folder(out: Path) -> Path:
    """The folder `out` without links, which `whole_folder` may replace: to be asked before long work. Raises InputError."""
    try:
        out = Path(os.path.realpath(out))
        if out.is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(out))
        if above := [path for path in out.parents if path.is_file()]:
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(above[0]))
        if out.exists() and not out.is_dir():
            raise InputError(out, [Fault("--out", "is a file; name a folder")])
        if foreign := _foreign(out):
            what = f"holds {foreign[0]}, which ctrlgen did not make; move it away, or name an empty or new folder"
            raise InputError(out, [Fault("--out", what)])
    except OSError as error:
        raise unwritable(out, error, "--out") from None
    return out


def _foreign(out: Path) -> list[str]:
    """Files in `out` that an earlier run did not list as its own."""
    if not out.is_dir():
        return []
    marker = out / MARKER
    made = {MARKER, *read_text(marker).splitlines()} if marker.exists() else set()
    return sorted(
        name for path in out.rglob("*") if path.is_file() and (name := str(path.relative_to(out))) not in made
    )


MARKER = ".ctrlgen"
