"""The C that the documentation shows fits the C that is generated."""

from __future__ import annotations

import re

from conftest import ROOT
from package_programs import STRICT, run

from ctrlgen.firmware.c.templates import ABI

GOLDEN = ROOT / "codegen" / "golden" / "mems_hexapod"
HEADER = "mems_hexapod_online_f32"
PAGE = ROOT / "docs" / "howto" / "c_in_firmware.md"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


def test_every_number_of_the_interface_that_a_page_pins_is_todays():
    pinned = {
        (page.name, number) for page in PAGES for number in re.findall(r"_ABI\b\W+?(\d+)U?\b", page.read_text("utf-8"))
    }
    assert (PAGE.name, str(ABI)) in pinned and {number for _, number in pinned} == {str(ABI)}


def test_the_snippets_of_the_page_compile_with_the_header_that_is_generated(compiler, tmp_path):
    """Those that include it, and the others that call it, in a function that has `state` and `out`."""
    snippets = [x for x in re.findall(r"```c\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL) if "_Q31_" not in x]
    assert len(snippets) == 2
    for k, text in enumerate(snippets):
        if "#include" not in text:
            head = f'#include "{HEADER}.h"\nvoid call({HEADER}_state state, {HEADER}_output out);\n'
            body = f"void call({HEADER}_state state, {HEADER}_output out)\n{{\n{text}(void)status;\n}}\n"
            text = head + body
        (tmp_path / f"snippet_{k}.c").write_text(text)
        run(compiler, "-std=c11", *STRICT, f"-I{GOLDEN}", "-c", tmp_path / f"snippet_{k}.c", "-o", tmp_path / "o.o")
