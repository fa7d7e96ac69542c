"""Templates of pages, C and new files, compiled once: what jinja2 makes of a template is kept in the user's cache folder.

Compiling the templates of one scenario takes as long as solving its path. No folder, or one that cannot be written, is no error.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import jinja2
from jinja2.bccache import Bucket

DIGEST = hashlib.sha256().digest_size


def cache_folder() -> Path | None:
    """The folder of what can be made again: $XDG_CACHE_HOME/ctrlgen, or ~/.cache/ctrlgen; None for a user without a home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "ctrlgen"
    except RuntimeError:  # as in a container with a number for a user
        return None


def environment(folders: Path | Sequence[Path], **options: Any) -> jinja2.Environment:
    """Where the templates of the `folders` are read with jinja2's `options`; a name that a template does not get is an error."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(folders),
        undefined=jinja2.StrictUndefined,
        bytecode_cache=_Cache(options),
        **options,
    )


class _Cache(jinja2.BytecodeCache):
    """Compiled templates by the content of the template, the options and jinja2's version; jinja2 itself looks at the content alone.

    A file begins with the SHA-256 of the rest, so that nothing damaged or foreign is read as code.
    """

    def __init__(self, options: dict[str, Any]) -> None:
        self._made_with = f"{jinja2.__version__} {sorted(options.items())!r}"

    def get_source_checksum(self, source: str) -> str:
        """Of all that the compiled template depends on."""
        return hashlib.sha256(f"{self._made_with}\0{source}".encode()).hexdigest()

    def load_bytecode(self, bucket: Bucket) -> None:
        """Fills `bucket` where there is a whole file; jinja2 leaves it empty where that is of another checksum."""
        path, kept = self._path(bucket), b""
        with suppress(OSError):
            kept = b"" if path is None else path.read_bytes()
        digest, code = kept[:DIGEST], kept[DIGEST:]
        if hashlib.sha256(code).digest() == digest:
            bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Writes a file that appears as a whole or not at all."""
        path, code = self._path(bucket), bucket.bytecode_to_string()
        if path is None:
            return
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=path.parent) as folder:
                written = Path(folder, path.name)
                written.write_bytes(hashlib.sha256(code).digest() + code)
                written.replace(path)

    def _path(self, bucket: Bucket) -> Path | None:
        """The `key` is of the template's name and folder, so that a changed one takes the place of the one before."""
        folder = cache_folder()
        return None if folder is None else folder / "templates" / f"{bucket.key}.pyc"
