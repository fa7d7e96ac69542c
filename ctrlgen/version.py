"""Which ctrlgen this is: its version, the commit of its source, and a digest of the source itself."""

from __future__ import annotations

import hashlib
import subprocess
from functools import cache
from pathlib import Path

__version__ = "0.1.0"

PACKAGE = Path(__file__).resolve().parent
BUILT_FROM = "_commit.txt"  # in a wheel: written when it is built (hatch_build.py)


def commit_of(checkout: Path) -> str:
    """The commit of a checkout, with -dirty where files differ from it; empty where git or the checkout is missing."""
    if not (checkout / ".git").exists():
        return ""
    words = ["git", "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


@cache
def commit() -> str:
    """The commit that this package was built from or is a checkout of; empty where nothing tells it."""
    built_from = PACKAGE / BUILT_FROM
    return built_from.read_text(encoding="utf-8").strip() if built_from.is_file() else commit_of(PACKAGE.parent)


def program() -> str:
    """'ctrlgen 0.1.0 (commit 5807f10abcde)', as --version and everything generated say it."""
    return f"ctrlgen {__version__}" + (f" (commit {commit()})" if commit() else "")


@cache
def code_hash(package: Path = PACKAGE) -> str:
    """SHA-256 of the package's Python files and their names: what a kept result was made by, whatever its version."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(package).as_posix()}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()
