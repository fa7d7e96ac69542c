"""codegen/limiter is C as it stands: what the generator makes of it is what a compiler's preprocessor does."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import ROOT, SCENARIOS
from three_stacks import circle, loaded, stage

from ctrlgen import build_model, load_device, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.preprocessor import Macro, resolved
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.online.online import online_context

LIMITER = ROOT / "codegen" / "limiter"
DEVICES = ("hexapod in balance", "axis with inertia", "redundant stage", "constants of the start")


def written(name: str, real: Real, folder: Path) -> None:
    """`limiter.h`, `generated.c` and `limiter_config.h` of a device, its controller named limiter."""
    if name == "redundant stage":
        scenario, model = loaded(folder, stage(drive_rate={"a": "5 V/ms"}), circle(20))
    else:
        scenario = load_scenario(SCENARIOS / ("flexure_axis_line" if name == "axis with inertia" else "circle20"))
        if name == "constants of the start":
            scenario = replace(scenario, device=load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml"))
        model = build_model(scenario.device)
    controller = controller_of(model, scenario.file.follow, scenario.sample_time)
    context = online_context(scenario, controller, real, "limiter")
    write("online.h", context, folder / "limiter.h")
    write("online.c", context, folder / "generated.c")
    write("limiter_config.h", context, folder / "limiter_config.h")


def tokens(source: Path, folder: Path) -> list[str]:
    words = ["gcc", "-std=c99", "-E", "-P", f"-I{folder}", str(source)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return re.findall(r"\w+|[^\w\s]", done.stdout)


@pytest.mark.parametrize("name", DEVICES)
def test_the_generated_limiter_is_the_limiter_with_the_configuration_of_the_device(name, tmp_path):
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: its preprocessor was not compared")
    for real in Real if name == DEVICES[0] else (Real.FLOAT,):
        written(name, real, tmp_path)
        assert tokens(tmp_path / "generated.c", tmp_path) == tokens(LIMITER / "limiter.c", tmp_path)


@pytest.mark.parametrize("name", DEVICES)
def test_the_limiter_compiles_as_it_stands_without_a_warning(name, compiler, tmp_path):
    written(name, Real.DOUBLE, tmp_path)
    words = [compiler, *FLAGS, f"-I{tmp_path}", "-c", str(LIMITER / "limiter.c"), "-o", str(tmp_path / "limiter.o")]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("A && !B", True),
        ("A && B", False),
        ("B || N > 2", True),
        ("defined(A) && !defined(C)", True),
        ("C", False),
        ("N != 3", False),
        ("!(A && N == 3)", False),
    ],
)
def test_a_condition_is_what_it_is_in_c(condition, holds):
    macros = {"A": Macro("1"), "B": Macro("0"), "N": Macro("3")}
    assert resolved(f"#if {condition}\nyes\n#else\nno\n#endif", macros, {}.get) == ("yes" if holds else "no")


def test_comments_stay_and_nothing_in_them_is_replaced():
    text = "/* N\n * axes */\nx[N] = M(N); /* N */\n#if 0\n/* gone */\n#elif N\nkept;\n#endif"
    macros = {"N": Macro("3"), "M": Macro("m(k, N)", ("k",))}
    assert resolved(text, macros, {}.get) == "/* N\n * axes */\nx[3] = m(3, 3); /* N */\nkept;"


def test_a_macro_of_several_lines_is_indented_as_the_line_that_it_stands_on():
    macros = {"EACH": Macro("F(0)\nF(1)", ("F",))}
    text = "#define COPY(k) a[k] = b[k];\n    EACH(COPY)\n#undef COPY\nCOPY(1)"
    assert resolved(text, macros, {}.get) == "    a[0] = b[0];\n    a[1] = b[1];\nCOPY(1)"


def test_what_is_open_or_unknown_is_refused():
    for text in ("#if 1\nx", "#warning x"):
        with pytest.raises(ValueError):
            resolved(text, {}, {}.get)
