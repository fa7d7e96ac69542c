"""Every name of a generated source begins with that of the source: any number of them are one translation unit, or one archive."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import SCENARIOS
from package_programs import STRICT, run

from ctrlgen import CtrlgenError, build_model, generate, load_scenario
from ctrlgen.firmware.c.file_scope import prefixed


def test_names_of_file_scope_get_the_prefix_and_nothing_else_does():
    text = (
        "#define HIGH (1)\nstatic const float LOW[2] = { 0 }; /* LOW, count */\nstatic int count(const state *s, int high)\n{\n"
        "    static const int ROW[1] = { HIGH };\n    return s->count + s.count + own_x(count) + HIGHER + ROW[LOW];\n}\n"
        '#error "HIGH"\nint own_x(int);\nstatic int own_y(void);\n'
    )
    assert prefixed(text, "own", "int own_lows(void);") == (
        "#define OWN_HIGH (1)\nstatic const float OWN_LOW[2] = { 0 }; /* LOW, count */\nstatic int own_count(const state *s, int high)\n{\n"
        "    static const int ROW[1] = { OWN_HIGH };\n    return s->count + s.count + own_x(own_count) + HIGHER + ROW[OWN_LOW];\n}\n"
        '#error "HIGH"\nint own_x(int);\nstatic int own_y(void);\n'
    )
    # a name that the header has already
    assert prefixed("#define RATE (1)\n", "own", "#define OWN_RATE (2U)") == "#define OWN_RATE_OWN (1)\n"


def one_of_each(folders: list[Path]) -> list[Path]:
    """The sources of all folders, of equal ones the first. Two of one name that differ fail."""
    sources: dict[str, Path] = {}
    for path in (path for folder in folders for path in sorted(folder.glob("*.c"))):
        first = sources.setdefault(path.name, path)
        assert first.read_bytes() == path.read_bytes(), (first, path)
    return list(sources.values())


def unity(compiler: str, folders: list[Path], scratch: Path) -> None:
    """Compiles all sources as one."""
    (scratch / "all.c").write_text("".join(f'#include "{path}"\n' for path in one_of_each(folders)))
    include = [f"-I{folder}" for folder in folders]
    run(compiler, "-std=c99", *STRICT, *include, "-c", scratch / "all.c", "-o", scratch / "all.o")


@pytest.mark.long
def test_two_packages_are_one_translation_unit(packages, compiler, tmp_path):
    unity(compiler, [c.path for c in packages.values()], tmp_path)


@pytest.mark.long
def test_all_shipped_scenarios_are_one_translation_unit_and_one_archive(compiler, tmp_path):
    folders, refused = [], []
    for file in sorted(SCENARIOS.glob("*/scenario.toml")):
        scenario = load_scenario(file)
        try:
            folders.append(generate(scenario, build_model(scenario.device), tmp_path / scenario.name).path)
        except CtrlgenError as error:
            refused.append(str(error))
    # a robust one is generated from its solution, whose limits its device is built for
    assert len(folders) > 12 and all("tightened limits" in words for words in refused), refused
    unity(compiler, folders, tmp_path)
    objects = []
    for path in one_of_each(folders):
        objects.append(tmp_path / f"{path.stem}.o")
        run(compiler, "-std=c99", "-O0", f"-I{path.parent}", "-c", path, "-o", objects[-1])
    run("ar", "rcs", tmp_path / "liball.a", *objects)
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    whole = ["-Wl,--whole-archive", tmp_path / "liball.a", "-Wl,--no-whole-archive"]
    run(compiler, tmp_path / "main.c", *whole, "-lm", "-o", tmp_path / "firmware")
