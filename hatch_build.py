"""Records the commit in what is built: a wheel has no git that could be asked. Used by pyproject.toml."""

from __future__ import annotations

import runpy
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CommitHook(BuildHookInterface):
    """Puts ctrlgen/_commit.txt into wheel and source distribution; an editable install asks git itself."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before the files are collected."""
        source = runpy.run_path(str(Path(self.root) / "ctrlgen" / "version.py"))
        commit = source["commit_of"](Path(self.root))
        if version != "editable" and commit:
            self.folder = tempfile.TemporaryDirectory()
            written = Path(self.folder.name) / source["BUILT_FROM"]
            written.write_text(commit + "\n", encoding="utf-8")
            build_data["force_include"][str(written)] = f"ctrlgen/{written.name}"
