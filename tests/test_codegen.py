"""The generated C: same bytes, strict builds, true float, equal to two references, safe on bad calls."""

from __future__ import annotations

import difflib
import importlib.util
import re
import shutil
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
import three_stacks
from conftest import ROOT, SCENARIOS
from one_kernel import print_function
from package_programs import build

from ctrlgen import CtrlgenError, __version__, build_model, load_scenario
from ctrlgen.controller import named_inverse
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render
from ctrlgen.firmware.fmi.fmu import write_fmus
from ctrlgen.firmware.fmi.plant import plant_of, write_plant
from ctrlgen.firmware.folder import generate, write_harness
from ctrlgen.firmware.online.online import online_context
from ctrlgen.version import program

GOLDEN = [
    *(f"golden/{d}/{d}_online_f32.{end}" for d in ("mems_hexapod", "flexure_axis", "three_stacks") for end in "ch"),
    "golden/limiter/limiter.h",
    "golden/limiter/limiter_config.h",
]
NUMBER = re.compile(r"(?<![\w.])(?:-?\d+\.\d+(?:e[+-]?\d+)?|-?\d+e[+-]?\d+)")


@pytest.fixture(scope="module")
def folder(circle_c):
    return circle_c


@pytest.mark.long
def test_the_same_input_gives_the_same_bytes(folder, circle, tmp_path):
    again = generate(circle.scenario, build_model(circle.scenario.device), tmp_path, circle)
    for path in (p for p in sorted(folder.path.rglob("*")) if p.is_file()):
        assert path.read_bytes() == (again.path / path.relative_to(folder.path)).read_bytes(), path.name


