"""The generated folder as a package: it drops into C, C++, CMake, Zephyr, PlatformIO and Arduino projects, and tests itself there."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import SCENARIOS

from ctrlgen import InputError, __version__, build_model, generate, load_scenario, solve
from ctrlgen.figures import draw_all
from ctrlgen.firmware.cprint import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.package import verify_package

STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
SEMANTIC = re.compile(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)(-[0-9A-Za-z.-]+)?(\+[0-9A-Za-z.-]+)?")


def run(*words: object, cwd: Path | None = None) -> str:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, f"{words}: status {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def packages(tmp_path_factory, circle) -> dict[str, CFolder]:
    """Two different scenarios, solved."""
    scenario = load_scenario(SCENARIOS / "raster")
    raster = solve(scenario, build_model(scenario.device))
    out = tmp_path_factory.mktemp("packages")
    return {
        s.scenario.name: generate(s.scenario, s.model, out / s.scenario.name, s, draw_all(s)) for s in (circle, raster)
    }


@pytest.fixture(scope="module")
def unsolved(tmp_path_factory) -> CFolder:
    scenario = load_scenario(SCENARIOS / "spiral")
    return generate(scenario, build_model(scenario.device), tmp_path_factory.mktemp("spiral") / "spiral")


@pytest.fixture(scope="module")
def objects(packages, compiler, tmp_path_factory) -> dict[str, list[Path]]:
    """Scenario -> the objects of all its C at the root, in both arithmetics."""
    out = tmp_path_factory.mktemp("objects")
    built = {}
    for name, c in packages.items():
        built[name] = [out / f"{source.stem}.o" for source in sorted(c.path.glob("*.c"))]
        assert len(built[name]) == 8
        for made in built[name]:
            run(compiler, "-std=c99", *STRICT, "-O2", "-c", c.path / f"{made.stem}.c", "-o", made)
    return built


@pytest.fixture
def cpp(compiler) -> str:
    name = {"gcc": "g++", "clang": "clang++", "cc": "c++"}[compiler]
    if not shutil.which(name):
        pytest.skip(f"{name} is missing: nothing was built as C++; apt-get install g++")
    return name


@pytest.fixture
def cmake() -> str:
    if not shutil.which("cmake"):
        pytest.skip("cmake is missing: the CMake files were not run; apt-get install cmake")
    return "cmake"


def everything(packages: dict[str, CFolder]) -> str:
    """A main that includes every header of all packages, calls every piece and every selftest."""
    headers = [h.name for c in packages.values() for h in sorted(c.path.glob("*.h"))]
    calls = ""
    for k, (c, real) in enumerate((c, real) for c in packages.values() for real in Real):
        test, online, player, vectors = (names[real] for names in (c.selftest, c.online, c.player, c.vectors))
        calls += f"""    {{
        {test}_result r;
        {online}_state state;
        {online}_output out;
        {online}_init(&state);
        if ({online}_settle(&state, {vectors}_target[0], &out) != {vectors}_status[0]) {{ return {4 * k + 1}; }}
        if ({player}_sample({vectors}_played[0], out.drive) != 0) {{ return {4 * k + 2}; }}
        if (({test}(&r) != 0) || (r.compared != {test.upper()}_VECTORS)) {{ return {4 * k + 3}; }}
    }}
