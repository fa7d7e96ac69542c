"""README and tutorial show what the program prints."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from conftest import ROOT

import ctrlgen

README = (ROOT / "README.md").read_text(encoding="utf-8")
FIRMWARE = (ROOT / "docs" / "tutorial" / "first_firmware.md").read_text(encoding="utf-8")
ROUNDING = re.compile(r"\d(\.\d+)?e-\d+( (rad|nm|W))?|0\.0\d* nm|0\.00\d+ nm")


def block(language: str, page: str = README) -> str:
    return re.search(rf"```{language}\n(.*?)```", page, re.DOTALL)[1]


def same(text: str) -> list[str]:
    """Lines with the sizes of rounding errors masked, which differ between machines, and spacing folded."""
    return [re.sub(r"\s+", " ", ROUNDING.sub("~", line)).strip() for line in text.strip().splitlines()]


@pytest.mark.long
def test_the_printed_output_is_the_programs(tmp_path, compiler):
    out = tmp_path / "circle20"
    done = subprocess.run(
        [sys.executable, "-m", "ctrlgen", "run", str(ROOT / "scenarios" / "circle20"), "--out", str(out)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    shown, printed = same(block("text", FIRMWARE)), same(done.stdout.replace(str(tmp_path), "out"))
    # Which compilers there are
    tools = re.compile(r"built strictly with [\w, ]+;|(not installed: not run)|\d+ of \d+ comparisons")
    assert [tools.sub("", line) for line in shown] == [tools.sub("", line) for line in printed if "not run" not in line]
    if "not run" not in done.stdout:
        (compared,) = re.findall(r"(\d+) of \d+ comparisons", done.stdout)
        assert (
            f" {compared} comparisons of the generated C" in README
            and f"{compared} of {compared} comparisons" in FIRMWARE
        )


def test_the_python_example_names_what_exists():
    for name in re.findall(r"ctrlgen\.(\w+)\(", block("python")):
        assert hasattr(ctrlgen, name), name


def test_every_path_in_the_readme_and_the_documentation_exists():
    named = (ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"))
    pages = [path.read_text(encoding="utf-8") for path in (*named, *(ROOT / "docs").glob("*.md"))]
    for path in re.findall(
        r"`((?:ctrlgen|codegen|tests|scenarios|benchmarks|battery|docs)/[\w/.*]+)`", "\n".join(pages)
    ):
        assert list(ROOT.glob(path)), path


def test_every_link_of_the_readme_exists():
    for path in re.findall(r"\]\(([\w/.]+)\)", README):
        assert (ROOT / path).exists(), path


def test_every_package_stands_in_the_architecture():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    for path in (ROOT / "ctrlgen").rglob("__init__.py"):
        name = path.parent.relative_to(ROOT / "ctrlgen").as_posix().replace("/", ".")
        if (name.count(".") == 0 and name != "") or name.startswith("diagnosis."):
            assert f"`{name}`" in page, name


def test_what_contributing_tells_of_a_law_is_there():
    text, effects = (ROOT / "CONTRIBUTING.md").read_text(), (ROOT / "ctrlgen" / "effects" / "_effect.py").read_text()
    files = ("planted_axis", "planted_poses", "recovery", "test_recovery")
    recovery = "".join((ROOT / "tests" / f"{name}.py").read_text() for name in files)
    (shown,) = re.findall(r"```python\n(def .*?)\n *y = ", text, re.DOTALL)
    assert shown.partition("(")[0] in recovery
    for word in ("ON_AXIS", "ON_HEXAPOD", "within", "def test_no_law_is_left_out"):
        assert word in recovery and word.removeprefix("def ") in text, word
    for word in ("place", "source", "params", "states", "active"):
        assert f"`{word}`" in text and f"    {word}: ClassVar" in effects, word


def test_the_two_commands_are_targets_of_the_makefile():
    makefile = (ROOT / "Makefile").read_text()
    assert "make run" in block("console") and re.search(r"^run:", makefile, re.MULTILINE)
    assert "make test" in block("console") and re.search(r"^test:", makefile, re.MULTILINE)