@pytest.fixture(scope="module")
def online_f32(circle, tmp_path_factory) -> dict[str, str]:
    """What is committed of generated C, in float: the controllers of three devices of different shape, and what codegen/limiter is
    compiled with where it is compiled as it stands."""
    made, folder = {}, tmp_path_factory.mktemp("golden")
    axis = load_scenario(SCENARIOS / "flexure_axis_line")
    stacks = three_stacks.loaded(folder, three_stacks.stage(drive_rate={"a": "5 V/ms"}), three_stacks.circle(20))
    devices = {
        "golden/mems_hexapod/mems_hexapod": (circle.scenario, circle.model),
        "golden/flexure_axis/flexure_axis": (axis, build_model(axis.device)),
        "golden/three_stacks/three_stacks": stacks,
    }
    for path, (scenario, model) in devices.items():
        controller = controller_of(model, scenario.file.follow, scenario.sample_time)
        name = f"{path.rpartition('/')[2]}_online_f32"
        context = online_context(scenario, controller, Real.FLOAT, name)
        made |= {f"{path}_online_f32.{end}": render(f"online.{end}", context) for end in "ch"}
    controller = controller_of(circle.model, "pose", circle.scenario.sample_time)
    context = online_context(circle.scenario, controller, Real.FLOAT, "limiter")
    made["golden/limiter/limiter.h"] = render("online.h", context)
    made["golden/limiter/limiter_config.h"] = render("limiter_config.h", context)
    return made


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_c_is_what_is_generated(online_f32, name, request):
    """Words exactly, constants to two roundings of a float, since libraries differ in the last digit between machines.

    Golden files state the version alone: with the commit each commit would have to change them.
    """
    path = ROOT / "codegen" / name
    assert program() in online_f32[name]
    new = online_f32[name].replace(program(), f"ctrlgen {__version__}")
    if request.config.getoption("--update-golden"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(new)
    old = path.read_text()
    same_words = NUMBER.sub("#", old) == NUMBER.sub("#", new)
    numbers = [np.array(NUMBER.findall(text), dtype=float) for text in (old, new)]
    if not same_words or not np.allclose(*numbers, rtol=3e-7, atol=0):
        diff = "".join(difflib.unified_diff(old.splitlines(True), new.splitlines(True), "golden", "generated", n=1))
        pytest.fail(f"{name} changed; if that is meant: pytest tests/test_codegen.py --update-golden\n{diff[:3000]}")


@pytest.mark.long
def test_the_golden_controller_is_the_one_of_the_generated_folder(folder, online_f32):
    for end in "ch":
        text = (folder.path / f"mems_hexapod_online_f32.{end}").read_text()
        assert text == online_f32[f"golden/mems_hexapod/mems_hexapod_online_f32.{end}"]


def test_float_c_knows_no_double(folder):
    for path in folder.path.glob("*_f32.[ch]"):
        text = re.sub(r'/\*.*?\*/|"[^"\n]*"', "", path.read_text(), flags=re.DOTALL)
        assert "double" not in text, path.name
        bare = [m[0] for m in NUMBER.finditer(text) if text[m.end()] != "f"]
        assert not bare, (path.name, bare[:3])


def test_float_objects_call_no_library(folder, compiler, tmp_path):
    if not shutil.which("nm"):
        pytest.skip("nm (binutils) is missing: the symbols of the float objects were not read")
    for name in (folder.online[Real.FLOAT], folder.player[Real.FLOAT]):
        build(compiler, [folder.path / f"{name}.c"], tmp_path / "o.o", "-c")
        symbols = subprocess.run(["nm", "-u", str(tmp_path / "o.o")], capture_output=True, text=True, check=True).stdout
        wanted = set(symbols.split()) - {"U", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}
        assert not wanted, wanted


def test_no_heap_no_globals_no_recursion_no_unbounded_loops(folder, compiler, tmp_path):
    for names in (folder.online, folder.player):
        for real, name in names.items():
            text = (folder.path / f"{name}.c").read_text()
            assert not re.search(
                r"\b(malloc|calloc|realloc|free|while|goto|do)\b", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
            )
            # a function that loops over `count` numbers is told how many, by a number, wherever it is called
            loops = re.findall(r"for \((.*?)\)", text)
            assert all(re.fullmatch(r"\w+ = 0; \w+ < (\d+|count); \w+\+\+", loop) for loop in loops)
            calls = re.findall(r"(?<!static int )\b\w+_limit_all\((.*)\);", text)
            assert all(re.search(r", \d+$", call) for call in calls)
            assert bool(calls) == any("count" in loop for loop in loops)
            build(compiler, [folder.path / f"{name}.c"], tmp_path / "o.o", "-c")
            if shutil.which("nm"):
                table = subprocess.run(["nm", str(tmp_path / "o.o")], capture_output=True, text=True, check=True).stdout
                assert not re.search(r" [BbDdC] ", table), f"{real}: writable data\n{table}"


@pytest.mark.long
@pytest.mark.parametrize("real", list(Real))
def test_the_shipped_test_of_reference_vectors_passes_and_can_fail(folder, compiler, tmp_path, real):
    online, *others = folder.sources(real)
    others.append(folder.runner(real))
    build(compiler, [online, *others], tmp_path / "good", f"-I{folder.path}")
    good = subprocess.run([tmp_path / "good"], capture_output=True, text=True)
    assert good.returncode == 0 and re.match(r"(\d{3}) of \1 vectors agree", good.stdout)
    broken = tmp_path / f"{folder.online[real]}.c"
    text = online.read_text()
    factor = real.literal(1.00001 if real is Real.DOUBLE else 1.0003)  # float: above four roundings of the temperature
    wrong, count = re.subn(r"(\(\d[\w.+-]* \* target_5\))", rf"({factor} * \g<1>)", text, count=1)
    assert count == 1
    broken.write_text(wrong)
    build(compiler, [broken, *others], tmp_path / "bad", f"-I{folder.path}")
    assert subprocess.run([tmp_path / "bad"], capture_output=True).returncode == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "option",
    [pytest.param("-ffast-math", marks=pytest.mark.exhaustive), "-Ofast", "-ffinite-math-only"],
)
def test_every_generated_source_refuses_arithmetic_without_nan(folder, circle, compiler, tmp_path, option):
    """A header may be included from code that is compiled so: it holds declarations only."""
    write_harness(folder, circle.scenario, circle.model, Real.FLOAT, tmp_path / "harness.c")
    write_plant(circle.scenario, plant_of(circle.scenario), Real.FLOAT, tmp_path)
    for fmi in (2, 3):
        write_fmus(circle.scenario, tmp_path / f"fmi{fmi}", fmi)
        for unit in list((tmp_path / f"fmi{fmi}").glob("*.fmu")):
            shutil.unpack_archive(unit, tmp_path / f"fmi{fmi}" / unit.stem, "zip")
    sources = [*folder.path.rglob("*.c"), *tmp_path.rglob("*.c")]
    compilers = [[compiler]]
    if importlib.util.find_spec("ziglang") and option != "-Ofast":  # which zig takes for -O3
        compilers.append([sys.executable, "-m", "ziglang", "cc"])  # clang
    for source in sources:
        for words in compilers:
            command = [*words, "-std=c99", f"-I{folder.path}", "-c", str(source), "-o", str(tmp_path / "o.o")]
            assert subprocess.run(command, capture_output=True).returncode == 0, source.name
            refused = subprocess.run([*command, option], capture_output=True, text=True)
            assert refused.returncode != 0 and "they remove the checks for NaN" in refused.stderr, source.name
    assert len(sources) == 8 + 2 + 1 + 1 + 8


