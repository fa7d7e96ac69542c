"""The generated C: same bytes, strict builds, true float, equal to two references, safe on bad calls."""

from __future__ import annotations

import difflib
import hashlib
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import three_stacks
from conftest import ROOT, SCENARIOS
from one_kernel import print_function

from ctrlgen import CtrlgenError, __version__, build_model, load_scenario
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import ABI, hertz, render
from ctrlgen.firmware.c.toolchains import FLAGS
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
NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?|-?\d+e[+-]?\d+")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, circle):
    out = tmp_path_factory.mktemp("c")
    return generate(circle.scenario, circle.model, out, circle)


def build(compiler: str, sources: list[Path], out: Path, *more: str) -> None:
    done = subprocess.run([compiler, *FLAGS, *more, *map(str, sources), "-o", str(out)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


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
            calls = re.findall(r"(?<!static int )\blimit_all\((.*)\);", text)
            assert all(re.search(r", \d+$", call) for call in calls)
            assert bool(calls) == any("count" in loop for loop in loops)
            build(compiler, [folder.path / f"{name}.c"], tmp_path / "o.o", "-c")
            if shutil.which("nm"):
                table = subprocess.run(["nm", str(tmp_path / "o.o")], capture_output=True, text=True, check=True).stdout
                assert not re.search(r" [BbDdC] ", table), f"{real}: writable data\n{table}"


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
    wrong, count = re.subn(r"(\(\w+\[i\]\[5\] \* target_5\))", rf"({factor} * \g<1>)", text, count=1)
    assert count == 1
    broken.write_text(wrong)
    build(compiler, [broken, *others], tmp_path / "bad", f"-I{folder.path}")
    assert subprocess.run([tmp_path / "bad"], capture_output=True).returncode == 1


@pytest.mark.long
@pytest.mark.parametrize(
    "option",
    [*(pytest.param(word, marks=pytest.mark.exhaustive) for word in ("-ffast-math", "-Ofast")), "-ffinite-math-only"],
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
        a + b, a - b, a * b, a / b, -a, a * a, 2 * a, 1 / a, ca.fmin(a, b), ca.fmax(a, b), ca.fabs(-a), ca.sign(a - b), ca.sqrt(a),
        ca.exp(a), ca.log(a), ca.sin(a), ca.cos(a), ca.tan(a), ca.asin(a / 4), ca.acos(a / 4), ca.atan(a), ca.tanh(a), a**2.5,
        ca.atan2(a, b),
        a < b, a <= b, ca.eq(a, b), ca.ne(a, b), ca.logic_and(a, b), ca.logic_or(a, b), ca.logic_not(a), 
        ca.if_else(a < b, a, b), ca.floor(a),
        ca.ceil(a), 0 * b + 3.25, ca.sinh(a), ca.cosh(a), a**b, (-a)**3, a**-3, a**7, a**-1.5, a**0.3, (-a)**17,
    )  # fmt: skip
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


def test_null_and_hostile_calls_are_safe(folder, compiler, tmp_path):
    """NULL pointers, a state of garbage, times and indices out of range: a status and admissible drives."""
    online, player = folder.online[Real.FLOAT], folder.player[Real.FLOAT]
    (tmp_path / "main.c").write_text(f"""
#include "{online}.h"
#include "{player}.h"
#include <stddef.h>
int main(void)
{{
    {online}_state s;
    {online}_output o;
    const float up[6] = {{ 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f }};
    const float zero = 0.0f;
    const float nan = zero / zero;
    float u[6];
    int i;
    {online}_init(NULL);
    if ({online}_step(NULL, up, &o) != {online.upper()}_INPUT) {{ return 1; }}
    {online}_init(&s);
    if ({online}_step(&s, NULL, &o) != {online.upper()}_INPUT) {{ return 2; }}
    if ({online}_step(&s, up, NULL) != {online.upper()}_INPUT) {{ return 3; }}
    for (i = 0; i < 6; i++) {{ s.x[i] = nan; s.z[i] = nan; }}
    if ({online}_step(&s, up, &o) != {online.upper()}_LOST) {{ return 4; }}
    for (i = 0; i < 6; i++) {{ if (o.drive[i] != 0.0f) {{ return 5; }} }}
    if ({player}_at(nan, u) != {player.upper()}_INPUT) {{ return 6; }}
    if ({player}_at(-1.0f, u) != {player.upper()}_INPUT) {{ return 7; }}
    if ({player}_at(1e30f, u) != {player.upper()}_INPUT) {{ return 8; }}
    if ({player}_at(0.9999f, u) != 0) {{ return 9; }}
    if ({player}_sample(4000000000U, u) != 0) {{ return 10; }}
    if ({player}_sample(0U, NULL) != {player.upper()}_INPUT) {{ return 11; }}
    return 0;
}}
""")
    sources = [tmp_path / "main.c", folder.path / f"{online}.c", folder.path / f"{player}.c"]
    build(compiler, sources, tmp_path / "main", f"-I{folder.path}", "-fsanitize=undefined", "-fno-sanitize-recover=all")
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True)
    assert done.returncode == 0, (done.returncode, done.stderr)


def test_a_lost_state_is_told_and_stays_so_until_it_is_initialised(folder, compiler, tmp_path):
    """NaN or an absurd temperature in one place, a struct of zeros or of any repeated byte; by step and by settle."""
    online = folder.online[Real.FLOAT]
    (tmp_path / "main.c").write_text(f"""
#include "{online}.h"
#include <math.h>
#include <string.h>
#define LOST {online.upper()}_LOST
static const float up[6] = {{ 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f }};
static {online}_output o;
static int stays_lost({online}_state *s)
{{
    const {online}_state before = *s;
    int i;
    if ({online}_step(s, up, &o) != LOST) {{ return 0; }}
    for (i = 0; i < 6; i++) {{ if (o.drive[i] != 0.0f || o.displacement[i] != 0.0f || o.state[i] != 295.15f) {{ return 0; }} }}
    if (memcmp(s->x, before.x, sizeof s->x) != 0 || memcmp(s->z, before.z, sizeof s->z) != 0) {{ return 0; }}
    {online}_state healed = *s; /* numbers alone do not help */
    for (i = 0; i < 6; i++) {{ healed.x[i] = 295.15f; healed.z[i] = 0.0f; }}
    if ({online}_step(&healed, up, &o) != LOST || {online}_settle(&healed, up, &o) != LOST) {{ return 0; }}
    {online}_init(s);
    return {online}_settle(s, up, &o) == 0U && {online}_step(s, up, &o) == 0U && o.drive[0] > 0.0f;
}}
int main(void)
{{
    static const float bad[] = {{ NAN, INFINITY, -INFINITY, 1e4f, -1e4f, 1e30f }};
    {online}_state s;
    unsigned i, k;
    for (i = 0; i < 256; i++) {{ (void)memset(&s, (int)i, sizeof s); if (!stays_lost(&s)) {{ return 1; }} }}
    for (i = 0; i < 6; i++) {{
        for (k = 0; k < 6; k++) {{
            {online}_init(&s);
            if ({online}_settle(&s, up, &o) != 0U) {{ return 2; }}
            s.x[i] = bad[k];
            if (!stays_lost(&s)) {{ return 3; }}
            {online}_init(&s);
            s.z[i] = bad[k]; /* no answer of this device depends on it: repaired, or told where a limit is met */
            if ({online}_settle(&s, up, &o) != 0U || !(s.z[i] > 0.0f && s.z[i] < 1e-4f)) {{ return 4; }}
        }}
    }}
    return 0;
}}
""")
    build(compiler, [tmp_path / "main.c", folder.path / f"{online}.c"], tmp_path / "main", f"-I{folder.path}")
    assert subprocess.run([tmp_path / "main"]).returncode == 0


def test_two_controllers_link_into_one_program(folder, compiler, tmp_path):
    scenario = load_scenario(SCENARIOS / "rrr_circle")
    other = generate(scenario, build_model(scenario.device), tmp_path / "rrr")
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    sources = [folder.path / f"{name}.c" for name in (*folder.online.values(), *folder.player.values())]
    sources += [other.path / f"{name}.c" for name in other.online.values()]
    build(compiler, [tmp_path / "main.c", *sources], tmp_path / "main")


@pytest.mark.long
def test_two_trajectories_of_one_device_and_rate_have_the_same_online_controller(folder, circle, tmp_path):
    spiral, raster = (load_scenario(SCENARIOS / name) for name in ("spiral", "raster"))
    same, slower = (generate(s, build_model(s.device), tmp_path / s.name) for s in (spiral, raster))
    for real in Real:
        for ending in ("h", "c"):
            here, there, elsewhere = (
                (c.path / f"{c.online[real]}.{ending}").read_bytes() for c in (folder, same, slower)
            )
            assert here == there
            assert ending == "c" or here != elsewhere  # 500 Hz instead of 1 kHz
    for name in (circle.scenario.name, spiral.name):
        assert name not in (folder.path / f"{folder.online[Real.FLOAT]}.h").read_text()


@pytest.mark.long
def test_controllers_of_one_device_at_two_rates_with_two_names_link_into_one_program(
    folder, circle, compiler, tmp_path
):
    """Both controllers and both plants; each has the rate of its own."""
    text = circle.scenario.inputs["scenario"].text.replace("../devices", str(SCENARIOS / "devices"))
    text = text.replace('sample_rate = "1 kHz"', 'sample_rate = "2 kHz"\ncontroller = "fast_hexapod"')
    (tmp_path / "scenario.toml").write_text(text)
    scenario = load_scenario(tmp_path)
    fast = generate(scenario, build_model(scenario.device), tmp_path / "fast")
    names = [folder.online[Real.FLOAT], fast.online[Real.FLOAT]]
    plants = [write_plant(s, plant_of(s), Real.FLOAT, tmp_path) for s in (circle.scenario, scenario)]
    assert names == ["mems_hexapod_online_f32", "fast_hexapod_online_f32"]
    assert plants == ["mems_hexapod_plant_f32", "fast_hexapod_plant_f32"]
    headers = "\n".join(f'#include "{name}.h"' for name in (*names, *plants))
    calls = "\n".join(
        f"""    {{
        static {name}_state state;
        {name}_output out;
        {name}_init(&state);
        if (({name.upper()}_RATE_HZ != {rate}U) || ({name}_step(&state, target, &out) == {name.upper()}_LOST)) {{ return {rate}; }}
    }}"""
        for name, rate in zip(names, (1000, 2000), strict=True)
    )
    target = "static const float target[6] = { 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 2e-5f };"
    (tmp_path / "main.c").write_text(f"{headers}\n{target}\nint main(void)\n{{\n{calls}\n    return 0;\n}}\n")
    sources = [folder.path / f"{names[0]}.c", fast.path / f"{names[1]}.c", *(tmp_path / f"{name}.c" for name in plants)]
    build(
        compiler,
        [tmp_path / "main.c", *sources],
        tmp_path / "main",
        f"-I{folder.path}",
        f"-I{fast.path}",
        f"-I{tmp_path}",
    )
    assert subprocess.run([tmp_path / "main"]).returncode == 0
    for text in ("README.md", "library.properties", "zephyr/Kconfig"):
        assert "mems_hexapod_online" not in (fast.path / text).read_text()


@pytest.mark.parametrize("piece", ["online", "player", "plant"])
def test_a_firmware_can_pin_the_interface_at_compile_time(piece, folder, circle, tmp_path):
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: _Static_assert was not compiled")
    write_plant(circle.scenario, plant_of(circle.scenario), Real.FLOAT, tmp_path)
    name = "mems_hexapod_plant_f32" if piece == "plant" else getattr(folder, piece)[Real.FLOAT]
    source = circle.scenario.inputs["device"].path.read_bytes()
    right = {
        "ABI": f"{ABI}U",
        "DEVICE_HASH": f"0x{hashlib.sha256(source).hexdigest()[:8]}U",
        "RATE_HZ": "1000U",
        "DRIVE_SIZE": "6U",
    }
    right |= {
        "online": {"TARGET_SIZE": "6U", "STATE_SIZE": "6U", "DISPLACEMENT_SIZE": "6U"},
        "player": {"SAMPLES": "1000U", "SCENARIO_HASH": f"0x{circle.scenario.digest['scenario'][:8]}U"},
        "plant": {"MODEL_STATE_SIZE": "6U", "POSE_SIZE": "6U"},
    }[piece]

    def compiles(macro: str, value: str) -> bool:
        asserted = f'_Static_assert({name.upper()}_{macro} == {value}, "{macro}");'
        version = f"static const char version[] = {name.upper()}_VERSION; int main(void) {{ return version[0] == 0; }}"
        (tmp_path / "main.c").write_text(f'#include "{name}.h"\n{asserted}\n{version}\n')
        words = [
            "gcc",
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Werror",
            f"-I{folder.path}",
            f"-I{tmp_path}",
            "-fsyntax-only",
            "main.c",
        ]
        return subprocess.run(words, cwd=tmp_path, capture_output=True).returncode == 0

    for macro, value in right.items():
        assert compiles(macro, value), macro
        assert not compiles(macro, f"{value} + 1U"), macro


def test_a_rate_that_is_no_whole_number_stays_one():
    assert hertz(1 / (1 / 44100.0), Real.FLOAT) == "44100U" and hertz(None, Real.FLOAT) == "0U"
    assert hertz(0.25, Real.FLOAT) == "0.25f" and hertz(1000.5, Real.DOUBLE) == "1000.5"


def test_headers_state_names_units_limits_and_provenance(folder, circle):
    text = (folder.path / f"{folder.online[Real.FLOAT]}.h").read_text()
    for words in ("theta_x [rad]", "delta_z [m]", "1X [W]", "1000 Hz", "22 degC <= actuator temperature <= 550 degC",
                  "wire flexure stress <= 550 MPa", circle.scenario.device_sha256[:16], "Mech. Mach. Theory"):  # fmt: skip
        assert words in text, words


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
