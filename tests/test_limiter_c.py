"""codegen/limiter is C as it stands: what the generator makes of it is what a compiler's preprocessor does."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from conftest import DEVICE, ROOT, SCENARIOS
from creeping_axis import CREEP
from inertial_stages import LINE, coil
from package_programs import build
from three_stacks import circle, loaded, stage

from ctrlgen import Controller, build_model, generate, load_device, load_scenario, user_device
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.devices.run_time import RunTime
from ctrlgen.firmware.c.preprocessor import Macro, resolved
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.online.online import online_context
from ctrlgen.trajectory.scenario import Scenario

LIMITER = ROOT / "codegen" / "limiter"
DEVICES = (
    "hexapod in balance",
    "axis with inertia",
    "redundant stage",
    "constants of the start",
    "hexapod that creeps",
    "axes that settle",
    "redundant stage that settles",
    "coil with inertia",
)
SETTLED = "points = 3\n"
# A stage so weak that no displacement in range needs a drive beyond its limits
WEAK = {"parameters": {"g": "0.2 N/V", "k": "0.01 N/um", "k3": "0 N/m^3"}}


def pushed(u, p):
    return [p.g * u.a, p.g * u.b]


def controlled(name: str, folder: Path) -> tuple[Scenario, Controller]:
    """A scenario of the device and its controller; files of its own are written to `folder`."""
    stages = {
        "redundant stage": (stage(drive_rate={"a": "5 V/ms"}), circle(20)),
        "axes that settle": (stage(**WEAK, drive={"a": "100 V", "b": "100 V"}, force=pushed), circle(20), SETTLED),
        "redundant stage that settles": (stage(**WEAK, drive=dict.fromkeys("abc", "100 V")), circle(20), SETTLED),
        "coil with inertia": (coil(), LINE, 'sample_rate = "5 kHz"\nduration = "0.1 s"\n'),
    }
    if name in stages:
        scenario, model = loaded(folder, *stages[name])
    else:
        scenario = load_scenario(SCENARIOS / ("flexure_axis_line" if name == "axis with inertia" else "circle20"))
        if name == "hexapod that creeps":
            (folder / "device.toml").write_text(DEVICE.read_text() + CREEP.replace('"axis"', '"1X"'))
            scenario = replace(scenario, device=load_device(folder / "device.toml"))
        if name == "constants of the start":
            scenario = replace(scenario, device=load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml"))
        model = build_model(scenario.device)
    return scenario, controller_of(model, scenario.file.follow, scenario.sample_time)


def folders_of(name: str, made: Path) -> list[Path]:
    """For each arithmetic, which the macros do not depend on, of the first device, and for float of the others: `limiter.h`,
    `generated.c` and `limiter_config.h`, the controller named limiter."""
    scenario, controller = controlled(name, made)
    folders = []
    for real in Real if name == DEVICES[0] else (Real.FLOAT,):
        context = online_context(scenario, controller, real, "limiter")
        folder = made / real.suffix
        folder.mkdir()
        write("online.h", context, folder / "limiter.h")
        write("online.c", context, folder / "generated.c")
        write("limiter_config.h", context, folder / "limiter_config.h")
        folders.append(folder)
    return folders


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Callable[[str], list[Path]]:
    """`folders_of` a device, made once."""
    return cache(lambda name: folders_of(name, tmp_path_factory.mktemp("limiter")))


def tokens(source: Path, folder: Path) -> list[str]:
    words = ["gcc", "-std=c99", "-E", "-P", f"-I{folder}", str(source)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    bare = re.sub(r"\blimiter_", "", without_type(done.stdout), flags=re.IGNORECASE)  # as limiter.c has its own names
    return re.findall(r"\w+|[^\w\s]", bare)


def without_type(text: str) -> str:
    """`text` with the type itself where limiter.c has a name for it, and without what tells that its constants are of that type."""
    text = re.sub(
        r"\btypedef char \w*constants_in_double\[[^;]*;", "", text
    )  # every generated file in double begins with that
    named = re.search(r"\btypedef (float|double) real;", text)
    return re.sub(r"\breal\b", named[1], text.replace(named[0], "")) if named else text


@pytest.mark.long
@pytest.mark.parametrize("name", DEVICES)
def test_the_generated_limiter_is_the_limiter_with_the_configuration_of_the_device(name, written):
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: its preprocessor was not compared")
    for folder in written(name):
        assert tokens(folder / "generated.c", folder) == tokens(LIMITER / "limiter.c", folder)


@pytest.mark.long
@pytest.mark.parametrize("name", DEVICES)
def test_the_limiter_compiles_as_it_stands_without_a_warning(name, compiler, written):
    for folder in written(name):
        words = [compiler, *FLAGS, f"-I{folder}", "-c", str(LIMITER / "limiter.c"), "-o", str(folder / "limiter.o")]
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


# Of the limiter, of the kernels and of C: names that a user may well give to a number
HOSTILE = (
    "input real limiter rate_limiter_gain N NU NX double state target value low high i t1 z x u out derive int constants derived hit "
    "READY TABLE_1 EACH_AXIS limit_composite status s_low wanted step REAL"
)


@pytest.mark.parametrize(
    "changing", [pytest.param(name, marks=pytest.mark.long) for name in ("input", "real", "limiter", "state", "N")]
)
def test_constants_may_have_any_name(changing, tmp_path):
    """Springs beside each other, one a name, each given at the start: the C compiles and passes its own test."""
    names = HOSTILE.split()
    device = user_device(
        "stage",
        parameters={"gain": "0.2 N/V"} | dict.fromkeys(names, f"{1 / len(names):.6g} N/um"),
        drive={"a": "100 V", "b": "100 V"},
        axes={"x": "50 um", "y": "50 um"},
        force=lambda u, p: [p.gain * u.a, p.gain * u.b],
        restoring_force=lambda d, p: sum(p[name] for name in names) * d.vector,
    )
    numbers = {path.rpartition(".")[2]: path for path, _ in device.quantities()}
    given = [{"number": numbers[name], "low": "0.03 N/um", "high": "0.04 N/um"} for name in names]
    run_time = RunTime.model_validate({"constants": given, "input": numbers[changing]})
    scenario, model = loaded(tmp_path, device.model_copy(update={"run_time": run_time}), circle(10, 10, 10))
    folder = generate(scenario, model, tmp_path / "c")
    for real in Real:
        sources = [*folder.sources(real), folder.runner(real)]
        build("gcc", sources, tmp_path / "test", f"-I{folder.path}")
        ran = subprocess.run([tmp_path / "test"], capture_output=True, text=True)
        assert ran.returncode == 0 and "vectors agree" in ran.stdout, ran.stdout[-2000:]


def test_a_macro_is_not_expanded_within_itself():
    macros = {"a": Macro("a + b"), "b": Macro("a"), "f": Macro("f(x)", ("x",))}
    assert resolved("a; b; f(1);", macros, lambda name: None).strip() == "a + a; a + b; f(1);"