"""
    return "".join(f'#include "{h}"\n' for h in headers) + f"int main(void)\n{{\n{calls}    return 0;\n}}\n"


def test_all_controllers_of_two_scenarios_link_into_one_program_and_pass_their_tests(
    packages, objects, compiler, tmp_path
):
    (tmp_path / "main.c").write_text(everything(packages))
    include = [f"-I{c.path}" for c in packages.values()]
    linked = [o for made in objects.values() for o in made]
    run(compiler, "-std=c99", *STRICT, *include, tmp_path / "main.c", *linked, "-lm", "-o", tmp_path / "main")
    run(tmp_path / "main")


def test_the_same_from_cpp(packages, objects, cpp, tmp_path):
    (tmp_path / "main.cpp").write_text(everything(packages))
    include = [f"-I{c.path}" for c in packages.values()]
    linked = [o for made in objects.values() for o in made]
    run(cpp, "-std=c++17", *STRICT, *include, tmp_path / "main.cpp", *linked, "-lm", "-o", tmp_path / "main")
    run(tmp_path / "main")


def test_every_external_symbol_begins_with_the_scenarios_name(objects):
    if not shutil.which("nm"):
        pytest.skip("nm is missing: the symbols of the objects were not read; apt-get install binutils")
    seen: list[str] = []
    for name, made in objects.items():
        for path in made:
            defined = [
                line.split()[-1] for line in run("nm", "-g", "--defined-only", path).splitlines() if line.strip()
            ]
            assert defined and all(symbol.startswith(f"{path.stem}_") or symbol == path.stem for symbol in defined), (
                path
            )
            assert path.stem.startswith(f"{name}_")
            seen += defined
    assert len(seen) == len(set(seen))


def test_every_name_a_header_defines_begins_with_the_scenarios_name(packages):
    for name, c in packages.items():
        for header in c.path.glob("*.h"):
            macros = re.findall(r"^#define (\w+)", header.read_text(), re.MULTILINE)
            assert macros and all(macro.startswith(f"{name.upper()}_") for macro in macros), header.name


@pytest.mark.parametrize("standard", ["c99", "c11", "c++11", "c++17"])
def test_each_header_compiles_alone(packages, compiler, cpp, tmp_path, standard):
    main = tmp_path / ("alone.cpp" if "+" in standard else "alone.c")
    for header in sorted(packages["circle20"].path.glob("*.h")):
        main.write_text(f'#include "{header}"\n#include "{header}"\n')
        words = (cpp if "+" in standard else compiler, f"-std={standard}", *STRICT, "-fsyntax-only", main)
        run(*words)


def test_cmake_builds_tests_and_installs(packages, cmake, cpp, tmp_path):
    """At top level with its own tests; installed, another project finds it."""
    c = packages["circle20"]
    run(cmake, "-S", c.path, "-B", tmp_path / "b", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'usr'}")
    run(cmake, "--build", tmp_path / "b")
    assert "100% tests passed, 0 tests failed out of 2" in run("ctest", "--test-dir", tmp_path / "b")
    run(cmake, "--install", tmp_path / "b")
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "main.c").write_text(everything({"circle20": c}))
    (tmp_path / "p" / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(p C)\nenable_testing()\nfind_package(circle20 REQUIRED)\n"
        "add_executable(p main.c)\ntarget_link_libraries(p PRIVATE ctrlgen::circle20_f32 ctrlgen::circle20_f64)\n"
        "add_test(NAME p COMMAND p)\n"
    )
    run(cmake, "-S", tmp_path / "p", "-B", tmp_path / "pb", f"-DCMAKE_PREFIX_PATH={tmp_path / 'usr'}")
    run(cmake, "--build", tmp_path / "pb")
    assert "100% tests passed" in run("ctest", "--test-dir", tmp_path / "pb")


def test_two_packages_are_subdirectories_of_one_cpp_project(packages, cmake, cpp, tmp_path):
    """Which gets the targets, and neither their tests nor their install rules."""
    (tmp_path / "main.cpp").write_text(everything(packages))
    adds = "".join(f"add_subdirectory({c.path} {name})\n" for name, c in packages.items())
    links = " ".join(f"ctrlgen::{name}_{real.suffix}" for name in packages for real in Real)
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.16)\nproject(firmware CXX)\nenable_testing()\n{adds}"
        f"add_executable(firmware main.cpp)\ntarget_link_libraries(firmware PRIVATE {links})\n"
        "add_test(NAME selftests COMMAND firmware)\n"
    )
    run(cmake, "-S", tmp_path, "-B", tmp_path / "b")
    run(cmake, "--build", tmp_path / "b")
    assert "100% tests passed, 0 tests failed out of 1" in run("ctest", "--test-dir", tmp_path / "b")


ZEPHYR = """cmake_minimum_required(VERSION 3.16)
project(app C)
add_library(interface INTERFACE)
function(zephyr_include_directories)
  target_include_directories(interface INTERFACE ${ARGN})
endfunction()
function(zephyr_library_named name)
  add_library(${name} STATIC)
  target_link_libraries(${name} PUBLIC interface)
  set(ZEPHYR_CURRENT_LIBRARY ${name} PARENT_SCOPE)
endfunction()
function(zephyr_library_sources)
  target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
