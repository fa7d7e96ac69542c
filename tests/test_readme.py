"""The README shows what the program prints."""

from __future__ import annotations

import re
import subprocess
import sys

from conftest import ROOT

import ctrlgen

README = (ROOT / "README.md").read_text()
ROUNDING = re.compile(r"\d(\.\d+)?e-\d+( (rad|nm|W))?|0\.0\d* nm|0\.00\d+ nm")


def block(language: str) -> str:
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)[1]


def same(text: str) -> list[str]:
    """Lines with the sizes of rounding errors masked, which differ between machines, and spacing folded."""
    return [re.sub(r"\s+", " ", ROUNDING.sub("~", line)).strip() for line in text.strip().splitlines()]


def test_the_printed_output_is_the_programs(tmp_path, compiler):
    out = tmp_path / "circle20"
    done = subprocess.run(
        [sys.executable, "-m", "ctrlgen", "run", str(ROOT / "scenarios" / "circle20"), "--out", str(out)],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    shown, printed = same(block("text")), same(done.stdout.replace(str(out), "out/circle20"))
    tools = re.compile(
        r"built strictly with [\w, ]+;|(not installed: not run)|\d+ of \d+ comparisons"
    )  # which compilers there are
    assert [tools.sub("", line) for line in shown] == [tools.sub("", line) for line in printed if "not run" not in line]


def test_the_python_example_names_what_exists():
    for name in re.findall(r"ctrlgen\.(\w+)\(", block("python")):
        assert hasattr(ctrlgen, name), name


def test_every_path_in_the_readme_exists():
    for path in re.findall(r"`((?:ctrlgen|codegen|tests|scenarios|benchmarks)/[\w/.*]+)`", README):
        assert list(ROOT.glob(path)), path


def test_every_module_stands_in_the_architecture():
    for path in (ROOT / "ctrlgen").glob("*.py"):
        if not path.stem.startswith("_"):
            assert f"`{path.stem}`" in README, path.stem


def test_the_two_commands_are_targets_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text()
    assert "make run" in block("console") and re.search(r"^run:", makefile, re.MULTILINE)
    assert "make test" in block("console") and re.search(r"^test:", makefile, re.MULTILINE)