def test_casadis_own_c_is_a_second_reference(circle, compiler, tmp_path):
    """CasADi's generator and ours from the same graph, in double: roots are ours, and numbers that multiply are gathered."""
    controller = controller_of(circle.model, "pose", 1e-3)
    generator = ca.CodeGenerator("reference.c")
    kernels = [getattr(controller.kernels.moving, part) for part in ("displacement", "state", "drive", "advance")] + [
        controller.kernels.composite_ratio
    ]
    for kernel in kernels:
        generator.add(kernel)
    generator.generate(f"{tmp_path}/")
    subprocess.run(
        [
            compiler,
            "-O1",
            "-shared",
            "-fPIC",
            str(tmp_path / "reference.c"),
            "-lm",
            "-o",
            str(tmp_path / "reference.so"),
        ],
        check=True,
    )
    rng = np.random.default_rng(3)
    for kernel in kernels:
        ours = print_function(kernel, "ours", Real.DOUBLE)
        inputs = [
            rng.uniform(0.2, 0.9, kernel.size1_in(i)) * (300 if kernel.name_in(i) in ("x", "state") else 4e-5)
            for i in range(kernel.n_in())
        ]
        main = "#include <stdio.h>\n#include <stdint.h>\n" + elementary_text(ours.calls, Real.DOUBLE) + ours.text
        main += "int main(void) {\n"
        for i in range(kernel.n_in()):
            if kernel.name_in(i) in ours.arguments:
                main += (
                    f"static const double {kernel.name_in(i)}[] = {{{', '.join(repr(float(v)) for v in inputs[i])}}};\n"
                )
        size = kernel.size1_out(0)
        main += f"double result[{size}]; {ours.call('result', **{a: a for a in ours.arguments})}; int i;\n"
        main += f'for (i = 0; i < {size}; i++) (void)printf("%.17g\\n", result[i]); return 0; }}\n'
        (tmp_path / "ours.c").write_text(main)
        subprocess.run(
            [compiler, "-std=c99", "-O1", str(tmp_path / "ours.c"), "-o", str(tmp_path / "ours")], check=True
        )
        printed = np.array(
            subprocess.run([tmp_path / "ours"], capture_output=True, text=True, check=True).stdout.split(), dtype=float
        )
        theirs = ca.external(kernel.name(), str(tmp_path / "reference.so"))(*inputs).full().ravel()
        assert printed == pytest.approx(theirs, rel=1e-13), kernel.name()  # some 100 roundings in a row