"""


@pytest.mark.parametrize("real", list(Real))
def test_the_zephyr_module_builds_with_stand_ins_for_zephyrs_functions(packages, cmake, tmp_path, real):
    """Zephyr itself is not run here: its four CMake functions that the module calls are."""
    text = ZEPHYR
    for name, c in packages.items():
        for option in ("", f"_{real.name}", "_SELFTEST"):
            text += f"set(CONFIG_{name.upper()}_CONTROLLER{option} y)\n"
        text += f"add_subdirectory({c.path}/zephyr {name})\n"
    text += f"add_executable(app main.c)\ntarget_link_libraries(app PRIVATE {' '.join(packages)} m)\n"
    (tmp_path / "CMakeLists.txt").write_text(text)
    calls = " + ".join(f"{c.selftest[real]}(0)" for c in packages.values())
    includes = "".join(f"#include <{c.selftest[real]}.h>\n" for c in packages.values())
    (tmp_path / "main.c").write_text(f"{includes}int main(void) {{ return {calls}; }}\n")
    run(cmake, "-S", tmp_path, "-B", tmp_path / "b")
    run(cmake, "--build", tmp_path / "b")
    run(tmp_path / "b" / "app")


def test_the_zephyr_module_says_what_zephyr_reads(packages):
    """Keys of scripts/zephyr_module.py: name, and the folder and the file that `build` names, which must be there."""
    for name, c in packages.items():
        lines = [line for line in (c.path / "zephyr" / "module.yml").read_text().splitlines() if line[:1] != "#"]
        assert lines == [f"name: {name}", "build:", "  cmake: zephyr", "  kconfig: zephyr/Kconfig"]
        assert (c.path / "zephyr" / "CMakeLists.txt").is_file()
        options = re.findall(r"^(?:config|choice) (\w+)$", (c.path / "zephyr" / "Kconfig").read_text(), re.MULTILINE)
        assert len(options) == 5 and all(option.startswith(f"{name.upper()}_CONTROLLER") for option in options)
        used = set(re.findall(r"CONFIG_(\w+)", (c.path / "zephyr" / "CMakeLists.txt").read_text()))
        assert used <= set(options)


def test_the_platformio_manifest_is_valid_and_builds_the_c_at_the_root(packages):
    for name, c in packages.items():
        manifest = json.loads((c.path / "library.json").read_text())
        assert {"name", "version", "description", "keywords", "authors"} <= set(manifest)
        assert (
            manifest["name"] == name and SEMANTIC.fullmatch(manifest["version"]) and len(manifest["description"]) < 1000
        )
        assert all((c.path / header).is_file() for header in manifest["headers"])
        (chosen,) = manifest["build"]["srcFilter"]
        built = {path.name for path in (c.path / manifest["build"]["srcDir"]).glob(chosen[2:-1])}
        assert built == {source.name for real in Real for source in c.sources(real)}


def test_the_arduino_manifest_has_every_required_field(packages):
    for name, c in packages.items():
        lines = (c.path / "library.properties").read_text().splitlines()
        fields = dict(line.split("=", 1) for line in lines if line)
        required = (
            "name",
            "version",
            "author",
            "maintainer",
            "sentence",
            "paragraph",
            "category",
            "url",
            "architectures",
        )
        assert all(fields.get(field) for field in required)
        assert fields["name"] == name and re.fullmatch(r"[A-Za-z0-9][\w .-]{0,62}", name)
        assert SEMANTIC.fullmatch(fields["version"]) and fields["version"] == __version__
        assert fields["category"] == "Device Control" and fields["url"].startswith("https://")
        assert all((c.path / header).is_file() for header in fields["includes"].split(","))


def test_the_arduino_sketch_builds_and_passes_with_a_stand_in_for_the_board(packages, objects, cpp, tmp_path):
    """A library without src/ is built from the C at its root, not from its subfolders."""
    c = packages["circle20"]
    assert not (c.path / "src").exists() and not (c.path / "utility").exists()
    (tmp_path / "Arduino.h").write_text(
        '#include <cstdio>\nstruct { void begin(long) {} void print(int v) { std::printf("%d", v); }\n'
        'void print(const char *t) { std::printf("%s", t); } void println(const char *t) { std::puts(t); } } Serial;\n'
    )
    (sketch,) = c.path.glob("examples/*/*.ino")
    assert sketch.stem == sketch.parent.name
    (tmp_path / "sketch.cpp").write_text(
        f'#include "Arduino.h"\n{sketch.read_text()}\nint main() {{ setup(); loop(); return 0; }}\n'
    )
    include = [f"-I{tmp_path}", f"-I{c.path}"]
    words = (cpp, "-std=c++11", *STRICT, *include, tmp_path / "sketch.cpp", *objects["circle20"], "-lm")
    run(*words, "-o", tmp_path / "sketch")
    assert run(tmp_path / "sketch") == "82 of 82 vectors agree\n"


def test_the_readmes_example_compiles_and_runs(packages, unsolved, compiler, tmp_path):
    for c in (*packages.values(), unsolved):
        (example,) = re.findall(r"```c\n(.*?)```", (c.path / "README.md").read_text(), re.DOTALL)
        assert len(example.splitlines()) <= 25
        (tmp_path / "example.c").write_text(example)
        source = c.path / f"{c.online[Real.FLOAT]}.c"
        words = (compiler, "-std=c99", *STRICT, f"-I{c.path}", tmp_path / "example.c", source, "-lm")
        run(*words, "-o", tmp_path / "example")
        assert len(re.findall(r"drive\[\d\] = [\d.e-]+ W", run(tmp_path / "example"))) == 6


def test_the_readme_states_units_limits_statuses_costs_and_provenance(packages, circle):
    c = packages["circle20"]
    text = (c.path / "README.md").read_text()
    for words in ("3: delta_x [m]", "0: 1X [W]", "temperature_3Y [K]", "wire flexure stress <= 550 MPa", "_STATE` 4", "1000 Hz",
                  f"{c.operations} arithmetic operations", f"{c.worst_operations} at most", circle.scenario.digest["device"],
                  "Mech. Mach. Theory", "calls on one state may not"):  # fmt: skip
        assert words in text, words
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", text)
    assert len(pictures) == 5 and all((c.path / picture).read_text().startswith("<svg") for picture in pictures)


def test_the_readme_of_an_unsolved_scenario_says_what_is_absent(unsolved):
    text = (unsolved.path / "README.md").read_text()
    assert "No player is here" in text and "No figures are here" in text and "_player_" not in text
    assert not list(unsolved.path.glob("*player*")) and not (unsolved.path / "figures").exists()


def test_the_readmes_sizes_are_those_of_the_compiled_c(packages, objects, compiler, tmp_path):
    c = packages["circle20"]
    text = (c.path / "README.md").read_text()
    stated = {
        m[0]: (int(m[1]), int(m[2])) for m in re.findall(r"^\| ([\w' ]+) \| (\d+) B \| (\d+) B \|", text, re.MULTILINE)
    }
    types = [f"{c.online[real]}_{kind}" for kind in ("state", "output") for real in (Real.FLOAT, Real.DOUBLE)]
    prints = "".join(f'    printf("%u\\n", (unsigned)sizeof({t}));\n' for t in types)
    headers = "".join(f'#include "{c.online[real]}.h"\n' for real in Real)
    (tmp_path / "m.c").write_text(f"{headers}#include <stdio.h>\nint main(void)\n{{\n{prints}    return 0;\n}}\n")
    run(compiler, f"-I{c.path}", tmp_path / "m.c", "-o", tmp_path / "m")
    assert list(map(int, run(tmp_path / "m").split())) == [*stated["state"], *stated["output"]]
    if not shutil.which("nm"):
        pytest.skip("nm is missing: the sizes of the tables were not read; apt-get install binutils")
    for piece, what in (("player", "player's table"), ("vectors", "vectors")):
        for real, size in zip((Real.FLOAT, Real.DOUBLE), stated[what], strict=True):
            (path,) = (o for o in objects["circle20"] if o.stem == getattr(c, piece)[real])
            rows = [line.split() for line in run("nm", "-S", path).splitlines()]
            constants = {row[3]: int(row[1], 16) for row in rows if len(row) == 4 and row[2] in "rR"}
            longs = sum(v for name, v in constants.items() if name.endswith("_played"))  # 8 bytes each on this computer
            assert sum(constants.values()) - longs // 2 == size, (piece, real)


def test_the_copied_inputs_make_the_same_c_again(packages, tmp_path):
    c = packages["raster"]
    scenario = load_scenario(c.path / "device" / "raster")
    again = generate(scenario, build_model(scenario.device), tmp_path)
    for real in Real:
        for suffix in ("h", "c"):
            name = f"{c.online[real]}.{suffix}"
            assert (again.path / name).read_bytes() == (c.path / name).read_bytes()


def test_poses_from_a_file_and_absolute_paths_are_copied_too(tmp_path):
    home = tmp_path / "bench" / "walk"
    home.mkdir(parents=True)
    device = SCENARIOS.resolve() / "devices" / "mems_hexapod.toml"
    (home / "poses.csv").write_text("delta_z [um]\n20\n21\n")
    (home / "scenario.toml").write_text(
        f'title = "walk"\ndevice = "{device}"\nsample_rate = "1 kHz"\n[path]\nkind = "poses"\nfile = "poses.csv"\n'
    )
    scenario = load_scenario(home)
    c = generate(scenario, build_model(scenario.device), tmp_path / "c")
    found = {p.relative_to(c.path / "device").as_posix() for p in (c.path / "device").rglob("*") if p.is_file()}
    assert found == {"walk/scenario.toml", "walk/poses.csv", "mems_hexapod.toml"}


def test_the_manifest_tells_a_spoiled_file(packages, tmp_path):
    folder = tmp_path / "circle20"
    shutil.copytree(packages["circle20"].path, folder)
    assert verify_package(folder) == ()
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert files == {*manifest["files"], "manifest.json"} and "belongs to the user" in manifest["licence"]
    (folder / "build").mkdir()
    (folder / "build" / "a.c").write_text("")  # a build may stand there
    spoiled = folder / "circle20_online_f32.c"
    spoiled.write_text(spoiled.read_text().replace("5.5e-05f", "5.6e-05f", 1))
    (folder / "device" / "circle20" / "scenario.toml").unlink()
    (folder / "mine.c").write_text("")
    assert {(f.where, f.what.split(";")[0]) for f in verify_package(folder)} == {
        ("circle20_online_f32.c", "was changed since it was generated"),
        ("device/circle20/scenario.toml", "is missing"),
        ("mine.c", "was added"),
    }
    (folder / "manifest.json").write_text("{}")
    with pytest.raises(InputError, match="no manifest of ctrlgen"):
        verify_package(folder)


def test_the_same_input_gives_the_same_bytes_of_everything(packages, circle, tmp_path):
    again = generate(circle.scenario, circle.model, tmp_path, circle, draw_all(circle))
    first = packages["circle20"].path
    names = sorted(p.relative_to(first) for p in first.rglob("*") if p.is_file())
    assert names == sorted(p.relative_to(again.path) for p in again.path.rglob("*") if p.is_file())
    for name in names:
        assert (first / name).read_bytes() == (again.path / name).read_bytes(), name


@pytest.mark.parametrize(
    ("piece", "pattern", "replacement"),
    [
        ("online", r"Z_HIGH\[6\] = \{ 5\.5e-05f", "Z_HIGH[6] = { 5.6e-05f"),
        ("online", r"int status = 0;", "int status = 64;"),
        ("player", r"(TABLE\[1000\]\[6\] = \{\n    \{ 0\.\d)(\d)", r"\g<1>0"),
    ],
)
def test_the_selftest_finds_a_wrong_constant(packages, compiler, tmp_path, piece, pattern, replacement):
    c = packages["circle20"]
    folder = tmp_path / "c"
    shutil.copytree(c.path, folder)
    spoiled = folder / f"{getattr(c, piece)[Real.FLOAT]}.c"
    text, count = re.subn(pattern, replacement, spoiled.read_text(), count=1)
    assert count == 1 and text != spoiled.read_text()
    spoiled.write_text(text)
    sources = [folder / source.name for source in c.sources(Real.FLOAT)]
    runner = folder / "test" / c.runner(Real.FLOAT).name
    run(compiler, "-std=c99", *STRICT, f"-I{folder}", runner, *sources, "-lm", "-o", tmp_path / "t")
    done = subprocess.run([tmp_path / "t"], capture_output=True, text=True)
    assert done.returncode == 1 and "the first that disagrees: vector" in done.stdout
