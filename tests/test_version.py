"""Which ctrlgen made something: version and commit are told, and what is kept is known by the code that made it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import ctrlgen
from conftest import ROOT, SCENARIOS

from ctrlgen import __version__, build_model, generate, load_scenario, version
from ctrlgen.version import code_hash, commit, commit_of, program


@pytest.fixture
def checkout(tmp_path) -> Path:
    """A repository of one commit."""
    if not shutil.which("git"):
        pytest.skip("git is missing: no commit could be made to be told")
    (tmp_path / "file").write_text("as committed")
    for words in (("init", "-q"), ("add", "."), ("-c", "user.name=t", "-c", "user.email=t@t", "commit", "-qm", "one")):
        subprocess.run(["git", "-C", str(tmp_path), *words], check=True)
    return tmp_path


def test_the_commit_of_a_checkout_is_told_and_whether_files_differ_from_it(checkout):
    said = subprocess.run(["git", "-C", checkout, "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
    assert re.fullmatch(r"[0-9a-f]{12}", commit_of(checkout)) and said.stdout.startswith(commit_of(checkout))
    (checkout / "file").write_text("changed")
    assert commit_of(checkout) == f"{said.stdout[:12]}-dirty"


def test_without_git_there_is_the_version_alone(tmp_path, checkout, monkeypatch):
    (tmp_path / "plain").mkdir()
    assert commit_of(tmp_path / "plain") == ""  # a folder of a repository is no checkout of ctrlgen
    monkeypatch.setenv("PATH", str(tmp_path / "plain"))
    assert commit_of(checkout) == ""
    monkeypatch.setattr(version, "commit", lambda: "")
    assert program() == f"ctrlgen {__version__}"


def test_version_and_commit_are_printed():
    done = ctrlgen("--version")
    assert done.returncode == 0 and done.stdout.strip() == program()
    if (ROOT / ".git").exists() and shutil.which("git"):
        assert re.fullmatch(rf"ctrlgen {re.escape(__version__)} \(commit [0-9a-f]{{12}}(-dirty)?\)", program())


def test_the_version_stands_in_one_place():
    """Where a file of ours needs it, it reads it."""
    told = [
        path.relative_to(ROOT).as_posix()
        for folder in ("ctrlgen", "codegen/templates")
        for path in (ROOT / folder).rglob("*.*")
        if path.suffix in (".py", ".j2") and __version__ in path.read_text()
    ]
    assert told == ["ctrlgen/version.py"]
    assert __version__ not in (ROOT / "pyproject.toml").read_text()


def test_what_is_generated_says_which_program_made_it(tmp_path):
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    made = generate(scenario, build_model(scenario.device), tmp_path)
    sources = [path for path in made.path.glob("*.[ch]")]
    assert sources and all(program() in path.read_text() for path in sources)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert (manifest["ctrlgen"], manifest["commit"]) == (__version__, commit())


def test_the_hash_of_the_code_changes_with_its_code_and_with_nothing_else(tmp_path):
    package = tmp_path / "ctrlgen"
    shutil.copytree(ROOT / "ctrlgen", package, ignore=shutil.ignore_patterns("__pycache__"))
    first = code_hash()
    assert code_hash(package) == first  # wherever it is installed

    def now() -> str:
        code_hash.cache_clear()
        return code_hash(package)

    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "a.cpython-311.pyc").write_bytes(b"compiled")
    assert now() == first
    module = package / "effects" / "creep.py"
    text = module.read_text()
    module.write_text(text + "\n")
    assert now() != first
    module.write_text(text)
    assert now() == first
    module.rename(module.with_name("crept.py"))
    assert now() != first