@pytest.mark.parametrize("real", list(Real))
def test_every_operation_prints_what_casadi_computes(real, compiler, tmp_path):
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    expressions = ca.vertcat(
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        a * a,
        2 * a,
        1 / a,
        ca.fmin(a, b),
        ca.fmax(a, b),
        ca.fabs(-a),
        ca.sign(a - b),
        ca.sqrt(a),
        ca.exp(a),
        ca.log(a),
        ca.sin(a),
        ca.cos(a),
        ca.tan(a),
        ca.asin(a / 4),
        ca.acos(a / 4),
        ca.atan(a),
        ca.tanh(a),
        a**2.5,
        ca.atan2(a, b),
        a < b,
        a <= b,
        ca.eq(a, b),
        ca.ne(a, b),
        ca.logic_and(a, b),
        ca.logic_or(a, b),
        ca.logic_not(a),
        ca.if_else(a < b, a, b),
        ca.floor(a),
        ca.ceil(a),
        0 * b + 3.25,
        ca.sinh(a),
        ca.cosh(a),
        a**b,
        (-a) ** 3,
        a**-3,
        a**7,
        a**-1.5,
        a**0.3,
        (-a) ** 17,
    )
    f = ca.Function("f", [a, b], [expressions], ["a", "b"], ["r"])
    kernel = print_function(f, "f", real)
    n = f.size1_out(0)
    text = f"#include <stdio.h>\n#include <stdint.h>\n{elementary_text(kernel.calls, real)}{kernel.text}"
    text += f"int main(void) {{ const {real.value} a[1] = {{{real.literal(1.3)}}}; "
    text += f"const {real.value} b[1] = {{{real.literal(0.7)}}}; {real.value} r[{n}]; int i; {kernel.call('r', a='a', b='b')}; "
    text += f'for (i = 0; i < {n}; i++) {{ (void)printf("%.17g\\n", (double)r[i]); }} return 0; }}\n'
    (tmp_path / "f.c").write_text(text)
    build(compiler, [tmp_path / "f.c"], tmp_path / "f")
    printed = np.array(
        subprocess.run([tmp_path / "f"], capture_output=True, text=True, check=True).stdout.split(), dtype=float
    )
    expected = f(np.float32(1.3), np.float32(0.7)) if real is Real.FLOAT else f(1.3, 0.7)
    assert printed == pytest.approx(expected.full().ravel(), rel=1e-15 if real is Real.DOUBLE else 5e-7, abs=0)


def test_an_output_may_be_an_input(compiler, tmp_path):
    """All outputs are stored last, so state = f(state) is not read half new: a shift register, turned by one."""
    x = ca.SX.sym("x", 4)
    shifted = ca.vertcat(x[3], x[0], x[1], x[2] + x[0])
    kernel = print_function(ca.Function("shift", [x], [shifted], ["x"], ["r"]), "shift", Real.DOUBLE)
    main = "int main(void) { double x[4] = { 1.0, 2.0, 3.0, 4.0 }; shift(x, x); "
    main += "return ((x[0] == 4.0) && (x[1] == 1.0) && (x[2] == 2.0) && (x[3] == 4.0)) ? 0 : 1; }"
    (tmp_path / "main.c").write_text(f"{kernel.text}{main}\n")
    build(compiler, [tmp_path / "main.c"], tmp_path / "main", "-Wno-restrict")
    assert subprocess.run([tmp_path / "main"]).returncode == 0


def test_a_constant_beyond_float_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(CtrlgenError, match="does not fit a float"):
        print_function(ca.Function("f", [x], [x * 1e-60], ["x"], ["r"]), "f", Real.FLOAT)
    with pytest.raises(CtrlgenError, match="cannot be written"):
        print_function(ca.Function("f", [x], [x * float("inf")], ["x"], ["r"]), "f", Real.DOUBLE)


def test_headers_state_names_units_limits_and_provenance(folder, circle):
    text = (folder.path / f"{folder.online[Real.FLOAT]}.h").read_text()
    for words in (
        "theta_x [rad]",
        "delta_z [m]",
        "1X [W]",
        "1000 Hz",
        "22 degC <= actuator temperature <= 550 degC",
        "wire flexure stress <= 550 MPa",
        circle.scenario.device_sha256[:16],
        "Mech. Mach. Theory",
    ):
        assert words in text, words


@pytest.mark.long
def test_the_cmake_project_builds_and_its_test_passes(folder, tmp_path):
    if not shutil.which("cmake"):
        pytest.skip("cmake is missing: the generated CMake project was not built")
    for command in (
        ["cmake", "-S", folder.path, "-B", tmp_path],
        ["cmake", "--build", tmp_path],
        ["ctest", "--test-dir", tmp_path],
    ):
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed" in done.stdout


def test_formulas_that_nobody_could_read_are_left_out_and_the_numbers_stay(monkeypatch):
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    found = []
    for most in (named_inverse.MOST_OPERATIONS, 0):
        monkeypatch.setattr(named_inverse, "MOST_OPERATIONS", most)
        found.append(named_inverse.named_inverses(scenario.device, "pose", None))
    assert found[0].static is not None and found[0].numbers
    assert found[1].static is None and not found[1].numbers and found[1].model.axes == found[0].model.axes
