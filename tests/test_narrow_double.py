"""Where a double has no 53 bits, as on AVR, the C in double is left out of a build, and a program that asks for it is told so."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, generate, load_scenario
from ctrlgen.firmware.c.real import Real

NARROW = ["-U__DBL_MANT_DIG__", "-D__DBL_MANT_DIG__=24"]  # as avr-gcc has it
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-c", "-o"]


def test_a_library_whose_double_is_a_float_builds_without_the_c_in_double(tmp_path):
    """Arduino compiles every source of a library: what would be wrong has nothing in it, and its header is refused."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: nothing was built with a narrow double")
    scenario = load_scenario(SCENARIOS / "flexure_axis_line")
    scenario = replace(scenario, file=scenario.file.model_copy(update={"checksum": True}))
    made = generate(scenario, build_model(scenario.device), tmp_path)
    sources = sorted(tmp_path.glob(f"*{Real.DOUBLE.suffix}.c"))
    assert len(sources) >= 4
    subprocess.run(["gcc", *NARROW, *STRICT, "narrow.o", f"{made.online[Real.FLOAT]}.c"], cwd=tmp_path, check=True)
    for source in sources:
        subprocess.run(["gcc", *NARROW, *STRICT, "narrow.o", source], cwd=tmp_path, check=True)
        assert subprocess.run(["nm", "narrow.o"], cwd=tmp_path, capture_output=True, check=True).stdout.strip() == b""
        (tmp_path / "asks.c").write_text(f'#include "{source.stem}.h"\n')
        refused = subprocess.run(["gcc", *NARROW, *STRICT, "asks.o", "asks.c"], cwd=tmp_path, capture_output=True)
        assert b"take the controller of the suffix _f32" in refused.stderr, source.name
