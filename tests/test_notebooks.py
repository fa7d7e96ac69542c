"""The notebooks of the documentation run from top to bottom, use public names alone, and are kept without results."""

from __future__ import annotations

import ast
import json
import os
import sys
from pathlib import Path

import pytest
from conftest import ROOT

import ctrlgen

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def cells(path: Path) -> list[dict]:
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def test_there_are_three():
    assert {path.stem for path in NOTEBOOKS} == {"mechanism_to_budget", "path_to_c", "recording_to_diagnosis"}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_results(path):
    code = [cell for cell in cells(path) if cell["cell_type"] == "code"]
    assert code and all(not cell["outputs"] and cell["execution_count"] is None for cell in code)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_uses_public_names_alone(path):
    lines = [
        line for cell in cells(path) if cell["cell_type"] == "code" for line in "".join(cell["source"]).split("\n")
    ]
    tree = ast.parse("\n".join(line for line in lines if not line.startswith("!")))
    used = {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute) and getattr(n.value, "id", "") == "ctrlgen"}
    imported = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert used and used <= set(ctrlgen.__all__)
    assert not {module for module in imported if module and module.startswith("ctrlgen")}


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_what_it_shows_is_short(path, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="notebooks are not run here: pip install '.[docs]'")
    nbformat = pytest.importorskip("nbformat")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()  # raises CellExecutionError with the cell and its traceback
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            assert len(output.get("data", {}).get("text/plain", "")) < 3000, cell.source
            assert "Traceback" not in output.get("text", ""), cell.source
            assert not (output.get("name") == "stderr" and "error" in output["text"].lower()), output["text"]
