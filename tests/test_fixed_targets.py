"""Targets of the controller in integers, made of floats: every bit pattern of a float is the nearest counts or is refused."""

from __future__ import annotations

import ctypes
import subprocess
from fractions import Fraction
from math import floor

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import ControllerStatus, build_model, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.online.fixed_source import fixed_context

NAMES = {"online": "stage_q31", "selftest": "stage_selftest_q31", "vectors": "stage_vectors_q31"}
INPUT = int(ControllerStatus.INPUT)
OPTIONS = ("-O0", "-O3", "-Os", "-Ofast", "-funsigned-char", "-fshort-enums", "-flto", "-fsanitize=undefined")


@pytest.fixture(scope="module")
def context():
    scenario = load_scenario(SCENARIOS / "circle20")
    model = build_model(scenario.device)
    controller = controller_of(model, scenario.file.follow, scenario.sample_time)
    return fixed_context(scenario, controller, scenario.bind(model).targets, NAMES)


@pytest.fixture(scope="module")
def sources(context, tmp_path_factory):
    folder = tmp_path_factory.mktemp("q31")
    for template, name in (("fixed", "online"), ("fixed_selftest", "selftest"), ("fixed_vectors", "vectors")):
        for kind in "hc":
            write(f"{template}.{kind}", context, folder / f"{NAMES[name]}.{kind}")
    return folder


def counted(value, bits):
    """The nearest counts, halves away from zero, in rational numbers; None beyond 32 bits, and of what is no number."""
    if not np.isfinite(value):
        return None
    size = floor(abs(Fraction(float(value))) * 2 ** int(bits) + Fraction(1, 2))
    return None if size >= 2**31 else size if value > 0 else -size


def patterns(rng, bits, n):
    """Floats of any bits, and as many of magnitudes around one count and around the largest."""
    with np.errstate(invalid="ignore"):
        any_ = rng.integers(0, 2**32, n, dtype=np.uint64).astype(np.uint32).view(np.float32)
    near = rng.choice([-1, 1], n) * 2.0 ** (rng.uniform(-3, 33, n) - bits)
    return np.concatenate([any_, near.astype(np.float32), np.float32([0.0, -0.0, np.nan, np.inf, -np.inf])])


def test_any_float_is_the_nearest_counts_or_is_refused_with_the_target_as_it_was(context, sources, compiler):
    library = sources / "q31.so"
    words = [compiler, *FLAGS, "-shared", "-fPIC", "-o", library, sources / "stage_q31.c"]
    subprocess.run(list(map(str, words)), check=True)
    convert, m = ctypes.CDLL(str(library)).stage_q31_target, context["m"]
    rng, taken, refused = np.random.default_rng(2), 0, 0
    for k, bits in enumerate(context["target_bits"]):
        for value in patterns(rng, bits, 2_000):
            number = rng.uniform(-1e-5, 1e-5, m).astype(np.float32)
            number[k] = value
            wanted = [counted(v, b) for v, b in zip(number, context["target_bits"], strict=True)]
            before = rng.integers(-9, 9, m).astype(np.int32)
            target = before.copy()
            status = convert(number.ctypes, target.ctypes)
            if None in wanted:
                refused += 1
                assert (status, target.tolist()) == (INPUT, before.tolist()), value
            else:
                taken += 1
                assert (status, target.tolist()) == (0, wanted), value
    assert taken > 5_000 and refused > 2_000


@pytest.mark.parametrize("wrong", [1e3, 1e6, 1e9], ids=["mm for m", "um for m", "nm for m"])
def test_a_pose_in_a_wrong_unit_is_refused(context, sources, compiler, wrong, tmp_path):
    """Each axis by itself: 10 um and 10 mrad of it; a conversion that wraps around finds poses in range instead."""
    library = tmp_path / "q31.so"
    words = [compiler, *FLAGS, "-shared", "-fPIC", "-o", library, sources / "stage_q31.c"]
    subprocess.run(list(map(str, words)), check=True)
    convert = ctypes.CDLL(str(library)).stage_q31_target
    for k, channel in enumerate(context["follow"].channels):
        number = np.zeros(context["m"], dtype=np.float32)
        number[k] = 1e-5 if channel.startswith("delta") else 1e-2
        target = np.zeros(context["m"], dtype=np.int32)
        assert convert(number.ctypes, target.ctypes) == 0 and target[k] != 0
        number[k] *= wrong
        assert convert(number.ctypes, target.ctypes) == INPUT, channel


@pytest.mark.parametrize("option", OPTIONS)
def test_no_option_of_a_compiler_changes_it(context, sources, compiler, option, tmp_path):
    """It computes with integers alone: the self test, which converts floats at every edge, passes with each."""
    (tmp_path / "main.c").write_text(
        '#include "stage_selftest_q31.h"\n'
        "int main(void)\n{\n    stage_selftest_q31_result r;\n"
        f"    const int wrong = stage_selftest_q31(&r);\n    return (wrong != 0) || (r.compared != {context['calls']});\n}}\n"
    )
    program = tmp_path / "main"
    names = [sources / f"{name}.c" for name in NAMES.values()]
    words = [compiler, "-std=c99", option, f"-I{sources}", tmp_path / "main.c", *names, "-o", program]
    built = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if built.returncode != 0:
        pytest.skip(f"{compiler} does not build with {option} here")
    subprocess.run([str(program)], check=True)
